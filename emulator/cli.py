# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``viso`` command: one row a command."""

import sys
from collections.abc import Callable, Mapping
from typing import Any, Final

import typer

from emulator.commands.demo import demo
from emulator.commands.replay import replay
from emulator.commands.serve import serve
from emulator.commands.vectors import vectors
from emulator.errors import InputError
from emulator.log_files import LogStoreError
from mav_handlers.links.base import LinkError

EXIT_USAGE: Final = 2

COMMANDS: Final[Mapping[str, Callable[..., Any]]] = {
    "demo": demo,
    "serve": serve,
    "replay": replay,
    "vectors": vectors,
}


def make_app() -> typer.Typer:
    """Return the command line with all its commands."""
    app = typer.Typer(
        name="viso",
        help="The autopilot's end of ArduPilot external navigation.",
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for name, function in COMMANDS.items():
        app.command(name)(function)
    return app


def main() -> None:
    """Run the command line: exit code 0 fine, 1 findings, 2 usage or unreadable input."""
    try:
        make_app()()
    except (InputError, LinkError, LogStoreError) as error:
        print(f"viso: {error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    except BrokenPipeError:
        # The reader of our output has gone, which is its right.
        sys.stderr.close()
        sys.exit(0)
