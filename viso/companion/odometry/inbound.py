# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the flight controller: inertial data, attitude and height in the companion's axes, units and time."""

import math
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from mav_handlers.wire.codec import message_id
from mav_handlers.wire.messages import (
    ATTITUDE,
    ATTITUDE_QUATERNION,
    COMMAND_LONG,
    DISTANCE_SENSOR,
    HIGHRES_IMU,
    RAW_IMU,
    SCALED_IMU,
    Message,
)
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD, GRAVITY_MSS
from viso.companion.vio.types import ImuSample
from viso.geometry.rotation import Array, rotation_from_quat_wxyz, so3_exp, yaw_of

MAV_CMD_SET_MESSAGE_INTERVAL: Final = 511
MAV_SENSOR_ROTATION_PITCH_270: Final = 25
INVALID_SIGNAL: Final = 1
ACCEL_AND_GYRO: Final = 0x3F

# Which inertial message is the best: by resolution of its numbers, then of its time.
RANKS: Final = {HIGHRES_IMU: 3, RAW_IMU: 2, SCALED_IMU: 1}
SOURCE_TIMEOUT_NS: Final = 500_000_000
MAX_AGE_NS: Final = 1_000_000_000
MAX_AHEAD_NS: Final = 20_000_000
MAX_ACCEL_MSS: Final = 1000.0
MAX_GYRO_RAD_S: Final = 100.0
ATTITUDE_HISTORY: Final = 100
ATTITUDE_REACH_NS: Final = 200_000_000
PERIODS: Final = 50

_Imu = HIGHRES_IMU | RAW_IMU | SCALED_IMU
_Attitude = ATTITUDE | ATTITUDE_QUATERNION


@dataclass(frozen=True, slots=True, eq=False)
class FcAttitude:
    """The autopilot's attitude.

    Attributes:
        t_ns: when, on the companion's clock.
        R: from the body (FLU) to ENU.
    """

    t_ns: int
    R: Array


class _Refused(Exception):
    """Carries the reason why a message is refused."""


class FcInbound:
    """Handles messages of the autopilot; refused ones are counted by reason.

    Args:
        on_imu: gets each sample, in strictly increasing order of time.
        on_height: gets each height above ground: when, on the companion's clock, and the height in m, corrected for the
            vehicle's tilt.

    Attributes:
        counters: how many messages of which kind were taken, and how many refused for which reason.
    """

    def __init__(
        self,
        clock: ClockSync,
        on_imu: Callable[[ImuSample], object],
        on_height: Callable[[int, float], object] = lambda _t_ns, _agl_m: None,
    ) -> None:
        self._clock = clock
        self._on_imu = on_imu
        self._on_height = on_height
        self.counters: Counter[str] = Counter()
        self._arrivals: dict[type[Message], deque[int]] = {}
        self._last_ns: dict[str, int] = {}
        self._imu_source: type[Message] | None = None
        self._imu_arrival_ns: int | None = None
        self._attitudes: deque[FcAttitude] = deque(maxlen=ATTITUDE_HISTORY)

    def imu_silent(self, now_ns: int) -> bool:
        """Return whether no inertial message has been taken for half a second."""
        return self._imu_arrival_ns is None or now_ns - self._imu_arrival_ns > SOURCE_TIMEOUT_NS

    def take(self, message: Message, arrival_ns: int) -> None:
        """Handle a message with its time of arrival; other kinds are ignored. Never raises because of its contents."""
        name = type(message).__name__
        try:
            if isinstance(message, _Imu):
                self._take_imu(message, arrival_ns)
            elif isinstance(message, _Attitude):
                self._take_attitude(message, arrival_ns)
            elif isinstance(message, DISTANCE_SENSOR):
                self._take_distance(message, arrival_ns)
            else:
                return
        except _Refused as refusal:
            self.counters[f"{name}_refused_{refusal}"] += 1
        else:
            self.counters[name] += 1

    def attitude_at(self, t_ns: int) -> FcAttitude | None:
        """Return the attitude nearest to a time, at most 0.2 s off, or None."""
        nearest = min(tuple(self._attitudes), key=lambda attitude: abs(attitude.t_ns - t_ns), default=None)
        return nearest if nearest is not None and abs(nearest.t_ns - t_ns) <= ATTITUDE_REACH_NS else None

    def yaw_at(self, t_ns: int) -> float | None:
        """Return the ENU yaw in rad of the attitude nearest to a time, at most 0.2 s off, or None."""
        attitude = self.attitude_at(t_ns)
        return None if attitude is None else yaw_of(attitude.R)

    def _take_imu(self, message: _Imu, arrival_ns: int) -> None:
        kind, source = type(message), self._imu_source
        if source is not None and RANKS[source] > RANKS[kind] and not self.imu_silent(arrival_ns):
            raise _Refused("better_source")
        if not isinstance(message, SCALED_IMU) and message.id != 0:
            raise _Refused("other_imu")
        accel_frd, gyro_frd = _measured(message)
        fc_ns = message.time_boot_ms * 1_000_000 if isinstance(message, SCALED_IMU) else message.time_usec * 1000
        t_ns = self._time_ns("imu", kind, fc_ns, arrival_ns)
        self._imu_source, self._imu_arrival_ns = kind, arrival_ns
        self._on_imu(ImuSample(t_ns, FLU_TO_FRD.dot(accel_frd), FLU_TO_FRD.dot(gyro_frd)))

    def _take_attitude(self, message: _Attitude, arrival_ns: int) -> None:
        ned_R_frd = _ned_R_frd(message)
        t_ns = self._time_ns("attitude", type(message), message.time_boot_ms * 1_000_000, arrival_ns)
        self._attitudes.append(FcAttitude(t_ns, ENU_TO_NED.T.dot(ned_R_frd).dot(FLU_TO_FRD)))

    def _take_distance(self, message: DISTANCE_SENSOR, arrival_ns: int) -> None:
        if message.orientation != MAV_SENSOR_ROTATION_PITCH_270:
            raise _Refused("not_downwards")
        in_range = message.min_distance <= message.current_distance <= message.max_distance
        if not in_range or message.current_distance == 0 or message.signal_quality == INVALID_SIGNAL:
            raise _Refused("out_of_range")
        t_ns = self._time_ns("distance", type(message), message.time_boot_ms * 1_000_000, arrival_ns)
        attitude = self.attitude_at(t_ns)
        if attitude is None:
            raise _Refused("no_attitude")
        upright = float(attitude.R[2, 2])
        if upright <= 0.5:
            raise _Refused("leaning")
        self._on_height(t_ns, message.current_distance * 0.01 * upright)

    def _time_ns(self, stream: str, kind: type[Message], fc_ns: int, arrival_ns: int) -> int:
        t_ns = self._clock.to_companion_ns(fc_ns, arrival_ns, self._mean_period_ns(kind, arrival_ns))
        # A stamp far off would block all later ones; after a clock step the next TIMESYNC answer corrects it.
        if t_ns < arrival_ns - MAX_AGE_NS:
            raise _Refused("too_old")
        if t_ns > arrival_ns + MAX_AHEAD_NS:
            raise _Refused("in_the_future")
        if t_ns <= self._last_ns.get(stream, -1):
            raise _Refused("not_later")
        self._last_ns[stream] = t_ns
        return t_ns

    def _mean_period_ns(self, kind: type[Message], arrival_ns: int) -> int:
        arrivals = self._arrivals.setdefault(kind, deque(maxlen=PERIODS + 1))
        arrivals.append(arrival_ns)
        return (arrivals[-1] - arrivals[0]) // (len(arrivals) - 1) if len(arrivals) > 1 else 0


