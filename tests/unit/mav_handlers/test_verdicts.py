# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The endpoint's rules."""

from ap_core.verdict import Verdict, VerdictKind
from ap_visualodom import verdicts as port
from ap_visualodom.verdicts import CONSUMED, QUALITY_BELOW_MIN, RESET_SETTLING
from mav_handlers import verdicts as endpoint
from mav_handlers.verdicts import ALL_VERDICTS, HANDLED


def test_codes_are_unique_among_all_rules() -> None:
    codes = [verdict.rule.code for verdict in ALL_VERDICTS]
    assert len(set(codes)) == len(codes)


def test_none_is_left_out() -> None:
    named = [value for module in (port, endpoint) for value in vars(module).values() if isinstance(value, Verdict)]
    assert list(ALL_VERDICTS) == named, "ALL_VERDICTS lists each verdict, in the order in which they are defined"


def test_all_other_rules_drop_the_message() -> None:
    others = [verdict for verdict in ALL_VERDICTS if verdict.kind is not VerdictKind.DROPPED]
    assert others == [CONSUMED, QUALITY_BELOW_MIN, RESET_SETTLING, HANDLED]
