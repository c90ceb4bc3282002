# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter says what EKF3 said, given what EKF3 was given: in every record of every recorded log.

What is compared is what the firmware logged, most of it in hundredths, which it gets by cutting off the rest: there,
one hundredth is as near as can be. The targets of the project are wider, and met too.
"""

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import pytest

from tests.parity.behaviours.logs import LOGS, Recordings, recordings_of_run
from viso.ekf_runs import targets as ekf_targets
from viso.ekf_runs.comparison import compare
from viso.ekf_runs.events import compare_texts
from viso.ekf_runs.run import EkfReplay, replay_ekf
from viso.errors import InputError

Array = npt.NDArray[np.float64]

NAMES: Final = sorted(ekf_targets.log_name(path) for path in LOGS.glob("*.BIN.xz"))
LEFT_TO_THE_LONG_RUN: Final = {"flight_mav_extyaw", "flight_t265", "prearm", "t265", "voxl"}
"""The usual run has one like each of them; the others are replayed there anyway, to look for behaviours."""

SHORTEST: Final = "bench_no_yaw_source"
SAME_FRAME_S: Final = 0.03
WORST: Final = {
    **dict.fromkeys(("PN", "PE", "PD"), 0.011),
    **dict.fromkeys(("VN", "VE", "VD"), 0.005),
    **dict.fromkeys(("Roll", "Pitch", "Yaw"), 0.02),
    **dict.fromkeys(("SV", "SP", "SH"), 0.021),
    **dict.fromkeys(("OFN", "OFE"), 0.001),
}
"""In m, m/s and deg."""

INNOVATION_RMS: Final = 0.02


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    return recordings_of_run(tmp_path_factory)


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.slow if name in LEFT_TO_THE_LONG_RUN else ()) for name in NAMES]
)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def run(name: str, recordings: Recordings) -> EkfReplay:
    return recordings.replay(name)


def differences(run: EkfReplay, label: str) -> Array:
    difference = run.ours[label] - run.recorded[label]
    return (difference + 180) % 360 - 180 if label == "Yaw" else difference


def test_every_kind_of_recording_is_there() -> None:
    assert len(NAMES) == 15
    assert sum(name.startswith(ekf_targets.BENCH_PREFIX) for name in NAMES) == 8


def test_targets_are_met(name: str, run: EkfReplay) -> None:
    comparison = compare(run, bench=name.startswith(ekf_targets.BENCH_PREFIX))
    assert len(run.time_s) > 90
    assert [check for check in comparison.checks if not check.passed] == []


@pytest.mark.parametrize("label", WORST)
def test_estimates_are_the_firmwares(run: EkfReplay, label: str) -> None:
    assert np.abs(differences(run, label)).max() <= WORST[label]


@pytest.mark.parametrize("label", ["IPN", "IPE", "IPD", "IVN", "IVE", "IVD"])
def test_innovations_are_the_firmwares(run: EkfReplay, label: str) -> None:
    assert np.sqrt(np.mean(differences(run, label) ** 2)) <= INNOVATION_RMS


@pytest.mark.parametrize("label", ["TS", "SS"])
def test_timeouts_and_status_are_the_firmwares_in_every_record(run: EkfReplay, label: str) -> None:
    assert run.ours[label].tolist() == run.recorded[label].tolist()


def test_texts_are_the_firmwares_in_the_same_frames(run: EkfReplay) -> None:
    texts = compare_texts(run.our_texts, run.recorded_texts)
    assert texts.lines == ()
    assert texts.matched >= 2
    assert texts.worst_s <= SAME_FRAME_S


def test_same_log_gives_the_same_estimates(recordings: Recordings) -> None:
    first, again = recordings.replay(SHORTEST), replay_ekf(LOGS / f"{SHORTEST}.BIN.xz")
    assert all(np.array_equal(again.ours[label], first.ours[label]) for label in again.ours)
    assert again.our_texts == first.our_texts


def test_log_without_replay_records_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\A[^\n]*no\.BIN: [^\n]*\Z"):
        replay_ekf(tmp_path / "no.BIN")
