# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a running vehicle shows on the terminal: its texts, first outcomes as lines, and tables that grow."""

from collections.abc import Callable, Sequence
from typing import Final, Self

from rich.console import Console, Group
from rich.live import Live

from ap_core.verdict import VerdictKind
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from viso.terminal.console import VerdictCounts
from viso.terminal.filter_report import tables_of
from viso.vehicle.outcomes import FilterCounts, OutcomeKind, basis, is_final, outcome_kind, sentence
from viso.vehicle.vehicle import Vehicle

OnMessage = Callable[[str, MessageEvent], None]
OnOutcome = Callable[[int, FilterOutcome], None]

SETTLED_US: Final = 1_000_000
"""So long after tilt and yaw are aligned the filter uses all sources that it will use."""
_OF_STARTING: Final = frozenset(
    rule.code
    for rule in (
        rules.NOT_STARTED,
        rules.NOT_INITIALISED,
        rules.OVERWRITTEN,
        rules.SUPERSEDED,
        rules.TOO_OLD,
        rules.UNUSED,
        rules.RESET_TO,
        rules.ALIGNED_TO,
    )
)
_STARTING: Final = "filter: starting; until it is aligned, some 6 s after boot, it uses no sample"
_PATIENCE_US: Final = 10_000_000


class LiveReport:
    """Prints texts as they come, and what becomes of messages and samples for the first time, if they are not used.

    While the filter starts, the outcomes that every sample has then are one line. Listeners get the name of
    the link and each message, ``filter_listeners`` the time in us since boot and each outcome in the filter.
    """

    def __init__(
        self, console: Console, listeners: Sequence[OnMessage] = (), filter_listeners: Sequence[OnOutcome] = ()
    ) -> None:
        self._console = console
        self._listeners = tuple(listeners)
        self._filter_listeners = tuple(filter_listeners)
        self._vehicle: Vehicle | None = None
        self._seen: set[tuple[str, str]] = set()

    def watch(self, vehicle: Vehicle) -> None:
        """Report on a vehicle that is about to run, in place of the one before it."""
        if self._vehicle is not None:
            self._print("restart")
        self._vehicle = vehicle
        self._aligned_us: int | None = None
        self._has_printed_start = False
        vehicle.texts.on_text.append(lambda severity, text: self._print(f"({severity}) {text}"))
        vehicle.endpoint.on_event = lambda event: self.take(vehicle.endpoint.channels[event.channel].name, event)
        if isinstance(vehicle.ahrs, Ekf3Ahrs):
            vehicle.ahrs.on_filter_outcome = lambda outcome: self._outcome(vehicle.clock.micros64(), outcome)

    def print_link_news(self, link: str, news: str) -> None:
        """Print a line about a link: a client that comes or goes, or an error."""
        self._print(f"{link}: {news}")

    def _print(self, line: str) -> None:
        time_s = 0.0 if self._vehicle is None else self._vehicle.clock.micros64() / 1e6
        self._console.print(f"{time_s:9.3f} s  {line}")

    def take(self, link: str, event: MessageEvent) -> None:
        """Report the outcome of a message that came over a link."""
        for listener in self._listeners:
            listener(link, event)
        verdict = event.verdict
        key = (event.name, verdict.rule.code)
        if verdict.kind in (VerdictKind.ACCEPTED, VerdictKind.HANDLED) or key in self._seen:
            return
        self._seen.add(key)
        self._print(f"first {event.name} {verdict.kind}: {verdict.rule.text}")

    def _outcome(self, now_us: int, outcome: FilterOutcome) -> None:
        for listener in self._filter_listeners:
            listener(now_us, outcome)
        rule = outcome.rule
        key = (outcome.kind, rule.code)
        if rule.code in _OF_STARTING and self._is_starting(now_us):
            if not self._has_printed_start:
                self._has_printed_start = True
                self._print(_STARTING)
            return
        if not is_final(rule) or outcome_kind(rule) is OutcomeKind.FUSED or key in self._seen:
            return
        self._seen.add(key)
        self._print(f"filter: first {outcome.kind} {sentence(outcome)} ({basis(rule)})")

    def _is_starting(self, now_us: int) -> bool:
        """Return whether the filter is still to be aligned, or has just been; one that never is shows why in time."""
        ahrs = None if self._vehicle is None else self._vehicle.ahrs
        if self._aligned_us is None and isinstance(ahrs, Ekf3Ahrs) and ahrs.core is not None and ahrs.core.is_aligned:
            self._aligned_us = now_us
        end_us = _PATIENCE_US if self._aligned_us is None else self._aligned_us + SETTLED_US
        return now_us < min(end_us, _PATIENCE_US)


REFRESH_US: Final = 250_000


class LiveCounts:
    """Shows the counts of outcomes at the bottom of a terminal, updated now and then.

    It disappears at the end, when the closing table takes its place. Other lines stay above it.
    ``counts`` and ``filter_counts`` return the present counts, ``period_us`` is the least time between two updates, and
    ``wanted`` whether anything is shown.
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
        """Start to show the tables."""
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the tables."""
        if self._live is not None:
            self._live.stop()

    def update(self, now_us: int) -> None:
        """Show the counts again if the period has passed; a clock that has gone back has started again."""
        if self._live is None or (self._shown_us is not None and 0 <= now_us - self._shown_us < self._period_us):
            return
        self._shown_us = now_us
        counts = self._counts()
        if counts:
            self._live.update(Group(*tables_of(counts, self._filter_counts())), refresh=True)
