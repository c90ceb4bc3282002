# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a vehicle's parameters are kept over a restart: what it asks of such a place, and one in memory."""

from collections.abc import Mapping
from typing import Protocol

from ap_core.param import ParamTable
from viso.parameters.conversion import NO_RENAMES, Renames, carry_over


class StoredParams(Protocol):
    """Keeps parameters over a restart."""

    def restore(self, params: ParamTable, renames: Renames = NO_RENAMES) -> None:
        """Give a vehicle's parameters their stored values, also those that an earlier release stored."""

    def save_if_changed(self, values: Mapping[str, float], *, synced: bool = True) -> bool:
        """Keep what a restart has to remember, by name; say whether anything was new.

        ``synced``: over a restart of the computer as well, which takes longer.
        """


class MemoryParamStore:
    """Keeps parameters as long as it exists itself."""

    def __init__(self) -> None:
        self._values: dict[str, float] = {}

    def restore(self, params: ParamTable, renames: Renames = NO_RENAMES) -> None:
        """Give a vehicle's parameters their stored values, also those that an earlier release stored."""
        params.load_stored(carry_over(self._values, params, renames).values)

    def save_if_changed(self, values: Mapping[str, float], *, synced: bool = True) -> bool:
        """Keep what a restart has to remember, by name; say whether anything was new."""
        changed = values != self._values
        self._values = dict(values)
        return changed
