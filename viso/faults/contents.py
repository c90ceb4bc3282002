# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of what goes with the estimate: frames, quality, covariance, and numbers that are none."""

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Final, cast

from mav_handlers.wire.messages import DISTANCE_SENSOR, ODOMETRY, OPTICAL_FLOW, VISION_POSITION_DELTA
from viso.faults.fault import ContentFault, Moment, parameter
from viso.faults.poses import VISION_TYPES

_COVARIANCES: Final = ("covariance", "pose_covariance", "velocity_covariance")
# An upper triangle of 6 x 6 row by row, or all of 3 x 3.
_DIAGONALS: Final = {21: (0, 6, 11, 15, 18, 20), 9: (0, 4, 8)}
_FLOATS: Final = frozenset(
    item.name for cls in VISION_TYPES for item in fields(cast(Any, cls)) if item.type in (float, tuple[float, ...])
)


@dataclass(slots=True)
class FrameIds(ContentFault):
    """ODOMETRY names other frames than LOCAL_FRD (20) and BODY_FRD (12), the only pair that the firmware accepts.

    Attributes:
        frame_id: of the pose (MAV_FRAME); 1 is LOCAL_NED.
        child_frame_id: of the velocity (MAV_FRAME); 8 is BODY_NED.
    """

    lasts: ClassVar[bool] = True
    frame_id: int = parameter(1, 0, 255)
    child_frame_id: int = parameter(8, 0, 255)

    def change(self, message: Any, moment: Moment) -> Any:
        if not isinstance(message, ODOMETRY):
            return None
        return replace(message, frame_id=self.frame_id, child_frame_id=self.child_frame_id)


@dataclass(slots=True)
class Quality(ContentFault):
    """The quality of ODOMETRY or OPTICAL_FLOW, or the confidence of a change, follows a sequence, over and over.

    Attributes:
        values: in turn; -1 failed, 0 unknown, 1 to 100; of flow 0 (none) to 255. A message that cannot hold one is left
            alone.
        hold_s: how long each holds; 0 for one message each.
    """

    lasts: ClassVar[bool] = True
    values: tuple[int, ...] = parameter((0,), -128, 255)
    hold_s: float = parameter(0.0, 0.0, 1e6)
    _count: int = field(default=0, init=False, repr=False)

    def change(self, message: Any, moment: Moment) -> Any:
        if isinstance(message, ODOMETRY | OPTICAL_FLOW):
            return replace(message, quality=self._next(moment))
        if isinstance(message, VISION_POSITION_DELTA):
            return replace(message, confidence=float(self._next(moment)))
        return None

    def _next(self, moment: Moment) -> int:
        turn = int(moment.since_s / self.hold_s) if self.hold_s else self._count
        self._count += 1
        return self.values[turn % len(self.values)]


@dataclass(slots=True)
class Distance(ContentFault):
    """DISTANCE_SENSOR reports a wrong distance: an outlier if it has a probability, else a stuck range.

    Attributes:
        distance_m: the distance that it reports, also outside its limits.
    """

    for_messages: ClassVar[tuple[str, ...]] = (DISTANCE_SENSOR.__name__,)
    distance_m: float = parameter(0.0, 0.0, 655.35)

    def change(self, message: Any, moment: Moment) -> Any:
        if not isinstance(message, DISTANCE_SENSOR):
            return None
        return replace(message, current_distance=round(100 * self.distance_m))


@dataclass(slots=True)
class Looks(ContentFault):
    """DISTANCE_SENSOR points in another direction.

    Attributes:
        orientation: where (MAV_SENSOR_ORIENTATION); 0 forward, 24 up, 25 down.
    """

    lasts: ClassVar[bool] = True
    for_messages: ClassVar[tuple[str, ...]] = (DISTANCE_SENSOR.__name__,)
    orientation: int = parameter(0, 0, 100)

    def change(self, message: Any, moment: Moment) -> Any:
        return replace(message, orientation=self.orientation) if isinstance(message, DISTANCE_SENSOR) else None


@dataclass(slots=True)
class NotANumber(ContentFault):
    """Fields are NaN.

    Attributes:
        fields: their names, as the message definition has them; all elements of an array.
    """

    fields: tuple[str, ...] = parameter(("x", "y", "z"))

    def __post_init__(self) -> None:
        ContentFault.__post_init__(self)
        unknown = [name for name in self.fields if name not in _FLOATS]
        if unknown:
            raise ValueError(f"fields: no message has a number {unknown[0]!r}; there are {', '.join(sorted(_FLOATS))}")

    def change(self, message: Any, moment: Moment) -> Any:
        names = [name for name in self.fields if isinstance(getattr(message, name, None), float | tuple)]
        return replace(message, **{name: _nan_like(getattr(message, name)) for name in names}) if names else None


def _nan_like(value: float | tuple[float, ...]) -> float | tuple[float, ...]:
    return (math.nan,) * len(value) if isinstance(value, tuple) else math.nan


@dataclass(slots=True)
class Covariance(ContentFault):
    """Every covariance has one number on its diagonal and 0 elsewhere.

    Attributes:
        variance: that number; nan for a covariance that is unknown, whose first element alone is NaN.
    """

    lasts: ClassVar[bool] = True
    variance: float = parameter(0.0, -1e30, 1e30, nan=True)

    def change(self, message: Any, moment: Moment) -> Any:
        # That of DISTANCE_SENSOR is a number in cm.
        names = [name for name in _COVARIANCES if isinstance(getattr(message, name, None), tuple)]
        return replace(message, **{name: self._of(len(getattr(message, name))) for name in names}) if names else None

    def _of(self, count: int) -> tuple[float, ...]:
        places = (0,) if math.isnan(self.variance) else _DIAGONALS[count]
        return tuple(self.variance if place in places else 0.0 for place in range(count))
