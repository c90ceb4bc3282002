# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Evidence of a trial: what the autopilot makes of a stream, and what it said itself in it."""

import math
from dataclasses import replace
from functools import cache

import pytest

from mav_handlers.verdicts import OWN_MESSAGE
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, DISTANCE_SENSOR, HEARTBEAT, PARAM_VALUE, STATUSTEXT, Message
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.evidences import SETUP
from tests.unit.viso.doctor.streams import LEAD_US, codes, examine
from viso.doctor import Evidence, HandledMessage, Severity, diagnose, gather
from viso.doctor.checks import CHECKS
from viso.doctor.output.summary import summarise
from viso.errors import InputError
from viso.streams.stream_kinds import Stream, StreamMessage
from viso.vehicle.outcomes import OutcomeKind

END_US = LEAD_US + 2_000_000


def stream_of(messages: list[tuple[int, int, int, Message]], params: dict[str, float] | None = None) -> Stream:
    """Return a stream of messages with their times and their senders' ids."""
    codecs: dict[tuple[int, int], Codec] = {}
    frames = []
    for time_us, system, component, message in sorted(messages, key=lambda row: row[0]):
        codec = codecs.setdefault((system, component), Codec(system, component))
        frames.append(StreamMessage(time_us, codec.encode(message)))
    return Stream("made", tuple(frames), params or {})


def companion(period_us: int = 40_000) -> list[tuple[int, int, int, Message]]:
    return [(time_us, 1, 197, odometry(time_us)) for time_us in range(LEAD_US, END_US, period_us)]


def autopilot(system: int) -> list[tuple[int, int, int, Message]]:
    beat = HEARTBEAT(2, 3, 81, 0, 3, 3)
    said: list[Message] = [
        beat,
        PARAM_VALUE("VISO_TYPE", 1.0, 9, 900, 0),
        PARAM_VALUE("VISO_TYPE", 2.0, 9, 900, 65535),
        STATUSTEXT(4, "EKF3 IMU0 stopped aiding"),
    ]
    rows = [(LEAD_US + 1000 * number, system, 1, message) for number, message in enumerate(said)]
    for time_us in range(LEAD_US, END_US, 50_000):
        boot_ms = (time_us - LEAD_US) // 1000 + 77_000
        rows.append((time_us + 3000, system, 1, ATTITUDE(boot_ms, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)))
    return rows


@cache
def tried(filter_s: float = math.inf) -> Evidence:
    """Return what came of a companion's stream that fits."""
    return gather(stream_of(companion(), dict(SETUP)), filter_s=filter_s)


def test_messages_carry_verdict_records_and_outcomes() -> None:
    assert [one.number for one in tried(60.0).stream.messages] == list(range(1, 51))
    late: HandledMessage = tried(60.0).stream.messages[40]
    assert (late.name, late.sender, late.version) == ("ODOMETRY", (1, 197), 2)
    assert [name for name, _ in late.records] == ["VISP", "VISV"]
    assert {sample.kind for sample in late.samples} == {"pose", "yaw", "velocity"}
    assert all(sample.is_settled for sample in late.samples)


def test_own_telemetry_is_counted_and_not_kept() -> None:
    evidence = gather(stream_of(companion() + autopilot(1), dict(SETUP)), filter_s=0.0)
    messages, own = evidence.stream.messages, [one for one in evidence.stream.messages if one.sender == (1, 1)]
    assert [one.number for one in messages] == list(range(1, len(companion()) + len(autopilot(1)) + 1))
    assert [one.sequence for one in own] == list(range(len(autopilot(1))))
    assert {(one.verdict, one.message, one.frame) for one in own} == {(OWN_MESSAGE, None, b"")}
    assert [(one.verdict, one.records) for one in messages if one.message] == [
        (one.verdict, one.records) for one in tried(0.0).stream.messages
    ]


def test_parameters_of_a_recording_leave_nothing_to_assume() -> None:
    evidence = gather(stream_of(companion(), {"VISO_TYPE": 0}))
    assert evidence.set_up.assumed == ()
    assert evidence.viso_type == 0
    assert "XN7-01" in codes(diagnose(evidence, CHECKS))


@pytest.mark.slow
def test_given_parameters_win_over_those_of_the_recording() -> None:
    evidence = gather(stream_of(companion(), {"VISO_TYPE": 0}), params={"VISO_TYPE": 3})
    assert evidence.viso_type == 3


@pytest.mark.slow
def test_without_parameters_a_set_up_that_fits_is_assumed() -> None:
    evidence = gather(stream_of(companion()))
    assumed = {one.name: one.value for one in evidence.set_up.assumed}
    assert assumed["VISO_TYPE"] == 1
    assert assumed["EK3_SRC1_POSXY"] == assumed["EK3_SRC1_VELXY"] == 6
    assert summarise(evidence).aiding_from_us is not None


