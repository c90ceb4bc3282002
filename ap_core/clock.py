# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Time since boot, passed in by the caller: nothing in the core reads a wall clock."""

from typing import Final, Protocol

from ap_core.cint import u64

NEVER: Final = 1 << 62
"""A time that does not come, in any unit."""

_U32: Final = 0xFFFFFFFF
_U64: Final = 0xFFFFFFFFFFFFFFFF


def count_before(times: range, time: int) -> int:
    """Count the times before ``time`` in an endless sequence of evenly spaced times."""
    return max(0, -((times.start - time) // times.step))


class Clock(Protocol):
    """Time since boot of the emulated vehicle (AP_HAL::micros64, AP_HAL::millis)."""

    def micros64(self) -> int:
        """Return microseconds since boot, modulo 2^64."""

    def millis(self) -> int:
        """Return milliseconds since boot, modulo 2^32."""


class VirtualClock:
    """A clock that moves only when it is set."""

    def __init__(self, time_us: int = 0) -> None:
        self._time_us = u64(time_us)

    def micros64(self) -> int:
        """Return microseconds since boot, modulo 2^64."""
        return self._time_us

    def millis(self) -> int:
        """Return milliseconds since boot, modulo 2^32."""
        return self._time_us // 1000 & _U32  # as u32 does, without its call: every pass reads it a dozen times

    def set_us(self, time_us: int) -> None:
        """Set the time since boot in microseconds; any value is allowed, as tests step across wraps."""
        self._time_us = time_us & _U64
