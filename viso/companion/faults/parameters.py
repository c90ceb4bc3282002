# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a fault: dataclass fields that are checked, by their types and ranges, when it is made."""

import dataclasses
import enum
import math
from typing import Any, get_args, get_origin


def parameter(default: Any, low: float = -math.inf, high: float = math.inf, *, nan: bool = False) -> Any:
    """Return a dataclass field for a value, or several, from ``low`` to ``high``, both included; infinity never is."""
    return dataclasses.field(default=default, metadata={"range": (low, high), "nan": nan})


def parameters_of(fault: Any) -> tuple["dataclasses.Field[Any]", ...]:
    """Return the fields of a fault, or of its class, that a timeline may give."""
    return tuple(field for field in dataclasses.fields(fault) if field.init)


def check_parameters(fault: Any) -> None:
    """Check every parameter and bring it into its own type.

    Raises ValueError: ``name: what`` for the first that cannot be used.
    """
    for field in parameters_of(fault):
        try:
            setattr(fault, field.name, _checked(field.type, getattr(fault, field.name), field.metadata))
        except ValueError as error:
            raise ValueError(f"{field.name}: {error}") from None


def _checked(kind: Any, value: Any, metadata: Any) -> Any:
    if get_origin(kind) is tuple:
        if not isinstance(value, list | tuple) or not value:
            raise ValueError(f"{value!r} is no list, or an empty one")
        return tuple(_checked(get_args(kind)[0], one, metadata) for one in value)
    if kind in (int, float):
        return _number(kind, value, metadata)
    if issubclass(kind, enum.StrEnum):
        if value not in list(kind):
            raise ValueError(f"{value!r} is none of {', '.join(kind)}")
        return kind(value)
    if type(value) is not kind:
        raise ValueError(f"{value!r} is no {'text' if kind is str else 'true or false'}")
    return value


def _number(kind: type[int] | type[float], value: Any, metadata: Any) -> int | float:
    number = as_number(value)
    low, high = metadata["range"]
    if math.isnan(number):
        if not metadata["nan"]:
            raise ValueError("not a number")
        return number
    if math.isinf(number) or not low <= number <= high:
        raise ValueError(f"{value!r} is not within {low:g} to {high:g}")
    if kind is int and number != int(number):
        raise ValueError(f"{value!r} is no whole number")
    return kind(value) if kind is int and type(value) is int else kind(number)


def as_number(value: Any) -> float:
    """Return a number of a timeline; YAML takes some, such as 1e6, for text. Raises ValueError if it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r} is no number")
    try:
        return float(value)
    except (ValueError, OverflowError):
        raise ValueError(f"{value!r} is no number") from None
