# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter rejects is told, but not held against a stream that was silent before."""

from typing import Any

import pytest

from ap_core.verdict import Rule
from ap_visualodom.verdicts import QUALITY_BELOW_MIN
from ekf_stub.inputs.ingest_rules import FUSED, GATE_POSITION, FilterOutcome
from mav_handlers.wire.messages import VISION_POSITION_DELTA
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.evidences import START_US, evidence_of, findings_of, seen
from viso.doctor import Finding, HandledMessage, Severity
from viso.vehicle.outcomes import HandedSample, Innovations, SampleTest

PERIOD_US = 40_000


def message(number: int, rule: Rule | None) -> HandledMessage:
    """Return a message whose pose had an outcome in the filter, or which was withheld."""
    at_us = START_US + number * PERIOD_US
    told = odometry(number * PERIOD_US + 1, x=0.02 * number)
    if rule is None:
        return seen(number + 1, at_us, told, QUALITY_BELOW_MIN)
    test = SampleTest(at_us, FilterOutcome("pose", rule, at_us // 1000, 1.5, 1.0))
    return seen(number + 1, at_us, told, samples=(HandedSample("pose", at_us // 1000, [test]),))


def found_of(outcomes: list[Rule | None], **fields: Any) -> Finding | None:
    messages = [message(number, rule) for number, rule in enumerate(outcomes)]
    return findings_of(evidence_of(messages, **fields)).get("XN9-04")


@pytest.mark.parametrize(("withheld", "severity"), [(5, Severity.WARNING), (40, Severity.NOTE)])
def test_rejection_after_a_silence_is_a_note(withheld: int, severity: Severity) -> None:
    finding = found_of([*[FUSED] * 50, *[None] * withheld, *[GATE_POSITION] * 20, *[FUSED] * 20])
    assert finding is not None
    assert finding.severity is severity
    assert finding.message_numbers == tuple(range(51 + withheld, 71 + withheld))
    assert ("after a time without samples" in finding.evidence) == (severity is Severity.NOTE)


def test_rejection_in_full_sight_counts_beside_one_after_a_silence() -> None:
    finding = found_of([*[FUSED] * 50, *[None] * 40, *[GATE_POSITION] * 20, *[FUSED] * 80, *[GATE_POSITION] * 30])
    assert finding is not None
    assert finding.severity is Severity.WARNING
    assert finding.message_numbers == tuple(range(191, 221))


def test_rejection_from_the_first_message_on_is_in_full_sight() -> None:
    finding = found_of([*[GATE_POSITION] * 30, *[FUSED] * 20])
    assert finding is not None
    assert finding.severity is Severity.WARNING


def test_vehicle_of_the_model_that_lost_the_stream_proves_nothing() -> None:
    innovations = {"pose": Innovations(tested=80, rejected=30, worst=64.0)}
    outcomes: list[Rule | None] = [*[FUSED] * 50, *[GATE_POSITION] * 30]
    seen_so, lost = (
        found_of(outcomes, innovations=innovations),
        found_of(outcomes, innovations=innovations, model_jumps=2),
    )
    assert seen_so is not None
    assert lost is not None
    assert (seen_so.severity, lost.severity) == (Severity.WARNING, Severity.NOTE)
    assert "64.00 m off" in seen_so.evidence
    assert "64" not in lost.evidence
    assert "lost the stream" in lost.evidence


@pytest.mark.parametrize("rejected", [0, 3])
def test_few_rejections_are_let_pass(rejected: int) -> None:
    assert found_of([*[FUSED] * 50, *[GATE_POSITION] * rejected, *[FUSED] * 50]) is None


def test_rejection_without_poses_shows_a_model_that_stands_still() -> None:
    rejected = [message(number, GATE_POSITION) for number in range(100)]
    test = rejected[0].samples
    deltas = [
        seen(n + 1, START_US + n * PERIOD_US, VISION_POSITION_DELTA(n, 40_000, (0.0,) * 3, (0.1, 0.0, 0.0), 90.0),
             samples=test)
        for n in range(100)
    ]  # fmt: skip
    assert "XN9-04" in findings_of(evidence_of(rejected))
    assert "XN9-04" not in findings_of(evidence_of(deltas))
