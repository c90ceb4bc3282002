# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Resets of position, velocity and height (AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp)."""

from typing import Final, final

from ekf_stub.core.aiding import ABSOLUTE, Aiding
from ekf_stub.core.covariance import POS, VEL
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.gps import Gps
from ekf_stub.core.output import OutputPredictor
from ekf_stub.core.params import EXTNAV, GPS, EkfSources, Params
from ekf_stub.core.state import State
from ekf_stub.core.vectors import Vec2, Vec3, larger, signed_since_ms, since_ms, square, sub

_FRESH_MEASUREMENT_MS: Final = 250
_LOST_VELOCITY_VAR: Final = 25.0 * 25.0


@final
class Resets:
    """Puts state, covariance and outputs where a measurement says, and tells the aiding that all is well again.

    Attributes:
        moved_ne: by how much the last reset of position moved, m north and east (posResetNE).
        last_known_ne, last_known_down: where the vehicle counts as being without aiding, m.
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
    ) -> None:
        self._params = params
        self._state = state
        self._output = output
        self._aiding = aiding
        self._sources = sources
        self._ext_nav = ext_nav
        self._gps = gps
        self.moved_ne: Vec2 = (0.0, 0.0)
        self.last_known_ne: Vec2 = (0.0, 0.0)
        self.last_known_down = 0.0

    def position(self, now_ms: int, by_gps: bool) -> None:
        """Put the horizontal position where it was measured last, or without aiding known last (ResetPosition).

        However old a measurement of the source is; without a source it must be fresh. Any reset ends the timeout.
        """
        state = self._state
        before = state.pos
        north, east, variance = self._position_target(now_ms, by_gps)
        state.set_pos((north, east, before[2]))
        state.clear(POS, POS + 2, variance)
        self._output.set_pos_ne(north, east)
        self.moved_ne = state.pos[0] - before[0], state.pos[1] - before[1]
        self._aiding.pos_timeout = False
        self._aiding.pos_ms = now_ms

    def _position_target(self, now_ms: int, by_gps: bool) -> Vec3:
        """Return north and east, m, and their variance, m^2."""
        pose, fix, noise = self._ext_nav.pose, self._gps.newest_at_imu(), self._params.POSNE_M_NSE
        if self._aiding.mode != ABSOLUTE:
            return self.last_known_ne[0], self.last_known_ne[1], square(noise)
        source = self._sources.pos_xy()
        is_open = not by_gps and source != GPS and source != EXTNAV
        gps_is_fresh = since_ms(now_ms, self._gps.received_ms) < _FRESH_MEASUREMENT_MS
        if fix is not None and (by_gps or source == GPS or (is_open and gps_is_fresh)):
            ahead_s = 1e-3 * signed_since_ms(self._ext_nav.horizon_ms, fix.time_ms)
            north, east = fix.pos[0] + ahead_s * fix.vel[0], fix.pos[1] + ahead_s * fix.vel[1]
            return north, east, square(larger(self._gps.pos_accuracy, noise))
        pose_is_fresh = pose is not None and since_ms(now_ms, pose.time_ms) < _FRESH_MEASUREMENT_MS
        if pose is not None and (pose_is_fresh or not is_open):
            return pose.pos[0], pose.pos[1], square(pose.err)
        return self._state.pos[0], self._state.pos[1], 0.0

    def shift_to(self, pos: Vec3, with_height: bool) -> None:
        """Follow a jump of the frame of a source: state and outputs by as much, and nothing else."""
        state = self._state
        north, east, down = sub(pos, state.pos)
        if not with_height:
            down = 0.0
        state.set_pos((state.pos[0] + north, state.pos[1] + east, state.pos[2] + down))
        self._output.shift_pos((north, east, down))
        if down != 0.0:
            self._output.restart_height_filter()
        self.moved_ne = north, east

    def velocity(self, now_ms: int, by_ext_nav: bool, by_gps: bool) -> None:
        """Put the horizontal velocity where it was measured last, or to rest (ResetVelocity)."""
        state = self._state
        north, east, variance = self._velocity_target(now_ms, by_ext_nav, by_gps)
        state.set_vel((north, east, state.vel[2]))
        state.clear(VEL, VEL + 2, variance)
        self._output.set_vel_ne(north, east)
        if self._aiding.mode == ABSOLUTE:
            self._aiding.vel_timeout = False
            self._aiding.vel_ms = now_ms

    def _velocity_target(self, now_ms: int, by_ext_nav: bool, by_gps: bool) -> Vec3:
        """Return north and east, m/s, and their variance, (m/s)^2."""
        ext_nav, fix, noise = self._ext_nav, self._gps.newest_at_imu(), self._params.VELNE_M_NSE
        if self._aiding.mode != ABSOLUTE:
            return 0.0, 0.0, square(noise)
        source = self._sources.active().vel_xy
        is_open = not by_ext_nav and not by_gps and source != GPS and source != EXTNAV
        gps_is_fresh = since_ms(now_ms, self._gps.received_ms) < _FRESH_MEASUREMENT_MS
        if fix is not None and (by_gps or (not by_ext_nav and source == GPS) or (is_open and gps_is_fresh)):
            return fix.vel[0], fix.vel[1], square(larger(noise, self._gps.speed_accuracy))
        is_fresh = ext_nav.have_velocity and since_ms(now_ms, ext_nav.velocity_stamp_ms) < _FRESH_MEASUREMENT_MS
        if by_ext_nav or source == EXTNAV or (is_open and is_fresh):
            measured = ext_nav.velocity
            return (0.0, 0.0, 0.0) if measured is None else (measured.vel[0], measured.vel[1], square(measured.err))
        return 0.0, 0.0, _LOST_VELOCITY_VAR

    def height(self, now_ms: int, down: float, variance: float, sets_climb: bool, vel_down: float) -> None:
        """Put height where it was measured; and vertical velocity, if that is given (ResetHeight)."""
        state = self._state
        state.set_pos((state.pos[0], state.pos[1], down))
        state.clear(POS + 2, POS + 3, variance)
        self._aiding.height_ms = now_ms
        if sets_climb:
            state.set_vel((state.vel[0], state.vel[1], vel_down))
        measured = self._ext_nav.velocity
        state.clear(VEL + 2, VEL + 3, square(self._params.VELD_M_NSE if measured is None else measured.err))
        self._output.set_down(down, state.vel[2])

    def shift_height(self, down: float) -> None:
        """Follow a change of the source of height: state and outputs by as much."""
        state = self._state
        shift = down - state.pos[2]
        state.set_pos((state.pos[0], state.pos[1], state.pos[2] + shift))
        self._output.shift_pos((0.0, 0.0, shift))
        if shift != 0.0:
            self._output.restart_height_filter()
