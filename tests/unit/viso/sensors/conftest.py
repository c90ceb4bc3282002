# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter in closed loop with a source of inertial data, in virtual time."""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
import pytest

from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.core.reporting import report_of
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.obs_ring import ring_sizes
from ekf_stub.inputs.sensors import SensorSource
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_report import CoreReport
from ekf_stub.reports.core_texts import CoreTexts
from viso.parameters.table import make_groups
from viso.sensors.stream.follow import FollowSource

LOOP_US = 2500
LONGEST_DELAY_MS = 60
EXT_NAV = 6
DELAY_MS = 10
POS_ERR, ANG_ERR, VEL_ERR = np.float32(0.2), np.float32(0.2), np.float32(0.1)

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

        @cache
        def get_float(name: str) -> float:
            found = table.find(f"EK3_{name}")
            assert found is not None
            return float(found.value)

        self._source = source
        self.core = Ekf3Core(
            EkfSources(lambda name: table.get_int(f"EK3_{name}")),
            get_float,
            ring_sizes(LONGEST_DELAY_MS),
            CoreTexts(self, (0,)),
            Counter(),
            lambda: has_compass,
        )
        self.now_us = 0
        self.armed = False
        self.texts: list[tuple[float, str]] = []
        self.reports: list[tuple[float, CoreReport]] = []
        self._reset_ms = 0

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.texts.append((1e-6 * self.now_us, text.removeprefix("EKF3 IMU0 ")))

    def run_pass(self) -> bool:
        """Run a pass of the main loop; say whether there was anything for the filter to do."""
        self.now_us += LOOP_US
        sensors = self._source.sense(self.now_us)
        if sensors is None:
            return False
        self.core.run(
            Frame(
                self.now_us,
                sensors.delta,
                armed=self.armed,
                baro=sensors.baro,
                mag=sensors.mag,
                declination=sensors.declination,
            )
        )
        if self.core.initialised and self.now_us % 100_000 == 0:
            self.reports.append((1e-6 * self.now_us, report_of(self.core, self.now_us // 1000)))
        return True

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
        self.core.ingest.write_pose(vector, attitude, (POS_ERR, ANG_ERR), stamp_ms, delay_ms, reset_ms)
        if isinstance(self._source, FollowSource):
            self._source.take_pose(vector, attitude, stamp_ms - delay_ms, is_reset=reset_ms != self._reset_ms)
        self._reset_ms = reset_ms

    def tell_velocity(self, vel: Three, *, stamp_ms: int | None = None, delay_ms: int = DELAY_MS) -> None:
        """Hand a velocity to the filter."""
        stamp_ms = self.now_us // 1000 if stamp_ms is None else stamp_ms
        self.core.ingest.write_velocity(Vector3f(*vel), VEL_ERR, stamp_ms, delay_ms)

    def at(self, time_s: float) -> CoreReport:
        """Return the first report from a time on."""
        return next(report for now_s, report in self.reports if now_s >= time_s - 1e-6)

    def between(self, start_s: float, end_s: float = math.inf) -> list[CoreReport]:
        """Return the reports of a time."""
        return [report for now_s, report in self.reports if start_s <= now_s <= end_s]

    def is_aided(self) -> bool:
        """Return whether the filter navigates by external navigation."""
        return self.core.aiding.mode is AidingMode.ABSOLUTE


MakeLoop = Callable[..., FilterLoop]


@pytest.fixture
def make_loop() -> MakeLoop:
    """Return a function that makes a loop around a source; parameters not given are external navigation throughout."""

    def make(source: SensorSource, *, has_compass: bool = False, **params: float) -> FilterLoop:
        return FilterLoop(source, params, has_compass=has_compass)

    return make
