# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An AHRS that follows a recorded log."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.core.params import EkfSources
from ekf_stub.log.ext_nav_log import ExtNavLog

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RecordedStates:
    """The state of the vehicle in a log; times in us since boot, rising.

    Attributes:
        att_time_us: shape (n,), times of the ATT records.
        att_rpy_deg: shape (n, 3), roll, pitch, yaw in degrees.
        pos_time_us: shape (m,), times of the XKF1 records that hold a valid position.
        pos_ned: shape (m, 3), metres NED from the EKF origin.
        vel_ned: shape (m, 3), m/s NED, of the same records.
        pos_start_us: when the position became valid: at the first of these records, or shortly before it.
        start_us: when the AHRS started.
        gps_origin: when the EKF took its origin from GPS, and the place; None if a client set it, or nobody did.
    """

    att_time_us: Array
    att_rpy_deg: Array
    pos_time_us: Array
    pos_ned: Array
    vel_ned: Array
    pos_start_us: float
    start_us: int = AHRS_START_US
    gps_origin: tuple[float, Location] | None = None

    def __post_init__(self) -> None:
        if len(self.att_time_us) == 0:
            raise ValueError("a recorded AHRS needs at least one ATT record")


class RecordedAhrs(AhrsBase):
    """Attitude and position of a log, interpolated at the present time.

    DCM's yaw counts as initialised from the first attitude on, as in the recordings.
    """

    def __init__(
        self,
        clock: VirtualClock,
        sources: EkfSources,
        log: ExtNavLog,
        states: RecordedStates,
        note: str = "",
    ) -> None:
        super().__init__(clock, sources, log, start_us=states.start_us)
        self._note = note
        self._states = states
        self._rpy_rad = np.unwrap(np.radians(states.att_rpy_deg), axis=0)

    @property
    def notes(self) -> tuple[str, ...]:
        """Where attitude and position come from, as given."""
        return (self._note,) if self._note else ()

    def _at_now(self, time_us: Array, values: Array) -> list[float]:
        now_us = float(self._clock.micros64())
        return [float(np.interp(now_us, time_us, column)) for column in values.T]

    def origin(self) -> Location | None:
        """Return the origin that was set, or that of the log from when its GPS gave one."""
        if self._origin is None and self._states.gps_origin is not None:
            time_us, place = self._states.gps_origin
            if self._clock.micros64() >= time_us:
                self._origin = place
        return self._origin

    def dcm_yaw_initialised(self) -> bool:
        """Return whether the log has an attitude by now."""
        return bool(self._clock.micros64() >= self._states.att_time_us[0])

    def get_yaw_rad(self) -> np.float32:
        """Return the log's yaw, -pi..pi."""
        yaw = self._at_now(self._states.att_time_us, self._rpy_rad)[2]
        return f32(math.remainder(yaw, 2 * math.pi))

    def get_quaternion(self) -> Quaternion | None:
        """Return the log's attitude; None before its first."""
        if not self.dcm_yaw_initialised():
            return None
        roll, pitch, yaw = self._at_now(self._states.att_time_us, self._rpy_rad)
        return Quaternion.from_euler(f32(roll), f32(pitch), f32(yaw))

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the log's position; None before it was valid.

        Between two records it is the cubic with their positions and velocities, so that a vehicle that accelerates is
        within a millimetre of where it was.
        """
        states, now_us = self._states, float(self._clock.micros64())
        times = states.pos_time_us
        if len(times) == 0 or now_us < states.pos_start_us:
            return None
        after = int(np.searchsorted(times, now_us))
        if after == 0 or after == len(times):
            nearest = min(after, len(times) - 1)
            passed_s = min(0.0, 1e-6 * (now_us - times[nearest]))
            return Vector3f(*(states.pos_ned[nearest] + passed_s * states.vel_ned[nearest]).tolist())
        before = after - 1
        interval_s = 1e-6 * (times[after] - times[before])
        share = 1e-6 * (now_us - times[before]) / interval_s
        moved = states.pos_ned[after] - states.pos_ned[before]
        first, last = (interval_s * states.vel_ned[index] - moved for index in (before, after))
        bend = share * (1 - share) * ((1 - share) * first - share * last)
        return Vector3f(*(states.pos_ned[before] + share * moved + bend).tolist())
