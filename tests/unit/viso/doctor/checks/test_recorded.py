# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter of the recorded vehicle said is found, whatever the model thinks; clean records show nothing."""

import json
import lzma
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from ap_core.dataflash_columns import LogColumns
from ekf_stub.inputs.ingest_rules import FUSED, GATE_POSITION
from ekf_stub.log.ekf_log_structure import XKFS
from ekf_stub.reports import AidingMode
from tests.places import RECORDED
from tests.unit.viso.command_line import Viso
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.checks.test_outcome import message
from tests.unit.viso.doctor.evidences import START_US, evidence_of, pose, seen, stream_of
from tests.unit.viso.doctor.own_filters import (
    EXTNAV,
    GPS,
    QUIET,
    during,
    heard,
    heartbeat,
    logged,
    own_of,
    report,
    sys_status,
    text,
)
from tests.unit.viso.report.log_maker import LOST, LogMaker
from viso.doctor import CHECKS, Finding, Severity, diagnose
from viso.doctor.evidence.own_filter import NOT_KNOWN, OwnFilter, Witness
from viso.doctor.evidence.own_log import own_filter_in
from viso.doctor.evidence.vehicle_position import PositionSeries
from viso.doctor.output.summary import summarise
from viso.doctor.output.terminal import summary_lines
from viso.logs.recorded import read_columns
from viso.vehicle.outcomes import AidingSpan

LEVEL: Final = (1.0, 0.0, 0.0, 0.0)
TURNED: Final = (math.cos(0.35), 0.0, 0.0, math.sin(0.35))
OURS: Final = frozenset(f"XN9-{number}" for number in range(10, 18))
CHECKS_OF_RECORD: Final = [check for check in CHECKS if check.code in OURS]


def found_in(own: OwnFilter | None) -> list[Finding]:
    """Return what a record of a filter shows."""
    return diagnose(evidence_of([], own_filter=own), CHECKS_OF_RECORD)


def wandering(time_s: float) -> dict[str, Any]:
    """Return yaw that fails for five of six seconds, worst at 31 s."""
    return {"SM": 5.1 if time_s == 31.0 else 2.5} if time_s % 6 >= 1 else {}


@dataclass(frozen=True, slots=True)
class Planted:
    """A log with something in it: what has to be found, how bad it is, and words of it."""

    name: str
    make: Callable[[], LogMaker]
    code: str
    severity: Severity
    words: tuple[str, ...]


def _switched() -> LogMaker:
    params = {**GPS, "EK3_SRC2_POSXY": 6, "EK3_SRC2_VELXY": 6, "EK3_SRC2_POSZ": 1, "EK3_SRC2_YAW": 6}
    events = [(20.0, "EV", {"Id": 86}), (40.0, "EV", {"Id": 85})]
    return logged(during(25, 35, SP=2.0), params, others=events)


def _set_by_record() -> LogMaker:
    maker = logged(during(25, 35, SM=1.5), {**GPS, "EK3_SRC2_YAW": 6})
    for time_s, number in ((10.0, 0), (30.0, 1), (50.0, 0)):
        maker.add_to(XKFS, time_s, SS=number)
    return maker


def _changed_parameter() -> LogMaker:
    maker = logged(during(35, 45, SM=1.5), {**GPS})
    maker.parameter("EK3_SRC1_YAW", 6, time_s=40.0)
    return maker


def _ekf2(
    layout: str = "TimeUS,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS,GPS,PI", form: str = "QcccccfffHBHHb"
) -> LogMaker:
    maker = LogMaker()
    maker.parameter("COMPASS_USE", 0)
    maker.add("MSG", 9.0, Message="EKF2 IMU0 is using external nav data")
    kind = maker.define("NKF4", layout, form)
    for number in range(600):
        values = {label: value for label, value in QUIET.items() if label in kind.fields}
        maker.add_to(kind, 10 + number * 0.1, **{**values, "SM": 3.0 if number > 300 else 0.1})
    return maker


def _of_36() -> LogMaker:
    maker = LogMaker()
    maker.parameter("AHRS_EKF_TYPE", 3)
    kind = maker.define("XKF4", "TimeUS,SV,SP,SH,SM,SVT,errRP,OFN,OFE,FS,TS,SS", "QcccccfffHBH")
    for number in range(300):
        maker.add_to(kind, 10 + number * 0.1, SV=0.1, SP=0.1, SH=1.5 if number > 200 else 0.1, SM=0.1, SS=0x33F)
    return maker


