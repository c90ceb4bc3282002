# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The state between camera frames."""

import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest

from viso.companion.odometry.composer import LocalPose
from viso.companion.odometry.propagation import HISTORY_NS, MotionState, OdometryPropagator
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.types import ImuBias, ImuSample
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

AtRest = Callable[[int], ImuSample]

MS = 1_000_000
SILENT = ImuNoise(1e-15, 1e-15, 1e-15, 1e-15)
EXACT = np.zeros((6, 6))
STILL = np.zeros(3)
UP = np.array([0.0, 0.0, GRAVITY_MSS])


def origin(covariance: Array = EXACT) -> LocalPose:
    return LocalPose(SE3.identity(), covariance)


def started(
    samples: Iterable[ImuSample],
    *,
    noise: ImuNoise = SILENT,
    pose: LocalPose | None = None,
    velocity_b: Array = STILL,
    velocity_sigma_m_s: float = 0.0,
) -> OdometryPropagator:
    """Return a propagator corrected at time 0 that has taken the samples."""
    propagator = OdometryPropagator(noise, velocity_sigma_m_s=velocity_sigma_m_s)
    propagator.correct(0, pose or origin(), velocity_b, ImuBias.zero())
    for sample in samples:
        propagator.add_imu(sample)
    return propagator


def state_of(propagator: OdometryPropagator) -> MotionState:
    state = propagator.state()
    assert state is not None
    return state


def turning(t_ns: int, speed: float = 4.0, rate: float = 0.8) -> ImuSample:
    """What an IMU feels on a level circle to the left."""
    return ImuSample(t_ns, np.array([0.0, speed * rate, GRAVITY_MSS]), np.array([0.0, 0.0, rate]))


def every(step_ms: int, end_ms: int, make: Callable[[int], ImuSample], start_ms: int = 0) -> list[ImuSample]:
    return [make(t_ms * MS) for t_ms in range(start_ms, end_ms + 1, step_ms)]


def test_there_is_no_state_before_a_camera_frame(at_rest: AtRest) -> None:
    propagator = OdometryPropagator(SILENT)
    propagator.add_imu(at_rest(0))
    assert propagator.state() is None


def test_state_without_inertial_data_is_the_camera_frames() -> None:
    pose = LocalPose(SE3(so3_exp(np.array([0.1, 0.2, 0.3])), np.array([1.0, 2.0, 3.0])), np.diag([1e-3] * 6))
    propagator = started([], pose=pose, velocity_b=np.array([1.0, 0.5, 0.0]))
    state = state_of(propagator)
    assert state.t_ns == 0
    assert state.pose.L_T_B.t == pytest.approx(pose.L_T_B.t)
    assert state.pose.covariance_6x6 == pytest.approx(pose.covariance_6x6)
    assert state.velocity_b == pytest.approx([1.0, 0.5, 0.0])
    assert state.gyro_b is None


def test_body_on_a_circle_is_followed() -> None:
    state = state_of(started(every(5, 1000, turning), velocity_b=np.array([4.0, 0.0, 0.0])))
    assert state.t_ns == 1000 * MS
    assert state.pose.L_T_B.t == pytest.approx([5 * math.sin(0.8), 5 * (1 - math.cos(0.8)), 0.0], abs=1e-9)
    np.testing.assert_allclose(state.pose.L_T_B.R, so3_exp(np.array([0.0, 0.0, 0.8])), atol=1e-9)
    assert state.velocity_b == pytest.approx([4.0, 0.0, 0.0], abs=1e-9)


def test_samples_that_do_not_fall_on_the_frame_are_interpolated() -> None:
    def jerk(t_ns: int) -> ImuSample:
        return ImuSample(t_ns, np.array([t_ns * 1e-9, 0.0, GRAVITY_MSS]), STILL)

    propagator = OdometryPropagator(SILENT, velocity_sigma_m_s=0.0)
    for sample in every(10, 100, jerk):
        propagator.add_imu(sample)
    propagator.correct(33 * MS, origin(), STILL, ImuBias.zero())
    assert state_of(propagator).velocity_b[0] == pytest.approx((0.1**2 - 0.033**2) / 2, rel=1e-9)


