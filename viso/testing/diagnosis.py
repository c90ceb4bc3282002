# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The doctor's look at what a test has sent."""

from collections.abc import Collection, Sequence

import numpy as np

from viso.doctor import CHECKS, Finding, Severity, diagnose, gather
from viso.doctor.evidence.vehicle_data import AttitudeSeries, HeightSeries, VehicleData
from viso.doctor.evidence.vehicle_position import PositionSeries
from viso.firmware.releases import Firmware
from viso.streams.stream import Stream
from viso.testing.observer import Observer
from viso.vehicle.vehicle import Vehicle

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is


def findings_in(observer: Observer, vehicle: Vehicle, firmware: Firmware) -> list[Finding]:
    """Return what the doctor finds in what was sent to a vehicle, tried again on one with the same parameters."""
    params = {param.name: float(param.value) for param in vehicle.params}
    stream = Stream("what was sent", tuple(observer.sent), params)
    return diagnose(gather(stream, vehicle=_truth(observer), firmware=firmware), CHECKS)


def _truth(observer: Observer) -> VehicleData:
    """Return the vehicle's own motion, if it flew."""
    if not observer.truths:
        return VehicleData()
    time_us = np.array([time_us for time_us, _ in observer.truths])
    time_us, first = np.unique(time_us, return_index=True)
    ned_m = np.array([state.pos for _, state in observer.truths])[first]
    attitude = AttitudeSeries(time_us, np.array([state.rpy for _, state in observer.truths])[first], "truth")
    height, position = HeightSeries(time_us, ned_m[:, 2]), PositionSeries("truth", time_us, ned_m)
    return VehicleData(attitude=attitude, height=height, position=position)


def check_no_findings(findings: Sequence[Finding], least: str, but: Collection[str]) -> None:
    """Raise AssertionError, with evidence and what to change, for findings of ``least`` or worse but some codes.

    Raises ValueError if there is no such severity or code.
    """
    if least not in list(Severity):
        raise ValueError(f"least {least!r}: not one of {', '.join(Severity)}")
    if unknown := sorted(set(but) - {check.code for check in CHECKS}):
        raise ValueError(f"but: no such code: {', '.join(unknown)}")
    counting = [one for one in findings if one.severity.at_least(Severity(least)) and one.code not in but]
    if counting:
        rows = [f"{one.severity.value} {one.code} {one.title}: {one.evidence}\n  fix: {one.fix}" for one in counting]
        raise AssertionError(f"expected no findings of the doctor, but {len(rows)}:\n" + "\n".join(rows))
