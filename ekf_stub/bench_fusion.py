# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the bench's filter makes of the samples that come due in a step.

FIRMWARE PARITY: position and velocity are those of the last sample in use, without a filter, gates or lever arm.
Which sample is in use, and what times out without one, is as in AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import u32
from ap_core.clock import Clock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ap_core.verdict import Rule
from ekf_stub import ingest_rules as rules
from ekf_stub.aiding import Aiding, AidingMode
from ekf_stub.bench_yaw import BenchYaw
from ekf_stub.ext_nav_ingest import ExtNavIngest, OdometrySample, PoseSample, VelocitySample
from ekf_stub.gps_checks import GpsChecks
from ekf_stub.gps_sample import GpsSample
from ekf_stub.sources import EkfSources, SourceXY, SourceZ

HEIGHT_FRESH_MS: Final = 500
HEIGHT_LOST_MS: Final = 5000
HEIGHT_LOST_WITH_VELOCITY_MS: Final = 10_000
# NavEKF3_core::ConstrainStates
MAX_NE: Final = f32(50e6)
MIN_D: Final = f32(-4e4)
MAX_D: Final = f32(1e4)
MAX_SPEED: Final = f32(500)


def is_finite(vector: Vector3f) -> bool:
    """Tell whether no component is infinite or not a number."""
    return all(math.isfinite(value) for value in vector.to_tuple())


def _limited(value: np.float32, low: np.float32, high: np.float32) -> np.float32:
    return min(max(value, low), high)


