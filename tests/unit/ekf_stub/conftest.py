# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An AHRS on the bench in virtual time, with settable surroundings."""

from collections.abc import Callable
from typing import Any

import pytest

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs_bench import BenchAhrs
from ekf_stub.ext_nav_log import ExtNavLog
from ekf_stub.gps_sample import GpsSample
from ekf_stub.source_check import SENSORS
from ekf_stub.sources import EkfSources
from ekf_stub.surroundings import Surroundings

LOOP_US = 2500
HOME = Location(-353632610, 1491652300, 58400)
DEFAULTS: dict[str, float] = {
    "EK3_ENABLE": 1,
    "EK3_IMU_MASK": 3,
    "EK3_MAG_CAL": 3,
    "EK3_HGT_DELAY": 60,
    "EK3_FLOW_DELAY": 10,
    "EK3_BCN_DELAY": 50,
    "EK3_VIS_VERR_MIN": 0.1,
    "EK3_VIS_VERR_MAX": 0.9,
    "VISO_DELAY_MS": 10,
}
SOURCES = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


class BenchRig:
    """A vehicle whose sources are given as ``66666`` and whose EK3_ parameters by keyword.

    Attributes:
        ahrs: the AHRS.
        texts: time in ms, severity and text of all that was said.
        statuses: time in ms and flags, whenever they changed.
        yaw_resets: the times in ms at which yaw was aligned.
        gps: the GPS's newest solution.
        armed: whether the vehicle is armed.
        fitted: the sensors that there are.
    """

    def __init__(self, sources: str, has_compass: bool, params: dict[str, float]) -> None:
        self.clock = VirtualClock()
        self.params = {**DEFAULTS, **params}
        self.use_sources(sources)
        self.texts: list[tuple[int, int, str]] = []
        self.statuses: list[tuple[int, int | None]] = []
        self.yaw_resets: list[int] = []
        self.gps: GpsSample | None = None
        self.armed = False
        self.fitted = set(SENSORS)
        self.sources = EkfSources(lambda name: self._int(f"EK3_{name}"))
        self.ahrs = BenchAhrs(
            self.clock,
            self.sources,
            ExtNavLog(self, lambda: False),
            has_compass=lambda: has_compass,
            around=Surroundings(
                self,
                self._int,
                lambda name: f32(self.params[name]),
                lambda: self.gps,
                lambda: self.armed,
                lambda sensor: sensor in self.fitted,
                lambda: self.yaw_resets.append(self.now_ms),
            ),
        )
        self._next_us = 0

    def _int(self, name: str) -> int:
        return int(self.params.get(name, 0))

    def use_sources(self, sources: str, number: int = 1) -> None:
        """Set the rows of a source set."""
        for what, value in zip(SOURCES, sources, strict=True):
            self.params[f"EK3_SRC{number}_{what}"] = int(value)

    def write(self, structure: LogStructure, values: object) -> None:
        """Take a record and forget it (RecordSink)."""

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.texts.append((self.now_ms, severity, text))

    @property
    def now_ms(self) -> int:
        """Time since boot."""
        return self.clock.millis()

    def run_to(self, time_s: float) -> None:
        """Run the main loop."""
        while self._next_us <= round(time_s * 1e6):
            self.clock.set_us(self._next_us)
            self.ahrs.update()
            self._next_us += LOOP_US
            if not self.statuses or self.statuses[-1][1] != self.flags:
                self.statuses.append((self.now_ms, self.flags))
        self.clock.set_us(round(time_s * 1e6))

    def run_for(self, duration_s: float) -> None:
        """Run the main loop on."""
        self.run_to(self.clock.micros64() * 1e-6 + duration_s)

    @property
    def flags(self) -> int | None:
        """The flags of EKF_STATUS_REPORT."""
        status = self.ahrs.get_filter_status()
        return None if status is None else int(status.flags)

    def said(self, *, since_s: float = 0) -> list[str]:
        """Return what was said, from a time on."""
        return [text for time_ms, _, text in self.texts if time_ms >= since_s * 1000]

    def pose(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, *, yaw: float = 0.0, **times: int) -> None:
        """Hand in a pose with a stamp of now."""
        quat = Quaternion.from_euler(f32(0), f32(0), f32(yaw))
        stamp_ms, reset_ms = times.get("stamp_ms", self.now_ms), times.get("reset_ms", 0)
        self.ahrs.writeExtNavData(Vector3f(x, y, z), quat, f32(0.2), f32(0.2), stamp_ms, 10, reset_ms)

    def speed(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """Hand in a velocity with a stamp of now."""
        self.ahrs.writeExtNavVelData(Vector3f(x, y, z), f32(0.1), self.now_ms, 10)

    def odometry(self, x: float = 0.0, *, quality: float = 100.0, duration_s: float = 0.05) -> None:
        """Hand in a change of position along the nose with a stamp of now."""
        way, turn, none = Vector3f(x, 0, 0), Vector3f(), Vector3f()
        self.ahrs.writeBodyFrameOdom(f32(quality), way, turn, f32(duration_s), self.now_ms, 10, none)

    def stream(self, until_s: float, *senders: Callable[[], None], period_s: float = 1 / 30) -> None:
        """Call senders again and again."""
        while self.clock.micros64() < until_s * 1e6:
            for send in senders:
                send()
            self.run_for(period_s)

    def fix(self, place: Location = HOME, **fields: Any) -> None:
        """Let the GPS have a solution of now."""
        values: dict[str, Any] = {"fix_type": 3, "vel_ned": Vector3f(), "num_sats": 10, "hdop": 120, **fields}
        self.gps = GpsSample(time_ms=self.now_ms, location=place, **values)


@pytest.fixture
def make_bench() -> Callable[..., BenchRig]:
    """Return a function that makes a vehicle from its sources, whether it has a compass, and parameters."""

    def make(sources: str = "66666", *, has_compass: bool = False, **params: float) -> BenchRig:
        return BenchRig(sources, has_compass, params)

    return make
