# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From events to scenes: which pose a picture gets, what is known when it comes, and what is left out."""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.landmarks.scenes import scenes_of
from viso.geometry.rotation import so3_exp
from viso.landmarks.local_frame import FrameMode, to_geodetic
from viso.landmarks.scene import Scene
from viso.landmarks.session import (
    ALONE_S,
    LONGEST_GAP_S,
    ReceiverWatch,
    Session,
    Settings,
    pose_at,
)
from viso.landmarks.types import (
    AircraftReport,
    Camera,
    CameraInfo,
    Detection,
    Detections,
    EstimatedPosition,
    Event,
    GeodeticPoint,
    GlobalFix,
    Landmark,
    LandmarkMap,
    VehiclePose,
)

MAP = LandmarkMap(0.0, (Landmark("1", 10.0, 0.0), Landmark("2", 20.0, 3.0)))
FIX = GeodeticPoint(47.0, 8.0, 500.0)
ICAO = "3C6481"


def settings(**changes: object) -> Settings:
    return Settings(mode=FrameMode.SPHERICAL, **changes)  # type: ignore[arg-type]


def pose(t_s: float, x_m: float = 0.0, yaw_rad: float = 0.0) -> VehiclePose:
    return VehiclePose(t_s, x_m, 0.0, yaw_rad)


def seen(t_s: float, *ids: str) -> Detections:
    return Detections(t_s, tuple(Detection(name, 640.0, 600.0) for name in ids or ("1",)))


def aircraft(t_s: float, icao: str = ICAO, altitude_ft: float | None = 4000.0) -> AircraftReport:
    return AircraftReport(t_s, icao, 47.0, 8.05, altitude_ft)


def run(*events: Event, **changes: object) -> tuple[list[Scene], Session]:
    session = Session(settings(**changes))
    return scenes_of(session, events), session


def test_picture_waits_for_the_pose_after_it() -> None:
    session = Session(settings())
    for event in (MAP, pose(0.0), seen(0.25)):
        assert session.take(event) == []
    (scene,) = session.take(pose(1.0, x_m=4.0, yaw_rad=0.2))
    at = scene.situation.odometry
    assert (at.t_s, at.x_m, at.yaw_rad) == pytest.approx((0.25, 1.0, 0.05))
    assert scene.t_s == 0.25


def test_picture_at_the_time_of_a_pose_has_that_pose() -> None:
    exact = pose(1.0, x_m=0.1)
    session = Session(settings())
    for event in (MAP, pose(0.0), exact):
        session.take(event)
    (scene,) = session.take(seen(1.0))
    assert (scene.situation.odometry.x_m, scene.situation.odometry.yaw_rad) == (0.1, 0.0)


def test_pictures_that_still_wait_at_the_end_have_the_last_pose() -> None:
    scenes, session = run(MAP, pose(0.0), seen(ALONE_S), seen(0.5))
    assert [scene.t_s for scene in scenes] == [ALONE_S]
    assert session.dropped == {"a picture without a pose of its time": 1}


def test_waiting_pictures_are_given_up_when_poses_stop() -> None:
    session = Session(settings())
    session.take(pose(0.0))
    late = [1 + index * 0.5 for index in range(5)]
    for t_s in late:
        session.take(seen(t_s))
    assert session.dropped["a picture without a pose of its time"] == 2


def test_pose_across_a_gap_is_not_made_up() -> None:
    scenes, session = run(pose(0.0), seen(1.0), pose(LONGEST_GAP_S + 0.01))
    assert scenes == []
    assert session.dropped["a picture without a pose of its time"] == 1
    assert not session.pictures


def test_yaw_is_interpolated_the_shorter_way_round() -> None:
    poses = [pose(0.0, yaw_rad=math.radians(175)), pose(1.0, yaw_rad=math.radians(-175))]
    found = pose_at(poses, 0.5)
    assert found is not None
    assert math.cos(found.yaw_rad) == pytest.approx(-1)


def test_attitude_is_interpolated_where_it_counts() -> None:
    poses = [VehiclePose(t_s, 0.0, 0.0, 0.0, 2 * t_s, so3_exp(np.array([0.4 * t_s, 0.0, 0.0]))) for t_s in (0.0, 1.0)]
    found = pose_at(poses, 0.25)
    assert found is not None
    assert found.z_m == 0.5
    assert found.world_R_body == pytest.approx(so3_exp(np.array([0.1, 0.0, 0.0])))


