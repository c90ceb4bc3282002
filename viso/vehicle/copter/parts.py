# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a copter is made of."""

from dataclasses import dataclass

from ap_core.clock import Clock
from ap_core.internal_error import InternalErrors
from ap_core.param import ParamTable
from ap_core.sinks import TextSink
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.gps_sample import GpsSample
from mav_handlers.transfers.log_transfer import LogTransfer
from viso.logs.logger import Logger
from viso.logs.vehicle_log import VehicleLog
from viso.parameters.releases import REFERENCE, ParameterRelease
from viso.vehicle.flow import MavlinkFlow
from viso.vehicle.gps import MavlinkGps
from viso.vehicle.ranges import MavlinkRanges
from viso.vehicle.sensors.source import VehicleSource


@dataclass(frozen=True)
class CopterParts:
    """The vehicle around a copter.

    Attributes:
        source: where the sensors' data come from, and what flies.
        variance_texts: what is told as the EKF's variances are over thresholds, and as its position is lost.
    """

    clock: Clock
    params: ParamTable
    texts: TextSink
    log: VehicleLog
    logger: Logger
    ahrs: AhrsBase
    visual_odom: AP_VisualOdom
    internal_errors: InternalErrors
    flow: MavlinkFlow
    ranges: MavlinkRanges
    gps: MavlinkGps
    source: VehicleSource
    log_transfer: LogTransfer
    release: ParameterRelease = REFERENCE
    variance_texts: tuple[str, str] = ("EKF variance", "EKF variance")

    def newest_gps(self) -> GpsSample | None:
        """Return the newest solution of the GPS; None without a GPS."""
        return self.source.gps() or self.gps.sample()
