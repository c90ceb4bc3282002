# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cores that a vehicle runs, from its parameters and IMUs (AP_NavEKF3/AP_NavEKF3.cpp, InitialiseFilter).

Cores that are given the same say the same: where all IMUs do so, one filter stands for all cores.
"""

import math
from collections import Counter
from typing import Final

from ap_core.internal_error import InternalErrors
from ap_core.param_cache import FromParams, Numbers
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.parts import AhrsParts
from ekf_stub.core.common_origin import CommonOrigin
from ekf_stub.core.ekf3_core import AFFINITY_MAG, Ekf3Core, Frame
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.reporting import run_report_of
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.inertial_pass import LOOP_DT
from ekf_stub.filter.kernel import Kernel
from ekf_stub.inputs.compasses import Compasses, CompassReading
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.imus import MAX_IMUS, ImuReading, Imus
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.log.ekf_log import EkfLog
from ekf_stub.log.replay_vehicle import SensorSet
from ekf_stub.reports.core_report import Three
from ekf_stub.reports.core_texts import NUMBER_OF_IMUS, CoreTexts, cores_of_mask

MOST_LEAN_APART: Final = math.radians(10.0)
MOST_YAW_APART: Final = math.radians(20.0)
_COMPASSES: Final = SensorSet().compasses


class Cores:
    """The filters, what they are given, and what they log.

    Args:
        parts: the vehicle around them.
        kernel: what their arithmetic runs on.
        sizes: lengths of their buffers.
        imus: the IMU of each core, in the order of the cores.
        differ: whether these IMUs differ.
        has_camera: whether there is visual odometry.

    Attributes:
        lanes: the filters, one for each core or one for all.
    """

    def __init__(
        self,
        parts: AhrsParts,
        kernel: Kernel,
        sizes: RingSizes,
        imus: tuple[int, ...],
        *,
        differ: bool,
        has_camera: bool,
    ) -> None:
        numbers = tuple(range(len(imus)))
        self._differ = differ
        self._has_camera = has_camera
        self._imu_of_core = imus
        get_float = Numbers(parts.params, "EK3_", {"MAX_FLOW": parts.release.flow_limit}).__getitem__
        has_compass = FromParams(parts.params, parts.has_compass)
        common = CommonOrigin()
        groups = [(number,) for number in numbers] if differ else [numbers]
        self.lanes = Lanes(
            [
                Ekf3Core(
                    parts.sources,
                    get_float,
                    sizes,
                    CoreTexts(parts.texts, [imus[number] for number in group]),
                    Counter(),
                    has_compass,
                    kernel,
                    common=common,
                    number=group[0],
                    release=parts.release,
                    imu=imus[group[0]],
                )
                for group in groups
            ],
            common,
            get_float,
            parts.texts,
        )
        self._chosen_by_user = FromParams(parts.params, lambda: parts.primary_core(len(imus)))
        logs = [EkfLog(parts.logger, parts.params.get_int, group, lambda: self.primary) for group in groups]
        self._logged = list(zip(self.lanes.cores, logs, strict=True))
        self._imus = Imus()
        self._has_own_compass = FromParams(
            parts.params, lambda: bool(parts.params.get_int("EK3_AFFINITY") & AFFINITY_MAG)
        )
        self._from_first = FromParams(parts.params, lambda: _from_first(parts))
        self._mag: tuple[int, Array] | None = None
        self._compasses: list[Compasses] = []
        self._levers: dict[int, tuple[Three, Three]] = {}

    @property
    def primary(self) -> int:
        """The number of the primary core."""
        return self.lanes.primary if self._differ else self._chosen_by_user()

    def run(self, frame: Frame, imus: tuple[ImuReading, ...]) -> None:
        """Run a frame of the first IMU; what others say comes beside it."""
        self.lanes.run(self._frames(frame, imus) if self._differ else (frame,))

    def quiet_until_ms(self, gps: GpsSample | None) -> int | None:
        """Return until when, included, the only filter may be run as of ``Lanes.run_alike``, None if it may not.

        Args:
            gps: the newest solution.
        """
        if self._differ or len(self._logged) > 1:
            return None
        ((core, log),) = self._logged
        until_ms = core.quiet_until_ms(gps)
        record_ms = log.quiet_until_ms(core.is_still() if core.initialised else None)
        return None if until_ms is None or record_ms is None else min(until_ms, record_ms)

    def _frames(self, frame: Frame, imus: tuple[ImuReading, ...]) -> list[Frame]:
        self._imus.update(imus, LOOP_DT)
        return [self._frame_of(number, imu, frame) for number, imu in enumerate(self._imu_of_core)]

    def _frame_of(self, number: int, imu: int, frame: Frame) -> Frame:
        imus = self._imus
        return frame._replace(
            delta=imus.delta_of(imu),
            lever_arm=self._lever_arm(frame.lever_arm, imus.accel_of(imu)),
            compasses=self._compasses_of(number, frame.mag),
            imu_rates=imus.rates_of(imu),
        )

    def _compasses_of(self, number: int, mag: tuple[int, Array] | None) -> Compasses | None:
        """Return what the compasses say, of which the core has its own by EK3_AFFINITY: the same until that changes."""
        if mag is None or not self._has_own_compass():
            return None
        if mag is not self._mag:
            all_say = Compasses((CompassReading(*mag),) * _COMPASSES)
            self._mag, self._compasses = mag, [all_say._replace(own=own) for own in range(MAX_IMUS)]
        return self._compasses[number]

    def _lever_arm(self, of_first: Three, accel: int) -> Three:
        """Return the camera's place from an IMU, where there is a camera; the same until that changes."""
        from_first = self._from_first()[accel]
        if not (self._has_camera and any(from_first)):
            return of_first
        known, lever = self._levers.get(accel, (None, of_first))
        if known is not of_first:
            x, y, z = (first + apart for first, apart in zip(of_first, from_first, strict=True))
            lever = x, y, z
            self._levers[accel] = of_first, lever
        return lever

    def from_imu(self, place: Vector3f, lane: int) -> Vector3f:
        """Return a place on the vehicle from the IMU of a filter, given it from the first IMU."""
        if not self._differ:
            return place
        return place + Vector3f(*self._from_first()[self._imus.accel_of(self._imu_of_core[lane])])

    def disagreement(self, *, checks_yaw: bool) -> str | None:
        """Return by what the attitude of a core differs from the primary one's, None while all agree.

        Source: AP_AHRS::attitudes_consistent.
        """
        lanes = self.lanes
        primary = _attitude_of(lanes.cores[lanes.primary])
        for quat in map(_attitude_of, lanes.cores if len(lanes.cores) > 1 else ()):
            lean = float(primary.roll_pitch_difference(quat, InternalErrors()))
            turn = abs(float(primary.angular_difference(quat).to_axis_angle().z)) if checks_yaw else 0.0
            for axis, apart, most in (("Roll/Pitch", lean, MOST_LEAN_APART), ("Yaw", turn, MOST_YAW_APART)):
                if apart > most:
                    return f"EKF3 {axis} inconsistent {int(math.degrees(apart))} deg. Wait or reboot"
        return None

    def log_run(self, now_us: int) -> None:
        """Log what the filters write by themselves after a frame."""
        for core, log in self._logged:
            still = core.is_still() if core.initialised else None
            if log.is_due(now_us, still, is_step=core.stepped):
                log.update(run_report_of(core), now_us, is_step=core.stepped)

    def log_estimates(self, now_us: int) -> None:
        """Log what they say at the moment."""
        for i, (_, log) in enumerate(self._logged):
            log.write_streaming(self.lanes.report(i), now_us)


def _attitude_of(core: Ekf3Core) -> Quaternion:
    quat = core.output.now.quat
    return Quaternion(quat.w, quat.x, quat.y, quat.z)


def _from_first(parts: AhrsParts) -> list[Three]:
    """Return the place of the first IMU as counted from each, m, body (FRD)."""
    first = parts.imu_pos()
    x_y_z = [(first - parts.imu_pos(imu)).to_tuple() for imu in range(3)]
    return [(float(x), float(y), float(z)) for x, y, z in x_y_z]


def imus_of_cores(parts: AhrsParts, differing: int) -> tuple[int, ...]:
    """Return the IMU of each core by EK3_IMU_MASK; ``differing`` is how many IMUs differ, 0 for none."""
    return cores_of_mask(parts.imu_mask(), differing or NUMBER_OF_IMUS)
