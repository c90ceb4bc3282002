# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fusion of all three axes of the compass (AP_NavEKF3/AP_NavEKF3_MagFusion.cpp, FuseMagnetometer, FuseDeclination)."""

import math
from typing import Final, final

from ap_core.declination import get_declination_rad, get_earth_field_ga
from ap_core.location import Location
from ekf_stub.core.covariance import BODY, EARTH, STATES, VEL
from ekf_stub.core.inertial import Inertial
from ekf_stub.core.params import Params, gate
from ekf_stub.core.samples import MagSample
from ekf_stub.core.state import State
from ekf_stub.core.vectors import (
    ZERO,
    Quat,
    Rotation,
    Vec3,
    add,
    length,
    length2,
    limited,
    matrix,
    square,
    sub,
    to_body,
    to_earth,
)

_RATE_SCALE: Final = 0.005  # of the noise, Gauss per rad/s
_MIN_NOISE: Final = 0.01
_MAX_NOISE: Final = 0.5
_START_DECLINATION_ERR: Final = math.radians(20.0)
_ALIGNED_DECLINATION_ERR: Final = 0.1
_DECLINATION_ERR: Final = 0.34
_MAX_DECLINATION_INNOVATION: Final = 0.5
_LEARNED_VAR: Final = 0.01 * 0.01
_MIN_NORTH_FIELD: Final = 1e-3
_MIN_LEVEL_FIELD_SQUARED: Final = 1e-4


