# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The closed loop: what covering the lens, restarting and another camera do to odometry and autopilot."""

import dataclasses
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from ekf_stub.reports import AidingMode, FilterFlag
from tests.unit.viso.demo.hops import ARM_S, Script, between, make_setup, play
from viso.companion.vio.types import NavCameraFrame, VioState, WarmStartPose
from viso.demo.errors import estimate_errors, odometry_errors
from viso.demo.loop import CompanionLoop
from viso.demo.record import AUTOPILOT, COMPANION, Arrived, Estimate
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

pytestmark = pytest.mark.slow  # the flights; what a short one shows is in test_figures

JUMP_ENU = np.array([2.0, -1.5, 0.0])


def true_start(loop: CompanionLoop, jump_enu: Array | None = None) -> Callable[[int], WarmStartPose]:
    """Return what knows the true state, but for a jump."""

    def start(t_ns: int) -> WarmStartPose:
        pose = loop.setup.flight.warm_start(t_ns, angle_sigma_rad=0.005, velocity_sigma_m_s=0.05)
        world_T_body = pose.body_T_world.inverse()
        moved = SE3(world_T_body.R, world_T_body.t + (0.0 if jump_enu is None else jump_enu))
        return dataclasses.replace(pose, body_T_world=moved.inverse())

    return start


def begin_anew(loop: CompanionLoop) -> None:
    """Let the odometry restart at a place that is off."""
    loop.companion.start_from(true_start(loop, JUMP_ENU))


def arrived(loop: CompanionLoop, start_s: float, end_s: float) -> list[Arrived]:
    """Return the messages that have arrived in a span of time."""
    return [one for one in loop.record.arrived if start_s * 1e6 <= one.time_us < end_s * 1e6]


def qualities(loop: CompanionLoop, start_s: float, end_s: float) -> list[int]:
    """Return their qualities."""
    return [one.message.quality for one in arrived(loop, start_s, end_s)]


def estimates(loop: CompanionLoop, start_s: float, end_s: float) -> list[Estimate]:
    """Return what the autopilot believed in a span of time."""
    return [one for one in loop.record.estimates if start_s * 1e6 <= one.time_us < end_s * 1e6]


def transitions(loop: CompanionLoop, start_s: float, end_s: float) -> list[str]:
    """Return the changes of the odometry's state in a span of time, without their reasons."""
    said = [one for one in loop.record.all_texts if one.who == COMPANION and start_s * 1e6 <= one.time_us < end_s * 1e6]
    return [one.text.split(":")[0] for one in said if "->" in one.text]


def when(loop: CompanionLoop, text: str) -> float:
    """Return when the autopilot first said something, in s since boot."""
    return next(one.time_us for one in loop.record.all_texts if one.who == AUTOPILOT and one.text == text) * 1e-6


# The lens is covered

SHORT_S, LONG_S, BEGIN_ANEW_S, COVERED_END_S = (15.0, 17.0), (20.0, 32.0), 37.0, 41.0


@cache
def covered() -> CompanionLoop:
    """A flight during which the lens is covered for 2 s and for 12 s, and which then restarts."""
    setup = make_setup(COVERED_END_S, covered_s=(SHORT_S, LONG_S))
    return play(setup, COVERED_END_S, [(BEGIN_ANEW_S, lambda loop: loop.companion.start_from(true_start(loop)))])


def test_aiding_starts_and_the_vehicle_arms() -> None:
    wanted = ["EKF3 IMU0 is using external nav data", "Arming motors"]
    assert [text for text in covered().record.texts(AUTOPILOT) if text in wanted][:2] == wanted
    assert all(one.is_armed and one.mode is AidingMode.ABSOLUTE for one in estimates(covered(), ARM_S + 0.1, 20.0))


def test_nothing_is_dropped() -> None:
    codes = {code for name, _, code in covered().vehicle.endpoint.verdict_counts() if name == "ODOMETRY"}
    assert codes == {"consumed", "quality_below_min"}


def test_odometry_and_estimate_keep_to_the_truth() -> None:
    loop = covered()
    odometry = between(odometry_errors(loop.setup, loop.record.arrived), ARM_S, LONG_S[0])
    estimate = between(estimate_errors(loop.setup, loop.record.estimates), ARM_S, LONG_S[0])
    for errors in (odometry, estimate):
        assert len(errors) > 200
        assert errors.horizontal_m.max() < 0.5
        assert np.abs(errors.errors_ned[:, 2]).max() < 0.6
        assert np.degrees(errors.tilt_rad.max()) < 1.5


def test_messages_come_often_enough_while_the_camera_is_slow() -> None:
    times_us = [one.time_us for one in arrived(covered(), ARM_S, LONG_S[0])]
    assert max(np.diff(times_us)) < 300_000


def test_two_seconds_of_darkness_degrade() -> None:
    assert transitions(covered(), SHORT_S[0], LONG_S[0]) == ["TRACKING -> DEGRADED", "DEGRADED -> TRACKING"]


