# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Dangers that nothing announces: arming without vision, no origin, velocities of all sets, a stream that stops."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pytest

from ekf_stub.inputs.ingest_rules import FUSED, FilterOutcome
from mav_handlers.wire.messages import ATT_POS_MOCAP, GLOBAL_POSITION_INT, Message
from tests.unit.viso.doctor.evidences import START_US, changed, evidence_of, findings_of, pose, seen, speed, stream_of
from tests.unit.viso.doctor.own_filters import (
    EXTNAV,
    GPS,
    during,
    heard,
    heartbeat,
    logged,
    own_of,
    quiet,
    report,
    sys_status,
    text,
)
from viso.doctor import Finding, Severity
from viso.doctor.evidence.own_filter import OwnFilter
from viso.doctor.evidence.set_up import SetUp
from viso.doctor.evidence.vehicle_data import AttitudeSeries
from viso.doctor.output.summary import summarise
from viso.doctor.output.terminal import summary_lines
from viso.firmware.flown import JudgedBy
from viso.firmware.releases import JULY_2025
from viso.streams.stream_kinds import Aspect
from viso.vehicle.outcomes import HandedSample, SampleTest

ON: Final = {"VISO_TYPE": 1.0}
CHECK_LEFT_OUT: Final = {**ON, "ARMING_CHECK": 448.0}
START_S: Final = START_US * 1e-6
HELD: Final = {"EK3_SRC1_YAW": 1, "EK3_SRC1_VELXY": 0, "EK3_SRC1_VELZ": 0}


def known(params: Mapping[str, float]) -> SetUp:
    """Return a set-up whose parameters are known."""
    return SetUp(JudgedBy(JULY_2025, "it is the reference"), known=dict(params))


def armed_at(time_s: float, *, healthy: bool) -> OwnFilter | None:
    """Return a filter of a vehicle that arms at some time, with a sensor that is always healthy, or never."""
    statuses = [(at_s, sys_status(healthy=healthy)) for at_s in range(1, 40)]
    beats = [(float(at_s), heartbeat(armed=at_s >= time_s)) for at_s in range(1, 40)]
    return heard(sorted([*statuses, *beats], key=lambda row: row[0]))


def shown(code: str, own: OwnFilter | None, params: Mapping[str, float], **fields: Any) -> Finding | None:
    """Return what a check finds on a vehicle."""
    return findings_of(evidence_of([], own_filter=own, set_up=known(params), **fields)).get(code)


# Arming


@pytest.mark.parametrize(
    ("params", "healthy", "severity", "words"),
    [
        (CHECK_LEFT_OUT, False, Severity.ERROR, "ARMING_CHECK 448 leaves the vision check (bit 18) out"),
        ({**ON, "ARMING_CHECK": 0.0}, False, Severity.ERROR, "ARMING_CHECK 0 leaves"),
        ({**ON, "ARMING_SKIPCHK": -1.0}, False, Severity.ERROR, "ARMING_SKIPCHK -1 leaves"),
        ({**ON, "ARMING_SKIPCHK": 262144.0}, False, Severity.ERROR, "ARMING_SKIPCHK 262144 leaves"),
        ({**ON, "ARMING_CHECK": 1.0}, False, Severity.ERROR, "by force"),
        ({**ON, "ARMING_SKIPCHK": 0.0}, False, Severity.ERROR, "by force"),
        (ON, False, Severity.ERROR, "not in the recording"),
        (CHECK_LEFT_OUT, True, Severity.NOTE, "would arm with an unhealthy camera"),
    ],
)
def test_arming_with_an_unhealthy_camera_is_told(
    params: Mapping[str, float], healthy: bool, severity: Severity, words: str
) -> None:
    found = shown("XN7-18", armed_at(20, healthy=healthy), params)
    assert found is not None
    assert found.severity is severity
    assert words in found.evidence
    assert ("armed at 20.000 s" in found.evidence) is not healthy


@pytest.mark.parametrize(
    ("params", "healthy"),
    [({**ON, "ARMING_CHECK": 1.0}, True), ({**ON, "ARMING_CHECK": 262144.0}, True), ({"VISO_TYPE": 0.0}, False)],
)
def test_arming_in_order_is_not_told(params: Mapping[str, float], healthy: bool) -> None:
    assert shown("XN7-18", armed_at(20, healthy=healthy), params) is None


