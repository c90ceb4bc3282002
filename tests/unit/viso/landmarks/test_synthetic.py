# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The synthetic flight: exact without noise, its errors as planted, and the same for the same seed."""

import dataclasses
import math

import numpy as np
import pytest

from tests.unit.viso.landmarks.scenes import flown, scenes_of
from viso.landmarks.fit import fit_pose_errors
from viso.landmarks.local_frame import FrameMode, to_enu
from viso.landmarks.scene import Scene
from viso.landmarks.session import Session, Settings
from viso.landmarks.synthetic import REFERENCE, TRAFFIC, Planted, SyntheticFlight
from viso.landmarks.types import AircraftReport, Camera, Detections, LandmarkMap, VehiclePose

CAMERA = Camera(offset_forward_m=0.5, offset_left_m=-0.2, heading_offset_rad=0.02, pitch_trim_rad=-0.03)
SHORT = SyntheticFlight(CAMERA, duration_s=3.0, mode=FrameMode.SPHERICAL)


def innovations(scenes: list[Scene]) -> list[tuple[float, float]]:
    residuals = [one for scene in scenes for one in (scene.landmark_residuals, scene.aircraft_residuals)]
    return [(one.du_px, one.dv_px) for residual in residuals for one in residual.innovations]


@pytest.mark.slow
@pytest.mark.parametrize("mode", FrameMode)
@pytest.mark.parametrize("qnh_offset_m", [pytest.param(None, marks=pytest.mark.slow), 44.0])
def test_innovations_are_exactly_zero_without_noise(mode: FrameMode, qnh_offset_m: float | None) -> None:
    flight = SyntheticFlight(CAMERA, duration_s=20.0, mode=mode, qnh_offset_m=qnh_offset_m)
    session = Session(Settings(camera=CAMERA, mode=mode, qnh_offset_m=qnh_offset_m))
    scenes = scenes_of(session, flight.events())
    found = innovations(scenes)
    assert set(found) == {(0.0, 0.0)}
    assert len(found) > 5 * len(scenes)
    assert len(scenes) == 101
    assert not session.dropped


def test_five_landmarks_are_where_the_vehicle_looks() -> None:
    (known,) = [event for event in SHORT.events() if isinstance(event, LandmarkMap)]
    assert [(one.x_m, one.y_m) for one in known.landmarks] == [(10, 5), (15, 8), (20, 11), (25, 14), (30, 17)]
    start = SHORT.truth(0.0)
    assert (start.x_m, start.y_m) == (0, 0)
    assert len(flown(SHORT)[0].landmark_residuals.innovations) == 5


def test_poses_come_at_20_hz_and_pictures_at_5() -> None:
    events = list(SHORT.events())
    assert len([event for event in events if isinstance(event, VehiclePose)]) == 61
    assert [event.t_s for event in events if isinstance(event, Detections)] == [index / 5 for index in range(16)]
    assert len([event for event in events if isinstance(event, AircraftReport)]) == 4 * len(TRAFFIC)


def test_events_come_in_the_order_of_their_times() -> None:
    times = [event.t_s for event in dataclasses.replace(SHORT, planted=Planted(delay_s=0.13)).events()]
    assert times == sorted(times)


@pytest.mark.slow
def test_noise_has_its_sigma_and_its_seed() -> None:
    flight = SyntheticFlight(CAMERA, noise_px=2.0, seed=3, traffic=())
    values = np.array(innovations(flown(flight)))
    assert np.abs(values.mean(axis=0)).max() < 0.2
    assert values.std(axis=0) == pytest.approx(2.0, rel=0.05)
    again, other = dataclasses.replace(flight, duration_s=2.0), dataclasses.replace(flight, duration_s=2.0, seed=4)
    assert innovations(flown(again)) == innovations(flown(again)) != innovations(flown(other))


