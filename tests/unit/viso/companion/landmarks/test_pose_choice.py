# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pose predicts."""

import pytest

from viso.companion.landmarks.local_frame import FrameMode, to_geodetic
from viso.companion.landmarks.pose_choice import choose_pose, reference_of
from viso.companion.landmarks.types import EstimatedPosition, GeodeticPoint, GlobalFix, VehiclePose

REFERENCE = GeodeticPoint(47.0, 8.0, 500.0)
ODOMETRY = VehiclePose(1.0, 10.0, 20.0, 0.3, z_m=5.0)
SOURCE = "adsb"
NOWHERE = GeodeticPoint(0.0, 0.0)


def place(mode: FrameMode = FrameMode.WGS84) -> EstimatedPosition:
    return EstimatedPosition(1.0, to_geodetic(mode, REFERENCE, 3000.0, -4000.0, 0.0))


@pytest.mark.parametrize("mode", FrameMode)
def test_an_estimated_position_gives_east_and_north_and_odometry_the_rest(mode: FrameMode) -> None:
    chosen = choose_pose(ODOMETRY, SOURCE, place(mode), REFERENCE, mode)
    assert (chosen.pose.x_m, chosen.pose.y_m) == pytest.approx((3000, -4000), abs=0.01)
    assert (chosen.pose.t_s, chosen.pose.yaw_rad, chosen.pose.z_m) == (1.0, 0.3, 5.0)
    assert chosen.label == "estimated"
    assert chosen.is_estimated


@pytest.mark.parametrize(
    ("source", "estimated", "reference"),
    [
        ("", place(), REFERENCE),
        (SOURCE, None, REFERENCE),
        (SOURCE, place(), None),
        (SOURCE, EstimatedPosition(1.0, NOWHERE), REFERENCE),
    ],
    ids=["no source", "nothing estimated", "no reference", "estimated nowhere"],
)
def test_otherwise_odometry_predicts(
    source: str, estimated: EstimatedPosition | None, reference: GeodeticPoint | None
) -> None:
    chosen = choose_pose(ODOMETRY, source, estimated, reference)
    assert chosen.pose is ODOMETRY
    assert chosen.label == "odom"
    assert not chosen.is_estimated


def test_the_first_real_fix_is_the_reference_for_good() -> None:
    fixes = (NOWHERE, REFERENCE, GeodeticPoint(48.0, 9.0))
    references = []
    reference = None
    for point in fixes:
        reference = reference_of(reference, GlobalFix(0.0, point))
        references.append(reference)
    assert references == [None, REFERENCE, REFERENCE]


@pytest.mark.parametrize("latitude_deg", [float("nan"), float("inf"), 91.0])
def test_what_is_not_on_the_globe_is_no_fix(latitude_deg: float) -> None:
    with pytest.raises(ValueError, match="latitude_deg"):
        GlobalFix(0.0, GeodeticPoint(latitude_deg, 8.0))


def test_a_place_on_the_equator_or_the_prime_meridian_is_a_fix() -> None:
    for point in (GeodeticPoint(0.0, 8.0), GeodeticPoint(51.5, 0.0)):
        assert reference_of(None, GlobalFix(0.0, point)) == point
