# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters of a log differ from their defaults, and which changed while it was written."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from viso.firmware.releases import DEFAULT, Firmware
from viso.parameters.releases import MAX_LINKS
from viso.parameters.table import make_groups
from viso.report.flight_data import LoggedParameter, Material

_ABOUT_VISION: Final = ("VISO_", "EK3_", "AHRS_", "COMPASS_USE", "COMPASS_ENABLE", "LOG_REPLAY", "ARMING_")


@dataclass(frozen=True, slots=True)
class ChangedParameter:
    """A parameter that is not at its default, or did not stay what it was.

    Attributes:
        name: of it.
        value: at the end of the log.
        log_default: as the log has it, which may come from a file of defaults; NaN if it has none.
        firmware_default: of this project's table; NaN if that has none of the name.
        changes: when, in s, it became what.
    """

    name: str
    value: float
    log_default: float
    firmware_default: float
    changes: tuple[tuple[float, float], ...]

    @property
    def about_vision(self) -> bool:
        """Whether external navigation, the EKF or arming is what it is about."""
        return self.name.startswith(_ABOUT_VISION)


@dataclass(frozen=True, slots=True)
class ParameterFacts:
    """The parameters of a log.

    Attributes:
        changed: those that differ from the default or have changed, in the order of their names.
        known: how many there are.
        without_default: how many have no known default.
    """

    changed: tuple[ChangedParameter, ...]
    known: int
    without_default: int


def parameter_facts(material: Material, firmware: Firmware = DEFAULT) -> ParameterFacts:
    """Return which parameters are worth a look, as a release has them."""
    by_name: dict[str, list[LoggedParameter]] = {}
    for parameter in material.parameters:
        by_name.setdefault(parameter.name, []).append(parameter)
    table = ParamTable(make_groups(MAX_LINKS, make_params(), firmware.params)) if by_name else None
    changed, without_default = [], 0
    for name, records in sorted(by_name.items()):
        log_default = next((record.default for record in records if math.isfinite(record.default)), math.nan)
        known = None if table is None else table.find(name)
        firmware_default = math.nan if known is None else float(known.value)
        defaults = list(filter(math.isfinite, (log_default, firmware_default)))
        without_default += not defaults
        value, changes = records[-1].value, _changes(records)
        differs = any(np.float32(value) != np.float32(default) for default in defaults)
        if (differs or changes) and not name.startswith("STAT_"):
            changed.append(ChangedParameter(name, value, log_default, firmware_default, changes))
    return ParameterFacts(tuple(changed), len(by_name), without_default)


def _changes(records: Sequence[LoggedParameter]) -> tuple[tuple[float, float], ...]:
    return tuple((after.time_s, after.value) for before, after in pairwise(records) if after.value != before.value)
