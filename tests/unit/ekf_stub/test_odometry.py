# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Velocity in the body frame: what is expected, which axes pass, what they change, and how long it aids."""

import math

import numpy as np
import pytest

from ekf_stub.core.vectors import matrix, quat_of_euler, to_body
from ekf_stub.release import APRIL_2026, JULY_2025, FilterRelease
from tests.unit.ekf_stub.filter_rig import (
    DELAY_MS,
    MODE_ABSOLUTE,
    MOVING,
    NO_AIDING,
    RELATIVE,
    SLOW_LOOP_US,
    START_US,
    FilterRig,
    Start,
    navigating,
    run_until_due,
    standing,
)

GATE_SIGMAS = 5.0
VEL, POS = 4, 7
RELATIVE_POSITION = 1 << 3 | 1 << 8


def just_moving() -> tuple[FilterRig, float]:
    """Return a vehicle that has begun to navigate by odometry, and the worst variance of a gyro's bias just before."""
    rig = standing("06101", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.feeds.add("odometry")
    worst = 0.0
    while rig.mode == NO_AIDING:
        assert rig.now_us < START_US + 60_000_000
        worst = max(rig.core.state.cov.variances()[10:13])
        rig.one_pass()
    rig.run(0.5)
    return rig, worst


def moving() -> FilterRig:
    """Return a vehicle that navigates by odometry, and whose sensors say nothing for now."""
    rig, _ = just_moving()
    rig.feeds -= {"odometry", "baro", "compass"}
    rig.run(0.3)
    rig.forget()
    return rig


def tell(start: Start, x: float, y: float = 0.0, z: float = 0.0, **fields: object) -> tuple[FilterRig, FilterRig]:
    """Let odometry come due in a vehicle; return it and one without."""
    rig, other = start(), start()
    before = rig.core.odometry.recalled
    rig.odometry(x, y, z, **fields)
    run_until_due(rig, other, lambda core: core.odometry.recalled > before)
    return rig, other


def innovation_of(rig: FilterRig) -> tuple[float, float, float]:
    return rig.core.odometry.innovation


# What is expected, and what it changes


@pytest.mark.parametrize("mode", [NO_AIDING, MODE_ABSOLUTE, RELATIVE])
def test_odometry_is_fused_in_every_mode(mode: int) -> None:
    def start() -> FilterRig:
        rig = {
            NO_AIDING: lambda: standing("06101", run_s=2.0),
            MODE_ABSOLUTE: lambda: navigating("66101", has_compass=True),
            RELATIVE: moving,
        }[mode]()
        rig.lose("camera", "baro", "compass")
        assert rig.mode == mode
        return rig

    told, other = tell(start, 0.1)
    assert told.core.state.vel[0] > other.core.state.vel[0] + 0.01
    code, ratio, innovation = told.last_test("odometry")
    assert (code, 0 < ratio < 1) == ("model_fused", True)
    assert innovation == pytest.approx(math.hypot(*innovation_of(told)))


@pytest.mark.parametrize("err", [0.1, 0.5, 0.9])
def test_gain_follows_from_the_error(err: float) -> None:
    told, other = tell(moving, 0.1, err=err)
    # Attitude is known so well that next to nothing of the velocity's variance comes from there.
    variance = other.core.state.cov.var(VEL)
    assert told.core.odometry.variance[0] == pytest.approx(variance + err**2, rel=0.01)
    vel = other.core.state.vel[0]
    gain = variance / (variance + err**2)
    assert told.core.state.vel[0] - vel == pytest.approx(gain * (0.1 - vel), rel=0.01)


def test_all_axes_depend_on_the_errors_that_were_found_before_the_first() -> None:
    # GIVEN a filter that knows little of yaw, and that the first axis tells how fast it is
    def start() -> FilterRig:
        return standing("06101", run_s=1.5)

    told, other = tell(start, 1.0, 0.5)
    state, cov = other.core.state, other.covariance()
    rows = []
    for axis in range(2):
        state.look_along_body_velocity(axis, 1.0, state.quat, state.vel)
        rows.append(np.array([*state.cov.row[:POS]] + [0.0] * (22 - POS)))
    # THEN the variance of the second is that of Kalman's formulae, by what was known before
    first, second = rows
    spread = cov @ first
    cov = cov - np.outer(spread, spread) / (first @ spread + 0.1**2)
    assert told.core.state.vel[0] > 0.3
    assert told.core.odometry.variance[1] == pytest.approx(second @ cov @ second + 0.1**2, rel=1e-9)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, -2.0])
