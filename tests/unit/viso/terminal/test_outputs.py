# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a command may write to: neither what it reads nor the same file twice, found before it does anything."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer

from viso.errors import InputError
from viso.files.outputs import replace_file
from viso.terminal.outputs import Output, keeping_inputs

Run = Callable[..., None]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Return a function that runs a command, which replaces what it is told to, in a folder with a file ``x``."""
    monkeypatch.chdir(tmp_path)
    Path("x").write_bytes(b"old")

    def work(
        inputs: Annotated[list[str] | None, typer.Argument(metavar="[INPUT]...")] = None,
        source: Annotated[str | None, typer.Option("-s", "--source")] = None,
        first: Annotated[Path | None, typer.Option("-1", "--first"), Output.FILE] = None,
        second: Annotated[Path | None, typer.Option(), Output.FILE] = None,
        folder: Annotated[Path, typer.Option(), Output.PLACE] = Path(),
        undeclared: Annotated[Path | None, typer.Option()] = None,
    ) -> None:
        for path in (first, second, undeclared):
            if path is not None:
                replace_file(path, b"new")

    app = typer.Typer()
    app.command()(work)
    command: Any = typer.main.get_command(app)
    command.callback = keeping_inputs(command, work)
    return lambda *args: command.main(args, standalone_mode=False)


def refusal(run: Run, *args: str) -> str:
    there = sorted(os.listdir())
    with pytest.raises(InputError) as refused:
        run(*args)
    assert Path("x").read_bytes() == b"old"
    assert sorted(os.listdir()) == there
    return str(refused.value)


def test_outputs_of_their_own_are_written(run: Run) -> None:
    run("x", "--first", "one", "--second", "two")
    assert [Path(name).read_bytes() for name in ("one", "two", "x")] == [b"new", b"new", b"old"]


def test_output_may_replace_what_is_not_read(run: Run) -> None:
    run("none", "--first", "x")
    assert Path("x").read_bytes() == b"new"


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (("y", "x", "--first", "x"), "--first x: the same file as INPUT x, which is read"),
        (("-s", "x", "-1", "./x"), "--first x: the same file as --source x, which is read"),
        (("-s", "log:x", "--second", "x"), "--second x: the same file as --source log:x, which is read"),
        (("x", "--folder", "x"), "--folder x: the same file as INPUT x, which is read"),
        (("x", "--first", "new", "--second", "x"), "--second x: the same file as INPUT x, which is read"),
    ],
)
def test_input_is_refused_by_both_names(run: Run, args: tuple[str, ...], line: str) -> None:
    assert refusal(run, *args) == line


@pytest.mark.parametrize("name", ["x", "new"])
def test_outputs_are_not_the_same(run: Run, name: str) -> None:
    assert refusal(run, "--first", name, "--second", f"./{name}") == f"--second {name}: the same file as --first"


def test_outputs_may_all_go_nowhere(run: Run) -> None:
    run("--first", os.devnull, "--second", os.devnull, "--folder", ".")


@pytest.mark.parametrize(
    ("place", "line"), [("none/y", "none/y: No such file or directory"), (".", ".: Is a directory")]
)
def test_place_that_cannot_be_is_told_before_anything_is_done(run: Run, place: str, line: str) -> None:
    assert refusal(run, "--first", "new", "--second", place) == line


def test_output_that_nobody_has_declared_replaces_nothing(run: Run) -> None:
    assert refusal(run, "--undeclared", "x") == "x: the same file as --undeclared x, which is read"


def test_what_stands_in_standard_input_is_kept(run: Run) -> None:
    before = os.dup(0)
    with Path("x").open() as file:
        os.dup2(file.fileno(), 0)
    try:
        assert refusal(run, "-", "--first", "x") == "--first x: the same file as standard input, which is read"
    finally:
        os.dup2(before, 0)
        os.close(before)
