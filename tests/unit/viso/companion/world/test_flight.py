# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A synthetic flight gives what sensors would, in the order in which it arrives, and knows the truth."""

import dataclasses
import itertools
from collections.abc import Iterable
from functools import cache
from typing import Any, TypeVar

import numpy as np
import pytest

from tests.unit.viso.companion.world.from_ground import from_ground
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.types import HeightMeasurement, ImuBias, ImuSample, NavCameraFrame, SensorEvent
from viso.companion.world.flight import SimulatedImu, SyntheticFlight, nadir_calibration
from viso.companion.world.motion import nadir_survey
from viso.companion.world.texture import GroundTexture
from viso.geometry.rotation import so3_log

PIXELS = np.random.default_rng(1).integers(50, 200, (64, 64), np.uint8)
GROUND = GroundTexture(PIXELS, 0.5, np.full((8, 8), 128, np.uint8))
CALIBRATION = nadir_calibration(80, 60, 60.0)
A = TypeVar("A", ImuSample, HeightMeasurement, NavCameraFrame)


def flight(**options: Any) -> SyntheticFlight:
    defaults = {"texture": GROUND, "calibration": CALIBRATION, "duration_s": 2.0, "trajectory": nadir_survey(seed=1)}
    return SyntheticFlight(**{**defaults, **options})


@cache
def flown_events(seed: int = 0) -> list[SensorEvent]:
    """Return the events of a flight, for looking at alone."""
    return list(flight(seed=seed).events())


def only(kind: type[A], events: Iterable[SensorEvent]) -> list[A]:
    return [event for event in events if isinstance(event, kind)]


def stamp_ns(event: SensorEvent) -> int:
    return event.capture_timestamp if isinstance(event, NavCameraFrame) else event.t_ns


def told(event: SensorEvent) -> tuple[Any, ...]:
    if isinstance(event, ImuSample):
        return event.t_ns, event.gyro.tobytes(), event.accel.tobytes()
    if isinstance(event, NavCameraFrame):
        return event.frame_id, event.sequence, event.capture_timestamp, event.pixels.tobytes()
    return event.t_ns, event.height_m


def test_flying_again_gives_the_same_events() -> None:
    assert [told(event) for event in flight(seed=3).events()] == [told(event) for event in flown_events(3)]


@pytest.mark.parametrize("kind", [ImuSample, HeightMeasurement, NavCameraFrame])
def test_another_seed_gives_other_noise(kind: type[ImuSample]) -> None:
    first, second = (only(kind, flown_events(seed)) for seed in (3, 0))
    assert told(first[0])[1:] != told(second[0])[1:]


def test_defaults_are_a_minute_at_a_third_of_a_second() -> None:
    flown = SyntheticFlight(texture=GROUND)
    assert (flown.calibration.width, flown.calibration.height, flown.calibration.fx) == (640, 480, 500.0)
    assert (flown.duration_s, flown.height_sigma_m, flown.imu_rate_hz) == (60.0, 0.3, 200)
    assert flown.frame_rate_hz == pytest.approx(3.333, abs=1e-3)
    assert flown.truth(0).t[2] == pytest.approx(40, abs=1.5)


@pytest.mark.slow
def test_there_is_an_event_for_each_reading() -> None:
    flown = list(flight(frame_rate_hz=10.0, imu_rate_hz=100).events())
    assert len(only(NavCameraFrame, flown)) == len(only(HeightMeasurement, flown)) == 20
    assert len(only(ImuSample, flown)) == 204  # and as long as the last frame takes to arrive


def test_frames_arrive_when_the_imu_has_passed_them() -> None:
    seen_ns = -1
    for event in flown_events():
        if isinstance(event, ImuSample):
            assert event.t_ns > seen_ns
            seen_ns = event.t_ns
        elif isinstance(event, NavCameraFrame):
            assert 20_000_000 < seen_ns - event.capture_timestamp <= 30_000_000
        else:
            assert 0 <= event.t_ns - seen_ns < 5_000_000


def test_frames_are_numbered_and_in_step_with_their_rate() -> None:
    frames = only(NavCameraFrame, flight(frame_rate_hz=4.0, shutter_phase_s=0.0).events())
    assert [frame.sequence for frame in frames] == list(range(9))
    assert [frame.capture_timestamp for frame in frames] == [k * 250_000_000 for k in range(9)]


