# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Alignment and fusion of yaw (AP_NavEKF3/AP_NavEKF3_MagFusion.cpp, SelectMagFusion)."""

import math
from collections.abc import Callable
from typing import Final

from ap_core.fmath import f32
from ekf_stub.filter.error_state import MIN_NOISE_VAR
from ekf_stub.filter.inertial import InertialStep, limited
from ekf_stub.filter.states import ATT
from ekf_stub.fusion.aiding import ABSOLUTE, NO_AIDING
from ekf_stub.fusion.compass_reading import CompassReader
from ekf_stub.fusion.compass_yaw import GROUND_AND_CLIMBED, NEVER, ON_GROUND, CompassAlignment
from ekf_stub.fusion.gps_yaw import GpsYaw
from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.fusion.mag_fusion import MagFusion
from ekf_stub.fusion.measurements import MagSample
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.fusion.resets import Resets
from ekf_stub.fusion.vel_pos_fusion import Innovations
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ext_nav_ingest import YawSample
from ekf_stub.inputs.gps_reading import MIN_YAW_ERR
from ekf_stub.inputs.sources import YAW_COMPASS, YAW_EXTNAV, YAW_GPS, YAW_GSF, YAW_NONE, SourceYaw
from ekf_stub.reports.core_texts import MAV_SEVERITY_WARNING

SYNTHETIC_PERIOD_MS: Final = 140
IN_USE_MS: Final = 5000
BAD_COMPASS_MS: Final = 5000
MIN_YAW_NOISE: Final = 0.05
MIN_ALIGNED_NOISE: Final = 0.01
MAX_INNOVATION: Final = 0.5
WELL_KNOWN: Final = float(f32(0.01))
_BY_GPS: Final = (SourceYaw.GPS, SourceYaw.GPS_COMPASS_FALLBACK)
_BY_COMPASS: Final = (SourceYaw.COMPASS, SourceYaw.GPS_COMPASS_FALLBACK)

_WITHOUT_COMPASS: Final = (*_BY_GPS, YAW_EXTNAV)


def wrap_pi(angle: float) -> float:
    """Return an angle within -pi..pi."""
    return math.remainder(angle, 2 * math.pi)


