# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Values computed from parameters, kept until one of them changes: for code of every pass of the main loop."""

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from ap_core.param import ParamTable

T = TypeVar("T")


class FromParams(Generic[T]):
    """A value that depends on nothing but parameters; call it to get the value.

    Args:
        work_out: makes the value; called at first use, and again at the first use after any parameter was stored.
    """

    def __init__(self, params: ParamTable, work_out: Callable[[], T]) -> None:
        self._params = params
        self._work_out = work_out
        self._generation: int | None = None
        self._value: T

    def __call__(self) -> T:
        """Return the value as the parameters have it now."""
        if self._generation != self._params.generation:
            self._value = self._work_out()
            self._generation = self._params.generation
        return self._value


class Numbers(dict[str, float]):
    """Numbers by parameter name, each looked up once until a parameter changes.

    It is a dictionary that fills itself, because a lookup in a dictionary is the fastest.

    Args:
        prefix: what precedes each of the names that are asked for.
        renamed: what some of the names that are asked for are called instead.
    """

    def __init__(self, params: ParamTable, prefix: str = "", renamed: Mapping[str, str] | None = None) -> None:
        super().__init__()
        self._renamed = dict(renamed or {})
        self._params = params
        self._prefix = prefix
        params.on_change.append(self._forget)

    def _forget(self) -> None:
        self.clear()

    def __missing__(self, name: str) -> float:
        """Look a parameter up by its name after the prefix; ValueError when there is none."""
        number = self[name] = self._params.get_number(self._prefix + self._renamed.get(name, name))
        return number
