# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Resets of position, velocity and height (AP_NavEKF3/AP_NavEKF3_PosVelFusion.cpp)."""

from collections.abc import Callable
from typing import Final

import numpy as np

from ap_core.cint import u32
from ekf_stub.aiding import Aiding, AidingMode
from ekf_stub.error_state import POS, VEL, ErrorState
from ekf_stub.inertial import Array
from ekf_stub.measurements import Delayed
from ekf_stub.output_predictor import OutputPredictor
from ekf_stub.sources import EkfSources, SourceXY

FRESH_VELOCITY_MS: Final = 250
LOST_VELOCITY_VAR: Final = 25.0**2
NORTH_EAST: Final = slice(0, 2)
_VEL_NE: Final = slice(VEL.start, VEL.start + 2)
_VEL_D: Final = slice(VEL.start + 2, VEL.stop)
POS_NE: Final = slice(POS.start, POS.start + 2)
_POS_D: Final = slice(POS.start + 2, POS.stop)


class Resets:
    """Puts state, covariance and outputs where a measurement says, and tells the aiding that all is well again.

    Args:
        state: the filter.
        output: what follows it.
        aiding: the mode and the timeouts.
        sources: the source sets.
        delayed: the measurements at the horizon.
        get_float: returns a parameter by its name after ``EK3_``.

    Attributes:
        moved_ne: by how much the last reset of position moved, m north and east (posResetNE).
        last_known_ne: where the vehicle counts as being without aiding.
    """

    def __init__(
        self,
        state: ErrorState,
        output: OutputPredictor,
        aiding: Aiding,
        sources: EkfSources,
        delayed: Delayed,
        get_float: Callable[[str], float],
    ) -> None:
        self._state = state
        self._output = output
        self._aiding = aiding
        self._sources = sources
        self._delayed = delayed
        self._get_float = get_float
        self.moved_ne: Array = np.zeros(2)
        self.last_known_ne: Array = np.zeros(2)

    def position(self, now_ms: int) -> None:
        """Put the horizontal position where the last pose, or without aiding the last known place, is (ResetPosition).

        However old the pose is. Any reset ends the timeout.
        """
        pose = self._delayed.pose
        before = self._state.pos[NORTH_EAST].copy()
        if self._aiding.mode is AidingMode.ABSOLUTE and pose is not None:
            target, variance = pose.pos[NORTH_EAST], pose.err**2
        else:
            target, variance = self.last_known_ne, self._get_float("POSNE_M_NSE") ** 2
        self._state.pos = np.array([*target, self._state.pos[2]])
        self._state.clear(POS_NE, variance)
        self._output.overwrite(pos={0: float(target[0]), 1: float(target[1])})
        self.moved_ne = self._state.pos[NORTH_EAST] - before
        self._aiding.pos_timeout = False
        self._aiding.times.pos = now_ms

    def shift_to_pose(self, *, with_height: bool) -> None:
        """Follow a jump of the camera's frame: state and outputs by as much, and nothing else."""
        pose = self._delayed.pose
        if pose is None:
            return
        shift = pose.pos - self._state.pos
        if not with_height:
            shift[2] = 0.0
        self._state.pos = self._state.pos + shift
        self._output.shift(pos=shift)
        self.moved_ne = shift[NORTH_EAST].copy()

    def velocity(self, now_ms: int, *, by_ext_nav: bool = False) -> None:
        """Put the horizontal velocity where the last measured one is, or to rest (ResetVelocity)."""
        target, variance = self._velocity_target(now_ms, by_ext_nav=by_ext_nav)
        self._state.vel = np.array([*target, self._state.vel[2]])
        self._state.clear(_VEL_NE, variance)
        self._output.overwrite(vel={0: float(target[0]), 1: float(target[1])})
        if self._aiding.mode is AidingMode.ABSOLUTE:
            self._aiding.vel_timeout = False
            self._aiding.times.vel = now_ms

    def _velocity_target(self, now_ms: int, *, by_ext_nav: bool) -> tuple[Array, float]:
        measured = self._delayed.velocity
        rest: Array = np.zeros(2)
        if self._aiding.mode is not AidingMode.ABSOLUTE:
            return rest, self._get_float("VELNE_M_NSE") ** 2
        if by_ext_nav or self._sources.uses_vel_xy(SourceXY.EXTNAV):
            return (rest, 0.0) if measured is None else (measured.vel[NORTH_EAST], measured.err**2)
        if measured is not None and u32(now_ms - self._delayed.velocity_stamp_ms()) < FRESH_VELOCITY_MS:
            return measured.vel[NORTH_EAST], measured.err**2
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

    def shift_height(self, down: float) -> None:
        """Follow a change of the source of height: state and outputs by as much."""
        shift = np.array([0.0, 0.0, down - self._state.pos[2]])
        self._state.pos = self._state.pos + shift
        self._output.shift(pos=shift)
