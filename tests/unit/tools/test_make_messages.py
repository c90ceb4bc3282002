# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The classes of messages are written from pymavlink's definitions, and the written file is the one that is used."""

from types import SimpleNamespace
from typing import Any

import pytest

from mav_handlers.wire import messages
from tools.make_messages import MESSAGES, TARGET, definition, fields_of, main


def test_file_is_current(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--check"]) == 0
    assert capsys.readouterr().out == ""


def test_every_row_is_a_class() -> None:
    assert list(messages.MESSAGES) == list(MESSAGES)
    assert [cls.__doc__ for cls in messages.MESSAGES.values()] == list(MESSAGES.values())


def test_stale_file_is_found_and_written_again(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "messages.py"
    copy.write_text("")
    monkeypatch.setattr("tools.make_messages.TARGET", copy)
    assert main(["--check"]) == 1
    assert "stale, run .venv/bin/python tools/make_messages.py" in capsys.readouterr().out
    assert main([]) == 0
    assert copy.read_bytes() == TARGET.read_bytes()


def made(a: int, b: float, c: bytes, d: int, e: bytes = b"", f: float = 0) -> None:
    """Stand for a constructor of pymavlink's, whose parameters with defaults are extension fields."""


def test_fields_have_the_types_of_the_wire_and_extensions_are_zero() -> None:
    cls = SimpleNamespace(
        fieldnames=list("abcdef"),
        fieldtypes=["uint8_t", "double", "char", "int16_t", "char", "float"],
        ordered_fieldnames=list("bfdace"),
        array_lengths=[0, 3, 2, 0, 16, 9],
        __init__=made,
    )
    assert [line.strip() for line in fields_of(cls)] == [
        "a: int",
        "b: float",
        "c: str",
        "d: tuple[int, ...]",
        'e: str = ""',
        "f: tuple[float, ...] = (0.0,) * 3",
    ]


def test_drafts_are_found_in_their_dialect_and_nothing_else_anywhere() -> None:
    assert definition("AVAILABLE_MODES").id == 435
    with pytest.raises(KeyError):
        definition("NO_SUCH_MESSAGE")
