# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Alignment and fusion of yaw (AP_NavEKF3/AP_NavEKF3_MagFusion.cpp, SelectMagFusion)."""

import math
from typing import Final, final

from ekf_stub.core import events as ev
from ekf_stub.core.aiding import ABSOLUTE, NO_AIDING, Aiding, Vehicle
from ekf_stub.core.compass import (
    ALWAYS,
    FINAL,
    GROUND_AND_CLIMBED,
    INTERIM,
    NEVER,
    NOT_DUE,
    CompassAlignment,
    CompassReader,
)
from ekf_stub.core.covariance import MIN_NOISE_VAR
from ekf_stub.core.events import Events
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.gps import MIN_YAW_ERR, Gps
from ekf_stub.core.gps_yaw import GpsYaw
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.mag_fusion import MagFusion
from ekf_stub.core.output import OutputPredictor
from ekf_stub.core.params import (
    COMPASS,
    EXTNAV,
    GPS_COMPASS_FALLBACK,
    GPS_YAW,
    GSF,
    NONE,
    EkfSources,
    Params,
    gate,
)
from ekf_stub.core.resets import Resets
from ekf_stub.core.samples import MagSample, YawSample
from ekf_stub.core.state import State
from ekf_stub.core.vectors import ZERO, larger, limited, matrix, square, to_earth, wrap_pi
from ekf_stub.core.vel_pos import VelPosFusion

IN_USE_MS: Final = 5000
_SYNTHETIC_PERIOD_MS: Final = 140
_BAD_COMPASS_MS: Final = 5000
_MIN_YAW_NOISE: Final = 0.05
_MIN_ALIGNED_NOISE: Final = 0.01
_MAX_INNOVATION: Final = 0.5
_WELL_KNOWN: Final = 0.009999999776482582


