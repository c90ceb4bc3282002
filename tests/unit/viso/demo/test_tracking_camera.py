# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration: what is said when, what becomes of the samples, and that it can be repeated."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import quaternion

from ap_core.verdict import VerdictKind
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.reports import AidingMode, FilterFlag
from viso.companion.simulated_camera import Flight
from viso.compare import tolerances
from viso.compare.estimates import compare_estimates
from viso.demo.plot import save_plot
from viso.demo.record import AUTOPILOT, Estimate
from viso.demo.tracking_camera import ARM_S, COMPANION_START_S, END_S, FAULTS, FLIGHT, Demo, DemoResult, flight_source
from viso.logs.logger import MemoryLog
from viso.replay.ekf.run import EkfRun
from viso.vehicle.outcomes import OutcomeKind, outcome_kind
from viso.vehicle.sensors.source import ImuOptions

BEGUN_S = 10


@dataclass(frozen=True)
class Ran:
    """A run, its log and how far it got when."""

    demo: Demo
    result: DemoResult
    log: bytes
    progress: list[float]


def run(seed: int, seconds: float = END_S) -> Ran:
    log, progress = MemoryLog(), list[float]()
    demo = Demo(seed, lambda: log)
    result = demo.run(progress.append, lambda: len(progress) > seconds)
    return Ran(demo, result, bytes(log.data), progress)


@pytest.fixture(scope="module")
def ran() -> Callable[[int], Ran]:
    """Return a function that runs the demonstration with a seed, once."""
    return cache(run)


@pytest.fixture(scope="module")
def begun() -> Ran:
    """Return a run that is stopped after 10 s: the vehicle stands and navigates."""
    return run(1, BEGUN_S)


@pytest.mark.slow
def test_same_seed_gives_the_same_log(ran: Callable[[int], Ran]) -> None:
    again = run(1, ARM_S + 6).log
    assert len(again) > 1_000_000
    assert again == ran(1).log[: len(again)]


@pytest.mark.slow
def test_another_seed_gives_another_log(begun: Ran) -> None:
    assert run(2, BEGUN_S).log != begun.log


@pytest.mark.slow
def test_autopilot_says_what_is_expected_in_order(ran: Callable[[int], Ran]) -> None:
    texts = ran(1).result.texts(AUTOPILOT)
    assert [text for text in texts if "yaw" not in text and "initial " not in text] == [
        "ArduPilot Ready",
        "AHRS: DCM active",
        "EKF3 IMU0 initialised",
        "EKF3 IMU1 initialised",
        "AHRS: EKF3 active",
        "EKF3 IMU0 tilt alignment complete",
        "EKF3 IMU1 tilt alignment complete",
        "PreArm: VisOdom: not healthy",
        "EKF3 IMU0 is using external nav data",
        "EKF3 IMU1 is using external nav data",
        "EKF3 IMU0 origin set",
        "EKF3 IMU1 origin set",
        "Field Elevation Set: 584m",
        "Arming motors",
        "Disarming motors",
    ]


@pytest.mark.slow
def test_yaw_differs_until_it_is_aligned(ran: Callable[[int], Ran]) -> None:
    said = [(one.time_us * 1e-6, one.text) for one in ran(1).result.all_texts if "VisOdom: yaw" in one.text]
    assert [text.split(":")[0] for _, text in said] == ["PreArm", "VisOdom"]
    assert said[0][1].startswith("PreArm: VisOdom: yaw diff 7")
    assert said[1][1] in ("VisOdom: yaw shifted 74 to 30 deg", "VisOdom: yaw shifted 75 to 30 deg")
    assert said[1][0] == pytest.approx(22.47, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("code", "least", "most"), [("quality_below_min", 89, 91), ("reset_settling", 29, 32)])
def test_samples_are_withheld(ran: Callable[[int], Ran], code: str, least: int, most: int) -> None:
    counts = ran(1).demo.vehicle.endpoint.verdict_counts()
    assert least <= counts["ODOMETRY", VerdictKind.IGNORED, code] <= most