E, W, N = Severity.ERROR, Severity.WARNING, Severity.NOTE
ARM = [(5.0, "ARM", {"ArmState": 1}), (55.0, "ARM", {"ArmState": 0})]
FAILSAFE = [(30.0, "ERR", {"Subsys": 16, "ECode": 2}), (30.0, "ERR", {"Subsys": 17, "ECode": 1})]
LANES = {1: lambda t: {"PI": int(20 <= t < 57)}}
PLANTED: Final = (
    Planted(
        *("yaw wanders", lambda: logged(wandering), "XN9-10", E),
        ("yaw test ratio (XKF4.SM, yaw from ExtNav) was above 1 for 83 % of 60 s", "worst 5.1 at 41.000 s"),
    ),
    Planted(
        *("compass wanders", lambda: logged(wandering, {**EXTNAV, "EK3_SRC1_YAW": 1}), "XN9-11", W),
        ("(XKF4.SM, yaw from compass) was above 1 for 83 %",),
    ),
    Planted(
        "one excursion",
        lambda: logged(during(20, 20.15, SP=1.3)),
        "XN9-10",
        N,
        ("position from ExtNav", "above 1 for 0.2 s of 60 s"),
    ),
    Planted("1.5 s", lambda: logged(during(20, 21.5, SP=1.3)), "XN9-10", W, ("worst 1.3",)),
    Planted(
        *("armed", lambda: logged(during(50, 59.9, SP=2.0), others=ARM), "XN9-10", E),
        ("5.0 s of that armed", "position test ratio"),
    ),
    Planted(
        *("height", lambda: logged(during(10, 30, SH=2.0), {**EXTNAV, "EK3_SRC1_POSZ": 6}), "XN9-10", E),
        ("height from ExtNav",),
    ),
    Planted("barometer", lambda: logged(during(10, 30, SH=2.0)), "XN9-11", W, ("height from barometer",)),
    Planted(
        *("vertical velocity", lambda: logged(during(10, 30, SV=2.0), {**GPS, "EK3_SRC1_VELZ": 6}), "XN9-10", E),
        ("velocity test ratio",),
    ),
    Planted("GPS", lambda: logged(during(10, 30, SP=2.0), GPS), "XN9-11", W, ("position from GPS",)),
    Planted("after a switch", _switched, "XN9-10", E, ("above 1 for 50 % of 20 s", "position from ExtNav")),
    Planted("set told by XKFS", _set_by_record, "XN9-10", E, ("above 1 for 50 % of 20 s", "yaw from ExtNav")),
    Planted("source changed in flight", _changed_parameter, "XN9-10", E, ("above 1 for 33 % of 30 s",)),
    Planted("EKF2", _ekf2, "XN9-10", E, ("(NKF4.SM, yaw from ExtNav) was above 1 for 50 %",)),
    Planted("a log of 3.6", _of_36, "XN9-11", W, ("height from an unknown source", "33 % of 30 s")),
    Planted("no parameters", lambda: logged(during(10, 30, SP=2.0), {}), "XN9-11", W, ("from an unknown source",)),
    Planted(
        *("failsafe", lambda: logged(others=FAILSAFE), "XN9-13", E),
        ('"EKF check: bad variance" once and "EKF failsafe: occurred" once, first at 40.000 s',),
    ),
    Planted("failsafe of a GPS flight", lambda: logged(params=GPS, others=FAILSAFE), "XN9-13", W, ("EKF failsafe",)),
    Planted(
        *("lane change", lambda: logged(lambda t: {"PI": int(20 <= t < 57)}, others=ARM, cores=LANES), "XN9-14", W),
        ("changed its primary core once, at 30.000 s to core 1",),
    ),
    Planted(
        *("a core that is not flown with", lambda: logged(cores={1: during(20, 30, SV=4.0)}), "XN9-14", N),
        ("core 1, while it was not the primary one, had a test ratio above 1 for 10.0 s", "worst 4.0"),
    ),
    Planted("never used", lambda: logged(lambda _: {"SS": LOST}), "XN9-15", E, ("in 60 s it never had either (XKF4)",)),
    Planted("too short to tell", lambda: logged(lambda _: {"SS": LOST}, length_s=5), "XN9-15", N, ("in 5 s",)),
    Planted(
        *("lost in flight", lambda: logged(during(20, 25, SS=LOST), others=ARM), "XN9-16", E),
        ("without horizontal position for 5.0 s, armed, first at 30.000 s",),
    ),
    Planted("lost on the ground", lambda: logged(during(20, 25, SS=LOST)), "XN9-16", W, ("for 5.0 s, first at",)),
    Planted(
        *("velocity times out", lambda: logged(during(20, 25, TS=0x32)), "XN9-16", W),
        ("without velocity (a timeout in TS) for 5.0 s",),
    ),
    Planted(
        "stops aiding over and over",
        lambda: logged(others=[(20.0 + n, "MSG", {"Message": "EKF3 IMU0 stopped aiding"}) for n in range(4)]),
        "XN9-16",
        E,
        ('said "stopped aiding" 4 times',),
    ),
    Planted(
        *("opens armed", lambda: logged(during(1, 4, SP=2.0), others=[(5.0, "ARM", {"ArmState": 0})]), "XN9-10", W),
        ("above 1 for 5 % of 60 s, armed",),
    ),
)


