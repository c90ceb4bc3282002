# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the endpoint needs of the vehicle, and what handlers need of the endpoint."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from ap_core.internal_error import InternalErrors
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.param import ParamEcho, ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ekf_stub.inputs.flow_measurement import FlowMeasurement
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.reports.filter_status import FilterStatus
from mav_handlers.channel import Channel
from mav_handlers.mission import Mission
from mav_handlers.params.reads import ParamReads
from mav_handlers.radio import RadioLink
from mav_handlers.release import EndpointRelease, OriginSender
from mav_handlers.signing import KeyStore, SigningState
from mav_handlers.statustext import StatusTextQueue
from mav_handlers.transfers.ftp import FtpReply, FtpServer
from mav_handlers.transfers.ftp_ports import FtpFiles
from mav_handlers.transfers.log_transfer import LogTransfer
from mav_handlers.wire.messages import DISTANCE_SENSOR, GPS_INPUT, HIL_SENSOR, HIL_STATE_QUATERNION, OPTICAL_FLOW

__all__ = [
    "AhrsPort",
    "AvailableMode",
    "CopterPort",
    "EndpointPort",
    "FlightPort",
    "FlightTruth",
    "GuidedTarget",
    "Location",
    "LogPort",
    "OriginResult",
    "VehiclePort",
]


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """A flight mode as AVAILABLE_MODES tells it: MAV_STANDARD_MODE 0 is none of those, properties are bits."""

    name: str
    custom_mode: int
    standard_mode: int
    properties: int


class OriginResult(Enum):
    """Outcome of a request to set the EKF origin."""

    SET = "set"
    INVALID = "invalid"
    FAILED = "failed"


class LogPort(Protocol):
    """The records that the endpoint asks the vehicle to write."""

    def dropped(self) -> int:
        """Return the number of log records lost."""

    def failed(self) -> bool:
        """Return whether the log cannot be written."""

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

    def named_value(self, time_boot_ms: int, name: str, value: float, system_id: int, component_id: int) -> None:
        """Write an NVAL record of somebody's named value."""


class AhrsPort(Protocol):
    """What telemetry asks of the AHRS; names are those of AP_AHRS."""

    def initialised(self) -> bool:
        """Return whether the estimator has been running for its settling time."""

    def healthy(self) -> bool:
        """Return whether the estimator runs well."""

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

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""

    def handle_external_position_estimate(self, location: Location, accuracy_m: np.float32, time_ms: int) -> bool:
        """Take a place that somebody else has worked out, at a time in ms since boot; say whether it was used."""

    def height_above_ground(self) -> float | None:
        """Return the height above the ground in m, or None while it is unknown."""

    def get_filter_status(self) -> FilterStatus | None:
        """Return what the estimator says of itself, or None while it does not run."""


class ArmingPort(Protocol):
    """The checks before arming."""

    passed: bool

    def pre_arm_checks(self, display: bool) -> bool:
        """Run all checks; say whether they passed, and failures as texts when asked to."""

    def enabled_checks(self) -> int:
        """Return the bits of the checks that are enabled."""


class HomePort(Protocol):
    """Where home is, None while unset."""

    place: Location | None

    def set(self, place: Location, lock: bool) -> bool:
        """Set home, for good if locked; say whether it was set, for which the EKF needs an origin."""

    def set_here(self, lock: bool) -> bool:
        """Set home to where the vehicle is; say whether that is known."""


@dataclass(frozen=True, slots=True)
class GuidedTarget:
    """What a companion wants of a vehicle in GUIDED; None for what it leaves open.

    Attributes:
        pos_ned_m: a place, from the EKF origin.
        vel_ned_m_s: a velocity; with a place, that of the place.
        acc_ned_m_s2: an acceleration.
        yaw_rad: where to look, or by what angle to turn if ``is_yaw_relative``.
        yaw_rate_rad_s: how fast to turn.
    """

    pos_ned_m: tuple[float, float, float] | None = None
    vel_ned_m_s: tuple[float, float, float] | None = None
    acc_ned_m_s2: tuple[float, float, float] | None = None
    yaw_rad: float | None = None
    yaw_rate_rad_s: float | None = None
    is_yaw_relative: bool = False


