# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pages show of a running vehicle, as JSON: made from its events, without a clock or a socket; and its parameters.

Numbers that are not finite become null, for JSON has none.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from ap_core.cint import i32
from ap_core.log_field import LogValue
from ap_core.param import ParamFlag, ParamTable
from ap_core.param_group import ParamSlot
from ap_core.param_info import ParamValue
from mav_handlers.endpoint import MessageEvent
from viso.vehicle.outcomes import UNITS, OutcomeKind, SampleTest, is_final, is_model, outcome_kind
from viso.web.diagnosis import RecentFrames
from viso.web.faults import SWITCHES
from viso.web.rates import Rates
from viso.web.requests import ACTIONS, Answer
from viso.web.runs import RUNS_KEPT, RunKey, Runs

Reading = tuple[tuple[ParamSlot, ParamValue], ...]
"""The parameters that are listed at a moment, in their order, each with its value."""


def read_params(params: ParamTable) -> Reading:
    """Return the parameters that are listed now; quick, for it is the vehicle's own thread that does it."""
    return tuple((slot, slot.raw) for group in params.groups for slot in group.listed_slots)


def defaults_of(params: ParamTable) -> dict[str, float | None]:
    """Return the defaults of all parameters by name; they do not change after boot."""
    names = (slot.name for group in params.groups for slot in group.slots)
    found = (params.find(name) for name in names)
    return {param.canonical_name: shown(param.default) for param in found if param is not None}


def shown(value: ParamValue) -> float | None:
    """Return the number with the fewest digits that rounds to what is stored; None for one that is not finite."""
    if isinstance(value, int):
        return value
    return float(str(value)) if math.isfinite(value) else None


def row_of(slot: ParamSlot, value: ParamValue, defaults: Mapping[str, float | None]) -> dict[str, Any]:
    """Return a parameter as JSON has it."""
    info = slot.row
    return {
        "name": slot.name,
        "value": shown(value),
        "default": defaults.get(slot.name),
        "unit": info.unit,
        "about": info.description,
        "range": info.range,
        "values": [[number, text] for number, text in info.values.items()],
        "reboot": info.reboot_required,
        "read_only": ParamFlag.READ_ONLY in info.flags,
    }


POINTS_KEPT: Final = 1200
"""Of paths and of curves; two minutes of ten per second."""
TEXTS_KEPT: Final = 200
PRE_ARM: Final = ("PreArm: ", "Arm: ")
FILTER: Final = "filter"

