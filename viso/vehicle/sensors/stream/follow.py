# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that moves by external navigation, so that a stream can be tried without other sensors."""

import math
from collections import Counter
from copy import copy
from typing import Final, NamedTuple

from ap_core.cint import i32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.core.vectors import Quat, euler_of, normalized
from ekf_stub.inputs.measurements import InertialDelta
from viso.vehicle.sensors.errors import exact_delta
from viso.vehicle.sensors.motion import Moving
from viso.vehicle.sensors.moving import MovingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import LONGEST_US, NOMINAL_US, SHORTEST_US
from viso.vehicle.sensors.stream.follower import StreamFollower
from viso.vehicle.sensors.stream.frame import Pose
from viso.vehicle.sensors.stream.imagined_vehicle import ImaginedVehicle

REST_UNTIL_US: Final = 6_000_000
"""Until then since boot the vehicle stands still: the filter takes its first tilt from gravity alone."""

GAP_US: Final = 300_000
"""Without a pose for so long, when external navigation counts as unhealthy, the vehicle brakes."""

ACCELERATION_DELAY_S: Final = 0.22
"""After which half of a step of acceleration is followed, at 30 poses per second, each 50 ms old."""

MAX_AGE_MS: Final = 500
MIN_INTERVAL_S: Final = 0.0005
MAX_POSITION_M: Final = 1e6

_STEER_US: Final = 10_000
_LENGTH_TOLERANCE: Final = 0.1


class FollowState(NamedTuple):
    """The vehicle, and when it was steered last, us since boot."""

    vehicle: ImaginedVehicle
    steered_us: int


class FollowedMotion(Moving[FollowState]):
    """Follows poses.

    Attributes:
        follower: what it makes of the poses; None before the first one.
        guided_us: when a pose came last that said where the vehicle is.
    """

    def __init__(self, heading_rad: float) -> None:
        super().__init__(FollowState(ImaginedVehicle(heading_rad), 0))
        self.follower: StreamFollower | None = None
        self.guided_us = 0

    def moved(self, state: FollowState, last_us: int | None, now_us: int) -> tuple[FollowState, InertialDelta]:
        """Return the state at a time, from that of the pass before, and what ideal inertial sensors feel of it."""
        vehicle, steered_us = copy(state.vehicle), state.steered_us
        if last_us is not None and last_us - steered_us >= _STEER_US:
            steered_us = last_us
            self._steer(vehicle, last_us)
        dt_us = NOMINAL_US if last_us is None else now_us - last_us
        dt = 1e-6 * max(SHORTEST_US, min(dt_us, LONGEST_US))
        return FollowState(vehicle, steered_us), exact_delta(*vehicle.move(dt), dt)

    def _steer(self, vehicle: ImaginedVehicle, time_us: int) -> None:
        if self.follower is None:
            return
        if self.is_in_gap(time_us):
            vehicle.brake()
        else:
            vehicle.steer(self.follower.target(1e-6 * time_us))

    def is_in_gap(self, time_us: int) -> bool:
        """Return whether the last pose is old."""
        return time_us - self.guided_us > GAP_US