def test_velocity_is_expected_in_the_frame_of_the_body(yaw: float) -> None:
    # GIVEN a vehicle that drives east with any heading
    def start() -> FilterRig:
        rig = FilterRig("66106", loop_us=SLOW_LOOP_US)
        rig.yaw = yaw
        rig.feeds |= {"camera", "velocity"}
        rig.run(3.5)
        rig.move(0.0, 2.0, 0.0, 1.0)
        rig.run(1.0)
        rig.lose("camera", "velocity", "baro")
        return rig

    # WHEN odometry tells the body's velocity
    told, _ = tell(start, *to_body(matrix(quat_of_euler(0.0, 0.0, yaw)), (0.0, 2.0, 0.0)))
    # THEN that was expected, to what the filter knows
    assert innovation_of(told) == pytest.approx((0.0, 0.0, 0.0), abs=0.03)


def test_camera_away_from_the_imu_moves_as_the_vehicle_turns() -> None:
    def start() -> FilterRig:
        rig = navigating("66106", "velocity", loop_us=SLOW_LOOP_US)
        rig.yaw_rate = 2.0
        rig.run(1.0)
        rig.lose("camera", "velocity", "baro")
        return rig

    told, _ = tell(start, 0.0, offset=(0.5, 0.25, 0.0))
    assert innovation_of(told) == pytest.approx((-0.5, 1.0, 0.0), abs=0.05)


def test_position_is_corrected_with_the_velocity_it_depends_on() -> None:
    told, other = tell(moving, 0.1)
    cov = other.covariance()
    gain = cov[POS, VEL] / (cov[VEL, VEL] + 0.01)
    moved = told.core.state.pos[0] - other.core.state.pos[0]
    assert moved == pytest.approx(gain * (0.1 - other.core.state.vel[0]), rel=0.05)
    assert moved > 1e-3


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_attitude_and_velocity_are_corrected_as_the_prediction_depends_on_them(axis: int) -> None:
    """Of a single axis that passes, states go by how much changing them changes the prediction."""

    # GIVEN a tilted vehicle that drives
    def start() -> FilterRig:
        rig = FilterRig("66106", loop_us=SLOW_LOOP_US)
        rig.roll, rig.pitch, rig.yaw = 0.3, -0.4, 1.2
        rig.feeds |= {"camera", "velocity"}
        rig.run(3.5)
        rig.move(1.0, -2.0, 0.5, 1.0)
        rig.lose("camera", "velocity", "baro")
        return rig

    _, other = tell(start, 0.0)
    quat, vel, cov = np.array(other.core.state.quat), np.array(other.core.state.vel), other.covariance()

    def predicted(quat: "np.ndarray[tuple[int], np.dtype[np.float64]]", vel: object) -> float:
        # How the firmware turns a vector: a quaternion that is not of length 1 scales what it turns.
        w, x, y, z = quat
        rows = [
            [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z],
        ]
        return float((np.array(rows) @ vel)[axis])

    tiny = 1e-6
    row = np.zeros(22)
    for i in range(4):
        d = tiny * np.eye(4)[i]
        row[i] = (predicted(quat + d, vel) - predicted(quat - d, vel)) / (2 * tiny)
    for i in range(3):
        d = tiny * np.eye(3)[i]
        row[VEL + i] = (predicted(quat, vel + d) - predicted(quat, vel - d)) / (2 * tiny)
    # WHEN odometry of which one axis passes comes due
    now = predicted(quat, vel)
    seen = [1000.0] * 3
    seen[axis] = now + 0.02
    told, other = tell(start, *seen)
    # THEN Kalman's formula holds
    gain = cov @ row / (row @ cov @ row + 0.01)
    corrected = np.array([*quat + 0.02 * gain[:4]])
    corrected /= np.linalg.norm(corrected)
    assert told.core.state.quat == pytest.approx(corrected, abs=1e-7)
    assert told.core.state.vel == pytest.approx(vel + 0.02 * gain[VEL : VEL + 3], abs=1e-7)