@pytest.mark.slow
def test_what_the_autopilot_said_is_told_from_the_companion() -> None:
    evidence = gather(stream_of([*companion(), *autopilot(7)]))
    assert evidence.param("MAV_SYSID") == 7
    assert evidence.viso_type == 1
    assert [(change.name, change.old, change.new) for change in evidence.vehicle.changes] == [("VISO_TYPE", 1.0, 2.0)]
    assert [text for _, _, text in evidence.vehicle.texts] == ["EKF3 IMU0 stopped aiding"]
    assert evidence.vehicle.attitude is not None
    assert len(evidence.vehicle.attitude) == 40
    # Its own clock, tied to the times of arrival.
    assert evidence.vehicle.attitude.time_us[0] == LEAD_US + 3000
    assert evidence.vehicle.attitude.euler_rad[0].tolist() == [0.0, 0.0, pytest.approx(1.0)]
    assert all(one.sender == (1, 197) for one in evidence.stream.vision)


@pytest.mark.slow
def test_heading_of_the_vehicle_is_where_it_starts() -> None:
    params = {**SETUP, "EK3_SRC1_YAW": 1.0}
    found = gather(stream_of([*companion(), *autopilot(1)], params))
    assert "XN8-04" in codes(diagnose(found, CHECKS))


@pytest.mark.slow
def test_more_than_the_filter_takes_is_a_note() -> None:
    _, findings = examine(stream_of(companion(8_000), dict(SETUP)))
    (finding,) = [finding for finding in findings if finding.code == "XN4-02"]
    assert finding.severity == "note"
    assert "125 messages per second" in finding.evidence
    assert "XN4-06" not in codes(findings)


@pytest.mark.slow
def test_samples_that_the_buffer_loses_are_told() -> None:
    bunched: list[tuple[int, int, int, Message]] = [
        (LEAD_US + index // 12 * 480_000, 1, 197, odometry(LEAD_US + index * 40_000)) for index in range(60)
    ]
    _, findings = examine(stream_of(bunched, dict(SETUP)))
    assert "XN9-05" in codes(findings)


def test_empty_stream_has_no_vision() -> None:
    evidence, findings = examine(Stream("empty", (), dict(SETUP)))
    assert evidence.stream.messages == ()
    assert "XN1-01" in codes(findings)
    assert summarise(evidence).healthy_from_us is None


@pytest.mark.slow
def test_summary_counts_what_became_of_messages_and_samples() -> None:
    summary = summarise(tried())
    assert sum(summary.outcomes.values()) == 50
    assert summary.rate_hz["ODOMETRY"] == pytest.approx(25)
    assert summary.healthy_from_us == LEAD_US
    assert summary.unhealthy == 0
    assert summary.samples["velocity", OutcomeKind.FUSED] > 40
    assert summary.aiding_until_us is None
    (lags,) = summary.lags
    assert sum(lags.counts) == 50


def test_parameter_that_cannot_be_is_one_line() -> None:
    with pytest.raises(InputError, match="made: "):
        gather(stream_of(companion(), {"VISO_SCALE": float("nan")}))


def test_type_that_always_fails_its_checksum_is_defined_otherwise() -> None:
    """DISTANCE_SENSOR of a dialect of the sender's own, between sound poses, and one damaged frame."""
    range_finder = Codec(1, 174)
    strange = [range_finder.encode(DISTANCE_SENSOR(0, 20, 500, 100, 0, 0, 25, 0)) for _ in range(40)]
    messages = list(stream_of(companion(), dict(SETUP)).messages)
    damaged = bytearray(messages[7].frame)
    damaged[20] ^= 0xFF
    messages[7] = replace(messages[7], frame=bytes(damaged))
    for frame, place in zip(strange, range(0, 80, 2), strict=True):
        spoilt = frame[:-2] + bytes((frame[-2] ^ 0x5A, frame[-1]))
        messages.insert(place, StreamMessage(messages[place].arrival_us, spoilt))
    _, findings = examine(Stream("made", tuple(messages), dict(SETUP)))
    of_type, of_link = (finding for finding in findings if finding.code == "XN1-04")
    assert of_type.severity is Severity.WARNING
    assert of_type.evidence.startswith("1 of 50")
    assert of_link.severity is Severity.NOTE
    assert of_link.evidence.startswith("all 40 DISTANCE_SENSOR from 1/174 fail their checksum")
    assert of_link.message_numbers == tuple(range(1, 80, 2))


@pytest.mark.parametrize(("filter_s", "is_told"), [(1.0, True), (60.0, False)])
def test_filter_that_did_not_run_all_the_way_is_told(filter_s: float, is_told: bool) -> None:
    evidence = tried(filter_s)
    told = f"made: the filter (a model) was run over the first {filter_s:g} s of external navigation, to 7.500 s"
    assert (f"{told} (--filter-seconds)" in evidence.notes) == is_told
    assert len(evidence.stream.vision) == 50
