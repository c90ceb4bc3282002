# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera of the firmware's simulator, on a link of its own (SITL/SIM_Vicon.cpp).

It knows where the vehicle is, and tells it late: each message waits for 25 to 124 ms, and there is room for three.
"""

import math
import random
from dataclasses import dataclass
from typing import Final

from ap_core.clock import NEVER
from ap_core.param_group import ParamGroup
from ekf_stub.core.vectors import ONE, Quat, conjugate, cross, euler_of, quat_of_euler, rotated, times
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    HEARTBEAT,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.vectors import Three, added, to_body, yawed

SYSTEM_ID: Final = 17
COMPONENT_ID: Final = 18
PLACES: Final = 3
HEARTBEAT_US: Final = 500_000
LEAST_DELAY_MS: Final = 25
DELAYS_MS: Final = 100
MOST_OFFSET_S: Final = 7000
QUALITY: Final = 50
"""Before there was a parameter for it."""
RATE_HZ: Final = 50
"""Before there was a parameter for it: 4.6 has none for rate and noise."""

_LOCAL_FRD, _BODY_FRD, _VIO = 20, 12, 3
_GCS, _INVALID_AUTOPILOT = 6, 8
_HEARTBEAT: Final = HEARTBEAT(_GCS, _INVALID_AUTOPILOT, 0, 0, 0, 0)
_POSE, _SPEED, _VICON, _DELTA, _ODOMETRY = (1 << bit for bit in range(5))
_POSE_DIAGONAL: Final = (0, 6, 11)


@dataclass
class _Waiting:
    """A place for a message that waits to be sent."""

    frame: bytes = b""
    send_us: int = 0


class Vicon:
    """The camera; its delays, its noise and how far its clock is off are of the seed."""

    def __init__(self, airframe: Airframe, params: ParamGroup, seed: int = 0) -> None:
        self._airframe = airframe
        self._params = params
        self._draw = random.Random(seed)
        self._codec = Codec(SYSTEM_ID, COMPONENT_ID)
        self._clock_off_us = self._draw.randrange(MOST_OFFSET_S) * 1_000_000
        self._places = [_Waiting() for _ in range(PLACES)]
        self._heartbeat_us = self._observed_us = 0
        self._last_pos: Three = (0.0, 0.0, 0.0)
        self._last_quat = ONE

    def next_us(self) -> int:
        """Return when it does something next."""
        sending = [place.send_us for place in self._places if place.send_us]
        observing = NEVER if self._is_blind() else self._observed_us + 1_000_000 // self._rate_hz()
        return min(self._heartbeat_us + HEARTBEAT_US, observing, *sending)

    def _is_blind(self) -> bool:
        # FIRMWARE PARITY: whether a message waits is asked of the last place alone.
        is_waiting = self._places[-1].send_us != 0
        return is_waiting or self._rate_hz() <= 0 or self._params.get_int("FAIL") != 0

    def _has(self, name: str) -> bool:
        return any(row.name == name for row in self._params.var_info)

    def _rate_hz(self) -> int:
        return self._params.get_int("RATE") if self._has("RATE") else RATE_HZ

    def _deviation(self, name: str) -> float:
        return float(self._params.get_float(name)) if self._has(name) else 0.0

    def update(self, now_us: int) -> bytes:
        """Look at the vehicle if it is time to, and return what arrives of it now."""
        if now_us - self._heartbeat_us >= HEARTBEAT_US and self._put(_HEARTBEAT, now_us):
            self._heartbeat_us = now_us
        arrived = b""
        for place in self._places:
            if 0 < place.send_us <= now_us:
                arrived += place.frame
                place.send_us = 0
        if not self._is_blind() and now_us - self._observed_us >= 1_000_000 // self._rate_hz():
            self._observe(now_us)
        return arrived

    def _put(self, message: Message, send_us: int) -> bool:
        for place in self._places:
            if not place.send_us:
                place.frame, place.send_us = self._codec.encode(message), send_us
                return True
        return False

    def _vector(self, name: str) -> Three:
        x, y, z = self._params.get_vector(name).to_tuple()
        return float(x), float(y), float(z)

    def _noise(self, name: str) -> Three:
        spread = self._deviation(name)
        return self._draw.gauss(0.0, spread), self._draw.gauss(0.0, spread), self._draw.gauss(0.0, spread)

    def _observe(self, now_us: int) -> None:
        params, truth, rates = self._params, self._airframe.truth(), self._airframe.felt()[1]
        attitude = truth.quat_wxyz
        roll, pitch, yaw = self._airframe.state.rpy
        markers = self._vector("POS")
        pos = added(added(truth.pos_ned, rotated(attitude, markers)), self._vector("GLIT"))
        pos = added(pos, self._noise("P_SD"))
        vel = added(added(truth.vel_ned, rotated(attitude, cross(rates, markers))), self._vector("VGLI"))
        turned_rad = math.radians(params.get_int("YAW"))
        if turned_rad:
            yaw = math.remainder(yaw - turned_rad, 2.0 * math.pi)
            pos, vel = yawed(pos, -turned_rad), yawed(vel, -turned_rad)
        vel = added(vel, self._noise("V_SD"))
        yaw = math.remainder(yaw + math.radians(params.get_int("YAWERR")), 2.0 * math.pi)
        send_us = now_us + 1000 * (LEAST_DELAY_MS + self._draw.randrange(DELAYS_MS))
        stamp_us, mask = now_us + self._clock_off_us, params.get_int("TMASK")
        pose_covariance = _diagonal(self._deviation("P_SD") ** 2)
        quat = conjugate(quat_of_euler(roll, pitch, yaw))
        if mask & _POSE:
            self._put(VISION_POSITION_ESTIMATE(stamp_us, *pos, roll, pitch, yaw, pose_covariance), send_us)
        if mask & _VICON:
            self._put(VICON_POSITION_ESTIMATE(stamp_us, *pos, roll, pitch, yaw), send_us)
        variance = self._deviation("V_SD") ** 2
        if mask & _SPEED:
            covariance = (variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance)
            self._put(VISION_SPEED_ESTIMATE(stamp_us, *vel, covariance), send_us)
        if mask & _ODOMETRY:
            ahead, right, down = to_body(attitude, vel)
            # FIRMWARE PARITY: the attitude is the true one, whatever YAW and YAWERR say.
            message = ODOMETRY(
                *(stamp_us, _LOCAL_FRD, _BODY_FRD, *pos, truth.quat_wxyz, ahead, right, down, *rates),
                pose_covariance=pose_covariance,
                velocity_covariance=_diagonal(variance),
                estimator_type=_VIO,
                quality=self._quality(),
            )
            self._put(message, send_us)
        if mask & _DELTA:
            self._put(self._delta(stamp_us, now_us - self._observed_us, pos, quat), send_us)
        self._observed_us, self._last_pos, self._last_quat = now_us, pos, quat

    def _quality(self) -> int:
        return max(-1, min(self._params.get_int("QUAL"), 100)) if self._has("QUAL") else QUALITY

    def _delta(self, stamp_us: int, since_us: int, pos: Three, quat: Quat) -> VISION_POSITION_DELTA:
        turn = times(quat, conjugate(self._last_quat))
        way = rotated(quat, added(pos, self._last_pos, -1.0))
        return VISION_POSITION_DELTA(stamp_us, since_us, euler_of(turn), way, 0.0)


def _diagonal(variance: float) -> tuple[float, ...]:
    return tuple(variance if index in _POSE_DIAGONAL else 0.0 for index in range(21))
