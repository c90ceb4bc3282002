# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes mav_handlers/wire/messages.py: a dataclass for each MAVLink message that we use, from pymavlink's dialect.

A message is a row of ``MESSAGES`` here, with a description in our words. `make_messages.py` rewrites the file,
`make_messages.py --check` fails when it is not what this writes.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega, development

TARGET: Final = Path(__file__).resolve().parent.parent / "mav_handlers" / "wire" / "messages.py"

MESSAGES: Final[Mapping[str, str]] = {
    "HEARTBEAT": "Presence, type, mode and state of a component.",
    "SYS_STATUS": "Sensors present, enabled and healthy (bit masks), load, battery and error counters.",
    "SYSTEM_TIME": "UTC in us (0 while unknown) and ms since boot.",
    "SET_MODE": "Request for a flight mode.",
    "PARAM_REQUEST_READ": "Request for one parameter, by index or (index -1) by name.",
    "PARAM_REQUEST_LIST": "Request for all parameters.",
    "PARAM_VALUE": "One parameter: value as float32 whatever its type.",
    "PARAM_SET": "Request to change a parameter.",
    "PARAM_ERROR": "Why a parameter was not read or set (MAV_PARAM_ERROR); by name with index -1.",
    "GPS_RAW_INT": (
        "What a GPS says: degE7, mm, dilutions x 100 (65535 unknown), cm/s, centidegrees; accuracies in mm and mm/s."
    ),
    "GPS2_RAW": "The same of the second GPS, with satellites and age (ms) of corrections.",
    "SCALED_IMU": "First IMU and compass: mG, mrad/s, mgauss, 0.01 degC.",
    "RAW_IMU": "First IMU and compass, as the firmware scales them: mG, mrad/s, mgauss, 0.01 degC.",
    "SCALED_PRESSURE": "First barometer: hPa, 0.01 degC.",
    "ATTITUDE": "Roll, pitch, yaw in rad, body rates in rad/s.",
    "ATTITUDE_QUATERNION": "Attitude as w, x, y, z (body to NED), body rates in rad/s.",
    "LOCAL_POSITION_NED": "Position in m and velocity in m/s, NED from the EKF origin.",
    "GLOBAL_POSITION_INT": "Place and velocity: degE7, mm above sea level and above home, cm/s NED, centidegrees.",
    "RC_CHANNELS_RAW": "Eight radio channels in us, for MAVLink 1.",
    "SERVO_OUTPUT_RAW": "Sixteen servo outputs in us.",
    "MISSION_CURRENT": "The mission's present item, number of items, state and mode.",
    "SET_GPS_GLOBAL_ORIGIN": "Request to set the EKF origin: degE7, mm above mean sea level.",
    "GPS_GLOBAL_ORIGIN": "The EKF origin: degE7, mm above mean sea level, us since boot.",
    "NAV_CONTROLLER_OUTPUT": "Where the controllers want to go: degrees, m, m/s.",
    "RC_CHANNELS": "Eighteen radio channels in us, signal strength (255 unknown).",
    "REQUEST_DATA_STREAM": "Request for the rate in Hz of a group of messages.",
    "VFR_HUD": "What a pilot looks at: m/s, degrees, percent, m above sea level, m/s upwards.",
    "COMMAND_INT": "A command with x and y as integers.",
    "COMMAND_LONG": "A command with seven float32 parameters.",
    "COMMAND_ACK": "Result of a command.",
    "GLOBAL_VISION_POSITION_ESTIMATE": "An alias of VISION_POSITION_ESTIMATE to the firmware; not a geodetic position.",
    "VISION_POSITION_ESTIMATE": (
        "Position in m NED, roll, pitch, yaw in rad, row-major upper triangle of the 6x6 covariance."
    ),
    "VISION_SPEED_ESTIMATE": "Velocity in m/s NED, 3x3 covariance.",
    "VICON_POSITION_ESTIMATE": "As VISION_POSITION_ESTIMATE, without a reset counter.",
    "HIGHRES_IMU": "Inertial sensors, compass and barometer with a mask of what is new: m/s/s, rad/s, hPa, m, degC.",
    "SIM_STATE": (
        "A simulator's truth: attitude in rad, m/s/s, rad/s, degrees of place, m of altitude, m/s NED, 1e-7 degrees."
    ),
    "TIMESYNC": "Time in ns: tc1 of the answering side (0 in a request), ts1 of the asking side.",
    "SCALED_IMU2": "Second IMU and compass, as SCALED_IMU.",
    "POWER_STATUS": "Voltages of the board and of the servo rail in mV.",
    "SCALED_IMU3": "Third IMU and compass, as SCALED_IMU.",
    "SCALED_PRESSURE2": "Second barometer, as SCALED_PRESSURE.",
    "ATT_POS_MOCAP": "Attitude as w, x, y, z and position in m NED.",
    "BATTERY_STATUS": "A battery: mV of each cell (65535 none), cA, mAh, hJ, percent.",
    "MEMINFO": "Free memory in bytes.",
    "AHRS": "Gyro bias in rad/s and DCM's errors.",
    "SIMSTATE": "ArduPilot's simulator's truth: attitude in rad, m/s/s, rad/s, place in 1e-7 degrees.",
    "HWSTATUS": "Voltage of the board in mV, errors of the I2C bus.",
    "AHRS2": "Attitude in rad and place (m, degE7) of the second estimator.",
    "SET_POSITION_TARGET_LOCAL_NED": "Where to fly: m, m/s, m/s/s NED, rad, rad/s; the mask says what to ignore.",
    "SET_POSITION_TARGET_GLOBAL_INT": (
        "Where to fly: degE7 and m, m/s, m/s/s NED, rad, rad/s; the mask says what to ignore."
    ),
    "RC_CHANNELS_OVERRIDE": (
        "Pulse lengths in us in place of the radio's; 65535 is none, and 0 gives a channel back to the radio."
    ),
    "AUTOPILOT_VERSION_REQUEST": "Request for AUTOPILOT_VERSION.",
    "AUTOPILOT_VERSION": "Capabilities, versions and ids.",
    "EKF_STATUS_REPORT": "What the EKF says of itself: flags, and square roots of test ratios, 1.0 at the gate.",
    "VIBRATION": "Vibration levels in m/s/s and how often each accelerometer clipped.",
    "HOME_POSITION": "Home: degE7, mm; m NED from the EKF origin.",
    "MESSAGE_INTERVAL": "Interval of a message in us: -1 not sent, 0 unknown.",
    "EXTENDED_SYS_STATE": "Kind of flight of a VTOL, and whether landed.",
    "NAMED_VALUE_FLOAT": "A value with a name, for debugging.",
    "STATUSTEXT": "A text with its severity; longer ones come in chunks of 50 characters that share an id.",
    "ODOMETRY": "Pose and velocity: m, m/s, rad/s; q as w, x, y, z; quality -1 failed, 0 unknown, 1..100.",
    "VISION_POSITION_DELTA": "Change of angle (rad) and position (m) in the body frame over time_delta_usec.",
    "FILE_TRANSFER_PROTOCOL": "One request or reply of MAVLink FTP, 251 bytes.",
    "LOG_REQUEST_LIST": "Request for a list of logs: first and last id.",
    "LOG_ENTRY": (
        "One log: id 1..num_logs, last id of this list, UTC in s (0 while unknown), bytes; all 0 when there is none."
    ),
    "LOG_REQUEST_DATA": "Request for ``count`` bytes of a log from offset ``ofs`` on.",
    "LOG_DATA": "Up to 90 bytes of a log, padded with zeros; fewer end the transfer.",
    "LOG_ERASE": "Request to erase all logs.",
    "LOG_REQUEST_END": "Request to stop a log transfer.",
    "SETUP_SIGNING": "Signing key of 32 bytes and first timestamp (10 us since 2015); all zero ends signing.",
    "RADIO_STATUS": (
        "Signal and noise of a radio and its peer, free transmit buffer (%), receive errors and corrected packets."
    ),
    "OPTICAL_FLOW": (
        "Movement of an image: flow in 0.1 pixels (as the sender sees it), compensated flow in m/s, quality 0..255."
    ),
    "DISTANCE_SENSOR": "A distance in cm, its limits, and where the sensor looks.",
    "RANGEFINDER": "The range of a range finder that looks down, m, and its voltage.",
    "LANDING_TARGET": (
        "Where a landing target is: angles in rad from the image's middle, distance in m, or a position in m."
    ),
    "GPS_INPUT": (
        "A GPS solution: degE7, m above mean sea level, m/s NED, accuracies in m/s and m; yaw in 0.01 deg, 0 for none."
    ),
    "HIL_SENSOR": "A simulator's sensors with a mask of what is new: m/s/s (gravity felt), rad/s, gauss, hPa, m, degC.",
    "HIL_STATE_QUATERNION": (
        "A simulator's truth: w, x, y, z (body to NED), rad/s, degE7, mm, cm/s NED, airspeeds in cm/s, mG."
    ),
    "ADSB_VEHICLE": "An aircraft: degE7, mm, heading in 0.01 deg, speeds in cm/s, seconds since it was last heard of.",
    "RADIO": "RADIO_STATUS as older radios send it.",
    "AVAILABLE_MODES": (
        "One flight mode: how many there are, its index from 1, its numbers, its properties (bits) and its name."
    ),
    "AVAILABLE_MODES_MONITOR": "A number that changes with the list of modes.",
    "MISSION_REQUEST_LIST": "Request for the number of items: of a mission (0), a fence (1) or rally points (2).",
    "MISSION_COUNT": "How many items there are, or will come.",
    "MISSION_REQUEST": "Request for one item, in float32.",
    "MISSION_REQUEST_INT": "Request for one item.",
    "MISSION_ITEM": "One item; x and y are degrees where they are a place, z is metres.",
    "MISSION_ITEM_INT": "One item; x and y are degE7 where they are a place, z is metres.",
    "MISSION_ACK": "End of a transfer, with a MAV_MISSION_RESULT.",
    "MISSION_CLEAR_ALL": "Request to forget all items.",
    "MISSION_SET_CURRENT": "Request to go on with an item.",
    "MISSION_ITEM_REACHED": "The item that was done last.",
    "MISSION_WRITE_PARTIAL_LIST": "Announcement of items that replace some.",
    "SET_HOME_POSITION": "Wish for another home: degE7, mm; the firmware ignores it.",
}
"""By MAVLink's name, in the order of the file: one line of description."""