@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.name)
def test_what_the_filter_of_a_log_said_is_found(planted: Planted) -> None:
    findings = found_in(own_of(planted.make()))
    assert [(one.code, one.severity, one.witness) for one in findings] == [
        (planted.code, planted.severity, Witness.LOG)
    ]
    assert not [words for words in planted.words if words not in findings[0].evidence], findings[0].evidence


@pytest.mark.parametrize("params", [EXTNAV, GPS, {}])
def test_filter_that_is_content_shows_nothing(params: dict[str, float]) -> None:
    assert not found_in(own_of(logged(params=params, others=ARM)))


def test_how_far_a_channel_was_off_is_told_beside_its_ratio() -> None:
    maker = logged(during(20, 30, SM=2.0, SP=3.0))
    for time_s, yaw_deg, north_m, east_m in ((25.0, 100.0, 0.0, 0.0), (35.0, -88.0, 3.0, 4.0), (45.0, 99.0, 9.0, 9.0)):
        maker.add("XKF3", time_s, IYAW=yaw_deg, IPN=north_m, IPE=east_m)
    told = {one.evidence.rpartition("; ")[2] for one in found_in(own_of(maker))}
    assert told == {"yaw was up to 88 deg off", "position was up to 5 m off"}


def test_vehicle_whose_filter_lost_itself_is_no_measure_of_attitude() -> None:
    own = own_of(logged(during(20, 30, SH=2.0)))
    assert own.lost_itself(np.array([0, 29_900_000, 35_000_000, 45_000_000])).tolist() == [False, False, True, False]
    by_extnav = own_of(logged(during(20, 30, SH=2.0), {**EXTNAV, "EK3_SRC1_POSZ": 6}))
    assert not by_extnav.lost_itself(np.array([35_000_000])).any()


@pytest.mark.parametrize(
    ("make", "viso_type", "found"),
    [
        (None, 2, {"XN6-01", "XN6-02"}),
        (lambda: logged(params=EXTNAV), 2, {"XN6-01", "XN6-02"}),
        (lambda: logged(params=GPS), 1, {"XN6-01", "XN6-02"}),
        (lambda: logged(params=GPS), 2, {"XN6-02"}),
        (lambda: logged(params=GPS, others=[(2.0, "MSG", {"Message": "VisOdom: yaw shifted 40 to 0 deg"})]), 2, set()),
    ],
)
def test_jumps_of_logged_poses_where_the_autopilot_aligned_them_are_its_own(
    make: Callable[[], LogMaker] | None, viso_type: int, found: set[str]
) -> None:
    poses = [
        odometry(1 + number * 40_000, x=4.0 * (number >= 50), q=TURNED if number >= 50 else LEVEL)
        for number in range(100)
    ]
    own = None if make is None else own_of(make())
    findings = diagnose(evidence_of(stream_of(poses), {"VISO_TYPE": viso_type}, own_filter=own), CHECKS)
    assert {one.code for one in findings if one.code in ("XN6-01", "XN6-02")} == found


@pytest.mark.parametrize(("params", "viso_type", "found"), [(GPS, 1, True), (GPS, 2, False), (EXTNAV, 2, True)])
def test_logged_positions_that_the_autopilot_moved_are_held_against_nothing(
    params: dict[str, float], viso_type: int, found: bool
) -> None:
    moved = [odometry(1 + number * 40_000, x=4.0 * (number >= 500)) for number in range(1000)]
    times_us = np.arange(10_000_000, 60_000_000, 100_000)
    stands = PositionSeries("SIM", times_us, np.zeros((len(times_us), 3)), 0.05)
    own = own_of(logged(params=params))
    findings = diagnose(
        evidence_of(stream_of(moved), {"VISO_TYPE": viso_type}, own_filter=own, position=stands), CHECKS
    )
    assert any(one.code == "XN8-12" for one in findings) is found


