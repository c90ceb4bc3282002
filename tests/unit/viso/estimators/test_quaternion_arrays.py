# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays of quaternions are bit for bit those of numpy-quaternion's own functions."""

from typing import Any

import numpy as np
import pytest
import quaternion
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from viso.estimators import quaternion_arrays
from viso.geometry.plain_quaternion import quaternion as plain
from viso.geometry.quaternions import one as our_one
from viso.geometry.quaternions import quaternion as our_type

NUMBERS = st.floats(-1e3, 1e3).filter(lambda number: number == 0.0 or abs(number) > 1e-9)
SHAPES = st.sampled_from([(), (0,), (1,), (3,), (2, 2)])


def vectors(length: int) -> st.SearchStrategy[Any]:
    return SHAPES.flatmap(lambda shape: arrays.arrays(np.float64, (*shape, length), elements=NUMBERS))


def bits(quats: Any) -> tuple[tuple[int, ...], bytes]:
    parts = quaternion.as_float_array(quats)
    return parts.shape, parts.tobytes()


def test_there_is_one_type_whoever_imports_it() -> None:
    assert our_type is quaternion.quaternion
    assert our_one == quaternion.one


@given(vectors(4))
def test_components_become_the_same_quaternions_and_come_back(wxyz: Any) -> None:
    ours = quaternion_arrays.as_quat_array(wxyz)
    assert bits(ours) == bits(quaternion.as_quat_array(wxyz))
    assert quaternion_arrays.as_float_array(ours).tobytes() == wxyz.tobytes()


def test_components_that_do_not_lie_side_by_side_become_the_same_quaternions() -> None:
    wxyz = np.arange(24.0).reshape(4, 6).T
    assert bits(quaternion_arrays.as_quat_array(wxyz)) == bits(quaternion.as_quat_array(wxyz))


@given(vectors(3))
def test_rotation_vectors_become_the_same_quaternions(rotations: Any) -> None:
    assert bits(quaternion_arrays.from_rotation_vector(rotations)) == bits(quaternion.from_rotation_vector(rotations))


@given(arrays.arrays(np.float64, st.sampled_from([(1, 4), (3, 4), (2, 2, 4)]), elements=st.floats(0.1, 2.0)))
def test_matrices_are_the_same(wxyz: Any) -> None:
    quats = quaternion.as_quat_array(wxyz)
    assert quaternion_arrays.as_rotation_matrix(quats).tobytes() == quaternion.as_rotation_matrix(quats).tobytes()


@given(vectors(3))
def test_arrays_of_the_type_in_python_are_the_same(rotations: Any) -> None:
    theirs = quaternion.from_rotation_vector(rotations)
    expected = quaternion.as_float_array((theirs * theirs).conj())
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("IS_PLAIN", True), ("quaternion", plain), ("_DTYPE", np.dtype(object))):
            patch.setattr(quaternion_arrays, name, value)
        ours = quaternion_arrays.from_rotation_vector(rotations)
        parts = quaternion_arrays.as_float_array(np.conjugate(ours * ours))
    assert (parts.shape, parts.tobytes()) == (expected.shape, expected.tobytes())
