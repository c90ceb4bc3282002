# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters as the page shows them: each with what is known about it."""

import math
from collections.abc import Mapping
from typing import Any

from ap_core.param import ParamFlag, ParamTable
from ap_core.param_group import ParamSlot
from ap_core.param_info import ParamValue

Reading = tuple[tuple[ParamSlot, ParamValue], ...]
"""The parameters that are listed at a moment, in their order, each with its value."""


def read_params(params: ParamTable) -> Reading:
    """Return the parameters that are listed now; quick, for it is the vehicle's own thread that does it."""
    return tuple((slot, slot.raw) for group in params.groups for slot in group.listed_slots)


def defaults_of(params: ParamTable) -> dict[str, float | None]:
    """Return the defaults of all parameters by name; they do not change after boot."""
    names = (slot.name for group in params.groups for slot in group.slots)
    found = (params.find(name) for name in names)
    return {param.canonical_name: shown(param.default) for param in found if param is not None}


def shown(value: ParamValue) -> float | None:
    """Return the number with the fewest digits that rounds to what is stored; None for one that is not finite."""
    if isinstance(value, int):
        return value
    return float(str(value)) if math.isfinite(value) else None


def row_of(slot: ParamSlot, value: ParamValue, defaults: Mapping[str, float | None]) -> dict[str, Any]:
    """Return a parameter as JSON has it."""
    info = slot.row
    return {
        "name": slot.name,
        "value": shown(value),
        "default": defaults.get(slot.name),
        "unit": info.unit,
        "about": info.description,
        "range": info.range,
        "values": [[number, text] for number, text in info.values.items()],
        "reboot": info.reboot_required,
        "read_only": ParamFlag.READ_ONLY in info.flags,
    }
