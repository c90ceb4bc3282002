# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter costs: in a pass of the main loop without a step, in a step, and in one that fuses a sample."""

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

import numpy as np

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.core.surroundings import Surroundings
from ekf_stub.inputs.ingest_rules import FUSED
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_texts import CoreTexts, NoTexts
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import odometry_at
from viso.sensors.options import ImuOptions
from viso.sensors.standing import BenchSource
from viso.vehicle.kernels import chosen_kernel, kernel_of
from viso.vehicle.vehicle import LOOP_PERIOD_US

WARM_UP_FRAMES: Final = 4000
FRAMES_A_ROUND: Final = 400
FRAMES_A_SAMPLE: Final = 13
NO_STEP: Final = "pass without a step"
STEP: Final = "step"
FUSING_STEP: Final = "step that fuses pose and velocity"
_DELAY_MS: Final = 10
_ERRORS: Final = (np.float32(0.2), np.float32(0.2))
_EXTNAV: Final = 6
_SOURCES: Final = {f"SRC1_{what}": _EXTNAV for what in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")}


class FilterAtRest:
    """A core, the sensors of a vehicle at rest, and a camera about 30 times a second."""

    def __init__(self) -> None:
        around = Surroundings()
        sources = EkfSources(lambda name: _SOURCES.get(name, 0), on_change=lambda _listener: None)
        self.counts: Counter[tuple[str, str]] = Counter()
        sizes = around.buffer_sizes(sources, has_camera=True)
        texts, kernel = CoreTexts(NoTexts(), (0,)), kernel_of(chosen_kernel())
        self._core = Ekf3Core(sources, around.ekf3_number, sizes, texts, self.counts, lambda: False, kernel)
        self._sensors = BenchSource(ImuOptions())
        self._frames = 0

    def run_frame(self, now_s: NowS) -> tuple[str, float]:
        """Run a frame of the filter; return which kind it was, and the seconds that it took."""
        self._frames += 1
        time_us = self._frames * LOOP_PERIOD_US
        sensors = self._sensors.sense(time_us)
        assert sensors is not None, "time goes on"
        frame = Frame(time_us, sensors.delta, baro=sensors.baro)
        horizon_ms, fused = self._core.ingest.horizon_ms, self._fused()
        begin_s = now_s()
        self._core.run(frame)
        elapsed_s = now_s() - begin_s
        if self._frames % FRAMES_A_SAMPLE == 0:
            self._hand_in(time_us)
        if self._core.ingest.horizon_ms == horizon_ms:
            return NO_STEP, elapsed_s
        return STEP if self._fused() == fused else FUSING_STEP, elapsed_s

    def _fused(self) -> int:
        return self.counts["pose", FUSED.code]

    def _hand_in(self, time_us: int) -> None:
        sample, ingest = odometry_at(time_us), self._core.ingest
        pos, vel = Vector3f(sample.x, sample.y, sample.z), Vector3f(sample.vx, sample.vy, sample.vz)
        ingest.write_pose(pos, Quaternion(), _ERRORS, time_us // 1000, _DELAY_MS, 0)
        ingest.write_velocity(vel, _ERRORS[0], time_us // 1000, _DELAY_MS)


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Start a filter and let it aid itself; a round is a second of it."""
    rig = FilterAtRest()
    for _ in range(WARM_UP_FRAMES):
        rig.run_frame(now_s)

    def run_round() -> Mapping[str, Part]:
        elapsed_s: dict[str, list[float]] = {}
        for _ in range(FRAMES_A_ROUND):
            kind, frame_s = rig.run_frame(now_s)
            elapsed_s.setdefault(kind, []).append(frame_s)
        return {kind: Part(sum(times_s), len(times_s)) for kind, times_s in sorted(elapsed_s.items())}

    yield run_round
