# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which release a recording says that it is of, and which one it is judged by."""

import pytest

from viso.firmware.flown import profile_for, version_in, version_of_number
from viso.firmware.releases import (
    APRIL_2026,
    DEFAULT,
    FEBRUARY_2026,
    JULY_2025,
    PROFILES,
    STABLE_4_6,
    STABLE_4_7,
    Firmware,
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ArduCopter V4.7.0-dev (2b361bde)", ("Copter", 4, 7, "2b361bde")),
        ("APM:Copter V3.5.4 (284349c3)", ("Copter", 3, 5, "284349c3")),
        ("APMrover2 V3.5.0 (0ABCDEF1)", ("Rover", 3, 5, "0abcdef1")),
        ("ArduSub V4.1.1 BETA5 (66c674c1)", ("Sub", 4, 1, "66c674c1")),
        ("ArduPlane V3.10.0-dev (f2b4e06a)", ("Plane", 3, 10, "f2b4e06a")),
        ("CubeCopter V4.5.7", ("Copter", 4, 5, "")),
        ("AntennaTracker V1.1.0 (1234567)", ("Tracker", 1, 1, "")),
    ],
)
def test_vehicle_introduces_itself(text: str, expected: tuple[object, ...]) -> None:
    found = version_in(text)
    assert found is not None
    assert (found.text, found.vehicle, found.major, found.minor, found.source_hash) == (text, *expected)


def test_master_differs_from_a_release() -> None:
    told = {
        text: version.is_master
        for text in ("ArduCopter V4.7.0-dev (2b361bde)", "ArduCopter V4.7.0-beta2", "ArduCopter V4.7.1 (dbe79216)")
        if (version := version_in(text)) is not None
    }
    assert list(told.values()) == [True, False, False]
    numbers = version_of_number(0x04070000, "", "Copter"), version_of_number(0x040701FF, "", "Copter")
    assert [one is not None and one.is_master for one in numbers] == [True, False]


@pytest.mark.parametrize(
    "text", ["", "EKF3 IMU0 initialised", "Frame: COPTER", "Submarine", "ChibiOS: 17a50e3a", "V4.5.7"]
)
def test_other_texts_introduce_nobody(text: str) -> None:
    assert version_in(text) is None


def test_number_tells_no_vehicle() -> None:
    found = version_of_number(0x04050700, "11223344", "")
    assert found is not None
    assert (found.text, found.vehicle, found.major, found.minor) == ("ArduPilot V4.5.7-dev", "", 4, 5)
    assert version_of_number(0, "", "Copter") is None


@pytest.mark.parametrize(
    ("number", "text", "is_master"),
    [
        (0x040700FF, "ArduCopter V4.7.0", False),
        (0x04070000, "ArduCopter V4.7.0-dev", True),
        (0x04070180, "ArduCopter V4.7.1-beta", False),
        (0x040701C0, "ArduCopter V4.7.1-rc", False),
    ],
)
def test_number_tells_a_release_from_a_master(number: int, text: str, is_master: bool) -> None:
    found = version_of_number(number, "11223344", "Copter")
    assert found is not None
    assert (found.text, found.is_master, found.witness) == (text, is_master, "AUTOPILOT_VERSION")


# Which release a recording is judged by

OF_JULY = ("ARMING_CHECK", "EK3_MAX_FLOW", "MAV_SYSID", "WPNAV_SPEED")
OF_FEBRUARY = ("ARMING_SKIPCHK", "EK3_FLOW_MAX", "MAV_GCS_SYSID_HI", "WPNAV_SPEED")
OF_4_7 = ("ARMING_SKIPCHK", "EK3_FLOW_MAX", "MAV_GCS_SYSID_HI", "WP_SPD")