class YawFusion(Fusion):
    """Where yaw comes from, and what becomes of it.

    Attributes:
        source: the yaw source as of ``control``; a compass that is not there is none.
        uses_compass: whether yaw comes from the compass, as of ``control``.
        aligned: whether yaw has been set from a measurement.
        resets: how often that was.
        innovation, ratio: of the last yaw tested, rad, and of its square to the gate.
        compass: the compass in use.
        field: the fields of the earth and of the vehicle.
        mag_fusion: 0 while the compass is not in use, 1 while its heading is fused, 2 while its three axes are.
        field_was_fused: whether they took up this step, so that other measurements wait for the next.
        by_gps: yaw by the velocity of GPS.
    """

    def __init__(self, parts: FilterParts, resets: Resets, innovations: Innovations) -> None:
        super().__init__(parts)
        self._reset = resets
        self._innovations = innovations
        self.by_gps = GpsYaw(parts)
        self._learns_field_on_ground = parts.release.learns_field_on_ground
        self.compass = CompassReader(parts)
        self._agreed_ms: int | None = None
        self.aligned = False
        self.resets = 0
        self.innovation = self.ratio = 0.0
        self.field = MagFusion(parts.state, parts.get_float)
        self.field_was_fused = False
        self.mag_fusion = 0
        self._alignment = CompassAlignment(parts.state)
        self._ext_nav_ms = self._synthetic_ms = self._gps_ms = 0
        self._look_at_sources()
        self._step_source = self.source
        self._source_changed = False
        self._yaw_at_rest, self._by_321_at_rest = 0.0, True

    def _look_at_sources(self) -> None:
        source, has_compass = self._sources.yaw(), self.compass.is_used()
        self.source = YAW_NONE if source == YAW_COMPASS and not has_compass else source
        self.uses_compass = source in _BY_COMPASS and has_compass and not self.compass.has_failed

    def uses_ext_nav(self, now_ms: int) -> bool:
        """Return whether yaw comes from external navigation, or is assumed while it waits for that."""
        in_use = now_ms - max(self._ext_nav_ms, self._synthetic_ms) < IN_USE_MS
        return self._sources.yaw() == YAW_EXTNAV and in_use

    def control(self, vehicle: Vehicle) -> None:
        """Look at the sources, and decide whether the magnetic fields are to be estimated.

        In each frame in which something of that may have changed (`ModeControl`).
        """
        self._look_at_sources()
        self._alignment.update(vehicle, self.innovation)
        self.field.is_learned &= not vehicle.on_ground
        magcal = int(self._get_float("MAG_CAL"))
        if magcal == GROUND_AND_CLIMBED and not self._learns_field_on_ground:
            magcal = NEVER
        if vehicle.on_ground and magcal not in ON_GROUND and not self._state.learns_field:
            return
        if self.field.learn(wanted=self.uses_compass and self._alignment.wants_field(magcal, vehicle)):
            self._alignment.request_for_field(vehicle)

    def step(
        self, now_ms: int, vehicle: Vehicle, step: InertialStep, *, is_still: bool, climbed_m: Callable[[], float]
    ) -> None:
        """Fuse what came due in a step; ``climbed_m`` tells the height above the place of take-off."""
        source = self.source
        self._source_changed |= source != self._step_source
        self._step_source = source
        if not is_still:
            self._by_321_at_rest = self._state.prefers_321()
            self._yaw_at_rest = self._state.yaw(by_321=self._by_321_at_rest)
        self.field_was_fused = False
        if source == YAW_GSF or (not self.uses_compass and source not in _WITHOUT_COMPASS):
            if self._source_changed or not self.aligned:
                self._align_by_gps(now_ms, vehicle)
                self._source_changed = False
            self._go_without_sensor(now_ms, vehicle, is_still=is_still)
            return
        if source in _BY_GPS:
            self._use_gps(now_ms, vehicle, is_still=is_still)
            if source == YAW_GPS:
                return
            if self._gps_ms:
                self.compass.read(now_ms, vehicle, is_in_use=self.uses_compass)
                return
        ext_nav = self._ingest.recall_yaw() if self._ingest.has_due else None
        if ext_nav is not None and not (math.isfinite(ext_nav.yaw) and math.isfinite(ext_nav.yaw_err)):
            self._ingest.tell("yaw", rules.NOT_FINITE, ext_nav.time_ms)
        elif ext_nav is not None:
            self._use_ext_nav(ext_nav, now_ms, vehicle)
        elif source == YAW_EXTNAV and not self.aligned:
            self._wait_for_sensor(now_ms, vehicle, is_still=is_still)
        self.compass.check_timeout(now_ms, is_in_use=self.uses_compass)
        self.compass.read(now_ms, vehicle, is_in_use=self.uses_compass)
        readings = self.compass.samples
        mag = readings.recall(self._ingest.horizon_ms).sample if readings.samples else None
        if mag is not None and self.uses_compass:
            self._align_by_compass(mag, vehicle, climbed_m=climbed_m())
            if self.aligned:
                self._fuse_compass(mag, vehicle, step)
        self.field.note_learned(is_set_in_flight=self._alignment.field_done)

    def begin_step(self) -> None:
        """Give the magnetic fields new variances where that is due, before the prediction."""
        self.field.begin_step(forgets_body_field=self.compass.forgets_body_field)
        self.compass.forgets_body_field = False

    def check_compass(self, now_ms: int, vehicle: Vehicle) -> None:
        """Ask for an alignment once a compass has been off for 5 s on the ground (calcGpsGoodToAlign).

        With each solution of the GPS.
        """
        mag_x, mag_y, _ = self.field.ratios.tolist()
        if self._agreed_ms is None or max(mag_x, mag_y, self.ratio) <= 1 or not self.compass.are_consistent:
            self._agreed_ms = now_ms
        if now_ms - self._agreed_ms > BAD_COMPASS_MS and not vehicle.armed:
            self._alignment.is_requested, self._agreed_ms = True, now_ms

    def _noise(self) -> float:
        return self._get_float("YAW_M_NSE")

    def _go_without_sensor(self, now_ms: int, vehicle: Vehicle, *, is_still: bool) -> None:
        """Use the GSF, or keep yaw from growing uncertain, while no sensor measures it."""
        if not self._synthetic_is_due(now_ms):
            return
        if not self._fuse_gsf(vehicle):
            is_known = float(self._state.cov.diagonal()[ATT].sum()) <= WELL_KNOWN
            if is_still or vehicle.on_ground or self._aiding.mode is NO_AIDING or not is_known:
                self._fuse_assumed(vehicle, is_still=is_still)
        self.field.ratios[:] = 0.0
        self.ratio = 0.0

    def _synthetic_is_due(self, now_ms: int) -> bool:
        if now_ms - self._synthetic_ms <= SYNTHETIC_PERIOD_MS:
            return False
        self._synthetic_ms = now_ms
        return True

    def _fuse_gsf(self, vehicle: Vehicle) -> bool:
        estimate = self.by_gps.estimate() if self.aligned and self._step_source == YAW_GSF else None
        if estimate is None:
            return False
        yaw, variance = estimate
        by_321 = self._state.prefers_321()
        return self._fuse(wrap_pi(self._state.yaw(by_321=by_321) - yaw), variance, vehicle, by_321=by_321)

    def _fuse_assumed(self, vehicle: Vehicle, *, is_still: bool) -> None:
        if is_still:
            by_321 = self._by_321_at_rest
            innovation = wrap_pi(self._state.yaw(by_321=by_321) - self._yaw_at_rest)
            self._fuse(innovation, max(self._noise(), MIN_YAW_NOISE) ** 2, vehicle, by_321=by_321)
        else:
            self._fuse(0.0, self._noise() ** 2, vehicle, by_321=self._state.prefers_321())

    def _wait_for_sensor(self, now_ms: int, vehicle: Vehicle, *, is_still: bool) -> None:
        if vehicle.tilt_aligned and not self.aligned and self._synthetic_is_due(now_ms):
            self._fuse_assumed(vehicle, is_still=is_still)

    def _use_ext_nav(self, sample: YawSample, now_ms: int, vehicle: Vehicle) -> None:
        if self._step_source != YAW_EXTNAV:
            self._ingest.tell("yaw", rules.UNUSED, sample.time_ms)
            return
        self._ext_nav_ms = now_ms
        yaw, err = float(sample.yaw), float(sample.yaw_err)
        if not vehicle.tilt_aligned:
            self._ingest.tell("yaw", rules.UNUSED, sample.time_ms)
        elif self.aligned and not self._source_changed:
            innovation = wrap_pi(self._state.yaw(by_321=True) - yaw)
            was_fused = self._fuse(innovation, max(err, MIN_YAW_NOISE) ** 2, vehicle, by_321=True)
            rule = rules.FUSED if was_fused else rules.GATE_YAW
            self._ingest.tell("yaw", rule, sample.time_ms, math.sqrt(self.ratio))
        else:
            self._align(yaw, max(err, MIN_ALIGNED_NOISE) ** 2, vehicle, by_321=True)
            self._texts.add("yaw aligned")
            self._ingest.tell("yaw", rules.ALIGNED_TO, sample.time_ms)

    def _use_gps(self, now_ms: int, vehicle: Vehicle, *, is_still: bool) -> None:
        fix = self._gps.delayed
        if self._gps.is_due and fix is not None and fix.yaw is not None:
            self._gps_ms = now_ms
            if not vehicle.tilt_aligned:
                return
            if self.aligned and not self._source_changed:
                innovation = wrap_pi(self._state.yaw(by_321=True) - fix.yaw)
                self._fuse(innovation, MIN_YAW_ERR**2, vehicle, by_321=True)
                return
            self._align(wrap_pi(fix.yaw), MIN_YAW_ERR**2, vehicle, by_321=True)
            self._texts.add("yaw aligned")
        else:
            self._wait_for_sensor(now_ms, vehicle, is_still=is_still)

    # By the velocity of GPS

    def correct_by_gps(self, now_ms: int, vehicle: Vehicle) -> None:
        """Let the GSF take the velocity that came due in a step, and set yaw by it if that was asked for."""
        self.by_gps.fuse()
        if self.by_gps.emergency(now_ms) and self._reset_to_gsf(now_ms, vehicle):
            self.compass.has_failed = True

    def _align_by_gps(self, now_ms: int, vehicle: Vehicle) -> None:
        """Set yaw by the GSF, or else to where the vehicle goes, unless it agrees (realignYawGPS)."""
        if self._step_source == YAW_GSF and not self.by_gps.is_steady:
            return
        course = self.by_gps.course(self._innovations.vel_ratio)
        if course is None:
            return
        if self.aligned and not course.disagrees:
            if course.is_steady:
                self.by_gps.forget_course()
                self._alignment.note_yaw(vehicle)
        elif not self._reset_to_gsf(now_ms, vehicle) and course.is_steady:
            self.by_gps.forget_course()
            self._align(course.yaw, course.variance, vehicle, by_321=self._best_order())
            self._reset.velocity(now_ms, by_gps=True)
            self._reset.position(now_ms, by_gps=True)
            self._texts.add("yaw aligned to GPS velocity")

    def _reset_to_gsf(self, now_ms: int, vehicle: Vehicle) -> bool:
        found = self.by_gps.for_reset()
        if found is None:
            return False
        self._align(*found, vehicle, by_321=self._best_order())
        if self.uses_compass:
            self._texts.add("emergency yaw reset", MAV_SEVERITY_WARNING)
        else:
            self._texts.add("yaw aligned using GPS")
        self._reset.velocity(now_ms)
        self._reset.position(now_ms)
        self._innovations.vel_ratio = self._innovations.pos_ratio = 0.0
        return True

    def _best_order(self) -> bool:
        """Return whether to set yaw by 3-2-1 (bestRotationOrder)."""
        return abs(float(self._state.rotation[0, 2])) < abs(float(self._state.rotation[1, 2]))

    def _align(self, yaw: float, variance: float, vehicle: Vehicle, *, by_321: bool) -> None:
        self._source_changed = False
        self._output.rotate(self._state.set_yaw(yaw, variance, by_321=by_321))
        self.aligned = True
        self.resets += 1
        self._alignment.note_yaw(vehicle)

    def _compass_yaw(self, mag: MagSample, *, by_321: bool) -> float:
        north, east, _ = (self._state.rotation_now() @ mag.field).tolist()
        # The field with yaw taken out of it points as far off north as the vehicle does, the other way round.
        level = math.atan2(east, north) - self._state.yaw(by_321=by_321)
        return wrap_pi(self.field.declination - level)

    def _align_by_compass(self, mag: MagSample, vehicle: Vehicle, *, climbed_m: float) -> None:
        alignment = self._alignment
        if self._source_changed:
            alignment.is_requested = True
            self._source_changed = False
        due = alignment.due(vehicle, self.innovation, climbed_m, aligned=self.aligned)
        if due is not None:
            self._align_to(mag, due, vehicle)
        if self.compass.wants_reset:
            self.field.is_learned = False
            self._set_field(mag, vehicle)

    def _align_to(self, mag: MagSample, due: str, vehicle: Vehicle) -> None:
        alignment = self._alignment
        if not self.aligned:
            self._texts.add(f"MAG{self.compass.number} initial yaw alignment complete")
        by_321 = self._best_order()
        measured = self._compass_yaw(mag, by_321=by_321)
        self._align(measured, max(self._noise(), MIN_ALIGNED_NOISE) ** 2, vehicle, by_321=by_321)
        if due == "final":
            self._texts.add(f"MAG{self.compass.number} in-flight yaw alignment complete")
        elif due == "interim":
            self._texts.add(f"MAG{self.compass.number} ground mag anomaly, yaw re-aligned", MAV_SEVERITY_WARNING)
            alignment.note_anomaly()
        if not self.field.is_learned:
            self._set_field(mag, vehicle)

    def _set_field(self, mag: MagSample, vehicle: Vehicle) -> None:
        self.compass.wants_reset = False
        self.field.reset(mag)
        self._alignment.note_field(vehicle, self.innovation)

    def _fuse_compass(self, mag: MagSample, vehicle: Vehicle, step: InertialStep) -> None:
        if self._state.learns_field and self._alignment.field_set and not self.compass.wants_reset:
            self.mag_fusion = 2
            knows_north = self._aiding.mode is ABSOLUTE
            self.field_was_fused = self.compass.is_healthy = self.field.fuse(mag, step, knows_north=knows_north)
            self.ratio = 0.0
            return
        self.mag_fusion = 1
        self.field.ratios[:] = 0.0
        by_321 = self._state.prefers_321()
        innovation = wrap_pi(self._state.yaw(by_321=by_321) - self._compass_yaw(mag, by_321=by_321))
        self._fuse(innovation, self._noise() ** 2, vehicle, by_321=by_321)

    def _fuse(self, innovation: float, variance: float, vehicle: Vehicle, *, by_321: bool) -> bool:
        """Fuse a yaw; on the ground even beyond the gate, but then no more than half a radian of it (fuseEulerYaw)."""
        spread, expected = self._state.spread_of_yaw(by_321=by_321)
        innovation_variance = expected + max(variance, MIN_NOISE_VAR)
        gate = max(0.01 * self._get_float("YAW_I_GATE"), 1.0) ** 2
        self.innovation = innovation
        self.ratio = innovation**2 / (gate * innovation_variance)
        self.compass.is_healthy = self.ratio <= 1
        if self.ratio > 1 and vehicle.in_flight:
            return False
        self._state.fuse_spread(spread, expected, limited(innovation, -MAX_INNOVATION, MAX_INNOVATION), variance)
        return True