@pytest.mark.slow
def test_samples_are_accepted_at_30_hz_but_for_the_faults(ran: Callable[[int], Ran]) -> None:
    counts = ran(1).demo.vehicle.endpoint.verdict_counts()
    flown = (END_S - COMPANION_START_S) * 30 - 60 - 90 - 30
    assert counts["ODOMETRY", VerdictKind.ACCEPTED, "consumed"] == pytest.approx(flown, abs=5)


def test_nothing_is_dropped(begun: Ran) -> None:
    assert all(outcome is not VerdictKind.DROPPED for _, outcome, _ in begun.demo.vehicle.endpoint.verdict_counts())


@pytest.mark.slow
def test_withheld_samples_are_those_of_the_faults(ran: Callable[[int], Ran]) -> None:
    assert FAULTS.low_quality is not None
    assert FAULTS.reset_s is not None
    low, reset_s, slack_s = FAULTS.low_quality, FAULTS.reset_s, 0.005
    withheld_s = [pose.time_s - 0.04 for pose in ran(1).result.poses if pose.ignored]
    assert all(
        low.start_s - slack_s < time_s < low.end_s + slack_s or -slack_s < time_s - reset_s < 1.04
        for time_s in withheld_s
    )


@pytest.mark.slow
def test_aligned_positions_follow_the_flight(ran: Callable[[int], Ran]) -> None:
    poses = [pose for pose in ran(1).result.poses if 30 < pose.time_s < FAULTS.reset_s]  # type: ignore[operator]
    errors = [np.array(pose.pos_ned) - FLIGHT.position_ned(pose.time_s - 0.04) for pose in poses]
    assert np.linalg.norm(errors, axis=1).max() < 0.5


def test_raw_positions_are_those_of_every_odometry_message(begun: Ran) -> None:
    result = begun.result
    assert len(result.arrived) == len(result.poses)


@pytest.mark.slow
def test_progress_goes_to_the_end(ran: Callable[[int], Ran]) -> None:
    assert ran(1).progress == [float(second) for second in range(int(END_S) + 1)]


@pytest.mark.slow
def test_log_is_closed_at_the_end(ran: Callable[[int], Ran]) -> None:
    assert not ran(1).demo.vehicle.logger.is_open


def test_log_is_closed_when_the_run_is_interrupted() -> None:
    demo = Demo(1, MemoryLog)

    def interrupt(time_s: float) -> None:
        if time_s >= 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        demo.run(interrupt)
    assert not demo.vehicle.logger.is_open


def test_companion_hears_the_autopilot(begun: Ran) -> None:
    kinds = {type(message).__name__ for message in begun.demo.companion.received}
    assert {"HEARTBEAT", "STATUSTEXT", "COMMAND_ACK"} <= kinds


@pytest.mark.slow
def test_plot_is_a_picture(ran: Callable[[int], Ran], tmp_path: Path) -> None:
    save_plot(ran(1).result, tmp_path / "demo.png")
    assert (tmp_path / "demo.png").read_bytes().startswith(b"\x89PNG")


# The filter


def outcomes(result: DemoResult, kind: str) -> list[tuple[float, OutcomeKind]]:
    """Return time of observation in s and outcome of the samples of a kind."""
    return [
        (1e-3 * test.outcome.time_ms, outcome_kind(test.outcome.rule))
        for test in result.outcomes
        if test.outcome.kind == kind
    ]


def errors_m(result: DemoResult, start_s: float, end_s: float) -> list[float]:
    """Return how far estimates were from the truth."""
    return [
        float(np.linalg.norm(np.array(estimate.pos_ned) - FLIGHT.position_ned(estimate.time_s)))
        for estimate in result.estimates
        if estimate.pos_ned is not None and start_s < estimate.time_s < end_s
    ]


