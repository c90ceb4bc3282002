# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The growing table."""

import re
from io import StringIO

from rich.console import Console

from ap_core.verdict import VerdictKind
from mav_handlers.verdicts import NOT_ADDRESSED
from viso.terminal.console import VerdictCounts
from viso.terminal.live_report import REFRESH_US, LiveCounts

CODE = NOT_ADDRESSED.rule.code
LINE_UP_AND_CLEAR = "\x1b[1A\x1b[2K"


class Screen:
    """A terminal, or a file in its place, and counts that grow."""

    def __init__(self, *, terminal: bool) -> None:
        self._file = StringIO()
        self.console = Console(file=self._file, force_terminal=terminal, width=100, color_system=None)
        self.counts: dict[tuple[str, VerdictKind, str], int] = {}
        self.looks = 0

    def look(self) -> VerdictCounts:
        self.looks += 1
        return self.counts

    def count(self, number: int) -> None:
        self.counts["PING", VerdictKind.DROPPED, CODE] = number

    def shown(self) -> str:
        """Return what was written since the last call."""
        text = self._file.getvalue()
        self._file.seek(0)
        self._file.truncate()
        return text


def test_counts_are_shown_by_message_and_reason() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look) as live:
        screen.count(7)
        live.update(0)
        text = screen.shown()
    assert all(part in text for part in ("PING", "7", "dropped", NOT_ADDRESSED.rule.text))


def test_samples_in_the_filter_are_shown_below() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look, lambda: {("pose", "model_gate_position"): 31}) as live:
        screen.count(7)
        live.update(0)
        text = screen.shown()
    assert text.index("PING") < text.index("Outcome of each sample") < text.index("horizontal position gate")
    assert " 31 " in text


def test_counts_are_shown_anew_after_a_while_only() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look) as live:
        screen.count(7)
        live.update(1000)
        screen.shown()
        screen.count(8)
        live.update(1000 + REFRESH_US - 1)
        assert screen.shown() == ""
        live.update(1000 + REFRESH_US)
        assert " 8 " in screen.shown()


def test_clock_that_starts_again_is_no_reason_to_stop() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look) as live:
        screen.count(7)
        live.update(10 * REFRESH_US)
        screen.shown()
        live.update(0)
        assert " 7 " in screen.shown()


def test_nothing_is_shown_before_the_first_message() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look) as live:
        screen.shown()
        live.update(0)
        assert screen.shown() == ""


def test_table_is_gone_at_the_end() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look) as live:
        screen.count(7)
        live.update(0)
        lines = screen.shown().count("\n")
    after_the_last_line = screen.shown().rpartition("\n")[2]
    assert after_the_last_line.count(LINE_UP_AND_CLEAR) > lines
    assert re.sub(r"\x1b\[[?\d]*\w|\r", "", after_the_last_line) == ""


def test_no_terminal_no_table() -> None:
    screen = Screen(terminal=False)
    with LiveCounts(screen.console, screen.look) as live:
        screen.count(7)
        live.update(0)
    assert (screen.shown(), screen.looks) == ("", 0)


def test_table_may_be_switched_off() -> None:
    screen = Screen(terminal=True)
    with LiveCounts(screen.console, screen.look, wanted=False) as live:
        screen.count(7)
        live.update(0)
    assert (screen.shown(), screen.looks) == ("", 0)