@pytest.mark.slow
def test_share_of_detections_is_of_another_landmark() -> None:
    scenes = flown(dataclasses.replace(SHORT, duration_s=60.0, wrong_share=0.1, traffic=()))
    all_of = [one for scene in scenes for one in scene.landmark_residuals.innovations]
    wrong = [one for one in all_of if (one.du_px, one.dv_px) != (0, 0)]
    assert len(wrong) / len(all_of) == pytest.approx(0.1, abs=0.02)
    for scene in scenes:
        predicted = {mark.predicted for mark in scene.landmarks}
        assert {mark.actual for mark in scene.landmarks if mark.actual} <= predicted
        assert not scene.landmark_residuals.duplicates


def test_planted_yaw_is_missing_from_the_reported_one() -> None:
    flight = dataclasses.replace(SHORT, planted=Planted(yaw_offset_rad=0.1))
    assert flight.truth(1.0).yaw_rad - flight.reported(1.0).yaw_rad == pytest.approx(0.1)
    mean = np.mean([one[0] for one in innovations(flown(dataclasses.replace(flight, traffic=())))])
    assert mean > 50  # the true view is further to the left, so all is further to the right in it


def test_planted_pitch_moves_all_down_in_the_picture() -> None:
    flight = dataclasses.replace(SHORT, planted=Planted(pitch_trim_rad=0.05))
    assert min(one[1] for one in innovations(flown(flight))) > 40


def test_planted_delay_is_in_the_stamps() -> None:
    stamps = [
        event.t_s
        for event in dataclasses.replace(SHORT, planted=Planted(delay_s=0.07)).events()
        if isinstance(event, Detections)
    ]
    assert stamps == pytest.approx([0.07 + index / 5 for index in range(16)])


@pytest.mark.slow
@pytest.mark.parametrize("planted", [Planted(math.radians(-10), 0.02, 0.3), Planted(0.05, -0.03, 0.0)])
def test_fit_finds_what_was_planted(planted: Planted) -> None:
    flight = SyntheticFlight(CAMERA, planted, 1.0, 0.1, seed=11, traffic=(), mode=FrameMode.SPHERICAL)
    session = Session(Settings(camera=CAMERA, mode=FrameMode.SPHERICAL))
    scenes_of(session, flight.events())
    found = fit_pose_errors(CAMERA, session.poses, session.landmarks, session.pictures)
    assert found.yaw_offset_rad == pytest.approx(planted.yaw_offset_rad, abs=math.radians(0.2))
    assert found.pitch_trim_rad == pytest.approx(planted.pitch_trim_rad, abs=math.radians(0.1))
    assert found.delay_s == pytest.approx(planted.delay_s, abs=0.02)


@pytest.mark.parametrize("one", TRAFFIC, ids=lambda one: str(one.icao))
def test_aircraft_fly_where_they_say(one: object) -> None:
    index = TRAFFIC.index(one)
    told = [event for event in SHORT.events() if isinstance(event, AircraftReport)][index :: len(TRAFFIC)]
    for t_s, report in enumerate(told):
        alt_m = TRAFFIC[index].enu(t_s)[2] + REFERENCE.alt_m
        enu = to_enu(FrameMode.SPHERICAL, REFERENCE, report.latitude_deg, report.longitude_deg, alt_m)
        assert enu == pytest.approx(TRAFFIC[index].enu(t_s), abs=1e-4)
    step_s = 1e-3
    before, after = np.array(TRAFFIC[index].enu(2 - step_s)), np.array(TRAFFIC[index].enu(2 + step_s))
    east, north, up = ((after - before) / (2 * step_s)).tolist()
    assert math.degrees(math.atan2(east, north)) % 360 == pytest.approx(told[2].heading_deg, abs=1e-3)
    assert math.hypot(east, north) == pytest.approx(told[2].speed_kt * 0.514444, rel=1e-6)
    assert up == pytest.approx(told[2].vertical_rate_ft_min * 0.3048 / 60, abs=1e-6)


def test_aircraft_without_altitude_is_never_predicted() -> None:
    quiet = next(one.icao for one in TRAFFIC if not one.tells_altitude)
    assert all(mark.predicted is None for scene in flown(SHORT) for mark in scene.aircraft if mark.id == quiet)
