# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the frame of a stream of poses lies in that of the vehicle, which a jump changes."""

import math
from collections import Counter
from typing import Final, NamedTuple

from ekf_stub.core.vectors import Quat, conjugate, euler_of, quat_of_euler, times
from viso.vehicle.sensors.stream.imagined_vehicle import Movement
from viso.vehicle.sensors.vectors import ZERO, Three, added, yawed

JUMP_M: Final = 0.5
JUMP_YAW_RAD: Final = math.radians(5.0)
JUMP_ACCEL: Final = 20.0
JUMP_YAW_ACCEL_RAD: Final = math.radians(1000.0)


class Pose(NamedTuple):
    """A place (m, NED) and an attitude (body to NED), and when it was observed, in s since boot."""

    time_s: float
    pos: Three
    quat: Quat


class StreamFrame:
    """Turned about the vertical against the vehicle's frame, and shifted.

    The vehicle is at ``where`` at the time of the pose ``first``, and its heading is that of the pose. ``jumps`` counts
    jumps by ``position``, ``yaw`` and ``reset``.
    """

    def __init__(self, first: Pose, where: Movement) -> None:
        self._yaw_rad = euler_of(where.quat)[2] - euler_of(first.quat)[2]
        self._offset: Three = ZERO
        self._shift(added(where.pos, self.apply(first).pos, -1.0))
        self.jumps: Counter[str] = Counter()

    def apply(self, pose: Pose) -> Pose:
        """Return a pose of the stream as one of the vehicle."""
        pos = added(yawed(pose.pos, self._yaw_rad), self._offset)
        return Pose(pose.time_s, pos, times(quat_of_euler(0.0, 0.0, self._yaw_rad), pose.quat))

    def settle_jump(
        self, pose: Pose, expected: Movement, interval_s: float, *, steady: Pose | None = None, is_reset: bool
    ) -> bool:
        """Let the frame jump, if a pose is too far from what was expected, so that it is not; return whether it has.

        Args:
            pose: a pose of the stream.
            expected: where the vehicle should be then.
            interval_s: for how long there was no pose.
            steady: where the stream itself should be then; a pose near that has not jumped either.
            is_reset: the frame has jumped in any case.
        """
        has_turned = self._is_turned(pose, expected, interval_s, steady)
        if has_turned or is_reset:
            self._turn(-_yaw_between(expected.quat, self.apply(pose).quat), about=pose)
        error = added(expected.pos, self.apply(pose).pos, -1.0)
        explained = JUMP_M + 0.5 * JUMP_ACCEL * interval_s**2
        has_moved = math.hypot(*error) > explained and (not steady or math.dist(steady.pos, pose.pos) > explained)
        if has_moved or is_reset:
            self._shift(error)
        self.jumps += Counter({"reset": 1} if is_reset else {"position": int(has_moved), "yaw": int(has_turned)})
        return has_moved or has_turned or is_reset

    def _is_turned(self, pose: Pose, expected: Movement, interval_s: float, steady: Pose | None) -> bool:
        explained = JUMP_YAW_RAD + 0.5 * JUMP_YAW_ACCEL_RAD * interval_s**2
        quats = [expected.quat] if steady is None else [expected.quat, self.apply(steady).quat]
        shown = self.apply(pose).quat
        return all(abs(_yaw_between(quat, shown)) > explained for quat in quats)

    def _turn(self, angle_rad: float, *, about: Pose) -> None:
        before = self.apply(about).pos
        self._yaw_rad = math.remainder(self._yaw_rad + angle_rad, 2.0 * math.pi)
        self._shift(added(before, self.apply(about).pos, -1.0))

    def _shift(self, way: Three) -> None:
        self._offset = added(self._offset, way)


def _yaw_between(first: Quat, second: Quat) -> float:
    # About the vertical, which is defined for every tilt.
    w, _, _, z = times(second, conjugate(first))
    return math.remainder(2.0 * math.atan2(z, w), 2.0 * math.pi)
