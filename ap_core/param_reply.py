# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the parameter table answers: readings of parameters, and results of setting them."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from ap_core.fmath import NAN
from ap_core.param_info import ParamType, ParamValue

NO_INDEX: Final = 65535
"""``param_index`` of a parameter that was not found by its index."""


@dataclass(frozen=True, slots=True)
class Param:
    """A reading of one parameter.

    ``name`` is spelled as it was asked for, ``canonical_name`` as it is listed. ``value`` is what MAVLink
    carries, ``raw`` what is stored (an int32 may need more digits than float32 has). ``index`` is NO_INDEX
    when the parameter was found by name.
    """

    name: str
    type: ParamType
    value: np.float32
    default: np.float32
    index: int
    canonical_name: str
    raw: ParamValue


class ParamOutcome(Enum):
    """Outcome of a PARAM_SET."""

    SET = "set"
    UNKNOWN = "unknown parameter"
    NOT_FINITE = "value is NaN or infinite"
    READ_ONLY = "read-only"


@dataclass(frozen=True, slots=True)
class ParamEcho:
    """One PARAM_VALUE that a PARAM_SET causes; ``wire_type`` is its MAV_PARAM_TYPE."""

    name: str
    value: np.float32
    wire_type: int


@dataclass(frozen=True, slots=True)
class ParamSet:
    """Result of a PARAM_SET.

    With SET the echoes go to every active link, with READ_ONLY the only one goes to the requester.
    ``previous`` and ``value`` are the readings before and after; NaN for an unknown parameter and for a whole
    vector.
    """

    outcome: ParamOutcome
    previous: np.float32 = NAN
    value: np.float32 = NAN
    echoes: tuple[ParamEcho, ...] = ()
