# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Alignment and fusion of yaw (AP_NavEKF3/AP_NavEKF3_MagFusion.cpp, SelectMagFusion).

FIRMWARE PARITY: in flight the firmware estimates the earth's and the vehicle's magnetic field from all three axes of
the compass. Here its heading goes on being fused, with the noise that the field's horizontal part leaves it.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
import quaternion

from ap_core.cint import u32
from ekf_stub.core_texts import CoreTexts
from ekf_stub.error_state import ErrorState, euler_of, quat_of_euler
from ekf_stub.ext_nav_ingest import ExtNavIngest
from ekf_stub.inertial import limited
from ekf_stub.measurements import MagSample
from ekf_stub.obs_ring import ObsRing
from ekf_stub.output_predictor import OutputPredictor
from ekf_stub.sources import EkfSources, SourceYaw
from ekf_stub.vel_pos_fusion import Vehicle

SYNTHETIC_PERIOD_MS: Final = 140
MIN_YAW_NOISE: Final = 0.05
MIN_ALIGNED_NOISE: Final = 0.01
MAX_INNOVATION: Final = 0.5
FINAL_ALIGNMENT_HEIGHT_M: Final = 2.5
MAX_TURN_TO_ALIGN: Final = 0.1745
MAG_NOISE_IN_FLIGHT: Final = 0.25  # rad, of the heading that three axes with EK3_MAG_M_NSE 0.05 Gauss give


def wrap_pi(angle: float) -> float:
    """Return an angle within -pi..pi."""
    return math.remainder(angle, 2 * math.pi)