# Gates


@pytest.mark.parametrize(("sigmas", "passes"), [(4.99, True), (5.01, False)])
def test_gate_is_at_5_sigma(sigmas: float, passes: bool) -> None:
    # GIVEN what is expected, and how well
    before, _ = tell(moving, 0.0)
    expected, sigma = innovation_of(before)[0], math.sqrt(before.core.odometry.variance[0])
    # WHEN odometry differs from that by so many sigmas
    told, other = tell(moving, expected + sigmas * sigma)
    # THEN it passes or not
    code, ratio, _ = told.last_test("odometry")
    assert (code, ratio) == ("model_fused" if passes else "model_gate_odometry", pytest.approx(sigmas / GATE_SIGMAS))
    assert (told.core.state.vel[0] > other.core.state.vel[0] + 0.01) is passes


def test_axes_are_judged_one_by_one() -> None:
    told, other = tell(moving, 9.0, 0.1, 0.0)
    assert told.core.state.vel[0] == pytest.approx(other.core.state.vel[0], abs=1e-3)
    assert told.core.state.vel[1] > other.core.state.vel[1] + 0.01
    assert told.core.aiding.odometry_ms == told.now_ms
    assert told.became() == [("odometry", "model_gate_odometry")]


def test_odometry_of_which_nothing_passes_counts_for_nothing() -> None:
    told, other = tell(moving, 9.0, 9.0, 9.0)
    assert told.core.state.vel == other.core.state.vel
    assert told.core.aiding.odometry_ms < told.now_ms
    assert innovation_of(told) == pytest.approx((-9.0, -9.0, -9.0), abs=0.1)


def test_fusion_is_told_once() -> None:
    rig = standing("06101", has_compass=True)
    rig.feeds.add("odometry")
    rig.run(0.4)
    assert rig.texts.count("fusing odometry") == 1


def test_report_counts_what_came_due() -> None:
    rig = moving()
    before = rig.core.odometry.recalled
    for number in range(3):
        rig.odometry()
        rig.run(0.2)
        report = rig.report.odometry
        assert report is not None
        assert report.recalled == before + number + 1


def test_nothing_is_told_before_the_first_odometry() -> None:
    assert standing().report.odometry is None


@pytest.mark.parametrize("sources", ["60161", "63101"])
def test_odometry_needs_a_source_of_horizontal_velocity(sources: str) -> None:
    def start() -> FilterRig:
        rig = standing(sources)
        rig.lose("baro")
        rig.forget()
        return rig

    told, other = tell(start, 1.0)
    assert told.became() == [("odometry", "model_unused")]
    assert told.core.state.vel == other.core.state.vel


# Relative aiding


def test_odometry_starts_relative_aiding_once_gyros_are_known() -> None:
    rig, worst_var = just_moving()
    sigma = math.degrees(math.sqrt(worst_var) / rig.core.dt_ekf_avg)
    assert sigma == pytest.approx(0.15, abs=0.005)  # it has been shrinking since the last pass
    assert "started relative aiding" in rig.texts
    assert rig.core.flags == MOVING


