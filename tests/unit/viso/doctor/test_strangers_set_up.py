# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of others that do not hold the companion's messages, or are of vehicles that never armed."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from ap_core.dataflash_columns import LogColumns
from mav_handlers.wire.messages import (
    ATTITUDE,
    EKF_STATUS_REPORT,
    HEARTBEAT,
    LANDING_TARGET,
    STATUSTEXT,
    SYS_STATUS,
    Message,
)
from tests.places import DATA
from tests.unit.viso.doctor.own_filters import EXTNAV, Status, during, logged, quiet
from tests.unit.viso.doctor.vehicles import AUTOPILOT, GPS_ALONE, READY, Said, beats, listed, recorded
from tests.unit.viso.report.log_maker import LOST
from viso.doctor import CHECKS, Finding, Severity, diagnose, gather
from viso.doctor.evidence.own_log import own_filter_in
from viso.doctor.evidence.vehicle_data import vehicle_of_log
from viso.doctor.output.summary import summarise
from viso.doctor.output.terminal import summary_lines
from viso.streams.stream_kinds import read_whole_stream

STRANGERS = DATA / "strangers"
VISION = 1 << 7
UNHEALTHY = SYS_STATUS(VISION | 1, VISION | 1, 1, *(0,) * 10)
HEALTHY = SYS_STATUS(VISION | 1, VISION | 1, VISION | 1, *(0,) * 10)
TARGET = LANDING_TARGET(0, 0, 8, 0.0, 0.0, 2.0, 0.0, 0.0)
AIDED = STATUSTEXT(6, "EKF3 IMU0 is using external nav data")


def stranger(name: str) -> dict[str, Finding]:
    """Return the worst finding of each code in a recording of others."""
    findings = diagnose(gather(read_whole_stream(STRANGERS / f"{name}.tlog.gz", 0)), CHECKS)
    return {finding.code: finding for finding in reversed(findings)}


def severities(stream_parts: list[Said], folder: Path) -> dict[str, Severity]:
    """Return how bad each code is in a made recording."""
    findings = diagnose(gather(recorded(folder, *stream_parts)), CHECKS)
    return {finding.code: finding.severity for finding in reversed(findings)}


def spoken(*messages: Message, times: int = 20) -> Said:
    """Return what an autopilot says over and over."""
    return [(AUTOPILOT, message) for _ in range(times) for message in messages]


# The companion's messages are not in the recording


def test_flight_by_motion_capture_from_another_link_is_no_error() -> None:
    findings = stranger("mocap_gcs_link")
    told = findings["XN1-01"]
    assert Severity.ERROR not in {finding.severity for finding in findings.values()}
    assert told.severity is Severity.NOTE
    assert "healthy in 170 of 171" in told.evidence
    assert '"is using external nav data"' in told.evidence
    assert ".BIN" in told.fix
    assert "recording of the link that the companion uses" in told.fix


def test_precision_landing_asks_for_no_external_navigation() -> None:
    findings = stranger("precision_landing")
    assert findings["XN7-17"].severity is Severity.NOTE
    assert not {"XN1-01", "XN9-12"} & set(findings)


@pytest.mark.parametrize("params", [READY, {}], ids=["parameters", "no parameters"])
@pytest.mark.parametrize(
    ("said", "severity"),
    [
        (spoken(HEALTHY), Severity.NOTE),
        (spoken(AIDED, times=1), Severity.NOTE),
        ([*spoken(UNHEALTHY), *spoken(HEALTHY)], Severity.NOTE),
        (spoken(UNHEALTHY), Severity.ERROR),
    ],
    ids=["healthy", "text alone", "healthy later", "never healthy"],
)
def test_what_the_vehicle_says_decides_whether_messages_reach_it(
    tmp_path: Path, params: Mapping[str, float], said: Said, severity: Severity
) -> None:
    assert severities([beats(), listed(params, total=900), said], tmp_path)["XN1-01"] is severity


def test_without_a_sign_of_health_it_is_said_that_nobody_can_tell(tmp_path: Path) -> None:
    stream = recorded(tmp_path, beats(), listed(READY))
    (told,) = [finding for finding in diagnose(gather(stream), CHECKS) if finding.code == "XN1-01"]
    assert told.severity is Severity.WARNING
    assert "nothing in the recording tells whether any reaches the autopilot" in told.evidence


def test_autopilot_that_says_nothing_of_it_is_no_error(tmp_path: Path) -> None:
    said = [(AUTOPILOT, ATTITUDE(time_ms, *(0.0,) * 6)) for time_ms in range(0, 5000, 100)]
    assert severities([beats(), said], tmp_path)["XN1-01"] is Severity.NOTE


