# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames, the two changes of handedness, and headings."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD, MOUNTINGS, yaw_of_heading
from viso.geometry.rotation import Array

X, Y, Z = np.eye(3)


def test_frd_points_forward_right_and_down() -> None:
    forward, left, up = FLU_TO_FRD.T
    assert (forward.tolist(), left.tolist(), up.tolist()) == ([1, 0, 0], [0, -1, 0], [0, 0, -1])


def test_ned_points_north_east_and_down() -> None:
    east, north, up = ENU_TO_NED.T
    assert (east.tolist(), north.tolist(), up.tolist()) == ([0, 1, 0], [1, 0, 0], [0, 0, -1])


@pytest.mark.parametrize("change", [FLU_TO_FRD, ENU_TO_NED])
def test_change_of_frame_undoes_itself_and_mirrors_nothing(change: Array) -> None:
    assert (change @ change).tolist() == np.eye(3).tolist()
    assert np.linalg.det(change) == pytest.approx(1)


@pytest.mark.parametrize("fixed", [FLU_TO_FRD, ENU_TO_NED, *MOUNTINGS.values()])
def test_fixed_matrices_cannot_be_written_to(fixed: Array) -> None:
    with pytest.raises(ValueError, match="read-only"):
        fixed[0, 0] = 5


@pytest.mark.parametrize(
    ("mounting", "right", "down", "view"), [("forward", -Y, -Z, X), ("nadir", -Y, -X, -Z)], ids=["forward", "nadir"]
)
def test_mounting_maps_the_axes_of_the_picture(mounting: str, right: Array, down: Array, view: Array) -> None:
    assert np.array_equal(MOUNTINGS[mounting], np.stack([right, down, view], axis=1))


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_mounting_is_a_rotation(mounting: str) -> None:
    assert np.linalg.det(MOUNTINGS[mounting]) == pytest.approx(1)


@pytest.mark.parametrize(
    ("heading_rad", "yaw_rad"),
    [
        (0, math.pi / 2),
        (math.pi / 2, 0),
        (math.pi, -math.pi / 2),
        (1.5 * math.pi, math.pi),
        (-0.5 * math.pi, math.pi),
        (2 * math.pi, math.pi / 2),
        (math.radians(350), math.radians(100)),
    ],
)
def test_yaw_counts_from_east_against_the_clock(heading_rad: float, yaw_rad: float) -> None:
    assert yaw_of_heading(heading_rad) == pytest.approx(yaw_rad, abs=1e-12)


@given(st.floats(-20, 20))
def test_yaw_and_heading_point_the_same_way(heading_rad: float) -> None:
    yaw = yaw_of_heading(heading_rad)
    assert -math.pi < yaw <= math.pi
    east, north = math.cos(yaw), math.sin(yaw)
    assert (east, north) == pytest.approx((math.sin(heading_rad), math.cos(heading_rad)), abs=1e-12)
