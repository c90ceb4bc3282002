# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The strategies by name, and the factory that builds the one that the configuration asks for, or none."""

import importlib
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, cast

from ap_core.plugins import with_plugins
from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.log import log_event
from viso.companion.vio.pipeline import StrategyBase, StrategyContext
from viso.companion.vio.types import CameraCalibration
from viso.extras import pip_install


@dataclass(frozen=True, slots=True)
class StrategyEntry:
    """A row of the registry.

    Attributes:
        loader: builds the strategy; raises ImportError, with one line of text, if it cannot.
        description: one line, for people.
        runs_programs: whether ``vio.engine.command`` names its program.
    """

    loader: Callable[[StrategyContext], StrategyBase]
    description: str
    runs_programs: bool = False


def _lazy(module: str, class_name: str, extra: str) -> Callable[[StrategyContext], StrategyBase]:
    """Return a loader that imports nothing before it is called, and names the extra of a missing library."""

    def load(context: StrategyContext) -> StrategyBase:
        try:
            strategy = getattr(importlib.import_module(f"viso.companion.strategies.{module}"), class_name)
        except ModuleNotFoundError as error:
            raise ImportError(f"{error}; {pip_install(extra)}") from error
        return cast(StrategyBase, strategy(context))

    return load


_ENGINE: Final = _lazy("engine", "EngineStrategy", extra="vio")
_STRATEGY_REGISTRY: Final[dict[str, StrategyEntry]] = {
    "klt_ransac": StrategyEntry(
        _lazy("klt_ransac", "KltRansac", extra="vio"),
        "tracked corners and an error-state filter with cloned poses; the baseline",
    ),
    "fixed_lag": StrategyEntry(
        _lazy("fixed_lag", "FixedLag", extra="vio,gtsam"),
        "tracked corners and an incremental fixed-lag smoother; needs the extras vio and gtsam",
    ),
    "okvis2": StrategyEntry(_ENGINE, "OKVIS2, whose program --engine names", runs_programs=True),
    "vins_mono": StrategyEntry(
        _ENGINE, "VINS-Mono, whose program --engine names; for comparison only", runs_programs=True
    ),
    "engine": StrategyEntry(_ENGINE, "any engine; --engine names its program", runs_programs=True),
}

STRATEGIES: Final = tuple(_STRATEGY_REGISTRY)


def all_strategies() -> Mapping[str, StrategyEntry]:
    """Return the strategies by their names, those of plug-ins too."""
    return with_plugins("viso.strategies", _STRATEGY_REGISTRY, StrategyEntry)


def build_vio_strategy(
    config: VioConfig,
    calibration: CameraCalibration,
    clock: Callable[[], int],
    logger: logging.Logger,
) -> StrategyBase:
    """Build the strategy that the configuration asks for; there is no other one to fall back to.

    Args:
        config: the configuration.
        calibration: of the camera.
        clock: the companion's monotonic clock in ns.
        logger: for events.

    Raises:
        ValueError: if there is none of that name.
        StrategyNotAvailableError: if it cannot be built, as where a library is missing.
    """
    name = config.strategy
    entry = _STRATEGY_REGISTRY.get(name) or all_strategies().get(name)
    if entry is None:
        raise ValueError(f"strategy {name!r} is none of {', '.join(all_strategies())}")
    try:
        strategy = entry.loader(StrategyContext(config, calibration, clock, logger))
    except ImportError as error:
        raise StrategyNotAvailableError(name, str(error)) from error
    msg = f"VIO ready: strategy={name}, calibration={calibration.camera_id}.{calibration.unit}"
    log_event(logger, logging.INFO, "vio_ready", msg, strategy=name)
    return strategy
