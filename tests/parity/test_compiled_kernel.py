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

from tests.parity.behaviours.logs import LOGS, Recordings, recordings_of_run
from viso.ekf_runs import targets as ekf_targets
from viso.ekf_runs.comparison import compare
from viso.ekf_runs.run import EkfReplay, EkfRun
from viso.vehicle.kernels import KERNEL_VARIABLE, NUMBA, PLAIN

pytestmark = pytest.mark.slow

WORST: Final = 1e-5
"""By how much an estimate may differ, in the unit of its field; what is logged in hundredths, by one of these."""

HUNDREDTH: Final = 0.0101


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    return recordings_of_run(tmp_path_factory)


def replayed(name: str, until_s: float, kernel: str, monkeypatch: pytest.MonkeyPatch) -> EkfReplay:
    monkeypatch.setenv(KERNEL_VARIABLE, kernel)
    path = LOGS / f"{name}.BIN.xz"
    run = EkfRun(path, until_s=min(until_s, ekf_targets.end_s(path)), core=0)
    run.run()
    replay = run.comparison()
    assert replay is not None
    return replay


def check_kernels_agree(plain: EkfReplay, compiled: EkfReplay) -> None:
    """Check that both kernels say the same over a log."""
    for label, values in plain.ours.items():
        difference = np.abs(
            (compiled.ours[label] - values + 180) % 360 - 180 if label == "Yaw" else compiled.ours[label] - values
        )
        assert difference.max() <= HUNDREDTH, label
        assert (difference > WORST).mean() < 0.01, label
    assert compiled.our_texts == plain.our_texts


@pytest.mark.parametrize("name", ["bench_no_yaw_source", "bench_odometry", "flight_mav_extyaw"])
def test_compiled_filter_says_what_the_plain_one_says(
    name: str, recordings: Recordings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KERNEL_VARIABLE, PLAIN)
    plain = recordings.replay(name)
    compiled = replayed(name, math.inf, NUMBA, monkeypatch)
    check_kernels_agree(plain, compiled)
    comparison = compare(compiled, bench=name.startswith(ekf_targets.BENCH_PREFIX))
    assert [dataclasses.asdict(check) for check in comparison.checks if not check.passed] == []


def test_compiled_filter_begins_as_the_plain_one(monkeypatch: pytest.MonkeyPatch) -> None:
    check_kernels_agree(*(replayed("bench_glitch_radius_0", 7.0, kernel, monkeypatch) for kernel in (PLAIN, NUMBA)))
