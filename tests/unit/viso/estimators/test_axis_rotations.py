# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axis maps have the right names, and the firmware's orientations turn vectors as they say."""

import numpy as np
import pytest

from ap_core.rotations import Rotation
from viso.estimators.axis_rotations import (
    BODY_WORDS,
    EARTH_WORDS,
    MIRRORED,
    PROPER,
    AxisMap,
    orient_name,
    rotation_matrix,
)


def test_maps_are_24_rotations_and_24_mirrored_ones() -> None:
    every = [AxisMap.of(matrix) for matrix in (*PROPER, *MIRRORED)]
    assert len(set(every)) == 48
    for axes, matrix in zip(every, (*PROPER, *MIRRORED), strict=True):
        np.testing.assert_array_equal(axes.matrix, matrix)


@pytest.mark.parametrize("matrix", PROPER)
def test_orientation_of_a_map_turns_vectors_as_the_map_does(matrix: np.ndarray) -> None:
    rotation = AxisMap.of(matrix).rotation
    assert rotation is not None
    np.testing.assert_array_equal(rotation_matrix(rotation), matrix)


def test_mirrored_map_is_no_orientation() -> None:
    assert {AxisMap.of(matrix).rotation for matrix in MIRRORED} == {None}


@pytest.mark.parametrize(("signed_axes", "letters", "orient"), [
    ((1, 2, 3), "FRD", 0),
    ((2, -1, 3), "RBD", 2),
    ((-1, -2, 3), "BLD", 4),
    ((-2, 1, 3), "LFD", 6),
    ((-3, 2, 1), "URF", 24),
    ((3, 2, -1), "DRB", 25),
    ((1, -2, -3), "FLU", None),
    ((2, 3, 1), "RDF", None),
])  # fmt: skip
def test_mountings_have_their_letters_and_parameter(
    signed_axes: tuple[int, int, int], letters: str, orient: int | None
) -> None:
    axes = AxisMap(signed_axes)
    assert axes.letters(BODY_WORDS) == letters
    rotation = axes.rotation
    assert rotation is not None
    assert (orient_name(rotation) != rotation.name) == (orient is not None)
    assert orient in (int(rotation), None)
    assert axes.is_identity == (letters == "FRD")


def test_documented_orientation_comes_before_others_that_turn_alike() -> None:
    assert AxisMap((-2, -1, -3)).rotation == Rotation.ROLL_180_YAW_270  # 14, which 26 equals
    assert AxisMap((3, 2, -1)).rotation == Rotation.PITCH_270


def test_map_is_described_axis_by_axis() -> None:
    assert AxisMap((1, -2, -3)).describe("camera {} is vehicle", BODY_WORDS) == (
        "camera x is vehicle x (forward), camera y is vehicle -y (left), camera z is vehicle -z (up)"
    )
    assert AxisMap((2, 1, -3)).letters(EARTH_WORDS) == "ENU"