@final
class YawFusion:
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

    def __init__(
        self,
        params: Params,
        state: State,
        output: OutputPredictor,
        aiding: Aiding,
        sources: EkfSources,
        ext_nav: ExtNav,
        gps: Gps,
        events: Events,
        resets: Resets,
        vel_pos: VelPosFusion,
        compass: CompassReader,
        by_gps: GpsYaw,
        learns_field_on_ground: bool,
    ) -> None:
        self._params = params
        self._state = state
        self._output = output
        self._aiding = aiding
        self._sources = sources
        self._ext_nav = ext_nav
        self._gps = gps
        self._events = events
        self._reset = resets
        self._vel_pos = vel_pos
        self.compass = compass
        self.by_gps = by_gps
        # What EK3_MAG_CAL becomes later has no effect (InitialiseVariables).
        magcal = int(params.MAG_CAL)
        self._magcal = magcal if magcal != GROUND_AND_CLIMBED or learns_field_on_ground else NEVER
        self._agreed_ms = -1
        self.aligned = False
        self.resets = 0
        self.innovation = 0.0
        self.ratio = 0.0
        self.field = MagFusion(params, state)
        self.field_was_fused = False
        self.mag_fusion = 0
        self._alignment = CompassAlignment(state)
        self._ext_nav_ms = 0
        self._synthetic_ms = 0
        self._gps_ms = 0
        self.source = NONE
        self.uses_compass = False
        self._set_source = sources.yaw()
        self._look_at_source()
        self._step_source = self.source
        self._source_changed = False
        self._yaw_at_rest = 0.0
        self._by_321_at_rest = True

    def _look_at_source(self) -> None:
        source, has_compass = self._set_source, self.compass.is_used()
        self.source = NONE if source == COMPASS and not has_compass else source
        by_compass = source == COMPASS or source == GPS_COMPASS_FALLBACK
        self.uses_compass = by_compass and has_compass and not self.compass.has_failed

    def uses_ext_nav(self, now_ms: int) -> bool:
        """Return whether yaw comes from external navigation, or is assumed while it waits for that."""
        in_use = now_ms - max(self._ext_nav_ms, self._synthetic_ms) < IN_USE_MS
        return self._sources.yaw() == EXTNAV and in_use

    def control(self, vehicle: Vehicle) -> None:
        """Look at the sources, and decide whether the magnetic fields are to be estimated, once a pass.

        Another source is noted after that decision (controlFilterModes).
        """
        self._look_at_source()
        self._alignment.update(vehicle, self.innovation)
        self._control_field(vehicle)
        self._set_source = self._sources.yaw()
        self._look_at_source()

    def _control_field(self, vehicle: Vehicle) -> None:
        magcal = self._magcal
        if vehicle.on_ground:
            self.field.is_learned = False
        on_ground = magcal == ALWAYS or magcal == GROUND_AND_CLIMBED
        if vehicle.on_ground and not on_ground and not self._state.learns_field:
            return
        if self.field.learn(self.uses_compass and self._alignment.wants_field(magcal, vehicle)):
            self._alignment.request_for_field(vehicle)

    def begin_step(self) -> None:
        """Give the magnetic fields new variances where that is due, before the prediction."""
        self.field.begin_step(self.compass.forgets_body_field)
        self.compass.forgets_body_field = False

    def step(self, now_ms: int, vehicle: Vehicle, step: Inertial, is_still: bool, climbed_m: float) -> None:
        """Fuse what came due in a step; the vehicle is ``climbed_m`` above the place of take-off."""
        source, state = self.source, self._state
        if source != self._step_source:
            self._source_changed = True
        self._step_source = source
        if not is_still:
            self._by_321_at_rest = state.prefers_321()
            self._yaw_at_rest = state.yaw(self._by_321_at_rest)
        self.field_was_fused = False
        by_gps = source == GPS_YAW or source == GPS_COMPASS_FALLBACK
        if source == GSF or (not self.uses_compass and not by_gps and source != EXTNAV):
            if self._source_changed or not self.aligned:
                self._align_by_gps(now_ms, vehicle)
                self._source_changed = False
            self._go_without_sensor(now_ms, vehicle, is_still)
            return
        if by_gps:
            self._use_gps(now_ms, vehicle, is_still)
            if source == GPS_YAW:
                return
            if self._gps_ms:
                self.compass.read(now_ms, vehicle, self.uses_compass)
                return
        ext_nav = self._ext_nav.recall_yaw()
        if ext_nav is not None and not (math.isfinite(ext_nav.yaw) and math.isfinite(ext_nav.err)):
            self._events.tell(ev.YAW, ev.NOT_FINITE, ext_nav.time_ms)
        elif ext_nav is not None:
            self._use_ext_nav(ext_nav, now_ms, vehicle)
        elif source == EXTNAV and not self.aligned:
            self._wait_for_sensor(now_ms, vehicle, is_still)
        self.compass.check_timeout(now_ms, self.uses_compass)
        self.compass.read(now_ms, vehicle, self.uses_compass)
        mag = self.compass.samples.recall(self._ext_nav.horizon_ms)
        if mag is not None and self.uses_compass:
            self._align_by_compass(mag, vehicle, climbed_m)
            if self.aligned:
                self._fuse_compass(mag, vehicle, step)
        self.field.note_learned(self._alignment.field_done)

    def check_compass(self, now_ms: int, vehicle: Vehicle) -> None:
        """Ask for an alignment once a compass has been off for 5 s on the ground (calcGpsGoodToAlign).

        With each solution of the GPS.
        """
        worst = max(self.field.ratios[0], self.field.ratios[1], self.ratio)
        if self._agreed_ms < 0 or worst <= 1 or not self.compass.are_consistent:
            self._agreed_ms = now_ms
        if now_ms - self._agreed_ms > _BAD_COMPASS_MS and not vehicle.armed:
            self._alignment.is_requested, self._agreed_ms = True, now_ms

    # Without a sensor

    def _go_without_sensor(self, now_ms: int, vehicle: Vehicle, is_still: bool) -> None:
        """Use the GSF, or keep yaw from growing uncertain, while no sensor measures it."""
        if not self._synthetic_is_due(now_ms):
            return
        if not self._fuse_gsf(vehicle):
            cov = self._state.cov
            is_known = cov.var(0) + cov.var(1) + cov.var(2) + cov.var(3) <= _WELL_KNOWN
            if is_still or vehicle.on_ground or self._aiding.mode == NO_AIDING or not is_known:
                self._fuse_assumed(vehicle, is_still)
        self.field.ratios = ZERO
        self.ratio = 0.0

    def _synthetic_is_due(self, now_ms: int) -> bool:
        if now_ms - self._synthetic_ms <= _SYNTHETIC_PERIOD_MS:
            return False
        self._synthetic_ms = now_ms
        return True

    def _fuse_gsf(self, vehicle: Vehicle) -> bool:
        if not self.aligned or self._step_source != GSF or not self.by_gps.has_estimate():
            return False
        yaw, variance = self.by_gps.gsf.estimate()
        by_321 = self._state.prefers_321()
        return self._fuse(wrap_pi(self._state.yaw(by_321) - yaw), variance, vehicle, by_321)

    def _fuse_assumed(self, vehicle: Vehicle, is_still: bool) -> None:
        if is_still:
            by_321 = self._by_321_at_rest
            innovation = wrap_pi(self._state.yaw(by_321) - self._yaw_at_rest)
            self._fuse(innovation, square(larger(self._params.YAW_M_NSE, _MIN_YAW_NOISE)), vehicle, by_321)
        else:
            self._fuse(0.0, square(self._params.YAW_M_NSE), vehicle, self._state.prefers_321())

    def _wait_for_sensor(self, now_ms: int, vehicle: Vehicle, is_still: bool) -> None:
        if vehicle.tilt_aligned and not self.aligned and self._synthetic_is_due(now_ms):
            self._fuse_assumed(vehicle, is_still)

    # By external navigation

    def _use_ext_nav(self, sample: YawSample, now_ms: int, vehicle: Vehicle) -> None:
        if self._step_source != EXTNAV:
            self._events.tell(ev.YAW, ev.UNUSED, sample.time_ms)
            return
        self._ext_nav_ms = now_ms
        if not vehicle.tilt_aligned:
            self._events.tell(ev.YAW, ev.UNUSED, sample.time_ms)
        elif self.aligned and not self._source_changed:
            innovation = wrap_pi(self._state.yaw(True) - sample.yaw)
            was_fused = self._fuse(innovation, square(larger(sample.err, _MIN_YAW_NOISE)), vehicle, True)
            rule = ev.FUSED if was_fused else ev.GATE_YAW
            self._events.tell(ev.YAW, rule, sample.time_ms, math.sqrt(self.ratio), abs(innovation))
        else:
            self._align(sample.yaw, square(larger(sample.err, _MIN_ALIGNED_NOISE)), vehicle, True)
            self._events.say(ev.YAW_ALIGNED)
            self._events.tell(ev.YAW, ev.ALIGNED_TO, sample.time_ms)

    # By GPS

    def _use_gps(self, now_ms: int, vehicle: Vehicle, is_still: bool) -> None:
        fix = self._gps.delayed
        if self._gps.is_due and fix is not None and not math.isnan(fix.yaw):
            self._gps_ms = now_ms
            if not vehicle.tilt_aligned:
                return
            variance = square(MIN_YAW_ERR)
            if self.aligned and not self._source_changed:
                self._fuse(wrap_pi(self._state.yaw(True) - fix.yaw), variance, vehicle, True)
                return
            self._align(wrap_pi(fix.yaw), variance, vehicle, True)
            self._events.say(ev.YAW_ALIGNED)
        else:
            self._wait_for_sensor(now_ms, vehicle, is_still)

    def correct_by_gps(self, now_ms: int, vehicle: Vehicle) -> None:
        """Let the GSF take the velocity that came due in a step, and set yaw by it if that was asked for."""
        self.by_gps.fuse()
        if self.by_gps.emergency(now_ms) and self._reset_to_gsf(now_ms, vehicle):
            self.compass.has_failed = True

    def _align_by_gps(self, now_ms: int, vehicle: Vehicle) -> None:
        """Set yaw by the GSF, or else to where the vehicle goes, unless it agrees (realignYawGPS)."""
        if self._step_source == GSF and not self.by_gps.is_steady:
            return
        course = self.by_gps.course(self._vel_pos.vel_ratio)
        if course is None:
            return
        if self.aligned and not course.disagrees:
            if course.is_steady:
                self.by_gps.forget_course()
                self._alignment.note_yaw(vehicle)
        elif not self._reset_to_gsf(now_ms, vehicle) and course.is_steady:
            self.by_gps.forget_course()
            self._align(course.yaw, course.variance, vehicle, self._best_order())
            self._reset.velocity(now_ms, False, True)
            self._reset.position(now_ms, True)
            self._events.say(ev.YAW_ALIGNED_TO_GPS)

    def _reset_to_gsf(self, now_ms: int, vehicle: Vehicle) -> bool:
        found = self.by_gps.take_for_reset()
        if found is None:
            return False
        self._align(found[0], found[1], vehicle, self._best_order())
        self._events.say(ev.EMERGENCY_YAW_RESET if self.uses_compass else ev.YAW_ALIGNED_USING_GPS)
        self._reset.velocity(now_ms, False, False)
        self._reset.position(now_ms, False)
        self._vel_pos.vel_ratio = 0.0
        self._vel_pos.pos_ratio = 0.0
        return True

    def _best_order(self) -> bool:
        """Return whether to set yaw by 3-2-1 (bestRotationOrder)."""
        return abs(self._state.rotation[0][2]) < abs(self._state.rotation[1][2])

    def _align(self, yaw: float, variance: float, vehicle: Vehicle, by_321: bool) -> None:
        self._source_changed = False
        self._output.rotate(self._state.set_yaw(yaw, variance, by_321))
        self.aligned = True
        self.resets += 1
        self._alignment.note_yaw(vehicle)

    # By the compass

    def _compass_yaw(self, mag: MagSample, by_321: bool) -> float:
        north, east, _ = to_earth(matrix(self._state.quat), mag.field)
        # The field with yaw taken out of it points as far off north as the vehicle does, the other way round.
        level = math.atan2(east, north) - self._state.yaw(by_321)
        return wrap_pi(self.field.declination() - level)

    def _align_by_compass(self, mag: MagSample, vehicle: Vehicle, climbed_m: float) -> None:
        alignment = self._alignment
        if self._source_changed:
            alignment.is_requested = True
            self._source_changed = False
        due = alignment.due(vehicle, self.innovation, climbed_m, self.aligned)
        if due != NOT_DUE:
            self._align_to(mag, due, vehicle)
        if self.compass.wants_reset:
            self.field.is_learned = False
            self._set_field(mag, vehicle)

    def _align_to(self, mag: MagSample, due: int, vehicle: Vehicle) -> None:
        number = float(self.compass.number), 0.0, 0.0
        if not self.aligned:
            self._events.say(ev.MAG_INITIAL, number)
        by_321 = self._best_order()
        measured = self._compass_yaw(mag, by_321)
        self._align(measured, square(larger(self._params.YAW_M_NSE, _MIN_ALIGNED_NOISE)), vehicle, by_321)
        if due == FINAL:
            self._events.say(ev.MAG_IN_FLIGHT, number)
        elif due == INTERIM:
            self._events.say(ev.MAG_ANOMALY, number)
            self._alignment.note_anomaly()
        if not self.field.is_learned:
            self._set_field(mag, vehicle)

    def _set_field(self, mag: MagSample, vehicle: Vehicle) -> None:
        self.compass.wants_reset = False
        self.field.reset(mag)
        self._alignment.note_field(vehicle, self.innovation)

    def _fuse_compass(self, mag: MagSample, vehicle: Vehicle, step: Inertial) -> None:
        if self._state.learns_field and self._alignment.field_set and not self.compass.wants_reset:
            self.mag_fusion = 2
            self.field_was_fused = self.field.fuse(mag, step, self._aiding.mode == ABSOLUTE)
            self.compass.is_healthy = self.field_was_fused
            self.ratio = 0.0
            return
        self.mag_fusion = 1
        self.field.ratios = ZERO
        by_321 = self._state.prefers_321()
        innovation = wrap_pi(self._state.yaw(by_321) - self._compass_yaw(mag, by_321))
        self._fuse(innovation, square(self._params.YAW_M_NSE), vehicle, by_321)

    def _fuse(self, innovation: float, variance: float, vehicle: Vehicle, by_321: bool) -> bool:
        """Fuse a yaw; on the ground even beyond the gate, but then no more than half a radian of it (fuseEulerYaw)."""
        expected = self._state.look_along_yaw(by_321)
        innovation_var = expected + larger(variance, MIN_NOISE_VAR)
        self.innovation = innovation
        self.ratio = square(innovation) / (gate(self._params.YAW_I_GATE) * innovation_var)
        self.compass.is_healthy = self.ratio <= 1
        if self.ratio > 1 and vehicle.in_flight:
            return False
        self._state.fuse(expected, limited(innovation, -_MAX_INNOVATION, _MAX_INNOVATION), variance)
        return True
