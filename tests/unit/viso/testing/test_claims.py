# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Claims about messages, samples and texts, on such that are made up."""

import pytest

from ap_core.verdict import Verdict, VerdictKind
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN
from mav_handlers.verdicts import BAD_CRC, HANDLED, NO_HANDLER, ODOMETRY_FRAMES
from mav_handlers.wire.messages import ODOMETRY
from viso.testing import MessageVerdict, StatusText, claims


def met(verdict: Verdict, name: str = "ODOMETRY", time_us: int = 8_000_000) -> MessageVerdict:
    rule = verdict.rule
    return MessageVerdict(time_us, name, 1, 197, None, verdict.kind, rule.code, rule.text, rule.source, ())


SEEN = [met(CONSUMED), met(HANDLED, "HEARTBEAT"), met(CONSUMED), met(QUALITY_BELOW_MIN), met(ODOMETRY_FRAMES)]


@pytest.mark.parametrize(
    ("outcome", "message", "reason", "count"),
    [
        (VerdictKind.ACCEPTED, None, None, None),
        (VerdictKind.ACCEPTED, "ODOMETRY", "consumed", 2),
        (VerdictKind.ACCEPTED, ODOMETRY, None, 2),
        (VerdictKind.ACCEPTED, "VISION_POSITION_ESTIMATE", None, 0),
        (VerdictKind.IGNORED, None, "quality_below_min", 1),
        (VerdictKind.DROPPED, None, "odometry_frames", None),
        (VerdictKind.DROPPED, None, "bad_crc", 0),
    ],
)
def test_true_claims_hold(
    outcome: VerdictKind, message: str | type[ODOMETRY] | None, reason: str | None, count: int | None
) -> None:
    claims.check_claim(claims.make_claim(outcome, message, reason, count), SEEN)


@pytest.mark.parametrize(
    ("outcome", "message", "reason", "count", "told"),
    [
        (VerdictKind.ACCEPTED, None, None, 3, "expected 3 messages accepted, found 2; what came:"),
        (VerdictKind.ACCEPTED, "ODOMETRY", None, 1, "expected 1 ODOMETRY accepted, found 2; what came:"),
        (
            VerdictKind.IGNORED,
            None,
            "reset_settling",
            None,
            "expected at least one message ignored by the rule reset_settling",
        ),
        (VerdictKind.DROPPED, "HEARTBEAT", None, None, "expected at least one HEARTBEAT dropped, found 0; what came:"),
    ],
)
def test_false_claims_tell_what_came(
    outcome: VerdictKind, message: str | None, reason: str | None, count: int | None, told: str
) -> None:
    claim = claims.make_claim(outcome, message, reason, count)
    with pytest.raises(AssertionError) as failure:
        claims.check_claim(claim, SEEN)
    lines = str(failure.value).splitlines()
    assert lines[0].startswith(told)
    assert "    2 ODOMETRY accepted, consumed: handed to the EKF (first at 8.000 s)" in lines
    assert len(lines) == 5


def test_first_time_of_a_row_is_told() -> None:
    text = claims.what_became([met(CONSUMED, time_us=7_100_000), met(CONSUMED, time_us=7_200_000)])
    assert "    2 ODOMETRY accepted, consumed: handed to the EKF (first at 7.100 s)" in text


def test_silence_is_told_as_such() -> None:
    claim = claims.make_claim(VerdictKind.ACCEPTED, None, None, None)
    with pytest.raises(AssertionError, match=r"^expected at least one message accepted, found 0; nothing has come$"):
        claims.check_claim(claim, [])


def test_many_kinds_are_cut_short() -> None:
    text = claims.what_became([met(HANDLED, f"MESSAGE_{number}") for number in range(20)])
    assert len(text.splitlines()) == 1 + claims.MESSAGE_ROWS + 1
    assert text.endswith("... and 12 more")


@pytest.mark.parametrize(
    ("outcome", "message", "reason", "count", "told"),
    [
        (VerdictKind.DROPPED, None, "odometry_frame", None, "no such rule; did you mean 'odometry_frames'?"),
        (VerdictKind.IGNORED, None, "zzz", None, "no such rule; there are quality_below_min, reset_settling"),
        (VerdictKind.DROPPED, None, "consumed", None, "by that rule messages are accepted, not dropped"),
        (VerdictKind.DROPPED, "ODOMETRIE", None, None, "message 'ODOMETRIE': MAVLink has no such message"),
        (VerdictKind.DROPPED, None, None, -1, "count -1: not a number of messages"),
        (VerdictKind.DROPPED, None, None, True, "count True: not a number of messages"),
    ],
)
def test_claims_about_what_does_not_exist_are_refused(
    outcome: VerdictKind, message: str | None, reason: str | None, count: int | None, told: str
) -> None:
    with pytest.raises(ValueError, match=told.replace("?", r"\?")):
        claims.make_claim(outcome, message, reason, count)


@pytest.mark.parametrize("name", ["BAD_DATA", "UNKNOWN"])
def test_bytes_that_are_no_message_have_a_name(name: str) -> None:
    claims.check_claim(claims.make_claim(VerdictKind.DROPPED, name, "bad_crc", 1), [met(BAD_CRC, name)])


@pytest.mark.parametrize("lost", [met(ODOMETRY_FRAMES), met(QUALITY_BELOW_MIN), met(BAD_CRC, "BAD_DATA")])
def test_lost_navigation_is_noticed(lost: MessageVerdict) -> None:
    with pytest.raises(AssertionError, match="expected every message with navigation accepted, but not 1; what came:"):
        claims.check_nothing_lost([met(CONSUMED), lost], None)


def test_other_messages_may_be_dropped() -> None:
    claims.check_nothing_lost([met(CONSUMED), met(NO_HANDLER, "ATTITUDE"), met(HANDLED, "HEARTBEAT")], None)


def test_only_the_message_in_question_may_not_be_lost() -> None:
    seen = [met(CONSUMED, "VISION_SPEED_ESTIMATE"), met(ODOMETRY_FRAMES)]
    claims.check_nothing_lost(seen, "VISION_SPEED_ESTIMATE")
    with pytest.raises(AssertionError, match="expected every ODOMETRY accepted"):
        claims.check_nothing_lost(seen, "ODOMETRY")


TEXTS = [StatusText(number * 1_000_000, 6, f"text {number}") for number in range(12)]


def test_part_of_a_text_is_found() -> None:
    claims.check_text("ext 3", TEXTS)


def test_missing_text_tells_the_newest_ones() -> None:
    with pytest.raises(AssertionError) as failure:
        claims.check_text("yaw", TEXTS)
    lines = str(failure.value).splitlines()
    assert lines[0] == "expected a text with 'yaw'; it said:"
    assert lines[1] == "  ... and 4 more"
    assert lines[-1] == "   11.000 s  (6) text 11"
    assert len(lines) == 10


def test_silent_autopilot_is_told_as_such() -> None:
    with pytest.raises(AssertionError, match=r"^expected a text with 'yaw'; it has said nothing$"):
        claims.check_text("yaw", [])


def test_unknown_kind_of_sample_is_refused() -> None:
    with pytest.raises(ValueError, match="kind 'position': no such kind of sample; there are pose, height, yaw"):
        claims.check_fused([], "position", None)
