# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The releases of the firmware that the emulator can be: one row each, with all that it does otherwise than others."""

import calendar
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from ap_core.log_structure import LogStructure
from ap_visualodom import release as visual_odom
from ap_visualodom.release import VisualOdomRelease
from ekf_stub import release as filters
from ekf_stub.log.replay_log import EKF2_BEFORE_EKF3, EKF3_BEFORE_EKF2
from ekf_stub.release import FilterRelease
from mav_handlers import release as endpoint
from mav_handlers.release import EndpointRelease
from viso.firmware import log_releases
from viso.firmware.log_releases import NUMBERED_TEXTS, PLAIN_TEXTS, LogRelease
from viso.parameters import releases as params
from viso.parameters.releases import ParameterRelease

DEVELOPMENT, BETA, OFFICIAL = 0, 128, 255
"""FIRMWARE_VERSION_TYPE of a master, and of what is released."""


@dataclass(frozen=True, slots=True)
class DdsRelease:
    """What the interface to ROS 2 does (AP_DDS/AP_DDS_Client.cpp).

    Attributes:
        unknown_covariance: what stands first in the covariances of an IMU.
        status_again_ms: after how long a status that has not changed is sent again; None for never.
    """

    unknown_covariance: float
    status_again_ms: int | None


_DDS_OF_2025: Final = DdsRelease(-1.0, None)
_DDS_OF_2026: Final = DdsRelease(0.0, 500)


@dataclass(frozen=True, slots=True)
class Firmware:
    """A release: its texts, version numbers and what it does where releases differ.

    Attributes:
        name: as ``--firmware`` takes it.
        date: when it came out, or of the master that it is: year, month and, where it is known, day.
        version_text: how it introduces itself.
        source_hash: 8 hex digits of its revision.
        major, minor, patch: version numbers.
        release_type: FIRMWARE_VERSION_TYPE, 0 development to 255 official.
        visual_odom: what AP_VisualOdom does.
        endpoint: what the MAVLink endpoint does.
        event_order: the replay records of an event that both filters know, in their order.
        log: what its log records look like.
        params: which parameters there are.
        ekf: what EKF3 does.
        dds: what its interface to ROS 2 does.
        variance_texts: the texts for variances of the EKF over thresholds, and for a lost position.
        reads_flow_rates: whether flow_rate_x and flow_rate_y of OPTICAL_FLOW are read, in rad/s, once one of them is
            not zero (AP_OpticalFlow_MAV::handle_msg); otherwise flow_x and flow_y alone are, times the period.
        reports_ekf_failure: an EKF failsafe is told even if the vehicle stays in its mode, as FS_EKF_ACTION 0 has it;
            else that value lands, too (Copter::failsafe_ekf_event).
        checks_unused_gps: arming in a mode that needs a position asks for a good GPS even if the active source set
            takes nothing from it (AP_Arming_Copter::gps_checks).
        keeps_origin: the filter's origin is logged however it was set, and AHRS_OPTIONS may keep it in parameters
            (AP_AHRS::record_origin).
    """

    name: str
    date: str
    version_text: str
    source_hash: str
    major: int
    minor: int
    patch: int
    release_type: int
    visual_odom: VisualOdomRelease
    endpoint: EndpointRelease
    event_order: tuple[LogStructure, LogStructure]
    log: LogRelease
    params: ParameterRelease
    ekf: FilterRelease
    dds: DdsRelease = _DDS_OF_2025
    variance_texts: tuple[str, str] = ("EKF variance", "EKF variance")
    reads_flow_rates: bool = False
    reports_ekf_failure: bool = True
    checks_unused_gps: bool = True
    keeps_origin: bool = False

    @property
    def version(self) -> tuple[int, int]:
        """Return the version's major and minor number."""
        return self.major, self.minor

    @property
    def month(self) -> str:
        """Return the date as recordings of a master name it, such as February 2026."""
        year, month, *_ = self.date.split("-")
        return f"{calendar.month_name[int(month)]} {year}"

    @property
    def banner(self) -> str:
        """Return the text by which ground stations and log readers know the vehicle."""
        return f"{self.version_text} ({self.source_hash})"

    @property
    def sw_version(self) -> int:
        """Return AUTOPILOT_VERSION.flight_sw_version: major, minor, patch and type, a byte each."""
        return self.major << 24 | self.minor << 16 | self.patch << 8 | self.release_type


