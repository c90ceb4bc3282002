# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes mixed up: the world's, the body's, or both, in the vectors, the attitude, or both."""

import enum
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Final

import numpy as np

from ekf_stub.core.vectors import Quat, Vec3, conjugate, times
from mav_handlers.wire.messages import ODOMETRY, OPTICAL_FLOW, VISION_POSITION_DELTA, VISION_SPEED_ESTIMATE
from viso.faults.fault import ContentFault, Moment
from viso.faults.poses import attitude_of, position_of, with_attitude, with_flow, with_position
from viso.geometry.frame_change import axes_matrix
from viso.geometry.rotation import Array, quat_wxyz_from_rotation


class AxesOf(enum.StrEnum):
    """What of a message is in other axes."""

    BOTH = "both"
    VECTORS = "vectors"
    ATTITUDE = "attitude"


@dataclass(frozen=True, slots=True)
class _Axes:
    """Coordinates in other axes than north, east, down or forward, right, down: each is one of them, or its opposite.

    ``matrix`` maps the coordinates to the usual ones.
    """

    matrix: Array

    @property
    def handedness(self) -> int:
        """1 if right-handed, else -1."""
        return round(float(np.linalg.det(self.matrix)))

    @property
    def quat_wxyz(self) -> Quat:
        """The matrix as a turn; for left-handed axes, that of its opposite."""
        w, x, y, z = quat_wxyz_from_rotation(self.handedness * self.matrix).tolist()
        return w, x, y, z

    def coordinates(self, vector: Vec3) -> Vec3:
        """Return the coordinates, in these axes, of a vector; each is copied, so that NaN stays where it belongs."""
        rows = np.abs(self.matrix).argmax(axis=0)
        x, y, z = (float(self.matrix[row, column]) * vector[row] for column, row in enumerate(rows))
        return x, y, z


_USUAL: Final = _Axes(np.eye(3))


@dataclass(slots=True)
class WrongAxes(ContentFault):
    """What should be in NED and FRD is in other axes.

    Axes are three letters for where x, y and z point: N, E, S, W or F, R, B, L, and U or D.

    Attributes:
        world_axes: of the position and of VISION_SPEED_ESTIMATE, such as ENU or NWU.
        body_axes: of the velocity of ODOMETRY, of rates, changes and flow, such as FLU.
        of: what is in them; for the attitude, both must be right-handed or both left-handed.
    """

    lasts: ClassVar[bool] = True
    world_axes: str = "NED"
    body_axes: str = "FRD"
    of: AxesOf = AxesOf.BOTH
    _world: _Axes = field(default=_USUAL, init=False, repr=False)
    _body: _Axes = field(default=_USUAL, init=False, repr=False)

    def __post_init__(self) -> None:
        ContentFault.__post_init__(self)
        self._world, self._body = _axes("world_axes", self.world_axes), _axes("body_axes", self.body_axes)
        if self.of is not AxesOf.VECTORS and self._world.handedness != self._body.handedness:
            raise ValueError(f"of: {self.world_axes} and {self.body_axes} differ in handedness, so no attitude fits")

    def change(self, message: Any, moment: Moment) -> Any:
        """Give the coordinates in the other axes."""
        vectors, attitude = self.of is not AxesOf.ATTITUDE, self.of is not AxesOf.VECTORS
        if isinstance(message, VISION_POSITION_DELTA):
            return self._delta(message, vectors=vectors, attitude=attitude)
        if isinstance(message, VISION_SPEED_ESTIMATE):
            return self._at(message, (message.x, message.y, message.z)) if vectors else None
        if isinstance(message, OPTICAL_FLOW):
            return with_flow(message, self._flow) if vectors else None
        position, quat = position_of(message), attitude_of(message)
        if position is None or quat is None:
            return None
        if vectors:
            message = self._at(message, position)
            if isinstance(message, ODOMETRY):
                vx, vy, vz = self._body.coordinates((message.vx, message.vy, message.vz))
                message = replace(message, vx=vx, vy=vy, vz=vz)
        return self._turned(message, quat) if attitude else message

    def _at(self, message: Any, vector: Vec3) -> Any:
        return with_position(message, self._world.coordinates(vector))

    def _flow(self, x: float, y: float) -> tuple[float, float]:
        """Return rates about x and y, an axial vector, in the other axes."""
        about_x, about_y, _ = self._body.coordinates((x, y, 0.0))
        return self._body.handedness * about_x, self._body.handedness * about_y

    def _turned(self, message: Any, quat: Quat) -> Any:
        if isinstance(message, ODOMETRY):
            rates = message.rollspeed, message.pitchspeed, message.yawspeed
            # An axial vector: it changes its sign with the handedness.
            roll, pitch, yaw = (self._body.handedness * rate for rate in self._body.coordinates(rates))
            message = replace(message, rollspeed=roll, pitchspeed=pitch, yawspeed=yaw)
        return with_attitude(message, times(times(conjugate(self._world.quat_wxyz), quat), self._body.quat_wxyz))

    def _delta(self, message: VISION_POSITION_DELTA, *, vectors: bool, attitude: bool) -> VISION_POSITION_DELTA:
        if vectors:
            position: Any = message.position_delta
            message = replace(message, position_delta=self._body.coordinates(position))
        if attitude:
            angle: Any = message.angle_delta  # small, so a vector
            turned = tuple(self._body.handedness * delta for delta in self._body.coordinates(angle))
            message = replace(message, angle_delta=turned)
        return message


def _axes(name: str, letters: str) -> _Axes:
    try:
        return _Axes(axes_matrix(letters))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
