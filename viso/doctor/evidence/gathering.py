# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tries a stream on the autopilot in virtual time, and keeps all that the rules want to know."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from ap_visualodom.verdicts import CONSUMED
from ekf_stub.inputs.sources import SETS, SourceXY
from mav_handlers.endpoint import MessageEvent
from mav_handlers.handlers import VISION_MESSAGES
from mav_handlers.verdicts import BAD_CRC
from mav_handlers.wire.codec import message_name
from viso.doctor.evidence.boot_clock import by_boot_clock
from viso.doctor.evidence.compare import Comparison, compare, compare_paths
from viso.doctor.evidence.evidence import Evidence, vision_of
from viso.doctor.evidence.flow_fit import fit_flow, with_motion_of
from viso.doctor.evidence.ground_sensors import GroundSensors
from viso.doctor.evidence.motion import motions_of
from viso.doctor.evidence.own_filter import OwnFilter
from viso.doctor.evidence.refused_frames import refused_kinds
from viso.doctor.evidence.tracks import Poses, SeenMessage, pose_tracks, stamped_tracks, velocity_tracks
from viso.doctor.evidence.trial_parameters import VISION_NAMES, Settled, settle
from viso.doctor.evidence.vehicle_data import AttitudeSeries, HeightSeries, VehicleData, is_of_simulator, listen
from viso.doctor.evidence.vehicle_position import LevelSeries, PositionSeries
from viso.errors import InputError
from viso.firmware.flown import notes_on
from viso.firmware.releases import Firmware
from viso.replay.feed import Replay, ReplayedMessage
from viso.streams.heard import firmware_of_recording
from viso.streams.stream import message_id_of, received_in, timed_frames
from viso.streams.stream_kinds import Aspect, Stream
from viso.vehicle.config import by_ekf3
from viso.vehicle.outcomes.watch import AidingSpan, FilterWatch, Innovations
from viso.vehicle.sensors.options import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource
from viso.vehicle.vehicle import Vehicle, VehicleConfig

_TURNING_RAD: Final = 0.05  # a second
_NO_TELEMETRY: Final = {0: dict.fromkeys(range(500), 0)}
"""Nobody listens to the vehicle of a trial."""
_AXES_UNKNOWN: Final = (
    "nothing else tells how the vehicle moved, or too little: axes that fit each other, such as ENU at one height, "
    "are not judged"
)
_OF_VEHICLE: Final = ("attitude", "height", "position", "level", "truth", "own_filter")
"""Fields of ``GatherOptions``, ``VehicleData`` and ``Evidence``; of the first two, that of the options counts."""


@dataclass(frozen=True, slots=True)
class GatherOptions:
    """How to try a stream.

    Attributes:
        params: parameters that the user gives; they win over those of the stream.
        baud: rate of the link's transport-time model; None for a link without delay.
        attitude, height, position, level, truth, own_filter, ground: the vehicle's, where something else than the
            stream tells it.
        heading_rad: where the vehicle points at first, if its attitude is not known.
        firmware: which release to try it on; None for the one that is nearest to what flew.
        is_tried: whether it is tried at all; else every message counts as accepted, and no filter is asked.
        filter_s: for how long the filter is run, from the first message of external navigation on.
    """

    params: Mapping[str, float] = field(default_factory=dict)
    baud: int | None = None
    attitude: AttitudeSeries | None = None
    height: HeightSeries | None = None
    position: PositionSeries | None = None
    own_filter: OwnFilter | None = None
    level: LevelSeries | None = None
    truth: AttitudeSeries | None = None
    ground: GroundSensors | None = None
    heading_rad: float = 0.0
    firmware: Firmware | None = None
    is_tried: bool = True
    filter_s: float = math.inf

    def beside(self, vehicle: VehicleData) -> "GatherOptions":
        """Return the options with what else describes the vehicle."""
        return replace(self, ground=vehicle.ground, **{name: getattr(vehicle, name) for name in _OF_VEHICLE})


@dataclass(frozen=True, slots=True)
class _Outcome:
    """What came of a stream: fields as those of ``Evidence``."""

    messages: tuple[SeenMessage, ...]
    params: Mapping[str, float]
    texts: tuple[tuple[int, int, str], ...] = ()
    aiding: tuple[AidingSpan, ...] = ()
    innovations: Mapping[str, Innovations] = field(default_factory=dict)
    model_jumps: int = 0
    filter_until_us: int | None = None
    notes: tuple[str, ...] = ()


def _filter_until_us(stream: Stream, filter_s: float) -> int | None:
    """Return until when the filter runs, us since boot; None for all the way."""
    times_us = [one.arrival_us for one in stream.messages if one.arrival_us is not None]
    numbers = (number for number, received in received_in(stream) if type(received.message) in VISION_MESSAGES)
    first = next(numbers, None) if math.isfinite(filter_s) and times_us else None
    if first is None:
        return None
    until_us = int((stream.messages[first].arrival_us or times_us[0]) + filter_s * 1e6)
    return until_us if until_us < times_us[-1] else None