@pytest.mark.parametrize("full", [True, False])
def test_roll_and_pitch_count_only_when_asked_for(full: bool) -> None:
    banked = VehiclePose(0.0, 0.0, 0.0, 0.0, world_R_body=so3_exp(np.array([0.1, 0.0, 0.0])))
    (scene,), _ = run(MAP, banked, seen(0.0), full_attitude=full)
    assert (scene.situation.pose.world_R_body is not None) is full
    u_px = scene.landmark_residuals.innovations[0].predicted_u_px
    assert (u_px != 640) is full


@given(st.lists(st.floats(0, 10), min_size=1, max_size=20), st.floats(-1, 11))
def test_pose_at_a_time_is_between_its_neighbours(times: list[float], t_s: float) -> None:
    poses = [pose(time, x_m=3 * time) for time in sorted(set(times))]
    found = pose_at(poses, t_s)
    if found is None:
        before = [one.t_s for one in poses if one.t_s <= t_s]
        after = [one.t_s for one in poses if one.t_s > t_s]
        near = [one.t_s for one in poses if abs(one.t_s - t_s) <= ALONE_S]
        assert not near
        assert not (before and after) or after[0] - before[-1] > LONGEST_GAP_S
    else:
        assert found.x_m == pytest.approx(3 * found.t_s)
        assert abs(found.t_s - t_s) <= ALONE_S


def test_what_counts_is_what_was_known_when_the_picture_came() -> None:
    later = LandmarkMap(0.0, (Landmark("9", 10.0, 0.0),))
    (scene,), session = run(MAP, pose(0.0), seen(0.5), later, pose(1.0))
    assert [mark.id for mark in scene.landmarks] == ["1", "2"]
    assert sorted(one.id for one in session.landmarks) == ["1", "2", "9"]


def test_ids_that_are_not_known_are_unmatched_and_duplicates_count_once() -> None:
    (scene,), _ = run(MAP, pose(0.0), Detections(0.0, tuple(Detection(name, 1.0, 2.0) for name in ("1", "7", "1"))))
    assert scene.landmark_residuals.unmatched == ("7",)
    assert scene.landmark_residuals.duplicates == ("1",)
    assert [one.id for one in scene.landmark_residuals.innovations] == ["1"]


def steady(count: int, *more: Event, picture_until: int = 0) -> Iterator[Event]:
    """Yield poses at 20 Hz with pictures at the first of them."""
    yield from more
    for index in range(count):
        yield pose(index / 20)
        if index < picture_until and index % 4 == 0:
            yield seen(index / 20)