def test_quality_of_a_degraded_pose_is_below_50() -> None:
    # The first frame in the dark is known a frame and its latency later.
    assert max(qualities(covered(), SHORT_S[0] + 0.4, SHORT_S[1])) < 50
    assert min(qualities(covered(), SHORT_S[0] + 0.4, SHORT_S[1])) >= 1


def test_two_seconds_of_darkness_are_no_reset() -> None:
    assert {one.message.reset_counter for one in arrived(covered(), 0.0, LONG_S[0])} == {0}


def test_filter_carries_on_through_two_seconds_of_darkness() -> None:
    states = estimates(covered(), *SHORT_S)
    assert {one.mode for one in states} == {AidingMode.ABSOLUTE}
    assert all(one.flags & FilterFlag.HORIZ_POS_ABS for one in states)


def test_autopilot_says_nothing_of_two_seconds_of_darkness() -> None:
    said = [one for one in covered().record.all_texts if one.who == AUTOPILOT]
    assert [one.text for one in said if SHORT_S[0] * 1e6 < one.time_us < LONG_S[0] * 1e6] == []


def lost_s(loop: CompanionLoop) -> float:
    """Return when the odometry was lost."""
    return next(one.time_us for one in loop.record.health if one.state is VioState.LOST) * 1e-6


def test_nine_dark_frames_lose_the_pose() -> None:
    loop = covered()
    dark = [one for one in loop.record.health if LONG_S[0] * 1e6 + 60_000 <= one.time_us <= lost_s(loop) * 1e6]
    assert [one.state for one in dark] == [VioState.DEGRADED] * 8 + [VioState.LOST]
    errors = [one.text for one in loop.record.all_texts if one.who == COMPANION and one.severity == 3]
    assert errors[0] == "VIO LOST after 9 consecutive frames; strategy=klt_ransac"


def test_lost_pose_is_sent_four_times_a_second_for_three_seconds() -> None:
    loop = covered()
    lost = arrived(loop, lost_s(loop) + 0.06, BEGIN_ANEW_S)
    assert {one.message.quality for one in lost} == {-1}
    assert lost[-1].time_us * 1e-6 == pytest.approx(lost_s(loop) + 3.0, abs=0.3)
    assert set(np.diff([one.time_us for one in lost])) == {250_000}
    assert len({(one.message.x, one.message.y, one.message.z) for one in lost}) == 1


def test_camera_counts_as_dead_300_ms_after_the_last_message() -> None:
    loop = covered()
    last_s = arrived(loop, 0.0, BEGIN_ANEW_S)[-1].time_us * 1e-6
    silent = estimates(loop, last_s + 0.3, BEGIN_ANEW_S)
    assert not any(one.is_camera_healthy for one in silent)
    assert all(one.is_camera_healthy for one in estimates(loop, LONG_S[0], last_s + 0.25))


def fused_s(loop: CompanionLoop) -> float:
    """Return when the last good pose before the loss arrived."""
    return max(one.time_us for one in arrived(loop, 0.0, BEGIN_ANEW_S) if one.is_accepted) * 1e-6


def test_position_is_given_up_seven_seconds_after_the_last_good_pose() -> None:
    later = estimates(covered(), fused_s(covered()), BEGIN_ANEW_S)
    has_position = [bool(one.flags & FilterFlag.HORIZ_POS_ABS) for one in later]
    assert 0.05 * has_position.index(False) == pytest.approx(7.05, abs=0.15)


def test_failsafe_follows_a_second_after_the_position_is_given_up() -> None:
    assert when(covered(), "EKF Failsafe") == pytest.approx(fused_s(covered()) + 8.1, abs=0.2)


def test_aiding_stops_fifteen_seconds_after_the_last_good_pose() -> None:
    assert when(covered(), "EKF3 IMU0 stopped aiding") == pytest.approx(fused_s(covered()) + 15.05, abs=0.1)


def test_light_alone_does_not_bring_a_lost_pose_back() -> None:
    loop = covered()
    assert transitions(loop, LONG_S[1], BEGIN_ANEW_S) == []
    assert arrived(loop, LONG_S[1], BEGIN_ANEW_S) == []


def test_start_from_a_known_state_brings_the_pose_and_aiding_back() -> None:
    loop = covered()
    assert transitions(loop, BEGIN_ANEW_S, COVERED_END_S)[:2] == ["LOST -> INIT", "INIT -> TRACKING"]
    texts = loop.record.texts(AUTOPILOT)
    stopped = texts.index("EKF3 IMU0 stopped aiding")
    assert "EKF3 IMU0 is using external nav data" in texts[stopped:]
    assert "EKF Failsafe Cleared" in texts[stopped:]


def test_start_after_a_loss_counts_as_reset() -> None:
    assert {one.message.reset_counter for one in arrived(covered(), BEGIN_ANEW_S, COVERED_END_S)} == {1}


# The odometry restarts in flight

RESTART_S = 14.0
SETTLED_S = 18.0
SWAP_S = 19.0


def other_camera(frame: NavCameraFrame) -> NavCameraFrame:
    """Return a frame as another camera would deliver it."""
    return dataclasses.replace(frame, camera_id="another")


