# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows the filter of a vehicle: what it made of samples, how far off they were, and when it navigated by what."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs.ingest_rules import FilterOutcome
from ekf_stub.reports import AidingMode
from viso.vehicle.outcomes.labels import Fate, fate_of
from viso.vehicle.vehicle import Vehicle

UNITS: Final = {"pose": "m", "height": "m", "yaw": "deg", "velocity": "m/s", "odometry": "m/s"}
"""Of innovations, by kind of sample."""
_REJECTED: Final = Fate.REJECTED  # in Python 3.11 it takes 0.1 us to look up a member of an enumeration


class SampleTest(NamedTuple):
    """A sample that the filter decided about, and when, us since boot."""

    time_us: int
    outcome: FilterOutcome


class AidingSpan(NamedTuple):
    """How the filter navigated from a time in us since boot on, to another."""

    start_us: int
    end_us: int
    mode: AidingMode


@dataclass(slots=True)
class Innovations:
    """What is known of a kind of sample: how many were tested and rejected, and how far off they were."""

    tested: int = 0
    rejected: int = 0
    worst: float = 0.0
    worst_ratio: float = 0.0
    _squares: float = 0.0

    def add(self, innovation: float, ratio: float, *, is_rejected: bool) -> None:
        """Count a sample that was tested."""
        self.tested += 1
        self.rejected += is_rejected
        if innovation > self.worst:
            self.worst = innovation
        if ratio > self.worst_ratio:
            self.worst_ratio = ratio
        self._squares += innovation**2

    @property
    def rms(self) -> float:
        """The root of the mean square."""
        return math.sqrt(self._squares / self.tested) if self.tested else 0.0


class FilterWatch:
    """Follows a vehicle's filter; all that it says is a model's.

    Args:
        vehicle: fresh, and with a filter.

    Attributes:
        listeners: hear of each sample.
        lookers: are called whenever it looks how the filter navigates.
        innovations: by kind, of the samples that were tested.

    Raises:
        ValueError: the vehicle follows a log in place of a filter.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        if not isinstance(vehicle.ahrs, Ekf3Ahrs):
            raise ValueError("a vehicle without a filter")
        self._clock = vehicle.clock
        self._ahrs = vehicle.ahrs
        self._ahrs.on_filter_outcome = self._take
        self._modes = [(0, AidingMode.NONE)]
        self._end_us: int | None = None
        self.listeners: list[Callable[[SampleTest], None]] = []
        self.lookers: list[Callable[[], None]] = []
        self.innovations: dict[str, Innovations] = {}

    def _take(self, outcome: FilterOutcome) -> None:
        kind, rule, _, ratio, innovation = outcome
        if ratio is not None and innovation is not None:
            of_kind = self.innovations.get(kind) or self.innovations.setdefault(kind, Innovations())
            of_kind.add(innovation, ratio, is_rejected=fate_of(rule) is _REJECTED)
        test = SampleTest(self._clock.micros64(), outcome)
        for listener in self.listeners:
            listener(test)

    def look(self) -> None:
        """Look how the filter navigates; to be called after each pass of the main loop."""
        mode = self.mode()
        if mode is not self._modes[-1][1]:
            self._modes.append((self._clock.micros64(), mode))
        for look in self.lookers:
            look()

    def end(self) -> None:
        """Let the filter run no further, and watch no more."""
        self._ahrs.stop()
        self._end_us = self._clock.micros64()

    def mode(self) -> AidingMode:
        """Return how the filter navigates."""
        return self._ahrs.aiding_mode()

    def aiding(self) -> list[AidingSpan]:
        """Return how the filter has navigated, from boot until now, or until it ended."""
        end_us = self._clock.micros64() if self._end_us is None else self._end_us
        ends = [*(time_us for time_us, _ in self._modes[1:]), end_us]
        return [AidingSpan(start_us, end_us, mode) for (start_us, mode), end_us in zip(self._modes, ends, strict=True)]
