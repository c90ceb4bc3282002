# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of the strategies' accuracy: what its rows say of figures that were given, not measured."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cv2", reason="needs OpenCV, of the extra vio")

from tools import vio_scenes, vio_table
from tools.trial import Claims
from viso.companion.sources.base import SourceError
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.types import VioState
from viso.companion.world.flight import SyntheticFlight
from viso.companion.world.texture import GroundTexture
from viso.geometry.errors import EvaluationError
from viso.geometry.trajectory import Trajectory

PAGE = "before\n<!-- measured: vio -->\nold\n<!-- end -->\nafter\n"
TRACKED = Counter({VioState.INIT: 2, VioState.TRACKING: 8})
S_NS = 1_000_000_000


def poses(*x_m: float) -> Trajectory:
    """Return poses along x, one a second."""
    positions = np.array([[x, 0.0, 0.0] for x in x_m])
    return Trajectory(np.arange(len(x_m)) * S_NS, positions, np.tile([1.0, 0.0, 0.0, 0.0], (len(x_m), 1)))


@dataclass
class FakeTrial:
    """A trial with given figures."""

    drift: float = 0.001
    horizontal: float = 1.0
    relative: float = 1.0
    error_m: float = 0.01
    was_degraded: bool = False
    still_m: float = 0.0

    def drift_share(self) -> float:
        return self.drift

    def horizontal_nees(self) -> float:
        return self.horizontal

    def relative_nees(self) -> float:
        return self.relative

    def states(self) -> Counter[VioState]:
        return TRACKED + Counter({VioState.DEGRADED: 1}) if self.was_degraded else TRACKED

    def absolute_error(self) -> SimpleNamespace:
        return SimpleNamespace(rmse_m=self.error_m)

    def estimate(self) -> Trajectory:
        return poses(0.0, 5.0, 9.0, 9.0, 9.0, 9.0 + self.still_m)


class Figures:
    """What the trials of a table have as their figures; a test changes them.

    Attributes:
        nadir: of the flight of a seed, where the height is right.
        wrong_height: of the flights where it is wrong, by the scale error that is admitted.
        fast: of the faster and higher flights.
        clip: of the run on the clip from each start, whatever the strategy.
        flown: arguments of the flights, in order.
    """

    def __init__(self) -> None:
        self.nadir = [FakeTrial() for _ in vio_table.SEEDS]
        self.wrong_height = {0.03: FakeTrial(horizontal=1.5), 0.0: FakeTrial(horizontal=30.0)}
        self.fast = {15.0: FakeTrial(drift=0.0008), 20.0: FakeTrial(drift=0.0024)}
        self.clip = [FakeTrial() for _ in vio_table.CLIP_SEEDS]
        self.flown: list[Any] = []

    def nadir_trial(
        self,
        seed: int,
        speed_m_s: float = 8.0,
        height_m: float = 40.0,
        *,
        height_scale: float = 1.0,
        scale_sigma: float = 0.02,
    ) -> FakeTrial:
        self.flown.append((seed, speed_m_s, height_m, height_scale))
        if height_scale != 1.0:
            return self.wrong_height[scale_sigma]
        return self.fast[speed_m_s] if speed_m_s != 8.0 else self.nadir[seed]

    def clip_trial(self, recording: object, strategy: str, seed: int) -> FakeTrial:
        self.flown.append((strategy, seed))
        return self.clip[seed]


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Figures:
    """Return the figures that take the place of all measuring."""
    figures = Figures()
    monkeypatch.setattr(vio_table, "nadir_trial", figures.nadir_trial)
    monkeypatch.setattr(vio_table, "clip_trial", figures.clip_trial)
    monkeypatch.setattr(vio_table, "load_euroc", lambda folder: None)
    monkeypatch.setattr(vio_table, "CLIP", tmp_path)
    return figures


def row(label: str, strategy: str = "klt_ransac") -> vio_table.Row:
    """Return the row of a requirement."""
    (found,) = (row for row in vio_table.rows() if label in row[0] and row[2] == strategy)
    return found


def test_table_has_a_row_for_each_requirement(figures: Figures) -> None:
    rows = list(vio_table.rows())
    assert [row[0] for row in rows] == ["A1", "A2", "A3", "A4, A5", "A4, A5", "A8"]
    assert {len(row) for row in rows} == {len(vio_table.HEAD)}
    assert {row[-1] for row in rows} == {"met"}


def test_row_shows_the_range_of_its_figures(figures: Figures) -> None:
    figures.nadir[1:3] = [FakeTrial(0.0025, 0.2, 0.6), FakeTrial(0.002, 2.8, 1.4)]
    assert row("A1")[4] == "0.10 to 0.25 %, NEES 1.17 (0.20 to 2.80)"
    assert row("A8")[4] == "0.60 to 1.40"
    assert row("A2")[4] == "0.08 % and 0.24 %"
    assert row("A3")[4] == "1.50, without the term 30.0"


