# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The functions of :mod:`ap_core.fmath` over arrays of float32, bit for bit.

numpy's own trigonometry has other last bits, and other ones on each kind of processor. Its ufuncs though run any C
function over an array, by loops that are part of its binary interface; here they run those of the C library. Where
either is missing, the scalar function is called for each value.

Plain arithmetic is the same for arrays and numbers: Vector3f, Quaternion and Matrix3f hold either.
"""

import ctypes
from collections.abc import Callable
from typing import Any, Final, TypeAlias, cast

import numpy as np
import numpy.typing as npt

from ap_core import fmath
from ap_core.fmath import UNARY_LOOP, f32, ufunc_table
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f

Floats: TypeAlias = npt.NDArray[np.float32]

UnaryArray = Callable[[Floats], Floats]
BinaryArray = Callable[[Floats, Floats], Floats]

# PyUFunc_ff_f in numpy's table of ufunc functions (numpy/__ufunc_api.h).
_BINARY_LOOP: Final = 14
_ITEM_BYTES: Final = 4
_ZERO, _ONE, _TWO, _360 = f32(0), f32(1), f32(2), f32(360)

_LoopType = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)


def _looped(loop_address: int, libm: ctypes.CDLL, name: str, inputs: int) -> Callable[..., Floats]:
    loop = _LoopType(loop_address)
    function = ctypes.cast(libm[name], ctypes.c_void_p).value
    addresses, strides = ctypes.c_void_p * (inputs + 1), ctypes.c_ssize_t * (inputs + 1)
    steps = strides(*[_ITEM_BYTES] * (inputs + 1))

    def run(*arrays: Floats) -> Floats:
        given = [np.ascontiguousarray(array, f32) for array in np.broadcast_arrays(*arrays)]
        result = np.empty(given[0].shape, f32)
        pointers = addresses(*(array.ctypes.data for array in (*given, result)))
        loop(ctypes.byref(pointers), ctypes.byref(ctypes.c_ssize_t(result.size)), ctypes.byref(steps), function)
        return result

    return run


def _one_by_one(function: Callable[..., float], inputs: int) -> Callable[..., Floats]:
    each = np.frompyfunc(lambda *values: function(*map(float, values)), inputs, 1)

    def run(*arrays: Floats) -> Floats:
        with np.errstate(all="ignore"):
            return np.asarray(each(*arrays), f32)

    return run


def bind_unary(libm: ctypes.CDLL | None, table: Any, name: str) -> UnaryArray:
    """Return the C library's float function ``name`` over an array."""
    if libm is None or table is None:
        return _one_by_one(fmath.bind_unary(libm, name), 1)
    return _looped(table[UNARY_LOOP], libm, name, 1)


def bind_atan2(libm: ctypes.CDLL | None, table: Any) -> BinaryArray:
    """Return the C library's ``atan2f`` over two arrays."""
    if libm is None or table is None:
        return _one_by_one(fmath.bind_atan2(libm), 2)
    return _looped(table[_BINARY_LOOP], libm, "atan2f", 2)


_TABLE: Final = ufunc_table()
sinf_array: Final = bind_unary(fmath.LIBM, _TABLE, "sinf")
cosf_array: Final = bind_unary(fmath.LIBM, _TABLE, "cosf")
asinf_array: Final = bind_unary(fmath.LIBM, _TABLE, "asinf")
sqrtf_array: Final = bind_unary(fmath.LIBM, _TABLE, "sqrtf")
cbrtf_array: Final = bind_unary(fmath.LIBM, _TABLE, "cbrtf")
atan2f_array: Final = bind_atan2(fmath.LIBM, _TABLE)


def safe_asin_array(v: Floats) -> Floats:
    """Return asin clamped to +-pi/2, and 0 for NaN; see :func:`ap_core.fmath.safe_asin`."""
    inside = asinf_array(v)
    outside = np.where(v >= _ONE, fmath.M_PI_2, np.where(v <= -_ONE, -fmath.M_PI_2, inside))
    return np.where(np.isnan(v), _ZERO, outside)


def constrain_array(amt: Floats, low: np.float32, high: np.float32) -> Floats:
    """Clamp, testing ``low`` first; see :func:`ap_core.fmath.constrain_float`. NaN is left, and is the caller's."""
    return np.where(amt < low, low, np.where(amt > high, high, amt))


def wrap_360_array(angle_deg: Floats) -> Floats:
    """Wrap degrees to 0..360; the remainder of two float32 values is exact in any width."""
    res = np.fmod(angle_deg, _360)
    return np.where(res < _ZERO, res + _360, res)


def vector_of_arrays(components: Floats) -> Vector3f:
    """Return a vector that holds an array a component: its arithmetic is elementwise. The rows are x, y and z."""
    return Vector3f(*cast("list[np.float32]", list(components)))


def quaternion_of_arrays(components: Floats) -> Quaternion:
    """Return a quaternion that holds an array a component: its arithmetic is elementwise. The rows are w, x, y, z."""
    return Quaternion(*cast("list[np.float32]", list(components)))


def array_of(item: Vector3f | Quaternion, count: int) -> Floats:
    """Return the components as rows of ``count`` values each."""
    components = item.to_tuple() if isinstance(item, Vector3f) else item.to_wxyz()
    rows = np.empty((len(components), count), f32)
    for row, component in zip(rows, components, strict=True):
        row[:] = component
    return rows


def euler_arrays(attitude: Quaternion) -> tuple[Floats, Floats, Floats]:
    """Return (roll, pitch, yaw) in radians of a quaternion of arrays; see :meth:`Quaternion.to_euler`."""
    q1, q2, q3, q4 = (cast("Floats", component) for component in attitude.to_wxyz())
    roll = atan2f_array(_TWO * (q1 * q2 + q3 * q4), _ONE - _TWO * (q2 * q2 + q3 * q3))
    pitch = safe_asin_array(_TWO * (q1 * q3 - q4 * q2))
    yaw = atan2f_array(_TWO * (q1 * q4 + q2 * q3), _ONE - _TWO * (q3 * q3 + q4 * q4))
    return roll, pitch, yaw


def quaternion_from_euler_arrays(euler_rad: Floats) -> Quaternion:
    """Return the quaternion of rows of roll, pitch and yaw in radians; see :meth:`Quaternion.from_euler`."""
    half = euler_rad * f32(0.5)
    (cr2, cp2, cy2), (sr2, sp2, sy2) = cosf_array(half), sinf_array(half)
    components = (
        cr2 * cp2 * cy2 + sr2 * sp2 * sy2,
        sr2 * cp2 * cy2 - cr2 * sp2 * sy2,
        cr2 * sp2 * cy2 + sr2 * cp2 * sy2,
        cr2 * cp2 * sy2 - sr2 * sp2 * cy2,
    )
    return Quaternion(*cast("tuple[np.float32, ...]", components))
