# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is changed from replay to replay: a name and the values that it takes."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from ap_core.param import ParamTable, ParamType
from viso.errors import InputError
from viso.terminal.settings import parse_assignment

MOST_VALUES: Final = 100_000
"""Of one axis; more are taken for a mistake."""

_FAULT_FIELD: Final = re.compile(r"faults\.([1-9][0-9]*)\.([a-z][a-z0-9_]*)")
_SPAN_PARTS: Final = (2, 3)


@dataclass(frozen=True, slots=True)
class Axis:
    """A name and its values.

    Attributes:
        name: a parameter, or ``faults.N.FIELD``: a field of the Nth entry of each timeline.
        values: those that a grid takes, and of which a sample draws; empty for a span.
        span: from where to where a sample draws; None for a list of values.
        is_whole: whether only whole numbers make sense.
    """

    name: str
    values: tuple[float, ...] = ()
    span: tuple[float, float] | None = None
    is_whole: bool = False

    def as_dict(self) -> dict[str, Any]:
        """Return the axis for the definition of a sweep."""
        return {"values": list(self.values)} if self.span is None else {"span": list(self.span)}

    def at(self, share: float) -> float:
        """Return the value at a share, 0 to less than 1, of the way along the axis."""
        if self.span is None:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        low, high = self.span
        if not self.is_whole:
            return low + share * (high - low)
        return min(float(math.floor(low + share * (high - low + 1))), float(high))  # a share next to 1 rounds to it


def fault_field(name: str) -> tuple[int, str] | None:
    """Return the number of an entry, from 1, and its field, if a name means one."""
    found = _FAULT_FIELD.fullmatch(name)
    return None if found is None else (int(found[1]), found[2])


def parse_axes(texts: Sequence[str], table: ParamTable) -> tuple[Axis, ...]:
    """Return the axes that texts such as ``VISO_DELAY_MS=0:200:10``, ``EK3_SRC1_YAW=1,6`` give.

    Of one name the last counts. Raises InputError for the first that cannot be used.
    """
    axes: dict[str, Axis] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        if not equals:
            raise InputError(f"--set {text!r}: not NAME=START:STOP:STEP, NAME=A,B,C or, with --sample, NAME=LOW:HIGH")
        axis = make_axis(name.strip(), values, table, f"--set {text!r}")
        axes[axis.name] = axis
    return tuple(axes.values())


def make_axis(name: str, text: str, table: ParamTable, place: str) -> Axis:
    """Return an axis from its name and its values as text; errors begin with ``place``."""
    is_whole = False
    if fault_field(name) is None:
        name, _ = parse_assignment(f"{name}=0", table, place)
        found = table.find(name)
        is_whole = found is not None and found.type is not ParamType.FLOAT
    values, span = values_of(text, place)
    for value in (*values, *(span or ())):
        if is_whole and not value.is_integer():
            raise InputError(f"{place}: {name} takes whole numbers, {value:g} is none")
    return Axis(name, values, span, is_whole)


def values_of(text: str, place: str) -> tuple[tuple[float, ...], tuple[float, float] | None]:
    """Return the values, or the span, that a text gives; errors begin with ``place``."""
    parts = text.split(":")
    if len(parts) == 1:
        values = tuple(_number(part, place) for part in text.split(","))
        if len(set(values)) < len(values):
            raise InputError(f"{place}: a value is there twice")
        return values, None
    if len(parts) not in _SPAN_PARTS:
        raise InputError(f"{place}: not START:STOP:STEP")
    numbers = [_number(part, place) for part in parts]
    low, high = numbers[:2]
    if not low < high:
        raise InputError(f"{place}: {high:g} is not above {low:g}")
    if len(numbers) == 2:
        return (), (low, high)
    return _steps(low, high, numbers[2], place), None


def _steps(low: float, high: float, step: float, place: str) -> tuple[float, ...]:
    if not 0 < step <= high - low:
        raise InputError(f"{place}: a step of {step:g} does not lead from {low:g} to {high:g}")
    count = math.floor((high - low) / step * (1 + 1e-12)) + 1
    if count > MOST_VALUES:
        raise InputError(f"{place}: {count} values; {MOST_VALUES} are the most")
    # Twelve digits, so that 0:1:0.1 gives 0.3 and not 0.30000000000000004.
    return tuple(float(f"{low + index * step:.12g}") for index in range(count))


def _number(text: str, place: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{place}: {text.strip()!r} is not a finite number")
    return value
