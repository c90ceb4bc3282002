# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Jumps of the vehicle's own estimate, its origin, a GPS beside external navigation, and deltas of zero."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ap_core.dataflash_columns import LogColumns
from ap_core.log_structure import ARM
from ekf_stub.log.ekf_log_structure import XKF1, XKFD, XKFS
from mav_handlers.wire.messages import SET_GPS_GLOBAL_ORIGIN, VISION_POSITION_DELTA
from tests.places import ROOT
from tests.unit.viso.doctor.evidences import START_US, evidence_of, findings_of, pose, seen, stream_of
from tests.unit.viso.doctor.own_filters import EXTNAV, GPS, logged
from tests.unit.viso.report.log_maker import LogMaker
from viso.doctor import Evidence, Finding, Severity, diagnose, gather
from viso.doctor.checks import CHECKS
from viso.doctor.checks.alignment import alignment_advice
from viso.doctor.checks.causes import probable_cause
from viso.doctor.evidence.estimate import NO_FIXES, Fixes, Origin, moves_in, moves_of, odometry_in
from viso.doctor.evidence.own_log import own_filter_in
from viso.doctor.evidence.vehicle_data import HeightSeries, VehicleData
from viso.firmware.flown import JudgedBy
from viso.firmware.releases import PROFILES
from viso.logs.filter_records import filter_records_in
from viso.streams.stream_kinds import read_stream

STRANGER = ROOT / "tests" / "data" / "strangers" / "origin_doubles_height.jsonl.gz"
Place = Callable[[float], dict[str, float]]
FLOW = {**EXTNAV, "EK3_SRC2_POSXY": 0, "EK3_SRC2_VELXY": 5, "EK3_SRC2_POSZ": 1, "EK3_SRC2_YAW": 1}


def flown(
    place: Place,
    params: dict[str, float],
    switches: Sequence[tuple[float, int]] = (),
    texts: Sequence[tuple[float, str]] = (),
    armed_s: float | None = 15.0,
    **fields: Any,
) -> list[Finding]:
    """Return what a flight shows whose estimate is at some places; times are in s since boot."""
    others = [(time_s - 10.0, "MSG", {"Message": text}) for time_s, text in texts]
    maker = logged(params=params, length_s=40.0, others=others)
    for time_s, number in switches:
        maker.add_to(XKFS, time_s, SS=number)
    if armed_s is not None:
        maker.add_to(ARM, armed_s, ArmState=1)
    for number in range(400):
        maker.add_to(XKF1, 10.0 + 0.1 * number, **place(10.0 + 0.1 * number))
    log = LogColumns(maker.data)
    vehicle = VehicleData(own_filter=own_filter_in(log), moves=moves_in(filter_records_in(log)))
    evidence = evidence_of([], params, vehicle=vehicle, **fields)
    return [one for one in diagnose(evidence, CHECKS) if one.code == "XN9-31"]


def step(**fields: float) -> Place:
    """Return places that move by something at 30 s."""
    return lambda time_s: {name: value if time_s >= 30.0 else 0.0 for name, value in fields.items()}


def test_jump_at_a_switch_of_sources_names_both_and_how_far() -> None:
    (found,) = flown(step(PN=-2.0), FLOW, switches=[(10.0, 1), (29.95, 0)])
    assert found.severity is Severity.ERROR
    assert (
        "at 30.000 s, armed, the estimate moved by 2.0 m horizontally, from (0.0, 0.0) to (-2.0, 0.0)" in found.evidence
    )
    assert "from velocity by optical flow to position by ExtNav" in found.evidence
    assert "EK3_SRC_OPTIONS 2" in found.fix


def test_jump_by_a_gps_that_returns_names_it() -> None:
    (found,) = flown(step(PN=300.0), {**GPS, "EK3_SRC2_POSXY": 6})
    assert found.evidence.endswith("by a reset to the GPS, which it had rejected or missed for 7 s")
    assert "300.0 m" in found.evidence


@pytest.mark.parametrize(("place", "text", "words", "fix"), [
    (step(PD=-5.0), "EKF3 IMU0 is using external nav data", ["5.0 m in height, from 0.0 to 5.0 m", "aiding started"],
     "Up to 4.7"),
    (step(PN=4.0), "EKF3 IMU0 is using external nav data", ["4.0 m horizontally", "is using external nav data"],
     "before take-off"),
    (step(Yaw=90.0), "EKF3 IMU0 emergency yaw reset", ["90 deg in yaw, from 0 to 90 deg", "emergency yaw reset"],
     "which yaw was right"),
    (step(Yaw=320.0), "EKF3 IMU0 MAG0 in-flight yaw alignment complete", ["40 deg in yaw", "in-flight"], "which yaw"),
    (step(PN=3.0), "EKF3 IMU0 stopped aiding", ["stopped aiding"], "Keep the stream alive"),
    (step(PD=3.0), "Field Elevation Set: 600m", ["as the origin was set"], "XN7-31"),
])  # fmt: skip
def test_jump_names_what_made_it(place: Place, text: str, words: list[str], fix: str) -> None:
    (found,) = flown(place, dict(EXTNAV), texts=[(30.02, text)])
    assert all(word in found.evidence for word in words)
    assert fix in found.fix