class _Trial:
    """A vehicle that follows a stream, and what it said and did."""

    def __init__(
        self,
        stream: Stream,
        params: Mapping[str, float],
        heading_rad: float,
        firmware: Firmware,
        options: GatherOptions,
        *,
        heeds_stamps: bool,
    ) -> None:
        self._heeds_stamps = heeds_stamps
        make_ahrs = by_ekf3(self._follow, ImuOptions(heading_rad=heading_rad))
        self.vehicle = _vehicle(
            stream, VehicleConfig(make_ahrs, defaults=params, firmware=firmware, message_intervals=_NO_TELEMETRY)
        )
        self.params = _params_of(self.vehicle)
        self.watch = FilterWatch(self.vehicle)
        self.texts: list[tuple[int, int, str]] = []
        self._events: list[MessageEvent] = []
        self.vehicle.texts.on_text.append(self._take_text)
        self._filter_until_us = _filter_until_us(stream, options.filter_s)
        self._replay = Replay(self.vehicle, stream, options.baud, self.watch, self._filter_until_us)
        self._tell_replay = self.vehicle.endpoint.on_event
        self.vehicle.endpoint.on_event = self._take_event

    def _follow(self, options: ImuOptions) -> FollowSource:
        self._source = FollowSource(options, heeds_stamps=self._heeds_stamps)
        return self._source

    def _take_text(self, severity: int, text: str) -> None:
        self.texts.append((self.vehicle.clock.micros64(), severity, text))

    def _take_event(self, event: MessageEvent) -> None:
        self._events.append(event)
        if self._tell_replay is not None:
            self._tell_replay(event)

    def run(self, on_progress: Callable[[int], None]) -> _Outcome:
        replayed = list(self._replay.run(on_progress))
        self.vehicle.close()
        pairs = enumerate(zip(self._events, replayed, strict=True), 1)
        return _Outcome(
            tuple(_seen(number, event, message) for number, (event, message) in pairs),
            self.params,
            tuple(self.texts),
            tuple(self.watch.aiding()),
            dict(self.watch.innovations),
            self._source.jumps["position"] + self._source.jumps["yaw"],
            self._filter_until_us,
            self._replay.notes(),
        )


def _vehicle(stream: Stream, config: VehicleConfig) -> Vehicle:
    try:
        return Vehicle(config)
    except ValueError as error:
        raise InputError(f"{stream.name}: {error}") from error


def _params_of(vehicle: Vehicle) -> dict[str, float]:
    return {slot.name: float(slot.value) for group in vehicle.params.groups for slot in group.slots}


def _untried(stream: Stream, params: Mapping[str, float], firmware: Firmware) -> _Outcome:
    """Return a stream as if every message had been accepted."""
    messages: list[SeenMessage] = []
    times_us = [time_us for time_us, _ in timed_frames(stream)]
    for place, received in received_in(stream):
        header = received.header
        ids = header.system_id, header.component_id, header.sequence, header.version, header.name
        messages.append(
            SeenMessage(len(messages) + 1, times_us[place], *ids, received.message, header.frame, CONSUMED, (), ())
        )
    vehicle = _vehicle(stream, VehicleConfig(defaults=params, firmware=firmware))
    return _Outcome(tuple(messages), _params_of(vehicle))


def _seen(number: int, event: MessageEvent, message: ReplayedMessage) -> SeenMessage:
    ids, frame = (0, 0, 0, 0), b""
    if (header := event.header) is not None:
        ids, frame = (header.system_id, header.component_id, header.sequence, header.version), header.frame
    about = event.name, event.message, frame, event.verdict
    return SeenMessage(number, event.now_us, *ids, *about, message.records, message.samples or ())


