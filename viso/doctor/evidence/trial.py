# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The trial of a stream: a vehicle in virtual time that moves as the stream says, and gets its messages."""

import math
from collections import deque
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from typing import Final

from ap_visualodom.verdicts import CONSUMED
from mav_handlers.endpoint import MessageEvent
from mav_handlers.handlers import VISION_NAMES
from mav_handlers.verdicts import OWN_MESSAGE
from mav_handlers.wire.codec import Header, sound_header
from viso.doctor.evidence.set_up import SetUp
from viso.doctor.evidence.tracks import HandledMessage
from viso.errors import InputError
from viso.replay.feed import Replay, ReplayedMessage
from viso.streams.heard import MAV_COMP_ID_AUTOPILOT1
from viso.streams.stream import StreamMessage, received_in, timed_frames
from viso.streams.stream_kinds import Stream
from viso.vehicle.config import by_ekf3
from viso.vehicle.outcomes import AidingSpan, FilterWatch, Innovations
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource
from viso.vehicle.vehicle import Vehicle, VehicleConfig

_NO_TELEMETRY: Final = {0: dict.fromkeys(range(500), 0)}
"""Nobody listens to the vehicle of a trial."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What the vehicle of the trial did, beside its verdicts on messages.

    Attributes:
        params: every parameter at boot, defaults included.
        texts: of the emulated autopilot: time in us since boot, severity, text.
        aiding: by what the filter navigated, a model's opinion.
        innovations: by kind of sample, likewise.
        model_jumps: how many jumps without a reset the imagined vehicle that follows the stream saw in it.
        filter_until_us: until when the filter ran, us since boot; None if all the way.
        notes: on what of the stream was not run.
    """

    params: Mapping[str, float]
    texts: tuple[tuple[int, int, str], ...] = ()
    aiding: tuple[AidingSpan, ...] = ()
    innovations: Mapping[str, Innovations] = field(default_factory=dict)
    model_jumps: int = 0
    filter_until_us: int | None = None
    notes: tuple[str, ...] = ()


def run_trial(
    stream: Stream,
    set_up: SetUp,
    *,
    heading_rad: float,
    heeds_stamps: bool,
    baud: int | None,
    filter_s: float,
    on_progress: Callable[[int], None],
) -> tuple[tuple[HandledMessage, ...], Trial]:
    """Feed a stream to a vehicle that follows it; return the messages as it handled them, and the trial.

    Args:
        stream: to be tried.
        set_up: of the vehicle.
        heading_rad: where it points at first.
        heeds_stamps: whether it follows the stamps of messages, rather than the times of their arrival.
        baud: rate of the link's transport-time model; None for a link without delay.
        filter_s: for how long the filter is run, from the first message of external navigation on.
        on_progress: gets the number of messages fed so far.

    Raises:
        InputError: a parameter has a value that it cannot take.
    """
    make_ahrs = by_ekf3(partial(FollowSource, heeds_stamps=heeds_stamps), ImuOptions(heading_rad=heading_rad))
    vehicle = _vehicle(
        stream,
        VehicleConfig(make_ahrs, defaults=set_up.params, firmware=set_up.firmware, message_intervals=_NO_TELEMETRY),
    )
    params = _params_of(vehicle)
    watch = FilterWatch(vehicle)
    texts: list[tuple[int, int, str]] = []
    vehicle.texts.on_text.append(lambda severity, text: texts.append((vehicle.clock.micros64(), severity, text)))
    filter_until_us = _filter_until_us(stream, filter_s)
    own = _own_telemetry(stream, vehicle.params.get_int(set_up.firmware.endpoint.params.system_id))
    replay = Replay(vehicle, _without_bytes(stream, own), baud, watch, filter_until_us)
    messages: list[HandledMessage] = []
    events: deque[tuple[int, MessageEvent]] = deque()
    numbers = count(1)
    on_event = vehicle.endpoint.on_event

    def take_event(event: MessageEvent) -> None:
        events.append((next(numbers), event))
        if on_event is not None:
            on_event(event)

    def take_own(fed: int) -> None:
        if (header := own.get(fed - 1)) is not None:
            messages.append(_own(next(numbers), vehicle.clock.micros64(), header))
        on_progress(fed)

    vehicle.endpoint.on_event = take_event
    for outcome in replay.run(take_own):
        messages.append(_handled(*events.popleft(), outcome))
    vehicle.close()
    messages.sort(key=lambda message: message.number)
    assert isinstance(vehicle.source, FollowSource)
    jumps = vehicle.source.jumps
    trial = Trial(
        params=params,
        texts=tuple(texts),
        aiding=tuple(watch.aiding()),
        innovations=dict(watch.innovations),
        model_jumps=jumps["position"] + jumps["yaw"],
        filter_until_us=filter_until_us,
        notes=replay.notes(),
    )
    return tuple(messages), trial


