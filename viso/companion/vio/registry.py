# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The strategies by name, and the factory that builds the one that the configuration asks for, or none."""

import importlib
import importlib.util
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, cast

from ap_core.plugins import with_plugins
from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.json_log import log_event
from viso.companion.vio.strategy import StrategyBase, StrategyContext
from viso.companion.vio.types import CameraCalibration
from viso.extras import pip_install


def read_flags() -> Mapping[str, bool]:
    """Return which strategies this build has; the environment has no say in that."""
    modules = {"FIXED_LAG": "gtsam", "OKVIS2": "viso_okvis2_native", "VINS_MONO": "viso_vins_mono_native"}
    is_there = {f"BUILD_{name}": importlib.util.find_spec(module) is not None for name, module in modules.items()}
    return MappingProxyType({"BUILD_KLT_RANSAC": True, **is_there})


FLAGS: Final = read_flags()
"""Hold for the whole run. A test that wants other flags makes its own and hands them to the factory."""


@dataclass(frozen=True, slots=True)
class StrategyEntry:
    """A strategy that can be asked for.

    Attributes:
        flag: of the build, that must be on; None for what is there in each, and for a plug-in.
        loader: imports the strategy's module and builds it; raises ImportError if that cannot be.
        description: one line, for people.
        runs_programs: whether ``vio.engine.command`` may name a program, for which no flag is asked.
    """

    flag: str | None
    loader: Callable[[StrategyContext], StrategyBase]
    description: str
    runs_programs: bool = False


def _lazy(module: str, class_name: str, extra: str) -> Callable[[StrategyContext], StrategyBase]:
    """Return a loader that imports nothing before it is called, and says which extra a missing library belongs to."""

    def load(context: StrategyContext) -> StrategyBase:
        try:
            strategy = getattr(importlib.import_module(f"viso.companion.strategies.{module}"), class_name)
        except ModuleNotFoundError as error:
            raise ImportError(f"{error}; {pip_install(extra)}") from error
        return cast(StrategyBase, strategy(context))

    return load


_STRATEGY_REGISTRY: Final[dict[str, StrategyEntry]] = {
    "klt_ransac": StrategyEntry(
        "BUILD_KLT_RANSAC",
        _lazy("klt_ransac", "KltRansac", extra="vio"),
        "tracked corners and an error-state filter with cloned poses; the baseline",
    ),
    "fixed_lag": StrategyEntry(
        "BUILD_FIXED_LAG",
        _lazy("fixed_lag", "FixedLag", extra="vio,gtsam"),
        "tracked corners and an incremental fixed-lag smoother; wants the extras vio and gtsam",
    ),
    "okvis2": StrategyEntry(
        "BUILD_OKVIS2",
        _lazy("engine", "Okvis2", extra="vio"),
        "OKVIS2, where its native module is installed or --engine names its program",
        runs_programs=True,
    ),
    "vins_mono": StrategyEntry(
        "BUILD_VINS_MONO",
        _lazy("engine", "VinsMono", extra="vio"),
        "VINS-Mono, where its native module is installed or --engine names its program; for comparison only",
        runs_programs=True,
    ),
    "engine": StrategyEntry(
        None,
        _lazy("engine", "EngineStrategy", extra="vio"),
        "any engine that is a program of its own, which --engine names",
        runs_programs=True,
    ),
}

STRATEGIES: Final = tuple(_STRATEGY_REGISTRY)


def all_strategies() -> Mapping[str, StrategyEntry]:
    """Return the strategies by their names, those of plug-ins too."""
    return with_plugins("viso.strategies", _STRATEGY_REGISTRY, StrategyEntry)


def describe(name: str) -> str:
    """Return what a strategy is, in one line."""
    return all_strategies()[name].description


def build_vio_strategy(
    config: VioConfig,
    calibration: CameraCalibration,
    clock: Callable[[], int],
    logger: logging.Logger,
    *,
    flags: Mapping[str, bool] = FLAGS,
) -> StrategyBase:
    """Build the strategy that the configuration asks for; there is no other one to fall back to.

    Args:
        config: the configuration.
        calibration: of the camera.
        clock: the companion's monotonic clock in ns.
        logger: for events.
        flags: of the build; for tests only.

    Raises:
        ValueError: if there is none of that name.
        StrategyNotAvailableError: if this build does not have it.
    """
    name = config.strategy
    entry = _STRATEGY_REGISTRY.get(name) or all_strategies().get(name)
    if entry is None:
        raise ValueError(f"strategy {name!r} is none of {', '.join(all_strategies())}")
    is_program = entry.runs_programs and config.engine.command
    if entry.flag is not None and not flags[entry.flag] and not is_program:
        raise StrategyNotAvailableError(name, f"flag {entry.flag} is off")
    try:
        strategy = entry.loader(StrategyContext(config, calibration, clock, logger))
    except ImportError as error:
        raise StrategyNotAvailableError(name, str(error)) from error
    msg = f"VIO ready: strategy={name}, calibration={calibration.camera_id}.{calibration.unit}"
    log_event(logger, logging.INFO, "vio_ready", msg, strategy=name)
    return strategy