def test_start_moves_all_stamps() -> None:
    first, later = (map(stamp_ns, events) for events in (flown_events(), flight(start_ns=12_345).events()))
    assert {moved - stamp for stamp, moved in zip(first, later, strict=True)} == {12_345}


def test_start_does_not_move_the_truth() -> None:
    assert np.array_equal(flight(start_ns=5_000).truth(1_000_005_000).t, flight().truth(1_000_000_000).t)


def test_cameras_clock_may_be_off() -> None:
    late = dataclasses.replace(CALIBRATION, time_offset_s=0.01)
    flights = flown_events(), flight(calibration=late).events()
    stamps = [[frame.capture_timestamp for frame in only(NavCameraFrame, events)] for events in flights]
    assert np.subtract(stamps[0], stamps[1]).tolist() == [10_000_000] * len(stamps[0])


def test_truth_is_the_trajectorys() -> None:
    flown = flight()
    assert np.array_equal(flown.truth(1_500_000_000).t, flown.trajectory.pose(1.5).t)
    assert np.array_equal(flown.truth_velocity_w(1_500_000_000), flown.trajectory.velocity_w(1.5))


@pytest.mark.slow
@pytest.mark.parametrize("scale", [pytest.param(1.0, marks=pytest.mark.slow), 1.03])
def test_heights_are_noisy_and_may_be_off_by_a_scale(scale: float) -> None:
    tiny = nadir_calibration(8, 6, 6.0)
    flown = flight(frame_rate_hz=400.0, height_sigma_m=0.2, height_scale=scale, calibration=tiny)
    heights = only(HeightMeasurement, flown.events())
    errors = np.array([event.height_m - scale * flown.truth(event.t_ns).t[2] for event in heights])
    assert errors.mean() == pytest.approx(0, abs=0.03)
    assert errors.std() == pytest.approx(0.2, rel=0.1)
    assert {event.sigma_m for event in heights} == {0.2}


def test_heights_may_be_absent() -> None:
    assert not only(HeightMeasurement, flight(height_sigma_m=None, duration_s=0.5).events())


def test_lens_is_covered_for_a_while() -> None:
    frames = only(NavCameraFrame, flight(frame_rate_hz=10.0, covered_s=((0.5, 1.0), (1.5, 1.6))).events())
    dark = [frame.sequence for frame in frames if frame.pixels.mean() < 3]
    assert dark == [5, 6, 7, 8, 9, 15]


def test_flight_may_begin_on_the_ground() -> None:
    flown = flight(trajectory=from_ground(nadir_survey()), duration_s=0.5)
    assert len(only(NavCameraFrame, flown.events())) == 2
    assert flown.truth(0).t[2] == 0.25


def test_warm_start_without_errors_is_the_truth() -> None:
    flown = flight()
    start = flown.warm_start(1_000_000_000, angle_sigma_rad=0.0, velocity_sigma_m_s=0.0)
    world_T_body = start.body_T_world.inverse()
    assert np.abs(world_T_body.R - flown.truth(1_000_000_000).R).max() < 1e-12
    assert world_T_body.t == pytest.approx(flown.truth(1_000_000_000).t)
    assert world_T_body.R @ start.velocity_b == pytest.approx(flown.truth_velocity_w(1_000_000_000))


def test_warm_start_is_that_of_the_first_frame() -> None:
    flown = flight()
    first = only(NavCameraFrame, flown_events())[0].capture_timestamp
    assert flown.warm_start().body_T_world.inverse().t == pytest.approx(flown.truth(first).t)


@pytest.mark.slow
def test_warm_start_has_errors_of_the_size_asked_for() -> None:
    angles, speeds = [], []
    for seed in range(150):
        flown = flight(seed=seed)
        start = flown.warm_start(0)
        rotation = start.body_T_world.R.T
        angles.append(so3_log(flown.truth(0).R.T @ rotation))
        speeds.append(rotation @ start.velocity_b - flown.truth_velocity_w(0))
    assert np.std(angles) == pytest.approx(0.01, rel=0.1)
    assert np.std(speeds) == pytest.approx(0.2, rel=0.1)


def test_warm_start_admits_its_errors() -> None:
    start = flight().warm_start(angle_sigma_rad=0.02, velocity_sigma_m_s=0.4)
    assert start.covariance is not None
    sigmas = np.sqrt(start.covariance.diagonal())
    assert sigmas == pytest.approx([0.02] * 3 + [1e-3, 1e-3, 0.3] + [0.4] * 3 + [0.02] * 3 + [0.15] * 3)


