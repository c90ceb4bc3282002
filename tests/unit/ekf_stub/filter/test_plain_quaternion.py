# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quaternion in Python computes what numpy-quaternion does, to the last bit."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import quaternion
from hypothesis import example, given
from hypothesis import strategies as st

from ekf_stub.filter.plain_quaternion import quaternion as plain

Parts = tuple[float, float, float, float]

NUMBERS = st.floats(-1e3, 1e3) | st.sampled_from([0.0, -0.0, 1e-15, 1e-9, math.inf, -math.inf, math.nan])
PARTS = st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS)
OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "sum": lambda one, other: one + other,
    "difference": lambda one, other: one - other,
    "product": lambda one, other: one * other,
    "multiple": lambda one, other: one * other.w,
    "multiple from the left": lambda one, other: other.x * one,
    "multiple by a number of numpy": lambda one, other: one * np.float64(other.w),
    "quotient": lambda one, other: one / (other.w or 1.0),
    "negative": lambda one, _: -one,
    "conjugate": lambda one, _: one.conj() + one.conjugate(),
    "normalized": lambda one, _: one.normalized(),
    "rotation of a rotation vector": lambda one, _: type(one)(0.0, one.x, one.y, one.z).exp(),
}


def bits(quat: Any) -> list[str]:
    return [float(part).hex() for part in (quat.w, quat.x, quat.y, quat.z)]


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=OPERATIONS)
@given(PARTS, PARTS)
@example((0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
def test_result_is_the_same(operation: Callable[[Any, Any], Any], one: Parts, other: Parts) -> None:
    ours, theirs = (operation(make(*one), make(*other)) for make in (plain, quaternion.quaternion))
    assert bits(ours) == bits(theirs)


@given(st.tuples(*4 * [st.floats(-1, 1)]).filter(lambda parts: max(map(abs, parts)) > 1e-9))
@example((1.0, 0.0, 0.0, 0.0))
@example((-1.0, 0.0, 0.0, 0.0))
@example((0.0, 1.0, 0.0, 0.0))
@example((1.0, 1e-15, 0.0, 0.0))
def test_rotation_vector_is_the_same(parts: Parts) -> None:
    ours, theirs = (make(*parts).normalized().log() for make in (plain, quaternion.quaternion))
    assert bits(ours) == bits(theirs)


@given(PARTS)
def test_length_vector_and_components_are_the_same(parts: Parts) -> None:
    ours, theirs = plain(*parts), quaternion.quaternion(*parts)
    assert ours.abs().hex() == float(theirs.abs()).hex()
    assert ours.norm().hex() == float(theirs.norm()).hex()
    assert ours.vec.tobytes() == theirs.vec.tobytes()
    assert np.array(ours.components).tobytes() == theirs.components.tobytes()
    assert (ours == plain(*parts)) == (theirs == quaternion.quaternion(*parts))


def test_other_things_are_no_factors() -> None:
    with pytest.raises(TypeError):
        plain(1, 0, 0, 0) * "2"  # type: ignore[operator]  # which is what is tried
    assert plain(1, 0, 0, 0) != 1
