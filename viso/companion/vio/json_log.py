# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion's log: one JSON object per line, and nothing else."""

import json
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

COMPONENT: Final = "vio"
PLAIN: Final = "log"  # the event of records that do not name theirs
_LEVELS: Final = {"WARNING": "WARN"}


def finite_json(value: object) -> object:
    """Return a value as JSON takes it: NaN and infinities as None, what JSON does not know as text."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None  # numpy's float64 is a float, too
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Mapping):
        return {str(key): finite_json(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray)):
        return [finite_json(item) for item in value]
    if hasattr(value, "tolist"):  # numpy's arrays and other scalars
        return finite_json(value.tolist())
    return str(value)


def compact_json(value: object) -> str:
    """Return a value as JSON without needless spaces, on one line."""
    return json.dumps(finite_json(value), separators=(",", ":"), allow_nan=False)


def log_event(
    logger: logging.Logger,
    level: int,
    event: str,
    msg: str,
    fields: Mapping[str, object] = MappingProxyType({}),
    *,
    strategy: str | None = None,
    frame: object = None,
    error: BaseException | None = None,
) -> None:
    """Log an event with its fields.

    Args:
        logger: whose handlers format with :class:`JsonFormatter`.
        event: what happened, for machines.
        msg: what happened, for people.
        fields: anything else; their names must not be those of the standing keys.
        error: whose traceback to log with it.
    """
    extra = {"event": event, "strategy": strategy, "frame": frame, "fields": fields}
    logger.log(level, "%s", msg, extra=extra, exc_info=error, stacklevel=2)


class JsonFormatter(logging.Formatter):
    """Formats any record as one line of JSON, also those that know nothing of events."""

    def __init__(self, clock_ns: Callable[[], int]) -> None:
        super().__init__()
        self._clock_ns = clock_ns

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, without its end."""
        fields = dict(getattr(record, "fields", {}))
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        standing = {
            "ts_ns": self._clock_ns(),
            "level": _LEVELS.get(record.levelname, record.levelname),
            "component": COMPONENT,
            "event": getattr(record, "event", PLAIN),
            "strategy": getattr(record, "strategy", None),
            "frame": getattr(record, "frame", None),
            "msg": record.getMessage(),
        }
        return compact_json(standing | fields | standing)  # they come first, and no field overrides them