@pytest.mark.parametrize("frame_ms", [0, 33, 40, 199, 200])
def test_late_frame_gives_the_same_as_a_punctual_one(frame_ms: int) -> None:
    pose, velocity_b = origin(np.diag([1e-4] * 3 + [1e-2] * 3)), np.array([4.0, 0.0, 0.0])
    samples = every(5, 200, turning)
    late, punctual = OdometryPropagator(ImuNoise()), OdometryPropagator(ImuNoise())
    for sample in samples:
        late.add_imu(sample)
    late.correct(frame_ms * MS, pose, velocity_b, ImuBias.zero())
    for sample in (sample for sample in samples if sample.t_ns <= frame_ms * MS):
        punctual.add_imu(sample)
    punctual.correct(frame_ms * MS, pose, velocity_b, ImuBias.zero())
    for sample in (sample for sample in samples if sample.t_ns > frame_ms * MS):
        punctual.add_imu(sample)
    found, expected = state_of(late), state_of(punctual)
    assert found.t_ns == expected.t_ns == 200 * MS
    assert found.pose.L_T_B.matrix() == pytest.approx(expected.pose.L_T_B.matrix(), abs=1e-12)
    assert found.pose.covariance_6x6 == pytest.approx(expected.pose.covariance_6x6, abs=1e-15)


def test_bias_is_taken_off() -> None:
    bias = ImuBias(np.array([0.1, -0.2, 0.3]), np.array([0.01, 0.02, -0.03]))

    def biased(t_ns: int) -> ImuSample:
        return ImuSample(t_ns, UP + bias.accel, bias.gyro)

    propagator = OdometryPropagator(SILENT)
    for sample in every(5, 500, biased):
        propagator.add_imu(sample)
    propagator.correct(0, origin(), STILL, bias)
    state = state_of(propagator)
    assert state.pose.L_T_B.t == pytest.approx(np.zeros(3), abs=1e-9)
    assert state.gyro_b == pytest.approx(np.zeros(3), abs=1e-12)


def test_gravity_points_where_it_is_said_to(at_rest: AtRest) -> None:
    leaning = so3_exp(np.array([0.02, 0.0, 0.0]))
    propagator = OdometryPropagator(SILENT)
    for sample in every(5, 500, at_rest):
        propagator.add_imu(sample)
    # The local frame has kept a wrong tilt: what the body feels is vertical all the same.
    propagator.correct(0, LocalPose(SE3(leaning, STILL), EXACT), STILL, ImuBias.zero(), leaning[:, 2])
    assert state_of(propagator).pose.L_T_B.t == pytest.approx(np.zeros(3), abs=1e-12)


def test_rate_is_that_of_the_newest_sample() -> None:
    assert state_of(started(every(5, 50, turning))).gyro_b == pytest.approx([0.0, 0.0, 0.8])


def position_variance(noise: ImuNoise, at_rest: AtRest, **options: object) -> Array:
    state = state_of(started(every(5, 500, at_rest), noise=noise, **options))  # type: ignore[arg-type]
    return np.array(np.diag(state.pose.covariance_6x6))


def test_covariance_grows_by_the_accelerometers_noise(at_rest: AtRest) -> None:
    variance = position_variance(ImuNoise(1e-15, 0.2, 1e-15, 1e-15), at_rest)
    assert variance[3:] == pytest.approx([0.2**2 * 0.5**3 / 3] * 3, rel=1e-3)


def test_covariance_grows_by_the_gyros_noise(at_rest: AtRest) -> None:
    variance = position_variance(ImuNoise(0.01, 1e-15, 1e-15, 1e-15), at_rest)
    assert variance[:3] == pytest.approx([0.01**2 * 0.5] * 3, rel=1e-6)
    # Tilt that has walked off turns gravity into acceleration: its white noise is integrated three times.
    assert variance[3] == pytest.approx((0.01 * GRAVITY_MSS) ** 2 * 0.5**5 / 20, rel=1e-2)


def test_covariance_grows_by_the_velocitys_sigma(at_rest: AtRest) -> None:
    variance = position_variance(SILENT, at_rest, velocity_sigma_m_s=0.3)
    assert variance[3:] == pytest.approx([(0.3 * 0.5) ** 2] * 3, rel=1e-6)


def test_covariance_grows_by_the_tilts_sigma(at_rest: AtRest) -> None:
    variance = position_variance(SILENT, at_rest, pose=origin(np.diag([0.01**2] * 3 + [0.0] * 3)))
    assert variance[3:5] == pytest.approx([(0.01 * GRAVITY_MSS * 0.5**2 / 2) ** 2] * 2, rel=1e-6)


def test_covariance_of_a_leaning_body_comes_back_in_its_own_axes() -> None:
    lean = so3_exp(np.array([0.5, 0.3, 1.0]))
    covariance = np.diag([1e-4, 2e-4, 3e-4, 0.1, 0.2, 0.3])
    covariance[0, 4] = covariance[4, 0] = 1e-3
    state = state_of(started([], pose=LocalPose(SE3(lean, STILL), covariance)))
    assert state.pose.covariance_6x6 == pytest.approx(covariance, abs=1e-15)