def test_row_of_the_clip_shows_median_worst_and_drift(figures: Figures) -> None:
    figures.clip[2:4] = [FakeTrial(error_m=0.04, still_m=0.03), FakeTrial(error_m=0.012)]
    assert row("A4")[4] == "0.0100 m, worst 0.0400 m; 0.030 m"


@pytest.mark.parametrize(
    ("label", "bad"),
    [
        ("A1", FakeTrial(drift=0.0051)),
        ("A1", FakeTrial(horizontal=13.1)),  # of six: with the others a mean above 3
        ("A8", FakeTrial(relative=3.1)),
        ("A8", FakeTrial(relative=0.2)),
    ],
)
def test_one_bad_survey_is_a_target_missed(figures: Figures, label: str, bad: FakeTrial) -> None:
    figures.nadir[3] = bad
    assert row(label)[-1] == "missed"


def test_uncertainty_that_is_too_large_is_a_target_missed(figures: Figures) -> None:
    figures.nadir = [FakeTrial(horizontal=0.2) for _ in vio_table.SEEDS]
    assert row("A1")[-1] == "missed"


def test_one_lucky_survey_is_none(figures: Figures) -> None:
    figures.nadir[3] = FakeTrial(horizontal=0.1)
    assert row("A1")[-1] == "met"


def test_large_drift_of_a_fast_survey_is_a_target_missed(figures: Figures) -> None:
    figures.fast[20.0] = FakeTrial(drift=0.0061)
    assert row("A2")[-1] == "missed"


@pytest.mark.parametrize(("scale_sigma", "nees"), [(0.03, 3.1), (0.0, 2.9)])
def test_scale_error_must_show_only_where_it_is_not_admitted(figures: Figures, scale_sigma: float, nees: float) -> None:
    figures.wrong_height[scale_sigma] = FakeTrial(horizontal=nees)
    assert row("A3")[-1] == "missed"


@pytest.mark.parametrize(
    ("bad", "mark"),
    [
        (FakeTrial(error_m=0.16), "missed"),
        (FakeTrial(error_m=0.16, was_degraded=True), "met"),
        (FakeTrial(error_m=0.15), "met"),
        (FakeTrial(still_m=0.051), "missed"),
    ],
)
def test_one_bad_run_on_the_clip(figures: Figures, bad: FakeTrial, mark: str) -> None:
    figures.clip[4] = bad
    assert row("A4")[-1] == mark


def test_strategies_have_targets_of_their_own_on_the_clip(figures: Figures) -> None:
    figures.clip = [FakeTrial(error_m=0.03) for _ in vio_table.CLIP_SEEDS]
    assert (row("A4")[-1], row("A4", "fixed_lag")[-1]) == ("met", "missed")
    assert ("fixed_lag", 4) in figures.flown


def test_absent_clip_is_said(figures: Figures, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(vio_table, "CLIP", tmp_path / "nowhere")
    assert row("A4")[-2:] == ("the clip is absent", "")


def test_absent_strategy_is_said(figures: Figures, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(recording: object, strategy: str, seed: int) -> FakeTrial:
        if strategy == "fixed_lag":
            raise StrategyNotAvailableError(strategy, "no gtsam")
        return FakeTrial()

    monkeypatch.setattr(vio_table, "clip_trial", refuse)
    assert "no gtsam" in row("A4", "fixed_lag")[-2]
    assert (row("A4", "fixed_lag")[-1], row("A4")[-1]) == ("", "met")


def test_still_end_is_the_last_seconds() -> None:
    trial: Any = FakeTrial(still_m=0.25)  # before that it moves by metres
    assert vio_table.still_drift_m(trial) == pytest.approx(0.25)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[Any, VioConfig, Any]]]:
    """Return what is run, source, configuration and start, without running it."""
    calls: list[tuple[Any, VioConfig, Any]] = []
    monkeypatch.setattr(vio_table, "generate_texture", lambda: None)
    monkeypatch.setattr(vio_table, "run_trial", lambda *arguments, truth: calls.append(arguments))
    vio_table.nadir_trial.cache_clear()
    yield calls
    vio_table.nadir_trial.cache_clear()


def test_survey_is_flown_as_it_says(runs: list[tuple[Any, VioConfig, Any]]) -> None:
    vio_table.nadir_trial(3, 15.0, 100.0, height_scale=1.03, scale_sigma=0.03)
    ((flight, config, start),) = runs
    assert (flight.seed, flight.height_scale, flight.duration_s) == (3, 1.03, 60.0)
    assert flight.truth(0).t[2] == pytest.approx(100.0, rel=0.05)
    speeds_m_s = [np.linalg.norm(flight.truth_velocity_w(second * S_NS)) for second in range(60)]
    assert np.mean(speeds_m_s) == pytest.approx(15.0, rel=0.05)
    assert (config.scene, config.agl_source, config.agl_scale_sigma) == (Scene.PLANAR, AglSource.RANGEFINDER, 0.03)
    assert np.linalg.norm(start.body_T_world.inverse().t - flight.truth(0).t) < 0.5