@dataclass(frozen=True, slots=True)
class FlightTruth:
    """Where a simulated vehicle really is, and how it moves.

    Attributes:
        place: on earth, None without an EKF origin.
        vel_ned_m_s: its velocity.
        quat_wxyz: its attitude, body (FRD) to earth (NED).
        rpy_rad: the same as roll, pitch and yaw.
        acc_frd_m_s2, rates_frd_rad_s: what ideal inertial sensors say.
    """

    place: Location | None
    vel_ned_m_s: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]
    rpy_rad: tuple[float, float, float]
    acc_frd_m_s2: tuple[float, float, float]
    rates_frd_rad_s: tuple[float, float, float]


class FlightPort(Protocol):
    """Who flies the vehicle."""

    def guide(self, target: GuidedTarget | None) -> None:
        """Obey a target in GUIDED; None to stay where the vehicle is."""

    def place_ned(self, place: Location) -> tuple[float, float, float] | None:
        """Return where a place is, m from the EKF origin; None without an origin."""

    def turn_to(self, yaw_rad: float, slew_rad_s: float, direction: int, *, is_relative: bool) -> None:
        """Look somewhere: at a heading, or turn by an angle; slew 0 is as fast as may be, direction 0 the short way."""

    def change_speed(self, speed_m_s: float) -> None:
        """Fly to targets with this horizontal speed from now on."""

    def override_sticks(self, pwm_us: Sequence[int]) -> None:
        """Move the pilot's sticks, by channel from 1 on; 65535 leaves a channel as it is, 0 gives it back."""

    def truth(self) -> FlightTruth:
        """Return where the vehicle really is."""


class CopterPort(Protocol):
    """What makes the vehicle a copter: its mode, its home, arming, and whether it stands on the ground.

    Attributes:
        safety_on: the safety switch keeps the motors off.
    """

    safety_on: bool

    @property
    def flight(self) -> FlightPort | None:
        """Who flies it; None if nobody does."""

    @property
    def mission(self) -> Mission:
        """The mission, which holds nothing but home."""

    @property
    def home(self) -> HomePort:
        """Home."""

    @property
    def arming(self) -> ArmingPort:
        """The checks before arming."""

    def take_changed(self) -> Sequence[str]:
        """Return, once, the names of the messages that tell of what has changed."""

    def is_armed(self) -> bool:
        """Return whether the motors are armed."""

    def arm(self, do_checks: bool) -> bool:
        """Try to arm; say whether it worked. Failures are told as texts."""

    def disarm(self, force: bool) -> bool:
        """Try to disarm; say whether it worked."""

    def custom_mode(self) -> int:
        """Return the flight mode's number."""

    def available_modes(self) -> Sequence[AvailableMode]:
        """Return the flight modes in the firmware's order; AVAILABLE_MODES counts them from 1."""

    def set_mode(self, number: int) -> bool:
        """Enter a mode; say whether the vehicle is in it now. A refusal is told as a text."""

    def is_holding_height(self) -> bool:
        """Return whether the mode runs the vertical position controller."""

    def is_holding_position(self) -> bool:
        """Return whether the mode runs the horizontal position controller."""

    def is_landed(self) -> bool:
        """Return whether the vehicle stands on the ground."""

    def is_taking_off(self) -> bool:
        """Return whether it climbs to where it was asked to take off to."""

    def is_landing(self) -> bool:
        """Return whether the mode brings it down."""

    def is_in_failsafe(self) -> bool:
        """Return whether a failsafe is active."""

    def take_off(self, altitude_cm: float, must_navigate: bool) -> bool:
        """Start a take-off to a height above home; say whether it was accepted."""


class GpsPort(Protocol):
    """The GPS."""

    def sample(self) -> GpsSample | None:
        """Return its newest solution, or None without a GPS; one that has lost its data has fix type 1."""

    def take(self, packet: GPS_INPUT) -> bool:
        """Give it a solution, whatever its ``gps_id``; say whether there is one that takes it."""


class FlowPort(Protocol):
    """The flow sensor."""

    def enabled(self) -> bool:
        """Return whether there is one."""

    def healthy(self) -> bool:
        """Return whether it works."""

    @property
    def newest(self) -> FlowMeasurement:
        """What it measured last."""

    def take(self, packet: OPTICAL_FLOW) -> bool:
        """Give it flow; say whether there is one that takes it."""


@dataclass(frozen=True, slots=True)
class RangeReport:
    """What a range finder says: its number, kind and orientation as DISTANCE_SENSOR has them, ranges in m.

    ``quality`` is in percent, -1 unknown.
    """

    number: int
    kind: int
    orientation: int
    distance: float
    least: float
    most: float
    quality: int


