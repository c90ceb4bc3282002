# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""C integer arithmetic: values reduced to a width, and conversions as x86-64 does them."""

import math

import numpy as np

_I32_MIN = -(1 << 31)
_I32_MAX = (1 << 31) - 1
_I64_MIN = -(1 << 63)
_I64_MAX = (1 << 63) - 1


def u8(value: int) -> int:
    """Reduce modulo 2^8."""
    return value & 0xFF


def u16(value: int) -> int:
    """Reduce modulo 2^16."""
    return value & 0xFFFF


def u32(value: int) -> int:
    """Reduce modulo 2^32."""
    return value & 0xFFFFFFFF


def u64(value: int) -> int:
    """Reduce modulo 2^64."""
    return value & 0xFFFFFFFFFFFFFFFF


def i8(value: int) -> int:
    """Reduce to a signed 8-bit integer."""
    return ((value + 0x80) & 0xFF) - 0x80


def i16(value: int) -> int:
    """Reduce to a signed 16-bit integer."""
    return ((value + 0x8000) & 0xFFFF) - 0x8000


def i32(value: int) -> int:
    """Reduce to a signed 32-bit integer."""
    return ((value + 0x80000000) & 0xFFFFFFFF) - 0x80000000


def i64(value: int) -> int:
    """Reduce to a signed 64-bit integer."""
    if _I64_MIN <= value <= _I64_MAX:
        return value
    return ((value + (1 << 63)) & 0xFFFFFFFFFFFFFFFF) - (1 << 63)


def int_of_float(value: float) -> int:
    """Convert to C ``int`` by truncation; NaN and values out of range give INT_MIN, as on x86-64."""
    if not math.isfinite(value):
        return _I32_MIN
    truncated = math.trunc(value)
    return truncated if _I32_MIN <= truncated <= _I32_MAX else _I32_MIN


def int64_of_float(value: float) -> int:
    """Convert to a signed 64-bit integer by truncation; NaN and values out of range give INT64_MIN, as on x86-64."""
    return math.trunc(value) if _I64_MIN <= value <= _I64_MAX else _I64_MIN


def float_of_u64(value: int) -> np.float32:
    """Convert an unsigned 64-bit integer to float32 with a single rounding."""
    return np.float32(np.uint64(u64(value)).astype(np.float32))