def test_jump_on_the_ground_is_a_note() -> None:
    (found,) = flown(step(PN=3.0), dict(EXTNAV), texts=[(30.02, "EKF3 IMU0 is using external nav data")], armed_s=None)
    assert found.severity is Severity.NOTE
    assert "disarmed" in found.evidence


@pytest.mark.parametrize(
    "place",
    [
        lambda time_s: {"PN": 8.0 * time_s, "VN": 8.0},
        lambda time_s: {"PN": 0.3 if time_s >= 30 else 0.0},
        lambda time_s: {"PE": 0.001 * round(time_s)},
        lambda time_s: {"Yaw": (90.0 * time_s) % 360},
    ],
)
def test_motion_and_corrections_are_no_jumps(place: Place) -> None:
    assert flown(place, dict(EXTNAV)) == []


def test_flight_without_external_navigation_is_left_alone() -> None:
    assert flown(step(PN=30.0), dict(GPS), trial=evidence_of([], {"VISO_TYPE": 0, **GPS}).trial) == []


def test_times_that_step_back_are_no_jump() -> None:
    times = np.array([10, 11, 5, 6], np.int64) * 100_000
    places = np.array([[0, 0, 0], [0, 0, 0], [50, 0, 0], [50, 0, 0]], np.float64)
    assert moves_of(times, places, np.zeros((4, 3)), np.zeros(4)) == ()


# The origin


def before_origin(z: float, texts: Sequence[tuple[int, int, str]] = (), **params: float) -> Evidence:
    """Return evidence of poses at a height, while whose origin is set 5 s after they begin."""
    messages = stream_of([pose(40_000 * number, z=z) for number in range(200)])
    said = texts or ((START_US + 5_000_000, 6, "EKF3 IMU0 origin set"),)
    vehicle = VehicleData(texts=tuple(said))
    return evidence_of(messages, {"EK3_SRC1_POSZ": 6, **params}, vehicle=vehicle)


@pytest.mark.parametrize(("z", "severity"), [(-3.0, Severity.ERROR), (2.0, Severity.ERROR), (-0.3, Severity.WARNING)])
def test_origin_that_is_set_at_a_height_is_named(z: float, severity: Severity) -> None:
    found = findings_of(before_origin(z))["XN7-31"]
    assert found.severity is severity
    assert f"z was {z:.1f} m" in found.evidence
    assert "before the first pose" in found.fix


@pytest.mark.parametrize("evidence", [
    before_origin(0.05), before_origin(-3.0, EK3_SRC1_POSZ=1), before_origin(-3.0, VISO_TYPE=0),
    before_origin(-3.0, [(START_US - 1_000_000, 6, "EKF3 IMU0 origin set")]), before_origin(-3.0, [(0, 6, "other")]),
])  # fmt: skip
def test_origin_at_zero_or_before_the_poses_or_with_another_height_is_fine(evidence: Evidence) -> None:
    assert "XN7-31" not in findings_of(evidence)


@pytest.mark.parametrize("release", ["4.6", "2025-07", "4.7"])
def test_recorded_origin_that_doubles_the_height_is_the_cause(release: str) -> None:
    evidence = gather(read_stream(STRANGER, 0), firmware=PROFILES[release])
    findings = diagnose(evidence, CHECKS)
    found = next(one for one in findings if one.code == "XN7-31")
    assert found is findings[0]
    assert "z was -3.0 m" in found.evidence
    assert "from 3.0 to 6.0 m" in found.evidence
    cause = probable_cause(findings)
    assert cause is None or cause.finding is found
    assert not any("See the findings" in one.fix for one in findings)


def gps_origin(*, is_of_gps: bool = True, asked_us: int | None = None, **params: float) -> tuple[Evidence, VehicleData]:
    messages = stream_of([pose(40_000 * number) for number in range(200)])
    if asked_us is not None:
        messages.append(seen(999, asked_us, SET_GPS_GLOBAL_ORIGIN(1, -353632621, 1491652374, 584000, 0)))
    vehicle = VehicleData(origin=Origin(START_US, -35.36, 149.16, 584.0, is_of_gps))
    return evidence_of(messages, params, vehicle=vehicle), vehicle


