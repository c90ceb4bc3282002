# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how good the strategies are in the scenes, as a table in Markdown on standard output.

All strategies that are there fly, and the engines whose programs --engine names. It takes some minutes.
"""

import argparse
import contextlib
import logging
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from tests.acceptance.scenes import SCENES
from tests.acceptance.trial import Trial
from tools.measured import render, where
from viso.companion.vio.config import EngineConfig, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.registry import all_strategies, build_vio_strategy
from viso.companion.world.flight import nadir_calibration
from viso.geometry.errors import EvaluationError
from viso.terminal.console import progress

HEAD: Final = ("scene", "what", "path")
SEEDS: Final = range(3)


def strategies(commands: Mapping[str, str]) -> list[str]:
    """Return the names of the strategies that can be built here, with those whose programs the commands start."""
    names = []
    for name in all_strategies():
        config = VioConfig(strategy=name, engine=EngineConfig(commands.get(name, "")))
        with contextlib.suppress(StrategyNotAvailableError, ImportError):
            build_vio_strategy(config, nadir_calibration(), lambda: 0, logging.getLogger(__name__)).close()
            names.append(name)
    return names


def cell(trials: Sequence[Trial]) -> str:
    """Return how a strategy did in a scene: the error with each seed, and what it claimed over all of them."""
    claims = [trial.claims() for trial in trials]
    frames, refuted = sum(claim.frames for claim in claims), sum(claim.refuted for claim in claims)
    errors = " ".join(map(_error, trials))
    return f"{errors} ({frames}/{refuted}/{max(claim.worst_m for claim in claims):.2g})"


def _error(trial: Trial) -> str:
    """Return the error of the trajectory in m (ATE), or that there is none for want of poses."""
    with contextlib.suppress(EvaluationError):
        return f"{trial.absolute_error().rmse_m:.3g}"
    return "none"


def rows(names: Sequence[str], commands: Mapping[str, str]) -> Iterator[tuple[str, ...]]:
    """Measure, a row for each scene."""
    with progress("measuring", len(SCENES)) as show:
        for number, scene in enumerate(SCENES, 1):
            trials = [[scene.fly(name, seed, commands.get(name, "")) for seed in SEEDS] for name in names]
            path_m = np.mean([trial.truth().path_length_m for trial in trials[0]])
            yield scene.name, scene.what, f"{path_m:.0f} m", *map(cell, trials)
            show(number)


def main(arguments: Sequence[str]) -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", action="append", default=[], metavar="NAME=COMMAND", help="an engine's program")
    options = parser.parse_args(arguments)
    commands = dict(engine.partition("=")[::2] for engine in options.engine)
    if unknown := commands.keys() - set(all_strategies()):
        parser.error(f"--engine: no strategy is called {', '.join(unknown)}")
    names = strategies(commands)
    print(render((*HEAD, *names), rows(names, commands)), where(), sep="\n", end="")


if __name__ == "__main__":
    main(sys.argv[1:])
