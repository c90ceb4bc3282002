# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter itself costs: cores at rest that are aided by external navigation 30 times per second."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Final

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.imus import Imus
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.params import EkfSources, Params
from ekf_stub.release import REFERENCE
from viso.parameters.ekf3 import FLOW_LIMIT_LATER
from viso.parameters.table import make_groups

LOOP_US: Final = 2500
FRAMES: Final = 4000
"""Of a round: ten seconds."""

_WARM_UP_FRAMES: Final = 12_000  # after which it is aided
_POSE_FRAMES: Final = 13


class FilterAtRest:
    """Some cores with equal data, which a camera tells that they stand still.

    Attributes:
        lanes: the cores.
    """

    def __init__(self, cores: int) -> None:
        table = ParamTable(make_groups(0, make_params()))
        for row in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW"):
            table.set(f"EK3_SRC1_{row}", 6)
        sources = EkfSources(lambda name: table.get_int(f"EK3_{name}"))
        params = Params()
        params.read(lambda name: table.get_number(f"EK3_{REFERENCE.flow_limit if name == FLOW_LIMIT_LATER else name}"))
        sizes = buffer_sizes(table.get_int, sources, has_camera=True, has_flow=False)
        imus = Imus(cores)
        for imu in imus.imus:
            imu.has_data = True
        numbers = list(range(cores))
        self.lanes = Lanes(params, sources, sizes, REFERENCE, imus, numbers, numbers, cores)
        delta = [0.0, 0.0, -GRAVITY_MSS * LOOP_US / 1e6, 0.0, 0.0, 0.0, LOOP_US / 1e6, LOOP_US / 1e6]
        self._delta = delta * cores
        self._frame = 0

    def run(self, frames: int) -> float:
        """Run for some frames; return the seconds of the processor that the filter took."""
        elapsed_s = 0.0
        for first in range(self._frame, self._frame + frames, _POSE_FRAMES):
            count = min(_POSE_FRAMES, self._frame + frames - first)
            rows: list[float] = []
            for frame in range(first + 1, first + count + 1):
                rows += [5e6 + frame * LOOP_US, 0.0, 0.0, *self._delta]
            begin_s, done = time.process_time(), 0
            while done < count:
                done = self.lanes.advance(rows, done, count)
            for core in self.lanes.cores:
                stamp_ms = self.lanes.now_us // 1000
                core.ext_nav.write_pose((0.0, 0.0, 0.0), 0.1, 0.0, 0.1, stamp_ms, 10, 0)
                core.ext_nav.write_velocity((0.0, 0.0, 0.0), 0.1, stamp_ms, 10)
                core.events.outcomes.clear()
            elapsed_s += time.process_time() - begin_s
            self.lanes.texts.clear()
        self._frame += frames
        return elapsed_s


def prepare(cores: int, _stack: ExitStack) -> Callable[[], float]:
    """A round is ten seconds of a filter that is being aided."""
    filter_ = FilterAtRest(cores)
    filter_.run(_WARM_UP_FRAMES)
    return lambda: filter_.run(FRAMES)
