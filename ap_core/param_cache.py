# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Values computed from parameters, cached until a parameter changes, for code that runs in every main loop."""

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from ap_core.param import ParamTable

T = TypeVar("T")


class FromParams(Generic[T]):
    """A cached value that depends on parameters alone; call the object to get the value.

    Args:
        work_out: computes the value; called at the first use, and at the first use after any parameter was stored.
    """

    def __init__(self, params: ParamTable, work_out: Callable[[], T]) -> None:
        self._params = params
        self._work_out = work_out
        self._generation: int | None = None
        self._value: T

    def __call__(self) -> T:
        """Return the value for the present parameters."""
        if self._generation != self._params.generation:
            self._value = self._work_out()
            self._generation = self._params.generation
        return self._value


class Numbers(dict[str, float]):
    """Numbers by parameter name, each looked up once until a parameter changes.

    It is a dictionary that fills itself, because a dictionary lookup is fastest.

    Args:
        prefix: precedes each requested name.
        renamed: actual names of some requested names.
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
