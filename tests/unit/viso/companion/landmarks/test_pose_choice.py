# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pose predicts."""

import pytest

from viso.companion.landmarks.local_frame import FrameMode, to_geodetic
from viso.companion.landmarks.pose_choice import choose_pose
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
    assert (chosen.x_m, chosen.y_m) == pytest.approx((3000, -4000), abs=0.01)
    assert (chosen.t_s, chosen.yaw_rad, chosen.z_m) == (1.0, 0.3, 5.0)


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
    assert choose_pose(ODOMETRY, source, estimated, reference) is ODOMETRY


@pytest.mark.parametrize("latitude_deg", [float("nan"), float("inf"), 91.0])
def test_what_is_not_on_the_globe_is_no_fix(latitude_deg: float) -> None:
    with pytest.raises(ValueError, match="latitude_deg"):
        GlobalFix(0.0, GeodeticPoint(latitude_deg, 8.0))


def test_a_place_on_the_equator_or_the_prime_meridian_is_a_fix() -> None:
    for point in (GeodeticPoint(0.0, 8.0), GeodeticPoint(51.5, 0.0)):
        assert point.is_fix
