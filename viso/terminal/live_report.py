# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle that is running says on the terminal, and who is told of each message and each sample."""

from collections.abc import Callable, Sequence

from rich.console import Console

from ap_core.verdict import Outcome
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs.ext_nav_ingest import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from viso.fates.labels import Fate, basis, fate_of, is_final, sentence
from viso.vehicle.vehicle import Vehicle

OnMessage = Callable[[str, MessageEvent], None]
OnOutcome = Callable[[int, FilterOutcome], None]


class LiveReport:
    """Prints texts as they come, and what becomes of messages and samples for the first time, if they are not used.

    Args:
        console: where to print.
        listeners: told of each message as well, with the name of its link.
        filter_listeners: told of what becomes of each sample in the filter, with the time in us since boot.
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
        vehicle.texts.on_text.append(lambda severity, text: self._print(f"({severity}) {text}"))
        vehicle.endpoint.on_event = lambda event: self._event(vehicle.endpoint.channels[event.channel].name, event)
        if isinstance(vehicle.ahrs, Ekf3Ahrs):
            vehicle.ahrs.on_filter_outcome = lambda outcome: self._outcome(vehicle.clock.micros64(), outcome)

    def tell_link(self, link: str, news: str) -> None:
        """Print who comes and goes on a link, or what fails on it."""
        self._print(f"{link}: {news}")

    def _print(self, line: str) -> None:
        time_s = 0.0 if self._vehicle is None else self._vehicle.clock.micros64() / 1e6
        self._console.print(f"{time_s:9.3f} s  {line}")

    def _event(self, link: str, event: MessageEvent) -> None:
        for listener in self._listeners:
            listener(link, event)
        verdict = event.verdict
        key = (event.name, verdict.rule.code)
        if verdict.outcome in (Outcome.ACCEPTED, Outcome.HANDLED) or key in self._seen:
            return
        self._seen.add(key)
        self._print(f"first {event.name} {verdict.outcome}: {verdict.rule.text}")

    def _outcome(self, now_us: int, outcome: FilterOutcome) -> None:
        for listener in self._filter_listeners:
            listener(now_us, outcome)
        rule = outcome.rule
        key = (outcome.kind, rule.code)
        if not is_final(rule) or fate_of(rule) is Fate.FUSED or key in self._seen:
            return
        self._seen.add(key)
        self._print(f"filter: first {outcome.kind} {sentence(outcome)} ({basis(rule)})")