StateUpdate = Callable[["LiveState"], None]
"""An event of the vehicle: made on the thread of the vehicle, and applied to the state on the thread of the pages."""


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
    """The state that pages show: it applies updates, and returns what has changed, or everything for a page that opens.

    Args:
        banner: what the vehicle claims to be, and where it listens.
        lost: returns how many updates were lost because there were too many.
        keeps_all: whether old points, texts and verdicts are kept, as a recording wants them.
    """

    def __init__(self, banner: str, lost: Callable[[], int] = lambda: 0, *, keeps_all: bool = False) -> None:
        self._banner = banner
        self._lost = lost
        self._runs = Runs(None if keeps_all else RUNS_KEPT)
        self._rates = Rates()
        self._recent = RecentFrames()
        self._firmware = ""
        self._texts: deque[list[Any]] = deque(maxlen=None if keeps_all else TEXTS_KEPT)
        self._points: deque[dict[str, Any]] = deque(maxlen=None if keeps_all else POINTS_KEPT)
        self._state: dict[str, Any] = {}
        self._pre_arm: list[str] = []
        self._pre_arm_us = -1
        self._now_us = 0
        self._boots = 0
        self._params: dict[str, dict[str, Any]] = {}
        self._defaults: Mapping[str, float | None] = {}
        self._answers: list[Answer] = []
        self._start_batch()

    def _start_batch(self) -> None:
        self._new_texts: list[list[Any]] = []
        self._changed_params: dict[str, Any] = {}
        self._has_new_table = False
        self._start_point()

    def _start_point(self) -> None:
        self._lags_ms: list[float] = []
        self._qualities: list[int] = []
        self._vision: dict[str, Any] | None = None
        self._innovations: dict[str, _Innovation] = {}

    def take(self, updates: Iterable[StateUpdate]) -> None:
        """Apply updates, in order."""
        for update in updates:
            update(self)

    def take_boot(self, defaults: Mapping[str, float | None], firmware: str) -> None:
        """Note that a vehicle starts, whose time counts from 0; ``defaults`` are those of its parameters."""
        self._boots += 1
        self._defaults = defaults
        self._runs.close()
        self._rates.restart()
        self._recent.restart()
        self._firmware = firmware
        self._points.clear()
        self._pre_arm, self._pre_arm_us = [], -1
        self._start_point()
        self._now_us = 0
        if self._boots > 1:
            self._add_text(0, 6, "— restart —")

    def take_message(self, link: str, event: MessageEvent) -> None:
        """Take that a message was dealt with, and over which link it came."""
        header, rule = event.header, event.verdict.rule
        self._now_us = max(self._now_us, event.now_us)
        self._rates.take_message(event)
        self._recent.take(event)
        sender = "" if header is None else f"{header.system_id}:{header.component_id}"
        key = RunKey(link, event.name, sender, event.verdict.kind.value, rule.code)
        self._runs.take(key, {"reason": rule.text, "source": rule.source, "model": False}, event.now_us)

    def take_sample(self, test: SampleTest) -> None:
        """Note what the filter did with a sample."""
        outcome, rule = test.outcome, test.outcome.rule
        self._rates.take_sample(test)
        if not is_final(rule):
            return
        what = outcome_kind(rule)
        key = RunKey(FILTER, outcome.kind, "", what.value, rule.code)
        about = {"reason": rule.text, "source": rule.source, "model": is_model(rule)}
        self._runs.take(key, about, test.time_us)
        if outcome.innovation is not None and outcome.ratio is not None:
            of_kind = self._innovations.setdefault(outcome.kind, _Innovation())
            of_kind.add(outcome.innovation, outcome.ratio, is_rejected=what is OutcomeKind.REJECTED)

    def take_record(self, has_position: bool, values: Sequence[LogValue]) -> None:
        """Take a VISP or a VISV record: its values, TimeUS first."""
        time_us, _, corrected_ms = (int(value) for value in values[:3])
        self._lags_ms.append(i32(time_us // 1000 - corrected_ms) + time_us % 1000 / 1e3)  # the stamp has 32 bits
        self._qualities.append(int(values[-1]))
        if has_position:
            x, y, z = (finite(value, 3) for value in values[3:6])
            self._vision = {"pos": None if None in (x, y, z) else [x, y, z], "ignored": bool(values[-2])}

    def take_text(self, time_us: int, severity: int, text: str) -> None:
        """Note a text of the vehicle, at a time in us since boot; ``severity`` is a MAV_SEVERITY."""
        self._add_text(time_us, severity, text)
        if text.startswith(PRE_ARM):
            if time_us != self._pre_arm_us:
                self._pre_arm, self._pre_arm_us = [], time_us
            self._pre_arm.append(text.partition(": ")[2])

    def _add_text(self, time_us: int, severity: int, text: str) -> None:
        row = [time_us / 1e6, severity, text]
        self._texts.append(row)
        self._new_texts.append(row)

    def take_params(self, reading: Reading) -> None:
        """Take parameters that have changed, or others that are listed."""
        if [slot.name for slot, _ in reading] != list(self._params):
            self._params = {slot.name: row_of(slot, value, self._defaults) for slot, value in reading}
            self._has_new_table = True
            return
        for slot, raw in reading:
            value, row = shown(raw), self._params[slot.name]
            if row["value"] != value:
                row["value"] = value
                self._changed_params[slot.name] = value

    def take_state(self, time_us: int, state: dict[str, Any]) -> None:
        """Take how the vehicle is, as JSON has it."""
        self._now_us = max(self._now_us, time_us)
        passed = state["prearm"]
        failures_s = None if passed or self._pre_arm_us < 0 else self._pre_arm_us / 1e6
        self._state = {**state, "failures": [] if passed else self._pre_arm, "failures_s": failures_s}

    def take_answer(self, answer: Answer) -> None:
        """Take the outcome of something that a page asked for."""
        self._answers.append(answer)

    def take_answers(self) -> list[Answer]:
        """Return, once, the outcome of requests."""
        answers, self._answers = self._answers, []
        return answers

    def material(self) -> dict[str, Any]:
        """Return what the doctor is to examine: the last minute, with the parameters of the moment."""
        params = {name: row["value"] for name, row in self._params.items() if row["value"] is not None}
        return {"firmware": self._firmware, "params": params, "frames": self._recent.as_lists()}

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
        lags_ms, qualities = sorted(self._lags_ms), sorted(self._qualities)
        return {
            "t": self._now_us / 1e6,
            "ekf": self._state.get("ekf"),
            "yaw_deg": self._state.get("yaw_deg"),
            "vision": self._vision,
            "lag": [round(lags_ms[len(lags_ms) // 2], 1), round(lags_ms[-1], 1)] if lags_ms else None,
            "quality": [qualities[len(qualities) // 2], qualities[0]] if qualities else None,
            "innovations": {kind: worst.as_dict() for kind, worst in self._innovations.items()},
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
            "faults": [{"name": switch.name, "label": switch.label, "about": switch.about} for switch in SWITCHES],
        }
