# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a copter is made of."""

from collections.abc import Callable
from dataclasses import dataclass

from ap_core.clock import Clock
from ap_core.internal_error import InternalErrors
from ap_core.param import ParamTable
from ap_core.sinks import TextSink
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.gps_sample import GpsSample
from viso.logs.logger import Logger
from viso.logs.vehicle_log import VehicleLog
from viso.parameters.releases import REFERENCE, ParameterRelease
from viso.sensors.flying.source import FlyingSource
from viso.vehicle.flow import MavlinkFlow
from viso.vehicle.ranges import MavlinkRanges


@dataclass(frozen=True)
class CopterParts:
    """The vehicle around a copter.

    Attributes:
        gps: returns the newest solution of the GPS; None without a GPS.
        is_initialised: says whether booting is over.
        is_downloading: says whether a client is downloading a log.
        on_mode, on_armed: called when the mode has changed, and when the vehicle has been armed.
        airframe: what flies; None of a vehicle that nobody flies.
        stands_for_ever: nothing can move it.
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
    gps: Callable[[], GpsSample | None]
    is_initialised: Callable[[], bool]
    is_downloading: Callable[[], bool]
    on_mode: Callable[[], None]
    on_armed: Callable[[], None]
    airframe: FlyingSource | None = None
    stands_for_ever: bool = False
    release: ParameterRelease = REFERENCE
    variance_texts: tuple[str, str] = ("EKF variance", "EKF variance")
