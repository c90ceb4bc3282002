# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the sender's clock and of what it writes into the time stamp."""

import enum
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

from viso.faults.fault import ContentFault, Moment, parameter

_STAMPS: Final = ("usec", "time_usec")
_LATEST_US: Final = 2**64 - 1


class StampUnit(enum.StrEnum):
    """What is in a stamp that should be in us."""

    SECONDS = "s"
    MILLISECONDS = "ms"
    NANOSECONDS = "ns"


def stamp_of(message: Any) -> int | None:
    """Return the time stamp of a message in us, None if it has none."""
    return next((getattr(message, name) for name in _STAMPS if hasattr(message, name)), None)


def with_stamp(message: Any, stamp_us: int) -> Any:
    """Return a message that has a stamp with another; it stays within 64 bits."""
    name = next(name for name in _STAMPS if hasattr(message, name))
    return replace(message, **{name: min(max(stamp_us, 0), _LATEST_US)})


def shifted(message: Any, by_us: float) -> Any:
    """Return a message with its stamp moved, None if it has none."""
    stamp_us = stamp_of(message)
    return None if stamp_us is None else with_stamp(message, stamp_us + round(by_us))


@dataclass(slots=True)
class ClockStep(ContentFault):
    """The sender's clock steps.

    Attributes:
        step_ms: how far, back if negative.
    """

    lasts: ClassVar[bool] = True
    step_ms: float = parameter(1000.0, -1e12, 1e12)

    def change(self, message: Any, moment: Moment) -> Any:
        return shifted(message, self.step_ms * 1e3)


@dataclass(slots=True)
class ClockDrift(ContentFault):
    """The sender's clock runs too fast or too slow.

    Attributes:
        drift_ppm: by how many us in a second, too slow if negative.
    """

    lasts: ClassVar[bool] = True
    drift_ppm: float = parameter(100.0, -1e8, 1e8)

    def change(self, message: Any, moment: Moment) -> Any:
        return shifted(message, moment.since_s * self.drift_ppm)


_CONVERSIONS: Final[dict[StampUnit, Callable[[int], int]]] = {
    StampUnit.SECONDS: lambda time_us: time_us // 1_000_000,
    StampUnit.MILLISECONDS: lambda time_us: time_us // 1000,
    StampUnit.NANOSECONDS: lambda time_us: time_us * 1000,
}


@dataclass(slots=True)
class StampInUnit(ContentFault):
    """The stamp is in another unit than us.

    Attributes:
        unit: what it is in.
    """

    unit: StampUnit = StampUnit.MILLISECONDS

    def change(self, message: Any, moment: Moment) -> Any:
        stamp_us = stamp_of(message)
        return None if stamp_us is None else with_stamp(message, _CONVERSIONS[self.unit](stamp_us))


@dataclass(slots=True)
class StampConstant(ContentFault):
    """The stamp is always the same.

    Attributes:
        stamp_us: what it is.
    """

    stamp_us: int = parameter(0, 0, _LATEST_US)

    def change(self, message: Any, moment: Moment) -> Any:
        return None if stamp_of(message) is None else with_stamp(message, self.stamp_us)
