# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings without external navigation: how the vehicle is set up is diagnosed, wherever its parameters are."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from mav_handlers.wire.messages import ATTITUDE, AUTOPILOT_VERSION
from tests.places import DATA
from tests.unit.viso.doctor.vehicles import (
    AUTOPILOT,
    BANNER,
    CAMERA,
    GPS_ALONE,
    MANY,
    READY,
    SET_UPS,
    SOURCES,
    SUB,
    WAYS,
    Said,
    beats,
    listed,
    logged,
    packed,
    recorded,
    transferred,
)
from viso.doctor import CHECKS, Finding, Severity, diagnose, gather
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025, STABLE_4_6, STABLE_4_7
from viso.streams.heard import params_heard, version_heard
from viso.streams.stream import Stream
from viso.streams.stream_kinds import read_whole_stream

OLD: Mapping[str, float] = {"SYSID_THISMAV": 1, "AHRS_EKF_TYPE": 2, "EK2_ENABLE": 1, "EK3_ENABLE": 0, "GPS_TYPE": 1}


def found(stream: Stream) -> list[Finding]:
    """Return what is found, but that these recordings hold nothing of the filter."""
    return [finding for finding in diagnose(gather(stream), CHECKS) if finding.code != "XN9-17"]


def codes(stream: Stream) -> list[str]:
    return [finding.code for finding in found(stream)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", SET_UPS)
def test_set_up_is_diagnosed_wherever_the_parameters_are(tmp_path: Path, name: str, way: str) -> None:
    params, expected = SET_UPS[name]
    assert sorted(codes(WAYS[way](tmp_path, params))) == expected


def test_only_what_can_be_switched_to_is_a_warning(tmp_path: Path) -> None:
    params, _ = SET_UPS["second set, type 0"]
    (finding,) = found(WAYS["log"](tmp_path, params))
    assert finding.severity is Severity.WARNING
    assert "VISO_TYPE is 0, while EK3_SRC2_POSXY 6, EK3_SRC2_YAW 6 ask" in finding.evidence


def test_build_without_visual_odometry_is_told(tmp_path: Path) -> None:
    params, _ = SET_UPS["build without"]
    (finding,) = found(WAYS["FTP"](tmp_path, params))
    assert "VISO_TYPE is not among the 408 parameters: this build has no visual odometry" in finding.evidence
    assert "Flash a build" in finding.fix


def test_vehicle_that_nothing_asks_is_in_order(tmp_path: Path) -> None:
    (finding,) = found(WAYS["log"](tmp_path, GPS_ALONE))
    assert finding.severity is Severity.NOTE


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ([beats()], ["XN1-01"]),
        ([beats(sensor=False)], ["XN7-17"]),
        ([beats(sensor=True)], ["XN1-01"]),
        ([beats(sensor=False), listed(SOURCES, total=900)], ["XN7-01"]),
        ([beats(sensor=True), listed(READY, 190)], ["XN1-01"]),
        ([listed(READY), beats()], ["XN1-01"]),
        # A list of which something is not there does not tell that the rest are defaults.
        ([beats(), listed({"EK3_SRC1_POSXY": 6}, total=900)], ["XN1-01"]),
        ([beats(), packed({**READY, **MANY}, lost=5)], ["XN1-01"]),
        # A camera has parameters of its own.
        ([beats(), listed({"VISO_TYPE": 0, "CAM_MODE": 1}, CAMERA), listed(READY, total=900)], ["XN1-01"]),
        # The ground station has set it, and nobody has rebooted since.
        ([beats(), packed(SOURCES), listed({"VISO_TYPE": 1}, total=len(SOURCES))], ["XN7-01", "XN7-13"]),
    ],
)
def test_what_is_not_known_is_not_taken_for_off(tmp_path: Path, said: list[Said], expected: list[str]) -> None:
    assert codes(recorded(tmp_path, *said)) == expected


def test_what_asks_is_named(tmp_path: Path) -> None:
    (finding,) = found(recorded(tmp_path, beats(), listed(READY)))
    assert "VISO_TYPE 1, EK3_SRC1_POSXY 6, EK3_SRC1_VELXY 6, … ask for external navigation" in finding.evidence
    assert "of 11 messages none is of external navigation; there are PARAM_VALUE (9), " in finding.evidence


