# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How a vehicle is set up for flow and ranges, and when it flew: what the rules about both ask for."""

from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.ground_sensors import FLOW, FlowSeries, RangeFinder, RangeSeries, finders_in
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import Bools, Floats, Ints

FLOW_BIT: Final = 11
CTUN_BIT: Final = 4
"""Bits of LOG_BITMASK, Copter's; ranges are logged with what the throttle controller does."""


def told(evidence: Evidence, name: str) -> float | None:
    """Return a parameter by what the recording or the user told; None if nobody knows.

    One of the filter's has its default where it is not told, any other of a whole list is 0: the vehicle lacks it.
    """
    value = evidence.set_up.known.get(name)
    if value is None and name.startswith("EK3_"):
        value = evidence.trial.params.get(name)
    return 0.0 if value is None and evidence.set_up.is_complete else value


def range_finders(evidence: Evidence) -> list[RangeFinder] | None:
    """Return the range finders that are set up; None if nobody tells."""
    if not any(name.startswith("RNGFND") for name in evidence.set_up.known) and not evidence.set_up.is_complete:
        return None
    return finders_in(evidence.set_up.known)


def is_recorded(evidence: Evidence, bit: int) -> bool:
    """Return whether the recording would hold what a sensor says: a log by LOG_BITMASK, a stream if it is one."""
    if evidence.vehicle_witness is not Witness.LOG:
        return bool(evidence.stream.messages) or evidence.vehicle_witness is Witness.TELEMETRY
    return bool(int(evidence.set_up.known.get("LOG_BITMASK", 0.0)) >> bit & 1)


def unheard(evidence: Evidence, sensor: str, severity: Severity | None) -> tuple[str, Severity | None] | None:
    """Return what SYS_STATUS says of FLOW or RANGE, of which nothing is heard, and how bad that is; None if no sign."""
    is_healthy = evidence.vehicle.ground.health.get(sensor)
    if not is_recorded(evidence, FLOW_BIT if sensor == FLOW else CTUN_BIT) or is_healthy:
        return None
    if is_healthy is not None:
        return f"; SYS_STATUS calls the {sensor} unhealthy throughout", severity
    # It may have another link than the one that was recorded.
    return "", Severity.WARNING if evidence.vehicle_witness is Witness.TELEMETRY else severity


def seen(text: str, one: FlowSeries | RangeSeries, mask: object, severity: Severity | None = None) -> Sighting:
    """Return what some of a sensor's records show, one at least."""
    chosen = np.flatnonzero(np.asarray(mask))
    times = one.time_us[chosen]
    numbers = one.numbers[chosen].tolist() if len(one.numbers) else []
    return Sighting(f"{named(one)}: {text}", numbers, int(times[0]), int(times[-1]), severity=severity)


def named(one: FlowSeries | RangeSeries) -> str:
    """Return how findings call a sensor."""
    if isinstance(one, RangeSeries) and one.origin in ("RFND", "RRNI"):
        return f"{one.origin} {one.instance}"
    return one.origin


def above_start_m(evidence: Evidence, time_us: Ints) -> Floats:
    """Return how high the vehicle is above its start, by what does not come from a range; NaN where nothing tells.

    Where the vehicle tells no height, the stream's first poses do.
    """
    series = evidence.vehicle.level or evidence.vehicle.height
    if series is not None:
        known_us, down_m = series.time_us, series.down_m
    elif evidence.stream.poses:
        known_us, down_m = evidence.stream.poses[0].track.arrival_us, evidence.stream.poses[0].pos_m[:, 2]
    else:
        return np.full(len(time_us), np.nan)
    if not len(known_us):
        return np.full(len(time_us), np.nan)
    start = float(np.median(down_m[: max(1, len(down_m) // 50)]))
    down = np.interp(time_us, known_us, down_m, left=np.nan, right=np.nan)
    return np.asarray(start - down, dtype=np.float64)


def is_in_flight(evidence: Evidence, time_us: Ints) -> Bools:
    """Return at which times the vehicle was armed, and not on the ground, as far as anybody knows."""
    own = evidence.vehicle.own_filter
    armed = np.ones(len(time_us), np.bool_)
    if own is not None and own.armed:
        armed = np.zeros(len(time_us), np.bool_)
        for start, end in own.armed:
            armed |= (time_us >= 1e6 * start) & (time_us <= 1e6 * end)
        height = above_start_m(evidence, time_us)
        armed &= ~(height < limits.FLYING_M)
    return armed
