# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules of the library: distinct, explained, and with a place in the firmware."""

import pytest

from ap_core.verdict import Verdict, VerdictKind
from ap_visualodom.verdicts import CONSUMED, DISABLED, NO_BACKEND, QUALITY_BELOW_MIN, RESET_SETTLING, VERDICTS


@pytest.mark.parametrize(
    ("verdict", "outcome", "code"),
    [
        (CONSUMED, VerdictKind.ACCEPTED, "consumed"),
        (DISABLED, VerdictKind.DROPPED, "viso_disabled"),
        (NO_BACKEND, VerdictKind.DROPPED, "no_backend"),
        (QUALITY_BELOW_MIN, VerdictKind.IGNORED, "quality_below_min"),
        (RESET_SETTLING, VerdictKind.IGNORED, "reset_settling"),
    ],
)
def test_outcome_and_code(verdict: Verdict, outcome: VerdictKind, code: str) -> None:
    assert (verdict.kind, verdict.rule.code) == (outcome, code)


def test_table_lists_every_verdict() -> None:
    assert set(VERDICTS) == {CONSUMED, DISABLED, NO_BACKEND, QUALITY_BELOW_MIN, RESET_SETTLING}


def test_codes_are_distinct() -> None:
    assert len({verdict.rule.code for verdict in VERDICTS}) == len(VERDICTS)


@pytest.mark.parametrize("verdict", VERDICTS, ids=lambda verdict: verdict.rule.code)
def test_rule_has_a_reason_and_a_place_in_the_firmware(verdict: Verdict) -> None:
    assert verdict.rule.text
    assert verdict.rule.source.startswith("AP_VisualOdom")
