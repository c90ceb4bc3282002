# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter says what EKF3 said, given what EKF3 was given: six recorded logs, from the start of aiding to the end."""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from emulator.ekf_replay import EkfReplay, replay_ekf
from emulator.errors import InputError

Array = npt.NDArray[np.float64]

LOGS = Path(__file__).parent.parent / "data" / "logs"
# The second flight ends in a failsafe, after which the firmware changes cores.
UNTIL_S = {"flight_voxl_reset": 71.0}
NAMES = sorted(path.name.removesuffix(".BIN.xz") for path in LOGS.glob("*.BIN.xz"))
SETTLED_S = 0.5
AIDING = "is using external nav data"


@pytest.fixture(scope="module")
def replay() -> Callable[[str], EkfReplay]:
    @cache
    def run(name: str) -> EkfReplay:
        return replay_ekf(LOGS / f"{name}.BIN.xz", until_s=UNTIL_S.get(name, math.inf))

    return run


@pytest.fixture(params=NAMES)
def run(request: pytest.FixtureRequest, replay: Callable[[str], EkfReplay]) -> EkfReplay:
    return replay(request.param)


def aided(run: EkfReplay) -> npt.NDArray[np.bool_]:
    start_s = max(
        next(time_s for time_s, text in texts if text == AIDING) for texts in (run.our_texts, run.recorded_texts)
    )
    return run.time_s > start_s + SETTLED_S


def differences(run: EkfReplay, label: str) -> Array:
    difference = (run.ours[label] - run.recorded[label])[aided(run)]
    return (difference + 180) % 360 - 180 if label == "Yaw" else difference


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("label", ["PN", "PE"])
def test_horizontal_position_is_the_firmwares(run: EkfReplay, label: str) -> None:
    assert rms(differences(run, label)) < 0.02
    assert abs(differences(run, label)).max() < 0.12


def test_height_is_the_firmwares(run: EkfReplay) -> None:
    assert rms(differences(run, "PD")) < 0.03


@pytest.mark.parametrize("label", ["IVN", "IVE", "IVD"])
def test_velocity_innovations_are_the_firmwares(run: EkfReplay, label: str) -> None:
    assert rms(differences(run, label)) < 0.03


@pytest.mark.parametrize("label", ["VN", "VE", "VD"])
def test_velocity_is_the_firmwares(run: EkfReplay, label: str) -> None:
    assert rms(differences(run, label)) < 0.03


@pytest.mark.parametrize("label", ["Roll", "Pitch"])
def test_tilt_is_the_firmwares(run: EkfReplay, label: str) -> None:
    assert rms(differences(run, label)) < 0.1


@pytest.mark.parametrize("label", ["IPN", "IPE", "IPD"])
def test_position_innovations_are_the_firmwares(run: EkfReplay, label: str) -> None:
    assert rms(differences(run, label)) < 0.02


def test_timeouts_and_flags_are_the_firmwares(run: EkfReplay) -> None:
    same = np.logical_and(*(run.ours[label] == run.recorded[label] for label in ("TS", "SS")))[aided(run)]
    assert same.mean() > 0.98


def test_texts_are_the_firmwares_in_the_same_frames(run: EkfReplay) -> None:
    def without_numbers(texts: list[tuple[float, str]]) -> list[tuple[float, str]]:
        return [(time_s, text.split(" = ")[0]) for time_s, text in texts]

    assert without_numbers(run.our_texts) == without_numbers(run.recorded_texts)


def test_same_log_gives_the_same_estimates(replay: Callable[[str], EkfReplay]) -> None:
    again = replay_ekf(LOGS / "voxl.BIN.xz")
    assert all(np.array_equal(again.ours[label], replay("voxl").ours[label]) for label in again.ours)


def test_log_without_replay_records_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\A[^\n]*no\.BIN: [^\n]*\Z"):
        replay_ekf(tmp_path / "no.BIN")
