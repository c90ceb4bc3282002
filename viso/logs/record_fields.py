# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers and texts out of the records of a log, which may hold anything."""

import math
from typing import Any


class RecordError(ValueError):
    """A record, or the lack of one, makes it impossible to go on; the text names it and its field."""


def numbers(record: Any, *labels: str) -> list[float]:
    """Return fields of a record. Raises RecordError if a field is missing, or no number."""
    try:
        return [float(getattr(record, label)) for label in labels]
    except (AttributeError, TypeError, ValueError) as error:
        raise RecordError(f"{record.get_type()} lacks a number in {' or '.join(labels)}") from error


def finite(record: Any, *labels: str) -> list[float]:
    """Return fields of a record. Raises RecordError if one is missing, NaN, infinite, or no number."""
    values = numbers(record, *labels)
    for label, value in zip(labels, values, strict=True):
        if not math.isfinite(value):
            raise RecordError(f"{record.get_type()}.{label} is {value}")
    return values


def whole(record: Any, *labels: str) -> list[int]:
    """Return integer fields of a record. Raises RecordError if a field is missing, or no number."""
    return [int(value) for value in finite(record, *labels)]


def instance(record: Any) -> int:
    """Return which of several sensors a record is about. Raises RecordError if it does not say so."""
    return whole(record, "I")[0]


def text(record: Any, label: str) -> str:
    """Return a text of a record. Raises RecordError if the field is missing, or no text."""
    value = getattr(record, label, None)
    if not isinstance(value, str):
        raise RecordError(f"{record.get_type()} lacks a text in {label}")
    return value