def test_position_by_external_navigation_alone_shows_that_it_comes(tmp_path: Path) -> None:
    report = EKF_STATUS_REPORT(0x33F, 0.0, 0.1, 0.1, 0.1, 0.0)
    for params, severity in ((READY, Severity.NOTE), ({**READY, "EK3_SRC1_VELXY": 5}, Severity.WARNING)):
        assert severities([beats(), listed(params), spoken(report)], tmp_path)["XN1-01"] is severity


@pytest.mark.parametrize(("status", "severity"), [(quiet, Severity.NOTE), (during(0, 99, SS=LOST), Severity.ERROR)])
def test_log_without_records_of_vision_is_judged_by_its_filter(
    tmp_path: Path, status: Status, severity: Severity
) -> None:
    path = tmp_path / "made.BIN"
    path.write_bytes(logged(status, {**EXTNAV, "VISO_TYPE": 1}).data)
    findings = diagnose(gather(read_whole_stream(path, 0), vehicle=vehicle_of_log(path)), CHECKS)
    assert [finding.severity for finding in findings if finding.code == "XN1-01"] == [severity]


@pytest.mark.parametrize("status", [HEALTHY, UNHEALTHY])
def test_landing_targets_explain_the_bit_where_no_parameter_does(tmp_path: Path, status: SYS_STATUS) -> None:
    assert severities([beats(), spoken(status, TARGET)], tmp_path)["XN1-01"] is Severity.NOTE


@pytest.mark.parametrize(
    ("params", "more", "expected"),
    [
        ({**GPS_ALONE, "PLND_ENABLED": 1}, (), {"XN7-17"}),
        (GPS_ALONE, (), {"XN7-17"}),
        (GPS_ALONE, (TARGET,), {"XN7-17"}),
        ({**GPS_ALONE, "VISO_TYPE": 1, "PLND_ENABLED": 1}, (), {"XN1-01"}),
    ],
)
@pytest.mark.parametrize("status", [HEALTHY, UNHEALTHY])
def test_bit_of_precision_landing_is_not_that_of_a_camera(
    tmp_path: Path, params: Mapping[str, float], more: tuple[Message, ...], expected: set[str], status: SYS_STATUS
) -> None:
    found = severities([beats(), listed(params), spoken(status, *more)], tmp_path)
    assert found.keys() & {"XN1-01", "XN7-17"} == expected
    assert found.get("XN1-01", Severity.WARNING) is Severity.WARNING


# Armed, or not


def test_disarmed_vehicle_misses_no_ranges() -> None:
    findings = stranger("disarmed_ranges")
    assert "XNR-05" not in findings
    assert all("in flight" not in finding.evidence for finding in findings.values())
    assert findings["XNR-09"].severity is Severity.NOTE
    assert {finding.severity for finding in findings.values()} == {Severity.NOTE}


@pytest.mark.parametrize(
    ("params", "records", "armed"),
    [
        ({"LOG_DISARMED": 1}, (), None),
        ({"LOG_DISARMED": 1}, ((1.0, "EV", {"Id": 25}),), ()),
        ({"LOG_DISARMED": 0}, (), ((1.0, 15.0),)),
        ({"LOG_DISARMED": 1}, ((1.0, "ARM", {"ArmState": 1}),), ((11.0, 15.0),)),
    ],
)
def test_when_a_log_was_armed(
    params: Mapping[str, float], records: tuple[tuple[float, str, dict[str, int]], ...], armed: object
) -> None:
    own = own_filter_in(LogColumns(logged(params=params, length_s=5.0, others=records).data))
    assert own.armed == armed


def test_heartbeats_of_others_do_not_arm(tmp_path: Path) -> None:
    armed = HEARTBEAT(2, 3, 128, 0, 4, 3)
    stream = recorded(tmp_path, beats(), [(100, armed)] * 5, [(AUTOPILOT, HEARTBEAT(2, 3, 0, 0, 4, 3))] * 5)
    own = gather(stream).vehicle.own_filter
    assert own is not None
    assert own.armed == ()


def test_vehicle_that_was_armed_all_the_same_is_not_said_to_refuse() -> None:
    findings = stranger("armed_unhealthy")
    told = findings["XN7-18"]
    assert told.severity is Severity.ERROR
    assert "ARMING_CHECK 448 leaves the vision check (bit 18) out" in told.evidence
    assert "unhealthy in 126 of 126" in told.evidence
    assert not any("refuse" in finding.evidence for finding in findings.values())


# The height


def test_height_of_a_constant_stamp_comes_from_the_barometer() -> None:
    evidence = gather(read_whole_stream(STRANGERS / "constant_stamp.tlog.gz", 0))
    findings = {finding.code: finding for finding in diagnose(evidence, CHECKS)}
    assert findings["XN3-01"].severity is Severity.ERROR
    assert "1 gave the height: it came from the barometer" in findings["XN9-07"].evidence
    told = " ".join(summary_lines(summarise(evidence)))
    assert "height 0.06 (barometer" in told
    assert "height 0.06 (ExtNav)" not in told
