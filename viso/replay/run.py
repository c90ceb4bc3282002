# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A replay from the first message to the last, and its outcome."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.measurements import FlowMeasurement
from mav_handlers.handlers import VISION_NAMES
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.logger import LogSink
from viso.replay.feed import Replay, ReplayedMessage
from viso.streams.stream_kinds import Stream
from viso.terminal.console import VerdictCounts, reason_of
from viso.vehicle.outcomes import (
    AidingSpan,
    FilterCounts,
    FilterWatch,
    Innovations,
    OutcomeKind,
    final_counts,
    outcome_kind,
    what_became,
)
from viso.vehicle.vehicle import Vehicle, VehicleConfig


class SaidText(NamedTuple):
    """A text of the vehicle: time in us since boot, MAV_SEVERITY and text."""

    time_us: int
    severity: int
    text: str


@dataclass(frozen=True)
class ReplaySetup:
    """How to replay a stream: ``baud`` is the rate of the UART whose transport time is modelled; None for none.

    The AHRS has a filter if the filter is to be recorded.
    """

    make_ahrs: Callable[[Vehicle], AhrsBase]
    baud: int | None = None
    with_filter: bool = False
    firmware: Firmware = DEFAULT


@dataclass(frozen=True)
class ReplayOutcome:
    """The outcome of a replay.

    Attributes:
        verdicts: number of messages by type and verdict.
        filter_counts: number of samples by the filter's decision.
        params: the vehicle's parameters at the end, by name.
        unknown_params: those of the settings that it does not have.
        innovations: of samples that the filter tested; None without a filter.
        aiding: the filter's aiding over time; None without a filter.
        messages: the outcome of each, if they are kept.
        flow: what the flow sensor of OPTICAL_FLOW measured, if messages are kept.
        notes: where the estimates of a log come from, and parts of the stream that were not run, a line each.
    """

    verdicts: VerdictCounts
    texts: tuple[SaidText, ...]
    filter_counts: FilterCounts
    params: Mapping[str, float]
    unknown_params: tuple[str, ...]
    innovations: Mapping[str, Innovations] | None = None
    aiding: tuple[AidingSpan, ...] | None = None
    messages: tuple[ReplayedMessage, ...] = field(default=(), repr=False)
    notes: tuple[str, ...] = ()
    flow: tuple[FlowMeasurement, ...] = field(default=(), repr=False)


def why_nothing_fused(outcome: ReplayOutcome) -> str:
    """Return the outcome of most samples, or of most messages if none had a sample; empty if one was fused."""
    outcomes = final_counts(outcome.filter_counts)
    if any(outcome_kind(rule) is OutcomeKind.FUSED for _, rule, _ in outcomes):
        return ""
    if outcomes:
        kind, rule, count = max(outcomes, key=lambda row: row[2])
        return f"{count} samples of {kind} {what_became(rule)}"
    messages = {key: count for key, count in outcome.verdicts.items() if key[0] in VISION_NAMES}
    if not messages:
        return "no message of external navigation came"
    (name, verdict, code), count = max(messages.items(), key=lambda row: row[1])
    return f"{count} {name} {verdict.value}: {reason_of(code)}"


def run_replay(
    stream: Stream,
    settings: Mapping[str, float],
    setup: ReplaySetup,
    *,
    open_log: Callable[[], LogSink] | None = None,
    on_message: Callable[[ReplayedMessage], None] | None = None,
    on_progress: Callable[[int], None] = lambda _count: None,
    keep_messages: bool = False,
    on_start: Callable[[Vehicle, FilterWatch | None], None] = lambda _vehicle, _watch: None,
    on_sent: Callable[[bytes], None] | None = None,
) -> ReplayOutcome:
    """Replay a stream into a fresh vehicle, whose parameters are ``settings`` from boot on.

    ``open_log`` opens its DataFlash log. ``on_message`` is called with each message once its outcome is known,
    ``on_progress`` with the number of messages fed, ``on_start`` with the vehicle and the observer of its filter before
    the first message, and ``on_sent`` with the vehicle's output. The outcome has the messages if they are kept.
    """
    config = VehicleConfig(setup.make_ahrs, defaults=settings, open_log=open_log, firmware=setup.firmware)
    vehicle = Vehicle(config)
    watch = FilterWatch(vehicle) if setup.with_filter else None
    texts: list[SaidText] = []
    vehicle.texts.on_text.append(
        lambda severity, text: texts.append(SaidText(vehicle.clock.micros64(), severity, text))
    )
    kept: list[ReplayedMessage] = []
    flow: list[FlowMeasurement] = []
    if keep_messages:
        vehicle.flow.on_measured = flow.append
    on_start(vehicle, watch)
    try:
        replay = Replay(vehicle, stream, setup.baud, watch, on_sent=on_sent)
        for message in replay.run(on_progress):
            if on_message is not None:
                on_message(message)
            if keep_messages:
                kept.append(message)
    finally:
        vehicle.close()
    return ReplayOutcome(
        vehicle.endpoint.verdict_counts(),
        tuple(texts),
        vehicle.ahrs.ext_nav_counts,
        {param.name: float(param.value) for param in vehicle.params},
        vehicle.unknown_defaults,
        None if watch is None else watch.innovations,
        None if watch is None else tuple(watch.aiding()),
        tuple(kept),
        (*vehicle.ahrs.notes, *replay.notes()),
        tuple(flow),
    )
