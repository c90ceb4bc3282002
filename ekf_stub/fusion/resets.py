# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Resets of position, velocity and height (AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp)."""

from typing import Final

import numpy as np

from ap_core.cint import i32, u32
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.states import POS, VEL
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.inputs.sources import SourceXY

FRESH_MEASUREMENT_MS: Final = 250
LOST_VELOCITY_VAR: Final = 25.0**2
NORTH_EAST: Final = slice(0, 2)
_VEL_NE: Final = slice(VEL.start, VEL.start + 2)
_VEL_D: Final = slice(VEL.start + 2, VEL.stop)
POS_NE: Final = slice(POS.start, POS.start + 2)
_POS_D: Final = slice(POS.start + 2, POS.stop)


class Resets(Fusion):
    """Puts state, covariance and outputs where a measurement says, and tells the aiding that all is well again.

    Attributes:
        moved_ne: by how much the last reset of position moved, m north and east (posResetNE).
        last_known_ne: where the vehicle counts as being without aiding.
    """

    def __init__(self, parts: FilterParts) -> None:
        super().__init__(parts)
        self.moved_ne: Array = np.zeros(2)
        self.last_known_ne: Array = np.zeros(2)

    def position(self, now_ms: int, *, by_gps: bool = False) -> None:
        """Put the horizontal position where it was measured last, or without aiding known last (ResetPosition).

        However old a measurement of the source is; without a source it must be fresh. Any reset ends the timeout.
        """
        before = self._state.pos[NORTH_EAST].copy()
        target, variance = self._position_target(now_ms, by_gps=by_gps)
        self._state.pos = np.array([*target, self._state.pos[2]])
        self._state.clear(POS_NE, variance)
        self._output.overwrite(pos={0: float(target[0]), 1: float(target[1])})
        self.moved_ne = self._state.pos[NORTH_EAST] - before
        self._aiding.pos_timeout = False
        self._aiding.times.pos = now_ms

    def _position_target(self, now_ms: int, *, by_gps: bool) -> tuple[Array, float]:
        pose, fix, noise = self._delayed.pose, self._gps.newest_at_imu(), self._get_float("POSNE_M_NSE")
        if self._aiding.mode is not AidingMode.ABSOLUTE:
            return self.last_known_ne, noise**2
        source = self._sources.pos_xy()
        is_open = not by_gps and source not in (SourceXY.GPS, SourceXY.EXTNAV)
        gps_is_fresh = u32(now_ms - self._gps.received_ms) < FRESH_MEASUREMENT_MS
        if fix is not None and (by_gps or source == SourceXY.GPS or (is_open and gps_is_fresh)):
            ahead_s = 1e-3 * i32(self._ingest.horizon_ms - fix.time_ms)
            return (fix.pos + ahead_s * fix.vel)[NORTH_EAST], max(self._gps.pos_accuracy, noise) ** 2
        pose_is_fresh = pose is not None and u32(now_ms - pose.time_ms) < FRESH_MEASUREMENT_MS
        if pose is not None and (pose_is_fresh or not is_open):
            return pose.pos[NORTH_EAST], pose.err**2
        return self._state.pos[NORTH_EAST], 0.0

    def shift_to(self, pos: Array, *, with_height: bool) -> None:
        """Follow a jump of the frame of a source: state and outputs by as much, and nothing else."""
        shift = pos - self._state.pos
        if not with_height:
            shift[2] = 0.0
        self._state.pos = self._state.pos + shift
        self._output.shift(shift)
        if shift[2]:
            self._output.restart_height_filter()
        self.moved_ne = shift[NORTH_EAST].copy()

    def velocity(self, now_ms: int, *, by_ext_nav: bool = False, by_gps: bool = False) -> None:
        """Put the horizontal velocity where it was measured last, or to rest (ResetVelocity)."""
        target, variance = self._velocity_target(now_ms, by_ext_nav=by_ext_nav, by_gps=by_gps)
        self._state.vel = np.array([*target, self._state.vel[2]])
        self._state.clear(_VEL_NE, variance)
        self._output.overwrite(vel={0: float(target[0]), 1: float(target[1])})
        if self._aiding.mode is AidingMode.ABSOLUTE:
            self._aiding.vel_timeout = False
            self._aiding.times.vel = now_ms

    def _velocity_target(self, now_ms: int, *, by_ext_nav: bool, by_gps: bool) -> tuple[Array, float]:
        measured, fix, sources = self._delayed.velocity, self._gps.newest_at_imu(), self._sources
        rest, noise = np.zeros(2), self._get_float("VELNE_M_NSE")
        if self._aiding.mode is not AidingMode.ABSOLUTE:
            return rest, noise**2
        source = sources.value(sources.active_set, "VELXY")
        is_open = not by_ext_nav and not by_gps and source not in (SourceXY.GPS, SourceXY.EXTNAV)
        gps_is_fresh = u32(now_ms - self._gps.received_ms) < FRESH_MEASUREMENT_MS
        ext_nav_is_fresh = (
            self._ingest.have_velocity and u32(now_ms - self._ingest.velocity_stamp_ms) < FRESH_MEASUREMENT_MS
        )
        if fix is not None and (by_gps or (not by_ext_nav and source == SourceXY.GPS) or (is_open and gps_is_fresh)):
            return fix.vel[NORTH_EAST], max(noise, self._gps.speed_accuracy) ** 2
        if by_ext_nav or source == SourceXY.EXTNAV or (is_open and ext_nav_is_fresh):
            return (rest, 0.0) if measured is None else (measured.vel[NORTH_EAST], measured.err**2)
        return rest, LOST_VELOCITY_VAR

    def height(self, now_ms: int, down: float, variance: float, *, vertical_velocity: float | None) -> None:
        """Put height where it was measured; and vertical velocity, when one is given (ResetHeight)."""
        self._state.pos = np.array([*self._state.pos[NORTH_EAST], down])
        self._state.clear(_POS_D, variance)
        self._output.overwrite(pos={2: down})
        self._aiding.times.height = now_ms
        if vertical_velocity is not None:
            self._state.vel = np.array([*self._state.vel[NORTH_EAST], vertical_velocity])
        measured = self._delayed.velocity
        self._state.clear(_VEL_D, self._get_float("VELD_M_NSE") ** 2 if measured is None else measured.err**2)
        self._output.overwrite(vel={2: float(self._state.vel[2])})
        self._output.restart_height_filter(vel=float(self._state.vel[2]))

    def shift_height(self, down: float) -> None:
        """Follow a change of the source of height: state and outputs by as much."""
        shift = np.array([0.0, 0.0, down - self._state.pos[2]])
        self._state.pos = self._state.pos + shift
        self._output.shift(shift)
        if shift[2]:
            self._output.restart_height_filter()