@pytest.mark.slow
def test_filter_navigates_from_the_first_pose_to_the_end(ran: Callable[[int], Ran]) -> None:
    standing, navigating = ran(1).result.aiding
    assert (standing.mode, navigating.mode) == (AidingMode.NONE, AidingMode.ABSOLUTE)
    assert navigating.start_us * 1e-6 == pytest.approx(COMPANION_START_S + 0.07, abs=0.03)
    assert navigating.end_us == END_S * 1e6


@pytest.mark.slow
def test_estimate_follows_the_flight_until_the_camera_jumps(ran: Callable[[int], Ran]) -> None:
    assert FAULTS.reset_s is not None
    found = errors_m(ran(1).result, 8, FAULTS.reset_s)
    assert len(found) == pytest.approx(20 * (FAULTS.reset_s - 8), abs=2)
    assert max(found) < 0.25


@pytest.mark.slow
def test_estimate_jumps_with_the_camera_and_keeps_that(ran: Callable[[int], Ran]) -> None:
    assert FAULTS.reset_s is not None
    jump_m = float(np.linalg.norm(FAULTS.reset_jump_m))
    found = errors_m(ran(1).result, FAULTS.reset_s + 1.2, END_S)
    assert min(found) > jump_m - 0.2
    assert max(found) < jump_m + 0.2


@pytest.mark.slow
def test_wrong_places_are_rejected_by_the_gate_and_nothing_else_is(ran: Callable[[int], Ran]) -> None:
    assert FAULTS.mismatch is not None
    result = ran(1).result
    rejected_s = [time_s for time_s, outcome in outcomes(result, "pose") if outcome is OutcomeKind.REJECTED]
    assert len(rejected_s) == pytest.approx(30, abs=1)
    assert min(rejected_s) == pytest.approx(FAULTS.mismatch.start_s, abs=0.05)
    assert max(rejected_s) == pytest.approx(FAULTS.mismatch.end_s, abs=0.05)
    for kind in ("height", "velocity", "yaw"):
        assert OutcomeKind.REJECTED not in {outcome for _, outcome in outcomes(result, kind)}


def test_yaw_of_the_camera_is_not_used_as_the_compass_is(begun: Ran) -> None:
    assert {outcome for _, outcome in outcomes(begun.result, "yaw")} == {OutcomeKind.UNUSED}


@pytest.mark.slow
def test_estimates_are_looked_at_twenty_times_a_second(ran: Callable[[int], Ran]) -> None:
    times_s = [estimate.time_s for estimate in ran(1).result.estimates]
    assert np.diff(times_s) == pytest.approx(0.05)
    assert (times_s[0], times_s[-1]) == (0.0, END_S)


def at(result: DemoResult, time_s: float) -> Estimate:
    return next(estimate for estimate in result.estimates if estimate.time_s >= time_s)


def test_flags_over_time(begun: Ran) -> None:
    flags = [at(begun.result, time_s).flags for time_s in (3.0, 5.0, 6.5, 9.9)]
    assert flags[0] == FilterFlag.UNINITIALISED
    assert not flags[1] & FilterFlag.ATTITUDE
    assert flags[2] & (FilterFlag.ATTITUDE | FilterFlag.CONST_POS_MODE | FilterFlag.HORIZ_POS_ABS) == (
        FilterFlag.ATTITUDE | FilterFlag.CONST_POS_MODE
    )
    assert flags[3] & FilterFlag.HORIZ_POS_ABS


@pytest.mark.slow
def test_arming_over_time(ran: Callable[[int], Ran]) -> None:
    result = ran(1).result
    assert [at(result, time_s).is_armed for time_s in (25.9, 26.2, 61.9, 62.2)] == [False, True, True, False]


