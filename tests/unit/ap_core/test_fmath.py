# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scalar float32 maths: limits, NaN, infinities, and the way without glibc."""

import ctypes
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ap_core import fmath
from ap_core.fmath import f32
from ap_core.internal_error import InternalError, InternalErrors

FLOATS = st.floats(width=32)
FINITE = st.floats(width=32, allow_nan=False, allow_infinity=False)

UNARY = ("sinf", "cosf", "asinf", "sqrtf", "cbrtf")
NO_GLIBC = pytest.mark.skipif(fmath.LIBM is None, reason="compares with glibc")


def within_one_ulp(a: np.float32, b: np.float32) -> bool:
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    return bool(a == b or np.nextafter(a, b) == b)


@pytest.mark.parametrize(
    ("constant", "value"),
    [
        (fmath.M_PI, 3.1415927410125732),
        (fmath.M_PI_2, 1.5707963705062866),
        (fmath.M_2PI, 6.2831854820251465),
        (fmath.RAD_TO_DEG, 57.2957763671875),
        (fmath.FLT_EPSILON, 2.0**-23),
    ],
)
def test_constant_is_the_single_precision_one(constant: np.float32, value: float) -> None:
    assert isinstance(constant, np.float32)
    assert float(constant) == value


@pytest.mark.parametrize(
    "result",
    [
        fmath.sinf(f32(1)),
        fmath.cosf(f32(1)),
        fmath.asinf(f32(0.5)),
        fmath.sqrtf(f32(2)),
        fmath.cbrtf(f32(2)),
        fmath.atan2f(f32(1), f32(2)),
        *(fmath.safe_asin(f32(v)) for v in (math.nan, 0.5, 1, -1)),
        *(fmath.constrain_float(f32(v), f32(0), f32(1), InternalErrors()) for v in (math.nan, -1, 0.5, 2)),
        fmath.degrees(f32(1)),
        fmath.wrap_360(f32(1)),
        fmath.wrap_360(f32(-1)),
        fmath.norm3(f32(1), f32(2), f32(3)),
        fmath.norm3(f32(math.nan), f32(2), f32(3)),
    ],
)
def test_result_is_float32(result: object) -> None:
    assert type(result) is np.float32


def any_number(test: Callable[..., None]) -> Callable[..., None]:
    """Run a test with any float32, and where functions begin, end or change sign."""
    for x in (math.inf, -math.inf, -0.0, 1.0, -1.0, 1.0000001192092896, -1.0000001192092896, float(f32(-1e-45))):
        test = example(x=x)(test)
    return given(x=FLOATS)(test)


@pytest.mark.parametrize("name", UNARY)
@NO_GLIBC
@any_number
def test_way_without_glibc_is_within_one_ulp(name: str, x: float) -> None:
    ours, theirs = fmath.bind_unary(None, name)(x), fmath.bind_unary(fmath.LIBM, name)(x)
    assert within_one_ulp(f32(ours), f32(theirs))


@NO_GLIBC
@given(y=FLOATS, x=FLOATS)
@example(y=0.0, x=-1.0)
@example(y=-0.0, x=-1.0)
@example(y=math.inf, x=-math.inf)
def test_atan2_without_glibc_is_within_one_ulp(y: float, x: float) -> None:
    ours, theirs = fmath.bind_atan2(None)(y, x), fmath.bind_atan2(fmath.LIBM)(y, x)
    assert within_one_ulp(f32(ours), f32(theirs))


def bits(x: np.float32) -> int:
    return int(x.view(np.uint32))


@pytest.mark.parametrize("name", UNARY)
@NO_GLIBC
@any_number
def test_result_is_the_c_library_s_to_the_last_bit_and_comes_without_a_warning(name: str, x: float) -> None:
    assert bits(getattr(fmath, name)(f32(x))) == bits(f32(fmath.bind_unary(fmath.LIBM, name)(x)))


@NO_GLIBC
@given(y=FLOATS, x=FLOATS)
def test_atan2_is_the_c_library_s_to_the_last_bit(y: float, x: float) -> None:
    assert bits(fmath.atan2f(f32(y), f32(x))) == bits(f32(fmath.bind_atan2(fmath.LIBM)(y, x)))


