# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What others write does nothing to a terminal."""

import io
import json
import logging
import sys
from contextlib import redirect_stdout

import pytest
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from viso.terminal import console
from viso.terminal.process import printable, printable_output

HOSTILE = "A\x1b[31m\x07\r\b\x9b2J\u202e\udcff\x7fZ"
SPELLED = r"A\x1b[31m\x07\r\x08\x9b2J\u202e\udcff\x7fZ"


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """Return what stands in for a terminal on standard output."""
    monkeypatch.setattr(console.out, "_force_terminal", True)
    monkeypatch.setattr(console.out, "_color_system", None)
    return io.StringIO()


@pytest.mark.parametrize(("text", "expected"), [("", ""), ("Höhe 3 µm\n\t— …", "Höhe 3 µm\n\t— …"), (HOSTILE, SPELLED)])
def test_what_does_not_show_is_spelled_out(text: str, expected: str) -> None:
    assert printable(text) == expected


def test_spelling_out_twice_is_spelling_out_once() -> None:
    assert printable(printable(HOSTILE)) == printable(HOSTILE)


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_whatever_a_command_prints_is_printable(capsys: pytest.CaptureFixture[str], stream: str) -> None:
    with printable_output():
        print(HOSTILE, file=getattr(sys, stream))
    assert getattr(capsys.readouterr(), stream[3:]) == f"{SPELLED}\n"


def test_warnings_of_the_program_are_printable(capsys: pytest.CaptureFixture[str]) -> None:
    assert logging.lastResort is not None
    with printable_output():
        logging.lastResort.emit(logging.makeLogRecord({"msg": HOSTILE}))
    assert capsys.readouterr().err == f"{SPELLED}\n"


@pytest.mark.parametrize("kind", [str, Text], ids=["text", "styled"])
def test_console_prints_texts_and_tables_printable(terminal: io.StringIO, kind: type[str] | type[Text]) -> None:
    # Rich itself leaves out some of the characters, which is as good.
    table = Table("a", title=HOSTILE)
    table.add_row(kind(HOSTILE))
    with redirect_stdout(terminal), printable_output():
        console.out.print(kind(HOSTILE), table)
    told = terminal.getvalue()
    assert r"\x1b[31m" in told
    assert all(char.isprintable() or char == "\n" for char in told)


def test_console_keeps_its_own_escapes_within_a_display_that_moves(terminal: io.StringIO) -> None:
    with redirect_stdout(terminal), printable_output(), Progress(console=console.out, auto_refresh=False) as bar:
        bar.add_task(HOSTILE, total=1)
        bar.refresh()
    told = terminal.getvalue()
    assert "\x1b[" in told
    assert r"\x1b[31m" in told
    assert "\x1b[31m" not in told


def test_json_has_escapes_of_its_own(terminal: io.StringIO) -> None:
    with redirect_stdout(terminal), printable_output():
        console.out.print_json(data={HOSTILE: "ä"})
    told = terminal.getvalue()
    assert told.isascii()
    assert json.loads(told) == {HOSTILE: "ä"}