def test_origin_of_a_gps_that_no_source_names_is_named_with_what_it_refuses() -> None:
    evidence, _ = gps_origin(asked_us=START_US + 9_000_000)
    found = findings_of(evidence)["XN7-32"]
    assert found.severity is Severity.WARNING
    assert "came too late and changed nothing" in found.evidence
    assert "GPS1_TYPE 0" in found.fix


@pytest.mark.parametrize(("fields", "is_found"), [
    ({}, True), ({"is_of_gps": False}, False), ({"asked_us": START_US - 1}, False), ({"EK3_SRC2_POSXY": 3}, False),
])  # fmt: skip
def test_origin_of_a_gps_matters_only_where_no_source_names_it(fields: dict[str, Any], is_found: bool) -> None:
    assert ("XN7-32" in findings_of(gps_origin(**fields)[0])) is is_found


@pytest.mark.parametrize(("release", "accuracy_m", "severity"), [
    ("4.6", 2.5, Severity.WARNING), ("4.6", 0.1, Severity.NOTE), ("4.7", 2.5, None),
])  # fmt: skip
def test_accuracies_of_a_gps_count_for_external_navigation_on_4_6(
    release: str, accuracy_m: float, severity: Severity | None
) -> None:
    times = START_US + np.arange(30, dtype=np.int64) * 200_000
    fixes = Fixes(times, np.zeros((30, 2)), np.full(30, accuracy_m))
    messages = stream_of([pose(40_000 * number) for number in range(200)])
    judged_by = JudgedBy(PROFILES[release], "a test says so")
    evidence = evidence_of(messages, vehicle=VehicleData(fixes=fixes), judged_by=judged_by)
    found = findings_of(evidence).get("XN7-33")
    assert (None if found is None else found.severity) is severity
    assert "XN7-33" not in findings_of(evidence_of(messages, vehicle=VehicleData(fixes=NO_FIXES), judged_by=judged_by))


# Sources of a set


def test_set_that_was_in_use_is_not_called_inactive() -> None:
    params = {
        **GPS,
        "EK3_SRC2_POSXY": 6,
        "EK3_SRC2_POSZ": 1,
        "EK3_SRC2_VELXY": 6,
        "EK3_SRC2_VELZ": 0,
        "EK3_SRC2_YAW": 1,
    }
    messages = stream_of([pose(40_000 * number) for number in range(200)])

    def found(switches: Sequence[tuple[float, int]]) -> bool:
        maker: LogMaker = logged(params=params)
        for time_s, number in switches:
            maker.add_to(XKFS, time_s, SS=number)
        own = own_filter_in(LogColumns(maker.data))
        return "XN7-05" in findings_of(evidence_of(messages, params, own_filter=own))

    assert found([(10.0, 0)])
    assert not found([(10.0, 0), (30.0, 1)])
    assert not found([(10.0, 1)])
    assert "XN7-05" in findings_of(evidence_of(messages, params))


@pytest.mark.parametrize(("params", "severity", "words"), [
    ({"VISO_TYPE": 1, "EK3_SRC2_VELXY": 5}, Severity.NOTE, "set 2 from another source"),
    ({"VISO_TYPE": 1, "EK3_SRC1_POSXY": 3, "EK3_SRC2_POSXY": 6}, Severity.NOTE, "set 1 from another source"),
    ({"VISO_TYPE": 3, "EK3_SRC2_VELXY": 5}, Severity.NOTE, "EK3_SRC_OPTIONS is 0"),
    ({"VISO_TYPE": 3, "EK3_SRC2_VELXY": 5, "EK3_SRC_OPTIONS": 2}, None, ""),
    ({"VISO_TYPE": 3, "EK3_SRC1_POSXY": 3, "EK3_SRC2_POSXY": 6}, None, ""),
    ({"VISO_TYPE": 1}, None, ""),
])  # fmt: skip
def test_switch_of_sources_that_will_jump(params: dict[str, float], severity: Severity | None, words: str) -> None:
    messages = stream_of([pose(40_000 * number) for number in range(200)])
    off = {"EK3_SRC2_POSXY": 0, "EK3_SRC2_VELXY": 0, "EK3_SRC1_VELXY": 0, "EK3_SRC2_POSZ": 0}
    evidence = evidence_of(messages, {**off, **params}, judged_by=JudgedBy(PROFILES["4.6"], "a test says so"))
    found = findings_of(evidence).get("XN8-07")
    assert (None if found is None else found.severity) is severity
    assert found is None or words in found.evidence


