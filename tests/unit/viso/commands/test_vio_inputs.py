# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an odometry is given on the command line."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.unit.viso.companion.vio.strategy_rig import make_calibration
from viso.commands.vio import configured, known_truth, opened, rotation_of
from viso.companion.sources.base import Recording, SourceOptions
from viso.companion.sources.camera import LiveCamera
from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import SensorEvent
from viso.errors import InputError
from viso.geometry.trajectory import Trajectory


def nothing() -> Iterator[SensorEvent]:
    yield from ()


RECORDING = Recording(make_calibration(), nothing, config=VioConfig(max_features=77))
CAMERA = LiveCamera("0", make_calibration(), None, VioConfig())


def test_source_brings_its_configuration() -> None:
    assert configured(RECORDING, None, None) == VioConfig(max_features=77)


def test_file_takes_its_place(tmp_path: Path) -> None:
    path = tmp_path / "vio.toml"
    path.write_text("[vio]\nmin_tracked = 20\n")
    assert configured(RECORDING, path, None) == VioConfig(min_tracked=20)


def test_bad_configuration_is_told(tmp_path: Path) -> None:
    path = tmp_path / "vio.toml"
    path.write_text("[vio]\nmin_trakced = 20\n")
    with pytest.raises(InputError, match=r"vio\.toml: vio\.min_trakced: unknown key"):
        configured(RECORDING, path, None)


def test_strategy_may_be_named() -> None:
    with pytest.raises(InputError, match="strategy vins_mono is not available: vio"):
        configured(RECORDING, None, "vins_mono")


def test_unknown_strategy_is_told_as_the_factory_does() -> None:
    with pytest.raises(InputError, match="strategy 'best' is none of klt_ransac, "):
        configured(RECORDING, None, "best")


def test_truth_is_the_source_s_or_a_file_s(tmp_path: Path) -> None:
    known = Trajectory(np.array([0]), np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]))
    path = tmp_path / "truth.tum"
    path.write_text("0 1 2 3 0 0 0 1\n1 2 3 4 0 0 0 1\n")
    source = dataclasses.replace(RECORDING, poses=known)
    assert known_truth(source, None) is known
    assert known_truth(CAMERA, None) is None
    read = known_truth(source, path)
    assert read is not None
    assert read.positions.tolist() == [[1, 2, 3], [2, 3, 4]]


def test_truth_that_is_none_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.tum: No such file or directory"):
        known_truth(RECORDING, tmp_path / "none.tum")


def test_source_that_cannot_be_used_is_told() -> None:
    with pytest.raises(InputError, match=r"none\.mp4: No such file or directory"):
        opened(SourceOptions("none.mp4"), None)


def test_rotation_that_is_none_is_told() -> None:
    np.testing.assert_allclose(rotation_of("0,0,180"), np.diag([-1, -1, 1]), atol=1e-12)
    with pytest.raises(InputError, match="--mounting: '1,2': 3, 4 or 9 numbers make a rotation, not 2"):
        rotation_of("1,2")
