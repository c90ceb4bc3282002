# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of all three axes of the compass (AP_NavEKF3/AP_NavEKF3_MagFusion.cpp, FuseMagnetometer, FuseDeclination).

FIRMWARE PARITY: the firmware takes the earth's field from a table of the world as the origin is set. Where that is not
known, it is here the one that was measured when yaw was aligned, turned to the declination.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from ekf_stub.filter.attitude import body_axes_by_attitude
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, InertialStep, limited
from ekf_stub.filter.states import ATT, BODY, EARTH, STATES
from ekf_stub.fusion.measurements import MagSample

RATE_SCALE: Final = 0.005  # of the noise, Gauss per rad/s
NOISE_LIMITS: Final = (0.01, 0.5)
START_DECLINATION_ERR: Final = math.radians(20.0)
ALIGNED_DECLINATION_ERR: Final = 0.1
DECLINATION_ERR: Final = 0.34
MAX_DECLINATION_INNOVATION: Final = 0.5
LEARNED_VAR: Final = 0.01**2
MIN_NORTH_FIELD: Final = 1e-3
MAX_BODY_FIELD: Final = 0.5
_MIN_LEVEL_FIELD_SQUARED: Final = 1e-4


class MagFusion:
    """The magnetic fields of the earth and of the vehicle.

    Attributes:
        is_learned: the fields are known so well that they are kept until the vehicle has landed.
        innovation: of the three axes, Gauss; ``ratios`` are their squares to the gate.
        declination: of the magnetic field, rad.
    """

    def __init__(self, state: ErrorState, get_float: Callable[[str], float]) -> None:
        self._state = state
        self._get_float = get_float
        self.is_learned = False
        self.innovation: Array = np.zeros(3)
        self.ratios: Array = np.zeros(3)
        self.declination = 0.0
        self._table_field: Array = np.zeros(3)
        self._has_table = False
        self._learned_vars: Array = np.zeros(6)
        self._begins = False

    def learn(self, *, wanted: bool) -> bool:
        """Estimate the fields from now on, or stop; say whether that has begun (setWindMagStateLearningMode)."""
        state = self._state
        if wanted == state.learns_field:
            return False
        state.learns_field = self._begins = wanted
        if not wanted:
            return False
        diagonal = np.einsum("ii->i", state.cov)
        if self.is_learned:
            diagonal[EARTH.start :] = self._learned_vars
        else:
            diagonal[EARTH.stop - 1 :] = self._variance()
            self._align_declination()
        return True

    def begin_step(self, *, forgets_body_field: bool = False) -> None:
        """Give the fields their first variances, before the first prediction with them, or the vehicle's new ones."""
        if forgets_body_field:
            self._state.clear(BODY, self._variance())
        if self._begins:
            self._begins = False
            self._state.clear(slice(EARTH.start, BODY.stop), self._variance())
            self._fuse_declination(START_DECLINATION_ERR)

    def _variance(self) -> float:
        return self._get_float("MAG_M_NSE") ** 2

    def use_table(self, field: Array) -> None:
        """Take the earth's field, Gauss, NED, from a table, once (setEarthFieldFromLocation)."""
        if not self._has_table and self._get_float("MAG_EF_LIM") > 0:
            self._has_table, self._table_field = True, field
            self._state.earth_field = field

    def reset(self, mag: MagSample) -> None:
        """Take the earth's field from the table, or from a measurement and the attitude (resetMagFieldStates)."""
        state = self._state
        state.earth_field = self._table_field if self._has_table else state.rotation @ mag.field
        self._align_declination()
        if not self._has_table:
            self._table_field = state.earth_field.copy()
        state.clear(slice(EARTH.stop - 1, BODY.stop), self._variance())

    def _align_declination(self) -> None:
        state = self._state
        if self.is_learned:
            return
        level = math.hypot(state.earth_field[0], state.earth_field[1])
        north, east = level * math.cos(self.declination), level * math.sin(self.declination)
        state.earth_field = np.array([north, east, state.earth_field[2]])
        if state.learns_field:
            for index in (EARTH.start, EARTH.start + 1):
                state.clear(slice(index, index + 1), float(state.cov[index, index]))
            self._fuse_declination(ALIGNED_DECLINATION_ERR)

    def _fuse_declination(self, err: float) -> None:
        north, east = self._state.earth_field[:2].tolist()
        level_squared = north * north + east * east
        if north < MIN_NORTH_FIELD or level_squared < _MIN_LEVEL_FIELD_SQUARED:
            return
        row = np.zeros(STATES)
        row[EARTH.start : EARTH.start + 2] = -east / level_squared, north / level_squared
        innovation = math.atan2(east, north) - self.declination
        bound = MAX_DECLINATION_INNOVATION
        self._state.update(row, limited(innovation, -bound, bound), err**2)

    def fuse(self, mag: MagSample, step: InertialStep, *, knows_north: bool = False) -> bool:
        """Fuse the three axes one after the other, with the attitude that they all found; say whether all passed.

        The declination keeps the earth's field from turning, unless there is no table and ``knows_north`` tells that
        positions do.
        """
        if not knows_north or self._get_float("MAG_EF_LIM") > 0:
            self._fuse_declination(DECLINATION_ERR)
        state = self._state
        rotation = state.rotation_now()
        noise = limited(self._get_float("MAG_M_NSE"), *NOISE_LIMITS) ** 2
        noise += (RATE_SCALE * float(np.linalg.norm(step.del_ang)) / step.del_ang_dt) ** 2
        self.innovation = state.earth_field @ rotation + state.body_field - mag.field
        rows = self._rows(rotation)
        variances = [float(row @ state.cov @ row) + noise for row in rows]
        gate = max(0.01 * self._get_float("MAG_I_GATE"), 1.0) ** 2
        self.ratios = self.innovation**2 / (gate * np.array(variances))
        if (self.ratios >= 1).any():
            return False
        for row, innovation, variance in zip(rows, self.innovation.tolist(), variances, strict=True):
            state.fuse(row, innovation, variance)
            self._limit()
        return True

    def _rows(self, rotation: Array) -> list[Array]:
        """Return how the field along each axis of the body depends on the errors."""
        by_attitude = body_axes_by_attitude(self._state.quat, self._state.earth_field)
        rows = []
        for axis in range(3):
            row = np.zeros(STATES)
            row[ATT] = by_attitude[axis]
            row[EARTH] = rotation[:, axis]
            row[BODY.start + axis] = 1.0
            rows.append(row)
        return rows

    def _limit(self) -> None:
        around = 0.001 * self._get_float("MAG_EF_LIM")
        if around > 0:
            self._state.earth_field = np.clip(
                self._state.earth_field, self._table_field - around, self._table_field + around
            )
        self._state.body_field = np.clip(self._state.body_field, -MAX_BODY_FIELD, MAX_BODY_FIELD)

    def note_learned(self, *, is_set_in_flight: bool) -> None:
        """Note how well the fields are known, once they were set in flight (SelectMagFusion)."""
        if not is_set_in_flight and not self.is_learned:
            return
        variances = self._state.cov.diagonal()[EARTH.start :]
        self.is_learned = self.is_learned or bool((variances[:3] < LEARNED_VAR).all())
        if self.is_learned and self._state.learns_field:
            self._learned_vars = variances.copy()
