# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled filter says over recorded logs what the plain one says, and meets the same targets.

``VISO_KERNEL=numba`` in the environment has all other tests of this folder run on it, too.
"""

import dataclasses
import math
from typing import Final

import numpy as np
import pytest

from tests.parity.behaviours.logs import LOGS
from viso.ekf_runs import targets as ekf_targets
from viso.ekf_runs.comparison import compare
from viso.ekf_runs.run import EkfReplay, EkfRun
from viso.vehicle.kernels import KERNEL_VARIABLE, NUMBA, PLAIN

pytestmark = pytest.mark.slow

WORST: Final = 1e-5
"""By how much an estimate may differ, in the unit of its field; what is logged in hundredths, by one of these."""

HUNDREDTH: Final = 0.0101


def replayed(name: str, until_s: float, kernel: str, monkeypatch: pytest.MonkeyPatch) -> EkfReplay:
    monkeypatch.setenv(KERNEL_VARIABLE, kernel)
    path = LOGS / f"{name}.BIN.xz"
    run = EkfRun(path, until_s=min(until_s, ekf_targets.end_s(path)), core=0)
    run.run()
    replay = run.comparison()
    assert replay is not None
    return replay


def check_kernels_agree(name: str, until_s: float, monkeypatch: pytest.MonkeyPatch) -> EkfReplay:
    """Replay a log with both kernels, check that they say the same, and return what the compiled one says."""
    plain, compiled = (replayed(name, until_s, kernel, monkeypatch) for kernel in (PLAIN, NUMBA))
    for label, values in plain.ours.items():
        difference = np.abs(
            (compiled.ours[label] - values + 180) % 360 - 180 if label == "Yaw" else compiled.ours[label] - values
        )
        assert difference.max() <= HUNDREDTH, label
        assert (difference > WORST).mean() < 0.01, label
    assert compiled.our_texts == plain.our_texts
    return compiled


@pytest.mark.parametrize("name", ["bench_no_yaw_source", "bench_odometry", "flight_mav_extyaw"])
def test_compiled_filter_says_what_the_plain_one_says(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = check_kernels_agree(name, math.inf, monkeypatch)
    comparison = compare(compiled, bench=name.startswith(ekf_targets.BENCH_PREFIX))
    assert [dataclasses.asdict(check) for check in comparison.checks if not check.passed] == []


def test_compiled_filter_begins_as_the_plain_one(monkeypatch: pytest.MonkeyPatch) -> None:
    check_kernels_agree("bench_glitch_radius_0", 7.0, monkeypatch)
