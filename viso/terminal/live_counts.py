# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of verdicts while they grow, at the bottom of a terminal."""

from collections.abc import Callable
from typing import Final, Self

from rich.console import Console, Group
from rich.live import Live

from viso.terminal.console import VerdictCounts
from viso.terminal.filter_report import tables_of
from viso.vehicle.outcomes.labels import FilterCounts

REFRESH_US: Final = 250_000


class LiveCounts:
    """Shows the outcome of messages and samples, updated now and then; nothing where there is no terminal.

    It is gone when it ends, for the closing table takes its place. What else is printed on the console stays above.
    ``counts`` and ``filter_counts`` return those of the moment, ``period_us`` is the least time between two looks by
    the clock that ``update`` is told, and what is not wanted is shown nowhere.
    """

    def __init__(
        self,
        console: Console,
        counts: Callable[[], VerdictCounts],
        filter_counts: Callable[[], FilterCounts] = dict,
        *,
        period_us: int = REFRESH_US,
        wanted: bool = True,
    ) -> None:
        self._counts = counts
        self._filter_counts = filter_counts
        self._period_us = period_us
        self._shown_us: int | None = None
        shown = wanted and console.is_terminal
        self._live = Live(console=console, auto_refresh=False, transient=True) if shown else None

    def __enter__(self) -> Self:
        """Take the bottom of the terminal."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Clear it."""
        if self._live is not None:
            self._live.stop()

    def update(self, now_us: int) -> None:
        """Show the counts again if it is time to; a clock that has gone back has started again."""
        if self._live is None or (self._shown_us is not None and 0 <= now_us - self._shown_us < self._period_us):
            return
        self._shown_us = now_us
        counts = self._counts()
        if counts:
            self._live.update(Group(*tables_of(counts, self._filter_counts())), refresh=True)
