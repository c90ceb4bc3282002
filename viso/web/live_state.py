# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pages are told: made from what the vehicle's thread has seen, without a clock or a socket.

Numbers that are not finite become null, for JSON has none.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from viso.fates.labels import Fate, fate_of, is_final, is_model
from viso.fates.watch import UNITS, SampleTest
from viso.web.desk import ACTIONS
from viso.web.events import (
    Answer,
    Seen,
    SeenBoot,
    SeenMessage,
    SeenParams,
    SeenRecord,
    SeenSample,
    SeenText,
    VehicleState,
)
from viso.web.faults import SWITCHES
from viso.web.params import row_of, shown
from viso.web.rates import Rates
from viso.web.runs import RunKey, Runs

POINTS_KEPT: Final = 1200
"""Of paths and of curves; two minutes of ten a second."""
TEXTS_KEPT: Final = 200
PRE_ARM: Final = ("PreArm: ", "Arm: ")
FILTER: Final = "filter"


@dataclass(slots=True)
class _Innovation:
    """The worst innovation of a kind since the last batch."""

    ratio: float = 0.0
    value: float = 0.0
    tested: int = 0
    rejected: int = 0

    def add(self, value: float, ratio: float, *, is_rejected: bool) -> None:
        self.tested += 1
        self.rejected += is_rejected
        if ratio >= self.ratio:
            self.ratio, self.value = ratio, value

    def as_dict(self) -> dict[str, Any]:
        gate = self.value / self.ratio if self.ratio > 0 else math.nan
        return {
            "ratio": finite(self.ratio),
            "value": finite(self.value),
            "gate": finite(gate),
            "tested": self.tested,
            "rejected": self.rejected,
        }


def finite(number: Any, digits: int = 4) -> float | None:
    """Return a number for JSON, rounded; None for one that is not finite."""
    value = float(number)
    return round(value, digits) if math.isfinite(value) else None


