# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pieces of recorded flights, clean or with faults of a timeline, and what the doctor says of them."""

from collections.abc import Mapping
from functools import cache
from typing import Final

import numpy as np

from mav_handlers.wire.codec import Codec, Received
from tests.places import RECORDED
from viso.doctor import CHECKS, Evidence, Finding, Severity, VehicleData, diagnose, gather
from viso.doctor.evidence.vehicle_data import AttitudeSeries, HeightSeries, vehicle_of_log
from viso.faults import inject, parse_timeline
from viso.streams.stream_kinds import Stream, StreamMessage, read_stream

LEAD_US: Final = 6_500_000
"""When pieces begin: the vehicle of the trial stands still for 6 s."""

SETUP: Final[Mapping[str, float]] = {
    "GPS1_TYPE": 0,
    "VISO_TYPE": 1,
    "VISO_DELAY_MS": 10,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 6,
    "EK3_SRC1_YAW": 6,
}
VISION: Final = frozenset({"ODOMETRY", "VISION_POSITION_ESTIMATE", "VISION_SPEED_ESTIMATE"})


@cache
def recording(name: str) -> Stream:
    """Return a capture."""
    return read_stream(RECORDED / "captures" / f"{name}.jsonl.gz", 0)


@cache
def log_of(name: str) -> tuple[AttitudeSeries, HeightSeries | None]:
    """Return attitude and height in the log of a capture."""
    vehicle = vehicle_of_log(RECORDED / "logs" / f"{name}.BIN.xz")
    assert vehicle.attitude is not None
    return vehicle.attitude, vehicle.height


@cache
def piece(name: str, start_s: float, length_s: float, every: int = 1) -> Stream:
    """Return external navigation out of a capture, from a time since boot on; with ``every``, of n poses one."""
    start_us, end_us = int(start_s * 1e6), int((start_s + length_s) * 1e6)
    codec, messages, stamps = Codec(1, 197), [], set[int]()
    reader = Codec(0, 0)
    for message in recording(name).messages:
        reader.feed(message.frame)
        received = reader.next_received()
        if message.arrival_us is None or not start_us <= message.arrival_us < end_us:
            continue
        if isinstance(received, Received) and received.message is not None and received.header.name in VISION:
            stamps.add(int(getattr(received.message, "usec", 0) or getattr(received.message, "time_usec", 0)))
            if len(stamps) % every == 0:
                arrival_us = message.arrival_us - start_us + LEAD_US
                messages.append(StreamMessage(arrival_us, codec.encode(received.message)))
    return Stream(name, tuple(messages), SETUP)


def faulty(stream: Stream, faults: str, seed: int = 1) -> Stream:
    """Return a stream with the faults of a timeline, given as the list in YAML."""
    timeline = parse_timeline(f"faults: [{faults}]")
    frames = [(message.arrival_us or 0, message.frame) for message in stream.messages]
    changed = sorted(inject(frames, timeline, seed), key=lambda timed: timed[0])
    return Stream(stream.name, tuple(StreamMessage(at, frame) for at, frame in changed), stream.params)


def shifted(name: str, start_s: float, *, delay_s: float = 0.0) -> VehicleData:
    """Return attitude and height that the vehicle's log holds for a piece."""
    attitude, height = log_of(name)
    by_us = LEAD_US - int(start_s * 1e6) - int(delay_s * 1e6)
    moved_height = None if height is None else HeightSeries(height.time_us + by_us, height.down_m)
    series = AttitudeSeries(attitude.time_us + by_us, np.asarray(attitude.euler_rad))
    keep = series.time_us > 0
    return VehicleData(attitude=AttitudeSeries(series.time_us[keep], series.euler_rad[keep]), height=moved_height)


def examine(stream: Stream, vehicle: VehicleData | None = None) -> tuple[Evidence, list[Finding]]:
    """Return what the doctor finds."""
    evidence = gather(stream, vehicle=vehicle or VehicleData())
    return evidence, diagnose(evidence, CHECKS)


def codes(findings: list[Finding], least: Severity = Severity.NOTE) -> set[str]:
    """Return the codes of findings of a severity or worse."""
    return {finding.code for finding in findings if finding.severity.at_least(least)}