def test_log_without_records_of_the_filter_says_so() -> None:
    maker = LogMaker()
    maker.add("MSG", 1.0, Message="ArduCopter V4.7.0-dev (00000000)")
    (finding,) = found_in(own_of(maker))
    assert (finding.code, finding.severity) == ("XN9-17", Severity.NOTE)
    assert finding.evidence == "the recording holds no XKF4"
    assert not found_in(None)  # of what no vehicle has left anything


def test_log_that_is_written_while_armed_only_is_armed() -> None:
    assert own_of(logged(params={"LOG_DISARMED": 0})).armed == ((1, 70),)
    events = [(time_s, "EV", {"Id": event}) for time_s, event in ((1.0, 10), (4.0, 11), (6.0, 10))]
    assert own_of(logged(others=events)).armed == ((11, 14), (16, 70))
    assert own_of(logged(others=[(1.0, "EV", {"Id": 62})])).armed == ()
    assert own_of(logged()).armed is None


def test_gap_of_a_log_counts_for_nothing() -> None:
    maker = LogMaker()
    for name, value in EXTNAV.items():
        maker.parameter(name, value)
    for time_s in (*np.arange(10, 12, 0.1), *np.arange(100, 102, 0.1)):
        maker.add("XKF4", time_s, **{**QUIET, "SP": 2.0})
    (finding,) = found_in(own_of(maker))
    assert "above 1 for 100 % of 4 s" in finding.evidence


# Telemetry

SECONDS = [float(number) for number in range(60)]


def test_ratios_of_telemetry_are_found() -> None:
    own = heard([(time_s, report(compass_variance=4.0 if time_s > 20 else 0.1)) for time_s in SECONDS])
    (first, *rest) = found_in(own)
    assert (first.code, first.severity, first.witness) == ("XN9-10", Severity.ERROR, Witness.TELEMETRY)
    assert "(EKF_STATUS_REPORT.compass_variance, yaw from ExtNav) was above 1 for 64 % of 59 s" in first.evidence
    assert [one.evidence for one in rest] == ["the recording holds no SYS_STATUS"]


def vision_findings(messages: list[tuple[float, Any]]) -> list[tuple[Severity, str]]:
    return [(one.severity, one.evidence) for one in found_in(heard(messages)) if one.code == "XN9-12"]


def test_vision_sensor_that_is_never_healthy_is_an_error() -> None:
    ((severity, told),) = vision_findings([(time_s, sys_status(healthy=False)) for time_s in SECONDS])
    assert severity is Severity.ERROR
    assert told == "SYS_STATUS: the vision sensor is enabled, and healthy in none of 60 messages"


def test_vision_sensor_that_is_ill_at_times_is_told_by_how_long() -> None:
    def from_to(start: float, end: float) -> list[tuple[float, Any]]:
        return [(time_s, sys_status(healthy=not start <= time_s < end)) for time_s in SECONDS]

    assert not vision_findings(from_to(99, 99))
    assert vision_findings(from_to(0, 5)) == [
        (Severity.NOTE, "SYS_STATUS: the vision sensor is unhealthy until 5.000 s, and healthy from then on")
    ]
    ((severity, told),) = vision_findings(from_to(20, 23))
    assert (severity, told.rpartition(": ")[2]) == (
        Severity.WARNING,
        "once healthy, the vision sensor is unhealthy in 3 of 60 (5 %) messages, first at 20.000 s",
    )
    armed = [(10.0, heartbeat(armed=True)), *from_to(20, 30)]
    ((severity, told),) = vision_findings(sorted(armed, key=lambda timed: timed[0]))
    assert severity is Severity.ERROR
    assert "10 of them armed" in told


def test_sensor_that_is_not_enabled_is_not_called_ill() -> None:
    assert not vision_findings([(time_s, sys_status(healthy=False, enabled=False)) for time_s in SECONDS])


