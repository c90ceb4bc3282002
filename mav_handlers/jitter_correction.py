# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Correction of a sender's time stamps into the autopilot's time (AP_RTC/JitterCorrection.cpp)."""

from ap_core.cint import i64, u64


class JitterCorrection:
    """Estimates when a sample was made, from the sender's clock and the time of arrival.

    The sender's clock may have any epoch: only differences matter. The smallest transport lag so far defines the offset
    between the clocks; a sample may be late by at most ``max_lag_ms``. One corrector serves all senders and message
    types of a link, and is never reset.
    """

    def __init__(self, max_lag_ms: int = 500, convergence_loops: int = 100) -> None:
        self._max_lag_us = max_lag_ms * 1000
        self._convergence_loops = convergence_loops
        self._initialised = False
        self._link_offset_usec = 0
        self._min_sample_us = 0
        self._min_sample_counter = 0

    def correct_offboard_timestamp_usec(self, offboard_usec: int, local_usec: int) -> int:
        """Return the time of a sample in us since boot.

        Args:
            offboard_usec: the sender's time stamp, 0..2^64-1.
            local_usec: the time of arrival in us since boot.

        Source: JitterCorrection::correct_offboard_timestamp_usec.
        """
        diff_us = i64(local_usec - offboard_usec)
        if not self._initialised or diff_us < self._link_offset_usec:
            # The sample would be from the future, which is impossible.
            self._link_offset_usec = diff_us
            self._initialised = True

        estimate_us = i64(offboard_usec + self._link_offset_usec)
        if i64(estimate_us + self._max_lag_us) < i64(local_usec):
            estimate_us = i64(local_usec - self._max_lag_us)
            self._link_offset_usec = i64(estimate_us - offboard_usec)

        if self._min_sample_counter == 0 or diff_us < self._min_sample_us:
            self._min_sample_us = diff_us
        self._min_sample_counter += 1
        if self._min_sample_counter == self._convergence_loops:
            # Follows slow drift of the sender's clock; takes effect with the next sample.
            self._link_offset_usec = self._min_sample_us
            self._min_sample_counter = 0
        return u64(estimate_us)
