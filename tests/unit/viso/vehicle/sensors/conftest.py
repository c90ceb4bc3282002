# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter in closed loop with a source of inertial data, in virtual time."""

import math
from collections.abc import Callable, Mapping

import pytest

from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.ahrs.ahrs_ekf3 import yaw_of
from ekf_stub.core.aiding import ABSOLUTE
from ekf_stub.core.imus import Imus
from ekf_stub.core.inputs import Compasses, CompassReading
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.params import EkfSources, Params
from ekf_stub.core.samples import RingSizes
from ekf_stub.inputs.measurements import numbers_of
from ekf_stub.inputs.sensors import Sensors, SensorSource
from ekf_stub.log.reporting import report_of
from ekf_stub.release import JULY_2025
from ekf_stub.reports import CoreReport, words_of
from viso.parameters.table import make_groups
from viso.vehicle.sensors.stream.follow import FollowSource

LOOP_US = 2500
LONGEST_DELAY_MS = 60
EXT_NAV = 6
DELAY_MS = 10
POS_ERR, ANG_ERR, VEL_ERR = 0.2, 0.2, 0.1

Three = tuple[float, float, float]
Wxyz = tuple[float, float, float, float]

LEVEL: Wxyz = (1.0, 0.0, 0.0, 0.0)


def yawed(degrees: float) -> Wxyz:
    """Return a level attitude with a yaw."""
    half = math.radians(0.5 * degrees)
    return math.cos(half), 0.0, 0.0, math.sin(half)


class FilterLoop:
    """A core of the filter and what its inertial data come from, 400 passes per second.

    Attributes:
        texts: what the core has said, with the time in s.
        reports: what it said of itself, with the time in s, ten times per second.
        armed: whether the vehicle is.
    """

    def __init__(self, source: SensorSource, params: Mapping[str, float], *, has_compass: bool) -> None:
        table = ParamTable(make_groups(1, make_params()))
        for name in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW"):
            table.set(f"EK3_SRC1_{name}", params.get(f"EK3_SRC1_{name}", EXT_NAV))
        core_params = Params()
        core_params.read(lambda name: table.get_number(f"EK3_{name}"))
        imus = Imus()
        imus.imus[0].has_data = True
        self._source = source
        self._lanes = Lanes(
            core_params,
            EkfSources(lambda name: table.get_int(f"EK3_{name}")),
            [RingSizes(LONGEST_DELAY_MS, False)],
            JULY_2025,
            imus,
            [0],
            [0],
            1,
        )
        (self.core,) = self._lanes.cores
        self.core.inputs.has_compass = has_compass
        self.now_us = 0
        self.armed = False
        self.texts: list[tuple[float, str]] = []
        self.reports: list[tuple[float, CoreReport]] = []
        self._reset_ms = 0

    def run_pass(self) -> bool:
        """Run a pass of the main loop; say whether there was anything for the filter to do."""
        self.now_us += LOOP_US
        sensors = self._source.sense(self.now_us)
        if sensors is None:
            return False
        self._set_inputs(sensors)
        self._lanes.advance([float(self.now_us), 0.0, 0.0, *numbers_of(sensors.delta)], 0, 1)
        self._listen()
        if self.core.initialised and self.now_us % 100_000 == 0:
            self.reports.append((1e-6 * self.now_us, self.report()))
        return True

    def _set_inputs(self, sensors: Sensors) -> None:
        inputs = self.core.inputs
        inputs.armed = self.armed
        inputs.set_baro(*(sensors.baro or (-1, 0.0)))
        readings = []
        if sensors.mag is not None:
            time_us, field = sensors.mag
            x, y, z = field.tolist()
            readings.append(CompassReading(time_us, (x, y, z)))
        inputs.set_compasses(Compasses(readings))
        inputs.set_declination(sensors.declination)

    def _listen(self) -> None:
        """Remember what the filter has said."""
        for text in self._lanes.texts:
            _, words = words_of(text.code, text.values)
            self.texts.append((1e-6 * self.now_us, words))
        self._lanes.texts.clear()
        self.core.events.outcomes.clear()

    def report(self) -> CoreReport:
        """Return what the core says of itself as of the last pass."""
        return report_of(self._lanes, 0)

    def tell_pose(
        self,
        pos: Three,
        quat: Wxyz = LEVEL,
        *,
        stamp_ms: int | None = None,
        delay_ms: int = DELAY_MS,
        reset_ms: int = 0,
    ) -> None:
        """Hand a pose to the filter, and to a source that follows it, as the AHRS does."""
        stamp_ms = self.now_us // 1000 if stamp_ms is None else stamp_ms
        vector, attitude = Vector3f(*pos), Quaternion(*quat)
        x, y, z = map(float, vector.to_tuple())
        self.core.ext_nav.write_pose((x, y, z), POS_ERR, yaw_of(attitude), ANG_ERR, stamp_ms, delay_ms, reset_ms)
        if isinstance(self._source, FollowSource):
            self._source.take_pose(vector, attitude, stamp_ms - delay_ms, is_reset=reset_ms != self._reset_ms)
        self._reset_ms = reset_ms

    def tell_velocity(self, vel: Three, *, stamp_ms: int | None = None, delay_ms: int = DELAY_MS) -> None:
        """Hand a velocity to the filter."""
        stamp_ms = self.now_us // 1000 if stamp_ms is None else stamp_ms
        x, y, z = map(float, Vector3f(*vel).to_tuple())
        self.core.ext_nav.write_velocity((x, y, z), VEL_ERR, stamp_ms, delay_ms)

    def at(self, time_s: float) -> CoreReport:
        """Return the first report from a time on."""
        return next(report for now_s, report in self.reports if now_s >= time_s - 1e-6)

    def between(self, start_s: float, end_s: float = math.inf) -> list[CoreReport]:
        """Return the reports of a time."""
        return [report for now_s, report in self.reports if start_s <= now_s <= end_s]

    def is_aided(self) -> bool:
        """Return whether the filter navigates by external navigation."""
        return self.core.aiding.mode == ABSOLUTE


MakeLoop = Callable[..., FilterLoop]


@pytest.fixture
def make_loop() -> MakeLoop:
    """Return a function that makes a loop around a source; parameters not given are external navigation throughout."""

    def make(source: SensorSource, *, has_compass: bool = False, **params: float) -> FilterLoop:
        return FilterLoop(source, params, has_compass=has_compass)

    return make