@pytest.mark.parametrize("sender", [(1, 191), (255, 190), (2, 1)])
def test_others_than_the_vehicle_are_no_witness(sender: tuple[int, int]) -> None:
    bad = [(time_s, one) for time_s in SECONDS for one in (sys_status(healthy=False), report(pos_horiz_variance=9.0))]
    assert [one.code for one in found_in(heard(bad, sender=sender))] == ["XN9-17"]


def test_texts_of_telemetry_are_found() -> None:
    said = [
        *(text("EKF3 IMU0 is using external nav data"), text("EKF variance"), text("EKF Failsafe: Land")),
        *(text("EKF Failsafe Cleared"), heartbeat(armed=True), text("EKF primary changed:1")),
    ]
    own = heard([(1.0 + number, one) for number, one in enumerate(said)], {})
    found = {one.code: one for one in found_in(own)}
    assert found["XN9-13"].severity is Severity.ERROR
    assert '"EKF variance" once and "EKF Failsafe: Land" once' in found["XN9-13"].evidence
    assert found["XN9-14"].evidence.endswith("at 6.000 s to core 1")


def test_text_tells_the_source_where_no_parameter_does() -> None:
    said = [(5.0, text("EKF3 IMU0 is using external nav data", 6)), (20.0, text("EKF3 IMU0 stopped aiding"))]
    rows = [(time_s, report(pos_horiz_variance=2.0 if 8 <= time_s < 15 else 0.1)) for time_s in SECONDS]
    own = heard(sorted([*said, *rows], key=lambda timed: timed[0]), {})
    assert own is not None
    assert set(own.sources[:, 0].tolist()) == {NOT_KNOWN, 6}
    found = {one.code: one.evidence for one in found_in(own)}
    assert "position from ExtNav) was above 1 for 47 % of 15 s" in found["XN9-10"]


# What the model says against it


def test_model_yields_to_the_vehicle_s_own_filter() -> None:
    own = own_of(logged())
    messages = [message(number, GATE_POSITION if 20 <= number < 60 else FUSED) for number in range(100)]
    never = (AidingSpan(0, 70_000_000, AidingMode.NONE),)
    stops = (AidingSpan(0, 30_000_000, AidingMode.ABSOLUTE), AidingSpan(30_000_000, 70_000_000, AidingMode.NONE))

    def told(**fields: Any) -> dict[str, Finding]:
        evidence = evidence_of(messages, end_us=70_000_000, **fields)
        checks = [check for check in CHECKS if check.witness is Witness.MODEL]
        return {one.code: one for one in diagnose(evidence, checks) if one.witness is Witness.MODEL}

    for spans, code, words in (
        (never, "XN9-02", "but the vehicle's own filter (log) did, from 10.000 s on"),
        (stops, "XN9-03", "but the vehicle's own filter (log) went on"),
        (never, "XN9-04", "(log) passed all: its position test ratio was 0.20 at most"),
    ):
        assert told(aiding=spans)[code].severity is not Severity.NOTE
        weak = told(aiding=spans, own_filter=own)[code]
        assert weak.severity is Severity.NOTE
        assert words in weak.evidence
        # With parameters that it did not fly with, what it did proves nothing.
        assert told(aiding=spans, own_filter=own, is_as_flown=False)[code].severity is not Severity.NOTE


def test_model_is_not_contradicted_by_a_filter_that_agrees() -> None:
    own = own_of(logged(during(20, 25, SP=3.0, SS=LOST)))
    messages = [message(number, GATE_POSITION if 20 <= number < 60 else FUSED) for number in range(100)]
    stops = (AidingSpan(0, 30_000_000, AidingMode.ABSOLUTE), AidingSpan(30_000_000, 70_000_000, AidingMode.NONE))
    findings = diagnose(evidence_of(messages, aiding=stops, own_filter=own), CHECKS)
    told = {one.code: one.severity for one in findings if one.witness is Witness.MODEL}
    assert told == {"XN9-01": Severity.NOTE, "XN9-03": Severity.ERROR, "XN9-04": Severity.WARNING}


def test_model_does_not_say_that_navigation_begins_where_it_never_did() -> None:
    own = own_of(logged(lambda _: {"SS": LOST}))
    messages = [seen(1, START_US, message(1, FUSED).message)]  # type: ignore[arg-type] # a message that is one
    assert "XN9-01" in {one.code for one in diagnose(evidence_of(messages), CHECKS)}
    assert "XN9-01" not in {one.code for one in diagnose(evidence_of(messages, own_filter=own), CHECKS)}


# Real ones, and the figures at the end


