# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The firmware's fixed orientations, as quaternions and as operations on a vector.

The two tables are separate because the firmware's are: each uses its own constants and its own order of
operations, and the results differ in the last bits.

Source: AP_Math/rotations.h (enum Rotation), AP_Math/quaternion.cpp (QuaternionT::from_rotation),
AP_Math/vector3.cpp (Vector3<T>::rotate).
"""

from collections.abc import Callable
from enum import IntEnum
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ap_core.internal_error import InternalError, InternalErrorSink
from ap_core.matrix3 import Matrix3f
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f


class Rotation(IntEnum):
    """Orientation numbers as stored in parameters."""

    NONE = 0
    YAW_45 = 1
    YAW_90 = 2
    YAW_135 = 3
    YAW_180 = 4
    YAW_225 = 5
    YAW_270 = 6
    YAW_315 = 7
    ROLL_180 = 8
    ROLL_180_YAW_45 = 9
    ROLL_180_YAW_90 = 10
    ROLL_180_YAW_135 = 11
    PITCH_180 = 12
    ROLL_180_YAW_225 = 13
    ROLL_180_YAW_270 = 14
    ROLL_180_YAW_315 = 15
    ROLL_90 = 16
    ROLL_90_YAW_45 = 17
    ROLL_90_YAW_90 = 18
    ROLL_90_YAW_135 = 19
    ROLL_270 = 20
    ROLL_270_YAW_45 = 21
    ROLL_270_YAW_90 = 22
    ROLL_270_YAW_135 = 23
    PITCH_90 = 24
    PITCH_270 = 25
    PITCH_180_YAW_90 = 26
    PITCH_180_YAW_270 = 27
    ROLL_90_PITCH_90 = 28
    ROLL_180_PITCH_90 = 29
    ROLL_270_PITCH_90 = 30
    ROLL_90_PITCH_180 = 31
    ROLL_270_PITCH_180 = 32
    ROLL_90_PITCH_270 = 33
    ROLL_180_PITCH_270 = 34
    ROLL_270_PITCH_270 = 35
    ROLL_90_PITCH_180_YAW_90 = 36
    ROLL_90_YAW_270 = 37
    ROLL_90_PITCH_68_YAW_293 = 38
    PITCH_315 = 39
    ROLL_90_PITCH_315 = 40
    PITCH_7 = 41
    ROLL_45 = 42
    ROLL_315 = 43
    CUSTOM_1 = 101
    CUSTOM_2 = 102


_H: Final = f32(0.70710678118654752440084436210485)
_C: Final = 0.92387953251128673848313610506011  # cos(pi/8)
_S: Final = 0.38268343236508972626808144923416  # sin(pi/8)
_A: Final = 0.65328148243818826392832158671359  # cos(pi/8) / sqrt(2)
_B: Final = 0.27059805007309849219986160268319  # sin(pi/8) / sqrt(2)
_HW: Final = float(_H)

_WXYZ: Final[dict[int, tuple[float, float, float, float]]] = {
    0: (1, 0, 0, 0),
    1: (_C, 0, 0, _S),
    2: (_HW, 0, 0, _HW),
    3: (_S, 0, 0, _C),
    4: (0, 0, 0, 1),
    5: (-_S, 0, 0, _C),
    6: (_HW, 0, 0, -_HW),
    7: (_C, 0, 0, -_S),
    8: (0, 1, 0, 0),
    9: (0, _C, _S, 0),
    10: (0, _HW, _HW, 0),
    11: (0, _S, _C, 0),
    12: (0, 0, 1, 0),
    13: (0, -_S, _C, 0),
    14: (0, -_HW, _HW, 0),
    15: (0, _C, -_S, 0),
    16: (_HW, _HW, 0, 0),
    17: (_A, _A, _B, _B),
    18: (0.5, 0.5, 0.5, 0.5),
    19: (_B, _B, _A, _A),
    20: (_HW, -_HW, 0, 0),
    21: (_A, -_A, -_B, _B),
    22: (0.5, -0.5, -0.5, 0.5),
    23: (_B, -_B, -_A, _A),
    24: (_HW, 0, _HW, 0),
    25: (_HW, 0, -_HW, 0),
    26: (0, -_HW, _HW, 0),
    27: (0, _HW, _HW, 0),
    28: (-0.5, -0.5, -0.5, 0.5),
    29: (0, -_HW, 0, _HW),
    30: (0.5, -0.5, 0.5, 0.5),
    31: (0, 0, -_HW, _HW),
    32: (0, 0, _HW, _HW),
    33: (0.5, 0.5, -0.5, 0.5),
    34: (0, _HW, 0, _HW),
    35: (-0.5, 0.5, 0.5, 0.5),
    36: (-0.5, 0.5, -0.5, 0.5),
    37: (-0.5, -0.5, 0.5, 0.5),
    38: (
        0.26774500501681575137524760066299,
        0.70698804688952421315661922562867,
        0.012957683254962659713527273197542,
        -0.65445596665363614530264158020145,
    ),
    39: (_C, 0, -_S, 0),
    40: (_A, _A, -_B, _B),
    41: (0.99813479842186692003735970502021, 0, 0.061048539534856872956769535676358, 0),
    42: (_C, _S, 0, 0),
    43: (_C, -_S, 0, 0),
    # Custom orientations have their own angles, which are zero unless set.
    101: (1, 0, 0, 0),
    102: (1, 0, 0, 0),
}

_QUATERNIONS: Final = {rotation: Quaternion(*wxyz) for rotation, wxyz in _WXYZ.items()}

_F = np.float32
_Step = Callable[[_F, _F, _F], tuple[_F, _F, _F]]


# Parts of chains. An orientation that the firmware does not chain is written out: some chains give the other sign of
# zero.
_LINKS: Final[dict[str, _Step]] = {
    "roll_90": lambda x, y, z: (x, -z, y),
    "roll_180": lambda x, y, z: (x, -y, -z),
    "roll_270": lambda x, y, z: (x, z, -y),
    "pitch_90": lambda x, y, z: (z, y, -x),
    "pitch_180": lambda x, y, z: (-x, y, -z),
    "pitch_270": lambda x, y, z: (-z, y, x),
    "pitch_315": lambda x, y, z: (_H * (x - z), y, _H * (x + z)),
    "yaw_45": lambda x, y, z: (_H * (x - y), _H * (x + y), z),
    "yaw_90": lambda x, y, z: (-y, x, z),
    "yaw_135": lambda x, y, z: (-_H * (x + y), _H * (x - y), z),
    "yaw_270": lambda x, y, z: (y, -x, z),
}


def _chain(*names: str) -> _Step:
    steps = [_LINKS[name] for name in names]

    def run(x: _F, y: _F, z: _F) -> tuple[_F, _F, _F]:
        for step in steps:
            x, y, z = step(x, y, z)
        return x, y, z

    return run


_PITCH_7_SIN: Final = f32(0.1218693434051474899781908334262)
_PITCH_7_COS: Final = f32(0.99254615164132198312785249072476)

_ROTATION_38: Final = Matrix3f(
    Vector3f(
        0.14303897231223747232853327204793,
        0.36877648650320382639478111741482,
        -0.91844638134308709265241077446262,
    ),
    Vector3f(
        -0.33213277779664740485543461545603,
        -0.85628942146641884303193137384369,
        -0.39554550256296522325882847326284,
    ),
    Vector3f(
        -0.93232380121551217122544130688766,
        0.36162457008209242248497616856184,
        0.00000000000000002214311861220361,
    ),
)
_CUSTOM: Final = Matrix3f.from_euler(f32(0), f32(0), f32(0))


def _times(matrix: Matrix3f) -> _Step:
    return lambda x, y, z: (matrix * Vector3f(x, y, z)).to_tuple()


_STEPS: Final[dict[int, _Step]] = {
    0: lambda x, y, z: (x, y, z),
    1: _LINKS["yaw_45"],
    2: _LINKS["yaw_90"],
    3: _LINKS["yaw_135"],
    4: lambda x, y, z: (-x, -y, z),
    5: lambda x, y, z: (_H * (y - x), -_H * (x + y), z),
    6: _LINKS["yaw_270"],
    7: lambda x, y, z: (_H * (x + y), _H * (y - x), z),
    8: _LINKS["roll_180"],
    9: lambda x, y, z: (_H * (x + y), _H * (x - y), -z),
    10: lambda x, y, z: (y, x, -z),
    11: lambda x, y, z: (_H * (y - x), _H * (y + x), -z),
    12: _LINKS["pitch_180"],
    13: lambda x, y, z: (-_H * (x + y), _H * (y - x), -z),
    14: lambda x, y, z: (-y, -x, -z),
    15: lambda x, y, z: (_H * (x - y), -_H * (x + y), -z),
    16: _LINKS["roll_90"],
    17: _chain("roll_90", "yaw_45"),
    18: _chain("roll_90", "yaw_90"),
    19: _chain("roll_90", "yaw_135"),
    20: _LINKS["roll_270"],
    21: _chain("roll_270", "yaw_45"),
    22: _chain("roll_270", "yaw_90"),
    23: _chain("roll_270", "yaw_135"),
    24: _LINKS["pitch_90"],
    25: _LINKS["pitch_270"],
    26: lambda x, y, z: (-y, -x, -z),
    27: lambda x, y, z: (y, x, -z),
    28: _chain("roll_90", "pitch_90"),
    29: _chain("roll_180", "pitch_90"),
    30: _chain("roll_270", "pitch_90"),
    31: _chain("roll_90", "pitch_180"),
    32: _chain("roll_270", "pitch_180"),
    33: _chain("roll_90", "pitch_270"),
    34: _chain("roll_180", "pitch_270"),
    35: _chain("roll_270", "pitch_270"),
    36: _chain("roll_90", "pitch_180", "yaw_90"),
    37: _chain("roll_90", "yaw_270"),
    38: _times(_ROTATION_38),
    39: _LINKS["pitch_315"],
    40: _chain("roll_90", "pitch_315"),
    41: lambda x, y, z: (_PITCH_7_COS * x + _PITCH_7_SIN * z, y, -_PITCH_7_SIN * x + _PITCH_7_COS * z),
    42: lambda x, y, z: (x, _H * (y - z), _H * (y + z)),
    43: lambda x, y, z: (x, _H * (y + z), _H * (z - y)),
    101: _times(_CUSTOM),
    102: _times(_CUSTOM),
}


def rotate_vector(v: Vector3f, rotation: int, errors: InternalErrorSink) -> Vector3f:
    """Rotate ``v`` by an orientation number; an unknown one leaves it unchanged and raises an internal error.

    Source: vector3.cpp, Vector3<T>::rotate.
    """
    step = _STEPS.get(rotation)
    if step is None:
        errors(InternalError.BAD_ROTATION, 273)
        return v
    return Vector3f(*step(v.x, v.y, v.z))


def quaternion_from_rotation(rotation: int, errors: InternalErrorSink) -> Quaternion:
    """Return the quaternion of an orientation number; an unknown one gives the identity and an internal error.

    Source: quaternion.cpp, QuaternionT::from_rotation on a freshly constructed quaternion.
    """
    quaternion = _QUATERNIONS.get(rotation)
    if quaternion is None:
        errors(InternalError.BAD_ROTATION, 395)
        return Quaternion()
    return quaternion
