# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulated IMU shows the motion, its biases and its noise, and the same each time."""

import itertools

import numpy as np
import pytest

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.types import ImuBias
from viso.companion.world.imu import SimulatedImu
from viso.companion.world.motion import nadir_survey

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


def test_another_seed_gives_other_noise() -> None:
    assert not np.array_equal(read(SimulatedImu(SURVEY, seed=4), 10)[1], read(SimulatedImu(SURVEY, seed=5), 10)[1])