@final
class MagFusion:
    """The magnetic fields of the earth and of the vehicle.

    Attributes:
        is_learned: the fields are known so well that they are kept until the vehicle has landed.
        innovation: of the three axes, Gauss; ``ratios`` are their squares to the gate.
        has_table: whether the field of the place has been looked up in the table of the world.
        compass_declination: of the magnetic field by the compass, rad.
    """

    def __init__(self, params: Params, state: State) -> None:
        self._params = params
        self._state = state
        self.is_learned = False
        self.innovation: Vec3 = ZERO
        self.ratios: Vec3 = ZERO
        self.has_table = False
        self.compass_declination = 0.0
        self._table_declination = 0.0
        self._table_field: Vec3 = ZERO
        self._learned_vars = [0.0] * (STATES - EARTH)
        self._begins = False

    def learn(self, wanted: bool) -> bool:
        """Estimate the fields from now on, or stop; say whether that has begun (setWindMagStateLearningMode)."""
        state = self._state
        if wanted == state.learns_field:
            return False
        state.learn_field(wanted)
        self._begins = wanted
        if not wanted:
            return False
        if self.is_learned:
            for i in range(EARTH, STATES):
                state.cov.put(i, i, self._learned_vars[i - EARTH])
        else:
            for i in range(BODY - 1, STATES):
                state.cov.put(i, i, self._variance())
            self.align_declination()
        return True

    def begin_step(self, forgets_body_field: bool) -> None:
        """Before a prediction, limit the earth's field, and give fields that begin or change their variances."""
        self._limit()
        if forgets_body_field:
            self._state.clear(BODY, STATES, self._variance())
        if self._begins:
            self._begins = False
            self._state.clear(EARTH, STATES, self._variance())
            self._fuse_declination(_START_DECLINATION_ERR)

    def _variance(self) -> float:
        return square(self._params.MAG_M_NSE)

    def look_up(self, place: Location) -> None:
        """Look up the field of a place in the table of the world (getEarthFieldTable)."""
        field = get_earth_field_ga(place)
        self._table_field = float(field.x), float(field.y), float(field.z)
        self._table_declination = float(get_declination_rad(place))
        self.has_table = True

    def use_table(self, place: Location) -> None:
        """Look up the field of a place, and go on with it (setEarthFieldFromLocation)."""
        self.look_up(place)
        if self._follows_table():
            self._state.set_earth_field(self._table_field)

    def _follows_table(self) -> bool:
        return self.has_table and self._params.MAG_EF_LIM > 0

    def declination(self) -> float:
        """Return the declination of the magnetic field, rad (MagDeclination)."""
        return self._table_declination if self._follows_table() else self.compass_declination

    def reset(self, mag: MagSample) -> None:
        """Take the earth's field from the table, or from a measurement and the attitude (resetMagFieldStates)."""
        state = self._state
        state.set_earth_field(self._table_field if self._follows_table() else to_earth(state.rotation, mag.field))
        self.align_declination()
        state.clear(BODY - 1, STATES, self._variance())

    def align_declination(self) -> None:
        """Turn the earth's field to the declination, unless the field is learned (alignMagStateDeclination)."""
        state, declination = self._state, self.declination()
        if self.is_learned:
            return
        level = length2(state.earth_field[0], state.earth_field[1])
        north, east = level * math.cos(declination), level * math.sin(declination)
        state.set_earth_field((north, east, state.earth_field[2]))
        if state.learns_field:
            state.clear(EARTH, EARTH + 1, state.cov.var(EARTH))
            state.clear(EARTH + 1, EARTH + 2, state.cov.var(EARTH + 1))
            self._fuse_declination(_ALIGNED_DECLINATION_ERR)

    def _fuse_declination(self, err: float) -> None:
        state = self._state
        north, east, _ = state.earth_field
        level_squared = north * north + east * east
        if north < _MIN_NORTH_FIELD or level_squared < _MIN_LEVEL_FIELD_SQUARED:
            return
        row = state.cov.row
        row[EARTH], row[EARTH + 1] = -east / level_squared, north / level_squared
        expected = state.cov.look_along(EARTH, EARTH + 2)
        innovation = math.atan2(east, north) - self.declination()
        bound = _MAX_DECLINATION_INNOVATION
        state.fuse(expected, limited(innovation, -bound, bound), square(err))

    def fuse(self, mag: MagSample, step: Inertial, knows_north: bool) -> bool:
        """Fuse the three axes one after the other, with the attitude that they all found; say whether all passed.

        The declination keeps the earth's field from turning, unless there is no table and ``knows_north`` tells that
        positions do.
        """
        params, state = self._params, self._state
        if not knows_north or self._follows_table():
            self._fuse_declination(_DECLINATION_ERR)
        quat, field = state.quat, state.earth_field
        rotation = matrix(quat)
        noise_var = square(limited(params.MAG_M_NSE, _MIN_NOISE, _MAX_NOISE))
        noise_var += square(_RATE_SCALE * length(step.del_ang) / step.del_ang_dt)
        self.innovation = sub(add(to_body(rotation, field), state.body_field), mag.field)
        variances = (
            self._look_along(0, quat, field, rotation) + noise_var,
            self._look_along(1, quat, field, rotation) + noise_var,
            self._look_along(2, quat, field, rotation) + noise_var,
        )
        limit = gate(params.MAG_I_GATE)
        x, y, z = self.innovation
        self.ratios = (
            square(x) / (limit * variances[0]),
            square(y) / (limit * variances[1]),
            square(z) / (limit * variances[2]),
        )
        if self.ratios[0] >= 1 or self.ratios[1] >= 1 or self.ratios[2] >= 1:
            return False
        for axis in range(3):
            expected = self._look_along(axis, quat, field, rotation)
            variance = variances[axis]
            # The variance of the innovation is that of before the first axis.
            rest = max(variance - expected, 0.0) if variance > 0.0 else math.nan
            state.fuse(expected, self.innovation[axis], rest)
            self._limit()
        return True

    def _look_along(self, axis: int, quat: Quat, earth_field: Vec3, rotation: Rotation) -> float:
        """Look at the field along an axis of the body, by an attitude and the earth's field; return its variance."""
        cov = self._state.cov
        row = cov.row
        self._state.set_body_axis_row(axis, quat, earth_field)
        for i in range(VEL, EARTH):
            row[i] = 0.0
        row[EARTH], row[EARTH + 1], row[EARTH + 2] = rotation[0][axis], rotation[1][axis], rotation[2][axis]
        for i in range(3):
            row[BODY + i] = 1.0 if i == axis else 0.0
        return cov.look_along(0, STATES)

    def _limit(self) -> None:
        """Keep the earth's field near that of the table (MagTableConstrain)."""
        state, around = self._state, 0.001 * self._params.MAG_EF_LIM
        if self._follows_table():
            north, east, down = self._table_field
            state.set_earth_field(
                (
                    limited(state.earth_field[0], north - around, north + around),
                    limited(state.earth_field[1], east - around, east + around),
                    limited(state.earth_field[2], down - around, down + around),
                )
            )

    def note_learned(self, is_set_in_flight: bool) -> None:
        """Note how well the fields are known, once they were set in flight (SelectMagFusion)."""
        if not is_set_in_flight and not self.is_learned:
            return
        cov = self._state.cov
        if cov.var(EARTH) < _LEARNED_VAR and cov.var(EARTH + 1) < _LEARNED_VAR and cov.var(EARTH + 2) < _LEARNED_VAR:
            self.is_learned = True
        if self.is_learned and self._state.learns_field:
            for i in range(EARTH, STATES):
                self._learned_vars[i - EARTH] = cov.var(i)