def swap_camera(loop: CompanionLoop) -> None:
    """Let another camera deliver from now on."""
    loop.companion.alter_frame = other_camera


@cache
def restarted(viso_type: int) -> CompanionLoop:
    """A flight that restarts 2.5 m off; with the first type of camera, another camera then takes its place."""
    end_s = {1: 24.0, 2: SETTLED_S, 3: 25.5}[viso_type]
    script: Script = [(RESTART_S, begin_anew), *([(SWAP_S, swap_camera)] if viso_type == 1 else [])]
    return play(make_setup(end_s, params={"VISO_TYPE": viso_type}), end_s, script)


def back_s(loop: CompanionLoop) -> float:
    """Return when the first pose after the restart arrived."""
    return next(one.time_us for one in loop.record.arrived if one.message.reset_counter) * 1e-6


def jump_m(loop: CompanionLoop, before_s: float, after_s: float) -> float:
    """Return by how much the estimate's error changed from one time to another."""
    errors = estimate_errors(loop.setup, loop.record.estimates)
    before, after = (between(errors, at_s, at_s + 0.2).errors_ned.mean(axis=0) for at_s in (before_s, after_s))
    return float(np.hypot(*(after - before)[:2]))


BACKENDS = (1, 2, 3)


@pytest.mark.parametrize("viso_type", BACKENDS)
def test_warm_start_goes_through_init_and_steps_the_counter(viso_type: int) -> None:
    loop = restarted(viso_type)
    assert transitions(loop, RESTART_S, SETTLED_S)[:2] == ["TRACKING -> INIT", "INIT -> TRACKING"]
    assert {one.message.reset_counter for one in arrived(loop, 0.0, RESTART_S)} == {0}
    assert {one.message.reset_counter for one in arrived(loop, back_s(loop), SETTLED_S)} == {1}


@pytest.mark.parametrize("viso_type", BACKENDS)
def test_nothing_is_sent_between_a_warm_start_and_the_second_good_frame(viso_type: int) -> None:
    loop = restarted(viso_type)
    silent_s = RESTART_S + 0.36  # the next frame, and its latency, at most
    assert arrived(loop, silent_s, back_s(loop)) == []
    assert back_s(loop) - RESTART_S == pytest.approx(0.85, abs=0.2)


def test_plain_camera_makes_the_estimate_jump_at_once() -> None:
    loop = restarted(1)
    assert all(one.is_accepted for one in arrived(loop, back_s(loop), SETTLED_S))
    assert jump_m(loop, RESTART_S, back_s(loop) + 0.3) == pytest.approx(2.5, abs=0.3)
    moved_ne = [one.moved_ne for one in estimates(loop, back_s(loop), SETTLED_S)][-1]
    assert moved_ne == pytest.approx((JUMP_ENU[1], JUMP_ENU[0]), abs=0.3)


def test_t265_withholds_a_second_and_then_makes_the_estimate_jump() -> None:
    loop = restarted(2)
    after = arrived(loop, back_s(loop), SETTLED_S)
    withheld = [one for one in after if not one.is_accepted]
    assert withheld == after[: len(withheld)]
    assert (after[len(withheld)].time_us - after[0].time_us) * 1e-6 == pytest.approx(1.02, abs=0.04)
    assert jump_m(loop, RESTART_S, back_s(loop) + 0.7) < 0.4
    assert jump_m(loop, RESTART_S, back_s(loop) + 1.4) == pytest.approx(2.5, abs=0.4)


def test_voxl_takes_the_jump_out() -> None:
    loop = restarted(3)
    assert all(one.is_accepted for one in arrived(loop, back_s(loop), SETTLED_S))
    assert when(loop, "VisOdom: reset") == pytest.approx(back_s(loop), abs=0.01)
    # What was flown without a pose in between is taken for the jump, too.
    gone_m = 4.0 * (back_s(loop) - RESTART_S) + 0.5
    assert jump_m(loop, RESTART_S, SETTLED_S - 0.3) < gone_m


def test_yaw_is_aligned_twenty_seconds_after_the_filter_began() -> None:
    texts = [one for one in restarted(3).record.all_texts if one.text.startswith("VisOdom: yaw shifted")]
    assert [one.time_us * 1e-6 for one in texts] == [pytest.approx(22.48, abs=0.1)]


def test_frame_of_another_camera_is_fatal() -> None:
    loop = restarted(1)
    assert transitions(loop, SWAP_S, 24.0) == ["TRACKING -> LOST"]
    assert "frame of camera 'another', strategy for 'synthetic'" in loop.record.texts(COMPANION)


def test_pose_of_another_camera_is_lost_at_once_then_silent() -> None:
    loop = restarted(1)
    swapped_s = lost_s(loop)
    assert swapped_s - SWAP_S < 0.4
    after = arrived(loop, swapped_s + 0.06, 24.0)
    assert {one.message.quality for one in after} == {-1}
    assert not any(one.is_accepted for one in after)
    assert after[-1].time_us * 1e-6 == pytest.approx(swapped_s + 3.0, abs=0.3)
