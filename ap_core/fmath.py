# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scalar float32 functions with the firmware's rounding.

Everything here takes and returns ``numpy.float32``. Transcendental functions come from the C library where that
is glibc, because the firmware's simulator build calls the same ones and parity means the same 32 bits. Elsewhere
they are computed in binary64 and rounded once, which is within one unit in the last place.

Source: AP_Math/AP_Math.cpp, AP_Math/AP_Math.h, AP_Math/definitions.h.
"""

import ctypes
import importlib
import math
from collections.abc import Callable
from contextvars import ContextVar, copy_context
from functools import wraps
from typing import Any, Final, ParamSpec, SupportsFloat, TypeVar

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
_INFINITY: Final = f32(math.inf)
_MINUS_INFINITY: Final = f32(-math.inf)
_360: Final = f32(360)
_M_PI_WIDE: Final = float(M_PI)
_M_2PI_WIDE: Final = float(M_2PI)

# Places in numpy's table of ufunc functions (numpy/__ufunc_api.h): PyUFunc_FromFuncAndData and PyUFunc_f_f.
_FROM_FUNC_AND_DATA: Final = 1
_UNARY_LOOP: Final = 6
_FLOAT_TYPE: Final = 11  # NPY_FLOAT

_Unary = Callable[[SupportsFloat], float]
_Binary = Callable[[SupportsFloat, SupportsFloat], float]
_Rounded = Callable[[np.float32], np.float32]

_P = ParamSpec("_P")
_T = TypeVar("_T")

_WARNINGS: Final = "numpy.ufunc.extobj"


def _silence() -> tuple[ContextVar[Any], object] | None:
    """Return where numpy keeps of what it warns, and what stands there while that is nothing; None in other numpys."""
    with np.errstate(all="ignore"):
        found = [(variable, value) for variable, value in copy_context().items() if variable.name == _WARNINGS]
    return found[0] if found else None


_SILENCE: Final = _silence()


def ieee754(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Have numpy compute with infinities and NaN, which are data, without a word while a function runs."""
    if _SILENCE is None:
        return np.errstate(all="ignore")(function)
    variable, silent = _SILENCE  # a quarter of the time that np.errstate takes; and nothing where numpy is silent

    @wraps(function)
    def wrapped(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        if variable.get(None) is silent:
            return function(*args, **kwargs)
        token = variable.set(silent)
        try:
            return function(*args, **kwargs)
        finally:
            variable.reset(token)

    return wrapped


def load_libm() -> ctypes.CDLL | None:
    """Return glibc's maths library, or None on a platform without glibc."""
    try:
        return ctypes.PyDLL("libm.so.6")  # what it does is too short to let go of Python's lock
    except OSError:
        return None


def _ufunc_table() -> Any:
    """Return numpy's table of ufunc functions, or None where this Python or numpy has none."""
    try:
        capsule: Any = importlib.import_module("numpy._core._multiarray_umath").__dict__["_UFUNC_API"]
        pointer = ctypes.pythonapi.PyCapsule_GetPointer
        pointer.restype, pointer.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
        return ctypes.cast(pointer(capsule, None), ctypes.POINTER(ctypes.c_void_p))
    except (ImportError, AttributeError, KeyError, ValueError):
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


# Numbers reach a C function through a ufunc of numpy in a third of the time that they take through ctypes.
_ufunc_parts: Final[list[Any]] = []  # which numpy does not keep alive


def bind_rounded(libm: ctypes.CDLL | None, table: Any, name: str) -> _Rounded:
    """Return the C library's float function ``name``, or its binary64 stand-in, with a result of float32.

    As any ufunc it may warn of an argument of which the function is not defined.
    """
    if libm is None or table is None:
        function = bind_unary(libm, name)
        return lambda x: _ONE * function(x)
    pointers, result, text = ctypes.POINTER(ctypes.c_void_p), ctypes.py_object, ctypes.c_char_p
    make = ctypes.PYFUNCTYPE(result, pointers, pointers, text, *[ctypes.c_int] * 4, text, text, ctypes.c_int)
    loops = (ctypes.c_void_p * 1)(table[_UNARY_LOOP])
    functions = (ctypes.c_void_p * 1)(ctypes.cast(libm[name], ctypes.c_void_p).value)
    types, label = bytes((_FLOAT_TYPE, _FLOAT_TYPE)), name.encode()
    _ufunc_parts.append((loops, functions, types, label))
    ufunc: _Rounded = make(table[_FROM_FUNC_AND_DATA])(loops, functions, types, 1, 1, 1, -1, label, label, 0)
    return ufunc


LIBM: Final = load_libm()
_TABLE: Final = _ufunc_table()
_sinf = bind_rounded(LIBM, _TABLE, "sinf")
_cosf = bind_rounded(LIBM, _TABLE, "cosf")
_asinf = bind_rounded(LIBM, _TABLE, "asinf")
_cbrtf = bind_rounded(LIBM, _TABLE, "cbrtf")
_other_sinf = bind_unary(LIBM, "sinf")
_other_cosf = bind_unary(LIBM, "cosf")
_other_asinf = bind_unary(LIBM, "asinf")
_other_sqrtf = bind_unary(LIBM, "sqrtf")
_other_cbrtf = bind_unary(LIBM, "cbrtf")
_atan2f = bind_atan2(LIBM)

# Below, ``_ONE * x`` rounds a Python float to float32 as ``f32(x)`` does, in a third of the time. Where a function is
# not defined, ctypes calls it, so that the NaN is the C library's and numpy does not warn.


def sinf(x: np.float32) -> np.float32:
    """Return the sine of ``x`` radians."""
    return _sinf(x) if _MINUS_INFINITY < x < _INFINITY else _ONE * _other_sinf(x)


def cosf(x: np.float32) -> np.float32:
    """Return the cosine of ``x`` radians."""
    return _cosf(x) if _MINUS_INFINITY < x < _INFINITY else _ONE * _other_cosf(x)


def asinf(x: np.float32) -> np.float32:
    """Return the arc sine of ``x`` in radians; NaN outside -1..1."""
    return _asinf(x) if _MINUS_ONE <= x <= _ONE else _ONE * _other_asinf(x)


def sqrtf(x: np.float32) -> np.float32:
    """Return the square root of ``x``; NaN below zero."""
    # A root in binary64 that is rounded once more is the right one in float32.
    return _ONE * (math.sqrt(x) if x >= _ZERO else _other_sqrtf(x))


def cbrtf(x: np.float32) -> np.float32:
    """Return the cube root of ``x``."""
    return _ONE * _other_cbrtf(x) if math.isnan(x) else _cbrtf(x)


def atan2f(y: np.float32, x: np.float32) -> np.float32:
    """Return the angle of the point (x, y) in radians, -pi..pi."""
    return _ONE * _atan2f(y, x)


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

    ``line`` is where the firmware calls it, which becomes part of the error.

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