STABLE_4_6: Final = Firmware(
    "4.6",
    "2025-11-04",
    "ArduCopter V4.6.3",
    "3fc7011a",
    4,
    6,
    3,
    BETA,  # so 4.6.3 says of itself
    visual_odom.STABLE_4_6,
    endpoint.STABLE_4_6,
    EKF2_BEFORE_EKF3,
    log_releases.STABLE_4_6,
    params.STABLE_4_6,
    filters.STABLE_4_6,
    reports_ekf_failure=False,
)

JULY_2025: Final = Firmware(
    "2025-07",
    "2025-07-21",
    "ArduCopter V4.7.0-dev",
    "2b361bde",
    4,
    7,
    0,
    DEVELOPMENT,
    visual_odom.JULY_2025,
    endpoint.JULY_2025,
    EKF2_BEFORE_EKF3,
    PLAIN_TEXTS,
    params.JULY_2025,
    filters.JULY_2025,
)

FEBRUARY_2026: Final = Firmware(
    "2026-02",
    "2026-02",
    "ArduCopter V4.7.0-dev",
    "2f511151",
    4,
    7,
    0,
    DEVELOPMENT,
    visual_odom.FEBRUARY_2026,
    endpoint.FEBRUARY_2026,
    EKF3_BEFORE_EKF2,
    NUMBERED_TEXTS,
    params.FEBRUARY_2026,
    filters.FEBRUARY_2026,
    _DDS_OF_2026,
    reads_flow_rates=True,
    checks_unused_gps=False,
    keeps_origin=True,
)

# The branch is in no public copy that was read: its code is that of its branch point, b1571a08, with what release notes
# name of the master's commits since. The revision of 4.7.1 is that of its banner in public logs.
STABLE_4_7: Final = Firmware(
    "4.7",
    "2026-07-14",
    "ArduCopter V4.7.1",
    "dbe79216",
    4,
    7,
    1,
    OFFICIAL,
    visual_odom.STABLE_4_7,
    endpoint.STABLE_4_7,
    EKF3_BEFORE_EKF2,
    log_releases.STABLE_4_7,
    params.STABLE_4_7,
    filters.STABLE_4_7,
    _DDS_OF_2026,
    reads_flow_rates=True,
    checks_unused_gps=False,
    keeps_origin=True,
)

APRIL_2026: Final = Firmware(
    "2026-04",
    "2026-04",
    "ArduCopter V4.8.0-dev",
    "5086d81c",
    4,
    8,
    0,
    DEVELOPMENT,
    visual_odom.APRIL_2026,
    endpoint.APRIL_2026,
    EKF3_BEFORE_EKF2,
    log_releases.APRIL_2026,
    params.APRIL_2026,
    filters.APRIL_2026,
    _DDS_OF_2026,
    ("EKF variance: over thresholds", "EKF variance: position lost"),
    reads_flow_rates=True,
    checks_unused_gps=False,
    keeps_origin=True,
)

PROFILES: Final[Mapping[str, Firmware]] = MappingProxyType(
    {profile.name: profile for profile in (STABLE_4_6, JULY_2025, FEBRUARY_2026, STABLE_4_7, APRIL_2026)}
)
"""The releases by the names that ``--firmware`` takes, the oldest first."""

DEFAULT: Final = STABLE_4_7
"""The release that is meant where none is named."""

ALIASES: Final[Mapping[str, str]] = MappingProxyType({"4.7-dev": JULY_2025.name})
"""Other names that ``--firmware`` takes."""
