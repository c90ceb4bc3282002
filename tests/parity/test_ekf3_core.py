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
SHORTEST: Final = "bench_no_yaw_source"
"""The usual run takes this one whole."""

PIECES: Final = {
    "bench_glitch_radius_0": 12.0,
    "bench_odometry": 22.0,
    "bench_pose_baro": 9.0,
    "bench_steps": 15.0,
    "bench_velocity_only": 13.0,
    "bench_vertical_velocity_100hz": 9.0,
    "dropout": 12.0,
    "flow_take_off": 5.2,
}
"""The beginnings of these, up to so many s since boot."""

USUAL_PIECES: Final = ("bench_odometry", "flow_take_off")

SAME_FRAME_S: Final = 0.03
WORST: Final = {
    **dict.fromkeys(("PN", "PE", "PD"), 0.011),
    **dict.fromkeys(("VN", "VE", "VD"), 0.005),
    **dict.fromkeys(("Roll", "Pitch", "Yaw"), 0.02),
    **dict.fromkeys(("SV", "SP", "SH"), 0.021),
    **dict.fromkeys(("OFN", "OFE"), 0.001),
}
"""In m, m/s and deg."""

INNOVATIONS: Final = ("IPN", "IPE", "IPD", "IVN", "IVE", "IVD")
INNOVATION_RMS: Final = 0.02


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    return recordings_of_run(tmp_path_factory)


def differences(run: EkfReplay, label: str) -> Array:
    difference = run.ours[label] - run.recorded[label]
    return (difference + 180) % 360 - 180 if label == "Yaw" else difference


def check(run: EkfReplay) -> None:
    """Check that all that a filter says is what the firmware said."""
    worst = {label: np.abs(differences(run, label)).max() for label in WORST}
    assert {label: value for label, value in worst.items() if value > WORST[label]} == {}
    rms = {label: np.sqrt(np.mean(differences(run, label) ** 2)) for label in INNOVATIONS}
    assert {label: value for label, value in rms.items() if value > INNOVATION_RMS} == {}
    for label in ("TS", "SS"):
        assert run.ours[label].tolist() == run.recorded[label].tolist(), label
    texts = compare_texts(run.our_texts, run.recorded_texts)
    assert texts.lines == ()
    assert texts.matched >= 2
    assert texts.worst_s <= SAME_FRAME_S


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == SHORTEST else pytest.mark.slow) for name in NAMES]
)
def test_whole_log_is_the_firmwares(name: str, recordings: Recordings) -> None:
    run = recordings.replay(name)
    check(run)
    comparison = compare(run, bench=name.startswith(ekf_targets.BENCH_PREFIX))
    assert len(run.time_s) > 90
    assert [target for target in comparison.checks if not target.passed] == []


@pytest.mark.parametrize(
    ("name", "until_s"),
    [
        pytest.param(name, until_s, marks=() if name in USUAL_PIECES else pytest.mark.slow)
        for name, until_s in PIECES.items()
    ],
)
def test_beginning_of_a_log_is_the_firmwares(name: str, until_s: float) -> None:
    run = replay_ekf(LOGS / f"{name}.BIN.xz", until_s=until_s)
    assert run.time_s[-1] > until_s - 0.2
    check(run)


@pytest.mark.slow
def test_same_log_gives_the_same_estimates(recordings: Recordings) -> None:
    first, again = recordings.replay(SHORTEST).until(8.0), replay_ekf(LOGS / f"{SHORTEST}.BIN.xz", until_s=8.0)
    assert all(np.array_equal(again.ours[label], first.ours[label]) for label in again.ours)
    assert again.our_texts == first.our_texts


def test_log_without_replay_records_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\A[^\n]*no\.BIN: [^\n]*\Z"):
        replay_ekf(tmp_path / "no.BIN")
