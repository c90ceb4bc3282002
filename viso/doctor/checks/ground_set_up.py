# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's set-up for flow and ranges, and when it flew, for the checks of both."""

from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.ground_sensors import FLOW, FlowSeries, RangeFinder, RangeSeries, UnreadFlow, finders_in
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import Bools, Floats, Ints

FLOW_BIT: Final = 11
CTUN_BIT: Final = 4
"""Bits of LOG_BITMASK, Copter's; ranges are logged with what the throttle controller does."""


def known_param(evidence: Evidence, name: str) -> float | None:
    """Return a parameter from the recording or the user; None if it is not known.

    EK3_ parameters have their defaults. Other parameters that a complete list lacks are 0, as the vehicle lacks them.
    """
    value = evidence.set_up.known.get(name)
    if value is None and name.startswith("EK3_"):
        value = evidence.trial.params.get(name)
    return 0.0 if value is None and evidence.set_up.is_complete else value


def range_finders(evidence: Evidence) -> list[RangeFinder] | None:
    """Return the range finders that are set up; None if that is not known."""
    if not any(name.startswith("RNGFND") for name in evidence.set_up.known) and not evidence.set_up.is_complete:
        return None
    return finders_in(evidence.set_up.known)


def is_recorded(evidence: Evidence, bit: int) -> bool:
    """Return whether the recording would hold a sensor's data: for a log by LOG_BITMASK, for a stream always."""
    if evidence.vehicle_witness is not Witness.LOG:
        return bool(evidence.stream.messages) or evidence.vehicle_witness is Witness.TELEMETRY
    return bool(int(evidence.set_up.known.get("LOG_BITMASK", 0.0)) >> bit & 1)


def not_heard(evidence: Evidence, sensor: str, severity: Severity | None) -> tuple[str, Severity | None] | None:
    """Return text and severity for a sensor, FLOW or RANGE, that is not in the recording; None if it may be well."""
    is_healthy = evidence.vehicle.ground.health.get(sensor)
    if not is_recorded(evidence, FLOW_BIT if sensor == FLOW else CTUN_BIT) or is_healthy:
        return None
    if is_healthy is not None:
        return f"; SYS_STATUS calls the {sensor} unhealthy throughout", severity
    # It may have another link than the one that was recorded.
    return "", Severity.WARNING if evidence.vehicle_witness is Witness.TELEMETRY else severity


Records = FlowSeries | RangeSeries | UnreadFlow


def in_records(
    text: str, series: Records, mask: object, severity: Severity | None = None, fix: str | None = None
) -> Sighting:
    """Return what the masked records of a sensor show, one at least."""
    chosen = np.flatnonzero(np.asarray(mask))
    times = series.time_us[chosen]
    numbers = series.numbers[chosen].tolist() if len(series.numbers) else []
    return Sighting(f"{named(series)}: {text}", numbers, int(times[0]), int(times[-1]), fix, severity)


def named(series: Records) -> str:
    """Return the name of a sensor in findings."""
    if isinstance(series, RangeSeries) and series.origin in ("RFND", "RRNI"):
        return f"{series.origin} {series.instance}"
    return series.origin


def above_start_m(evidence: Evidence, time_us: Ints) -> Floats:
    """Return the vehicle's height above its start, from other sources than ranges; NaN where it is not known.

    If the vehicle reports no height, those of the stream's first poses count.
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


def is_flight_known(evidence: Evidence) -> bool:
    """Return whether the recording tells when the vehicle was armed."""
    own = evidence.vehicle.own_filter
    return own is not None and own.armed is not None


def is_never_armed(evidence: Evidence) -> bool:
    """Return whether the vehicle is known to be disarmed all the time."""
    own = evidence.vehicle.own_filter
    return own is not None and own.armed == ()


def is_in_flight(evidence: Evidence, time_us: Ints) -> Bools:
    """Return at which times the vehicle was armed and off the ground; always, if it is not known whether it armed."""
    own = evidence.vehicle.own_filter
    armed = np.ones(len(time_us), np.bool_)
    if own is not None and own.armed is not None:
        armed = np.zeros(len(time_us), np.bool_)
        for start, end in own.armed:
            armed |= (time_us >= 1e6 * start) & (time_us <= 1e6 * end)
        height = above_start_m(evidence, time_us)
        armed &= ~(height < limits.FLYING_M)
    return armed