def without_trial(stream: Stream, set_up: SetUp) -> tuple[tuple[HandledMessage, ...], Trial]:
    """Return the messages of a stream as if every one had been accepted, and a trial in which no filter ran."""
    messages: list[HandledMessage] = []
    times_us = [time_us for time_us, _ in timed_frames(stream)]
    for place, received in received_in(stream):
        header = received.header
        ids = header.system_id, header.component_id, header.sequence, header.version, header.name
        messages.append(
            HandledMessage(len(messages) + 1, times_us[place], *ids, received.message, header.frame, CONSUMED, (), ())
        )
    return tuple(messages), Trial(
        _params_of(_vehicle(stream, VehicleConfig(defaults=set_up.params, firmware=set_up.firmware)))
    )


def _vehicle(stream: Stream, config: VehicleConfig) -> Vehicle:
    try:
        return Vehicle(config)
    except ValueError as error:
        raise InputError(f"{stream.name}: {error}") from error


def _params_of(vehicle: Vehicle) -> dict[str, float]:
    return {slot.name: float(slot.value) for group in vehicle.params.groups for slot in group.slots}


def _filter_until_us(stream: Stream, filter_s: float) -> int | None:
    """Return until when the filter runs, us since boot; None for all the way."""
    times_us = [message.arrival_us for message in stream.messages if message.arrival_us is not None]
    numbers = (number for number, _ in received_in(stream, VISION_NAMES))
    first = next(numbers, None) if math.isfinite(filter_s) and times_us else None
    if first is None:
        return None
    until_us = int((stream.messages[first].arrival_us or times_us[0]) + filter_s * 1e6)
    return until_us if until_us < times_us[-1] else None


def _own_telemetry(stream: Stream, system_id: int) -> dict[int, Header]:
    """Return the headers of the autopilot's own messages, by place; it drops what comes from itself unread.

    None are left out where messages may have waited together, and none that carry external navigation.
    """
    own: dict[int, Header] = {}
    if stream.shared_arrival:
        return own
    for place, message in enumerate(stream.messages):
        header = sound_header(message.frame)
        if header is None or header.name in VISION_NAMES:
            continue
        if (header.system_id, header.component_id) == (system_id, MAV_COMP_ID_AUTOPILOT1):
            own[place] = header
    return own


def _without_bytes(stream: Stream, places: Collection[int]) -> Stream:
    """Return a stream in which nothing comes at some places, from 0; time passes as before."""
    if not places:
        return stream
    messages = (
        StreamMessage(message.arrival_us, b"") if place in places else message
        for place, message in enumerate(stream.messages)
    )
    return replace(stream, messages=tuple(messages))


def _own(number: int, time_us: int, header: Header) -> HandledMessage:
    """Return a message of the autopilot itself; its contents are not kept."""
    ids = header.system_id, header.component_id, header.sequence, header.version
    return HandledMessage(number, time_us, *ids, header.name, None, b"", OWN_MESSAGE, (), ())


def _handled(number: int, event: MessageEvent, message: ReplayedMessage) -> HandledMessage:
    ids, frame = (0, 0, 0, 0), b""
    if (header := event.header) is not None:
        ids, frame = (header.system_id, header.component_id, header.sequence, header.version), header.frame
    about = event.name, event.message, frame, event.verdict
    return HandledMessage(number, event.now_us, *ids, *about, message.records, message.samples or ())