def test_a_log_shows_arming_without_messages() -> None:
    own = own_of(logged(params={**EXTNAV}, others=[(30.0, "ARM", {"ArmState": 1})]))
    for silent_s, is_told in ((0.1, False), (4.0, True)):
        messages = [seen(n + 1, round((40.0 - silent_s - (50 - n) * 0.1) * 1e6), pose(0)) for n in range(51)]
        found = findings_of(evidence_of(messages, own_filter=own, set_up=known(CHECK_LEFT_OUT)))["XN7-18"]
        assert (found.severity is Severity.ERROR) is is_told
        assert (f"no message for {silent_s:.1f} s" in found.evidence) is is_told


# The stream stops


def stopped(end_s: float, own: OwnFilter | None, params: Mapping[str, float] | None = None) -> dict[str, Finding]:
    """Return what is found of gaps in a log whose stream ends at 14 s."""
    evidence = evidence_of(stream_of([pose(0)] * 101), params, own_filter=own, lacks=frozenset({Aspect.LINK}))
    assert evidence.until_us == round(end_s * 1e6)
    found = findings_of(evidence)
    return {code: found[code] for code in ("XN4-03", "XN4-04", "XN4-05") if code in found}


@pytest.mark.parametrize(
    ("length_s", "code", "severity", "words"),
    [
        (4.4, "XN4-03", Severity.NOTE, "the sensor is unhealthy from 14.300 s on"),
        (5.9, "XN4-04", Severity.NOTE, "the sensor is unhealthy from 14.300 s on"),
        (8.0, "XN4-04", Severity.WARNING, "the sensor is unhealthy from 14.300 s on"),
        (60.0, "XN4-05", Severity.ERROR, "position times out from 21.000 s on, aiding stops from 29.000 s on"),
    ],
)
def test_silence_to_the_end_of_a_log_is_a_gap(length_s: float, code: str, severity: Severity, words: str) -> None:
    own = own_of(logged(length_s=length_s, others=[(1.0, "ARM", {"ArmState": 1})]))
    ((found, finding),) = stopped(10 + length_s, own).items()
    assert found == code
    assert words in finding.evidence
    assert f"armed for {length_s - 4:.1f} s of that" in finding.evidence
    assert finding.severity is severity


@pytest.mark.parametrize(
    ("others", "severity", "words"),
    [
        ([(1.0, "ARM", {"ArmState": 1}), (24.0, "ARM", {"ArmState": 0})], Severity.ERROR, "armed for 20.0 s of that"),
        ([(30.0, "EV", {"Id": 25})], Severity.NOTE, "disarmed"),
        ([], Severity.WARNING, "from 14.000 s on; the sensor"),
    ],
    ids=["disarmed later", "never armed", "not known"],
)
def test_silence_is_as_bad_as_the_vehicle_was_armed(others: Any, severity: Severity, words: str) -> None:
    finding = stopped(70.0, own_of(logged(others=others)))["XN4-05"]
    assert finding.severity is severity
    assert words in finding.evidence


def test_stream_may_stop_after_the_flight() -> None:
    assert stopped(70.0, own_of(logged(others=[(1.0, "ARM", {"ArmState": 1}), (3.0, "ARM", {"ArmState": 0})]))) == {}


def test_trajectory_ends_where_it_ends() -> None:
    own = own_of(logged())
    lacks = frozenset({Aspect.LINK, Aspect.RESETS})
    assert evidence_of(stream_of([pose(0)] * 10), own_filter=own, lacks=lacks).until_us == START_US + 360_000
    assert evidence_of(stream_of([pose(0)] * 10), own_filter=own).until_us == START_US + 360_000


# The origin


def place(lat: int) -> GLOBAL_POSITION_INT:
    return GLOBAL_POSITION_INT(0, lat, 0, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("said", "is_told"),
    [([place(0)], True), ([place(473977418)], False), ([place(0), text("EKF3 IMU0 origin set")], False), ([], False)],
)
def test_flight_without_an_origin_is_told(said: list[Message], is_told: bool) -> None:
    rows = [(5.0, message) for message in said]
    rows += [(float(at_s), message) for at_s in range(6, 30) for message in (heartbeat(armed=at_s > 10), report())]
    own = heard(rows)
    found = shown("XN9-18", own, ON)
    assert (found is not None) is is_told
    assert found is None or "armed for 18.0 s" in found.evidence


def test_vehicle_by_gps_needs_no_such_warning() -> None:
    own = own_of(logged(params=GPS, others=[(1.0, "ARM", {"ArmState": 1})]))
    assert shown("XN9-18", replace(own, has_origin=False), ON) is None
    assert shown("XN9-18", replace(own_of(logged()), has_origin=False, armed=()), ON) is None


