# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``viso`` command: one row per subcommand; only the requested one is imported."""

import contextlib
import io
import os
import signal
import sys
from collections.abc import Callable, Mapping
from functools import wraps
from importlib import import_module
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from viso.terminal.process import printable_output

EXIT_USAGE: Final = 2
EXIT_TERMINATED: Final = 128 + signal.SIGTERM
HELP: Final = "The autopilot's end of ArduPilot external navigation."

COMMANDS: Final[Mapping[str, str]] = {
    "demo": "Fly a survey in virtual time, navigating by what a camera sees of the ground.",
    "serve": (
        "Run the autopilot: a vehicle that takes external navigation, estimates its state and answers as ArduCopter."
    ),
    "sitl": "Stand in for the firmware's simulator of ArduCopter: the same command line, ports, lines and parameters.",
    "replay": "Feed a recorded stream to the autopilot at its arrival times, and report the outcome of each message.",
    "doctor": "Report what the autopilot would do with a stream of external navigation, and what to change.",
    "explain": "Explain a text on the ground station, or a code of the doctor: cause, what to check, what to change.",
    "vio": (
        "Estimate a vehicle's position from pictures and inertial data, and send it to the autopilot if there is one."
    ),
    "engine": "Print the folder of viso_engine.hpp, the header for engines in C++ that viso vio --engine runs.",
    "play": "Play the trajectory that an odometry or a motion capture recorded, as a companion computer would send it.",
    "record": (
        "Play a scenario to a running autopilot and record what it does, in the formats that viso "
        "replay and doctor read."
    ),
    "landmarks": (
        "Compare landmarks and aircraft in pictures with their predicted places; report errors of heading and time."
    ),
    "faults": "Put faults into a stream: as a proxy between two links, or from a recorded stream into a file.",
    "report": "Report what a flight's log holds about external navigation, as a page with figures.",
    "ekf": "Run the filter over the replay records of a log (LOG_REPLAY), and compare it with the log's estimates.",
    "compare": "Play recordings of an autopilot through viso, and report which fields differ.",
    "vectors": "Recompute every output of recorded firmware behaviour with the port.",
    "sweep": (
        "Replay recorded streams many times with other parameters, faults, seeds or firmware, and report the best."
    ),
}
"""The commands, each with the first line of its help. ``viso.commands.NAME`` has the function NAME."""


def command_function(name: str) -> Callable[..., Any]:
    """Import a command and return its function."""
    function: Callable[..., Any] = getattr(import_module(f"viso.commands.{name}"), name)
    return function


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


def _not_imported() -> None:
    """Stand for a command that is listed, and not run."""


class _Commands(TyperGroup):
    """The commands: only the one that is run is imported."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the name, the imported command, and its arguments."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, None if name is None else load_command(name), rest


def load_command(name: str) -> Any:
    """Import a command and return it as click runs it."""
    from viso.terminal.outputs import keeping_inputs

    function = command_function(name)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name)(_ending_with_its_reader(function))
    command = typer.main.get_command(app)
    command.callback = keeping_inputs(command, function)
    return command


def _print_version(asked: bool) -> None:
    if asked:
        from ekf_stub.core import IS_COMPILED
        from viso.extras import installed_version

        print(f"viso {installed_version()} (filter: {'compiled' if IS_COMPILED else 'interpreted'})")
        raise typer.Exit


def _program(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Stand for the program itself, without a command."""


def make_app() -> typer.Typer:
    """Return the command line with all its commands."""
    app = typer.Typer(
        name="viso",
        cls=_Commands,
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback(help=HELP)(_program)
    for name, line in COMMANDS.items():
        app.command(name, help=line)(_not_imported)
    return app


def _reported() -> tuple[type[Exception], ...]:
    # Looked for once something has gone wrong, for links take time to import.
    from mav_handlers.links.base import LinkError
    from viso.errors import InputError
    from viso.logs.files import LogStoreError

    return InputError, LinkError, LogStoreError


@printable_output()
def main() -> None:
    """Run the command line: exit code 0 fine, 1 findings or losses, 2 usage or unreadable input."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(EXIT_TERMINATED))  # after drafts of outputs are removed
    try:
        make_app()()
    except OSError as error:
        # Files and links give errors of their own; left is standard output, for instance on a full disk.
        _discard_output()
        print(f"viso: {error.strerror or error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
    except Exception as error:
        if not isinstance(error, _reported()):
            raise
        print(f"viso: {error}", file=sys.stderr)
        sys.exit(EXIT_USAGE)
