# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Preintegration: against exact motions, numerical derivatives, drawn noise, and gtsam."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.imu import ImuSteps, steps_between
from viso.companion.vio.preintegration import PreintegratedDelta, preintegrate
from viso.companion.vio.types import ImuBias, ImuSample
from viso.geometry.rotation import Array, so3_log

NOISE = ImuNoise()
BIAS = ImuBias(np.array([0.1, -0.2, 0.05]), np.array([0.01, 0.02, -0.015]))
PERIOD_NS = 5_000_000
RATES = st.tuples(*[st.floats(-6, 6)] * 3).map(np.array)


def gyro_at(t_s: Array) -> Array:
    return np.stack([1.2 * np.sin(3 * t_s), 0.8 * np.cos(2 * t_s), 0.9 + 0 * t_s], axis=-1)


def accel_at(t_s: Array) -> Array:
    return np.stack([1.2 * np.sin(5 * t_s), 1 + 0.8 * np.cos(4 * t_s), 9.8 + 0 * t_s], axis=-1)


@dataclass
class Samples:
    """Samples to integrate over, and the bias to take off."""

    bias: ImuBias = BIAS
    samples: list[ImuSample] = field(default_factory=list)

    def delta(self) -> PreintegratedDelta:
        return preintegrate(steps_between(self.samples), NOISE, self.bias)

    def as_gtsam(self) -> Any:
        from viso.companion.smoother.lag_smoother import preintegrated  # for whoever has gtsam

        return preintegrated(self.samples, NOISE, self.bias)


def shaken(bias: ImuBias = BIAS, samples: int = 201) -> Samples:
    """Return a second of lively motion at 200 Hz."""
    made = Samples(bias)
    for index in range(samples):
        t_s = np.array(index * PERIOD_NS * 1e-9)
        made.samples.append(ImuSample(index * PERIOD_NS, accel_at(t_s), gyro_at(t_s)))
    return made


def steps(count: int, dt_s: float, gyro: Array, accel: Array) -> ImuSteps:
    return ImuSteps(np.full(count, dt_s), np.broadcast_to(gyro, (count, 3)), np.broadcast_to(accel, (count, 3)))


def difference(left: PreintegratedDelta, right: PreintegratedDelta) -> Array:
    """Return (rotation, dv, dp) of the right one against the left one."""
    return np.concatenate([so3_log(left.dR.T @ right.dR), right.dv - left.dv, right.dp - left.dp])


def test_no_sample_is_no_motion() -> None:
    delta = Samples().delta()
    assert (delta.dt_s, delta.dR.tolist(), delta.dv.tolist(), delta.dp.tolist()) == (
        0,
        np.eye(3).tolist(),
        [0] * 3,
        [0] * 3,
    )
    assert not delta.cov.any()
    assert not delta.jac_bias.any()


def test_first_sample_only_starts_the_time() -> None:
    assert shaken(samples=1).delta().dt_s == 0


def test_constant_force_without_turning_is_a_parabola() -> None:
    delta = preintegrate(steps(10, 0.1, np.zeros(3), np.array([1, 2, 3])), NOISE, ImuBias.zero())
    assert delta.dt_s == pytest.approx(1)
    assert np.allclose(delta.dR, np.eye(3))
    assert np.allclose(delta.dv, [1, 2, 3])
    assert np.allclose(delta.dp, [0.5, 1, 1.5])


def test_turning_while_pushed_to_the_centre_is_a_circle() -> None:
    speed, rate = 3.0, 2.0
    delta = preintegrate(steps(1, 1.5, np.array([0, 0, rate]), np.array([0, speed * rate, 0])), NOISE, ImuBias.zero())
    angle, radius = rate * 1.5, speed / rate
    assert np.allclose(delta.dv, [speed * (math.cos(angle) - 1), speed * math.sin(angle), 0], atol=1e-12)
    on_the_circle = np.array([radius * math.sin(angle), radius * (1 - math.cos(angle)), 0])
    assert np.allclose(delta.dp + np.array([speed * 1.5, 0, 0]), on_the_circle, atol=1e-12)


@given(RATES, RATES, st.sampled_from([1e-6, 1e-4, 1e-2, 1.0]))
def test_one_step_is_as_good_as_many_while_nothing_changes(gyro: Array, accel: Array, dt_s: float) -> None:
    one = preintegrate(steps(1, dt_s, gyro, accel), NOISE, ImuBias.zero())
    many = preintegrate(steps(7, dt_s / 7, gyro, accel), NOISE, ImuBias.zero())
    assert np.allclose(difference(one, many)[:6], 0, atol=1e-12)
    assert np.allclose(one.dp, many.dp, atol=1e-12)