# EK3_SRC_OPTIONS

_SECOND: Final = {**GPS, "EK3_SRC2_VELXY": 6, "EK3_SRC2_POSXY": 6, "EK3_SRC_OPTIONS": 1}


@pytest.mark.parametrize(
    ("params", "status", "severity"),
    [
        (_SECOND, quiet, Severity.WARNING),
        (_SECOND, during(10, 40, SV=3.0), Severity.ERROR),
        ({**_SECOND, "EK3_SRC_OPTIONS": 0}, quiet, None),
        ({**_SECOND, "EK3_SRC_OPTIONS": 2}, quiet, None),
        ({**_SECOND, "EK3_SRC1_VELXY": 6}, quiet, None),
        ({**_SECOND, "EK3_SRC2_VELXY": 0}, quiet, None),
    ],
)
def test_velocities_of_sets_that_are_not_active(
    params: Mapping[str, float], status: Any, severity: Severity | None
) -> None:
    own = own_of(logged(status, params))
    evidence = evidence_of(stream_of([speed(0)] * 50), {"EK3_SRC1_VELZ": 3, **params}, own_filter=own)
    found = findings_of(evidence).get("XN7-19")
    assert (None if found is None else found.severity) is severity
    if severity is not None and "XN7-05" in (codes := findings_of(evidence)):
        assert "EK3_SRC_OPTIONS fuses the velocities" in codes["XN7-05"].evidence


# Positions alone


def turning(count: int = 400) -> tuple[list[int], AttitudeSeries]:
    """Return times, and the attitude of a vehicle that turns."""
    times = [START_US + number * 40_000 for number in range(count)]
    yaw = np.linspace(0, 3.0, count)
    level = np.zeros(count)
    return times, AttitudeSeries(np.array(times), np.column_stack((level, level, yaw)))


@pytest.mark.parametrize("angle", [0.0, math.nan])
@pytest.mark.parametrize("kind", ["euler", "quaternion"])
def test_sender_of_positions_alone_is_in_order(angle: float, kind: str) -> None:
    times, attitude = turning()
    angles = dict.fromkeys(("roll", "pitch", "yaw"), angle)
    quat = (1.0, 0.0, 0.0, 0.0) if angle == 0 else (angle,) * 4
    messages = [
        seen(
            n + 1, time_us, pose(time_us, **angles) if kind == "euler" else ATT_POS_MOCAP(time_us, quat, 0.0, 0.0, 0.0)
        )
        for n, time_us in enumerate(times)
    ]
    of_attitude = {"XN2-02", "XN2-06", "XN2-10", "XN5-02", "XN5-05", "XN8-04", "XN8-05", "XN8-10"}
    found = findings_of(evidence_of(messages, HELD, attitude))
    assert {code: found[code].severity for code in of_attitude & set(found)} == (
        {} if angle == 0 else {"XN5-02": Severity.NOTE}
    )
    used = findings_of(evidence_of(messages, {**HELD, "EK3_SRC1_YAW": 6}, attitude))
    assert ("XN8-10" if angle == 0 else "XN5-02") in used


# Height


def _with_outcomes(kinds: tuple[str, ...]) -> dict[str, Any]:
    tests = [SampleTest(0, FilterOutcome(kind, FUSED, 0, None, None)) for kind in kinds]
    return {"samples": (HandedSample("pose", 0, tests),)}


@pytest.mark.parametrize(("every", "is_told"), [(1, False), (2, False), (10, True), (100, True)])
def test_height_that_the_barometer_gives_is_told(every: int, is_told: bool) -> None:
    own = own_of(logged(params={**EXTNAV, "EK3_SRC1_POSZ": 6}))
    messages = [
        seen(
            n + 1, START_US + n * 40_000, pose(0), **_with_outcomes(("pose", "height") if n % every == 0 else ("pose",))
        )
        for n in range(100)
    ]
    evidence = evidence_of(messages, {"EK3_SRC1_POSZ": 6}, own_filter=own)
    assert ("XN9-07" in findings_of(evidence)) is is_told
    assert ("(barometer, by the model" in " ".join(summary_lines(summarise(evidence)))) is is_told
    assert "XN9-07" not in findings_of(changed(evidence, params={**evidence.trial.params, "EK3_SRC1_POSZ": 1}))
