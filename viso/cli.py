# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``viso`` command: one row per subcommand; only the requested one is imported."""

import ast
import atexit
import contextlib
import gc
import io
import os
import signal
import sys
from collections.abc import Callable, Mapping
from functools import wraps
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from viso.terminal.long_lived import uncollected
from viso.terminal.printable import printable_output

EXIT_USAGE: Final = 2
EXIT_TERMINATED: Final = 128 + signal.SIGTERM
HELP: Final = "The autopilot's end of ArduPilot external navigation."

COMMANDS: Final[Mapping[str, str]] = {
    "demo": "viso.commands.demo",
    "serve": "viso.commands.serve",
    "replay": "viso.commands.replay",
    "doctor": "viso.commands.doctor",
    "vio": "viso.commands.vio",
    "engine": "viso.commands.engine",
    "play": "viso.commands.play",
    "record": "viso.commands.record",
    "landmarks": "viso.commands.landmarks",
    "faults": "viso.commands.faults",
    "report": "viso.commands.report",
    "ekf": "viso.commands.ekf",
    "compare": "viso.commands.compare",
    "vectors": "viso.commands.vectors",
    "sweep": "viso.commands.sweep",
}
"""The module of each command; the function in it has the name of the command."""


def command_function(name: str) -> Callable[..., Any]:
    """Import a command and return its function."""
    with uncollected():
        function: Callable[..., Any] = getattr(import_module(COMMANDS[name]), name)
    return function


def command_help(name: str) -> str:
    """Return the help of a command out of its source: to import them all for a list of them takes long."""
    spec = find_spec(COMMANDS[name])
    if spec is None or spec.origin is None:
        return ""
    body = ast.parse(Path(spec.origin).read_bytes()).body
    functions = (node for node in body if isinstance(node, ast.FunctionDef) and node.name == name)
    return next((ast.get_docstring(function) or "" for function in functions), "")


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
    """Stand for a command that nobody has asked for."""


class _Commands(TyperGroup):
    """The commands: known by name alone until one is run, or until they are listed."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the name, the command itself in place of what stands for it, and its arguments."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, None if name is None else _command(name), rest

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of the commands."""
        for name, command in self.commands.items():
            command.help = command_help(name)
        super().format_commands(ctx, formatter)


def _command(name: str) -> Any:
    from viso.terminal.outputs import keeping_inputs

    function = command_function(name)
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command(name)(_ending_with_its_reader(function))
    command = typer.main.get_command(app)
    command.callback = keeping_inputs(command, function)
    return command


def _tell_version(asked: bool) -> None:
    if asked:
        from ekf_stub.core import IS_COMPILED
        from viso.extras import installed_version

        print(f"viso {installed_version()} (filter: {'compiled' if IS_COMPILED else 'interpreted'})")
        raise typer.Exit


def _program(
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Print the version and exit.")
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
    for name in COMMANDS:
        app.command(name)(_not_imported)
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
    atexit.register(gc.freeze)  # at the end everything goes anyway; to look through it for cycles first takes long
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