HEAD: Final = '''# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The MAVLink messages that the endpoint and the companion know, as frozen dataclasses.

tools/make_messages.py writes this file. Field names and order are those of the message definitions (common.xml,
ardupilotmega.xml). Arrays are tuples, text is ``str`` without its padding. Extension fields, which a sender may leave
out, are zero by default, as on the wire.
"""

from collections.abc import Mapping
from dataclasses import Field, dataclass
from typing import Any, ClassVar, Final


class Message:
    """Base of all messages, which are dataclasses; the class name is MAVLink's name of the message."""

    __slots__ = ()

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
'''


def definition(name: str) -> Any:
    """Return pymavlink's class of a message; it has AVAILABLE_MODES and its monitor in its dialect of drafts alone."""
    for dialect in (ardupilotmega, development):
        for cls in dialect.mavlink_map.values():
            if cls.msgname == name:
                return cls
    raise KeyError(name)


def fields_of(cls: Any) -> Iterator[str]:
    """Yield a line for each field of a message, as a class defines it."""
    lengths = dict(zip(cls.ordered_fieldnames, cls.array_lengths, strict=True))
    parameters = inspect.signature(cls.__init__).parameters
    for name, wire_type in zip(cls.fieldnames, cls.fieldtypes, strict=True):
        is_extension = parameters[name].default is not inspect.Parameter.empty
        if wire_type == "char":
            kind, zero = "str", '""'
        elif wire_type in ("float", "double"):
            kind, zero = "float", "0.0"
        else:
            kind, zero = "int", "0"
        if wire_type != "char" and lengths[name]:
            kind, zero = f"tuple[{kind}, ...]", f"({zero},) * {lengths[name]}"
        yield f"    {name}: {kind} = {zero}" if is_extension else f"    {name}: {kind}"


def source() -> str:
    """Return what the file is to hold."""
    classes = [
        f"""@dataclass(frozen=True, slots=True)
class {name}(Message):
    \"\"\"{about}\"\"\"

"""
        + "\n".join(fields_of(definition(name)))
        for name, about in MESSAGES.items()
    ]
    names = "".join(f"        {name},\n" for name in MESSAGES)
    table = f"""MESSAGES: Final[Mapping[str, type[Message]]] = {{
    cls.__name__: cls
    for cls in (
{names}    )
}}
\"\"\"All message classes by name.\"\"\"
"""
    return "\n\n".join([HEAD, *(f"{cls}\n" for cls in classes), table])


def main(arguments: list[str]) -> int:
    """Write the file, or with --check say whether it is current."""
    if TARGET.read_text(encoding="utf-8") == source():
        return 0
    if "--check" in arguments:
        print(f"{TARGET}: stale, run .venv/bin/python tools/make_messages.py")
        return 1
    TARGET.write_text(source(), encoding="utf-8")
    print(f"{TARGET}: rewritten")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
