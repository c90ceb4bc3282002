# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every planted defect is found by its code, and clean streams give no warning."""

from collections.abc import Iterable, Iterator

import pytest

from tests.unit.viso.doctor.corpus import CLEAN, CORPUS, ODOMETRY, POSE, SPEED, Case
from tests.unit.viso.doctor.evidences import changed, evidence_of, seen_in
from tests.unit.viso.doctor.streams import LEAD_US, codes, examine, recording, shifted
from viso.doctor import CHECKS, Finding, Severity, diagnose

BY_THE_VEHICLE = {
    *("XN1-04", "XN1-06", "XN1-08", "XN1-09", "XN2-01", "XN4-06", "XN4-07", "XN6-07", "XN6-08", "XN7-01", "XN7-02"),
    *("XN7-10", "XN9-02", "XN9-03", "XN9-04"),
}
"""Codes for which the vehicle has to have its say."""
CLEAN_ALWAYS = {"pose and speed against the vehicle's place", "reset with its counter"}
LATENESS = {"XN3-04", "XN3-05", "XN3-06", "XN3-07", "XN3-08", "XN3-10", "XN3-11"}


def _new_codes() -> Iterator[Case]:
    """Yield one stream for each code that shows in what is sent."""
    known = set(BY_THE_VEHICLE)
    for case in CORPUS:
        if case.expected.isdisjoint(BY_THE_VEHICLE) and not case.expected <= known:
            known |= case.expected
            yield case


NEW = list(_new_codes())
AGAIN = [case for case in CORPUS if case not in NEW and case.expected.isdisjoint(BY_THE_VEHICLE) and not case.first]
"""Other streams for the same codes, of which no order is asked for."""


def _named(cases: Iterable[Case], *marks: pytest.MarkDecorator) -> list[object]:
    return [pytest.param(case, id=case.name, marks=marks) for case in cases]


def _sent(case: Case) -> list[Finding]:
    """Return what is found when every message is accepted and the filter aids.

    Where it does not matter what else is found, checks of other families are left out: no check depends on another.
    """
    stream, vehicle = case.stream(), case.vehicle()
    made = evidence_of(seen_in(stream), stream.params, vehicle.attitude)
    families = {code.partition("-")[0] for code in case.expected}
    checks = CHECKS if case.first or not families else [check for check in CHECKS if check.family in families]
    return diagnose(changed(made, position=vehicle.position, level=vehicle.level), checks)


def _holds(case: Case, findings: list[Finding]) -> bool:
    """Return whether what is expected was found, and is the first error if it is to be that."""
    errors = [finding.code for finding in findings if finding.severity is Severity.ERROR]
    return case.expected <= codes(findings) and (not case.first or errors[:1] == [case.first])


@pytest.mark.parametrize("case", [*_named(NEW), *_named(AGAIN, pytest.mark.slow)])
def test_planted_defect_shows_in_what_is_sent(case: Case) -> None:
    assert _holds(case, _sent(case))


@pytest.mark.parametrize("case", [case for case in CLEAN if case.name in CLEAN_ALWAYS], ids=lambda case: case.name)
def test_nothing_shows_in_what_is_sent_of_a_clean_stream(case: Case) -> None:
    assert codes(_sent(case), Severity.WARNING) == set()


def test_corpus_is_large_and_its_names_are_unique() -> None:
    names = [case.name for case in (*CLEAN, *CORPUS)]
    assert len(names) == len(set(names))
    assert set(names) >= CLEAN_ALWAYS
    assert len(CORPUS) >= 60
    assert sum(bool(case.first) for case in CORPUS) >= 22
    assert {case.base for case in CORPUS} >= {ODOMETRY, SPEED, POSE}


@pytest.mark.slow
@pytest.mark.parametrize("case", _named(case for case in CORPUS if case not in AGAIN))
def test_planted_defect_is_found(case: Case) -> None:
    _, findings = examine(case.stream(), case.vehicle())
    assert _holds(case, findings)
    assert case.first != "XN3-12" or not codes(findings) & LATENESS


@pytest.mark.slow
@pytest.mark.parametrize("case", CLEAN, ids=lambda case: case.name)
def test_clean_stream_gives_no_warning(case: Case) -> None:
    _, findings = examine(case.stream(), case.vehicle())
    assert codes(findings, Severity.WARNING) == set()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flight_t265", "flight_mav_extyaw", "voxl"])
@pytest.mark.parametrize("knows_attitude", [False, True])
def test_clean_capture_gives_no_warning(name: str, knows_attitude: bool) -> None:
    vehicle = shifted(name, LEAD_US * 1e-6) if knows_attitude else None
    _, findings = examine(recording(name), vehicle)
    assert codes(findings, Severity.WARNING) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("dropout", {"XN4-04", "XN4-05"}),
        ("flight_voxl_reset", {"XN6-12"}),
        ("mav", {"XN5-11", "XN6-03"}),
        ("mocap", {"XN5-11", "XN7-03"}),
        ("prearm", {"XN6-02"}),
        ("t265", {"XN2-01", "XN5-11", "XN6-03", "XN6-08", "XN6-09"}),
    ],
)
def test_what_was_done_to_a_capture_is_found_and_nothing_else(name: str, expected: set[str]) -> None:
    _, findings = examine(recording(name))
    assert codes(findings, Severity.WARNING) == expected


@pytest.mark.slow
def test_what_the_vehicle_knows_of_a_capture_is_found_as_well() -> None:
    # The firmware refused to arm: VisOdom: roll/pitch diff 17.8 deg, VisOdom: yaw diff 22.9 deg.
    _, findings = examine(recording("prearm"), shifted("prearm", LEAD_US * 1e-6))
    assert codes(findings, Severity.WARNING) == {"XN6-02", "XN8-05", "XN8-08"}
    told = {finding.code: finding.evidence for finding in findings}
    assert "roll and pitch are 17 deg" in told["XN8-05"]
    assert "by up to 23 deg" in told["XN8-08"]
