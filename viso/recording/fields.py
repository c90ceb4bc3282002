# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of a mapping that somebody wrote: each is checked as it is taken, and what nobody takes is an error."""

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from mav_handlers.wire.messages import MESSAGES, Message
from viso.errors import InputError

PAYLOAD_BYTES = 251
_NUMBERS = {"nan": math.nan, "inf": math.inf}


class Fields:
    """A mapping's fields; ``place`` is its file and field.

    Raises InputError, one line that names file and field, if it is no mapping, or a field cannot be used.
    """

    def __init__(self, place: str, given: object) -> None:
        self.place = place
        if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
            raise InputError(f"{place}: not a mapping of names to values: {given!r}")
        self._given = dict(given)

    def __contains__(self, name: str) -> bool:
        """Return whether a field is there that nobody has taken."""
        return name in self._given

    def at(self, name: str) -> str:
        """Return the place of a field."""
        return f"{self.place}: {name}"

    def take(self, name: str) -> Any:
        """Return a field as it stands. Raises InputError if it is missing."""
        if name not in self._given:
            raise InputError(f"{self.at(name)}: missing")
        return self._given.pop(name)

    def number(self, name: str, default: float | None = None, low: float = -1e9, high: float = 1e9) -> float:
        """Return a number between two others; it has to be there if there is no default."""
        if default is not None and name not in self._given:
            return default
        return number(self.at(name), self.take(name), low, high)

    def whole(self, name: str, default: int | None = None, low: int = 0, high: int = 2**32 - 1) -> int:
        """Return a whole number between two others; it has to be there if there is no default."""
        if default is not None and name not in self._given:
            return default
        value = self.take(name)
        if type(value) is not int or not low <= value <= high:
            raise InputError(f"{self.at(name)}: {value!r} is not a whole number between {low} and {high}")
        return value

    def flag(self, name: str, default: bool = False) -> bool:
        """Return true or false."""
        value = self._given.pop(name, default)
        if not isinstance(value, bool):
            raise InputError(f"{self.at(name)}: {value!r} is neither true nor false")
        return value

    def text(self, name: str, default: str | None = None, among: Collection[str] = ()) -> str:
        """Return a text, one of some if they are given."""
        value = self._given.pop(name, default) if default is not None else self.take(name)
        if not isinstance(value, str) or (among and value not in among):
            expected = f"none of {', '.join(among)}" if among else "not a text"
            raise InputError(f"{self.at(name)}: {value!r} is {expected}")
        return value

    def numbers(self, name: str, default: Sequence[float], most: int | None = None) -> tuple[float, ...]:
        """Return a list of finite numbers, as many as the default has, or up to ``most``."""
        value = self._given.pop(name, default)
        return numbers(self.at(name), value, len(default) if most is None else None, most)

    def table(self, name: str) -> dict[str, float]:
        """Return a mapping of names to numbers, empty if it is missing."""
        inner = Fields(self.at(name), self._given.pop(name, {}))
        return {one: inner.number(one, low=-3.4e38, high=3.4e38) for one in tuple(inner._given)}

    def end(self) -> None:
        """Raise InputError if a field is left that nobody took."""
        for name in self._given:
            raise InputError(f"{self.at(name)}: no such field")


def number(place: str, value: object, low: float, high: float) -> float:
    """Return a number. Raises InputError if it is none, or out of bounds."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise InputError(f"{place}: {value!r} is not a number between {low:g} and {high:g}")
    return float(value)


def numbers(place: str, value: object, count: int | None, most: int | None = None) -> tuple[float, ...]:
    """Return a list of finite numbers. Raises InputError if it is none, or of another length."""
    if not isinstance(value, list | tuple) or (count is not None and len(value) != count):
        raise InputError(f"{place}: {value!r} is not a list of {'' if count is None else f'{count} '}numbers")
    if most is not None and len(value) > most:
        raise InputError(f"{place}: {len(value)} numbers, at most {most} are fine")
    return tuple(number(place, one, -1e9, 1e9) for one in value)


def message_of(place: str, value: object) -> Message:
    """Return the message that ``[NAME, {field: value}]`` stands for; fields that are left out are zero or empty.

    ``"nan"`` and ``"inf"`` are numbers; a payload is text in hex.

    Raises InputError if there is no such message or field, or a value is of another kind.
    """
    if not isinstance(value, list) or not 1 <= len(value) <= 2 or value[0] not in MESSAGES:
        raise InputError(f"{place}: {value!r} is not [MESSAGE, {{field: value}}] of a message that is known here")
    kind = MESSAGES[value[0]]
    fields = Fields(f"{place}: {value[0]}", value[1] if len(value) == 2 else {})
    names = [field.name for field in dataclasses.fields(kind) if field.name in fields]
    given = {name: _sendable(fields.at(name), name, fields.take(name)) for name in names}
    fields.end()
    return filled(kind, given)


def filled(kind: type[Message], given: Mapping[str, Any]) -> Message:
    """Return a message; fields that are not given are zero or empty."""
    empty = {
        field.name: "" if field.type in (str, "str") else 0
        for field in dataclasses.fields(kind)
        if field.default is dataclasses.MISSING
    }
    return kind(**{**empty, **given})


def _sendable(place: str, name: str, value: Any) -> Any:
    if name == "payload" and isinstance(value, str):
        try:
            return tuple(bytes.fromhex(value).ljust(PAYLOAD_BYTES, b"\0"))
        except ValueError:
            raise InputError(f"{place}: {value!r} is not text in hex") from None
    if isinstance(value, list):
        return tuple(_NUMBERS.get(one, one) if isinstance(one, str) else one for one in value)
    if isinstance(value, str):
        return _NUMBERS.get(value, value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{place}: {value!r} is neither a number nor a text")
    return value
