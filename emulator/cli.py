# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``viso`` command: one row a command."""

import contextlib
import io
import os
import sys
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Final

import typer

from emulator.commands.bench import bench
from emulator.commands.demo import demo
from emulator.commands.doctor import doctor
from emulator.commands.ekf import ekf
from emulator.commands.faults import faults
from emulator.commands.landmarks import landmarks
from emulator.commands.play import play
from emulator.commands.replay import replay
from emulator.commands.report import report
from emulator.commands.serve import serve
from emulator.commands.vectors import vectors
from emulator.commands.vio import vio
from emulator.errors import InputError
from emulator.log_files import LogStoreError
from mav_handlers.links.base import LinkError

EXIT_USAGE: Final = 2

COMMANDS: Final[Mapping[str, Callable[..., Any]]] = {
    "demo": demo,
    "serve": serve,
    "replay": replay,
    "doctor": doctor,
    "vio": vio,
    "play": play,
    "landmarks": landmarks,
    "faults": faults,
    "report": report,
    "ekf": ekf,
    "vectors": vectors,
    "bench": bench,
}


def _discard_output() -> None:
    # What is left in the buffer would be tried again at exit. A stand-in for standard output has no descriptor.
    with contextlib.suppress(io.UnsupportedOperation):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _ending_with_its_reader(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a command end in peace when the reader of its output has gone, which is the reader's right."""

    @wraps(function)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            function(*args, **kwargs)
            sys.stdout.flush()
        except BrokenPipeError:
            _discard_output()

    return run


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
        app.command(name)(_ending_with_its_reader(function))
    return app


def main() -> None:
    """Run the command line: exit code 0 fine, 1 findings, 2 usage or unreadable input."""
    try:
        make_app()()
    except (InputError, LinkError, LogStoreError) as error:
        print(f"viso: {error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    except OSError as error:
        # Files and links give errors of their own; left is standard output, for instance on a full disk.
        _discard_output()
        print(f"viso: {error.strerror or error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
