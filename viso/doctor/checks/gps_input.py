# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN7: companions that act as a GPS, by GPS_INPUT."""

from collections.abc import Iterator
from typing import Final

from ekf_stub.ahrs.sources import SourceXY
from mav_handlers.wire.messages import GPS_INPUT
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.vehicle_position import SOURCE_SETS

_HANDLER: Final = "AP_GPS_MAV.cpp, AP_GPS_MAV::handle_msg"
_LEVEL_IGNORED: Final = 1 << 3  # of ignore_flags: vn and ve
_MAVLINK: Final = 14
_TYPES: Final = (("GPS1_TYPE", "GPS_TYPE"), ("GPS2_TYPE",))
_FIX_3D: Final = 3


def _are_enough(inputs: tuple[GPS_INPUT, ...]) -> bool:
    return len(inputs) >= limits.FEWEST_GPS_INPUTS


def _has_no_velocity(message: GPS_INPUT) -> bool:
    return bool(message.ignore_flags & _LEVEL_IGNORED) or (message.vn == 0 and message.ve == 0)


@check(
    code="XN7-21",
    severity=Severity.ERROR,
    title="GPS_INPUT without a velocity",
    firmware=(
        "A velocity that ignore_flags leaves out stays 0, and EKF3 fuses it: with EK3_SRC1_VELXY 3 the filter is told "
        "that the vehicle stands still while its positions move. It drifts, and overshoots where it should stop."
    ),
    source=f"{_HANDLER}; AP_NavEKF3_Measurements.cpp, NavEKF3_core::readGpsData",
    fix=(
        "Fill in vn, ve and vd, and take bits 3 (8) and 4 (16) off ignore_flags; or set EK3_SRC1_VELXY and VELZ to 0."
    ),
)
def gps_input_without_velocity(evidence: Evidence) -> Iterator[Sighting]:
    inputs = tuple(message for message in evidence.stream.gps_inputs if message.fix_type >= _FIX_3D)
    fewer = [message for message in inputs if _has_no_velocity(message)]
    if not _are_enough(inputs) or 2 * len(fewer) < len(inputs):
        return
    ways = len({(message.lat, message.lon) for message in inputs})
    ignored = sum(bool(message.ignore_flags & _LEVEL_IGNORED) for message in fewer)
    if not ignored and ways < limits.FEWEST_GPS_INPUTS:
        return  # it stands still
    known = evidence.set_up.known
    names = [f"EK3_SRC{number}_VELXY" for number in SOURCE_SETS]
    uses = [name for name in names if known.get(name) == SourceXY.GPS]
    if names[0] in known and not uses:
        return
    how = f"ignore_flags leave vn and ve out in {ignored}" if ignored else "vn and ve are 0, though the place changes"
    source = f", and {uses[0]} is 3 (GPS)" if uses else "; it matters if EK3_SRC1_VELXY is 3 (GPS), its default"
    yield Sighting(f"{share(len(fewer), len(inputs))} GPS_INPUT have no velocity ({how}){source}")


@check(
    code="XN7-22",
    severity=Severity.ERROR,
    title="GPS_INPUT without a GPS of type 14",
    firmware="GPS_INPUT is read by a GPS whose type is 14 (MAVLink), and whose number is gps_id; all else is dropped.",
    source=f"AP_GPS.cpp, AP_GPS::handle_msg; {_HANDLER}",
    fix="Set GPS1_TYPE (before 4.6 GPS_TYPE) to 14, reboot, and send gps_id 0; or stop the sender.",
)
def gps_input_without_gps(evidence: Evidence) -> Iterator[Sighting]:
    inputs, known = evidence.stream.gps_inputs, evidence.set_up.known
    if not _are_enough(inputs):
        return
    types = [next(((name, known[name]) for name in names if name in known), None) for names in _TYPES]
    ids = {message.gps_id for message in inputs}
    if any(kind is not None and kind[1] == _MAVLINK and number in ids for number, kind in enumerate(types)):
        return
    told = f"{len(inputs)} GPS_INPUT with gps_id {', '.join(map(str, sorted(ids)))}"
    if types[0] is None or (types[1] is None and ids != {0}):
        name = "GPS1_TYPE" if types[0] is None else "GPS2_TYPE"
        text = f"{told}, and the recording does not tell {name}: whether the autopilot takes them is not known"
        yield Sighting(text, severity=Severity.NOTE, fix=f"See that {name} is 14 (GPS_TYPE before 4.6, for gps_id 0).")
        return
    shown = " and ".join(f"{kind[0]} is {kind[1]:.0f}" for kind in types if kind is not None)
    yield Sighting(f"{told}, and {shown}")


@check(
    code="XN7-23",
    severity=Severity.WARNING,
    title="GPS_INPUT without a fix",
    firmware="The filter uses a GPS from fix_type 3 on, and its accuracies and satellites count as a receiver's do.",
    source=f"{_HANDLER}; AP_NavEKF3_Measurements.cpp, NavEKF3_core::readGpsData",
    fix="Send fix_type 3 or more while the position is good, with satellites_visible 6 or more and real accuracies.",
)
def gps_input_without_fix(evidence: Evidence) -> Iterator[Sighting]:
    inputs = evidence.stream.gps_inputs
    fewer = [message for message in inputs if message.fix_type < _FIX_3D]
    if _are_enough(inputs) and 2 * len(fewer) > len(inputs):
        yield Sighting(f"{share(len(fewer), len(inputs))} GPS_INPUT have a fix_type below 3")
