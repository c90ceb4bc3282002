# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of the scenes: what its rows say of figures that were given, not measured."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs OpenCV, of the extra vio")

from tests.acceptance import scenes
from tests.acceptance.trial import Claims
from tools import vio_table
from viso.companion.vio.config import VioConfig
from viso.companion.world.flight import SyntheticFlight
from viso.companion.world.texture import GroundTexture
from viso.geometry.errors import EvaluationError


class FakeTrial:
    """A flight in a scene, with figures of its own."""

    def __init__(self, error_m: float | None) -> None:
        self._error_m = error_m

    def absolute_error(self) -> Any:
        if self._error_m is None:
            raise EvaluationError("no poses")
        return SimpleNamespace(rmse_m=self._error_m)

    def truth(self) -> Any:
        return SimpleNamespace(path_length_m=300.0)

    def claims(self) -> Claims:
        return Claims(100, 2, 1.25, 0.5)


@pytest.mark.parametrize(("error_m", "shown"), [(0.25, "0.25 0.25 0.25"), (None, "none none none")])
def test_scenes_have_a_row_each_with_all_strategies(
    monkeypatch: pytest.MonkeyPatch, error_m: float | None, shown: str
) -> None:
    plans = [SimpleNamespace(name=name, what="any", fly=lambda *_: FakeTrial(error_m)) for name in "ab"]
    monkeypatch.setattr(vio_table, "SCENES", plans)
    cell = f"{shown} (300/6/1.2)"
    rows = [(name, "any", "300 m", cell, cell) for name in "ab"]
    assert list(vio_table.rows(["one", "other"], {})) == rows


def test_engine_flies_by_its_program(monkeypatch: pytest.MonkeyPatch) -> None:
    configs: list[VioConfig] = []
    monkeypatch.setattr(scenes, "run_trial", lambda told, config, start, truth: configs.append(config))
    black = np.zeros((8, 8), np.uint8)
    flight = SyntheticFlight(texture=GroundTexture(black, 1.0, black))
    scenes.ScenePlan("a", "any", lambda seed: flight).fly("okvis2", 0, "./okvis2_adapter")
    assert (configs[0].strategy, configs[0].engine.command) == ("okvis2", "./okvis2_adapter")


def test_engine_without_a_strategy_of_its_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        vio_table.main(["--engine", "nonesuch=./program"])
    assert "nonesuch" in capsys.readouterr().err


def test_strategies_that_cannot_be_built_are_left_out() -> None:
    assert "klt_ransac" in vio_table.strategies({})
    assert "okvis2" not in vio_table.strategies({})
