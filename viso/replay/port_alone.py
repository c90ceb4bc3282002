# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded stream through the batch port: what AP_VisualOdom makes of its samples, without a vehicle around it.

Nothing but the library runs, so that thousands of streams or settings can be gone through; records and verdicts are
those of ``viso replay`` to the bit. What it leaves out is the filter: there are no innovations, and the camera is
aligned with the attitude of a log, or not at all.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from ap_core.cint import int_of_float
from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ap_visualodom.batch import BatchVisualOdom, Event
from ap_visualodom.batch_samples import PoseResults, Poses, Velocities, VelocityResults
from ap_visualodom.ports import Ahrs
from ap_visualodom.verdicts import VERDICTS
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, ESTIMATOR_STARTUP_DELAY_US
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs, RecordedStates
from ekf_stub.ahrs.ahrs_settable import SettableAhrs
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.log.ext_nav_log import ExtNavLog
from mav_handlers.channel import Channel
from mav_handlers.vision_columns import Arrived, VisionColumns, is_sample, vision_columns
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_INT, COMMAND_LONG, PARAM_SET, VISION_POSITION_DELTA, Message
from viso.firmware.releases import REFERENCE, Firmware
from viso.parameters.table import make_groups
from viso.replay.feed import READ_BEFORE_HANDLING_US, batches
from viso.replay.run import SaidText
from viso.streams.stream_kinds import Stream
from viso.vehicle.vehicle import LOOP_PERIOD_US

MakeAhrs = Callable[[VirtualClock, ParamTable, EkfSources], Ahrs]

_AUTOPILOT: Final = (1, 1)
_MAV_CMD_DO_AUX_FUNCTION: Final = 218
_ALIGN_VISUAL_ODOM: Final = (80, 2)


@dataclass(frozen=True)
class PortReplay:
    """What the library made of a stream.

    Attributes:
        poses, velocities: the samples as it got them.
        pose_results, velocity_results: what became of each.
        texts: what it said.
        internal_errors: as the vehicle would report them.
        healthy, quality: at the end.
    """

    poses: Poses
    velocities: Velocities
    pose_results: PoseResults
    velocity_results: VelocityResults
    texts: tuple[SaidText, ...]
    internal_errors: InternalErrors
    healthy: bool
    quality: int

    def verdict_counts(self) -> dict[str, int]:
        """Return how many samples met which rule, by its code."""
        numbers = np.concatenate((self.pose_results.verdict, self.velocity_results.verdict))
        counts = np.bincount(numbers, minlength=len(VERDICTS)).tolist()
        return {verdict.rule.code: count for verdict, count in zip(VERDICTS, counts, strict=True) if count}


class _Said:
    """Takes the texts of the library; forgets its records of deltas."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self.texts: list[SaidText] = []

    def send_text(self, severity: int, text: str) -> None:
        self.texts.append(SaidText(self._clock.micros64(), severity, text))

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Forget it."""


def never_aligned(_clock: VirtualClock, _params: ParamTable, _sources: EkfSources) -> Ahrs:
    """Return an AHRS that has no attitude yet: the camera's frame stays what it is."""
    return SettableAhrs()


def following(states: RecordedStates) -> MakeAhrs:
    """Return the maker of an AHRS that follows a log (``viso.logs.recorded.read_recorded_states``)."""

    def make(clock: VirtualClock, _params: ParamTable, sources: EkfSources) -> Ahrs:
        return RecordedAhrs(clock, sources, ExtNavLog(_Said(clock), lambda: False), states)

    return make


class StreamSamples(NamedTuple):
    """A stream as columns, to be gone through as often as wanted.

    Attributes:
        columns: its samples.
        others: its other messages, each with the number of the sample message that follows and the time in us.
        firmware: the release whose errors these are.
    """

    columns: VisionColumns
    others: Sequence[tuple[int, int, Message]]
    firmware: Firmware


def samples_of(stream: Stream, *, baud: int | None = None, firmware: Firmware = REFERENCE) -> StreamSamples:
    """Return the samples of a stream.

    Args:
        stream: what arrived.
        baud: rate of the UART whose transport time is modelled; None for none.
        firmware: which release to be.
    """
    channel = Channel(0, stream.name, Codec(*_AUTOPILOT), baud)
    arrived, others = _sorted_out(stream, channel)
    return StreamSamples(vision_columns(arrived, channel.jitter, firmware.endpoint), others, firmware)