def test_without_pictures_there_is_a_scene_every_fifth_of_a_second() -> None:
    scenes, _ = run(*steady(41, MAP))
    assert [scene.t_s for scene in scenes] == pytest.approx([1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
    assert not any(scene.has_detections for scene in scenes)


def test_with_pictures_there_are_no_other_scenes_until_they_stop() -> None:
    scenes, _ = run(*steady(61, MAP, picture_until=21))
    times = [scene.t_s for scene in scenes if scene.has_detections]
    assert times == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert min(scene.t_s for scene in scenes if not scene.has_detections) == pytest.approx(2.0)
    assert [scene.number for scene in scenes] == list(range(1, len(scenes) + 1))


def test_pose_that_is_not_after_the_last_is_left_out() -> None:
    _, session = run(pose(1.0), pose(0.9), pose(1.0))
    assert session.dropped == {"a pose that is not after the one before": 2}


def test_clock_that_was_set_back_starts_anew() -> None:
    scenes, session = run(MAP, pose(100.0), seen(100.0), pose(0.0), seen(0.0))
    assert [scene.t_s for scene in scenes] == [100.0, 0.0]
    assert [one.t_s for one in session.poses] == [0.0]
    assert session.dropped == {"what came before the clock was set back": 1}


def test_aircraft_are_around_the_vehicle_once_there_is_a_fix() -> None:
    before, _ = run(aircraft(0.0), pose(0.0), seen(0.0))
    after, _ = run(GlobalFix(0.0, FIX), aircraft(0.0), pose(0.0, x_m=50.0), seen(0.0))
    assert before[0].aircraft == ()
    east_m = 6_371_000 * math.cos(math.radians(47)) * math.radians(0.05)
    (mark,) = after[0].aircraft
    assert (mark.id, mark.x_m, mark.y_m) == pytest.approx((ICAO, 50 + east_m, 0.0))
    assert mark.predicted is not None
    assert mark.is_baro


def test_height_of_aircraft_is_above_the_reference() -> None:
    higher = dataclasses.replace(FIX, alt_m=900.0)
    (scene,), _ = run(GlobalFix(0.0, FIX), GlobalFix(0.0, higher), aircraft(0.0), pose(0.0), seen(0.0))
    assert scene.situation.states[0].up_m == pytest.approx(4000 * 0.3048 - 500)
    (offset,), _ = run(GlobalFix(0.0, FIX), aircraft(0.0), pose(0.0), seen(0.0), qnh_offset_m=30.0)
    assert offset.situation.states[0].up_m == pytest.approx(4000 * 0.3048 - 500 + 30)
    assert not offset.aircraft[0].is_baro


def test_reference_stands_in_for_a_fix() -> None:
    (scene,), _ = run(aircraft(0.0), pose(0.0, x_m=1000.0), seen(0.0), reference=FIX)
    (near,), _ = run(aircraft(0.0), pose(0.0), seen(0.0), reference=FIX)
    assert scene.aircraft[0].x_m == pytest.approx(near.aircraft[0].x_m, abs=0.01)
    assert scene.situation.states[0].east_m == pytest.approx(near.situation.states[0].east_m - 1000, abs=0.01)


def test_no_fix_is_none() -> None:
    scenes, session = run(GlobalFix(0.0, GeodeticPoint(0.0, 0.0)), aircraft(0.0), pose(0.0), seen(0.0))
    assert scenes[0].aircraft == ()
    assert session.dropped == {"no fix: (0, 0)": 1}


def test_aircraft_that_fell_silent_is_gone() -> None:
    scenes, _ = run(GlobalFix(0.0, FIX), aircraft(0.0), pose(15.0), seen(15.0), pose(15.1), seen(15.1))
    assert [len(scene.aircraft) for scene in scenes] == [1, 0]


def test_aircraft_of_unknown_height_is_there_but_not_predicted() -> None:
    (scene,), _ = run(GlobalFix(0.0, FIX), aircraft(0.0, altitude_ft=None), pose(0.0), seen(0.0))
    (mark,) = scene.aircraft
    assert (mark.predicted, mark.elevation_rad) == (None, None)


def info(fx_px: float) -> CameraInfo:
    return CameraInfo(0.0, 640, 480, fx_px, 500.0, 320.0, 240.0)


def test_camera_record_replaces_the_intrinsics() -> None:
    _, session = run(info(450.0), camera=Camera(height_m=3.0))
    expected = Camera(640, 480, 450.0, 500.0, 320.0, 240.0, height_m=3.0)
    assert session.camera == expected


def test_camera_record_without_calibration_changes_nothing() -> None:
    _, session = run(info(0.0))
    assert session.camera == Camera()
    assert session.dropped == {"a camera that is not calibrated": 1}


def test_camera_that_cannot_be_changes_nothing() -> None:
    _, session = run(info(-5.0))
    assert session.camera == Camera()
    assert session.dropped == {"a camera that cannot be": 1}


def test_camera_of_the_user_stands() -> None:
    _, session = run(info(450.0), keeps_intrinsics=True)
    assert session.camera == Camera()


ESTIMATE = EstimatedPosition(0.0, GeodeticPoint(47.01, 8.0))


def test_estimated_position_predicts_when_that_is_wanted() -> None:
    events = (GlobalFix(0.0, FIX), ESTIMATE, pose(0.0, yaw_rad=0.3), seen(0.0))
    (by_estimate,), _ = run(*events, from_estimate=True)
    (by_odometry,), _ = run(*events)
    north_m = 6_371_000 * math.radians(0.01)
    at = by_estimate.situation.pose
    assert (at.x_m, at.y_m, at.yaw_rad) == pytest.approx((0.0, north_m, 0.3))
    assert by_estimate.situation.is_estimated
    assert not by_odometry.situation.is_estimated
    assert (by_estimate.situation.label, by_odometry.situation.label) == ("estimated", "odom")


@pytest.mark.parametrize("mode", FrameMode)
def test_estimated_position_gives_east_and_north_and_odometry_the_rest(mode: FrameMode) -> None:
    place = EstimatedPosition(1.0, to_geodetic(mode, FIX, 3000.0, -4000.0, 0.0))
    session = Session(Settings(mode=mode, reference=FIX, from_estimate=True))
    (scene,) = scenes_of(session, (place, VehiclePose(1.0, 10.0, 20.0, 0.3, z_m=5.0), seen(1.0)))
    chosen = scene.situation.pose
    assert (chosen.x_m, chosen.y_m) == pytest.approx((3000, -4000), abs=0.01)
    assert (chosen.t_s, chosen.yaw_rad, chosen.z_m) == (1.0, 0.3, 5.0)


@pytest.mark.parametrize(
    ("from_estimate", "estimated", "reference"),
    [
        (False, (ESTIMATE,), FIX),
        (True, (), FIX),
        (True, (ESTIMATE,), None),
        (True, (EstimatedPosition(1.0, GeodeticPoint(0.0, 0.0)),), FIX),
    ],
    ids=["not wanted", "nothing estimated", "no reference", "estimated nowhere"],
)
def test_otherwise_odometry_predicts(
    from_estimate: bool, estimated: tuple[EstimatedPosition, ...], reference: GeodeticPoint | None
) -> None:
    (scene,), _ = run(*estimated, pose(1.0), seen(1.0), from_estimate=from_estimate, reference=reference)
    assert scene.situation.pose is scene.situation.odometry


@pytest.mark.parametrize("latitude_deg", [float("nan"), float("inf"), 91.0])
def test_what_is_not_on_the_globe_is_no_fix(latitude_deg: float) -> None:
    with pytest.raises(ValueError, match="latitude_deg"):
        GlobalFix(0.0, GeodeticPoint(latitude_deg, 8.0))


def test_a_place_on_the_equator_or_the_prime_meridian_is_a_fix() -> None:
    for point in (GeodeticPoint(0.0, 8.0), GeodeticPoint(51.5, 0.0)):
        assert point.is_fix


def test_aircraft_stay_where_odometry_has_them_and_raw_odometry_is_their_actual_place() -> None:
    events = (GlobalFix(0.0, FIX), aircraft(0.0), ESTIMATE, pose(0.0), seen(0.0))
    (estimated,), _ = run(*events, from_estimate=True)
    (by_odometry,), _ = run(*events)
    (mark,), (plain,) = estimated.aircraft, by_odometry.aircraft
    assert (mark.x_m, mark.y_m) == (plain.x_m, plain.y_m)
    assert (mark.actual, mark.seen) == (plain.predicted, False)
    assert mark.predicted != plain.predicted
    assert plain.actual is None


def constellation(t_s: float, count: int = 6) -> Iterator[AircraftReport]:
    for index in range(count):
        yield AircraftReport(t_s, f"40000{index}", 47.0 + 0.02 * index, 8.0 + 0.03 * (index % 3), 9000.0)


def test_receiver_is_estimated_every_five_seconds() -> None:
    watch = ReceiverWatch(FrameMode.SPHERICAL)
    times = [
        event.t_s for second in range(16) for event in constellation(float(second)) if watch.take(event) is not None
    ]
    assert times == [5.0, 10.0, 15.0]


def test_record_of_an_estimate_has_its_time_and_position() -> None:
    watch = ReceiverWatch(FrameMode.SPHERICAL)
    found = [watch.take(event) for second in range(6) for event in constellation(float(second))]
    ((position, record),) = [one for one in found if one is not None]
    assert record["t_s"] == position.t_s == 5.0
    assert (record["lat"], record["lon"]) == (position.point.latitude_deg, position.point.longitude_deg)
    assert record["aircraft_used"] + record["rejected_outliers"] == 6


def test_three_aircraft_are_too_few_for_an_estimate() -> None:
    watch = ReceiverWatch(FrameMode.SPHERICAL)
    assert not any(watch.take(event) for second in range(12) for event in constellation(float(second), 3))


def test_estimates_go_on_after_the_clock_was_set_back() -> None:
    watch = ReceiverWatch(FrameMode.SPHERICAL)
    found = [
        watch.take(event) for start in (1000.0, 0.0) for second in range(7) for event in constellation(start + second)
    ]
    assert [one[0].t_s for one in found if one is not None] == [1005.0, 5.0]
