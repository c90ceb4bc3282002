# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter says what EKF3 said, given what EKF3 was given: in every record of every recorded log.

What is compared is what the firmware logged, most of it in hundredths, which it gets by cutting off the rest: there,
one hundredth is as near as can be. The targets of the project are wider, and met too.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from tests.ekf_replay import replay_ekf
from tests.parity.behaviours.logs import Recordings, log_path, recordings_of_run
from tests.places import PARITY
from viso.compare.estimates import compare_estimates
from viso.compare.logs import estimate_differences
from viso.compare.tolerances import kind_of_log, log_name
from viso.errors import InputError
from viso.replay.ekf.run import EkfReplay

NAMES: Final = sorted(f"{path.parts[-3]}/{log_name(path)}" for path in PARITY.glob("*/logs/*.BIN.xz"))
"""All logs, each after the release that the filter is then of."""

SHORTEST: Final = "2025-07/bench_no_yaw_source"
"""The usual run takes this one whole."""

FLOW: Final = "2025-07/flow_take_off", 5.2
"""The usual run takes the beginning of this one as well, up to so many s since boot: it has flow and ranges."""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    return recordings_of_run(tmp_path_factory)


def check(run: EkfReplay) -> None:
    """Check that all that a filter says is what the firmware said."""
    assert list(estimate_differences(run)) == []
    assert len(run.recorded_texts) >= 2


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == SHORTEST else pytest.mark.slow) for name in NAMES]
)
def test_whole_log_is_the_firmwares(name: str, recordings: Recordings) -> None:
    run = recordings.replay(name)
    check(run)
    comparison = compare_estimates(run, kind_of_log(log_path(name)))
    assert len(run.time_s) > 90
    assert [target for target in comparison.checks if not target.passed] == []


def test_beginning_of_a_log_with_flow_is_the_firmwares() -> None:
    name, until_s = FLOW
    run = replay_ekf(log_path(name), until_s=until_s)
    assert run.time_s[-1] > until_s - 0.2
    check(run)


@pytest.mark.slow
def test_same_log_gives_the_same_estimates(recordings: Recordings) -> None:
    first, again = recordings.replay(SHORTEST).until(8.0), replay_ekf(log_path(SHORTEST), until_s=8.0)
    assert all(np.array_equal(again.ours[label], first.ours[label]) for label in again.ours)
    assert again.our_texts == first.our_texts


def test_log_without_replay_records_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\A[^\n]*no\.BIN: [^\n]*\Z"):
        replay_ekf(tmp_path / "no.BIN")


def changed(run: EkfReplay, label: str, by: float) -> EkfReplay:
    """Return a run in whose log one estimate, that in the middle, is another."""
    values = run.recorded[label].copy()
    values[len(values) // 2] += by
    return replace(run, recorded={**run.recorded, label: values})


@pytest.mark.parametrize(
    ("label", "by", "field"),
    [
        ("PN", 0.05, "XKF1[0].PN"),
        ("Yaw", 0.1, "XKF1[0].Yaw"),
        ("IVD", 1.0, "XKF3[0].IVD"),
        ("SS", 1, "XKF4[0].SS"),
        ("TS", math.nan, "XKF4[0].TS"),
    ],
)
def test_changed_estimate_is_a_difference(recordings: Recordings, label: str, by: float, field: str) -> None:
    [found] = estimate_differences(changed(recordings.replay(SHORTEST), label, by))
    assert found.field == field


def test_turn_of_the_yaw_is_none(recordings: Recordings) -> None:
    assert list(estimate_differences(changed(recordings.replay(SHORTEST), "Yaw", 360.0))) == []


def test_changed_late_and_missing_texts_are_differences(recordings: Recordings) -> None:
    run = recordings.replay(SHORTEST)
    (time_s, text), *others = run.recorded_texts
    for texts in ([(time_s, "other"), *others], [(time_s + 0.1, text), *others], others):
        assert {one.field for one in estimate_differences(replace(run, recorded_texts=texts))} == {"MSG of core 0"}