def test_filter_navigates_from_the_first_pose(begun: Ran) -> None:
    standing, navigating = begun.result.aiding
    assert (standing.mode, navigating.mode) == (AidingMode.NONE, AidingMode.ABSOLUTE)
    assert navigating.start_us * 1e-6 == pytest.approx(COMPANION_START_S + 0.07, abs=0.03)
    found = errors_m(begun.result, 8, BEGUN_S)
    assert len(found) == pytest.approx(20 * (BEGUN_S - 8), abs=2)
    assert max(found) < 0.25


@pytest.mark.slow
def test_filter_run_on_the_log_agrees_with_the_vehicle(ran: Callable[[int], Ran], tmp_path: Path) -> None:
    path = tmp_path / "demo.BIN"
    path.write_bytes(ran(1).log)
    run = EkfRun(path, until_s=32.0, core=0)
    run.run(lambda _frames, _total: None)
    comparison = run.comparison()
    assert comparison is not None
    found = compare_estimates(comparison, tolerances.FLIGHT)
    assert found.records > 200
    assert [check.what for check in found.checks if not check.passed] == []


# The vehicle's sensors feel the flight that the camera sees

SHORT_FLIGHT = Flight(start_s=2.0, climb_s=2.0, loop_s=8.0, heading_rad=0.5)
LOOP_US = 2500


@pytest.mark.parametrize("time_s", [0.0, 3.0, 7.7, 11.0, 30.0])
def test_truth_is_the_flight(time_s: float) -> None:
    truth = flight_source(SHORT_FLIGHT, ImuOptions(heading_rad=0.5)).truth(round(time_s * 1e6))
    assert truth.pos_ned == pytest.approx(SHORT_FLIGHT.position_ned(time_s), abs=1e-9)
    assert truth.vel_ned == pytest.approx(SHORT_FLIGHT.velocity_ned(time_s), abs=1e-9)
    roll, pitch, yaw = (quaternion.from_rotation_vector(v) for v in np.diag(SHORT_FLIGHT.attitude_rpy_rad(time_s)))
    assert quaternion.rotation_intrinsic_distance(yaw * pitch * roll, quaternion.quaternion(*truth.quat_wxyz)) < 1e-7


@pytest.mark.slow
def test_inertial_data_add_up_to_the_flight() -> None:
    source = flight_source(SHORT_FLIGHT, ImuOptions(heading_rad=0.5))
    source.sense(0)
    quat, vel, pos = quaternion.from_rotation_vector([0.0, 0.0, 0.5]), np.zeros(3), np.zeros(3)
    errors = []
    for time_us in range(LOOP_US, 15_000_000, LOOP_US):
        sensors = source.sense(time_us)
        assert sensors is not None
        delta = sensors.delta
        halfway = quat * quaternion.from_rotation_vector(0.5 * delta.del_ang)
        before = vel
        vel = vel + quaternion.rotate_vectors(halfway, delta.del_vel) + [0.0, 0.0, GRAVITY_MSS * delta.del_vel_dt]
        pos = pos + 0.5 * (before + vel) * delta.del_vel_dt
        quat = quat * quaternion.from_rotation_vector(delta.del_ang)
        errors.append(np.linalg.norm(pos - SHORT_FLIGHT.position_ned(1e-6 * time_us)))
    assert max(errors) < 0.01


def test_height_and_heading_are_those_of_the_flight() -> None:
    source = flight_source(SHORT_FLIGHT, ImuOptions(heading_rad=0.5, has_compass=lambda: True))
    for time_us in range(0, 5_000_001, LOOP_US):
        sensors = source.sense(time_us)
    assert sensors is not None
    assert sensors.baro is not None
    assert list(sensors.baro) == pytest.approx([4950, 3.0])
    assert sensors.mag is not None
    assert source.yaw_rad() == pytest.approx(0.5)


def test_it_flies_unarmed_too() -> None:
    source = flight_source(SHORT_FLIGHT, ImuOptions())
    source.set_armed(False)
    assert math.isclose(source.truth(6_000_000).pos_ned[2], -3.0, abs_tol=1e-6)