def stream_requests(rates_hz: Mapping[str, float], target_system: int = 1) -> tuple[COMMAND_LONG, ...]:
    """Return the commands that request messages from an autopilot.

    Args:
        rates_hz: by the message's name.
        target_system: the autopilot's.

    Raises:
        KeyError: if a name is no message's.
    """
    command = target_system, 1, MAV_CMD_SET_MESSAGE_INTERVAL, 0
    return tuple(
        COMMAND_LONG(*command, message_id(name), round(1e6 / hz), 0, 0, 0, 0, 0) for name, hz in rates_hz.items()
    )


def _measured(message: _Imu) -> tuple[Array, Array]:
    """Return specific force in m/s^2 and rates in rad/s, FRD."""
    accel = np.array([message.xacc, message.yacc, message.zacc], np.float64)
    gyro = np.array([message.xgyro, message.ygyro, message.zgyro], np.float64)
    if isinstance(message, HIGHRES_IMU):
        if message.fields_updated & ACCEL_AND_GYRO != ACCEL_AND_GYRO:
            raise _Refused("not_updated")
    else:
        accel, gyro = accel * (GRAVITY_MSS * 1e-3), gyro * 1e-3
    if not (np.isfinite(accel).all() and np.isfinite(gyro).all()):
        raise _Refused("not_finite")
    if np.abs(accel).max() > MAX_ACCEL_MSS or np.abs(gyro).max() > MAX_GYRO_RAD_S:
        raise _Refused("out_of_range")
    return accel, gyro


def _ned_R_frd(message: _Attitude) -> Array:
    if isinstance(message, ATTITUDE):
        angles = (message.roll, message.pitch, message.yaw)
        if not all(map(math.isfinite, angles)):
            raise _Refused("not_finite")
        if not any(angles):  # ArduPilot's value before it has an attitude
            raise _Refused("no_attitude")
        roll, pitch, yaw = (so3_exp(vector) for vector in np.diag(angles))
        ned_R_frd: Array = yaw.dot(pitch).dot(roll)
        return ned_R_frd
    quat_wxyz = (message.q1, message.q2, message.q3, message.q4)
    try:
        return rotation_from_quat_wxyz(quat_wxyz)
    except ValueError:
        raise _Refused("no_rotation") from None
