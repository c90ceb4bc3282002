# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight modes have the names that the vehicle of the log gives them."""

import pytest

from viso.logs.event_names import FlightModes
from viso.logs.recorded import LogRecord


@pytest.mark.parametrize(
    ("record", "name"),
    [
        (LogRecord("MSG", {"Message": "ArduCopter V4.6.3 (3fc7011a)"}), "AUTO"),
        (LogRecord("MSG", {"Message": "ArduRover V4.5.0"}), "ACRO"),
        (LogRecord("MSG", {"Message": "ArduSub V4.5.0"}), "AUTO"),
        (LogRecord("MSG", {"Message": "EKF3 IMU0 initialised"}), "TRAINING"),
        (LogRecord("VER", {"BU": 2}), "AUTO"),
        (LogRecord("VER", {"BU": 99}), "TRAINING"),
    ],
)
def test_mode_has_the_name_of_the_vehicle(record: LogRecord, name: str) -> None:
    modes = FlightModes()
    modes.take(record)
    number = 1 if name == "ACRO" else 3
    assert modes.name(LogRecord("MODE", {"Mode": number, "ModeNum": number})) == name


def test_mode_may_have_no_name_or_bring_its_own() -> None:
    assert FlightModes().name(LogRecord("MODE", {"Mode": 200, "ModeNum": 200})) == "UNKNOWN"
    assert FlightModes().name(LogRecord("MODE", {"Mode": "Loiter"})) == "LOITER"