def gather(
    stream: Stream, options: GatherOptions | None = None, on_progress: Callable[[int], None] = lambda _count: None
) -> Evidence:
    """Try a stream on a vehicle that moves as it says, and return what came of it.

    A stream without external navigation is not tried: what the vehicle in it said is all that there is.

    Args:
        stream: what is sent, and perhaps what the autopilot said meanwhile.
        options: how to try it.
        on_progress: told the number of messages fed so far.

    Raises:
        InputError: a parameter has a value that it cannot take.
    """
    options = options or GatherOptions()
    told = listen(stream, options.params)
    if told.clock is not None:
        stream = by_boot_clock(stream, told.clock)
        told = replace(listen(stream, options.params), is_simulated=True)
    known = {name: getattr(options, name) or getattr(told, name) for name in _OF_VEHICLE}
    told = replace(told, ground=told.ground.beside(options.ground), **known)
    kinds = Counter(message_name(message_id_of(one.frame)) or "unknown" for one in stream.messages)
    names = told.vision | (kinds.keys() & VISION_NAMES)
    firmware = options.firmware or firmware_of_recording(stream)
    flown = stream.flown if options.firmware is None else None
    settled = settle(stream, told, options.params, names, firmware, flown)
    heading_rad = options.heading_rad if told.attitude is None else float(told.attitude.euler_rad[0, 2])
    if options.is_tried and names:
        trial = _Trial(stream, settled.params, heading_rad, firmware, options, heeds_stamps=told.are_stamps_steady)
        outcome = trial.run(on_progress)
    else:
        outcome = _untried(stream if names else replace(stream, messages=()), settled.params, firmware)
    with np.errstate(all="ignore"):  # streams hold NaN and infinity
        evidence = _evidence(stream, told, options, settled, outcome)
    notes = (*evidence.notes, *(f"{stream.name}: {one}" for one in notes_on(stream.flown, firmware)))
    return replace(evidence, notes=notes, kinds=kinds, flown=flown)


def _motion_beside(told: VehicleData, poses: Sequence[Poses]) -> tuple[GroundSensors, AttitudeSeries | None]:
    """Return flow, ranges and motion with the attitude, of the stream's first poses if no vehicle tells its turning."""
    if len(told.ground.turning) or not told.ground.flows or not poses:
        return told.ground, told.attitude
    return with_motion_of(told.ground, poses[0])


def _uses_flow(params: Mapping[str, float]) -> bool:
    return any(params.get(f"EK3_SRC{number}_VELXY") == SourceXY.OPTFLOW for number in range(1, SETS + 1))


def _is_another_flight(comparisons: Sequence[Comparison]) -> bool:
    """Return whether the vehicle turns, and nowhere as the stream does: a trajectory has a clock of its own."""
    turning = [one for one in comparisons if one.since_arrival.rate_rad > _TURNING_RAD]
    return bool(turning) and not any(one.since_arrival.enough_motion for one in turning)


def _evidence(
    stream: Stream, told: VehicleData, options: GatherOptions, settled: Settled, outcome: _Outcome
) -> Evidence:
    messages = outcome.messages
    vision, notes = vision_of(messages), (*stream.notes, *outcome.notes)
    poses, velocities = pose_tracks(vision), velocity_tracks(vision)
    comparisons = compare(poses, vision, told.attitude, outcome.params)
    if Aspect.RESETS in stream.lacks and _is_another_flight(comparisons):
        told = replace(told, attitude=None, height=None, position=None, level=None, truth=None)
        comparisons = ()
        notes = (*notes, f"{stream.name}: the vehicle turns otherwise, or at other times (--lead): left out of account")
    if outcome.filter_until_us is not None:
        until = f"the first {options.filter_s:g} s of external navigation, to {outcome.filter_until_us * 1e-6:.3f} s"
        notes = (*notes, f"{stream.name}: the filter (a model) was run over {until} (--filter-seconds)")
    paths = compare_paths(poses, told.position, comparisons, outcome.params)
    axes = [*(one.orientation for one in comparisons), *(one.axes for one in paths)]
    if poses and not any(one is not None and one.sufficient for one in axes):
        notes = (f"{stream.name}: {_AXES_UNKNOWN}", *notes)
    known = {**told.params, **stream.params}
    arrivals_us = [one.arrival_us for one in stream.messages[-1:] if one.arrival_us is not None]
    return Evidence(
        name=stream.name,
        firmware=settled.firmware,
        messages=messages,
        tracks=stamped_tracks(vision),
        poses=poses,
        velocities=velocities,
        motions=motions_of(poses, velocities),
        comparisons=comparisons,
        params=outcome.params,
        assumed=settled.assumed,
        changes=told.changes,
        texts=outcome.texts,
        vehicle_texts=told.texts,
        aiding=outcome.aiding,
        innovations=outcome.innovations,
        end_us=messages[-1].arrival_us if messages else max(arrivals_us, default=0),
        notes=notes,
        vision=vision,
        lacks=stream.lacks,
        paths=paths,
        is_as_flown=all(known.get(name, value) == value for name, value in options.params.items()),
        told=settled.told,
        tells_all=settled.tells_all,
        model_jumps=outcome.model_jumps,
        refused=refused_kinds(stream) if any(one.verdict is BAD_CRC for one in messages) else (),
        ground=told.ground,
        flow_fits=fit_flow(
            *_motion_beside(told, poses), told.height, told.position, _uses_flow({**outcome.params, **known})
        ),
        is_simulated=told.is_simulated or told.truth is not None or is_of_simulator(stream.params),
        **{name: getattr(told, name) for name in _OF_VEHICLE},
    )
