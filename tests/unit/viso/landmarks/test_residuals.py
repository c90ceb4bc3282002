# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Innovations: zero for a perfect pose, and every detection accounted for."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.landmarks.observation import back_project, camera_centre, project
from viso.landmarks.residuals import (
    Innovation,
    Residuals,
    aircraft_residuals,
    innovation_statistics,
    landmark_residuals,
    summarise,
)
from viso.landmarks.types import (
    AircraftReport,
    AircraftState,
    Camera,
    Detection,
    Detections,
    Landmark,
    VehiclePose,
)

POSE = VehiclePose(0.0, 0.0, 0.0, 0.0)
AHEAD = Landmark("1", 10.0, 0.0)
BEHIND = Landmark("2", -10.0, 0.0)

metres = st.floats(-100, 100)
poses = st.builds(VehiclePose, t_s=st.just(0.0), x_m=metres, y_m=metres, yaw_rad=st.floats(-math.pi, math.pi))
places = st.lists(st.tuples(metres, metres), min_size=1, max_size=12)


def picture(*detections: Detection) -> Detections:
    return Detections(3.0, landmarks=detections)


def state(icao: str, east_m: float, north_m: float, up_m: float | None) -> AircraftState:
    report = AircraftReport(0.0, icao, 47.0, 8.0)
    return AircraftState(report, east_m, north_m, up_m, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


@given(poses, places)
def test_a_perfect_pose_has_no_innovation(pose: VehiclePose, xy: list[tuple[float, float]]) -> None:
    landmarks = [Landmark(str(index), x, y) for index, (x, y) in enumerate(xy)]
    pixels = project(Camera(), pose, [(x, y, 0.0) for x, y in xy]).uv_px
    seen = [
        Detection(one.id, *uv) for one, uv in zip(landmarks, pixels.tolist(), strict=True) if math.isfinite(sum(uv))
    ]
    residuals = landmark_residuals(Camera(), pose, landmarks, picture(*seen))
    assert [(one.id, one.du_px, one.dv_px) for one in residuals.innovations] == [(one.id, 0, 0) for one in seen]


def test_an_innovation_is_observed_less_predicted() -> None:
    residuals = landmark_residuals(Camera(), POSE, [AHEAD], picture(Detection("1", 643.0, 630.0)))
    (innovation,) = residuals.innovations
    assert (innovation.du_px, innovation.dv_px) == pytest.approx((3.0, -2.0))
    assert innovation.in_image
    assert innovation.range_m == 10.0


def test_a_vehicle_whose_yaw_is_too_small_sees_everything_more_to_the_right() -> None:
    truth = VehiclePose(0.0, 0.0, 0.0, math.radians(5))
    uv = project(Camera(), truth, [(10.0, 0.0, 0.0)]).uv_px[0].tolist()
    (innovation,) = landmark_residuals(Camera(), POSE, [AHEAD], picture(Detection("1", *uv))).innovations
    assert innovation.du_px == pytest.approx(1000 * math.tan(math.radians(5)))


def test_the_range_of_a_landmark_is_from_the_camera() -> None:
    camera = Camera(offset_forward_m=4.0, height_m=30.0)
    (innovation,) = landmark_residuals(camera, POSE, [AHEAD], picture(Detection("1", 0.0, 0.0))).innovations
    assert innovation.range_m == 6.0


def test_what_is_not_known_or_behind_or_seen_twice_is_listed() -> None:
    names = ("9", "1", "2", "1", "8", "9", "1")
    seen = [Detection(name, float(index), 0.0) for index, name in enumerate(names)]
    residuals = landmark_residuals(Camera(), POSE, [BEHIND, AHEAD], picture(*seen))
    assert [(one.id, one.observed_u_px) for one in residuals.innovations] == [("1", 1.0)]
    assert residuals.unmatched == ("9", "8")
    assert residuals.not_projected == ("2",)
    assert residuals.duplicates == ("1", "9")


def test_an_innovation_whose_prediction_is_outside_the_picture_is_kept_and_marked() -> None:
    (innovation,) = landmark_residuals(
        Camera(), POSE, [Landmark("1", 1.0, 5.0)], picture(Detection("1", 0.0, 0.0))
    ).innovations
    assert not innovation.in_image
    assert innovation.predicted_u_px == pytest.approx(-4360)


def test_nothing_known_or_nothing_seen_has_no_innovation() -> None:
    assert landmark_residuals(Camera(), POSE, [], picture(Detection("1", 0.0, 0.0))).unmatched == ("1",)
    assert landmark_residuals(Camera(), POSE, [AHEAD], picture()).innovations == ()
    assert aircraft_residuals(Camera(), POSE, [], picture()).innovations == ()


def test_landmarks_may_have_a_height() -> None:
    pose = VehiclePose(0.0, 0.0, 0.0, 0.0, z_m=5.0)
    level = Landmark("1", 10.0, 0.0, 6.2)
    (innovation,) = landmark_residuals(Camera(), pose, [level], picture(Detection("1", 0.0, 0.0))).innovations
    assert innovation.predicted_v_px == pytest.approx(512)


def test_an_aircraft_counts_from_the_vehicle_and_its_height_from_the_ground() -> None:
    pose = VehiclePose(0.0, 100.0, 50.0, 0.0)
    seen = Detections(0.0, aircraft=(Detection("ABC123", 475.0, 180.0),))
    (innovation,) = aircraft_residuals(Camera(), pose, [state("ABC123", 3000, 500, 1000)], seen).innovations
    predicted = (innovation.predicted_u_px, innovation.predicted_v_px)
    assert predicted == pytest.approx((473.3333, 179.0667), abs=1e-3)
    assert innovation.range_m == pytest.approx(math.hypot(3000, 500))


def test_another_pose_predicts_an_aircraft_that_stays_where_odometry_has_it() -> None:
    odometry, other = VehiclePose(0.0, 0.0, 0.0, 0.0), VehiclePose(0.0, 1000.0, 0.0, 0.0)
    seen = Detections(0.0, aircraft=(Detection("ABC123", 0.0, 0.0),))
    (innovation,) = aircraft_residuals(Camera(), other, [state("ABC123", 3000, 500, 0)], seen, odometry).innovations
    assert innovation.predicted_u_px == pytest.approx(640 - 1000 * 500 / 2000)


def test_an_aircraft_of_unknown_height_is_not_projected() -> None:
    seen = Detections(0.0, aircraft=(Detection("ABC123", 0.0, 0.0), Detection("FFFFFF", 0.0, 0.0)))
    residuals = aircraft_residuals(Camera(), POSE, [state("ABC123", 3000, 500, None)], seen)
    assert residuals.innovations == ()
    assert residuals.not_projected == ("ABC123",)
    assert residuals.unmatched == ("FFFFFF",)


@pytest.mark.parametrize(("depth_m", "projected"), [(0.0999, False), (0.1001, True)])
def test_an_aircraft_is_not_projected_up_to_a_tenth_of_a_metre(depth_m: float, projected: bool) -> None:
    seen = Detections(0.0, aircraft=(Detection("ABC123", 0.0, 0.0),))
    residuals = aircraft_residuals(Camera(), POSE, [state("ABC123", depth_m, 0.0, 1.2)], seen)
    assert bool(residuals.innovations) is projected


def test_what_is_not_a_number_is_no_detection() -> None:
    with pytest.raises(ValueError, match="u_px"):
        Detection("1", math.nan, 0.0)


@given(poses, st.floats(0, 1280), st.floats(520, 1024))
def test_a_landmark_on_the_line_of_a_pixel_is_predicted_there(pose: VehiclePose, u_px: float, v_px: float) -> None:
    camera = Camera()
    line = back_project(camera, pose, [(u_px, v_px)])[0]
    centre = camera_centre(camera, pose)
    x_m, y_m, _ = (centre - line * (centre[2] / line[2])).tolist()
    (innovation,) = landmark_residuals(
        camera, pose, [Landmark("1", x_m, y_m)], picture(Detection("1", u_px, v_px))
    ).innovations
    assert (innovation.du_px, innovation.dv_px) == pytest.approx((0, 0), abs=1e-6)


# What many of them amount to


def off(name: str, du_px: float, dv_px: float) -> Innovation:
    return Innovation(name, 100.0, 200.0, 100.0 + du_px, 200.0 + dv_px, True, 10.0)


def test_mean_median_and_spread() -> None:
    statistics = innovation_statistics([off("1", 1.0, -2.0), off("1", 2.0, -2.0), off("1", 6.0, -2.0)])
    assert statistics.count == 3
    assert statistics.mean == pytest.approx((3.0, -2.0))
    assert statistics.median == pytest.approx((2.0, -2.0))
    assert statistics.spread == pytest.approx((math.sqrt(14 / 3), 0.0))
    assert statistics.robust_spread == pytest.approx((1.4826, 0.0))


def test_one_wrong_match_hardly_moves_median_and_robust_spread() -> None:
    good = [off("1", float(index % 5 - 2), 0.0) for index in range(99)]
    with_wrong = innovation_statistics([*good, off("1", 5000.0, 0.0)])
    assert with_wrong.median[0] == 0.0
    assert with_wrong.robust_spread[0] == pytest.approx(1.4826)
    assert with_wrong.spread[0] > 100


def test_nothing_has_no_mean() -> None:
    statistics = innovation_statistics([])
    assert statistics.count == 0
    assert all(map(math.isnan, (*statistics.mean, *statistics.median, *statistics.spread, *statistics.robust_spread)))


def test_a_summary_is_of_all_and_of_each() -> None:
    summary = summarise(
        [
            Residuals((off("b", 1.0, 0.0), off("a", 3.0, 0.0)), unmatched=("x",), duplicates=("a",)),
            Residuals((off("b", 5.0, 0.0),), unmatched=("x", "y"), not_projected=("c",)),
        ]
    )
    assert summary.pictures == 2
    assert summary.overall.count == 3
    assert summary.overall.mean[0] == pytest.approx(3.0)
    assert {name: (one.count, one.mean[0]) for name, one in summary.per_id.items()} == {"b": (2, 3.0), "a": (1, 3.0)}
    assert list(summary.per_id) == ["b", "a"]
    assert summary.unmatched == {"x": 2, "y": 1}
    assert summary.not_projected == {"c": 1}
    assert summary.duplicates == {"a": 1}


def test_no_pictures_have_an_empty_summary() -> None:
    summary = summarise([])
    assert (summary.pictures, summary.overall.count, dict(summary.per_id)) == (0, 0, {})