def test_same_survey_is_flown_once(runs: list[tuple[Any, VioConfig, Any]]) -> None:
    for seed in (1, 2, 1):
        vio_table.nadir_trial(seed)
    assert [flight.seed for flight, _, _ in runs] == [1, 2]


def test_clip_is_followed_by_the_strategy_from_the_start(
    monkeypatch: pytest.MonkeyPatch, runs: list[tuple[Any, VioConfig, Any]]
) -> None:
    clip: Any = SimpleNamespace(truth=None)
    monkeypatch.setattr(vio_table, "disturbed_start", lambda recording, seed: f"start {seed}")
    vio_table.clip_trial(clip, "fixed_lag", 4)
    assert runs == [(clip, VioConfig(strategy="fixed_lag"), "start 4")]


def test_table_is_printed(figures: Figures, capsys: pytest.CaptureFixture[str]) -> None:
    assert vio_table.main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + len(vio_table.MEASURES)
    assert {line.count("|") for line in lines} == {len(vio_table.HEAD) + 1}


def test_table_goes_into_a_page(figures: Figures, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    assert vio_table.main(["--page", str(page)]) == 0
    assert page.read_text().count("| met |") == len(vio_table.MEASURES)
    assert re.search(r"^Measured at (\w{10}|none) on .*, \d+ cores\.$", page.read_text(), re.MULTILINE)
    assert "old" not in page.read_text()
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("page", ["nothing", None])
def test_page_is_looked_at_before_the_run(figures: Figures, tmp_path: Path, page: str | None) -> None:
    path = tmp_path / "page.md"
    if page is not None:
        path.write_text(page)
    assert vio_table.main(["--page", str(path)]) == 2
    assert figures.flown == []


def test_clip_that_cannot_be_read_is_one_line(
    figures: Figures, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(folder: Path) -> None:
        raise SourceError("imu0.csv: no records")

    monkeypatch.setattr(vio_table, "load_euroc", refuse)
    assert vio_table.main([]) == 2
    assert capsys.readouterr() == ("", "vio_table: imu0.csv: no records\n")


class FakeFlight:
    """A flight in a scene, with figures of its own."""

    def __init__(self, error_m: float | None = 0.25) -> None:
        self._error_m = error_m

    def absolute_error(self) -> Any:
        if self._error_m is None:
            raise EvaluationError("no poses")
        return SimpleNamespace(rmse_m=self._error_m)

    def truth(self) -> Trajectory:
        return poses(0.0, 300.0)

    def claims(self) -> Claims:
        return Claims(100, 2, 1.25, 0.5)


def scenes(*names: str, error_m: float | None = 0.25) -> list[Any]:
    """Return scenes in which all strategies do the same."""
    return [SimpleNamespace(name=name, what="any", fly=lambda *_: FakeFlight(error_m)) for name in names]


def test_scenes_have_a_row_each_with_all_strategies(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(vio_table, "SCENES", scenes("a", "b"))
    rows = list(vio_table.scene_rows(["one", "other"], {}, tmp_path / "scenes.png"))
    cell = "0.25 0.25 0.25 (300/6/1.2)"
    assert rows == [("a", "any", "300 m", cell, cell), ("b", "any", "300 m", cell, cell)]
    assert (tmp_path / "scenes.png").stat().st_size > 0


def test_strategy_without_poses_has_no_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(vio_table, "SCENES", scenes("a", error_m=None))
    (row,) = vio_table.scene_rows(["one"], {}, tmp_path / "scenes.png")
    assert row[-1].startswith("none none none (")


def test_engine_flies_by_its_program(monkeypatch: pytest.MonkeyPatch) -> None:
    configs: list[VioConfig] = []
    monkeypatch.setattr(vio_scenes, "run_trial", lambda told, config, start, truth: configs.append(config))
    black = np.zeros((8, 8), np.uint8)
    flight = SyntheticFlight(texture=GroundTexture(black, 1.0, black))
    vio_scenes.ScenePlan("a", "any", lambda seed: flight).fly("okvis2", 0, "./okvis2_adapter")
    assert (configs[0].strategy, configs[0].engine.command) == ("okvis2", "./okvis2_adapter")


def test_engine_without_a_strategy_of_its_name_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        vio_table.main(["--scenes", "--engine", "nonesuch=./program"])
    assert end.value.code == 2
    assert "nonesuch" in capsys.readouterr().err


def test_strategies_that_cannot_be_built_are_left_out() -> None:
    assert "klt_ransac" in vio_table.strategies({})
    assert "okvis2" not in vio_table.strategies({})
