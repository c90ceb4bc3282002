# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter's door for sensors: what cannot be reckoned with stays outside.

FIRMWARE PARITY: the firmware trusts its drivers, and a number that is not finite spoils its filter for good.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from ekf_stub.core.frame import Frame
from ekf_stub.filter.inertial import MIN_DT, InertialDelta, InertialGuard
from ekf_stub.inputs.compasses import NO_COMPASS

MAX_BARO_M: Final = 1e5
MAX_FIELD_MGAUSS: Final = 1e5
MAX_DECLINATION_RAD: Final = 2 * math.pi
MAX_LEVER_ARM_M: Final = 1e4
MAX_RANGE_M: Final = 1e5
MAX_GPS_SPEED_M_S: Final = 1e4
MAX_GPS_ERROR: Final = 1e9
MAX_GPS_YAW_DEG: Final = 1e4


def _within(limit: float, *values: float) -> bool:
    """Return whether the sum of absolute values is within a limit, as it is not when one is not a number."""
    return sum(map(abs, values)) <= limit


def _is_gps_sound(frame: Frame) -> bool:
    gps = frame.gps
    if gps is None:
        return True
    errors = gps.speed_accuracy, gps.horizontal_accuracy, gps.vertical_accuracy
    return (
        _within(MAX_GPS_SPEED_M_S, *map(float, gps.vel_ned.to_tuple()))
        and _within(MAX_GPS_ERROR, *(error for error in errors if error is not None))
        and (gps.yaw_deg is None or _within(MAX_GPS_YAW_DEG, gps.yaw_deg))
    )


def _are_ranges_sound(frame: Frame) -> bool:
    if frame.ranges is None:
        return True
    finders, clearance, max_distance = frame.ranges
    numbers = [number for finder in finders for number in (finder.distance, *finder.place_frd)]
    return _within(MAX_RANGE_M, clearance, max_distance, *numbers)


def _are_compasses_sound(frame: Frame) -> bool:
    readings = () if frame.compasses is None else frame.compasses.readings
    return all(_within(MAX_FIELD_MGAUSS, *reading.field.tolist(), *reading.offsets) for reading in readings)


_SLOW: Final[dict[str, tuple[Callable[[Frame], bool], Any]]] = {
    "baro": (lambda frame: frame.baro is None or _within(MAX_BARO_M, frame.baro[1]), None),
    "mag": (lambda frame: frame.mag is None or _within(MAX_FIELD_MGAUSS, *frame.mag[1].tolist()), None),
    "gps": (_is_gps_sound, None),
    "declination": (lambda frame: _within(MAX_DECLINATION_RAD, frame.declination), 0.0),
    "place_declination": (lambda frame: _within(MAX_DECLINATION_RAD, frame.place_declination or 0.0), None),
    "lever_arm": (lambda frame: _within(MAX_LEVER_ARM_M, *frame.lever_arm), (0.0, 0.0, 0.0)),
    "ranges": (_are_ranges_sound, None),
    "compasses": (_are_compasses_sound, NO_COMPASS),
}
"""How to tell what may come in, by field of a frame, and what stands in for the rest."""


_SLOW_FIELDS: Final = slice(Frame._fields.index("baro"), Frame._fields.index("compasses") + 1)
_NOTHING_SEEN: Final[Any] = object()


class FrameDoor:
    """Looks at what comes with each frame.

    For inertial data that are unsound stand the last that were not; for what another sensor says nothing does.

    Attributes:
        is_open: nothing had to stand in for what came with the last frame but inertial data.
        delta: the inertial data of the last frame, as they came in.
        refused: in how many frames something else came in, by field of the frame.
    """

    def __init__(self) -> None:
        self._inertial = InertialGuard()
        self.delta: InertialDelta | None = None
        self.refused: Counter[str] = Counter()
        self._seen: Any = (_NOTHING_SEEN,) * len(Frame._fields[_SLOW_FIELDS])
        self._stand_ins: dict[str, Any] = {}
        self.is_open = True

    def note(self, delta: InertialDelta) -> None:
        """Note usable inertial data that have come in."""
        self.delta = self._inertial.newest = delta

    def admit(self, frame: Frame) -> Frame:
        """Return the frame with something else in place of what is refused."""
        if not self._has_been_seen(frame):
            self._seen = frame[_SLOW_FIELDS]
            self._stand_ins = {name: instead for name, (sound, instead) in _SLOW.items() if not sound(frame)}
            self.is_open = not self._stand_ins
        delta = self.delta = self._sound(frame.delta)
        if delta is frame.delta and not self._stand_ins:
            return frame
        stand_ins = self._stand_ins if delta is frame.delta else {"delta": delta, **self._stand_ins}
        self.refused.update(stand_ins.keys())
        return frame._replace(**stand_ins)

    def _has_been_seen(self, frame: Frame) -> bool:
        # Most frames bring what the one before has brought, but for inertial data.
        baro, mag, gps, declination, place_declination, lever_arm, _, ranges, compasses = self._seen
        return (
            frame.baro is baro
            and frame.mag is mag
            and frame.gps is gps
            and frame.declination is declination
            and frame.place_declination is place_declination
            and frame.lever_arm is lever_arm
            and frame.ranges is ranges
            and frame.compasses is compasses
        )

    def _sound(self, delta: InertialDelta) -> InertialDelta:
        delta = self._inertial.sound(delta)
        if delta.del_vel_dt >= MIN_DT and delta.del_ang_dt >= MIN_DT:
            return delta
        # As NavEKF3_core::readDeltaVelocity and readDeltaAngle do.
        return replace(delta, del_vel_dt=max(delta.del_vel_dt, MIN_DT), del_ang_dt=max(delta.del_ang_dt, MIN_DT))
