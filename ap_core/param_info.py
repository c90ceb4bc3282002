# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of parameter tables: types, flags, metadata, and the conversion of numbers to a type.

Source: AP_Param/AP_Param.h (ap_var_type, GroupInfo), AP_Param/AP_Param.cpp (set_float), AP_Math/AP_Math.cpp
(is_equal).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from typing import Final

import numpy as np

from ap_core.cint import i8, i16, i32
from ap_core.fmath import FLT_EPSILON, f32

MAX_NAME_SIZE: Final = 16
"""Longest full parameter name; it is the width of MAVLink's ``param_id`` (AP_MAX_NAME_SIZE)."""

_MAV_PARAM_TYPE_REAL32: Final = 9
_ROUNDING_ADDITION: Final = f32(0.01)
_FLT_MAX: Final = float(np.finfo(f32).max)


class ParamType(IntEnum):
    """Stored types of parameters, with the firmware's numbers (ap_var_type)."""

    INT8 = 1
    INT16 = 2
    INT32 = 3
    FLOAT = 4
    VECTOR3F = 5

    @property
    def wire_type(self) -> int:
        """The MAV_PARAM_TYPE that PARAM_VALUE carries (GCS_MAVLink.cpp, mav_param_type)."""
        return _WIRE_TYPE.get(self, _MAV_PARAM_TYPE_REAL32)

    @property
    def bits(self) -> int:
        """Width of an integer type, 0 for the others."""
        return _BITS.get(self, 0)


_WIRE_TYPE: Final = {ParamType.INT8: 2, ParamType.INT16: 4, ParamType.INT32: 6}
_BITS: Final = {ParamType.INT8: 8, ParamType.INT16: 16, ParamType.INT32: 32}
_NARROW: Final[dict[ParamType, Callable[[int], int]]] = {
    ParamType.INT8: i8,
    ParamType.INT16: i16,
    ParamType.INT32: i32,
}


class ParamFlag(IntFlag):
    """Flags of a row."""

    NONE = 0
    ENABLE = 1
    """First row of a group: while it is 0 the others are not listed."""
    READ_ONLY = 2
    """Not settable over MAVLink."""
    HIDDEN = 4
    """Readable and settable by name, but never listed and never echoed."""


@dataclass(frozen=True, slots=True)
class ParamInfo:
    """One row of a table (AP_Param.h, GroupInfo) with its documentation.

    ``name`` follows the group's prefix. ``range`` and ``values`` are documentation; nothing enforces them, as in the
    firmware. A vector has three defaults.
    """

    name: str
    type: ParamType
    default: float | tuple[float, float, float]
    description: str
    unit: str = ""
    range: tuple[float, float] | None = None
    values: Mapping[int, str] = field(default_factory=dict)
    flags: ParamFlag = ParamFlag.NONE
    reboot_required: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.default, tuple) != (self.type is ParamType.VECTOR3F):
            raise ValueError(f"{self.name}: a vector needs three defaults, any other type one")


ParamValue = int | np.float32
"""The value of a scalar: int for the integer types, float32 for FLOAT and the elements of a vector."""


def to_f32(value: float | np.float32) -> np.float32:
    """Round a number to float32; values too large become infinite, without a warning."""
    if -_FLT_MAX <= value <= _FLT_MAX:
        return f32(value)
    with np.errstate(over="ignore"):
        return f32(value)


def is_equal(a: np.float32, b: np.float32) -> bool:
    """Return whether two values differ by less than FLT_EPSILON; false with NaN (AP_Math.cpp, is_equal)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(abs(a - b) < FLT_EPSILON)


def is_within_hundredth_percent(value: np.float32, reference: np.float32) -> bool:
    """Return whether ``reference`` is within 0.01 % of ``value`` (AP_Param.cpp, save_sync)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(abs(value - reference) < f32(0.0001) * abs(value))


def assigned(value: float | np.float32, kind: ParamType) -> ParamValue:
    """Convert as a C assignment does: truncate toward zero and wrap to the width; FLOAT rounds to float32.

    Raises ValueError for a NaN or infinite value of an integer type.
    """
    if kind not in _NARROW:
        return to_f32(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be stored as an integer")
    return _NARROW[kind](int(value))


def from_wire(value: np.float32, kind: ParamType) -> ParamValue:
    """Convert a finite number that came over MAVLink or from a file (AP_Param.cpp, set_float).

    Integers get 0.01 added away from zero in float32, are limited to the range of the type and truncated.
    """
    if kind not in _NARROW:
        return value
    v = f32(value - _ROUNDING_ADDITION) if value < 0 else f32(value + _ROUNDING_ADDITION)
    # FIRMWARE PARITY: the firmware's upper limit for INT32 rounds to 2147483648.0, whose conversion C leaves
    # undefined: INT32_MIN on x86-64, INT32_MAX on the ARM boards. This follows the board.
    limit = 1 << (kind.bits - 1)
    return max(-limit, min(int(v), limit - 1))
