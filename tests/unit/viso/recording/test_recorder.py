# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The recorder against a made-up autopilot: what it sets and restores, waits for, sends, keeps, and how it fails."""

from itertools import pairwise
from typing import Any

import pytest

from mav_handlers.wire.messages import (
    COMMAND_LONG,
    EKF_STATUS_REPORT,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    LOG_REQUEST_DATA,
    ODOMETRY,
    PARAM_ERROR,
    PARAM_SET,
    SIM_STATE,
    STATUSTEXT,
    TIMESYNC,
    Message,
)
from tests.unit.viso.recording.fake_autopilot import ARM, REBOOT, FakeAutopilot, drive, float32, recorder_of

PAUSE = "- pause: 1\n"


def set_values(autopilot: FakeAutopilot) -> list[tuple[str, float]]:
    return [(one.param_id, one.param_value) for one in autopilot.asked if isinstance(one, PARAM_SET)]


def reboots(autopilot: FakeAutopilot) -> int:
    return sum(isinstance(one, COMMAND_LONG) and one.command == REBOOT for one in autopilot.asked)


def test_parameters_are_set_before_a_reboot_and_restored_before_another() -> None:
    autopilot = FakeAutopilot()
    recording = drive(recorder_of(PAUSE), autopilot)
    assert recording.problems == []
    assert set_values(autopilot) == [("VISO_TYPE", 1.0), ("VISO_TYPE", 0.0)]
    assert reboots(autopilot) == 2
    assert recording.params["VISO_TYPE"] == 0.0
    assert recording.set_params == {"VISO_TYPE": 1.0}


def test_parameters_that_a_step_sets_are_restored_too() -> None:
    autopilot = FakeAutopilot()
    sent = "- send: [PARAM_SET, {target_system: 1, target_component: 1, param_id: EK3_SRC1_YAW, param_value: 6}]\n"
    recording = drive(recorder_of(f"- set: {{VISO_SCALE: 1.1}}\n{sent}{PAUSE}"), autopilot)
    assert autopilot.params == {"VISO_TYPE": 0.0, "VISO_SCALE": 1.0, "EK3_SRC1_YAW": 1.0}
    assert ("VISO_SCALE", float32(1.1)) in set_values(autopilot)
    assert [type(one.message).__name__ for one in recording.sent] == ["PARAM_SET", "PARAM_SET"]


def test_nothing_reboots_where_the_scenario_does_not_want_it() -> None:
    autopilot = FakeAutopilot()
    assert drive(recorder_of(PAUSE, more="reboot: false"), autopilot).problems == []
    assert reboots(autopilot) == 0


def test_streams_are_sent_at_their_times_by_the_autopilots_clock() -> None:
    autopilot = FakeAutopilot()
    steps = "- until: {clock_s: 5}\n- stream: {message: VISION_POSITION_ESTIMATE, rate_hz: 20}\n- pause: 1\n"
    recording = drive(recorder_of(steps), autopilot)
    times_us = [one.autopilot_us for one in recording.sent]
    assert times_us[:3] == [5_000_000, 5_050_000, 5_100_000]
    assert len(times_us) == 2 * 20 + 1  # those of the second after the last step as well


def test_commands_and_their_results_are_kept_in_order() -> None:
    autopilot = FakeAutopilot()
    recording = drive(recorder_of(f"- arm: true\n{PAUSE}- command: [511, 30, 20000]\n"), autopilot)
    assert recording.acks == [(ARM, 4), (511, 0)]


def test_question_keeps_what_is_answered_within_its_time() -> None:
    autopilot = FakeAutopilot()
    question = "[COMMAND_LONG, {target_system: 1, target_component: 1, command: 512, param1: 148}]"
    recording = drive(recorder_of(f"- ask: {{name: version, send: {question}}}\n"), autopilot)
    [exchange] = recording.exchanges
    assert [type(one).__name__ for one in exchange.answers] == ["COMMAND_ACK", "AUTOPILOT_VERSION"]


