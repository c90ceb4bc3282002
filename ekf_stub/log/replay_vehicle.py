# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator knows of the vehicle and its sensors beside what they measure, and how RFRN tells it."""

from dataclasses import dataclass
from typing import Final, NamedTuple

from ap_core.cint import u32
from ap_core.location import Location
from ap_core.log_field import LogValue

Three = tuple[float, float, float]
Place = tuple[int, int, int]

EAS2TAS_AT_SEA_LEVEL: Final = 1.0000001192092896
"""True over equivalent airspeed as the firmware computes it for height zero."""

_AVAILABLE_MEMORY: Final = 524_288  # bytes, as the simulator reports
_COPTER: Final = 2
ARMED: Final = 1 << 0  # of RFRN.Flags
HAS_FLOW: Final = 1 << 4
TAKEOFF_EXPECTED: Final = 1 << 6
TOUCHDOWN_EXPECTED: Final = 1 << 7


class VehicleFrame(NamedTuple):
    """What the estimator knows of the vehicle in one frame.

    Attributes:
        home: None while unset.
        eas2tas: true over equivalent airspeed at the present height.
        trim_rad: AHRS_TRIM.
        ekf_type: AHRS_EKF_TYPE.
    """

    armed: bool = False
    takeoff_expected: bool = False
    touchdown_expected: bool = False
    has_flow_sensor: bool = False
    home: Location | None = None
    eas2tas: float = EAS2TAS_AT_SEA_LEVEL
    trim_rad: Three = (0.0, 0.0, 0.0)
    ekf_type: int = 3


@dataclass(frozen=True, slots=True)
class SensorSet:
    """How many sensors of a kind there are; those of a kind all say the same, except IMUs that differ.

    Attributes:
        imus: 1..3.
        compass_offsets: COMPASS_OFS, mGauss.
        loop_rate_hz: SCHED_LOOP_RATE.
    """

    imus: int = 2
    baros: int = 2
    compasses: int = 3
    compass_offsets: Three = (0.0, 0.0, 0.0)
    loop_rate_hz: int = 400


def place_values(place: Location | None) -> Place:
    """Return latitude, longitude and height as the records hold them, zeros for no place."""
    return (0, 0, 0) if place is None else (u32(place.lat), u32(place.lng), u32(place.alt_cm))


def vehicle_values(vehicle: VehicleFrame) -> tuple[LogValue, ...]:
    """Return the fields of RFRN."""
    flags = (
        vehicle.armed * ARMED
        | vehicle.has_flow_sensor * HAS_FLOW
        | vehicle.takeoff_expected * TAKEOFF_EXPECTED
        | vehicle.touchdown_expected * TOUCHDOWN_EXPECTED
    )
    state = vehicle.eas2tas, _AVAILABLE_MEMORY, *vehicle.trim_rad
    return *place_values(vehicle.home), *state, _COPTER, vehicle.ekf_type, flags