@pytest.mark.parametrize("name", UNARY)
def test_without_the_c_library_results_are_rounded_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmath, f"_{name}", fmath.bind_unary(None, name))
    result = getattr(fmath, name)(f32(0.3))
    assert type(result) is np.float32
    assert result == f32(fmath.bind_unary(None, name)(f32(0.3)))


LARGE = f32(3e38)


@fmath.ieee754
def squared(x: np.float32) -> np.float32:
    return x * x


@fmath.ieee754
def squared_twice(x: np.float32, *, fails: bool = False) -> np.float32:
    if fails:
        raise LookupError
    return squared(squared(x)) + x * x


def test_overflow_gives_infinity_without_a_warning() -> None:
    assert squared(LARGE) == squared_twice(LARGE) == np.inf


def test_numpy_warns_again_afterwards() -> None:
    squared_twice(LARGE)
    with pytest.raises(LookupError):
        squared_twice(LARGE, fails=True)
    with pytest.warns(RuntimeWarning, match="overflow"):
        LARGE * LARGE
    with np.errstate(over="raise"):
        assert squared(LARGE) == np.inf


@pytest.mark.parametrize(("name", "x"), [("sinf", math.inf), ("cosf", math.inf), ("asinf", 1.5), ("sqrtf", -1.0)])
def test_way_without_glibc_gives_nan_outside_the_domain(name: str, x: float) -> None:
    assert math.isnan(fmath.bind_unary(None, name)(x))


def test_no_library_on_a_platform_without_glibc(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> ctypes.PyDLL:
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(ctypes, "PyDLL", absent)
    assert fmath.load_libm() is None


@pytest.mark.parametrize("function", [fmath.sinf, fmath.cosf, fmath.asinf, fmath.sqrtf, fmath.cbrtf])
def test_nan_gives_nan(function: Callable[[np.float32], np.float32]) -> None:
    assert math.isnan(function(fmath.NAN))


@pytest.mark.parametrize(("x", "zero"), [(0.0, True), (-0.0, True), (2.0**-23, False), (-(2.0**-23), False)])
def test_is_zero_ends_below_epsilon(x: float, zero: bool) -> None:
    assert fmath.is_zero(f32(x)) is zero


def test_is_zero_just_below_epsilon() -> None:
    assert fmath.is_zero(np.nextafter(fmath.FLT_EPSILON, f32(0)))


def test_nan_is_not_zero() -> None:
    assert not fmath.is_zero(fmath.NAN)


@pytest.mark.parametrize("v", [1.0, 1.0000001, math.inf])
def test_safe_asin_at_and_above_one_is_half_pi(v: float) -> None:
    assert fmath.safe_asin(f32(v)) == fmath.M_PI_2


@pytest.mark.parametrize("v", [-1.0, -1.0000001, -math.inf])
def test_safe_asin_at_and_below_minus_one_is_minus_half_pi(v: float) -> None:
    assert fmath.safe_asin(f32(v)) == -fmath.M_PI_2


def test_safe_asin_of_nan_is_zero() -> None:
    assert fmath.safe_asin(fmath.NAN) == 0


def test_safe_asin_inside_is_asin() -> None:
    below_one = np.nextafter(f32(1), f32(0))
    assert fmath.safe_asin(below_one) == fmath.asinf(below_one) < fmath.M_PI_2


@pytest.mark.parametrize(("amt", "expected"), [(-math.inf, 1), (0.5, 1), (1, 1), (2, 2), (3, 3), (4, 3), (math.inf, 3)])
def test_constrain_clamps(amt: float, expected: float) -> None:
    assert fmath.constrain_float(f32(amt), f32(1), f32(3), InternalErrors()) == expected


def test_constrain_raises_no_error_for_numbers() -> None:
    errors = InternalErrors()
    fmath.constrain_float(f32(math.inf), f32(1), f32(3), errors)
    assert errors.count == 0


def test_constrain_of_nan_is_the_midpoint() -> None:
    assert fmath.constrain_float(fmath.NAN, f32(1), f32(4), InternalErrors()) == 2.5


def test_constrain_of_nan_is_an_internal_error() -> None:
    errors = InternalErrors()
    fmath.constrain_float(fmath.NAN, f32(1), f32(4), errors)
    assert (errors.count, errors.last) == (1, InternalError.CONSTRAINING_NAN)


@pytest.mark.parametrize(("amt", "expected"), [(1, 5), (4, 5), (5, 2), (6, 2)])
def test_constrain_tests_the_lower_limit_first(amt: float, expected: float) -> None:
    # Limits in the wrong order, as VISO_POS_M_NSE above 100 makes them.
    assert fmath.constrain_float(f32(amt), f32(5), f32(2), InternalErrors()) == expected


def test_constrain_ignores_limits_that_are_nan() -> None:
    assert fmath.constrain_float(f32(7), fmath.NAN, fmath.NAN, InternalErrors()) == 7


def test_degrees_is_one_product() -> None:
    assert float(fmath.degrees(f32(3))) == float(f32(3 * 57.2957763671875))


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(0, 0), (359.5, 359.5), (360, 0), (725, 5), (-90, 270), (-360, 0), (-725, 355)]
)
def test_wrap_360(angle: float, wrapped: float) -> None:
    assert fmath.wrap_360(f32(angle)) == wrapped


