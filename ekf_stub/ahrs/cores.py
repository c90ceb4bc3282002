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
from ekf_stub.ahrs.parts import AhrsParts
from ekf_stub.core.ekf3_core import AFFINITY_MAG, CommonOrigin, Ekf3Core, Frame
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.reporting import run_report_of
from ekf_stub.filter.inertial import LOOP_DT, Array
from ekf_stub.filter.inertial_pass import Kernel
from ekf_stub.inputs.compasses import Compasses, CompassReading
from ekf_stub.inputs.imus import MAX_IMUS, ImuReading, Imus
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.inputs.places import Moved, from_imu, gps_seen_from
from ekf_stub.inputs.range_state import RangeState
from ekf_stub.log.ekf_log import EkfLog
from ekf_stub.log.replay_log import SensorSet
from ekf_stub.reports.core_report import Three
from ekf_stub.reports.core_texts import CoreTexts

MOST_LEAN_APART: Final = math.radians(10.0)
MOST_YAW_APART: Final = math.radians(20.0)
_COMPASSES: Final = SensorSet().compasses
_HERE: Final = (0.0, 0.0, 0.0)


class Cores:
    """The filters, what they are given, and what they log.

    ``imus`` has the IMU of each core, in the order of the cores; ``differ`` says whether these differ. In ``lanes`` is
    a filter for each core, or one for all.
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
            len(imus),
        )
        logs = [EkfLog(parts.logger, parts.params.get_int, group, lambda: self.lanes.primary) for group in groups]
        self._logged = list(zip(self.lanes.cores, logs, strict=True))
        self._imus = Imus()
        self._has_own_compass = FromParams(
            parts.params, lambda: bool(parts.params.get_int("EK3_AFFINITY") & AFFINITY_MAG)
        )
        self._places = FromParams(parts.params, lambda: _places(parts))
        self._mag: tuple[int, Array] | None = None
        self._compasses: list[Compasses] = []
        self._levers = Moved(from_imu)
        self._ranges = Moved(RangeState.seen_from)
        self._gps = Moved(gps_seen_from)

    def run(self, frame: Frame, imus: tuple[ImuReading, ...]) -> None:
        """Run a frame of the first IMU; what others say comes beside it."""
        self.lanes.run(self._frames(frame, imus) if self._differ else (frame,))

    @property
    def may_be_alike(self) -> bool:
        """Whether there is but one filter, and nobody else is to become primary."""
        return not self._differ and self.lanes.primary == self.lanes.chosen_by_user()

    def _frames(self, frame: Frame, imus: tuple[ImuReading, ...]) -> list[Frame]:
        self._imus.update(imus, LOOP_DT)
        return [self._frame_of(number, imu, frame) for number, imu in enumerate(self._imu_of_core)]

    def _frame_of(self, number: int, imu: int, frame: Frame) -> Frame:
        imus = self._imus
        accel = imus.accel_of(imu)
        place = self._places()[accel]
        return frame._replace(
            delta=imus.delta_of(imu),
            lever_arm=self._levers(accel, frame.lever_arm, place) if self._has_camera else frame.lever_arm,
            ranges=None if frame.ranges is None else self._ranges(accel, frame.ranges, place),
            compasses=self._compasses_of(number, frame.mag),
            gps=None if frame.gps is None else self._gps(accel, frame.gps, place),
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

    def place_of_imu(self, lane: int) -> Three:
        """Return the place of a filter's IMU as counted from the first IMU, m, body (FRD)."""
        return self._places()[self._imus.accel_of(self._imu_of_core[lane])] if self._differ else _HERE

    def disagreement(self, *, checks_yaw: bool) -> str | None:
        """Return by what the attitude of a core differs from the primary one's, None while all agree.

        Source: AP_AHRS::attitudes_consistent.
        """
        lanes = self.lanes
        primary = _attitude_of(lanes.primary_filter)
        for quat in map(_attitude_of, lanes.cores if len(lanes.cores) > 1 else ()):
            lean = float(primary.roll_pitch_difference(quat, InternalErrors()))
            turn = abs(float(primary.angular_difference(quat).to_axis_angle().z)) if checks_yaw else 0.0
            for axis, apart, most in (("Roll/Pitch", lean, MOST_LEAN_APART), ("Yaw", turn, MOST_YAW_APART)):
                if apart > most:
                    return f"EKF3 {axis} inconsistent {int(math.degrees(apart))} deg. Wait or reboot"
        return None

    def record_is_due(self, now_us: int) -> bool:
        """Return whether the only filter writes anything by itself after a step."""
        core, log = self._logged[0]
        return log.is_due(now_us, core.is_still(), is_step=True)

    def record_due_us(self) -> int:
        """Return from when on the only filter writes something by itself after a frame without a step; 0 if now."""
        core, log = self._logged[0]
        return log.due_us(core.is_still())

    def log_run(self, now_us: int) -> bool | None:
        """Log what the filters write by themselves after a frame; return the first one's answer of ``is_still``."""
        answer = None
        for core, log in self._logged:
            still = core.is_still() if core.initialised else None
            answer = still if core is self._logged[0][0] else answer
            if log.is_due(now_us, still, is_step=core.stepped):
                log.update(run_report_of(core), now_us, is_step=core.stepped)
        return answer

    def log_estimates(self, now_us: int) -> None:
        """Log what they say at the moment."""
        for i, (_, log) in enumerate(self._logged):
            log.write_streaming(self.lanes.report(i), now_us)


def _attitude_of(core: Ekf3Core) -> Quaternion:
    quat = core.output.now.quat
    return Quaternion(quat.w, quat.x, quat.y, quat.z)


def _places(parts: AhrsParts) -> list[Three]:
    """Return the place of each IMU as counted from the first, m, body (FRD)."""
    x_y_z = (map(float, parts.imu_pos(imu).to_tuple()) for imu in range(MAX_IMUS))
    first, *others = [(x, y, z) for x, y, z in x_y_z]
    return [_HERE, *(from_imu(place, first) for place in others)]
