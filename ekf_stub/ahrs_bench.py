# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A stationary vehicle, level, with a given heading, that believes what it is told once EKF3 would."""

from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.clock import Clock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.aiding import AidingMode
from ekf_stub.bench_filter import BenchFilter
from ekf_stub.bench_yaw import BenchYaw
from ekf_stub.core_texts import MAV_SEVERITY_INFO
from ekf_stub.ext_nav_log import ExtNavLog
from ekf_stub.filter_status import FilterFlag, FilterStatus
from ekf_stub.gps_sample import FIX_3D
from ekf_stub.source_check import source_failure
from ekf_stub.sources import EkfSources, SourceYaw
from ekf_stub.surroundings import Surroundings

_OLD_EXTERNAL_YAW: Final = (5, 6)  # of EK3_MAG_CAL
_HORIZ_POS: Final = FilterFlag.HORIZ_POS_ABS | FilterFlag.HORIZ_POS_REL


class BenchAhrs(AhrsBase):
    """The AHRS of a vehicle on the bench.

    Args:
        heading_rad: the vehicle's true yaw.
        has_compass: tells whether a compass is in use; without one DCM's yaw is never initialised.
        around: the vehicle around it.
    """

    def __init__(
        self,
        clock: Clock,
        sources: EkfSources,
        log: ExtNavLog,
        *,
        heading_rad: float = 0.0,
        has_compass: Callable[[], bool] = lambda: True,
        around: Surroundings | None = None,
        start_us: int = AHRS_START_US,
    ) -> None:
        super().__init__(clock, sources, log, start_us=start_us)
        self._around = around or Surroundings()
        self._yaw = BenchYaw(clock, sources, f32(heading_rad), has_compass)
        self._has_compass = has_compass
        self._filter = BenchFilter(clock, sources, self._around, self.ext_nav_counts, self._yaw, self.origin)
        self._ingest = self._filter.ingest

    def update(self) -> None:
        """Run one frame of the filter; GPS that is good enough sets the origin."""
        if not self.estimator_started():
            return
        was_active = self._filter.active
        self._filter.update()
        if self._filter.active and not was_active:
            self._around.texts.send_text(MAV_SEVERITY_INFO, "AHRS: EKF3 active")
        gps = self._filter.gps
        if gps.good and gps.newest is not None and self.origin() is None:
            self.set_origin(gps.newest.location)

    def dcm_yaw_initialised(self) -> bool:
        """Tell whether there has been a compass heading."""
        return self.started() and self._has_compass()

    def using_extnav_for_yaw(self) -> bool:
        """Tell whether yaw comes from external navigation (NavEKF3_core::using_extnav_for_yaw)."""
        return self.estimator_started() and self._yaw.uses_ext_nav()

    def get_yaw_rad(self) -> np.float32:
        """Return the yaw, which is the heading until external navigation or GPS give another."""
        return self._yaw.yaw

    def get_quaternion(self) -> Quaternion | None:
        """Return the level attitude, once the AHRS runs."""
        return self._yaw.quaternion() if self.started() else None

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position while the filter navigates; it needs no origin for that."""
        navigates = self._filter.mode is not AidingMode.NONE
        return self._filter.position if navigates and self._has(FilterFlag.VERT_POS) else None

    def get_velocity_NED(self) -> Vector3f | None:
        """Return the velocity, as soon as the filter runs."""
        return self._filter.velocity if self._filter.active else None

    def get_location(self) -> Location | None:
        """Return the filter's place while it has one, else that of the GPS (NavEKF3_core::getLLH)."""
        origin, position = self.origin(), self.get_relative_position_NED_origin_float()
        if origin is not None and position is not None and self._has(_HORIZ_POS):
            return origin.offset(position)
        fix = self._around.gps()
        has_fix = self._filter.active and fix is not None and fix.fix_type >= FIX_3D
        return fix.location if has_fix and fix is not None else None

    def _has(self, flag: FilterFlag) -> bool:
        return bool(self._filter.flags & flag)

    def get_filter_status(self) -> FilterStatus | None:
        """Return the filter's flags, once there are cores."""
        return FilterStatus(self._filter.flags) if self._filter.has_cores else None

    def healthy(self) -> bool:
        """Tell whether the filter runs well."""
        return self._filter.active and self._filter.healthy()

    def reset_height_datum(self) -> bool:
        """Let heights count from the present one, on the ground (NavEKF3_core::resetHeightDatum)."""
        on_ground = self._filter.has_cores and not self._around.is_armed()
        if on_ground:
            self._filter.reset_height()
        return on_ground

    def handle_external_position_estimate(self, location: Location, accuracy_m: np.float32, time_ms: int) -> bool:
        """Put the vehicle somewhere while it navigates without a position; tell whether it was."""
        origin = self.origin()
        return origin is not None and self._filter.set_position(origin.distance_ned(location))

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what keeps the vehicle from arming, the text after ``AHRS: ``, or None (AP_AHRS::pre_arm_check)."""
        if not self._filter.active:
            return "not using configured AHRS type" if self._has_compass() else "EKF3 not started"
        failure = source_failure(self._sources, self._around.is_fitted, requires_position=requires_position)
        if failure is not None:
            return failure
        if self._around.get_int("EK3_MAG_CAL") in _OLD_EXTERNAL_YAW and self._yaw.source() != SourceYaw.GPS:
            return "EK3_MAG_CAL and EK3_SRC1_YAW inconsistent"
        if self.healthy():
            return None
        return self._filter.failure_reason() or "EKF3 core 0 unhealthy"