def test_odometry_from_the_beginning_starts_relative_aiding_as_soon_as_tilt_is_known() -> None:
    rig = standing("06000", run_s=0.1)
    rig.feeds.add("odometry")
    rig.run(3.0)
    times_ms = {text: time_ms for time_ms, text in reversed(rig.said)}
    assert times_ms["started relative aiding"] == times_ms["tilt alignment complete"]


def test_poor_odometry_starts_nothing() -> None:
    rig = standing("06101", has_compass=True, run_s=1.2)
    for _ in range(40):
        rig.odometry(err=1.06)
        rig.run(0.06)
    assert rig.core.tilt_aligned
    assert rig.mode == NO_AIDING


@pytest.mark.parametrize(("age_ms", "starts"), [(170, True), (215, False)])
def test_odometry_starts_aiding_within_200_ms_of_its_time(age_ms: int, starts: bool) -> None:
    # GIVEN a vehicle whose aiding has just ended
    rig = moving()
    rig.skip(5.2)
    rig.run_until(lambda: rig.mode == NO_AIDING)
    rig.run(0.2)
    # WHEN odometry comes that is so old
    rig.odometry(stamp_ms=rig.now_ms - age_ms + DELAY_MS)
    rig.run(0.04)
    assert (rig.mode == RELATIVE) is starts


@pytest.mark.parametrize(("silence_s", "mode"), [(4.9, RELATIVE), (5.1, NO_AIDING)])
def test_relative_aiding_ends_5_s_after_the_last_odometry(silence_s: float, mode: int) -> None:
    rig = moving()
    since_s = 1e-3 * (rig.now_ms - rig.core.aiding.odometry_ms)
    rig.skip(silence_s - since_s)
    rig.run(0.04)
    assert rig.mode == mode
    assert rig.told() == ["stopped aiding"] * (mode == NO_AIDING)


def test_end_of_aiding_lets_fusion_be_told_again() -> None:
    rig = moving()
    rig.skip(5.2)
    rig.run(0.1)
    rig.forget()
    rig.feeds.add("odometry")
    rig.run(0.5)
    assert rig.told() == ["started relative aiding", "fusing odometry"]


def test_aiding_that_has_just_started_counts_as_by_odometry_though_none_passes() -> None:
    # GIVEN a vehicle whose aiding has ended
    rig = moving()
    rig.skip(5.2)
    rig.run(0.1)
    rig.forget()
    # WHEN all odometry that comes then is wrong
    for _ in range(10):
        rig.odometry(9.0, 9.0, 9.0)
        rig.run(0.06)
    # THEN aiding starts again, and the position counts as known
    assert rig.told() == ["started relative aiding"]
    assert rig.core.flags & RELATIVE_POSITION == RELATIVE_POSITION


def test_vehicle_keeps_its_position_by_odometry() -> None:
    # GIVEN a vehicle that drives by odometry alone
    rig = moving()
    rig.feeds |= {"odometry", "baro", "compass"}
    rig.move(1.0, 0.5, 0.0, 1.0)
    rig.run(2.0)
    assert rig.core.output.now.vel == pytest.approx(rig.vel, abs=0.05)
    # It sees 0.01 s late what a camera's stamps say, and drifts by no more.
    assert rig.miss_m() < 0.1


@pytest.mark.parametrize(("release", "goes_on"), [(JULY_2025, False), (APRIL_2026, True)])
def test_relative_aiding_without_a_source_of_yaw_ends_as_the_vehicle_is_disarmed(
    release: FilterRelease, goes_on: bool
) -> None:
    # GIVEN a vehicle without a source of yaw that is armed and navigates by odometry
    rig = standing("06100", run_s=0.1, release=release, loop_us=SLOW_LOOP_US)
    rig.arm()
    rig.feeds.add("odometry")
    rig.run_until(lambda: rig.mode == RELATIVE, 60.0)
    rig.forget()
    # WHEN it is disarmed
    rig.arm(False)
    rig.one_pass()
    rig.one_pass()
    # THEN it depends on the release
    assert ("stopped aiding" not in rig.told()) is goes_on
