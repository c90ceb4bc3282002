# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which release a recording says that it is of."""

import pytest

from viso.firmware.flown import version_in, version_of_number


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


@pytest.mark.parametrize(
    "text", ["", "EKF3 IMU0 initialised", "Frame: COPTER", "Submarine", "ChibiOS: 17a50e3a", "V4.5.7"]
)
def test_other_texts_introduce_nobody(text: str) -> None:
    assert version_in(text) is None


def test_number_tells_no_vehicle() -> None:
    found = version_of_number(0x04050700, "11223344", "")
    assert found is not None
    assert (found.text, found.vehicle, found.major, found.minor) == ("ArduPilot V4.5.7", "", 4, 5)
    assert version_of_number(0, "", "Copter") is None
