# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Velocity in the body frame: what is expected, which axes pass, and what they change."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
import quaternion

from ap_core.fmath import f32
from ap_core.vector3 import Vector3f
from ekf_stub.filter.inertial import Array, InertialStep
from ekf_stub.filter.states import ATT, POS, VEL
from ekf_stub.fusion.aiding import AidingMode

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

NOW_MS = 50_000
STILL = InertialStep(NOW_MS, np.zeros(3), np.zeros(3), 0.0125, 0.0125)
TURNING = InertialStep(NOW_MS, np.zeros(3), np.array([0.0, 0.0, 0.025]), 0.0125, 0.0125)  # 2 rad/s to the right
VEL_VAR = 0.09  # EK3_VELNE_M_NSE, as the filter begins
BEST_ERR, WORST_ERR = 0.1, 0.9


def step(
    parts: "FilterParts",
    velocity: Vector3f,
    *,
    now_ms: int = NOW_MS,
    quality: float = 100.0,
    offset: Vector3f | None = None,
    inertial: InertialStep = STILL,
) -> None:
    """Let an odometry come due and be fused."""
    deltas = velocity * f32(0.5), Vector3f(), f32(0.5)
    parts.ingest.write_odometry(f32(quality), deltas, now_ms, 0, offset or Vector3f())
    parts.ingest.horizon_ms = now_ms
    parts.odometry.step(now_ms, inertial)


def innovation(parts: "FilterParts") -> list[float]:
    report = parts.odometry.report()
    assert report is not None
    return list(report.innovation)


def certain_of_attitude(make_parts: MakeParts, sources: str = "06101") -> "FilterParts":
    parts = make_parts(sources)
    parts.state.clear(ATT, 1e-12)
    return parts


def test_nothing_is_told_before_the_first_odometry(make_parts: MakeParts) -> None:
    parts = make_parts("06101")
    parts.odometry.step(NOW_MS, STILL)
    assert parts.odometry.report() is None
    assert not parts.odometry.is_fused


@pytest.mark.parametrize("mode", list(AidingMode))
def test_odometry_is_fused_in_every_mode(make_parts: MakeParts, mode: AidingMode) -> None:
    parts = certain_of_attitude(make_parts)
    parts.aiding.mode = mode
    step(parts, Vector3f(0.1, 0, 0))
    gain = VEL_VAR / (VEL_VAR + BEST_ERR**2)
    assert parts.state.vel == pytest.approx([0.1 * gain, 0, 0], abs=1e-6)
    assert parts.outcomes == [("odometry", "model_fused", pytest.approx(0.1 / 5 / math.hypot(0.3, 0.1), rel=1e-5))]


@pytest.mark.parametrize(("quality", "err"), [(100.0, BEST_ERR), (0.0, WORST_ERR), (50.0, 0.5)])
def test_variance_of_the_innovation_follows_from_the_quality(make_parts: MakeParts, quality: float, err: float) -> None:
    parts = certain_of_attitude(make_parts)
    step(parts, Vector3f(), quality=quality)
    report = parts.odometry.report()
    assert report is not None
    assert report.variance[0] == pytest.approx(VEL_VAR + err**2, rel=1e-5)


def test_velocity_is_expected_in_the_frame_of_the_body(make_parts: MakeParts) -> None:
    parts = make_parts("06101")
    parts.turn_to(yaw=math.pi / 2)
    parts.state.vel = np.array([1.0, 2.0, 3.0])
    step(parts, Vector3f(2, -1, 3))
    assert innovation(parts) == pytest.approx([0, 0, 0], abs=0.02)


def test_camera_away_from_the_imu_moves_as_the_vehicle_turns(make_parts: MakeParts) -> None:
    parts = certain_of_attitude(make_parts)
    step(parts, Vector3f(), offset=Vector3f(0.5, 0.25, 0), inertial=TURNING)
    assert innovation(parts) == pytest.approx([-0.5, 1.0, 0.0], abs=1e-6)


def test_rotation_over_no_time_is_not_believed(make_parts: MakeParts) -> None:
    parts = certain_of_attitude(make_parts)
    turning = InertialStep(NOW_MS, np.zeros(3), np.array([0.0, 0.0, 0.025]), 0.001, 0.001)
    step(parts, Vector3f(), offset=Vector3f(0.5, 0, 0), inertial=turning)
    assert innovation(parts) == pytest.approx([0, 0, 0], abs=1e-6)


@pytest.mark.parametrize(("sigmas", "passes"), [(4.99, True), (5.01, False)])
def test_gate_is_at_5_sigma(make_parts: MakeParts, sigmas: float, passes: bool) -> None:
    parts = certain_of_attitude(make_parts)
    step(parts, Vector3f(sigmas * math.hypot(0.3, BEST_ERR), 0, 0))
    assert parts.outcomes == [
        ("odometry", "model_fused" if passes else "model_gate_odometry", pytest.approx(sigmas / 5))
    ]
    assert bool(parts.state.vel[0] != 0) is passes


def test_axes_are_judged_one_by_one(make_parts: MakeParts) -> None:
    parts = certain_of_attitude(make_parts)
    step(parts, Vector3f(9, 0.1, 0))
    assert innovation(parts) == pytest.approx([-9, -0.1, 0], abs=1e-6)
    assert parts.state.vel[0] == pytest.approx(0, abs=1e-6)
    assert parts.state.vel[1] == pytest.approx(0.09, abs=1e-3)
    assert parts.aiding.times.odometry == NOW_MS
    assert parts.told() == ["fusing odometry"]
    assert [outcome[1] for outcome in parts.outcomes] == ["model_gate_odometry"]


