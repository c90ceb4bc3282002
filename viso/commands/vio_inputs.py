# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The inputs of ``viso vio``; each error is one line."""

import logging
from pathlib import Path

from viso.companion.sources.base import Recording, SourceError, SourceOptions
from viso.companion.sources.camera import LiveCamera
from viso.companion.sources.kinds import open_source
from viso.companion.vio.config import ConfigError, VioConfig, load_config
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.registry import build_vio_strategy
from viso.errors import InputError, as_input_errors
from viso.geometry.frame_change import parse_rotation
from viso.geometry.rotation import Array
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import TrajectoryError
from viso.streams.readers import Source, load_trajectory
from viso.terminal.engine import with_engine


def rotation_of(text: str) -> Array:
    """Return the rotation matrix that ``--mounting`` gives."""
    try:
        return parse_rotation(text)
    except ValueError as error:
        raise InputError(f"--mounting: {error}") from error


def opened(options: SourceOptions, kind: str | None) -> Recording | LiveCamera:
    """Open a source."""
    with as_input_errors(SourceError):
        return open_source(options, kind)


def configured(
    source: Recording | LiveCamera, file: Path | None, strategy: str | None, engine: str | None = None
) -> VioConfig:
    """Return the configuration of the file, or else of the source, with the given overrides.

    Args:
        strategy: replaces the configuration's.
        engine: command that starts the engine's program.

    Raises InputError if the file is invalid, or the strategy is not available.
    """
    with as_input_errors(ConfigError):
        config = source.config if file is None else load_config(file)
    config = with_engine(config, strategy, engine)
    # Built once in advance, so that missing parts are reported before anything is opened.
    silent = logging.Logger("viso.trying", logging.CRITICAL + 1)
    with as_input_errors(ValueError, StrategyNotAvailableError):
        build_vio_strategy(config, source.calibration, lambda: 0, silent).close()
    return config


def known_truth(source: Recording | LiveCamera, file: Path | None) -> Trajectory | None:
    """Return the trajectory in a file, or the source's own."""
    if file is None:
        return source.poses if isinstance(source, Recording) else None
    with as_input_errors(TrajectoryError):
        return load_trajectory(Source(file))
