# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the endpoint asks of the vehicle behind it."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from ap_core.internal_error import InternalErrors
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ekf_stub.filter_status import FilterStatus
from mav_handlers.ftp_ports import FtpFiles
from mav_handlers.log_transfer import LogLibrary
from mav_handlers.signing import KeyStore
from mav_handlers.statustext import StatusTextQueue

__all__ = ["AhrsPort", "Attitude", "Location", "LogPort", "OriginResult", "VehiclePort"]


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll, pitch, yaw in rad (body to NED), body rates in rad/s."""

    roll: np.float32
    pitch: np.float32
    yaw: np.float32
    rates: tuple[np.float32, np.float32, np.float32]


class OriginResult(Enum):
    """What became of a request to set the EKF origin."""

    SET = "set"
    INVALID = "invalid"
    FAILED = "failed"


class LogPort(Protocol):
    """The records that the endpoint asks the vehicle to write."""

    def dropped(self) -> int:
        """Return the number of log records lost."""

    def text(self, text: str) -> None:
        """Write a MSG record."""

    def parameter(self, name: str, value: np.float32) -> None:
        """Write a PARM record of a change."""

    def command(self, values: Sequence[LogValue]) -> None:
        """Write a MAVC record: everything after TimeUS."""

    def timesync(self, system_id: int, round_trip_us: int) -> None:
        """Write a TSYN record."""

    def aux_function(self, function: int, position: int, result: bool) -> None:
        """Write an AUXF record for a function run by MAVLink."""


class AhrsPort(Protocol):
    """What telemetry asks of the AHRS; names are those of AP_AHRS."""

    def initialised(self) -> bool:
        """Tell whether the estimator has been running for its settling time."""

    def get_quaternion(self) -> Quaternion | None:
        """Return the attitude, body (FRD) to earth (NED), or None while there is none."""

    def get_yaw_rad(self) -> np.float32:
        """Return the yaw in radians, -pi..pi."""

    def get_gyro(self) -> Vector3f:
        """Return the body rates in rad/s, without bias."""

    def get_gyro_drift(self) -> Vector3f:
        """Return the estimated gyro bias in rad/s."""

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position in metres NED from the EKF origin, or None while there is none."""

    def get_velocity_NED(self) -> Vector3f | None:
        """Return the velocity in m/s NED, or None while there is none."""

    def get_location(self) -> Location | None:
        """Return where the vehicle is, or None without origin or position."""

    def get_filter_status(self) -> FilterStatus | None:
        """Return what the estimator says of itself, or None while it does not run."""


class VehiclePort(Protocol):
    """The vehicle as the endpoint sees it."""

    params: ParamTable
    texts: StatusTextQueue
    visual_odom: AP_VisualOdom
    internal_errors: InternalErrors
    signing_store: KeyStore

    @property
    def ahrs(self) -> AhrsPort:
        """The estimates of attitude and position."""

    @property
    def log(self) -> LogPort:
        """Where the endpoint's log records go."""

    @property
    def files(self) -> FtpFiles:
        """What MAVLink FTP shows."""

    @property
    def logs(self) -> LogLibrary:
        """The logs that clients may download."""

    def firmware_version(self) -> tuple[int, str, str]:
        """Return flight_sw_version, the version text and the source hash (8 characters)."""

    def banner(self) -> tuple[str, ...]:
        """Return the texts that introduce the vehicle."""

    def is_initialised(self) -> bool:
        """Tell whether booting is over."""

    def is_armed(self) -> bool:
        """Tell whether the motors are armed."""

    def custom_mode(self) -> int:
        """Return the flight mode's number."""

    def arm(self, do_checks: bool) -> bool:
        """Try to arm; tell whether it worked. Failures are told as texts."""

    def disarm(self, force: bool) -> bool:
        """Try to disarm; tell whether it worked."""

    def run_prearm_checks(self) -> None:
        """Run all pre-arm checks and tell their failures as texts."""

    def prearm_passed(self) -> bool:
        """Tell whether the last run of the checks passed."""

    def checks_enabled(self) -> bool:
        """Tell whether any arming check is enabled."""

    def set_source_set(self, index: int) -> None:
        """Choose one of the three EKF source sets, 0..2."""

    def set_origin(self, location: Location) -> OriginResult:
        """Set the EKF origin, once."""

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""

    def home(self) -> Location | None:
        """Return home, or None while unset."""

    def take_home_changed(self) -> bool:
        """Tell, once, that home has changed and is to be told to all links."""

    def attitude(self) -> Attitude | None:
        """Return the attitude, or None while there is none."""

    def utc_us(self) -> int:
        """Return the time of day in us since 1970, 0 while unknown."""

    def set_utc_us(self, utc_us: int) -> None:
        """Take a time of day from SYSTEM_TIME, subject to BRD_RTC_TYPES."""
