# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle imagined to move as external navigation says, so that a stream of it can be tried with nothing else."""

from collections import Counter
from typing import Final

from ap_core.cint import i32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.sensors import Sensors
from viso.geometry import quaternions as quaternion
from viso.geometry.attitude import euler_of
from viso.sensors.errors import exact_delta
from viso.sensors.options import ImuOptions
from viso.sensors.source import VehicleSource
from viso.sensors.standing import LONGEST_US, NOMINAL_US, SHORTEST_US
from viso.sensors.stream.follower import StreamFollower
from viso.sensors.stream.frame import Pose
from viso.sensors.stream.imagined_vehicle import ImaginedVehicle

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


class FollowSource(VehicleSource):
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
        super().__init__(options)
        self._heeds_stamps = heeds_stamps
        self._vehicle = ImaginedVehicle(options.heading_rad)
        self._follower: StreamFollower | None = None
        self._now_us = -1
        self._guided_us = self._steered_us = 0
        self.ignored: Counter[str] = Counter()

    @property
    def jumps(self) -> Counter[str]:
        """How many jumps there were, by ``position``, ``yaw`` and ``reset``."""
        return Counter() if self._follower is None else self._follower.frame.jumps

    # What the vehicle's sensors say

    def sense(self, now_us: int) -> Sensors | None:
        """Return what the sensors say, or None for a time that has been."""
        dt_us = NOMINAL_US if self._now_us < 0 else now_us - self._now_us
        if dt_us <= 0:
            return None
        if self._now_us - self._steered_us >= _STEER_US:
            self._steer()
        self._now_us = now_us
        dt = 1e-6 * max(SHORTEST_US, min(dt_us, LONGEST_US))
        delta = exact_delta(*self._vehicle.move(dt), dt)
        if now_us > self._next_reading_us:
            self._read(now_us, self._vehicle.height_m, self._vehicle.quat)
        return self._model.apply(Sensors(delta, self._baro, self._mag))

    def _steer(self) -> None:
        self._steered_us = self._now_us
        if self._follower is None:
            return
        if self._in_gap():
            self._vehicle.brake()
        else:
            self._vehicle.steer(self._follower.target(1e-6 * self._now_us))

    def _in_gap(self) -> bool:
        return self._now_us - self._guided_us > GAP_US

    def yaw_rad(self) -> float:
        """Return the heading in rad; without a compass it begins as the stream's first yaw."""
        return euler_of(self._vehicle.quat)[2]

    # What the vehicle follows

    def take_pose(self, pos_ned: Vector3f, quat: Quaternion, observed_ms: int, is_reset: bool) -> None:
        """Follow a pose: m and attitude, observed at a time in ms since boot.

        It may be anything at all; what cannot be used is counted in ``ignored``.
        """
        pose = self._usable(pos_ned, quat, observed_ms)
        if isinstance(pose, str):
            self.ignored[pose] += 1
            return
        if self._follower is None:
            if not self._options.has_compass():
                self._vehicle.point(euler_of(pose.quat)[2])
            self._follower = StreamFollower(pose, self._vehicle.movement())
            is_guide = True
        elif self._in_gap():
            is_guide = self._follower.begin_again(pose, self._vehicle.movement(), is_reset=is_reset)
        else:
            is_guide = self._follower.go_on(pose, is_reset=is_reset)
        if is_guide:
            self._guided_us = self._now_us

    def _usable(self, pos_ned: Vector3f, quat: Quaternion, observed_ms: int) -> Pose | str:
        now_us = self._now_us
        if now_us < REST_UNTIL_US:
            return "at_rest_after_boot"
        x, y, z = map(float, pos_ned.to_tuple())
        if not all(abs(part) <= MAX_POSITION_M for part in (x, y, z)):
            return "absurd_position"
        attitude = quaternion.quaternion(*map(float, quat.to_wxyz()))
        length = attitude.abs()
        if not abs(length - 1.0) <= _LENGTH_TOLERANCE:
            return "absurd_attitude"
        age_ms = max(0, min(i32(now_us // 1000 - observed_ms), MAX_AGE_MS)) if self._heeds_stamps else 0
        time_s = 1e-3 * (now_us // 1000 - age_ms)
        if self._follower is not None and time_s - self._follower.time_s < MIN_INTERVAL_S:
            return "not_newer"
        return Pose(time_s, (x, y, z), attitude / length)
