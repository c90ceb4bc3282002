# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Evidence made of messages alone, without a trial: for checks that look at what is sent."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np

from ap_core.verdict import Verdict
from ap_visualodom.verdicts import CONSUMED
from ekf_stub.reports import AidingMode
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE, Message
from viso.doctor import CHECKS, Evidence, Finding, HandledMessage, diagnose
from viso.doctor.evidence.compare import compare
from viso.doctor.evidence.set_up import SetUp
from viso.doctor.evidence.stream_data import stream_data
from viso.doctor.evidence.trial import Trial
from viso.doctor.evidence.vehicle_data import AttitudeSeries, VehicleData
from viso.firmware.flown import JudgedBy
from viso.firmware.releases import JULY_2025
from viso.streams.stream_kinds import Stream
from viso.vehicle.outcomes import AidingSpan
from viso.vehicle.vehicle import Vehicle, VehicleConfig

SETUP: Final[Mapping[str, float]] = {
    "VISO_TYPE": 1,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 6,
    "EK3_SRC1_YAW": 6,
}
START_US: Final = 10_000_000


@cache
def default_params() -> Mapping[str, float]:
    """Return every parameter's default."""
    vehicle = Vehicle(VehicleConfig())
    return {slot.name: float(slot.value) for group in vehicle.params.groups for slot in group.slots}


def pose(stamp_us: int, **fields: Any) -> VISION_POSITION_ESTIMATE:
    """Return a pose at rest, level, heading north."""
    values = {**dict.fromkeys(("x", "y", "z", "roll", "pitch", "yaw"), 0.0), **fields}
    return VISION_POSITION_ESTIMATE(stamp_us, **values)


def speed(stamp_us: int, **fields: Any) -> VISION_SPEED_ESTIMATE:
    """Return a velocity of zero."""
    return VISION_SPEED_ESTIMATE(stamp_us, **{**dict.fromkeys("xyz", 0.0), **fields})


def seen(number: int, arrival_us: int, message: Message, verdict: Verdict = CONSUMED, **fields: Any) -> HandledMessage:
    """Return a message of 1/197 that came with the sequence number of its own number."""
    values: dict[str, Any] = {"system_id": 1, "component_id": 197, "sequence": number % 256, "version": 2}
    values |= {"name": type(message).__name__, "frame": b"%d" % number, "records": (), "samples": (), **fields}
    return HandledMessage(number=number, arrival_us=arrival_us, message=message, verdict=verdict, **values)


def evidence_of(
    messages: Sequence[HandledMessage],
    params: Mapping[str, float] | None = None,
    attitude: AttitudeSeries | None = None,
    **fields: Any,
) -> Evidence:
    """Return evidence of messages, with parameters that fit unless told otherwise."""
    all_params = {**default_params(), **SETUP, **(params or {})}
    with np.errstate(all="ignore"):
        return _evidence(messages, all_params, attitude, fields)


def _evidence(
    messages: Sequence[HandledMessage],
    all_params: Mapping[str, float],
    attitude: AttitudeSeries | None,
    fields: Mapping[str, Any],
) -> Evidence:
    sent = stream_data(Stream("made", ()), tuple(messages))
    aiding = (AidingSpan(0, START_US, AidingMode.NONE), AidingSpan(START_US, 2 * START_US, AidingMode.ABSOLUTE))
    made = Evidence(
        stream=sent,
        vehicle=VehicleData(attitude=attitude),
        set_up=SetUp(JudgedBy(JULY_2025, "it is the reference"), is_complete=True),
        trial=Trial(all_params, aiding=aiding),
        comparisons=compare(sent.poses, sent.vision, attitude, all_params),
    )
    return changed(made, **fields)


def changed(evidence: Evidence, **fields: Any) -> Evidence:
    """Return evidence with other values of some fields of it or its parts; ``params`` and ``texts`` are the trial's."""
    own = {field.name for field in dataclasses.fields(evidence)}
    whole = {name: fields.pop(name) for name in own & fields.keys()}
    for part in ("trial", "stream", "set_up", "vehicle"):
        value = whole.get(part, getattr(evidence, part))
        of_part = {field.name for field in dataclasses.fields(value)} & fields.keys()
        whole[part] = replace(value, **{name: fields.pop(name) for name in of_part})
    assert not fields, fields
    return replace(evidence, **whole)


def stream_of(messages: Sequence[Message], period_us: int = 40_000) -> list[HandledMessage]:
    """Return messages that came at a steady rate."""
    return [seen(number + 1, START_US + number * period_us, message) for number, message in enumerate(messages)]


def seen_in(stream: Stream) -> list[HandledMessage]:
    """Return the messages of a stream as if every one had been accepted."""
    codec, found = Codec(0, 0), list[HandledMessage]()
    for one in stream.messages:
        codec.feed(one.frame)
        while (received := codec.next_received()) is not None:
            if isinstance(received, Received) and received.message is not None:
                header = received.header
                fields: dict[str, Any] = {
                    "system_id": header.system_id,
                    "component_id": header.component_id,
                    "sequence": header.sequence,
                    "version": header.version,
                    "frame": header.frame,
                }
                found.append(seen(len(found) + 1, one.arrival_us or 0, received.message, **fields))
    return found


class Found(Mapping[str, Finding]):
    """What is found by code, the last of each; a check runs when its code is asked for: none depends on another."""

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence

    def __getitem__(self, code: str) -> Finding:
        found = diagnose(self._evidence, [check for check in CHECKS if check.code == code])
        if not found:
            raise KeyError(code)
        return found[-1]

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(finding.code for finding in diagnose(self._evidence, CHECKS)))

    def __len__(self) -> int:
        return len(list(iter(self)))


def findings_of(evidence: Evidence) -> Found:
    """Return what is found."""
    return Found(evidence)