class RangesPort(Protocol):
    """The range finders; ``is_enabled`` if there was one that looks down as the vehicle booted."""

    is_enabled: bool

    def is_present(self) -> bool:
        """Return whether one looks down."""

    def has_data(self) -> bool:
        """Return whether ranges come in from that, good or not."""

    def downward_m(self) -> float | None:
        """Return its range in m; None without one."""

    def reports(self) -> Sequence[RangeReport]:
        """Return what each says from which ranges come in."""

    def take(self, packet: DISTANCE_SENSOR) -> bool:
        """Give them a range; say whether there is one that takes it."""


class HilPort(Protocol):
    """A simulator that the vehicle's sensors come from; times in us since boot."""

    def take_hil_sensor(self, message: HIL_SENSOR, now_us: int) -> None:
        """Take its sensors."""

    def take_hil_state(self, message: HIL_STATE_QUATERNION, now_us: int) -> None:
        """Take its truth."""


class RtcPort(Protocol):
    """The time of day."""

    def utc_us(self) -> int:
        """Return it in us since 1970, 0 while unknown."""

    def take_system_time(self, utc_us: int) -> None:
        """Take it from SYSTEM_TIME, subject to BRD_RTC_TYPES."""


class VehiclePort(Protocol):
    """The vehicle as the endpoint sees it.

    Attributes:
        battery_monitor: BATT_MONITOR at boot, which is when monitors are looked for.
    """

    battery_monitor: int
    params: ParamTable
    texts: StatusTextQueue
    visual_odom: AP_VisualOdom
    internal_errors: InternalErrors
    signing_store: KeyStore

    @property
    def release(self) -> EndpointRelease:
        """Which release the endpoint is to be, where they differ."""

    @property
    def ahrs(self) -> AhrsPort:
        """The estimates of attitude and position."""

    @property
    def copter(self) -> CopterPort:
        """What makes it a copter."""

    @property
    def gps(self) -> GpsPort:
        """The GPS."""

    @property
    def flow(self) -> FlowPort:
        """The flow sensor."""

    @property
    def ranges(self) -> RangesPort:
        """The range finders."""

    @property
    def hil(self) -> HilPort | None:
        """The simulator that its sensors come from, if they do."""

    @property
    def rtc(self) -> RtcPort:
        """The time of day."""

    @property
    def log(self) -> LogPort:
        """Where the endpoint's log records go."""

    @property
    def files(self) -> FtpFiles:
        """What MAVLink FTP shows."""

    @property
    def log_transfer(self) -> LogTransfer:
        """Listing, downloading and erasing logs."""

    def firmware_version(self) -> tuple[int, str, str]:
        """Return flight_sw_version, the version text and the source hash (8 characters)."""

    def banner(self) -> tuple[str, ...]:
        """Return the texts that introduce the vehicle."""

    def is_initialised(self) -> bool:
        """Return whether booting is over."""

    def is_time_to_log(self) -> bool:
        """Return whether the vehicle is in a state in which it logs."""

    def request_reboot(self) -> None:
        """Restart, once the answer to the command has left."""

    def set_source_set(self, index: int) -> None:
        """Choose one of the three EKF source sets, 0..2."""

    def set_origin(self, location: Location) -> OriginResult:
        """Set the EKF origin, once."""

    def last_location(self) -> Location | None:
        """Return where the vehicle is, or was when that was last known; None before the first time."""


class EndpointPort(OriginSender, Protocol):
    """The endpoint as its handlers see it: its links, what they share, and what is sent besides an answer."""

    channels: list[Channel]
    ftp: FtpServer
    log_transfer: LogTransfer
    param_reads: ParamReads
    radio: RadioLink
    signing: SigningState

    def send_banner(self, channel: Channel) -> None:
        """Introduce the vehicle in texts to one link."""

    def send_ftp_replies(self, replies: Iterable[FtpReply]) -> None:
        """Send replies of the file server, each to whom it is for."""

    def pump_log_transfer(self, channel: Channel, now_us: int) -> None:
        """Send the next part of a listing or of a log on a link, as far as it takes any."""

    def echo_parameters(self, echoes: Iterable[ParamEcho]) -> None:
        """Queue the echoes of a changed parameter for every active link."""
