# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the strategies' accuracy on synthetic flights and on the EuRoC clip, as a table in Markdown.

The table goes to standard output, or with --page between the lines `<!-- measured: vio -->` and `<!-- end -->` of a
page. It takes some minutes. Without the clip (VISO_DATA, or ../shared/data) its rows say that it is absent.
"""

import argparse
import dataclasses
import functools
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np

from tools.measured_page import render, replace
from tools.trial import Trial, disturbed_start, run_trial
from viso.companion.trials.euroc import EurocError, EurocRecording, load_euroc
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.types import VioState
from viso.companion.world.flight import SyntheticFlight
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import nadir_survey
from viso.errors import InputError
from viso.terminal.console import progress

CLIP: Final = (
    Path(os.environ.get("VISO_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "euroc_mh01_clip"
)
HEAD: Final = ("", "data", "strategy", "target", "measured", "")
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
    still = poses.within(int(poses.t_ns[-1] - STILL_S * 1e9), int(poses.t_ns[-1]))
    return float(np.linalg.norm(still.positions_xyz - still.positions_xyz[0], axis=1).max())


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
    with progress("measuring", len(MEASURES)) as bar:
        for measure in MEASURES:
            yield measure()
            bar.advance(bar.task_ids[0])


def main(arguments: Sequence[str]) -> int:
    """Measure; return 2 when a file cannot be used."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, help="put the table there")
    options = parser.parse_args(arguments)
    try:
        if options.page is None:
            print(render(HEAD, rows()), end="")
            return 0
        page = options.page.read_text(encoding="utf-8")
        replace(page, "vio", "")  # before the long run
        options.page.write_text(replace(page, "vio", render(HEAD, rows())), encoding="utf-8")
    except (InputError, EurocError, OSError) as error:
        print(f"vio_table: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