class BenchFusion:
    """Position and velocity, and when which of them was last renewed.

    Args:
        clock: time since boot.
        sources: the source sets.
        ingest: the samples.
        gps: the GPS's solutions.
        yaw: the attitude.
        origin: returns the EKF origin.
        read_gps: returns the newest solution of the GPS.

    Attributes:
        aiding: the mode and the timeouts.
        position: metres NED from the origin.
        velocity: m/s NED.
        pose: the pose that came due in the last step.
        fix: the solution of the GPS that came in the last step.
        last_velocity: the last velocity that came due, in use or not.
        height_timeout: height is lost.
        keeps_velocity: whether a velocity was in use since aiding began.
        fuses_odometry: whether odometry was in use since aiding ended.
    """

    def __init__(
        self,
        clock: Clock,
        sources: EkfSources,
        ingest: ExtNavIngest,
        gps: GpsChecks,
        yaw: BenchYaw,
        origin: Callable[[], Location | None],
        read_gps: Callable[[], GpsSample | None],
    ) -> None:
        self._clock = clock
        self._sources = sources
        self._ingest = ingest
        self._gps = gps
        self._yaw = yaw
        self._origin = origin
        self._read_gps = read_gps
        self.aiding = Aiding()
        self.position = Vector3f()
        self.velocity = Vector3f()
        self.pose: PoseSample | None = None
        self.fix: GpsSample | None = None
        self.last_velocity = Vector3f()
        self.height_timeout = True
        self.keeps_velocity = False
        self.fuses_odometry = False
        # Where the barometer says the vehicle is; its offset follows the other sources of height.
        self._baro_down = f32(0)

    def move(self, to: Vector3f) -> None:
        """Set the position, within the filter's limits."""
        north, east = _limited(to.x, -MAX_NE, MAX_NE), _limited(to.y, -MAX_NE, MAX_NE)
        self.position = Vector3f(north, east, _limited(to.z, MIN_D, MAX_D))

    def set_velocity(self, to: Vector3f) -> None:
        """Set the velocity, within the filter's limits."""
        self.velocity = Vector3f(*(_limited(value, -MAX_SPEED, MAX_SPEED) for value in to.to_tuple()))

    def step(self) -> None:
        """Take in what has come due (SelectVelPosFusion)."""
        now_ms = self._clock.millis()
        self.pose = self._recall_pose()
        velocity = self._ingest.recall_velocity()
        self.fix = self._gps.update(self._read_gps(), now_ms)
        self._use_position(now_ms)
        if velocity is not None:
            self._ingest.count("velocity", self._use_velocity(velocity, now_ms))
        self._use_height(now_ms)

    def _recall_pose(self) -> PoseSample | None:
        pose = self._ingest.recall_pose()
        if pose is not None and not is_finite(pose.pos):
            self._ingest.count("pose", rules.NOT_FINITE)
            return None
        return pose

    def _use_position(self, now_ms: int) -> None:
        aiding = self.aiding
        by_ext_nav = aiding.mode is AidingMode.ABSOLUTE and self._sources.pos_xy() == SourceXY.EXTNAV
        if self.pose is not None:
            self._ingest.count("pose", rules.FUSED if by_ext_nav else rules.UNUSED)
        if aiding.mode is AidingMode.NONE:
            aiding.times.pos = now_ms  # the last known position is fused along with the height
        elif aiding.mode is AidingMode.ABSOLUTE and self._move_to_measured(by_ext_nav, now_ms):
            aiding.times.pos = now_ms
            if aiding.pos_timeout:
                # Position that comes back after it was lost resets the filter to it, and velocity to what there is.
                aiding.pos_timeout = aiding.vel_timeout = False
                aiding.times.vel = now_ms

    def _move_to_measured(self, by_ext_nav: bool, now_ms: int) -> bool:
        origin = self._origin()
        if by_ext_nav and self.pose is not None:
            self.move(Vector3f(self.pose.pos.x, self.pose.pos.y, self.position.z))
            return True
        if self._sources.pos_xy() != SourceXY.GPS or self.fix is None or origin is None:
            return False
        way = origin.distance_ned(self.fix.location)
        self.move(Vector3f(way.x, way.y, self.position.z))
        if self._sources.uses_vel_xy(SourceXY.GPS):
            self.set_velocity(self.fix.vel_ned)
            self.aiding.times.vel = now_ms
        return True

    def _use_velocity(self, sample: VelocitySample, now_ms: int) -> Rule:
        if not is_finite(sample.vel):
            return rules.NOT_FINITE
        self.last_velocity = sample.vel
        # Without aiding the filter is told that it stands still.
        if not self._sources.uses_vel_xy(SourceXY.EXTNAV) or self.aiding.mode is AidingMode.NONE:
            return rules.UNUSED
        down = sample.vel.z if self._sources.uses_vel_z(SourceZ.EXTNAV) else f32(0)
        self.set_velocity(Vector3f(sample.vel.x, sample.vel.y, down))
        self.aiding.times.vel = now_ms
        self.keeps_velocity = True
        return rules.FUSED

    def _use_height(self, now_ms: int) -> None:
        times = self.aiding.times
        if not self._height_is_from_ext_nav(now_ms):
            gps_down = self._gps_down()
            self._move_vertically(self._baro_down if gps_down is None else gps_down)
            times.height = now_ms
        elif self.pose is not None:
            self._move_vertically(self.pose.pos.z)
            times.height = now_ms
        self._baro_down = self.position.z
        with_velocity = self._ingest.have_velocity and not self.aiding.vel_timeout
        lost_ms = HEIGHT_LOST_WITH_VELOCITY_MS if with_velocity else HEIGHT_LOST_MS
        self.height_timeout = u32(now_ms - times.height) > lost_ms

    def _height_is_from_ext_nav(self, now_ms: int) -> bool:
        # Stale, it gives way to the barometer, which goes on from where it ended.
        fresh = u32(now_ms - self._ingest.pose_stamp_ms) < HEIGHT_FRESH_MS
        return fresh and self._sources.pos_z() == SourceZ.EXTNAV

    def _gps_down(self) -> np.float32 | None:
        origin = self._origin()
        if self._sources.pos_z() != SourceZ.GPS or self.fix is None or origin is None:
            return None
        return origin.distance_ned(self.fix.location).z

    def _move_vertically(self, down: np.float32) -> None:
        self.move(Vector3f(self.position.x, self.position.y, down))

    def reset_height(self) -> None:
        """Let heights count from the present one, which is the barometer's zero."""
        self._move_vertically(f32(0))
        self._baro_down = f32(0)

    def step_odometry(self) -> bool:
        """Take in the odometry that has come due; tell whether it is the first since aiding ended."""
        sample = self._ingest.recall_odometry()
        if sample is None:
            return False
        rule = self._use_odometry(sample)
        self._ingest.count("odometry", rule)
        is_first = rule is rules.FUSED and not self.fuses_odometry
        self.fuses_odometry |= is_first
        return is_first

    def _use_odometry(self, sample: OdometrySample) -> Rule:
        if not is_finite(sample.vel):
            return rules.NOT_FINITE
        if not self._sources.uses_vel_xy(SourceXY.EXTNAV):
            return rules.UNUSED
        self.aiding.times.odometry = self._clock.millis()
        if self.aiding.mode is not AidingMode.NONE:
            self.set_velocity(self._yaw.quaternion().rotate_vector(sample.vel))
        return rules.FUSED
