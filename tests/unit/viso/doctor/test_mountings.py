# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""However the camera is mounted, VISO_ORIENT is named; and with it set nothing is left to say."""

import re
from dataclasses import replace
from functools import cache

import pytest

from ap_visualodom.var_info import VAR_INFO
from tests.places import DATA
from tests.unit.viso.command_line import Viso
from tests.unit.viso.doctor.evidences import changed, evidence_of, seen_in
from tests.unit.viso.doctor.streams import codes, examine, faulty, piece, shifted
from viso.doctor import CHECKS, Evidence, Finding, Severity, diagnose
from viso.doctor.evidence.compare import compare
from viso.streams.stream_kinds import Stream

START_S = 40.0
MOUNTINGS = {0: "FRD", 2: "RBD", 4: "BLD", 6: "LFD", 24: "URF", 25: "DRB"}
"""VISO_ORIENT, and where x, y and z of the camera point then: x is the way that it looks."""
NAMES = {0: "Forward", 2: "Right", 4: "Back", 6: "Left", 24: "Up", 25: "Down"}


@cache
def stream_of(orient: int) -> Stream:
    """Return a flight whose camera is mounted so, with VISO_ORIENT set to that."""
    stream = piece("flight_t265", START_S, 12.0)
    stream = faulty(stream, f"{{kind: axes, body_axes: {MOUNTINGS[orient]}, of: both}}") if orient else stream
    params = {**stream.params, "VISO_TYPE": 2.0, "VISO_ORIENT": float(orient), "EK3_SRC1_YAW": 1.0}
    return replace(stream, params=params)


@cache
def mounted(orient: int) -> Evidence:
    """Return evidence of what is sent and of how the vehicle turned."""
    stream = stream_of(orient)
    return evidence_of(seen_in(stream), stream.params, shifted("flight_t265", START_S).attitude)


def with_params(evidence: Evidence, **others: float) -> dict[str, Finding]:
    """Return what is found if parameters were others."""
    params = {**evidence.trial.params, **others}
    compared = compare(evidence.stream.poses, evidence.stream.vision, evidence.vehicle.attitude, params)
    findings = diagnose(changed(evidence, params=params, comparisons=compared), CHECKS)
    return {finding.code: finding for finding in findings}


def test_these_are_the_mountings_that_the_parameter_lists() -> None:
    (row,) = [row for row in VAR_INFO if row.name == "_ORIENT"]
    assert set(row.values or {}) == set(MOUNTINGS)


ALL = [pytest.param(orient, marks=() if orient == 25 else pytest.mark.slow) for orient in MOUNTINGS]


@pytest.mark.slow
@pytest.mark.parametrize("orient", MOUNTINGS)
def test_camera_is_in_order_on_a_vehicle_once_its_mounting_is_set(orient: int) -> None:
    _, findings = examine(stream_of(orient), shifted("flight_t265", START_S))
    assert codes(findings, Severity.WARNING) == set()


@pytest.mark.slow
@pytest.mark.parametrize("orient", ALL)
def test_camera_is_in_order_once_its_mounting_is_set(orient: int) -> None:
    findings = diagnose(mounted(orient), CHECKS)
    assert codes(findings, Severity.WARNING) == set()


@pytest.mark.parametrize("orient", ALL[1:])
def test_mounting_is_named_with_the_value_that_undoes_it(orient: int) -> None:
    found = with_params(mounted(orient), VISO_ORIENT=0)["XN2-06"]
    assert f"axes point {MOUNTINGS[orient]} rather than FRD" in found.evidence
    assert found.fix.startswith(f"Set VISO_ORIENT to {orient} ({NAMES[orient]}), or turn the attitude")


@pytest.mark.parametrize("orient", ALL)
def test_wrong_value_is_replaced_by_the_right_one(orient: int) -> None:
    wrong = 4 if orient == 6 else 6
    found = with_params(mounted(orient), VISO_ORIENT=wrong)["XN2-06"]
    assert f"rather than FRD once VISO_ORIENT {wrong} is taken off" in found.evidence
    assert found.fix.startswith(f"Set VISO_ORIENT to {orient} ({NAMES[orient]}), or turn")


@pytest.mark.parametrize("orient", ALL[1:])
def test_type_that_turns_nothing_needs_another(orient: int) -> None:
    found = with_params(mounted(orient), VISO_TYPE=1, VISO_ORIENT=6)["XN2-06"]
    assert found.fix.endswith(f"; or use VISO_TYPE 2 with VISO_ORIENT {orient} ({NAMES[orient]}).")


@pytest.mark.slow
@pytest.mark.parametrize(("mounting", "found"), [("0,0,90", []), ("0,90,0", ["XN2-13"]), ("0,-90,0", ["XN2-13"])])
def test_what_play_makes_of_a_mounting_is_in_order(viso: Viso, mounting: str, found: list[str]) -> None:
    """The recorded body is level, so a camera that was tilted would have been on a vehicle on its side."""
    flight = DATA / "trajectories" / "flight.tum"
    assert viso("play", flight, "-o", "played.tlog", "--axes", "enu_flu", "--mounting", mounting).code == 0
    out = viso("doctor", "played.tlog", "--fail-on", "warning", "--lead", "6.5").out
    assert re.findall(r"^(?:error|warning) (XN\S+)", out, re.MULTILINE) == found