@pytest.mark.parametrize(
    ("banner", "names", "expected", "reason"),
    [
        ("ArduCopter 4.7.0-dev of February 2026, SITL", (), FEBRUARY_2026, ""),
        ("ArduCopter 4.8.0-dev (April 2026) SITL", (), APRIL_2026, ""),
        ("ArduCopter V4.7.0 (11223344)", (), STABLE_4_7, ""),
        ("ArduCopter V4.7.0 (11223344)", OF_JULY, STABLE_4_7, ""),
        ("ArduCopter V4.7.1-beta1 (11223344)", (), STABLE_4_7, ""),
        ("ArduCopter V4.6.0 (11223344)", (), STABLE_4_6, ""),
        ("ArduCopter V4.7.0-dev (2b361bde)", OF_4_7, JULY_2025, ""),
        ("ArduCopter V4.7.0-dev (2f511151)", (), FEBRUARY_2026, ""),
        (
            "ArduCopter V4.7.0-dev (11223344)",
            (),
            JULY_2025,
            ", and of its masters 2025-07 is the oldest that is known here",
        ),
        (
            "ArduCopter V4.7.0-dev (11223344)",
            OF_JULY,
            JULY_2025,
            ", and it has ARMING_CHECK, EK3_MAX_FLOW, WPNAV_SPEED",
        ),
        ("ArduCopter V4.7.0-dev (11223344)", OF_4_7, STABLE_4_7, ", and it has WP_SPD, ARMING_SKIPCHK, EK3_FLOW_MAX"),
        (
            "ArduCopter V4.7.0-dev (11223344)",
            OF_FEBRUARY,
            FEBRUARY_2026,
            ", and it has ARMING_SKIPCHK, EK3_FLOW_MAX, MAV_GCS_SYSID_HI",
        ),
        ("ArduCopter V4.5.7", (), STABLE_4_6, ", and 4.6 is the nearest that is known here"),
        ("APM:Copter V3.6.2", (), STABLE_4_6, ", and 4.6 is the nearest that is known here"),
        ("ArduCopter V4.8.0-dev (11223344)", (), APRIL_2026, ", and 2026-04 is the nearest that is known here"),
        ("ArduCopter V4.9.0", OF_JULY, APRIL_2026, ", and 2026-04 is the nearest that is known here"),
    ],
)
def test_version_chooses_the_release(banner: str, names: tuple[str, ...], expected: Firmware, reason: str) -> None:
    found = profile_for(version_in(banner), names)
    assert found.firmware is expected
    assert found.reason == f"the banner says {banner}{reason}"
    assert str(found) == f"judged as {expected.name}: {found.reason}"
    assert found.as_dict() == {"firmware": expected.name, "firmware_reason": found.reason}


@pytest.mark.parametrize(
    ("names", "expected", "reason"),
    [
        ((), DEFAULT, "and this is the default"),
        (("VISO_TYPE",), DEFAULT, "and this is the default"),
        (("SYSID_THISMAV", "ARMING_CHECK"), STABLE_4_6, "and has SYSID_THISMAV, ARMING_CHECK"),
        (("ARMING_CHECK",), STABLE_4_6, "and has ARMING_CHECK"),
        (OF_JULY, JULY_2025, "and has ARMING_CHECK, EK3_MAX_FLOW, WPNAV_SPEED"),
        (OF_FEBRUARY, FEBRUARY_2026, "and has ARMING_SKIPCHK, EK3_FLOW_MAX, MAV_GCS_SYSID_HI"),
        (OF_4_7, STABLE_4_7, "and has WP_SPD, ARMING_SKIPCHK, EK3_FLOW_MAX"),
    ],
)
def test_parameters_choose_where_nothing_names_the_release(
    names: tuple[str, ...], expected: Firmware, reason: str
) -> None:
    found = profile_for(None, names)
    assert found.firmware is expected
    assert found.reason == f"the recording does not name its release, {reason}"
    assert found.notes == ()
    assert found.stands_for is None


@pytest.mark.parametrize("given", PROFILES.values(), ids=lambda one: one.name)
def test_release_that_the_user_asks_for_wins(given: Firmware) -> None:
    assert str(profile_for(None, OF_JULY, given)) == f"judged as {given.name}: it was asked for"
    found = profile_for(version_in("ArduCopter V4.7.0"), (), given)
    assert (found.firmware, found.stands_for) == (given, None)
    assert found.reason == "it was asked for; the banner says ArduCopter V4.7.0"


@pytest.mark.parametrize(
    ("banner", "names", "notes"),
    [
        ("ArduCopter V4.7.0", (), []),
        ("ArduCopter V4.7.0-dev (11223344)", OF_JULY, []),
        ("ArduCopter V4.5.7", (), ["is older than 4.6: before 4.6 there is no VISO_QUAL_MIN"]),
        ("ArduCopter V4.0.7", (), ["is older than 4.6: before 4.1 there are no EK3_SRC1_*"]),
        ("ArduCopter V4.9.0", (), ["is newer than 2026-04: what changed since is not known here"]),
        (
            "ArduCopter V4.7.0-dev (11223344)",
            ("ARMING_CHECK", "EK3_FLOW_MAX", "WPNAV_SPEED"),
            ["is no release that is known here: EK3_FLOW_MAX are not of 2025-07"],
        ),
        ("ArduSub V4.7.0", (), ["the vehicle is a Sub"]),
    ],
)
def test_what_the_nearest_release_may_do_otherwise(banner: str, names: tuple[str, ...], notes: list[str]) -> None:
    found = profile_for(version_in(banner), names).notes
    assert len(found) == len(notes)
    assert all(part in note for part, note in zip(notes, found, strict=True))
