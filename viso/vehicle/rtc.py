# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The time of day, and who may set it (AP_RTC/AP_RTC.cpp)."""

from collections.abc import Callable
from enum import IntEnum
from typing import Final

from ap_core.cint import i64
from ap_core.clock import Clock
from ap_core.param import ParamTable

OLDEST_VALID_UTC_US: Final = 1_640_995_200_000_000
"""2022-01-01: an earlier time of day is wrong."""


class RtcSource(IntEnum):
    """Where a time of day comes from, the better source first; the number is its bit in BRD_RTC_TYPES."""

    GPS = 0
    SYSTEM_TIME = 1
    HARDWARE = 2
    NONE = 3


class Rtc:
    """The time of day, in us since 1970; at boot that of ``boot_utc_us``, as of a clock in hardware, unless it is 0."""

    def __init__(self, clock: Clock, params: ParamTable, is_armed: Callable[[], bool], boot_utc_us: int = 0) -> None:
        self._clock = clock
        self._params = params
        self._is_armed = is_armed
        self._shift_us = boot_utc_us
        self._source = RtcSource.HARDWARE if boot_utc_us else RtcSource.NONE

    def utc_us(self) -> int:
        """Return the time of day, 0 while unknown."""
        return 0 if self._source is RtcSource.NONE else self._shift_us + self._clock.micros64()

    def take_system_time(self, utc_us: int) -> None:
        """Take a time of day from SYSTEM_TIME, if BRD_RTC_TYPES admits it and no better source was there."""
        self.set_utc_us(utc_us, RtcSource.SYSTEM_TIME)

    def set_utc_us(self, utc_us: int, source: RtcSource) -> None:
        """Take a time of day, unless its source is not allowed or a better one was there, or time would go back.

        Source: AP_RTC::set_utc_usec.
        """
        outranked = source >= self._source if self._is_armed() else source > self._source
        allowed = self._params.get_int("BRD_RTC_TYPES") >> source & 1
        if outranked or not allowed or utc_us < OLDEST_VALID_UTC_US:
            return
        shift_us = i64(utc_us - self._clock.micros64())
        if shift_us >= self._shift_us:
            self._shift_us = shift_us
            self._source = source