class YawFusion:
    """Where yaw comes from, and what becomes of it.

    Args:
        state: the filter.
        output: what follows it.
        sources: the source sets.
        ingest: where external navigation waits.
        texts: what the ground station is told.
        get_float: returns a parameter by its name after ``EK3_``.
        has_compass: tells whether a compass is in use.
        mag_ring_size: how many magnetic fields wait.

    Attributes:
        aligned: whether yaw has been set from a measurement.
        innovation, ratio: of the last yaw tested, rad, and of its square to the gate.
        mag: magnetic fields that wait for the horizon.
        declination: of the magnetic field, rad.
    """

    def __init__(
        self,
        state: ErrorState,
        output: OutputPredictor,
        sources: EkfSources,
        ingest: ExtNavIngest,
        texts: CoreTexts,
        get_float: Callable[[str], float],
        has_compass: Callable[[], bool],
        mag_ring_size: int,
    ) -> None:
        self._state = state
        self._output = output
        self._sources = sources
        self._ingest = ingest
        self._texts = texts
        self._get_float = get_float
        self._has_compass = has_compass
        self.aligned = False
        self.innovation = self.ratio = 0.0
        self.mag: ObsRing[MagSample] = ObsRing(mag_ring_size)
        self.declination = 0.0
        self._synthetic_ms = 0
        self._source = self.source()
        self._source_changed = False
        self._final_alignment_done = False
        self._quat_at_last_mag = state.quat
        self._yaw_at_rest = 0.0

    def source(self) -> int:
        """Return the yaw source; a compass that is not there is none."""
        source = self._sources.yaw()
        return SourceYaw.NONE if source == SourceYaw.COMPASS and not self._has_compass() else source

    def check_source(self) -> None:
        """Note a change of the source, every frame."""
        source = self.source()
        self._source_changed |= source != self._source
        self._source = source

    def uses_compass(self) -> bool:
        """Tell whether yaw comes from the compass."""
        return self._source == SourceYaw.COMPASS

    def step(self, now_ms: int, vehicle: Vehicle, *, tilt_aligned: bool, moves: bool, climbed_m: float) -> None:
        """Fuse what came due in a step.

        Args:
            now_ms: time of the step.
            vehicle: what is known of it.
            tilt_aligned: whether roll and pitch are known.
            moves: whether the vehicle is known not to stand still on the ground.
            climbed_m: height above the place of take-off.
        """
        if moves:
            self._yaw_at_rest = self._yaw()
        if vehicle.on_ground:
            self._final_alignment_done = False
        ext_nav, mag = self._ingest.recall_yaw(), self.mag.recall(self._ingest.horizon_ms).sample
        if self._source == SourceYaw.NONE:
            self._source_changed = False
            if self._fuse_synthetic(now_ms, vehicle, moves=moves):
                self.ratio = 0.0
        elif self._source == SourceYaw.EXTNAV:
            if ext_nav is not None:
                self._use_ext_nav(float(ext_nav.yaw), float(ext_nav.yaw_err), vehicle, tilt_aligned=tilt_aligned)
            elif tilt_aligned and not self.aligned:
                self._fuse_synthetic(now_ms, vehicle, moves=moves)
        elif self._source == SourceYaw.COMPASS and mag is not None:
            self._use_compass(mag, vehicle, tilt_aligned=tilt_aligned, climbed_m=climbed_m)

    def _yaw(self) -> float:
        return euler_of(self._state.quat)[2]

    def _noise(self) -> float:
        return self._get_float("YAW_M_NSE")

    def _fuse_synthetic(self, now_ms: int, vehicle: Vehicle, *, moves: bool) -> bool:
        """Keep yaw from growing uncertain while nothing measures it; tell whether it was time for that."""
        if u32(now_ms - self._synthetic_ms) <= SYNTHETIC_PERIOD_MS:
            return False
        self._synthetic_ms = now_ms
        innovation = 0.0 if moves else wrap_pi(self._yaw() - self._yaw_at_rest)
        self._fuse(innovation, (self._noise() if moves else max(self._noise(), MIN_YAW_NOISE)) ** 2, vehicle)
        return True

    def _use_ext_nav(self, yaw: float, err: float, vehicle: Vehicle, *, tilt_aligned: bool) -> None:
        if not tilt_aligned:
            return
        if self.aligned and not self._source_changed:
            self._fuse(wrap_pi(self._yaw() - yaw), max(err, MIN_YAW_NOISE) ** 2, vehicle)
            return
        self._align(yaw, max(err, MIN_ALIGNED_NOISE) ** 2)
        self._texts.add("yaw aligned")

    def _align(self, yaw: float, variance: float) -> None:
        self._source_changed = False
        self._output.rotate(self._state.set_yaw(yaw, variance))
        self.aligned = True

    def _use_compass(self, mag: MagSample, vehicle: Vehicle, *, tilt_aligned: bool, climbed_m: float) -> None:
        roll, pitch, yaw = euler_of(self._state.quat)
        level = quaternion.as_rotation_matrix(quat_of_euler(roll, pitch, 0.0)) @ mag.field
        measured = wrap_pi(self.declination - math.atan2(level[1], level[0]))
        turned = (self._state.quat * self._quat_at_last_mag.conjugate()).normalized()
        self._quat_at_last_mag = self._state.quat
        turns_slowly = 2 * math.acos(limited(abs(turned.w), 0.0, 1.0)) < MAX_TURN_TO_ALIGN
        is_final = not vehicle.on_ground and not self._final_alignment_done and climbed_m > FINAL_ALIGNMENT_HEIGHT_M
        variance = max(self._noise(), MIN_ALIGNED_NOISE) ** 2
        if tilt_aligned and turns_slowly and not self.aligned:
            self._texts.add("MAG0 initial yaw alignment complete")
            self._align(measured, variance)
        elif turns_slowly and is_final:
            self._texts.add("MAG0 in-flight yaw alignment complete")
            self._align(measured, variance)
            self._final_alignment_done = True
        elif self.aligned and self._source_changed:
            self._align(measured, variance)
        elif self.aligned:
            noise = MAG_NOISE_IN_FLIGHT if self._final_alignment_done else self._noise()
            self._fuse(wrap_pi(yaw - measured), noise**2, vehicle)

    def _fuse(self, innovation: float, variance: float, vehicle: Vehicle) -> None:
        """Fuse a yaw; on the ground even beyond the gate, but then no more than half a radian of it (fuseEulerYaw)."""
        row = self._state.yaw_row()
        spread = float(row @ self._state.cov @ row) + variance
        gate = max(0.01 * self._get_float("YAW_I_GATE"), 1.0) ** 2
        self.innovation = innovation
        self.ratio = innovation**2 / (gate * spread)
        if self.ratio > 1 and vehicle.in_flight:
            return
        self._state.update(row, float(np.clip(innovation, -MAX_INNOVATION, MAX_INNOVATION)), variance)
