# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Advice names the findings that explain a symptom, fits the release and the build, and causes come first."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.unit.viso.command_line import Viso
from tests.unit.viso.doctor.evidences import evidence_of
from viso.doctor import CHECKS, Check, Evidence, Severity, Sighting, diagnose
from viso.doctor.checks.causes import probable_cause
from viso.doctor.checks.phrases import per_second
from viso.doctor.evidence.set_up import FEWEST_OF_WHOLE_LIST
from viso.firmware.flown import profile_for, version_in


def made(code: str, severity: Severity = Severity.ERROR, **fields: Any) -> Check:
    """Return the check of a code, which finds one thing whatever the evidence."""

    def find(_evidence: Evidence) -> Iterator[Sighting]:
        yield Sighting("found", severity=severity)

    return replace(next(check for check in CHECKS if check.code == code), find=find, **fields)


def fix_of(code: str, *others: Check, evidence: Evidence | None = None) -> str:
    found = diagnose(evidence or evidence_of([]), [made(code), *others])
    return next(one.fix for one in found if one.code == code)


@pytest.mark.parametrize("check", [check for check in CHECKS if "See the" in check.fix and "findings" in check.fix])
def test_advice_of_a_symptom_names_the_findings_that_are_there(check: Check) -> None:
    assert check.leads_to, check.code
    cause = next(one for one in CHECKS if one.code.startswith(check.leads_to) and one.code != check.code)
    assert fix_of(check.code, made(cause.code)) == f"Look first at {cause.code} ({cause.title})."
    assert "finding" not in fix_of(check.code)
    assert fix_of(check.code, made(cause.code, Severity.NOTE)) == check.alone


def with_set_up(evidence: Evidence, **fields: Any) -> Evidence:
    return replace(evidence, set_up=replace(evidence.set_up, **fields))


def test_advice_about_source_sets_says_what_an_old_release_has_instead() -> None:
    flown = version_in("ArduCopter V3.6.11 (abcdef12)")
    assert flown is not None
    old = with_set_up(evidence_of([]), judged_by=profile_for(flown, ()))
    assert "EK2_GPS_TYPE 3" in fix_of("XN7-08", evidence=old)
    assert "EK2_GPS_TYPE" not in fix_of("XN7-08")
    assert "EK2_GPS_TYPE" not in fix_of("XN3-01", evidence=old)


def test_advice_about_visual_odometry_says_that_the_build_has_none() -> None:
    known = {f"P{number}": 0.0 for number in range(FEWEST_OF_WHOLE_LIST + 1)}
    without = with_set_up(evidence_of([]), known=known, is_complete=True)
    assert "This build has no visual odometry" in fix_of("XN7-17", evidence=without)
    with_it = with_set_up(evidence_of([]), known={**known, "VISO_TYPE": 0.0}, is_complete=True)
    assert "This build" not in fix_of("XN7-17", evidence=with_it)


@pytest.mark.parametrize(("cause", "others", "explained"), [
    ("XN3-12", ("XN3-06", "XN9-10"), ("XN3-06", "XN9-10")),
    ("XN3-01", ("XN9-10", "XN4-03"), ("XN9-10",)),
    ("XN5-07", ("XN9-10", "XN6-01"), ("XN6-01", "XN9-10")),
    ("XN2-02", ("XN8-05",), ("XN8-05",)),
    ("XN4-05", ("XN9-16", "XN9-13"), ("XN9-13", "XN9-16")),
    ("XN3-13", ("XN3-11", "XN9-07", "XN9-31"), ("XN3-11", "XN9-07", "XN9-31")),
    ("XN2-13", ("XN2-03", "XN8-12", "XN9-18"), ("XN2-03", "XN8-12")),
    ("XN7-19", ("XN9-11", "XN7-18"), ("XN9-11",)),
    ("XN8-07", ("XN9-31", "XN9-18"), ("XN9-31",)),
    ("XN9-07", ("XN9-31",), ("XN9-31",)),
    ("XN1-01", ("XN7-18", "XN9-12", "XN9-15"), ("XN9-12", "XN9-15")),
    ("XN9-12", ("XN9-13", "XN9-16"), ("XN9-13", "XN9-16")),
    ("XN2-06", ("XN2-04", "XN8-05"), ("XN2-04", "XN8-05")),
    ("XN2-07", ("XN2-06", "XN8-05"), ("XN2-06", "XN8-05")),
    ("XN6-11", ("XN1-05", "XN4-06"), ("XN1-05", "XN4-06")),
])  # fmt: skip
def test_one_cause_explains_others(cause: str, others: tuple[str, ...], explained: tuple[str, ...]) -> None:
    found = probable_cause(diagnose(evidence_of([]), [made(code) for code in (*others, cause)]))
    assert found is not None
    assert (found.finding.code, set(found.explains)) == (cause, set(explained))


def test_nothing_is_a_cause_that_explains_nothing() -> None:
    assert probable_cause(diagnose(evidence_of([]), [made("XN3-01"), made("XN5-01")])) is None
    assert probable_cause(diagnose(evidence_of([]), [made("XN3-01"), made("XN9-10", Severity.NOTE)])) is None
    assert probable_cause(diagnose(evidence_of([]), CHECKS)) is None


def test_cause_is_printed_first(viso: Viso) -> None:
    poses = "".join(f"{0.02 * i:g} {0.02 * i:g} 0 -1 0 0 0 1\n" for i in range(300))
    Path("poses.tum").write_text(poses, encoding="utf-8")
    out = viso("doctor", "poses.tum", "--param", "VISO_TYPE=0", "--param", "EK3_SRC1_POSXY=6").out
    assert out.startswith(("probable cause: XN7-01", "error XN7-01"))


def test_rate_is_counted_over_time_and_bursts_are_named() -> None:
    assert per_second([0, 100_000, 200_000, 300_000]) == "10 messages per second"
    assert per_second([0, 100, 200, 300_000, 300_100, 300_200]) == "16.7 messages per second, in bursts or with gaps"
