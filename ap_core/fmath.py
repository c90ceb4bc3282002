# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scalar float32 functions with the firmware's rounding.

All functions take and return ``numpy.float32``. Transcendental functions come from the C library where that
is glibc, because the firmware's simulator build calls the same ones and parity means the same 32 bits. Elsewhere
they are computed in binary64 and rounded once, which is within one unit in the last place.

Source: AP_Math/AP_Math.cpp, AP_Math/AP_Math.h, AP_Math/definitions.h.
"""

import ctypes
import math
from collections.abc import Callable
from typing import Final, SupportsFloat

import numpy as np

from ap_core.internal_error import InternalError, InternalErrorSink

f32 = np.float32

FLT_EPSILON: Final = f32(1.1920929e-07)
M_PI: Final = f32(math.pi)
M_PI_2: Final = f32(f32(math.pi) / f32(2))
M_2PI: Final = f32(M_PI * f32(2))
RAD_TO_DEG: Final = f32(f32(180) / M_PI)
NAN: Final = f32(math.nan)

_ZERO: Final = f32(0)
_ONE: Final = f32(1)
_MINUS_ONE: Final = f32(-1)
_MINUS_M_PI_2: Final = f32(-M_PI_2)
_360: Final = f32(360)
_M_PI_WIDE: Final = float(M_PI)
_M_2PI_WIDE: Final = float(M_2PI)

_Unary = Callable[[SupportsFloat], float]
_Binary = Callable[[SupportsFloat, SupportsFloat], float]

ieee754: Final = np.errstate(all="ignore")
"""Decorator: infinities and NaN are data, so numpy does not warn of them while the function runs."""


def load_libm() -> ctypes.CDLL | None:
    """Return glibc's maths library, or None on a platform without glibc."""
    try:
        return ctypes.PyDLL("libm.so.6")  # its functions are too short to be worth a release of Python's lock
    except OSError:
        return None


def _nan_outside_domain(function: _Unary) -> _Unary:
    def wrapped(x: SupportsFloat) -> float:
        try:
            return function(x)
        except ValueError:
            return math.nan

    return wrapped


_FALLBACK: Final[dict[str, _Unary]] = {
    "sinf": _nan_outside_domain(math.sin),
    "cosf": _nan_outside_domain(math.cos),
    "asinf": _nan_outside_domain(math.asin),
    "sqrtf": _nan_outside_domain(math.sqrt),
    "cbrtf": math.cbrt,
}


def bind_unary(libm: ctypes.CDLL | None, name: str) -> _Unary:
    """Return the C library's float function ``name``, or its binary64 stand-in when ``libm`` is None."""
    if libm is None:
        return _FALLBACK[name]
    function = libm[name]
    function.argtypes = [ctypes.c_float]
    function.restype = ctypes.c_float
    return function


def bind_atan2(libm: ctypes.CDLL | None) -> _Binary:
    """Return the C library's ``atan2f``, or its binary64 stand-in when ``libm`` is None."""
    if libm is None:
        return math.atan2
    function = libm["atan2f"]
    function.argtypes = [ctypes.c_float, ctypes.c_float]
    function.restype = ctypes.c_float
    return function


LIBM: Final = load_libm()
_sinf = bind_unary(LIBM, "sinf")
_cosf = bind_unary(LIBM, "cosf")
_asinf = bind_unary(LIBM, "asinf")
_sqrtf = bind_unary(LIBM, "sqrtf")
_cbrtf = bind_unary(LIBM, "cbrtf")
_atan2f = bind_atan2(LIBM)


def sinf(x: np.float32) -> np.float32:
    """Return the sine of ``x`` radians."""
    return f32(_sinf(x))


def cosf(x: np.float32) -> np.float32:
    """Return the cosine of ``x`` radians."""
    return f32(_cosf(x))


def asinf(x: np.float32) -> np.float32:
    """Return the arc sine of ``x`` in radians; NaN outside -1..1."""
    return f32(_asinf(x))


def sqrtf(x: np.float32) -> np.float32:
    """Return the square root of ``x``; NaN below zero."""
    return f32(_sqrtf(x))


def cbrtf(x: np.float32) -> np.float32:
    """Return the cube root of ``x``."""
    return f32(_cbrtf(x))


def atan2f(y: np.float32, x: np.float32) -> np.float32:
    """Return the angle of the point (x, y) in radians, -pi..pi."""
    return f32(_atan2f(y, x))


def _fmod(x: float, y: float) -> float:
    # C's fmod gives NaN for infinities where Python raises.
    return math.fmod(x, y) if math.isfinite(x) else math.nan


def is_zero(x: np.float32) -> bool:
    """Return whether |x| is below FLT_EPSILON (AP_Math.h, is_zero)."""
    return bool(abs(x) < FLT_EPSILON)


def safe_asin(v: np.float32) -> np.float32:
    """Return asin(v) clamped to +-pi/2 outside -1..1, and 0 for NaN (AP_Math.cpp, safe_asin)."""
    if math.isnan(v):
        return _ZERO
    if v >= _ONE:
        return M_PI_2
    if v <= _MINUS_ONE:
        return _MINUS_M_PI_2
    return asinf(v)


def constrain_float(
    amt: np.float32, low: np.float32, high: np.float32, errors: InternalErrorSink, line: int = 0
) -> np.float32:
    """Clamp ``amt``, testing ``low`` first; NaN gives the midpoint and an internal error.

    ``line`` is the firmware's source line of the call, which becomes part of the error.

    Source: AP_Math.cpp, constrain_value_line.
    """
    if math.isnan(amt):
        errors(InternalError.CONSTRAINING_NAN, line)
        return f32((low + high) / f32(2))
    if amt < low:
        return low
    if amt > high:
        return high
    return amt


def degrees(radians: np.float32) -> np.float32:
    """Convert radians to degrees with one float32 product (AP_Math.h, degrees)."""
    return radians * RAD_TO_DEG


def wrap_360(angle_deg: np.float32) -> np.float32:
    """Wrap degrees to 0..360 (AP_Math.cpp, wrap_360)."""
    res = f32(_fmod(float(angle_deg), 360.0))
    return res + _360 if res < _ZERO else res


def wrap_2pi(radians: float) -> float:
    """Wrap radians to 0..2 pi in binary64 with the float32 constant (AP_Math.cpp, wrap_2PI)."""
    res = _fmod(radians, _M_2PI_WIDE)
    return res + _M_2PI_WIDE if res < 0 else res


def wrap_pi(radians: float) -> float:
    """Wrap radians to -pi..pi in binary64 with the float32 constants (AP_Math.cpp, wrap_PI)."""
    res = wrap_2pi(radians)
    return res - _M_2PI_WIDE if res > _M_PI_WIDE else res


def norm3(x: np.float32, y: np.float32, z: np.float32) -> np.float32:
    """Return the length of (x, y, z) with the firmware's mixed precision.

    The sum of the last two squares is float32; the first square is added, and the root taken, in binary64.
    Source: AP_Math.h, norm and norm_squared.
    """
    total = float(x * x) + float(y * y + z * z)
    return f32(math.sqrt(total)) if total >= 0 else NAN