def test_warm_start_does_not_know_the_biases_but_admits_them() -> None:
    flown = flight()
    start = flown.warm_start()
    assert start.bias.norm() == ImuBias.zero().norm() == 0
    assert start.covariance is not None
    sigmas = np.sqrt(start.covariance.diagonal())
    assert (np.abs(flown.imu_bias.gyro) < sigmas[9:12]).all()
    assert (np.abs(flown.imu_bias.accel) < sigmas[12:]).all()


# The IMU

SURVEY = nadir_survey(seed=1)
QUIET = ImuNoise(1e-12, 1e-12, 1e-12, 1e-12)


def read(imu: SimulatedImu, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps [N], samples [N, 6] and biases [N, 6], the gyro first."""
    pairs = list(itertools.islice(imu.readings(), count))
    samples = np.array([np.concatenate([sample.gyro, sample.accel]) for sample, _ in pairs])
    biases = np.array([np.concatenate([bias.gyro, bias.accel]) for _, bias in pairs])
    return np.array([sample.t_ns for sample, _ in pairs]), samples, biases


def test_perfect_imu_shows_rates_and_specific_force() -> None:
    _, samples, _ = read(SimulatedImu(SURVEY, QUIET, ImuBias.zero()), 450)
    motion = SURVEY.motion(np.arange(450) / 200)
    assert samples == pytest.approx(np.concatenate([motion.rates_b, motion.specific_force_b], axis=1), abs=1e-9)


def test_samples_come_at_the_rate_from_the_start() -> None:
    stamps, _, _ = read(SimulatedImu(SURVEY, rate_hz=300, start_ns=7), 601)
    assert stamps[0] == 7
    assert stamps[600] == 7 + 2_000_000_000
    assert set(np.diff(stamps).tolist()) == {3_333_333, 3_333_334}


def test_imu_shows_its_biases() -> None:
    bias = ImuBias(accel=np.array([0.1, 0.2, 0.3]), gyro=np.array([0.01, 0.02, 0.03]))
    _, samples, biases = read(SimulatedImu(SURVEY, QUIET, bias), 300)
    _, without, _ = read(SimulatedImu(SURVEY, QUIET, ImuBias.zero()), 300)
    assert samples - without == pytest.approx(np.tile([0.01, 0.02, 0.03, 0.1, 0.2, 0.3], (300, 1)), abs=1e-9)
    assert biases[-1] == pytest.approx(biases[0], abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [pytest.param(100, marks=pytest.mark.slow), 400])
def test_white_noise_has_its_density(rate_hz: int) -> None:
    noise = ImuNoise(gyro=2e-3, accel=3e-2, gyro_walk=1e-12, accel_walk=1e-12)
    _, samples, _ = read(SimulatedImu(SURVEY, noise, rate_hz=rate_hz), 4000)
    _, clean, _ = read(SimulatedImu(SURVEY, QUIET, rate_hz=rate_hz), 4000)
    deviation = (samples - clean).std(axis=0) / np.sqrt(rate_hz)
    assert deviation == pytest.approx([2e-3] * 3 + [3e-2] * 3, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [pytest.param(100, marks=pytest.mark.slow), 400])
def test_biases_walk_with_their_density(rate_hz: int) -> None:
    noise = ImuNoise(gyro=1e-12, accel=1e-12, gyro_walk=1e-3, accel_walk=2e-2)
    _, samples, biases = read(SimulatedImu(SURVEY, noise, ImuBias.zero(), rate_hz), 4000)
    _, clean, _ = read(SimulatedImu(SURVEY, QUIET, ImuBias.zero(), rate_hz), 4000)
    assert samples - clean == pytest.approx(biases, abs=1e-9)
    assert np.diff(biases, axis=0).std(axis=0) * np.sqrt(rate_hz) == pytest.approx([1e-3] * 3 + [2e-2] * 3, rel=0.05)


def test_same_seed_gives_the_same_samples() -> None:
    assert np.array_equal(read(SimulatedImu(SURVEY, seed=4), 250)[1], read(SimulatedImu(SURVEY, seed=4), 250)[1])


def test_another_seed_gives_other_samples() -> None:
    assert not np.array_equal(read(SimulatedImu(SURVEY, seed=4), 10)[1], read(SimulatedImu(SURVEY, seed=5), 10)[1])