def replay_samples(
    samples: StreamSamples, settings: Mapping[str, float], *, make_ahrs: MakeAhrs = never_aligned
) -> PortReplay:
    """Run samples through AP_VisualOdom.

    A PARAM_SET, a command to align yaw and a VISION_POSITION_DELTA of the stream have their effect in their place; no
    other message has. Whether positions are aligned while another source is in use follows from the parameters that
    the stream begins with.

    Args:
        samples: of a stream.
        settings: parameters from boot on; unknown ones have no effect.
        make_ahrs: what the camera is aligned with.
    """
    columns, others, firmware = samples
    visual_odom_params = make_params()
    params = ParamTable(make_groups(1, visual_odom_params, firmware.params))
    params.apply_defaults(settings, "settings")
    clock, errors = VirtualClock(), InternalErrors()
    said = _Said(clock)
    sources = EkfSources(lambda name: params.get_int(f"EK3_{name}"), params.on_change.append)
    ahrs = make_ahrs(clock, params, sources)
    batch = BatchVisualOdom(
        visual_odom_params, ahrs=ahrs, gcs=said, logger=said, clock=clock, errors=errors, release=firmware.visual_odom
    )
    batch.visual_odom.init()
    events = _Events(batch.visual_odom, clock, params)
    places = [*columns.first_place.tolist(), len(columns.poses) + len(columns.velocities)]
    planned = [events.of_message(places[number], now_us, message) for number, now_us, message in others]
    if any(sources.position_alignment()):
        planned += events.of_alignments(columns, sources)
    poses, velocities = batch.handle(columns.poses, columns.velocities, sorted(planned, key=lambda event: event[0]))
    visual_odom = batch.visual_odom
    return PortReplay(
        *(columns.poses, columns.velocities, poses, velocities),
        *(tuple(said.texts), errors, visual_odom.healthy(), visual_odom.quality()),
    )


def replay_port(
    stream: Stream,
    settings: Mapping[str, float],
    *,
    baud: int | None = None,
    make_ahrs: MakeAhrs = never_aligned,
    firmware: Firmware = REFERENCE,
) -> PortReplay:
    """Run the samples of a stream through AP_VisualOdom; see :func:`samples_of` and :func:`replay_samples`."""
    return replay_samples(samples_of(stream, baud=baud, firmware=firmware), settings, make_ahrs=make_ahrs)


def _sorted_out(stream: Stream, channel: Channel) -> tuple[list[Arrived], list[tuple[int, int, Message]]]:
    """Return samples, and other messages with the number of the sample that follows and the time (us)."""
    arrived: list[Arrived] = []
    others: list[tuple[int, int, Message]] = []
    now_us = next((one.arrival_us for one in stream.messages if one.arrival_us is not None), 0)
    for group in batches(stream):
        time_us = now_us if group[0].arrival_us is None else group[0].arrival_us
        now_us = max(now_us, time_us)
        read_us = time_us - READ_BEFORE_HANDLING_US if stream.shared_arrival else now_us
        channel.codec.feed(b"".join(message.frame for message in group))
        for message in _received(channel.codec):
            if is_sample(message):
                local_us = channel.arrival_us(type(message), read_us, now_us) or now_us
                arrived.append(Arrived(now_us, local_us, message))
            else:
                others.append((len(arrived), now_us, message))
    return arrived, others


def _received(codec: Codec) -> Iterator[Message]:
    while (received := codec.next_received()) is not None:
        if not isinstance(received, Received) or received.message is None:
            continue
        if (received.header.system_id, received.header.component_id) != _AUTOPILOT:
            yield received.message


class _Events:
    """What happens between samples."""

    def __init__(self, visual_odom: AP_VisualOdom, clock: VirtualClock, params: ParamTable) -> None:
        self._visual_odom, self._clock, self._params = visual_odom, clock, params

    def of_message(self, place: int, now_us: int, message: Message) -> Event:
        """Return what a message does."""

        def happen() -> None:
            self._clock.set_us(now_us)
            if isinstance(message, PARAM_SET):
                self._params.set_from_mavlink(message.param_id, f32(message.param_value))
            elif isinstance(message, VISION_POSITION_DELTA):
                deltas = Vector3f(*message.angle_delta), Vector3f(*message.position_delta)
                duration_us, confidence = message.time_delta_usec, f32(message.confidence)
                self._visual_odom.handle_vision_position_delta_msg(duration_us, *deltas, confidence)
            elif isinstance(message, COMMAND_INT | COMMAND_LONG) and _asks_for_alignment(message):
                self._visual_odom.request_align_yaw_to_ahrs()

        return place, happen

    def of_alignments(self, samples: VisionColumns, sources: EkfSources) -> Iterator[Event]:
        """Yield that the estimator asks for positions to be aligned, in the passes of the main loop before poses."""
        passes = samples.poses.time_us // np.uint64(LOOP_PERIOD_US)
        is_new = np.diff(passes, prepend=passes[:1]) != 0
        is_new[:1] = True
        started_us = AHRS_START_US + ESTIMATOR_STARTUP_DELAY_US
        for row in np.flatnonzero(is_new & (passes * LOOP_PERIOD_US >= started_us)).tolist():
            place = int(samples.poses.place[row])
            yield place, lambda: self._visual_odom.align_position_to_ahrs(*sources.position_alignment())


def _asks_for_alignment(command: COMMAND_INT | COMMAND_LONG) -> bool:
    asked = int_of_float(command.param1), int_of_float(command.param2)
    return command.command == _MAV_CMD_DO_AUX_FUNCTION and asked == _ALIGN_VISUAL_ODOM
