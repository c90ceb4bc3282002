# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions over arrays have the bits of the scalar ones, with and without the C library."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ap_core import fmath, fmath_arrays
from ap_core.fmath import f32
from ap_core.fmath_arrays import Floats
from ap_core.internal_error import InternalErrors
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f

FLOATS = st.floats(width=32)
FEW = settings(max_examples=25)
LISTS = st.lists(FLOATS, max_size=40)
UNARY = ("sinf", "cosf", "asinf", "sqrtf", "cbrtf")
EDGES = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1.0000001,
    float("inf"),
    float("-inf"),
    float("nan"),
    1e-45,
    3.4e38,
    360.0,
    -360.0,
    -1e-45,
]


def column(values: Sequence[float]) -> Floats:
    return np.array(values, f32)


def same_bits(ours: Floats, expected: Sequence[np.float32]) -> bool:
    """Tell whether all are equal to the bit, any NaN being equal to any other."""
    theirs = np.array(expected, f32)
    both_nan = np.isnan(ours) & np.isnan(theirs)
    return ours.dtype == f32 and bool((both_nan | (ours.view(np.uint32) == theirs.view(np.uint32))).all())


@pytest.mark.parametrize("name", UNARY)
@FEW
@given(values=LISTS)
@example(values=EDGES)
def test_function_of_an_array_has_the_scalar_bits(name: str, values: list[float]) -> None:
    over_array: Callable[[Floats], Floats] = getattr(fmath_arrays, f"{name}_array")
    one = getattr(fmath, name)
    assert same_bits(over_array(column(values)), [one(f32(value)) for value in values])


@FEW
@given(pairs=st.lists(st.tuples(FLOATS, FLOATS), max_size=40))
def test_atan2_of_arrays_has_the_scalar_bits(pairs: list[tuple[float, float]]) -> None:
    y, x = column([pair[0] for pair in pairs]), column([pair[1] for pair in pairs])
    assert same_bits(fmath_arrays.atan2f_array(y, x), [fmath.atan2f(*pair) for pair in zip(y, x, strict=True)])


@FEW
@given(values=LISTS)
@example(values=EDGES)
def test_guarded_functions_of_arrays_have_the_scalar_bits(values: list[float]) -> None:
    with np.errstate(all="ignore"):
        array = column(values)
        assert same_bits(fmath_arrays.safe_asin_array(array), [fmath.safe_asin(value) for value in array])
        assert same_bits(fmath_arrays.wrap_360_array(array), [fmath.wrap_360(value) for value in array])


@FEW
@given(values=LISTS, low=FLOATS, high=FLOATS)
def test_clamping_an_array_does_what_clamping_each_does(values: list[float], low: float, high: float) -> None:
    array = column([value for value in values if value == value])
    expected = [fmath.constrain_float(value, f32(low), f32(high), InternalErrors()) for value in array]
    assert same_bits(fmath_arrays.constrain_array(array, f32(low), f32(high)), expected)


@FEW
@given(rows=st.lists(st.tuples(FLOATS, FLOATS, FLOATS, FLOATS), min_size=1, max_size=20))
def test_attitudes_in_arrays_become_the_scalar_angles(rows: list[tuple[float, float, float, float]]) -> None:
    with np.errstate(all="ignore"):
        wxyz = np.array(rows, f32).T
        euler = fmath_arrays.euler_arrays(fmath_arrays.quaternion_of_arrays(wxyz))
        for axis, angles in enumerate(euler):
            assert same_bits(angles, [Quaternion(*row).to_euler()[axis] for row in rows])


@FEW
@given(rows=st.lists(st.tuples(FLOATS, FLOATS, FLOATS), min_size=1, max_size=20))
def test_angles_in_arrays_become_the_scalar_attitudes(rows: list[tuple[float, float, float]]) -> None:
    with np.errstate(all="ignore"):
        made = fmath_arrays.quaternion_from_euler_arrays(np.array(rows, f32).T)
        components = fmath_arrays.array_of(made, len(rows))
        expected = [Quaternion.from_euler(*map(f32, row)).to_wxyz() for row in rows]
    for axis in range(4):
        assert same_bits(components[axis], [wxyz[axis] for wxyz in expected])


@FEW
@given(rows=st.lists(st.tuples(*[FLOATS] * 7), min_size=1, max_size=20))
def test_vectors_and_quaternions_of_arrays_calculate_as_those_of_numbers(rows: list[tuple[float, ...]]) -> None:
    with np.errstate(all="ignore"):
        columns = np.array(rows, f32).T
        quat, vector = fmath_arrays.quaternion_of_arrays(columns[:4]), fmath_arrays.vector_of_arrays(columns[4:])
        turned = fmath_arrays.array_of(quat.rotate_vector(vector), len(rows))
        product = fmath_arrays.array_of(quat * quat.inverse(), len(rows))
        for number, row in enumerate(rows):
            one, v = Quaternion(*row[:4]), Vector3f(*row[4:])
            assert same_bits(turned[:, number], one.rotate_vector(v).to_tuple())
            assert same_bits(product[:, number], (one * one.inverse()).to_wxyz())


def test_columns_that_are_not_contiguous_are_read_right() -> None:
    table = np.arange(12, dtype=f32).reshape(3, 4)
    assert same_bits(fmath_arrays.sinf_array(table[:, 1]), [fmath.sinf(value) for value in table[:, 1]])


def test_a_table_of_values_keeps_its_shape() -> None:
    table = np.arange(6, dtype=f32).reshape(2, 3)
    assert fmath_arrays.cosf_array(table).shape == (2, 3)
    assert fmath_arrays.cosf_array(table)[1, 2] == fmath.cosf(f32(5))


@pytest.mark.parametrize("has_table", [True, False])
@pytest.mark.parametrize("name", UNARY)
def test_without_the_c_library_or_the_table_each_value_is_computed_by_the_scalar_way(
    name: str, has_table: bool
) -> None:
    libm, table = (None, fmath.ufunc_table()) if has_table else (fmath.LIBM, None)
    one = fmath.bind_unary(libm, name)
    over_array = fmath_arrays.bind_unary(libm, table, name)
    assert same_bits(over_array(column(EDGES)), [f32(one(value)) for value in column(EDGES).tolist()])


@pytest.mark.parametrize("libm", [None, fmath.LIBM])
def test_atan2_without_the_table_is_the_scalar_one(libm: object) -> None:
    y, x = column([1, -1, 0, 2]), column([2, -3, -1, float("nan")])
    one = fmath.bind_atan2(fmath.LIBM if libm else None)
    ours = fmath_arrays.bind_atan2(fmath.LIBM if libm else None, None)(y, x)
    assert same_bits(ours, [f32(one(*pair)) for pair in zip(y.tolist(), x.tolist(), strict=True)])


def test_table_is_missing_where_numpy_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.import_module", lambda _name: fmath)
    assert fmath.ufunc_table() is None