def test_wrap_360_of_a_tiny_negative_angle_rounds_to_360() -> None:
    assert fmath.wrap_360(f32(-1e-9)) == 360


@pytest.mark.parametrize("angle", [math.inf, -math.inf, math.nan])
def test_wrapping_what_is_not_finite_gives_nan(angle: float) -> None:
    assert math.isnan(fmath.wrap_360(f32(angle)))
    assert math.isnan(fmath.wrap_2pi(angle))
    assert math.isnan(fmath.wrap_pi(angle))


def test_wrap_2pi_wraps_at_the_single_precision_constant() -> None:
    two_pi = float(fmath.M_2PI)
    assert fmath.wrap_2pi(two_pi) == 0
    assert fmath.wrap_2pi(2 * math.pi) == 2 * math.pi  # the true value is below the constant


def test_wrap_2pi_adds_the_single_precision_constant() -> None:
    assert fmath.wrap_2pi(-1.0) == 6.2831854820251465 - 1.0


def test_wrap_2pi_keeps_binary64() -> None:
    assert fmath.wrap_2pi(0.1) == 0.1 != float(f32(0.1))


def test_wrap_pi_keeps_the_single_precision_pi() -> None:
    pi = float(fmath.M_PI)
    assert fmath.wrap_pi(pi) == pi


def test_wrap_pi_subtracts_above_the_single_precision_pi() -> None:
    above = math.nextafter(float(fmath.M_PI), 4)
    assert fmath.wrap_pi(above) == above - 6.2831854820251465


@given(x=FINITE)
def test_wrapped_angles_are_in_range(x: float) -> None:
    assert 0 <= fmath.wrap_2pi(x) <= float(fmath.M_2PI)
    assert -float(fmath.M_PI) <= fmath.wrap_pi(x) <= float(fmath.M_PI)
    assert 0 <= fmath.wrap_360(f32(x)) <= 360


def test_norm3_adds_the_first_square_in_binary64() -> None:
    # In float32, 1 + 2**-25 + 2**-25 is 1 when the first square is rounded in; here the small squares count.
    x, y, z = f32(4096), f32(0.25), f32(0)
    wide = math.sqrt(4096.0**2 + 0.0625)
    assert float(fmath.norm3(x, y, z)) == float(f32(wide))


def test_norm3_adds_the_other_squares_in_float32() -> None:
    y, z = f32(4097), f32(1)
    total = float(y * y + z * z)
    assert total != 4097.0**2 + 1
    assert float(fmath.norm3(f32(0), y, z)) == float(f32(math.sqrt(total)))


def test_norm3_of_an_overflowing_square_is_infinite() -> None:
    with np.errstate(over="ignore"):
        assert fmath.norm3(f32(1e30), f32(0), f32(0)) == math.inf


def test_norm3_with_nan_is_nan() -> None:
    assert math.isnan(fmath.norm3(f32(1), fmath.NAN, f32(0)))


@pytest.mark.parametrize("length", [0.0, 2.0**-10, 0.5])
def test_norm3_of_a_short_vector(length: float) -> None:
    assert fmath.norm3(f32(0), f32(-length), f32(0)) == length
