# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables to which installed distributions add rows by entry points, which are read once, at the first use."""

import logging
from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

_T = TypeVar("_T")

_log = logging.getLogger(__name__)
_read: dict[str, Mapping[str, Any]] = {}


def with_plugins(group: str, own: Mapping[str, _T], kind: type[_T]) -> Mapping[str, _T]:
    """Return a table with the rows of plug-ins added.

    A row that cannot be loaded, or whose name is taken, is skipped with a warning of one line.

    Args:
        group: group of entry points; their names become the names of the rows.
        own: the built-in rows.
        kind: type that a row must have.
    """
    if group not in _read:
        _read[group] = _rows(group, own, kind)
    return {**own, **_read[group]}


def _rows(group: str, own: Mapping[str, _T], kind: type[_T]) -> Mapping[str, _T]:
    rows: dict[str, _T] = {}
    for point in entry_points(group=group):
        if point.name in own or point.name in rows:
            _pass_over(point, "the name is taken" + (" by one that is built in" if point.name in own else ""))
            continue
        try:
            row = point.load()
        except Exception as error:  # a plug-in may raise anything
            _pass_over(point, f"{type(error).__name__}: {error}")
            continue
        if isinstance(row, kind):
            rows[point.name] = row
        else:
            _pass_over(point, f"{point.value} is no {kind.__name__}")
    return rows


def _pass_over(point: EntryPoint, reason: str) -> None:
    by = "an unknown distribution" if point.dist is None else f"{point.dist.name} {point.dist.version}"
    _log.warning("plug-in %s (%s) of %s left out: %s", point.name, point.group, by, " ".join(reason.split()))
