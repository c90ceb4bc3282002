# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A filter core that is fed frame by frame in virtual time."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ap_core.fmath import f32
from ap_core.param import ParamTable
from ap_core.param_cache import Numbers
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.filter.inertial import GRAVITY_MSS, Array, InertialDelta
from ekf_stub.filter.release import REFERENCE, FilterRelease
from ekf_stub.inputs.flow_ingest import FlowMeasurement
from ekf_stub.inputs.obs_ring import RingSizes
from ekf_stub.inputs.range_state import DOWNWARD, FinderState, RangeState, RangeStatus
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_texts import CoreTexts
from viso.parameters.table import make_groups

LOOP_US = 2500
SOURCES = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


class CoreRig:
    """A filter core that is given frames of constant inertial data; its clock begins at 10 s.

    Attributes:
        frame: fields of the frames, but time and inertial data.
        accel, rate: what the IMU feels, m/s/s and rad/s, body (FRD).
        height: of the barometer, read ten times per second; None without one.
        field: what the compass feels as often, mGauss, body; None without one.
        said: time in ms and text of all that was said, without the core.
    """

    def __init__(
        self, sources: str, has_compass: bool, params: dict[str, float], release: FilterRelease = REFERENCE
    ) -> None:
        self.params = ParamTable(make_groups(0, make_params()))
        for what, value in zip(SOURCES, sources, strict=True):
            self.params.set(f"EK3_SRC1_{what}", int(value))
        for name, number in params.items():
            self.params.set(f"EK3_{name}", number)
        self.said: list[tuple[int, str]] = []
        self.counts: Counter[tuple[str, str]] = Counter()
        numbers = Numbers(self.params)
        self.core = Ekf3Core(
            EkfSources(lambda name: self.params.get_int(f"EK3_{name}"), self.params.on_change.append),
            lambda name: numbers[f"EK3_{name}"],
            RingSizes(6, 5, 2, flow=5),
            CoreTexts(self, (0,)),
            self.counts,
            lambda: has_compass,
            release=release,
        )
        self.now_us = 10_000_000
        self.frame: dict[str, Any] = {}
        self.accel: Array | Sequence[float] = (0.0, 0.0, -GRAVITY_MSS)
        self.rate: Array | Sequence[float] = (0.0, 0.0, 0.0)
        self.height: float | None = 0.0
        self.field: Array | None = np.array([238.0, 0.0, -529.0]) if has_compass else None

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.said.append((self.now_ms, text.removeprefix("EKF3 IMU0 ")))

    @property
    def now_ms(self) -> int:
        """Time since boot."""
        return self.now_us // 1000

    def told(self) -> list[str]:
        """Return what was said since the last call."""
        texts = [text for _, text in self.said]
        self.said.clear()
        return texts

    def run_for(self, duration_s: float) -> None:
        """Run the main loop."""
        dt = 1e-6 * LOOP_US
        delta = InertialDelta(np.array(self.accel) * dt, np.array(self.rate) * dt, dt, dt)
        last_us, read_us = self.now_us + LOOP_US * round(duration_s / dt), -1
        for now_us in range(self.now_us + LOOP_US, last_us + 1, LOOP_US):
            self.now_us = now_us
            if now_us // 100_000 != read_us // 100_000:
                read_us = now_us // 100_000 * 100_000
                self.frame["baro"] = None if self.height is None else (read_us // 1000, self.height)
                self.frame["mag"] = None if self.field is None else (read_us, self.field)
                frame = Frame(now_us, delta, **self.frame)
            self.core.run(frame._replace(time_us=now_us))

    def stream(self, duration_s: float, *senders: Callable[[], object], period_s: float = 0.035) -> None:
        """Call senders again and again."""
        for _ in range(round(duration_s / period_s)):
            for send in senders:
                send()
            self.run_for(period_s)

    def pose(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, *, yaw: float = 0.0) -> None:
        """Hand in a pose with a stamp of now."""
        quat = Quaternion.from_euler(f32(0), f32(0), f32(yaw))
        self.core.ingest.write_pose(Vector3f(x, y, z), quat, (f32(0.2), f32(0.2)), self.now_ms, 10, 0)

    def speed(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """Hand in a velocity with a stamp of now."""
        self.core.ingest.write_velocity(Vector3f(x, y, z), f32(0.1), self.now_ms, 10)

    def flow(self, x: float = 0.0, y: float = 0.0) -> None:
        """Hand in a measurement of optical flow without turning."""
        self.core.write_flow(FlowMeasurement(80, (x, y), (0.0, 0.0)))

    def see_ranges(self, distance: float) -> None:
        """Let a range finder see a distance from now on; it stands 0.1 m above the ground and sees 40 m."""
        self.frame["ranges"] = RangeState(
            (FinderState((0.0, 0.0, 0.0), distance, DOWNWARD, RangeStatus.GOOD),), 0.1, 40.0
        )

    @property
    def flags(self) -> int:
        """The bits of nav_filter_status."""
        return self.core.control.flags
