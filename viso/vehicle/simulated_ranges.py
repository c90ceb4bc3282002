# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The range finder of the firmware's simulator (SITL/SIM_Aircraft.cpp, AP_HAL_SITL/sitl_rangefinder.cpp)."""

import math
import random
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.param import FromParams, ParamTable
from ap_core.rotations import Rotation, rotate_vector
from ap_core.vector3 import Vector3f
from ekf_stub.core.vectors import rotated
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.source import VehicleSource
from viso.vehicle.sensors.vectors import Three

FARTHEST_M: Final = 100_000.0
MOST_VOLTS: Final = 5.0
NOTHING_IN_SIGHT: Final = math.inf


def height_above_ground_m(airframe: Airframe, source: VehicleSource) -> float:
    """Return how high a vehicle really is above the ground, m, which is level and as high as where it stood at first.

    It is in whole centimetres, as the simulator has it (SITL_State::set_height_agl).
    """
    home = source.home
    return 0.01 * (home.offset(Vector3f(*airframe.truth().pos_ned)).alt_cm - home.alt_cm)


class SimulatedRanges:
    """What the simulated range finder says, as a range and as a voltage on pin 0.

    Args:
        airframe: what flies.
        source: its sensors, which know where on earth it started.
        params: with the SIM_SONAR_ parameters.
        seed: of its noise and glitches.

    Attributes:
        range_m: the range of the last measurement, infinite where there is nothing in sight.
        volts: the voltage of the last measurement, 0..5.
    """

    def __init__(self, airframe: Airframe, source: VehicleSource, params: ParamTable, seed: int = 0) -> None:
        self._airframe = airframe
        self._source = source
        self._params = params
        self._direction_frd = FromParams(params, self._find_direction)
        self._draw = random.Random(seed)
        self.range_m = NOTHING_IN_SIGHT
        self.volts = 0.0

    def _find_direction(self) -> Three | None:
        rotation = self._params.get_int("SIM_SONAR_ROT")
        # FIRMWARE PARITY: a range finder that looks across sees the posts of an obstacle course. There are none here.
        if Rotation.NONE <= rotation <= Rotation.YAW_315:
            return None
        x, y, z = rotate_vector(Vector3f(1, 0, 0), rotation, InternalErrors()).to_tuple()
        return float(x), float(y), float(z)

    def measure(self) -> None:
        """Measure again."""
        self.range_m = self._range_m()
        self.volts = self._volts()

    def _range_m(self) -> float:
        """Return a range with noise (Aircraft::rangefinder_range)."""
        direction, quat, params = self._direction_frd(), self._airframe.truth().quat_wxyz, self._params
        down = 0.0 if direction is None else rotated(quat, direction)[2]
        if down <= np.finfo(np.float32).eps:
            return NOTHING_IN_SIGHT
        x, y, z = (float(params.get_float(f"SIM_SONAR_POS_{axis}")) for axis in "XYZ")
        height_m = height_above_ground_m(self._airframe, self._source) - rotated(quat, (x, y, z))[2]
        range_m = height_m / down
        if range_m > FARTHEST_M:
            return NOTHING_IN_SIGHT
        return max(range_m + float(params.get_float("SIM_SONAR_RND")) * self._draw.uniform(-1.0, 1.0), 0.0)

    def _volts(self) -> float:
        """Return the voltage of another range, or that of a glitch (SITL_State::_sonar_pin_voltage)."""
        glitches, scale = (float(self._params.get_float(f"SIM_SONAR_{name}")) for name in ("GLITCH", "SCALE"))
        if glitches and glitches >= self._draw.random():
            return MOST_VOLTS
        range_m = self._range_m()
        if math.isinf(range_m) or not scale:
            return MOST_VOLTS
        return float(f32(min(max(range_m / scale, 0.0), MOST_VOLTS)))
