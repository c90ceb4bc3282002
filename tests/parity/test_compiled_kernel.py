# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled filter says over recorded logs what the plain one says, and meets the same targets.

``VISO_KERNEL=numba`` in the environment has all other tests of this folder run on it, too.
"""

import dataclasses
from typing import Final

import numpy as np
import pytest

from tests.parity.behaviours.logs import LOGS
from viso.ekf_runs import targets as ekf_targets
from viso.ekf_runs.comparison import compare
from viso.ekf_runs.run import EkfReplay, EkfRun
from viso.vehicle.kernels import KERNEL_VARIABLE, NUMBA, PLAIN

WORST: Final = 1e-5
"""By how much an estimate may differ, in the unit of its field; what is logged in hundredths, by one of these."""

HUNDREDTH: Final = 0.0101


def replayed(name: str, kernel: str, monkeypatch: pytest.MonkeyPatch) -> EkfReplay:
    monkeypatch.setenv(KERNEL_VARIABLE, kernel)
    path = LOGS / f"{name}.BIN.xz"
    run = EkfRun(path, until_s=ekf_targets.end_s(path))
    run.run()
    replay = run.comparison()
    assert replay is not None
    return replay


@pytest.mark.parametrize(
    "name",
    [
        "bench_no_yaw_source",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("bench_odometry", "flight_mav_extyaw")),
    ],
)
def test_compiled_filter_says_what_the_plain_one_says(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plain, compiled = (replayed(name, kernel, monkeypatch) for kernel in (PLAIN, NUMBA))
    for label, values in plain.ours.items():
        difference = np.abs(
            (compiled.ours[label] - values + 180) % 360 - 180 if label == "Yaw" else compiled.ours[label] - values
        )
        assert difference.max() <= HUNDREDTH, label
        assert (difference > WORST).mean() < 0.01, label
    assert compiled.our_texts == plain.our_texts
    comparison = compare(compiled, bench=name.startswith(ekf_targets.BENCH_PREFIX))
    assert [dataclasses.asdict(check) for check in comparison.checks if not check.passed] == []