@pytest.mark.parametrize("name", ["flight_t265", "flight_mav_extyaw", "voxl", "t265", "prearm"])
def test_recorded_flight_that_went_well_shows_nothing(name: str) -> None:
    assert not found_in(own_filter_in(read_columns(RECORDED / "logs" / f"{name}.BIN.xz")))


def test_recorded_flight_that_went_wrong_shows_it() -> None:
    found = found_in(own_filter_in(read_columns(RECORDED / "logs" / "flight_voxl_reset.BIN.xz")))
    assert [(one.code, one.severity) for one in found] == [
        *(("XN9-10", Severity.ERROR), ("XN9-10", Severity.ERROR), ("XN9-13", Severity.ERROR)),
        *(("XN9-16", Severity.ERROR), ("XN9-14", Severity.WARNING)),
    ]
    assert "(XKF4.SP, position from ExtNav) was above 1 for 23 % of 74 s" in found[0].evidence


def tampered(log: bytes, label: str, value: float, start_s: float, end_s: float) -> bytes:
    """Return a log whose XKF4 say something else of a test ratio within a time."""
    columns, data = LogColumns(log), bytearray(log)
    fields = columns.types["XKF4"].dtype.fields
    assert fields is not None
    kind, at = fields[label][:2]
    times_us = columns.columns("XKF4", ["TimeUS"])["TimeUS"].tolist()
    for begin, time_us in zip(columns.offsets("XKF4").tolist(), times_us, strict=True):
        if start_s <= time_us * 1e-6 < end_s:
            data[begin + at : begin + at + kind.itemsize] = np.array(round(100 * value), kind).tobytes()
    return bytes(data)


@pytest.mark.slow
def test_flight_whose_filter_rejected_its_yaw_begins_with_that(viso: Viso, tmp_path: Path) -> None:
    log = tmp_path / "flight.BIN"
    log.write_bytes(
        tampered(lzma.decompress((RECORDED / "logs" / "flight_mav_extyaw.BIN.xz").read_bytes()), "SM", 4, 30, 70)
    )
    outcome = viso("doctor", log, "--json")
    first, *_ = json.loads(outcome.out)["findings"]
    assert (outcome.code, first["code"], first["witness"]) == (1, "XN9-10", "log")
    assert "(XKF4.SM, yaw from ExtNav) was above 1 for 57 % of 70 s" in first["evidence"]
    assert viso("report", log, "--csv", "out.csv").out.startswith("TROUBLE: ")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flight_t265", "flight_mav_extyaw"])
def test_flight_that_went_well_stays_without_a_warning(viso: Viso, name: str) -> None:
    outcome = viso("doctor", RECORDED / "logs" / f"{name}.BIN.xz", "--json", "--fail-on", "warning")
    assert outcome.code == 0, outcome.out
    assert json.loads(outcome.out)["summary"]["own_filter"]["record"] == "XKF4"


def test_summary_tells_what_the_vehicle_s_own_filter_said() -> None:
    own = own_of(logged(during(20, 30, SM=2.0)))
    summary = summarise(evidence_of([], own_filter=own))
    assert summary_lines(summary) == [
        "There is no external navigation to try.",
        "The vehicle's own filter (log, XKF4) navigated by external navigation for 60.0 of 60.0 s; largest test "
        "ratios: velocity 0.10 (ExtNav), position 0.20 (ExtNav), height 0.05 (barometer), yaw 2.00 (ExtNav).",
    ]
    silent = summary_lines(summarise(evidence_of(stream_of([pose(1)]))))
    assert any(line.startswith("What the vehicle's own filter made of it is not recorded") for line in silent)


@pytest.mark.parametrize(("disarmed_s", "codes"), [(START_US * 1e-6 + 3.0, set()), (START_US * 1e-6 + 9.0, {"XN4-04"})])
def test_gap_after_the_last_disarming_is_no_finding(disarmed_s: float, codes: set[str]) -> None:
    said = [(1.0, heartbeat(armed=True)), (disarmed_s, heartbeat())]
    own = heard([*said, (disarmed_s + 30.0, heartbeat())])
    messages = stream_of([odometry(1_000_000 + number * 40_000) for number in range(100)])
    gap = [replace(one, arrival_us=one.arrival_us + 1_000_000 * (number >= 90)) for number, one in enumerate(messages)]
    found = diagnose(evidence_of(gap, own_filter=own), CHECKS)
    assert {finding.code for finding in found if finding.code.startswith("XN4")} == codes