def test_each_camera_frame_replaces_what_was_propagated(at_rest: AtRest) -> None:
    propagator = started(every(5, 1000, at_rest), noise=ImuNoise(), velocity_sigma_m_s=0.5)
    pose = LocalPose(SE3(np.eye(3), np.array([1.0, 0.0, 0.0])), np.diag([1e-6] * 6))
    propagator.correct(1000 * MS, pose, STILL, ImuBias.zero())
    state = state_of(propagator)
    assert state.pose.L_T_B.t == pytest.approx([1.0, 0.0, 0.0])
    assert state.pose.covariance_6x6 == pytest.approx(np.diag([1e-6] * 6), abs=1e-12)


def test_correction_is_measured_at_the_newest_instant() -> None:
    propagator = started(every(5, 400, turning), velocity_b=np.array([4.0, 0.0, 0.0]), velocity_sigma_m_s=0.25)
    stated = state_of(propagator)
    expected_at_200 = state_of(started(every(5, 200, turning), velocity_b=np.array([4.0, 0.0, 0.0])))
    shifted = SE3(expected_at_200.pose.L_T_B.R, expected_at_200.pose.L_T_B.t + np.array([0.0, 0.7, 0.0]))
    correction = propagator.correct(200 * MS, LocalPose(shifted, EXACT), np.array([4.0, 0.0, 0.0]), ImuBias.zero())
    assert correction is not None
    assert correction[0] == pytest.approx([0.0, 0.7, 0.0], abs=1e-9)
    assert np.trace(correction[1]) == pytest.approx(np.trace(stated.pose.covariance_6x6[3:, 3:]))


def test_frame_ahead_of_the_inertial_data_is_compared_with_where_the_body_was_going(at_rest: AtRest) -> None:
    propagator = started(every(5, 100, at_rest), velocity_b=np.array([2.0, 0.0, 0.0]))
    pose = LocalPose(SE3(np.eye(3), np.array([0.6, 0.0, 0.0])), EXACT)
    correction = propagator.correct(300 * MS, pose, np.array([2.0, 0.0, 0.0]), ImuBias.zero())
    assert correction is not None
    assert correction[0] == pytest.approx(np.zeros(3), abs=1e-9)
    assert state_of(propagator).t_ns == 300 * MS


def test_first_frame_corrects_nothing() -> None:
    assert OdometryPropagator(SILENT).correct(0, origin(), STILL, ImuBias.zero()) is None


def test_frame_not_newer_than_the_last_is_an_error() -> None:
    propagator = started([])
    with pytest.raises(ValueError, match="t_ns"):
        propagator.correct(0, origin(), STILL, ImuBias.zero())


def test_first_sample_of_all_only_starts_the_way(at_rest: AtRest) -> None:
    propagator = started([turning(10 * MS)])
    assert state_of(propagator).t_ns == 0
    propagator.add_imu(turning(20 * MS))
    assert state_of(propagator).t_ns == 20 * MS


def test_sample_not_newer_than_the_last_is_left_out(at_rest: AtRest) -> None:
    propagator = started(every(5, 100, at_rest))
    assert not propagator.add_imu(turning(100 * MS))
    assert state_of(propagator).gyro_b == pytest.approx(STILL)
    assert propagator.add_imu(turning(101 * MS))


def test_flight_without_frames_goes_on_past_the_history() -> None:
    end_ms = HISTORY_NS // MS + 2000
    state = state_of(started(every(20, end_ms, turning), velocity_b=np.array([4.0, 0.0, 0.0])))
    angle = 0.8 * end_ms * 1e-3
    assert state.pose.L_T_B.t == pytest.approx([5 * math.sin(angle), 5 * (1 - math.cos(angle)), 0.0], abs=1e-6)
    assert np.isfinite(state.pose.covariance_6x6).all()


def test_covariance_does_not_depend_on_where_the_history_ends(at_rest: AtRest) -> None:
    """After 12 s the tilt's noise has been integrated over the whole time, not since the history began."""
    noise = ImuNoise(0.001, 1e-15, 1e-15, 1e-15)
    state = state_of(started(every(20, 12_000, at_rest), noise=noise))
    assert state.pose.covariance_6x6[3, 3] == pytest.approx((0.001 * GRAVITY_MSS) ** 2 * 12.0**5 / 20, rel=1e-2)