class FollowSource(MovingSource):
    """Sensors of a vehicle that follows the poses that external navigation gives.

    The vehicle starts at rest, level, at height 0, with the heading of the options, and stays so for 6 s after boot;
    where the stream begins then is where the vehicle is. Its acceleration and its rates are continuous and limited,
    and the sensors agree with them. What moves with constant acceleration, or turns at a constant rate, is followed
    without lag; of a step of acceleration half is followed after ``ACCELERATION_DELAY_S``. How old a pose is when it
    comes is made up for, as far as its stamp tells; a latency that the stamps hide stays hidden. The IMU is taken to
    be where the pose is, so a camera's lever arm is to be taken off before.

    What no vehicle can do is not followed. A pose that is further from what was expected than 0.5 m and 20 m/s^2
    explain, or 5 deg and 1000 deg/s^2 of yaw, has jumped, and so has one that comes with a reset: the vehicle moves on
    as before, and the stream's frame is turned and shifted against that of the vehicle. The filter sees the jump as it
    would in flight. A movement that begins suddenly, up to 20 m/s and 10 rad/s, is told from a jump by its going on.
    Tilt is the stream's, whatever it is.

    With a compass the vehicle's own heading is the truth: a stream with another yaw has a frame that is turned, the
    vehicle moves in the turned direction, and the error grows as it would in flight. Without one the stream's first yaw
    is the truth, as nothing else tells the heading.

    After 0.3 s without a pose, or with jumps alone, the vehicle brakes, levels, and is at rest within another second.
    When poses come again, it catches up smoothly with one less than 1.4 m and 50 deg away; more is a jump.

    Args:
        options: as of every source.
        heeds_stamps: whether stamps tell how old poses are; else they count as new when they come.

    Attributes:
        ignored: how many poses were not used, by reason.
    """

    follows_poses = True

    def __init__(self, options: ImuOptions, *, heeds_stamps: bool = True) -> None:
        self._followed = FollowedMotion(options.heading_rad)
        super().__init__(options, self._followed)
        self._heeds_stamps = heeds_stamps
        self.ignored: Counter[str] = Counter()

    @property
    def jumps(self) -> Counter[str]:
        """How many jumps there were, by ``position``, ``yaw`` and ``reset``."""
        follower = self._followed.follower
        return Counter() if follower is None else follower.frame.jumps

    def _shown(self, now_us: int) -> tuple[float, Quat]:
        vehicle = self._followed.state.vehicle
        return vehicle.height_m, vehicle.quat

    def yaw_rad(self) -> float:
        """Return the heading in rad; without a compass it begins as the stream's first yaw."""
        return euler_of(self._followed.state.vehicle.quat)[2]

    # What the vehicle follows

    def take_pose(self, pos_ned: Vector3f, quat: Quaternion, observed_ms: int, is_reset: bool) -> None:
        """Follow a pose: m and attitude, observed at a time in ms since boot.

        It may be anything at all; what cannot be used is counted in ``ignored``.
        """
        pose = self._usable(pos_ned, quat, observed_ms)
        if isinstance(pose, str):
            self.ignored[pose] += 1
            return
        motion, vehicle = self._followed, self._followed.state.vehicle
        motion.think_again()
        if motion.follower is None:
            if not self._options.has_compass():
                vehicle = copy(vehicle)
                vehicle.point(euler_of(pose.quat)[2])
                motion.state = motion.state._replace(vehicle=vehicle)
            motion.follower = StreamFollower(pose, vehicle.movement())
            is_guide = True
        elif motion.is_in_gap(self._now_us):
            is_guide = motion.follower.begin_again(pose, vehicle.movement(), is_reset=is_reset)
        else:
            is_guide = motion.follower.go_on(pose, is_reset=is_reset)
        if is_guide:
            motion.guided_us = self._now_us

    @property
    def _now_us(self) -> int:
        last_us = self._followed.last_us
        return -1 if last_us is None else last_us

    def _usable(self, pos_ned: Vector3f, quat: Quaternion, observed_ms: int) -> Pose | str:
        now_us = self._now_us
        if now_us < REST_UNTIL_US:
            return "at_rest_after_boot"
        x, y, z = map(float, pos_ned.to_tuple())
        if not all(abs(part) <= MAX_POSITION_M for part in (x, y, z)):
            return "absurd_position"
        w, i, j, k = map(float, quat.to_wxyz())
        if not abs(math.hypot(w, i, j, k) - 1.0) <= _LENGTH_TOLERANCE:
            return "absurd_attitude"
        age_ms = max(0, min(i32(now_us // 1000 - observed_ms), MAX_AGE_MS)) if self._heeds_stamps else 0
        time_s = 1e-3 * (now_us // 1000 - age_ms)
        follower = self._followed.follower
        if follower is not None and time_s - follower.time_s < MIN_INTERVAL_S:
            return "not_newer"
        return Pose(time_s, (x, y, z), normalized((w, i, j, k)))
