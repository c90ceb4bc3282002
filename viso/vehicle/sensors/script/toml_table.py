# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the tables of a TOML file, with errors in one line that name the key."""

from collections.abc import Collection, Mapping
from typing import Any

from viso.errors import InputError
from viso.vehicle.sensors.vectors import Three


class TomlTable:
    """A table of a file whose keys are read one after the other; ``check_all_known`` then refuses others.

    Args:
        values: what the table holds.
        place: what errors begin with: the file, and the table if it is not the whole file.
    """

    def __init__(self, values: Mapping[str, Any], place: str) -> None:
        self._values = values
        self._known: list[str] = []
        self.place = place

    def fail(self, key: str, why: str) -> InputError:
        """Return an error that names a key."""
        return InputError(f"{self.place}: {key}: {why}")

    def has(self, key: str) -> bool:
        """Return whether a key is there, which is then known."""
        self._known.append(key)
        return key in self._values

    def get(self, key: str) -> Any:
        """Return the value of a key, whatever it is."""
        if not self.has(key):
            raise self.fail(key, "missing")
        return self._values[key]

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """Return a number within limits; without a default it must be there."""
        if not self.has(key) and default is not None:
            return default
        value = self.get(key)
        if not _is_within(value, low, high):
            raise self.fail(key, f"not a number from {low:g} to {high:g}")
        return float(value)

    def count(self, key: str, high: int, default: float) -> float:
        """Return a whole number from 1 up."""
        if not self.has(key):
            return default
        value = self.get(key)
        if not isinstance(value, int) or not _is_within(value, 1, high):
            raise self.fail(key, f"not a whole number from 1 to {high}")
        return value

    def three(self, key: str, limit: float, default: Three | None = None) -> Three:
        """Return three numbers, none of them beyond a limit; without a default they must be there."""
        if not self.has(key) and default is not None:
            return default
        value = self.get(key)
        if not isinstance(value, list) or len(value) != 3 or not all(_is_within(one, -limit, limit) for one in value):
            raise self.fail(key, f"not three numbers from {-limit:g} to {limit:g}")
        return float(value[0]), float(value[1]), float(value[2])

    def choice(self, key: str, choices: Collection[str], default: str | None = None) -> str:
        """Return one of some texts; without a default it must be there."""
        if not self.has(key) and default is not None:
            return default
        value = self.get(key)
        if not isinstance(value, str) or value not in choices:
            raise self.fail(key, f"not one of {', '.join(choices)}")
        return value

    def tables(self, key: str) -> "list[TomlTable]":
        """Return the tables of an array of tables, at least one, counted from 1 in errors."""
        value = self.get(key)
        if not isinstance(value, list) or not value or not all(isinstance(one, dict) for one in value):
            raise self.fail(key, f"not [[{key}]] tables")
        return [TomlTable(one, f"{self.place}: {key} {number}") for number, one in enumerate(value, 1)]

    def check_all_known(self) -> None:
        """Check that every key was read. Raises InputError naming one that was not."""
        for key in self._values:
            if key not in self._known:
                known = ", ".join(dict.fromkeys(self._known))
                raise self.fail(key, f"no such key here; there are {known}")


def _is_within(value: object, low: float, high: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
