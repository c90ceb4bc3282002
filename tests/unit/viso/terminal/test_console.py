# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables and rows of verdicts."""

import io

import pytest
from rich.console import Console

from ap_core.verdict import VerdictKind
from mav_handlers.verdicts import ALL_VERDICTS as VERDICTS
from viso.terminal import console
from viso.terminal.console import VerdictCounts, progress, reason_of, verdict_rows, verdict_table

COUNTS: VerdictCounts = {
    ("ODOMETRY", VerdictKind.IGNORED, "quality_below_min"): 3,
    ("HEARTBEAT", VerdictKind.HANDLED, "handled"): 2,
    ("BAD_DATA", VerdictKind.DROPPED, "bad_crc"): 17,
    ("ODOMETRY", VerdictKind.ACCEPTED, "consumed"): 5,
}


def rendered(counts: VerdictCounts) -> str:
    console = Console(file=io.StringIO(), width=140)
    console.print(verdict_table(counts))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_every_verdict_has_its_sentence() -> None:
    assert all(reason_of(verdict.rule.code) == verdict.rule.text for verdict in VERDICTS)


def test_codes_stand_for_one_rule_each() -> None:
    rules = {verdict.rule.code: verdict.rule for verdict in VERDICTS}
    assert all(rules[verdict.rule.code] == verdict.rule for verdict in VERDICTS)


def test_rows_are_sorted_and_say_why() -> None:
    rows = verdict_rows(COUNTS)
    assert [(row["message"], row["outcome"], row["count"]) for row in rows] == [
        ("BAD_DATA", "dropped", 17),
        ("HEARTBEAT", "handled", 2),
        ("ODOMETRY", "accepted", 5),
        ("ODOMETRY", "ignored", 3),
    ]
    assert all(row["reason"] == reason_of(str(row["rule"])) for row in rows)


def test_table_counts_bad_data_in_bytes() -> None:
    assert "17 bytes" in rendered(COUNTS)


def test_table_gives_the_reason() -> None:
    assert reason_of("quality_below_min") in rendered(COUNTS)


def test_empty_table_is_a_table() -> None:
    assert "Outcome of each message" in rendered({})


@pytest.mark.parametrize("is_terminal", [True, False])
def test_progress_is_shown_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch, is_terminal: bool) -> None:
    file = io.StringIO()
    monkeypatch.setattr(console, "err", Console(file=file, force_terminal=is_terminal, width=80))
    with progress("replaying", 3) as show:
        show(3)
    assert ("replaying" in file.getvalue()) is is_terminal


@pytest.mark.parametrize("name", ["out", "err"])
def test_text_is_printed_as_it_is(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = "logs[plot]/:smile:/" + "x" * 200
    getattr(console, name).print(text)
    assert getattr(capsys.readouterr(), name) == text + "\n"


def test_reader_that_leaves_is_told_to_the_command_line() -> None:
    with pytest.raises(BrokenPipeError):
        console.out.on_broken_pipe()