class LiveState:
    """Holds what a page shows: takes what was seen, gives what has changed, and everything for a page that opens.

    Args:
        banner: what the vehicle claims to be, and where it listens.
        lost: returns how many things went unseen because there were too many.
    """

    def __init__(self, banner: str, lost: Callable[[], int] = lambda: 0) -> None:
        self._banner = banner
        self._lost = lost
        self._runs = Runs()
        self._rates = Rates()
        self._texts: deque[list[Any]] = deque(maxlen=TEXTS_KEPT)
        self._points: deque[dict[str, Any]] = deque(maxlen=POINTS_KEPT)
        self._state: dict[str, Any] = {}
        self._pre_arm: list[str] = []
        self._pre_arm_us = -1
        self._now_us = 0
        self._boots = 0
        self._params: dict[str, dict[str, Any]] = {}
        self._defaults: Mapping[str, float | None] = {}
        self._takers: Mapping[type[Seen], Callable[[Any], None]] = {
            SeenBoot: self._take_boot,
            SeenMessage: self._take_message,
            SeenSample: self._take_sample,
            SeenRecord: self._take_record,
            SeenText: self._take_text,
            SeenParams: self._take_params,
            VehicleState: self._take_state,
            Answer: self._take_answer,
        }
        self._answers: list[Answer] = []
        self._start_batch()

    def _start_batch(self) -> None:
        self._new_texts: list[list[Any]] = []
        self._changed_params: dict[str, Any] = {}
        self._has_new_table = False
        self._lags_ms: list[float] = []
        self._vision: dict[str, Any] | None = None
        self._innovations: dict[str, _Innovation] = {}

    def take(self, things: Iterable[Seen]) -> None:
        """Take what was seen, in order."""
        for thing in things:
            self._takers[type(thing)](thing)

    def _take_boot(self, boot: SeenBoot) -> None:
        self._boots += 1
        self._defaults = boot.defaults
        self._runs.close()
        self._rates.restart()
        self._points.clear()
        self._pre_arm, self._pre_arm_us = [], -1
        self._vision = None
        self._innovations = {}
        self._lags_ms = []
        self._now_us = 0
        if self._boots > 1:
            self._add_text(0, 6, "— restart —")

    def _take_message(self, seen: SeenMessage) -> None:
        event = seen.event
        header, rule = event.header, event.verdict.rule
        self._now_us = max(self._now_us, event.now_us)
        self._rates.take_message(event)
        sender = "" if header is None else f"{header.system_id}:{header.component_id}"
        key = RunKey(seen.link, event.name, sender, event.verdict.outcome.value, rule.code)
        self._runs.take(key, {"reason": rule.text, "source": rule.source, "model": False}, event.now_us)

    def _take_sample(self, seen: SeenSample) -> None:
        outcome = seen.outcome
        rule = outcome.rule
        self._rates.take_sample(SampleTest(seen.time_us, outcome, seen.innovation))
        if not is_final(rule):
            return
        fate = fate_of(rule)
        key = RunKey(FILTER, outcome.kind, "", fate.value, rule.code)
        about = {"reason": rule.text, "source": rule.source, "model": is_model(rule)}
        self._runs.take(key, about, seen.time_us)
        if seen.innovation is not None and outcome.ratio is not None:
            of_kind = self._innovations.setdefault(outcome.kind, _Innovation())
            of_kind.add(seen.innovation, outcome.ratio, is_rejected=fate is Fate.REJECTED)

    def _take_record(self, seen: SeenRecord) -> None:
        time_us, _, corrected_ms = (int(value) for value in seen.values[:3])
        self._lags_ms.append(time_us / 1e3 - corrected_ms)
        if seen.has_position:
            x, y, z = (finite(value, 3) for value in seen.values[3:6])
            self._vision = {"pos": None if None in (x, y, z) else [x, y, z], "ignored": bool(seen.values[-2])}

    def _take_text(self, seen: SeenText) -> None:
        self._add_text(seen.time_us, seen.severity, seen.text)
        if seen.text.startswith(PRE_ARM):
            if seen.time_us != self._pre_arm_us:
                self._pre_arm, self._pre_arm_us = [], seen.time_us
            self._pre_arm.append(seen.text.partition(": ")[2])

    def _add_text(self, time_us: int, severity: int, text: str) -> None:
        row = [time_us / 1e6, severity, text]
        self._texts.append(row)
        self._new_texts.append(row)

    def _take_params(self, seen: SeenParams) -> None:
        if [slot.name for slot, _ in seen.reading] != list(self._params):
            self._params = {slot.name: row_of(slot, value, self._defaults) for slot, value in seen.reading}
            self._has_new_table = True
            return
        for slot, raw in seen.reading:
            value, row = shown(raw), self._params[slot.name]
            if row["value"] != value:
                row["value"] = value
                self._changed_params[slot.name] = value

    def _take_state(self, seen: VehicleState) -> None:
        self._now_us = max(self._now_us, seen.time_us)
        pos = None if seen.pos_ned is None else [finite(part, 3) for part in seen.pos_ned]
        passed = seen.has_prearm_passed
        self._state = {
            "time_s": seen.time_us / 1e6,
            "mode": seen.mode,
            "armed": seen.is_armed,
            "prearm": passed,
            "failures": [] if passed else self._pre_arm,
            "failures_s": None if passed or self._pre_arm_us < 0 else self._pre_arm_us / 1e6,
            "camera": seen.camera,
            "aiding": seen.aiding,
            "source_set": seen.source_set,
            "ekf": None if pos is None or None in pos else pos,
            "yaw_deg": finite(math.degrees(seen.yaw_rad), 1),
            "faults": list(seen.faults),
        }

    def _take_answer(self, answer: Answer) -> None:
        self._answers.append(answer)

    def take_answers(self) -> list[Answer]:
        """Return, once, what became of requests."""
        answers, self._answers = self._answers, []
        return answers

    def batch(self) -> dict[str, Any]:
        """Return, once, what has changed since the last call."""
        point = self._point()
        self._points.append(point)
        batch = {
            "type": "batch",
            "boots": self._boots,
            "lost": self._lost(),
            "state": self._state,
            "runs": self._runs.take_changed(),
            "rates": self._rates.rows(self._now_us),
            "point": point,
            "texts": self._new_texts[-TEXTS_KEPT:],
            "params": self._changed_params,
            "table": list(self._params.values()) if self._has_new_table else None,
        }
        self._start_batch()
        return batch

    def _point(self) -> dict[str, Any]:
        """Return what curves and paths grow by."""
        lags_ms = sorted(self._lags_ms)
        return {
            "t": self._now_us / 1e6,
            "ekf": self._state.get("ekf"),
            "yaw_deg": self._state.get("yaw_deg"),
            "vision": self._vision,
            "lag": [round(lags_ms[len(lags_ms) // 2], 1), round(lags_ms[-1], 1)] if lags_ms else None,
            "innovations": {kind: one.as_dict() for kind, one in self._innovations.items()},
        }

    def snapshot(self) -> dict[str, Any]:
        """Return everything, for a page that opens after the last batch."""
        return {
            "type": "all",
            "banner": self._banner,
            "boots": self._boots,
            "lost": self._lost(),
            "state": self._state,
            "runs": self._runs.all(),
            "rates": self._rates.rows(self._now_us),
            "points": list(self._points),
            "texts": list(self._texts),
            "table": list(self._params.values()),
            "units": dict(UNITS),
            "actions": [
                {"name": action.name, "label": action.label, "about": action.about, "key": action.key}
                for action in ACTIONS
            ],
            "faults": [{"name": one.name, "label": one.label, "about": one.about} for one in SWITCHES],
        }
