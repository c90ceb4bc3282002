# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the strategies' accuracy on synthetic flights and on the EuRoC clip, as a table in Markdown.

The table goes to standard output, or with --page between the lines `<!-- measured: vio -->` and `<!-- end -->` of a
page. It takes some minutes. Without the clip (VISO_DATA, or ../shared/data) its rows say that it is absent. With
--scenes it is that of the scenes instead (`vio-scenes`), for all strategies that are there, and for the engines whose
programs --engine names; --plot draws it.
"""

import argparse
import contextlib
import dataclasses
import functools
import logging
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np

from tools.measured_page import render, replace, where
from tools.trial import Claims, Trial, disturbed_start, run_trial
from tools.vio_scenes import SCENES, ScenePlan
from viso.companion.sources.base import SourceError
from viso.companion.sources.euroc import EurocRecording, load_euroc
from viso.companion.vio.config import AglSource, EngineConfig, Scene, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.registry import all_strategies, build_vio_strategy
from viso.companion.vio.types import VioState
from viso.companion.world.flight import SyntheticFlight, nadir_calibration
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import nadir_survey
from viso.errors import InputError
from viso.geometry.errors import EvaluationError
from viso.terminal.console import progress

CLIP: Final = (
    Path(os.environ.get("VISO_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "euroc_mh01_clip"
)
HEAD: Final = ("", "data", "strategy", "target", "measured", "")
SCENE_HEAD: Final = ("scene", "what", "path")
SCENE_SEEDS: Final = range(3)
SEEDS: Final = range(6)
WRONG_HEIGHT_SEEDS: Final = range(4)
CLIP_SEEDS: Final = range(5)
STILL_S: Final = 3.5
NADIR: Final = VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER)

Row = tuple[str, ...]
Measure = Callable[[], Row]


def _mark(is_met: bool) -> str:
    return "met" if is_met else "missed"


@functools.cache  # several rows look at the same ones
def nadir_trial(
    seed: int, speed_m_s: float = 8.0, height_m: float = 40.0, *, height_scale: float = 1.0, scale_sigma: float = 0.02
) -> Trial:
    """Return how the baseline did on a minute of a flight over generated ground, looking down."""
    flight = SyntheticFlight(
        seed=seed,
        trajectory=nadir_survey(speed_m_s, height_m, seed=seed),
        texture=generate_texture(),
        height_scale=height_scale,
    )
    config = dataclasses.replace(NADIR, agl_scale_sigma=scale_sigma)
    return run_trial(flight, config, flight.warm_start(), truth=flight.truth)


def clip_trial(recording: EurocRecording, strategy: str, seed: int) -> Trial:
    """Return how a strategy did on the EuRoC clip."""
    return run_trial(recording, VioConfig(strategy=strategy), disturbed_start(recording, seed), truth=recording.truth)


def still_drift_m(trial: Trial) -> float:
    """Return how far the estimate goes away from where it was, in the last seconds of a recording that ends at rest."""
    poses = trial.estimate()
    still = poses.within(int(poses.times_ns[-1] - STILL_S * 1e9), int(poses.times_ns[-1]))
    return float(np.linalg.norm(still.positions - still.positions[0], axis=1).max())


def _drift_and_nees() -> Row:
    trials = [nadir_trial(seed) for seed in SEEDS]
    drifts = [100 * trial.drift_share() for trial in trials]
    nees = [trial.horizontal_nees() for trial in trials]
    mean = float(np.mean(nees))  # the errors of one flight are much the same all the way
    measured = f"{min(drifts):.2f} to {max(drifts):.2f} %, NEES {mean:.2f} ({min(nees):.2f} to {max(nees):.2f})"
    met = max(drifts) <= 0.5 and 0.3 <= mean <= 3
    return ("A1", "8 m/s at 40 m, 6 seeds", "klt_ransac", "0.5 % of path; mean NEES/dof 0.3 to 3", measured, _mark(met))


def _relative_nees() -> Row:
    nees = [nadir_trial(seed).relative_nees() for seed in SEEDS]
    measured = f"{min(nees):.2f} to {max(nees):.2f}"
    met = min(nees) >= 0.3 and max(nees) <= 3
    return ("A8", "as A1, relative poses", "klt_ransac", "NEES/dof 0.3 to 3", measured, _mark(met))


def _faster_and_higher() -> Row:
    drifts = [100 * nadir_trial(0, *flight).drift_share() for flight in ((15.0, 100.0), (20.0, 150.0))]
    measured = " and ".join(f"{drift:.2f} %" for drift in drifts)
    data = "15 m/s at 100 m, 20 m/s at 150 m"
    return ("A2", data, "klt_ransac", "0.6 % of path", measured, _mark(max(drifts) <= 0.6))


def _wrong_height() -> Row:
    admitted, not_admitted = (_wrong_height_nees(sigma) for sigma in (0.03, 0.0))
    measured = f"{admitted:.2f}, without the term {not_admitted:.1f}"
    met = admitted <= 3 < not_admitted
    return ("A3", "height 3 % wrong, 4 seeds", "klt_ransac", "mean NEES/dof 3", measured, _mark(met))


def _wrong_height_nees(scale_sigma: float) -> float:
    trials = [nadir_trial(seed, height_scale=1.03, scale_sigma=scale_sigma) for seed in WRONG_HEIGHT_SEEDS]
    return float(np.mean([trial.horizontal_nees() for trial in trials]))


def _on_the_clip(strategy: str, target_m: float) -> Row:
    head = ("A4, A5", "EuRoC MH_01, 5 to 24 s, 5 seeds", strategy)
    target = f"median ATE {target_m} m, still end 0.05 m"
    if not CLIP.is_dir():
        return (*head, target, "the clip is absent", "")
    recording = load_euroc(CLIP)
    try:
        trials = [clip_trial(recording, strategy, seed) for seed in CLIP_SEEDS]
    except StrategyNotAvailableError as error:
        return (*head, target, str(error), "")
    errors = [trial.absolute_error().rmse_m for trial in trials]
    drift = max(still_drift_m(trial) for trial in trials)
    left = [set(trial.states()) - {VioState.INIT, VioState.TRACKING} for trial in trials]
    honest = all(error <= 0.15 or states for error, states in zip(errors, left, strict=True))
    measured = f"{median(errors):.4f} m, worst {max(errors):.4f} m; {drift:.3f} m"
    return (*head, target, measured, _mark(median(errors) <= target_m and drift < 0.05 and honest))


MEASURES: Final[Sequence[Measure]] = (
    _drift_and_nees,
    _faster_and_higher,
    _wrong_height,
    lambda: _on_the_clip("klt_ransac", 0.05),
    lambda: _on_the_clip("fixed_lag", 0.02),
    _relative_nees,
)


def rows() -> Iterator[Row]:
    """Measure, a row each."""
    with progress("measuring", len(MEASURES)) as show:
        for number, measure in enumerate(MEASURES, 1):
            yield measure()
            show(number)


def strategies(commands: Mapping[str, str]) -> list[str]:
    """Return the names of the strategies that can be built here, with those whose programs the commands start."""
    names = []
    for name in all_strategies():
        config = VioConfig(strategy=name, engine=EngineConfig(commands.get(name, "")))
        with contextlib.suppress(StrategyNotAvailableError, ImportError):
            build_vio_strategy(config, nadir_calibration(), lambda: 0, logging.getLogger(__name__)).close()
            names.append(name)
    return names


@dataclasses.dataclass(frozen=True, slots=True)
class Scored:
    """How a strategy did in a scene.

    Attributes:
        errors_m: of the trajectory with each seed (ATE); NaN where there is none, for want of poses.
        claims: with each seed.
    """

    errors_m: tuple[float, ...]
    claims: tuple[Claims, ...]

    def cell(self) -> str:
        """Return it as text."""
        frames, refuted = (sum(getattr(claim, name) for claim in self.claims) for name in ("frames", "refuted"))
        errors = " ".join("none" if math.isnan(error) else f"{error:.3g}" for error in self.errors_m)
        return f"{errors} ({frames}/{refuted}/{max(claim.worst_m for claim in self.claims):.2g})"


def scored(scene: ScenePlan, strategy: str, command: str) -> tuple[Scored, float]:
    """Return how a strategy does in a scene, and the mean length of the path in m."""
    trials = [scene.fly(strategy, seed, command) for seed in SCENE_SEEDS]
    score = Scored(tuple(_error_m(trial) for trial in trials), tuple(trial.claims() for trial in trials))
    return score, float(np.mean([trial.truth().path_length_m for trial in trials]))


def _error_m(trial: Trial) -> float:
    with contextlib.suppress(EvaluationError):
        return trial.absolute_error().rmse_m
    return math.nan


def scene_rows(names: Sequence[str], commands: Mapping[str, str], plot: Path | None) -> Iterator[Row]:
    """Measure, a row for each scene; draw them at the end."""
    all_scores: dict[str, list[Scored]] = {}
    with progress("measuring", len(SCENES)) as show:
        for number, scene in enumerate(SCENES, 1):
            results = [scored(scene, name, commands.get(name, "")) for name in names]
            all_scores[scene.name] = [score for score, _ in results]
            path_m = results[0][1]
            yield (scene.name, scene.what, f"{path_m:.0f} m", *(score.cell() for score, _ in results))
            show(number)
    if plot is not None:
        draw(names, all_scores, plot)


def draw(names: Sequence[str], scores: Mapping[str, Sequence[Scored]], plot: Path) -> None:
    """Draw the errors of all scenes."""
    from matplotlib.figure import Figure

    figure = Figure((8, 4.2), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    for offset, name in zip(np.linspace(-0.15, 0.15, len(names)), names, strict=True):
        points = [
            (column + offset, error_m)
            for column, scored_ in enumerate(scores.values())
            for error_m in scored_[list(names).index(name)].errors_m
        ]
        axes.plot(*zip(*points, strict=True), "o", label=name, alpha=0.75)
    axes.set_yscale("log")
    axes.set_ylabel("error of the trajectory (ATE) in m")
    axes.set_xticks(range(len(scores)), list(scores), rotation=35, ha="right")
    axes.grid(axis="y", alpha=0.4)
    axes.legend()
    figure.savefig(plot)


def main(arguments: Sequence[str]) -> int:
    """Measure; return 2 when a file cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, help="put the table there")
    parser.add_argument("--scenes", action="store_true", help="measure the scenes")
    parser.add_argument("--plot", type=Path, help="draw the scenes there")
    parser.add_argument("--engine", action="append", default=[], metavar="NAME=COMMAND", help="an engine's program")
    options = parser.parse_args(arguments)
    commands = dict(engine.split("=", 1) for engine in options.engine if "=" in engine)
    if unknown := [engine for engine in options.engine if engine.split("=", 1)[0] not in all_strategies()]:
        parser.error(f"--engine: {unknown[0]} begins with the name of no strategy")
    name = "vio"
    head: Row = HEAD
    body = rows()
    if options.scenes:
        names = strategies(commands)
        name, head, body = "vio-scenes", (*SCENE_HEAD, *names), scene_rows(names, commands, options.plot)
    try:
        if options.page is None:
            print(render(head, body), end="")
            return 0
        page = options.page.read_text(encoding="utf-8")
        replace(page, name, "")  # before the long run
        options.page.write_text(replace(page, name, f"{render(head, body)}\n{where()}"), encoding="utf-8")
    except (InputError, SourceError, OSError) as error:
        print(f"vio_table: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
