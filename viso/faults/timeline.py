# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Timelines: which faults happen when, to which messages, read from YAML."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from mav_handlers.handlers import VISION_NAMES
from mav_handlers.wire.codec import message_id
from viso.documents import parsed_yaml
from viso.faults.fault import Fault, as_number, parameters_of
from viso.faults.kinds import FAULTS

ALL: Final = "all"
LATEST_S: Final = 1e9
MAX_SEED: Final = 2**63 - 1
_COMMON: Final = ("kind", "start_s", "end_s", "at_s", "messages", "probability")


class TimelineError(ValueError):
    """A timeline that cannot be used; its text is one line ``file: entry: field: what``."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A fault, when it happens, and to what.

    Attributes:
        kind: its name in the table of kinds.
        fault: with its parameters, never used itself: each injector has one of its own.
        start_s: when it begins, from the first frame on, included.
        end_s: when it is over.
        once: whether it happens to one message only, the first from ``start_s`` on that it can happen to.
        messages: names of those it happens to; None for all, bytes that are no frame included.
        probability: that it happens to a message, 0 to 1.
    """

    kind: str
    fault: Fault
    start_s: float = 0.0
    end_s: float = math.inf
    once: bool = False
    messages: frozenset[str] | None = VISION_NAMES
    probability: float = 1.0

    @property
    def start_us(self) -> int:
        """When it begins, in us."""
        return round(self.start_s * 1e6)

    def covers(self, time_us: int, name: str) -> bool:
        """Return whether a message of that name, at that time from the first frame on, is concerned."""
        if time_us < self.start_us or (self.end_s < math.inf and time_us >= round(self.end_s * 1e6)):
            return False
        return self.messages is None or name in self.messages


@dataclass(frozen=True, slots=True)
class Timeline:
    """Faults in the order in which a frame meets them, and the seed of all chance."""

    entries: tuple[Entry, ...] = ()
    seed: int = 0


def load_timeline(path: Path) -> Timeline:
    """Return the timeline in a YAML file. Raises TimelineError, naming file, entry and field."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise TimelineError(f"{path}: not UTF-8 text") from error
    except OSError as error:
        raise TimelineError(f"{path}: {error.strerror or error}") from error
    return parse_timeline(text, str(path))


def parse_timeline(text: str, name: str = "timeline") -> Timeline:
    """Return the timeline in YAML text.

    Args:
        text: a mapping with ``faults``, a list, and if wanted ``seed``.
        name: of the file, for the error.

    Raises:
        TimelineError: naming file, entry and field.
    """
    try:
        return _timeline(parsed_yaml(text))
    except ValueError as error:
        raise TimelineError(" ".join(f"{name}: {error}".split())) from None


def _timeline(document: Any) -> Timeline:
    if not isinstance(document, Mapping) or "faults" not in document:
        raise TimelineError("a timeline has a list 'faults'")
    for key in document:
        if key not in ("faults", "seed"):
            raise TimelineError(f"{key}: unknown field; there are faults, seed")
    faults = document["faults"]
    if not isinstance(faults, list):
        raise TimelineError("faults: not a list")
    entries = tuple(_entry(number, fields) for number, fields in enumerate(faults, 1))
    return Timeline(entries, _seed(document.get("seed", 0)))


def _seed(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= MAX_SEED:
        raise TimelineError(f"seed: {value!r} is no whole number from 0 to {MAX_SEED}")
    return value


def _entry(number: int, fields: Any) -> Entry:
    if not isinstance(fields, Mapping) or "kind" not in fields:
        raise TimelineError(f"entry {number}: kind: missing; there are {', '.join(FAULTS)}")
    kind = fields["kind"]
    if not isinstance(kind, str) or kind not in FAULTS:
        raise TimelineError(f"entry {number}: kind: {kind!r} is unknown; there are {', '.join(FAULTS)}")
    try:
        return make_entry(kind, {key: value for key, value in fields.items() if key != "kind"})
    except ValueError as error:
        raise TimelineError(f"entry {number} ({kind}): {error}") from None


def make_entry(kind: str, fields: Mapping[str, Any]) -> Entry:
    """Return an entry of a known kind from its other fields.

    Raises ValueError: ``field: what`` for one that is unknown or cannot be used.
    """
    cls = FAULTS[kind]
    own = [field.name for field in parameters_of(cls)]
    for key in fields:
        if key not in _COMMON and key not in own:
            raise ValueError(f"{key}: unknown field; there are {', '.join((*_COMMON, *own))}")
    fault = cls(**{key: value for key, value in fields.items() if key in own})
    start_s, end_s, once = _span(fields, lasts=cls.lasts)
    usual = ALL if cls.every_message else list(cls.for_messages) or None
    messages = _messages(fields.get("messages", usual))
    probability = _within("probability", fields.get("probability", 1.0), 1.0)
    return Entry(kind, fault, start_s, end_s, once, messages, probability)


def _span(fields: Mapping[str, Any], *, lasts: bool) -> tuple[float, float, bool]:
    if "at_s" in fields:
        for key in ("start_s", "end_s"):
            if key in fields:
                raise ValueError(f"{key}: not together with at_s")
        return _within("at_s", fields["at_s"], LATEST_S), math.inf, not lasts
    start_s = _within("start_s", fields.get("start_s", 0.0), LATEST_S)
    if "end_s" not in fields:
        return start_s, math.inf, False
    end_s = _within("end_s", fields["end_s"], LATEST_S)
    if end_s <= start_s:
        raise ValueError(f"end_s: {end_s:g} is not after start_s, {start_s:g}")
    return start_s, end_s, False


def _within(name: str, value: Any, high: float) -> float:
    try:
        number = as_number(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if not 0 <= number <= high:
        raise ValueError(f"{name}: {value!r} is not within 0 to {high:g}")
    return number


def _messages(value: Any) -> frozenset[str] | None:
    if value is None:
        return VISION_NAMES
    if value == ALL:
        return None
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names:
        raise ValueError(f"messages: {value!r} is neither a name, nor a list of them, nor {ALL}")
    for name in names:
        try:
            message_id(name)
        except (KeyError, TypeError):
            raise ValueError(f"messages: {name!r} is no message") from None
    return frozenset(names)
