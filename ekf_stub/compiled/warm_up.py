# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Has all functions compiled before the filter needs them, which on a machine's first run takes long.

numba keeps what it has compiled beside the source, or in the user's cache folder where that cannot be written.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from ekf_stub.compiled import compiled_kernel, compiled_pass_kernel
from ekf_stub.compiled.compiled_pass import CompiledPass
from ekf_stub.compiled.compiled_state import CompiledErrorState
from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.inertial import GRAVITY_MSS, InertialDelta, InertialStep, row_of
from ekf_stub.filter.process_model import ProcessNoise
from ekf_stub.filter.states import POS

_REST: Final = InertialDelta(np.array([0.0, 0.0, -0.0025 * GRAVITY_MSS]), np.zeros(3), 0.0025, 0.0025)
_STEP: Final = InertialStep(0, 5 * _REST.del_vel, np.zeros(3), 0.0125, 0.0125)
_NOISE: Final = ProcessNoise(0.015, 0.35, 0.001, 0.02)


def _parts() -> Sequence[Callable[[], object]]:
    """Return what calls all functions, one after the other."""
    passing, state = CompiledPass(), CompiledErrorState(quaternion.one, np.ones(6))
    passing.begin(state, 4)
    return (
        lambda: passing.sense(_REST),
        lambda: passing.sample(_REST, 0, scale=None),
        lambda: passing.advance(_REST, 0, state, scale=None, height_filter_hz=2.0),
        lambda: passing.advance_all(row_of(_REST)[np.newaxis], range(1), state, scale=1.0, height_filter_hz=2.0),
        lambda: passing.follow(_REST, state, delay_s=0.1, tau_s=0.25, height_filter_hz=2.0),
        lambda: state.predict(_STEP, _NOISE, 0.0125, aided=True, on_ground=True),
        lambda: state.update_states([(POS.start, 0.0, 1.0)]),
        lambda: state.fuse_spread(*state.spread_of_yaw(by_321=True), 0.0, 1.0),
    )


def _compiled() -> int:
    """Return how many functions had to be compiled so far."""
    functions = {**vars(compiled_kernel), **vars(compiled_pass_kernel)}.values()
    return sum(len(function.stats.cache_misses) for function in functions if hasattr(function, "stats"))


def warm_up(on_compiled: Callable[[int, int], None]) -> None:
    """Have all functions compiled, or loaded where that was done before.

    Args:
        on_compiled: hears after each part that had to be compiled how many of how many are ready.
    """
    parts = _parts()
    for number, part in enumerate(parts, 1):
        before = _compiled()
        part()
        if _compiled() != before:
            on_compiled(number, len(parts))