def test_nothing_is_tried_without_external_navigation(tmp_path: Path) -> None:
    attitudes = [(AUTOPILOT, ATTITUDE(time_ms, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) for time_ms in range(0, 60_000, 1000)]
    evidence = gather(recorded(tmp_path, beats(), listed(READY), attitudes))
    assert (evidence.stream.messages, evidence.trial.texts) == ((), ())
    assert evidence.stream.kinds["ATTITUDE"] == 60
    assert evidence.vehicle.attitude is not None


# Parameters by FTP


def test_lost_piece_ends_the_list(tmp_path: Path) -> None:
    heard = params_heard(recorded(tmp_path, beats(), packed({**READY, **MANY}, lost=2)))
    names = [one.name for one in heard.values]
    assert names == list({**READY, **MANY})[: len(names)]
    assert len(READY) < len(names) < len(MANY)
    assert not heard.has_all


def test_file_that_is_no_list_of_parameters_is_passed_over(tmp_path: Path) -> None:
    assert params_heard(recorded(tmp_path, beats(), transferred(b"a mission" * 100))).values == ()
    assert params_heard(recorded(tmp_path, beats(), transferred(b""))).values == ()


def test_session_that_is_used_again_holds_another_file(tmp_path: Path) -> None:
    heard = params_heard(recorded(tmp_path, beats(), packed(GPS_ALONE), packed(SOURCES)[1:]))
    assert [one.value for one in heard.values if one.name == "EK3_SRC1_POSXY"] == [3.0, 6.0]


# Releases


@pytest.mark.parametrize(
    ("banner", "names", "expected"),
    [
        ("ArduCopter V4.6.3 (3fc7011a)", (), STABLE_4_6),
        ("ArduCopter V4.6.0-dev", (), STABLE_4_6),
        ("ArduSub V4.5.6 (11223344)", (), STABLE_4_6),
        ("APM:Copter V3.6-rc1 (11223344)", (), STABLE_4_6),
        ("ArduCopter V4.7.0-dev (2b361bde)", ("ARMING_SKIPCHK",), JULY_2025),
        ("ArduCopter V4.7.0-dev (11223344)", (), JULY_2025),
        ("ArduCopter V4.7.0-dev (2f511151)", (), FEBRUARY_2026),
        ("ArduCopter V4.7.0-beta2 (11223344)", ("ARMING_SKIPCHK",), STABLE_4_7),
        ("ArduCopter V4.7.0 (1511f271)", (), STABLE_4_7),
        ("ArduCopter V4.8.0-dev (11223344)", (), APRIL_2026),
        ("ArduCopter V4.9.0 (11223344)", (), APRIL_2026),
        # By SYSID_THISMAV, which all of these have.
        ("EKF3 IMU0 initialised", (), STABLE_4_6),
    ],
)
def test_release_that_flew_chooses_the_profile(
    tmp_path: Path, banner: str, names: tuple[str, ...], expected: object
) -> None:
    params = {**READY, **dict.fromkeys(names, 0.0)}
    assert gather(recorded(tmp_path, beats(banner=banner), listed(params))).set_up.firmware is expected
    assert gather(read_whole_stream(logged(tmp_path, params, banner), 0)).set_up.firmware is expected


def test_profile_that_is_given_wins(tmp_path: Path) -> None:
    stream = recorded(tmp_path, beats(banner="ArduCopter V4.5.7"), listed(READY))
    evidence = gather(stream, firmware=FEBRUARY_2026)
    assert evidence.set_up.firmware is FEBRUARY_2026
    assert evidence.system_id == 1


@pytest.mark.parametrize(
    ("banner", "told"),
    [
        (BANNER, []),
        ("ArduCopter V4.5.7 (2a3dc4b7)", ["before 4.6 there is no VISO_QUAL_MIN"]),
        ("ArduCopter V4.0.7", ["before 4.1 there are no EK3_SRC1_*"]),
        ("ArduCopter V4.8.0-dev", ["is no release that is known here"]),
        ("ArduCopter V4.9.0", ["what changed since is not known here"]),
        ("ArduSub V4.6.0", ["the vehicle is a Sub"]),
        ("ArduPlane V4.5.1", ["before 4.6", "the vehicle is a Plane"]),
    ],
)
def test_what_a_profile_cannot_know_is_a_note(tmp_path: Path, banner: str, told: list[str]) -> None:
    evidence = gather(recorded(tmp_path, beats(banner=banner), listed(READY)))
    clock, *notes = evidence.notes
    assert "no message has the autopilot's clock: it begins 30 s after boot here (--lead)" in clock
    assert len(notes) == len(told)
    assert all(text in note for text, note in zip(told, notes, strict=True))


def test_version_number_does_where_no_text_is(tmp_path: Path) -> None:
    beat, _ = beats(SUB)
    version = AUTOPILOT_VERSION(0, 0x040506FF, 0, 0, 0, tuple(b"66c674c1"), (0,) * 8, (0,) * 8, 0, 0, 0)
    flown = version_heard(recorded(tmp_path, [(AUTOPILOT, version), beat]))
    assert flown is not None
    assert (flown.text, flown.vehicle, flown.source_hash) == ("ArduSub V4.5.6", "Sub", "66c674c1")


@pytest.mark.parametrize("banner", ["APM:Copter V3.6.12 (11223344)", "ArduCopter V4.0.7 (11223344)"])
def test_releases_before_sources_ask_for_nothing(tmp_path: Path, banner: str) -> None:
    assert codes(read_whole_stream(logged(tmp_path, OLD, banner), 0)) == ["XN7-17"]


# Recordings of others


@pytest.mark.parametrize(
    ("name", "expected", "firmware", "notes"),
    [
        # VISO_TYPE 0 and AHRS_EKF_TYPE 10 beside five sources that are 6: both keep all of it from the filter.
        ("depth_drone_gz_00000006_set_up.BIN.xz", ["XN7-01", "XN7-12"], "2026-04", 0),
        # A boat under water without a camera: GPS and barometer are the sources.
        ("ardusub_log_tools_small_set_up.BIN.xz", ["XN7-17"], "4.6", 2),
        ("ardusub_log_tools_small_set_up.tlog.gz", ["XN7-17"], "4.6", 2),
    ],
)
def test_recordings_of_others(name: str, expected: list[str], firmware: str, notes: int) -> None:
    stream = read_whole_stream(DATA / "real" / name, 0)
    evidence, findings = gather(stream), found(stream)
    assert [finding.code for finding in findings] == expected
    assert {finding.severity for finding in findings} == {Severity.NOTE if expected == ["XN7-17"] else Severity.ERROR}
    assert (evidence.set_up.firmware.name, len(evidence.notes)) == (firmware, notes)
