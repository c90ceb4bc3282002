# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the numbers of EV, ERR and MODE mean (AP_Logger/AP_Logger.h: LogEvent, LogErrorSubsystem, LogErrorCode)."""

from typing import Any, Final

EV_ARMED: Final = 10
EV_DISARMED: Final = 11
EV_ALT_RESET: Final = 60
EV_YAW_RESET: Final = 62
EV_SOURCE_SET_1: Final = 85

ERR_EKFCHECK: Final = 16
ERR_EKF_FAILSAFE: Final = 17
ERR_EKF_PRIMARY: Final = 24

_MAV_TYPE_PLANE: Final = 1
# MAV_TYPE by a word of the banner, and by VER.BU.
_VEHICLES_BY_WORD: Final = {"Rover": 10, "Plane": 1, "Copter": 2, "AntennaTracker": 5, "ArduSub": 12, "Blimp": 7}
_VEHICLES_BY_BUILD: Final = {1: 10, 2: 2, 3: _MAV_TYPE_PLANE, 4: 5, 7: 12, 12: 7, 13: 4}

_EVENTS: Final = {
    EV_ARMED: "armed",
    EV_DISARMED: "disarmed",
    15: "auto armed",
    17: "perhaps landed",
    18: "landed",
    19: "GPS lost",
    25: "home set",
    28: "not landed",
    41: "fence enabled",
    42: "fence disabled",
    54: "motors: emergency stop",
    55: "motors: emergency stop cleared",
    56: "motor interlock disabled",
    57: "motor interlock enabled",
    EV_ALT_RESET: "EKF height reset",
    61: "landing cancelled by pilot",
    EV_YAW_RESET: "EKF yaw reset",
    67: "primary GPS changed",
    74: "standby on",
    75: "standby off",
    EV_SOURCE_SET_1: "EKF source set 1",
    86: "EKF source set 2",
    87: "EKF source set 3",
}
_SUBSYSTEMS: Final = {
    1: "main",
    2: "radio",
    3: "compass",
    5: "radio failsafe",
    6: "battery failsafe",
    8: "GCS failsafe",
    9: "fence failsafe",
    10: "flight mode",
    11: "GPS",
    12: "crash check",
    13: "flip",
    15: "parachutes",
    ERR_EKFCHECK: "EKF check",
    ERR_EKF_FAILSAFE: "EKF failsafe",
    18: "barometer",
    19: "CPU",
    20: "ADS-B failsafe",
    21: "terrain",
    22: "navigation",
    23: "terrain failsafe",
    ERR_EKF_PRIMARY: "EKF primary core",
    25: "thrust loss check",
    26: "sensor failsafe",
    27: "leak failsafe",
    28: "pilot input",
    29: "vibration failsafe",
}
_CODES: Final = {
    (ERR_EKFCHECK, 0): "variance cleared",
    (ERR_EKFCHECK, 2): "bad variance",
    (ERR_EKF_FAILSAFE, 0): "resolved",
    (ERR_EKF_FAILSAFE, 1): "occurred",
    (12, 1): "crash",
    (12, 2): "loss of control",
    (18, 2): "glitch",
    (11, 2): "glitch",
}


def event_text(number: int) -> str:
    """Return what an EV record says."""
    return _EVENTS.get(number, f"event {number}")


def error_text(subsystem: int, code: int) -> str:
    """Return what an ERR record says."""
    name = _SUBSYSTEMS.get(subsystem, f"subsystem {subsystem}")
    if subsystem == ERR_EKF_PRIMARY:
        return f"{name}: {code}"
    fallback = "resolved" if code == 0 else f"error {code}"
    return f"{name}: {_CODES.get((subsystem, code), fallback)}"


class FlightModes:
    """The names of flight modes in a log, by the kind of vehicle that wrote it; a plane's until the log says more."""

    def __init__(self) -> None:
        self._vehicle = _MAV_TYPE_PLANE

    def take(self, record: Any) -> None:
        """Learn the kind of vehicle from a MSG or VER record, if it says so."""
        message = str(getattr(record, "Message", ""))
        named = (kind for word, kind in _VEHICLES_BY_WORD.items() if word in message)
        build: Any = getattr(record, "BU", None)
        self._vehicle = next(named, _VEHICLES_BY_BUILD.get(build, self._vehicle))

    def name(self, record: Any) -> str:
        """Return the name of a MODE record's mode, "UNKNOWN" if it has none."""
        # Imported where a log is read: it brings a dialect of its own, which would make every command start slower.
        from pymavlink.mavutil import mode_mapping_bynumber

        mode = getattr(record, "Mode", None)
        if isinstance(mode, str):
            return mode.upper()
        names = mode_mapping_bynumber(self._vehicle) or {}
        return str(names.get(getattr(record, "ModeNum", mode), "UNKNOWN"))
