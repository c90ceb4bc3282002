# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an AHRS is made of."""

from collections.abc import Callable
from dataclasses import dataclass

from ap_core.clock import Clock
from ap_core.location import Location
from ap_core.param import ParamTable
from ap_core.sinks import RecordSink, TextSink
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.source_check import BARO, COMPASS, GPS, OPTICAL_FLOW, RANGEFINDER, VISUAL_ODOM
from ekf_stub.core.params import EkfSources
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.range_state import DOWNWARD, RangeState
from ekf_stub.log.replay_log import ReplayLog
from ekf_stub.release import REFERENCE, FilterRelease


@dataclass(frozen=True, slots=True)
class AhrsParts:
    """The vehicle around an AHRS.

    Attributes:
        log: where inputs are logged.
        logger: where estimates are logged.
        gps: returns the newest solution of the GPS.
        gps_lag_s: returns how late the GPS is said to be, s.
        on_yaw_reset: is called as the estimator's yaw has jumped.
        on_primary: is called with the number of the primary core as another has become that.
        flying_since_us: since when the vehicle has been flying, us since boot; None on the ground.
        home: returns home, None while it is unset.
        ranges: returns what the range finders say, the same until that changes; None without any.
        expected: says whether a take-off is expected, and whether a touchdown is.
    """

    clock: Clock
    sources: EkfSources
    log: ReplayLog
    logger: RecordSink
    params: ParamTable
    texts: TextSink
    gps: Callable[[], GpsSample | None]
    gps_lag_s: Callable[[], float]
    is_armed: Callable[[], bool]
    visual_odom_enabled: Callable[[], bool]
    on_yaw_reset: Callable[[], None]
    on_primary: Callable[[int], None]
    flying_since_us: Callable[[], int | None]
    home: Callable[[], Location | None]
    release: FilterRelease = REFERENCE
    ranges: Callable[[], RangeState | None] = lambda: None
    expected: Callable[[], tuple[bool, bool]] = lambda: (False, False)

    def is_fitted(self, sensor: str) -> bool:
        """Return whether there is a sensor that EKF sources may need, by its name in ``source_check.SENSORS``."""
        fitted = {
            BARO: True,
            COMPASS: self.has_compass(),
            GPS: self.params.get_int("GPS1_TYPE") != 0,
            OPTICAL_FLOW: self.has_flow(),
            RANGEFINDER: self._looks_down(),
            VISUAL_ODOM: self.visual_odom_enabled(),
        }
        return fitted.get(sensor, False)

    def has_flow(self) -> bool:
        """Return whether there is to be a flow sensor (AP_OpticalFlow::enabled)."""
        return self.params.get_int("FLOW_TYPE") != 0

    def _looks_down(self) -> bool:
        ranges = self.ranges()
        return ranges is not None and any(finder.orientation == DOWNWARD for finder in ranges.finders)

    def has_compass(self) -> bool:
        """Return whether there is a compass, and in use."""
        return self.params.get_int("COMPASS_ENABLE") != 0 and self.params.get_int("COMPASS_USE") != 0

    def imu_pos(self, imu: int = 0) -> Vector3f:
        """Return the place of an IMU on the vehicle, m, body (FRD)."""
        return Vector3f(*(self.params.get_float(f"INS_POS{imu + 1}_{axis}") for axis in "XYZ"))

    def imu_mask(self) -> int:
        """Return which IMUs get a core; none when EK3_ENABLE is off."""
        return self.params.get_int("EK3_IMU_MASK") if self.params.get_int("EK3_ENABLE") else 0
