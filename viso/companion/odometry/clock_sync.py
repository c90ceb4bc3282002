# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flight controller's clock against the companion's, by TIMESYNC (MAVLink common.xml, message 111)."""

from collections import deque
from dataclasses import dataclass
from typing import Final

from mav_handlers.wire.messages import TIMESYNC

SAMPLES: Final = 32
MAX_ROUND_TRIP_NS: Final = 20_000_000
REQUEST_PERIOD_NS: Final = 200_000_000
OUTSTANDING: Final = 16
# How far two clocks may part while a sample is among the last.
_DRIFT_NS: Final = 2_000_000


@dataclass(frozen=True, slots=True)
class _Sample:
    round_trip_ns: int
    offset_ns: int


class ClockSync:
    """Sends TIMESYNC requests, keeps the best answers, and answers the autopilot's requests.

    Times are nanoseconds; the companion's are those of its monotonic clock.
    """

    def __init__(self) -> None:
        self._outstanding: deque[int] = deque(maxlen=OUTSTANDING)
        self._samples: deque[_Sample] = deque(maxlen=SAMPLES)

    @property
    def offset_ns(self) -> int | None:
        """The companion's time less the autopilot's, or None before the first good answer."""
        best = self._best()
        return None if best is None else best.offset_ns

    @property
    def round_trip_ns(self) -> int | None:
        """The round trip of the best answer, or None before the first good one."""
        best = self._best()
        return None if best is None else best.round_trip_ns

    def request(self, now_ns: int) -> TIMESYNC:
        """Return a request to be sent at once."""
        self._outstanding.append(now_ns)
        return TIMESYNC(0, now_ns)

    def take(self, message: TIMESYNC, arrival_ns: int) -> TIMESYNC | None:
        """Handle a message; return the answer to send at once if it is a request."""
        if message.tc1 == 0:
            return TIMESYNC(max(arrival_ns, 1), message.ts1)  # with 0 it would be a request
        if message.ts1 not in self._outstanding:
            return None
        self._outstanding.remove(message.ts1)
        self._take_answer(message, arrival_ns)
        return None

    def to_companion_ns(self, fc_ns: int, arrival_ns: int, mean_period_ns: int) -> int:
        """Return the companion's time of a stamp of the autopilot's.

        Args:
            arrival_ns: when the message arrived; while there is no offset, the result is half a period before it.
            mean_period_ns: of messages of this kind.
        """
        offset_ns = self.offset_ns
        return arrival_ns - mean_period_ns // 2 if offset_ns is None else fc_ns + offset_ns

    def _best(self) -> _Sample | None:
        return min(tuple(self._samples), key=lambda sample: sample.round_trip_ns, default=None)

    def _take_answer(self, message: TIMESYNC, arrival_ns: int) -> None:
        round_trip_ns = arrival_ns - message.ts1
        if not 0 <= round_trip_ns <= MAX_ROUND_TRIP_NS:
            return
        sample = _Sample(round_trip_ns, message.ts1 + round_trip_ns // 2 - message.tc1)
        best = self._best() or sample
        uncertainty_ns = (sample.round_trip_ns + best.round_trip_ns) // 2 + _DRIFT_NS
        if abs(sample.offset_ns - best.offset_ns) > uncertainty_ns:
            # One of the clocks has been set or restarted, as a rebooted autopilot's has.
            self._samples.clear()
        self._samples.append(sample)
