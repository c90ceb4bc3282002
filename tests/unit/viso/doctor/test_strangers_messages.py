# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of others with messages beside ODOMETRY: flow, deltas of a DVL, a companion's GPS; and their releases."""

import pytest

from tests.places import DATA
from viso.doctor import CHECKS, Severity, diagnose, gather
from viso.firmware.releases import STABLE_4_6, Firmware
from viso.replay.feed import Replay
from viso.streams.heard import firmware_of_recording
from viso.streams.stream_kinds import Stream, read_whole_stream
from viso.vehicle.vehicle import Vehicle, VehicleConfig


def stranger(name: str) -> Stream:
    return read_whole_stream(DATA / "strangers" / f"{name}.tlog.gz", 0)


def severities(name: str, firmware: Firmware | None = None) -> dict[str, Severity]:
    """Return how bad each code is at worst."""
    findings = diagnose(gather(stranger(name), firmware=firmware), CHECKS)
    return {finding.code: finding.severity for finding in reversed(findings)}


def test_rates_of_flow_are_read_since_4_7() -> None:
    assert Severity.ERROR not in severities("flow470").values()


def test_rates_of_flow_are_not_read_in_4_6() -> None:
    found = severities("flow470", STABLE_4_6)
    assert (found["XNF-05"], found["XNF-09"]) == (Severity.ERROR, Severity.ERROR)


def test_flow_in_a_message_without_a_handler_is_named() -> None:
    assert severities("flowrad")["XNF-15"] is Severity.ERROR


def test_deltas_of_a_dvl_are_relative_aiding_and_no_error() -> None:
    found = severities("subdelta")
    assert found["XN7-03"] is Severity.NOTE
    assert not {Severity.ERROR, Severity.WARNING} & set(found.values())


def test_gps_of_a_companion_is_no_missing_external_navigation() -> None:
    assert severities("gpsinput") == {"XN7-22": Severity.NOTE}


@pytest.mark.parametrize("name", ["cov470", "cov470p"])
def test_errors_of_a_covariance_are_those_of_4_7(name: str) -> None:
    """The one names its release by its banner alone, the other by ARMING_SKIPCHK as well."""
    stream = stranger(name)
    firmware = firmware_of_recording(stream, None).firmware
    replay = Replay(Vehicle(VehicleConfig(firmware=firmware, defaults={"VISO_TYPE": 1})), stream, None)
    first = next(message for message in replay.run() if message.records)
    assert first.records[0][1][9] == pytest.approx(0.75**0.5)  # VISP.PErr of three variances of 0.25 m2
