# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``--strategy`` and ``--engine``: which odometry, and the program that it runs."""

import dataclasses
from typing import Annotated

import typer

from viso.companion.vio.config import VioConfig
from viso.companion.vio.registry import all_strategies
from viso.errors import InputError

EngineOption = Annotated[
    str | None,
    typer.Option(help="Program of an engine, for okvis2, vins_mono or (without --strategy) any.", metavar="COMMAND"),
]


def with_engine(config: VioConfig, strategy: str | None, engine: str | None) -> VioConfig:
    """Return a configuration with what ``--strategy`` and ``--engine`` name; the latter alone means ``engine``.

    Raises InputError if there is no such strategy, or it runs no programs.
    """
    if strategy is not None and strategy not in (known := all_strategies()):
        raise InputError(f"strategy {strategy!r} is none of {', '.join(known)}")
    if engine is not None:
        runs_programs = {name for name, entry in all_strategies().items() if entry.runs_programs}
        strategy = strategy or (config.strategy if config.strategy in runs_programs else "engine")
        if strategy not in runs_programs:
            raise InputError(f"--engine: {strategy} is none of {', '.join(sorted(runs_programs))}")
        config = dataclasses.replace(config, engine=dataclasses.replace(config.engine, command=engine))
    return config if strategy is None else dataclasses.replace(config, strategy=strategy)