def test_error_of_lively_motion_falls_with_the_square_of_the_period() -> None:
    def at(count: int) -> PreintegratedDelta:
        t_s = np.linspace(0, 1, count + 1)
        gyro, accel = gyro_at(t_s), accel_at(t_s)
        means = (gyro[1:] + gyro[:-1]) / 2, (accel[1:] + accel[:-1]) / 2
        return preintegrate(ImuSteps(np.diff(t_s), *means), NOISE, ImuBias.zero())

    fine = at(3200)
    coarse, halved = np.abs(difference(fine, at(100))), np.abs(difference(fine, at(200)))
    assert halved.max() < 2e-4
    assert np.linalg.norm(coarse) / np.linalg.norm(halved) == pytest.approx(4, abs=0.1)


def test_bias_is_taken_off() -> None:
    moved = Samples()
    for t_ns in (0, PERIOD_NS):
        moved.samples.append(ImuSample(t_ns, BIAS.accel, BIAS.gyro))
    assert np.allclose(moved.delta().dR, np.eye(3), atol=1e-15)
    assert np.allclose(moved.delta().dv, 0, atol=1e-15)


@pytest.mark.parametrize("column", range(6))
def test_bias_jacobian_is_the_derivative(column: int) -> None:
    step = 1e-5 * np.eye(6)[column]
    forth = shaken(ImuBias(BIAS.accel + step[3:], BIAS.gyro + step[:3])).delta()
    back = shaken(ImuBias(BIAS.accel - step[3:], BIAS.gyro - step[:3])).delta()
    middle = shaken().delta()
    derivative = (difference(middle, forth) - difference(middle, back)) / 2e-5
    assert np.allclose(middle.jac_bias[:, column], derivative, atol=2e-5 * np.abs(middle.jac_bias).max())


@pytest.mark.slow
def test_covariance_is_that_of_drawn_noise() -> None:
    rng, count, dt_s = np.random.default_rng(1), 20, 0.01
    gyro, accel = np.array([1.0, -2.0, 1.5]), np.array([1.0, 2.0, 9.8])
    truth = preintegrate(steps(count, dt_s, gyro, accel), NOISE, ImuBias.zero())
    draws = []
    for _ in range(500):
        noisy = ImuSteps(
            np.full(count, dt_s),
            gyro + NOISE.gyro / math.sqrt(dt_s) * rng.standard_normal((count, 3)),
            accel + NOISE.accel / math.sqrt(dt_s) * rng.standard_normal((count, 3)),
        )
        draws.append(difference(truth, preintegrate(noisy, NOISE, ImuBias.zero())))
    sigma = np.sqrt(truth.cov.diagonal())
    correlation = truth.cov / np.outer(sigma, sigma)
    assert np.allclose(np.cov(np.array(draws).T) / np.outer(sigma, sigma), correlation, atol=0.2)


def test_covariance_of_standing_still_is_that_of_a_random_walk() -> None:
    cov = preintegrate(steps(200, 0.005, np.zeros(3), np.zeros(3)), NOISE, ImuBias.zero()).cov
    variances = np.repeat([NOISE.gyro**2, NOISE.accel**2, NOISE.accel**2 / 3], 3)
    assert np.allclose(cov.diagonal(), variances, rtol=1e-4)


def test_covariance_is_symmetric_and_positive() -> None:
    cov = shaken().delta().cov
    assert np.allclose(cov, cov.T, rtol=1e-12)
    assert np.linalg.eigvalsh(cov)[0] > 0


def test_gtsam_integrates_the_same_motion() -> None:
    pytest.importorskip("gtsam")
    ours, theirs = shaken().delta(), shaken().as_gtsam()
    assert theirs.deltaTij() == pytest.approx(ours.dt_s)
    assert np.allclose(theirs.deltaRij().matrix(), ours.dR, atol=1e-6)
    assert np.allclose(theirs.deltaVij(), ours.dv, atol=1e-6)
    assert np.allclose(theirs.deltaPij(), ours.dp, atol=1e-6)


def test_gtsam_propagates_the_same_noise() -> None:
    pytest.importorskip("gtsam")
    delta = shaken().delta()
    # Theirs is in the order (rotation, position, velocity) and in the body's axes at the end; ours at the start.
    turn = np.zeros((9, 9))
    turn[:3, :3], turn[3:6, 6:], turn[6:, 3:6] = np.eye(3), delta.dR, delta.dR
    theirs = turn @ shaken().as_gtsam().preintMeasCov()[:9, :9] @ turn.T
    sigma = np.sqrt(delta.cov.diagonal())
    assert np.allclose(theirs / np.outer(sigma, sigma), delta.cov / np.outer(sigma, sigma), atol=2e-3)


def test_gtsam_predicts_with_gravity_down() -> None:
    gtsam = pytest.importorskip("gtsam")
    still = Samples(ImuBias.zero())
    for t_ns in range(0, 200 * PERIOD_NS + 1, PERIOD_NS):
        still.samples.append(ImuSample(t_ns, np.array([0, 0, GRAVITY_MSS]), np.zeros(3)))
    predicted = still.as_gtsam().predict(gtsam.NavState(), gtsam.imuBias.ConstantBias())
    assert np.allclose(predicted.velocity(), 0, atol=1e-9)
    assert np.allclose(predicted.position(), 0, atol=1e-9)