@pytest.mark.parametrize(("release", "options", "words"), [
    ("4.6", 1, "EK3_SRC_OPTIONS 3"),
    ("2025-07", 0, "EK3_SRC_OPTIONS 2"),
    ("4.7", 0, "in no VISO_TYPE"),
])  # fmt: skip
def test_remedy_of_a_jump_from_flow_is_that_of_the_release(release: str, options: int, words: str) -> None:
    params = {"VISO_TYPE": 3, "EK3_SRC2_POSXY": 0, "EK3_SRC2_VELXY": 5, "EK3_SRC_OPTIONS": options}
    messages = stream_of([pose(40_000 * number) for number in range(200)])
    evidence = evidence_of(messages, params, judged_by=JudgedBy(PROFILES[release], ""))
    advice = alignment_advice(evidence)
    assert words in advice
    assert ("take VELXY 6" in advice) == (release == "4.6")
    assert (findings_of(evidence)["XN8-07"].fix == advice) == (release != "4.7")


@pytest.mark.parametrize(("release", "params", "is_found"), [
    ("4.6", {}, True),
    ("2025-07", {}, False),
    ("4.6", {"VISO_TYPE": 1}, False),
    ("4.6", {"EK3_SRC_OPTIONS": 1}, False),
    ("4.6", {"EK3_SRC1_VELXY": 6}, False),
])  # fmt: skip
def test_source_in_use_is_moved_along_up_to_4_6(release: str, params: dict[str, float], is_found: bool) -> None:
    params = {"VISO_TYPE": 2, "EK3_SRC1_VELXY": 5, "EK3_SRC_OPTIONS": 2, **params}
    messages = stream_of([pose(40_000 * number) for number in range(200)])
    found = findings_of(evidence_of(messages, params, judged_by=JudgedBy(PROFILES[release], "")))
    assert ("XN7-20" in found) == is_found


# Deltas


def deltas(*parts: tuple[float, float, float], confidence: float = 100.0, sinks_m_s: float = 0.0) -> Evidence:
    messages = [
        VISION_POSITION_DELTA(100_000 * i, 100_000, (0.0,) * 3, parts[i % len(parts)], confidence) for i in range(100)
    ]
    times = START_US + np.arange(100, dtype=np.int64) * 100_000
    height = HeightSeries(times, sinks_m_s * 0.1 * np.arange(100, dtype=np.float64))
    return evidence_of(stream_of(messages, 100_000), vehicle=VehicleData(height=height))


def test_zero_deltas_while_the_vehicle_moves_are_an_error() -> None:
    found = findings_of(deltas((0.0, 0.0, 0.0), sinks_m_s=0.5))["XN9-32"]
    assert found.severity is Severity.ERROR
    assert "at 0.5 m/s" in found.evidence
    assert "confidence 0" in found.fix


def test_innovations_of_the_filter_show_that_the_vehicle_moves() -> None:
    maker = logged(length_s=10.0)
    for number in range(100):
        maker.add_to(XKFD, 10.0 + 0.1 * number, IX=0.3, IZ=0.4)
    odometry = odometry_in(LogColumns(maker.data))
    assert odometry.shape == (100, 2)
    at_rest = deltas((0.0, 0.0, 0.0))
    moving = replace(at_rest, vehicle=replace(at_rest.vehicle, odometry=odometry))
    assert "at 0.5 m/s" in findings_of(moving)["XN9-32"].evidence


def test_zero_deltas_at_rest_are_a_warning_and_others_are_none() -> None:
    assert findings_of(deltas((0.0, 0.0, 0.0)))["XN9-32"].severity is Severity.WARNING
    assert "XN9-32" not in findings_of(deltas((0.0, 0.0, 0.0), confidence=0.0, sinks_m_s=0.5))
    assert "XN9-32" not in findings_of(deltas((0.01, 0.0, 0.02), (0.0, 0.0, 0.01), sinks_m_s=0.5))


def test_vertical_deltas_are_used_whatever_velz_is() -> None:
    messages = [VISION_POSITION_DELTA(100_000 * i, 100_000, (0.0,) * 3, (0.01, 0.0, 0.0), 90.0) for i in range(100)]
    found = findings_of(evidence_of(stream_of(messages, 100_000), {"EK3_SRC1_VELZ": 0}))["XN9-33"]
    assert "z is exactly 0 in 100 of 100" in found.evidence
    assert "XN9-33" not in findings_of(evidence_of(stream_of(messages, 100_000), {"EK3_SRC1_VELZ": 6}))
