# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How parameters of commands become integers."""

import math
from typing import Final

from ap_core.cint import u32, u64

_I64_LIMIT: Final = 1 << 63


def u32_of_float(value: float) -> int:
    """Return a parameter as the firmware's uint32_t."""
    # x86-64 converts to uint32_t through a 64-bit register; NaN and what does not fit there give 0.
    return u32(math.trunc(value)) if -_I64_LIMIT <= value < _I64_LIMIT else 0


def u64_of_float(value: float) -> int:
    """Return a parameter as the firmware's uint64_t."""
    # x86-64 converts the upper half after taking 2**63 off; what does not fit a register becomes its sign bit.
    if value >= 2 * _I64_LIMIT:
        return 0
    return u64(math.trunc(value)) if value >= -_I64_LIMIT else _I64_LIMIT