def test_odometry_of_which_nothing_passes_says_nothing_and_counts_for_nothing(make_parts: MakeParts) -> None:
    parts = certain_of_attitude(make_parts)
    step(parts, Vector3f(9, 9, 9))
    assert (parts.odometry.is_fused, parts.aiding.times.odometry, parts.told()) == (False, 0, [])
    assert innovation(parts) == pytest.approx([-9, -9, -9], abs=1e-6)


def test_fusion_is_told_once_until_aiding_has_ended(make_parts: MakeParts) -> None:
    parts = make_parts("06101")
    for number in range(3):
        step(parts, Vector3f(), now_ms=NOW_MS + 100 * number)
    assert parts.told() == ["fusing odometry"]
    parts.odometry.is_fused = False
    step(parts, Vector3f(), now_ms=NOW_MS + 300)
    assert parts.told() == ["fusing odometry"]


def test_report_counts_what_came_due(make_parts: MakeParts) -> None:
    parts = make_parts("06101")
    for number in range(3):
        step(parts, Vector3f(), now_ms=NOW_MS + 100 * number)
        parts.odometry.step(NOW_MS + 100 * number + 12, STILL)
        report = parts.odometry.report()
        assert report is not None
        assert report.recalled == number + 1


@pytest.mark.parametrize("sources", ["66161", "06101"])
def test_odometry_needs_a_source_of_horizontal_velocity(make_parts: MakeParts, sources: str) -> None:
    parts = make_parts(sources)
    parts.params.set("EK3_SRC1_VELXY", 3)
    step(parts, Vector3f(1, 0, 0))
    assert parts.outcomes == [("odometry", "model_unused", None)]
    assert parts.state.vel.tolist() == [0, 0, 0]


def test_infinite_odometry_is_not_believed(make_parts: MakeParts) -> None:
    parts = make_parts("06101")
    step(parts, Vector3f(math.inf, 0, 0))
    assert parts.outcomes == [("odometry", "model_not_finite", None)]
    assert parts.state.vel.tolist() == [0, 0, 0]


def test_badly_conditioned_axis_ends_it(make_parts: MakeParts) -> None:
    parts = certain_of_attitude(make_parts)
    parts.state.cov[VEL.start, VEL.start] = -1.0
    step(parts, Vector3f(0, 0.1, 0))
    assert innovation(parts) == [0, 0, 0]
    assert parts.state.vel.tolist() == [0, 0, 0]
    assert not parts.odometry.is_fused


def test_position_is_corrected_with_the_velocity_it_depends_on(make_parts: MakeParts) -> None:
    parts = certain_of_attitude(make_parts)
    parts.state.cov[POS.start, VEL.start] = parts.state.cov[VEL.start, POS.start] = 0.1
    step(parts, Vector3f(0.1, 0, 0))
    assert parts.state.pos[0] == pytest.approx(0.1 * 0.1 / (VEL_VAR + BEST_ERR**2), rel=1e-4)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_attitude_and_velocity_are_corrected_as_the_prediction_depends_on_them(
    make_parts: MakeParts, axis: int
) -> None:
    """Of a single axis that passes, states go by how much changing them changes the prediction."""
    parts = make_parts("06101")
    parts.turn_to(0.3, -0.4, 1.2)
    vel, quat = np.array([1.0, -2.0, 0.5]), parts.state.quat
    parts.state.vel = vel.copy()
    parts.state.clear(ATT, 1e-6)
    parts.state.clear(VEL, 1e-4)

    def predict(quat: quaternion.quaternion, vel: Array) -> float:
        # How the firmware turns a vector: a quaternion that is not of length 1 scales what it turns.
        turned = quat.conjugate() * quaternion.quaternion(0.0, *vel) * quat
        return float((turned.x, turned.y, turned.z)[axis])

    def slopes() -> tuple[list[float], list[float]]:
        tiny = 1e-6
        components = (quaternion.quaternion(*(tiny * np.eye(4)[index])) for index in range(4))
        by_quat = [(predict(quat + part, vel) - predict(quat - part, vel)) / (2 * tiny) for part in components]
        by_vel = [(predict(quat, vel + part) - predict(quat, vel - part)) / (2 * tiny) for part in np.eye(3) * tiny]
        return by_quat, by_vel

    predicted = [float(value) for value in parts.state.rotation.T @ vel]
    seen = [value + (0.02 if index == axis else 100.0) for index, value in enumerate(predicted)]
    step(parts, Vector3f(*seen))
    by_quat, by_vel = slopes()
    variance = 1e-6 * sum(slope**2 for slope in by_quat) + 1e-4 * sum(slope**2 for slope in by_vel) + BEST_ERR**2
    assert parts.state.vel - vel == pytest.approx([0.02 * 1e-4 * slope / variance for slope in by_vel], rel=1e-3)
    corrected = quat + quaternion.quaternion(*(0.02 * 1e-6 * slope / variance for slope in by_quat))
    assert (parts.state.quat - corrected.normalized()).abs() < 1e-10