@pytest.mark.parametrize(
    ("wanted", "told"),
    [
        ("text: is ready", STATUSTEXT(6, "EKF3 IMU0 is ready")),
        ("ekf: [attitude, pos_horiz_rel]", EKF_STATUS_REPORT(0b1011, 0, 0, 0, 0, 0)),
        ("near_m: [1, 2, -3]", LOCAL_POSITION_NED(0, 1.1, 2.1, -3.1, 0, 0, 0)),
        ("armed: true", HEARTBEAT(2, 3, 0x80, 0, 4, 3)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_scenario_waits_for_what_the_autopilot_tells(wanted: str, told: Message) -> None:
    autopilot = FakeAutopilot()

    def tell(message: Message) -> None:
        if isinstance(message, HEARTBEAT) and autopilot.now_us > 8_000_000:
            autopilot.answers.append(told)

    autopilot.on_message = tell
    recorder = recorder_of(f"- until: {{{wanted}}}\n- arm: true\n")
    recording = drive(recorder, autopilot)
    assert recording.problems == []
    assert recording.sent[0].now_us > 8_000_000


def test_what_does_not_come_ends_the_steps_and_says_which() -> None:
    autopilot = FakeAutopilot()
    recording = drive(recorder_of("- pause: 1\n- until: {text: ready, timeout_s: 5}\n"), autopilot)
    assert recording.problems == ["step 2: waited 5 s in vain for text 'ready'"]
    assert recording.log == autopilot.log
    assert autopilot.params["VISO_TYPE"] == 0.0


def test_pieces_of_a_log_that_are_lost_are_asked_for_again() -> None:
    autopilot = FakeAutopilot()
    autopilot.lost = {90, 360}
    recording = drive(recorder_of(PAUSE), autopilot)
    assert recording.log == autopilot.log
    asked = [(one.ofs, one.count) for one in autopilot.asked if isinstance(one, LOG_REQUEST_DATA)]
    assert asked == [(0, 0xFFFFFFFF), (90, 90), (360, 0xFFFFFFFF)]


# What fails


def fail(autopilot: FakeAutopilot, steps: str = PAUSE, **options: Any) -> list[str]:
    return drive(recorder_of(steps, **options), autopilot).problems


def test_nobody_answers() -> None:
    autopilot = FakeAutopilot()
    autopilot.is_dead = True
    assert fail(autopilot) == ["no answer within 10 s: no autopilot is heard"]


def test_armed_vehicle_is_refused_and_nothing_is_set() -> None:
    autopilot = FakeAutopilot()
    autopilot.is_armed = True
    assert fail(autopilot) == ["the vehicle is armed (--allow-armed records it all the same)"]
    assert set_values(autopilot) == []


def test_armed_vehicle_is_recorded_if_that_is_wanted() -> None:
    autopilot = FakeAutopilot()
    autopilot.is_armed = True
    assert fail(autopilot, allow_armed=True) == []


def test_refused_parameter_is_named_and_those_before_are_restored() -> None:
    autopilot = FakeAutopilot()
    autopilot.fixed = {"VISO_SCALE"}
    problems = fail(autopilot, more="if_there: {VISO_SCALE: 2}")
    assert problems == ["parameter VISO_SCALE: 2 is refused, it stays 1"]
    assert autopilot.params["VISO_TYPE"] == 0.0


def test_refusal_by_message_is_told() -> None:
    autopilot = FakeAutopilot()

    def refuse(message: Message) -> None:
        if isinstance(message, PARAM_SET):
            autopilot.answers.append(PARAM_ERROR(1, 1, message.param_id, -1, 5))

    autopilot.on_message = refuse
    autopilot.fixed = {"VISO_TYPE"}
    assert fail(autopilot) == ["parameter VISO_TYPE: 1 is refused (PARAM_ERROR 5)"]


def test_missing_parameter_is_named() -> None:
    autopilot = FakeAutopilot()
    del autopilot.params["VISO_TYPE"]
    assert fail(autopilot) == ["parameter VISO_TYPE: the autopilot has none of that name"]


def test_link_that_dies_ends_the_recording_and_tells_what_is_not_restored() -> None:
    autopilot = FakeAutopilot()

    def die(message: Message) -> None:
        autopilot.is_dead = isinstance(message, COMMAND_LONG) and message.command == ARM

    autopilot.on_message = die
    recorder = recorder_of("- pause: 1\n- arm: true\n- pause: 60\n")
    recording = drive(recorder, autopilot)
    assert recording.problems == [
        "step 3: nothing heard for 10 s: the link is dead",
        "the log cannot be downloaded: the link is dead",
        "parameters are not restored: VISO_TYPE=0: the link is dead",
    ]
    assert len(recording.sent) == 1


def test_log_that_is_not_there_is_told() -> None:
    autopilot = FakeAutopilot()
    autopilot.log = b""
    assert fail(autopilot) == ["the log cannot be downloaded: there is none"]


def test_log_that_ends_in_the_middle_is_kept_as_far_as_it_came() -> None:
    autopilot = FakeAutopilot()
    autopilot.log = bytes(1000)

    def lose(_message: Message) -> None:
        autopilot.lost = {180}

    autopilot.on_message = lose
    recording = drive(recorder_of(PAUSE), autopilot)
    assert recording.problems == ["the log cannot be downloaded: 180 bytes came, then none"]
    assert recording.log == bytes(180)


def test_being_stopped_ends_the_steps_and_restores() -> None:
    autopilot = FakeAutopilot()
    recorder = recorder_of("- arm: true\n- pause: 300\n")

    def stop(message: Message) -> None:
        if isinstance(message, COMMAND_LONG) and message.command == ARM:
            recorder.stop("interrupted")

    autopilot.on_message = stop
    recording = drive(recorder, autopilot)
    assert recording.problems == ["interrupted"]
    assert recording.log == autopilot.log
    assert autopilot.params["VISO_TYPE"] == 0.0


def test_second_stop_ends_the_download_and_parameters_are_still_restored() -> None:
    autopilot = FakeAutopilot()
    recorder = recorder_of(PAUSE)

    def stop(message: Message) -> None:
        if isinstance(message, LOG_REQUEST_DATA):
            recorder.stop("interrupted")

    autopilot.on_message = stop
    recording = drive(recorder, autopilot)
    assert recording.problems == ["the log cannot be downloaded: interrupted"]
    assert autopilot.params["VISO_TYPE"] == 0.0


def test_parameter_that_cannot_be_restored_is_told_and_the_others_are() -> None:
    autopilot = FakeAutopilot()

    def hold(message: Message) -> None:
        if isinstance(message, LOG_REQUEST_DATA):
            autopilot.fixed = {"VISO_SCALE"}

    autopilot.on_message = hold
    recording = drive(recorder_of("- set: {VISO_SCALE: 2}\n"), autopilot)
    told = "parameters are not restored: VISO_SCALE=1: parameter VISO_SCALE: 1 is refused, it stays 2"
    assert recording.problems == [told]
    assert autopilot.params["VISO_TYPE"] == 0.0


def test_flight_is_refused_where_no_simulator_tells_the_truth() -> None:
    autopilot = FakeAutopilot()
    problems = fail(autopilot, more="needs_flight: true")
    assert problems == ["this scenario flies, and needs a simulator: the autopilot sends no SIM_STATE"]


def test_flight_follows_the_truth_of_a_simulator() -> None:
    autopilot = FakeAutopilot()

    def tell(message: Message) -> None:
        moved = round(autopilot.now_us * 1e-6)
        truth = SIM_STATE(*(0.0,) * 15, 584.0 + moved, 0, 0, 1.0, 0.0, -1.0, -353632620 + 90 * moved, 1491652370)
        if isinstance(message, TIMESYNC):
            autopilot.answers.append(truth)

    autopilot.on_message = tell
    steps = "- stream: {message: ODOMETRY, motion: truth, rate_hz: 1}\n- pause: 3\n"
    recording = drive(recorder_of(steps, more="needs_flight: true"), autopilot)
    assert recording.problems == []
    poses = [one.message for one in recording.sent if isinstance(one.message, ODOMETRY)]
    assert [after.z - before.z for before, after in pairwise(poses)] == pytest.approx([-1] * 3)
    assert [after.x - before.x for before, after in pairwise(poses)] == pytest.approx([1.0] * 3, rel=0.01)


def test_questions_about_time_do_not_touch_the_autopilots_clock() -> None:
    autopilot = FakeAutopilot()
    ask = "- ask: {name: time, send: [TIMESYNC, {ts1: 5000}], wait_ms: 1000, show: [TIMESYNC]}\n"
    recorder = recorder_of(ask)
    [exchange] = drive(recorder, autopilot).exchanges
    assert [getattr(one, "ts1", None) for one in exchange.answers] == [5000]


def test_autopilot_that_forgets_in_its_reboot_is_told_before_the_steps() -> None:
    autopilot = FakeAutopilot()

    def forget(message: Message) -> None:
        if isinstance(message, COMMAND_LONG) and message.command == REBOOT:
            autopilot.params = {"VISO_TYPE": 0.0, "VISO_SCALE": 1.0, "EK3_SRC1_YAW": 1.0}

    autopilot.on_message = forget
    recording = drive(recorder_of("- arm: true\n", more="if_there: {EK3_SRC1_YAW: 1, VISO_SCALE: 2}"), autopilot)
    assert recording.problems == ["parameter VISO_TYPE: set to 1, after the reboot it is 0"]
    assert (recording.sent, recording.began_us) == ([], None)


def test_autopilot_that_does_not_reboot_is_told() -> None:
    autopilot = FakeAutopilot()
    autopilot.reboots = False
    assert fail(autopilot) == ["the autopilot does not reboot (result 4)"] * 2
    assert autopilot.params["VISO_TYPE"] == 0.0
