# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a native module is found, and what it says when it is not."""

import re
from pathlib import Path
from typing import NoReturn

import pytest

from tests.unit.viso.companion.strategies.fake_native import install
from tests.unit.viso.companion.vio.strategy_rig import make_calibration
from viso.companion.strategies.native import load_engine
from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import CameraCalibration

NAME = "viso_test_native"


def load(calibration: CameraCalibration | None = None) -> object:
    return load_engine(NAME, calibration or make_calibration(), VioConfig())


def refuse(kind: type[Exception]) -> NoReturn:
    raise kind("no licence file")


def test_module_makes_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    module = install(monkeypatch, NAME)
    assert [load()] == module.engines


def test_missing_module_is_wiring_absent() -> None:
    with pytest.raises(ImportError, match=r"^native wiring absent$"):
        load()


def test_module_that_lacks_something_says_what(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / f"{NAME}.py").write_text("import viso_test_lib\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ImportError, match=r"^No module named 'viso_test_lib'$"):
        load()


@pytest.mark.parametrize("kind", [RuntimeError, ValueError])
def test_module_that_makes_no_engine_says_why(monkeypatch: pytest.MonkeyPatch, kind: type[Exception]) -> None:
    install(monkeypatch, NAME).before = lambda: refuse(kind)
    with pytest.raises(ImportError, match=re.escape(f"{NAME}: no licence file")):
        load()
