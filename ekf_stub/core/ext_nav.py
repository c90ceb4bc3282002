# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""External navigation: which samples are taken, with what time, and what of them the fusion horizon has reached.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (writeExtNavData, writeExtNavVelData, writeBodyFrameOdom),
AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp (CorrectExtNavForSensorOffset, CorrectExtNavVelForSensorOffset). Times are ms
since boot, unsigned 32 bit: a stamp that steps backwards is a long way off, and therefore taken.
"""

import math
from typing import Final, TypeVar, final

from ekf_stub.core import events as ev
from ekf_stub.core.events import Events
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.samples import (
    HALF_FILTER_STEP_MS,
    RECALL_WINDOW_MS,
    SENSOR_INTERVAL_MIN_MS,
    ObsRing,
    OdometrySample,
    PoseSample,
    RingSizes,
    Sample,
    VelocitySample,
    YawSample,
)
from ekf_stub.core.vectors import (
    U32,
    Rotation,
    Vec2,
    Vec3,
    cross,
    is_finite,
    is_zero,
    later_ms,
    scaled,
    signed_since_ms,
    since_ms,
    sub,
    to_earth,
)

_INTERVAL_MIN_MS: Final = 20
_DT_EKF_AVG: Final = 0.012500000186264515  # float32 of 0.0125, where the firmware's average settles at 400 Hz
_MIN_YAW_ERR: Final = 0.08726646006107330  # float32 of 5 degrees


T = TypeVar("T", bound=Sample)


@final
class ExtNav:
    """Takes samples or refuses them, keeps what waits for the horizon, and the last that the horizon has reached.

    Args:
        sizes: of the buffers; None when no source set names external navigation, or before the cores are set up.
        is_set_up: whether the cores are set up.

    Attributes:
        initialised: whether the filter has a state.
        horizon_ms: the time of the oldest inertial data, to which later measurements are compared.
        have_pose, have_odometry: whether one has ever been taken.
        have_velocity: the same of a velocity (useExtNavVel).
        pose_stamp_ms: the stamp of the last pose taken, before any correction (extNavMeasTime_ms).
        velocity_stamp_ms: the same of the last velocity taken.
        odometry_ms: the time of the last odometry taken.
        odometry_err: its error in m/s.
        pose, velocity: the last that the horizon has reached, at the place of the IMU, however old.
        has_pose, has_velocity: whether it came in this step.
    """

    def __init__(self, events: Events, sizes: RingSizes | None, is_set_up: bool) -> None:
        self._events = events
        self._is_set_up = is_set_up
        ext_nav = 0 if sizes is None else sizes.ext_nav
        self._poses: ObsRing[PoseSample] = ObsRing(ext_nav)
        self._yaws: ObsRing[YawSample] = ObsRing(ext_nav)
        self._velocities: ObsRing[VelocitySample] = ObsRing(ext_nav)
        self._odometry: ObsRing[OdometrySample] = ObsRing(0 if sizes is None else sizes.slow)
        self.reset()

    def reset(self) -> None:
        """Forget everything, as the filter restarts (NavEKF3_core::InitialiseVariables)."""
        self.initialised = False
        self.horizon_ms = 0
        self.have_pose = False
        self.have_velocity = False
        self.have_odometry = False
        self.pose_stamp_ms = 0
        self.velocity_stamp_ms = 0
        self.odometry_ms = 0
        self.odometry_err = 0.0
        self._reset_time_ms = 0
        self.pose: PoseSample | None = None
        self.velocity: VelocitySample | None = None
        self.has_pose = False
        self.has_velocity = False
        self._poses.clear()
        self._yaws.clear()
        self._velocities.clear()
        self._odometry.clear()

    # What is handed in

    def write_pose(
        self, pos: Vec3, pos_err: float, yaw: float, yaw_err: float, stamp_ms: int, delay_ms: int, reset_ms: int
    ) -> None:
        """Take a position and a yaw, m and rad, with their errors, or refuse them (writeExtNavData).

        A yaw that is NaN is refused alone.
        """
        time_ms = self._observed_ms(stamp_ms, delay_ms)
        refusal = self._refuse_pose(pos, pos_err, stamp_ms)
        if refusal != ev.TAKEN:
            self._events.tell(ev.POSE, refusal, time_ms)
            return
        self.pose_stamp_ms = stamp_ms
        self.have_pose = True
        is_reset = reset_ms != self._reset_time_ms
        self._reset_time_ms = reset_ms
        self._push(self._poses, PoseSample(time_ms, pos, pos_err, is_reset), ev.POSE)
        if math.isnan(yaw) or math.isnan(yaw_err):
            self._events.tell(ev.YAW, ev.YAW_NOT_A_NUMBER, time_ms)
        else:
            err = _MIN_YAW_ERR if yaw_err < _MIN_YAW_ERR else yaw_err
            self._push(self._yaws, YawSample(time_ms, yaw, err), ev.YAW)

    def _refuse_pose(self, pos: Vec3, pos_err: float, stamp_ms: int) -> int:
        if not self._is_set_up:
            return ev.NOT_STARTED
        if _has_nan(pos) or math.isnan(pos_err):
            return ev.NOT_A_NUMBER
        if since_ms(stamp_ms, self.pose_stamp_ms) < _INTERVAL_MIN_MS:
            return ev.TOO_SOON
        return ev.TAKEN if self.initialised else ev.NOT_INITIALISED

    def write_velocity(self, vel: Vec3, err: float, stamp_ms: int, delay_ms: int) -> None:
        """Take a velocity in m/s, even before there is a state, or refuse it (writeExtNavVelData)."""
        time_ms = self._observed_ms(stamp_ms, delay_ms)
        refusal = self._refuse_velocity(vel, err, stamp_ms)
        if refusal != ev.TAKEN:
            self._events.tell(ev.VELOCITY, refusal, time_ms)
            return
        self.velocity_stamp_ms = stamp_ms
        self.have_velocity = True
        self._push(self._velocities, VelocitySample(time_ms, vel, err), ev.VELOCITY)

    def _refuse_velocity(self, vel: Vec3, err: float, stamp_ms: int) -> int:
        if not self._is_set_up:
            return ev.NOT_STARTED
        if _has_nan(vel) or math.isnan(err):
            return ev.NOT_A_NUMBER
        too_soon = since_ms(stamp_ms, self.velocity_stamp_ms) < _INTERVAL_MIN_MS
        return ev.TOO_SOON if too_soon else ev.TAKEN

    def write_odometry(
        self, vel: Vec3, err: float, del_time: float, has_nan: bool, stamp_ms: int, delay_ms: int, offset: Vec3
    ) -> None:
        """Take a body odometry, or refuse it (writeBodyFrameOdom).

        The interval is measured from the last sample's time with the delay taken off, so it may be shorter than 50 ms
        by the delay.

        Args:
            vel, err: velocity and its error, m/s, body (FRD).
            del_time: the interval over which it was measured, s.
            has_nan: whether anything that was handed in is NaN.
            stamp_ms, delay_ms: when it came, and how late.
            offset: the camera's place from the IMU, m, body (FRD).
        """
        time_ms = (stamp_ms - delay_ms) & U32
        refusal = self._refuse_odometry(del_time, has_nan, stamp_ms)
        if refusal != ev.TAKEN:
            self._events.tell(ev.ODOMETRY, refusal, time_ms)
            return
        self.odometry_ms = time_ms
        self.have_odometry = True
        self.odometry_err = err
        self._push(self._odometry, OdometrySample(time_ms, vel, err, offset), ev.ODOMETRY)

    def _refuse_odometry(self, del_time: float, has_nan: bool, stamp_ms: int) -> int:
        if not self._is_set_up:
            return ev.NOT_STARTED
        if has_nan:
            return ev.NOT_A_NUMBER
        if since_ms(stamp_ms, self.odometry_ms) < SENSOR_INTERVAL_MIN_MS:
            return ev.TOO_SOON
        if del_time < _DT_EKF_AVG:
            return ev.TOO_SHORT
        return ev.TAKEN if self.initialised else ev.NOT_INITIALISED

    def _observed_ms(self, stamp_ms: int, delay_ms: int) -> int:
        """Return the time of the observation, never before the horizon: what comes late is fused as if in time.

        FIRMWARE PARITY: a stamp beyond half of 2^32 ms ahead stays as it is, and is too old as it comes due.
        """
        time_ms = (stamp_ms - delay_ms - HALF_FILTER_STEP_MS) & U32
        return time_ms if time_ms > self.horizon_ms else later_ms(time_ms, self.horizon_ms)

    def _push(self, ring: ObsRing[T], sample: T, kind: int) -> None:
        """Put a sample into its buffer, if there is one."""
        if ring.size <= 0:
            self._events.tell(kind, ev.NO_BUFFER, sample.time_ms)
            return
        gone = ring.push(sample)
        if gone is not None:
            self._events.tell(kind, ev.OVERWRITTEN, gone.time_ms)
        self._events.tell(kind, ev.TAKEN, sample.time_ms)

    # What comes due

    def recall_yaw(self) -> YawSample | None:
        """Take out the yaw that has come due."""
        return self._recall(self._yaws, ev.YAW)

    def recall_odometry(self) -> OdometrySample | None:
        """Take out the odometry that has come due."""
        return self._recall(self._odometry, ev.ODOMETRY)

    def recall(self, rotation: Rotation, step: Inertial, lever_arm: Vec3, common: Vec2) -> None:
        """Take out pose and velocity that have come due, and move them from the camera to the IMU.

        The camera's place is as seen from there, m, body (FRD). The origin from which poses count, which all cores have
        in common, is as seen from the core's own, m north and east.
        """
        pose = self._recall(self._poses, ev.POSE)
        self.has_pose = pose is not None and self._take_pose(pose, rotation, lever_arm, common)
        velocity = self._recall(self._velocities, ev.VELOCITY)
        self.has_velocity = velocity is not None and self._take_velocity(velocity, rotation, step, lever_arm)

    def _recall(self, ring: ObsRing[T], kind: int) -> T | None:
        """Take out of a buffer what has come due; report those that were lost to a newer one, or by their age."""
        if not ring.has_due(self.horizon_ms):
            return None
        lost: list[T] = []
        found = ring.recall(self.horizon_ms, lost)
        for sample in lost:
            is_fresh = signed_since_ms(self.horizon_ms, sample.time_ms) < RECALL_WINDOW_MS
            self._events.tell(kind, ev.SUPERSEDED if is_fresh else ev.TOO_OLD, sample.time_ms)
        return found

    def _take_pose(self, sample: PoseSample, rotation: Rotation, lever_arm: Vec3, common: Vec2) -> bool:
        if not (is_finite(sample.pos) and math.isfinite(sample.err)):
            # FIRMWARE PARITY: there an infinite position fails its gate, but is fused once position has timed out.
            self._events.tell(ev.POSE, ev.NOT_FINITE, sample.time_ms)
            return False
        north, east, down = sample.pos
        pos = north + common[0], east + common[1], down
        if not is_zero(lever_arm):
            pos = sub(pos, to_earth(rotation, lever_arm))
        self.pose = PoseSample(sample.time_ms, pos, sample.err, sample.is_reset)
        return True

    def _take_velocity(self, sample: VelocitySample, rotation: Rotation, step: Inertial, lever_arm: Vec3) -> bool:
        if not (is_finite(sample.vel) and math.isfinite(sample.err)):
            self._events.tell(ev.VELOCITY, ev.NOT_FINITE, sample.time_ms)
            return False
        vel = sample.vel
        if not is_zero(lever_arm):
            body_rate = scaled(step.del_ang, 1.0 / step.del_ang_dt)
            vel = sub(vel, to_earth(rotation, cross(body_rate, lever_arm)))
        self.velocity = VelocitySample(sample.time_ms, vel, sample.err)
        return True


def _has_nan(vector: Vec3) -> bool:
    return math.isnan(vector[0]) or math.isnan(vector[1]) or math.isnan(vector[2])
