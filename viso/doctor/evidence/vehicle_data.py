# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording holds of the vehicle itself: attitude, height, position, parameters, texts, its filter."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from ap_core.dataflash_columns import LogColumns
from mav_handlers.handlers import VISION_NAMES
from mav_handlers.wire.codec import Header
from mav_handlers.wire.messages import (
    ATTITUDE,
    GLOBAL_POSITION_INT,
    HEARTBEAT,
    SIM_STATE,
    SIMSTATE,
    STATUSTEXT,
    Message,
)
from viso.doctor.evidence.boot_clock import BootClock, boot_clock
from viso.doctor.evidence.estimate import (
    NO_FIXES,
    EstimateListener,
    Fixes,
    Move,
    Origin,
    fixes_in,
    moves_in,
    odometry_in,
    origin_in,
)
from viso.doctor.evidence.ground_sensors import NO_GROUND_SENSORS, GroundListener, GroundSensors, ground_sensors_in
from viso.doctor.evidence.own_filter import OwnFilter
from viso.doctor.evidence.own_log import own_filter_in
from viso.doctor.evidence.own_telemetry import FilterListener
from viso.doctor.evidence.sender_clock import sender_clock
from viso.doctor.evidence.tracks import STAMPED_TYPES, Bools, Floats, Ints, Sender, Track, stamp_of, timed, track_of
from viso.doctor.evidence.vehicle_position import (
    MAV_TYPE_SUBMARINE,
    LevelSeries,
    PositionListener,
    PositionSeries,
    follows_yaw,
    level_in,
    params_in,
    position_in,
    sources_of,
    truth_in,
)
from viso.errors import InputError
from viso.files.first_bytes import Content, content_of
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.filter_records import filter_records_in
from viso.logs.recorded import read_columns, recorded_states
from viso.streams.heard import MAV_COMP_ID_AUTOPILOT1, HeardParams, ParamListener, is_autopilot
from viso.streams.stream import received_in
from viso.streams.stream_kinds import Stream

_COPTERS: Final = (2, 3, 4, 13, 14, 15, 29, 35)  # MAV_TYPE: what moves by leaning


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeSeries:
    """The vehicle's attitude over time, as it reports it.

    Attributes:
        time_us: N, us since boot.
        euler_rad: N x 3, roll, pitch, yaw.
        origin: the record or message, such as ATT.
        follows_stream: whether its yaw may come from external navigation; then it agrees with the stream anyway.
    """

    time_us: Ints
    euler_rad: Floats
    origin: str = "ATTITUDE"
    follows_stream: bool = False

    def __len__(self) -> int:
        return len(self.time_us)

    def at(self, time_us: Ints) -> Floats:
        """Return roll, pitch, yaw interpolated at some times; NaN before the first and after the last."""
        unwrapped = np.unwrap(self.euler_rad, axis=0)
        columns = [np.interp(time_us, self.time_us, unwrapped[:, axis], left=np.nan, right=np.nan) for axis in range(3)]
        return np.column_stack(columns)


@dataclass(frozen=True, slots=True, eq=False)
class HeightSeries:
    """The vehicle's height at N times since boot, as it reports it; its zero is arbitrary."""

    time_us: Ints
    down_m: Floats

    def at(self, time_us: Ints) -> Floats:
        """Return m down interpolated at some times; NaN before the first and after the last."""
        return np.asarray(np.interp(time_us, self.time_us, self.down_m, left=np.nan, right=np.nan), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class ParamChange:
    """A parameter whose value changed within the stream."""

    time_us: int
    name: str
    old: float
    new: float


@dataclass(frozen=True, slots=True)
class VehicleData:
    """What a recording holds of the vehicle.

    Attributes:
        system_id: its own; None if no heartbeat of an autopilot was heard.
        attitude, height: as it reports them; None if it does not.
        params: the first reported value of each.
        changes: of parameters that were reported more than once.
        texts: time in us since boot, severity, text.
        has_all_params: whether a complete list was reported.
        position, level: its position and height from sources other than the stream; None if there are none.
        own_filter: what its own filter reported; None without an autopilot.
        vision: the names of the messages of external navigation that came whole, from any sender.
        truth: the attitude by a simulator.
        is_simulated: whether it flies in a simulator.
        clock: how its clock ran against that of the recording; None if alike.
        ground: the data of flow sensors and range finders, also of companions.
        is_copter: whether it flies by leaning; False if that is not known.
        is_submarine: whether it goes below where it starts; False if that is not known.
        are_stamps_steady: whether the clocks of the senders of external navigation run as the recording's.
        moves: the steps of its own estimate that no motion explains.
        origin, fixes: the first origin of its estimate, and its GPS's.
        odometry: N x 2, time in us and size in m/s of its filter's innovations of deltas (XKFD).
    """

    system_id: int | None = None
    attitude: AttitudeSeries | None = None
    height: HeightSeries | None = None
    params: Mapping[str, float] = field(default_factory=dict)
    changes: tuple[ParamChange, ...] = ()
    texts: tuple[tuple[int, int, str], ...] = ()
    has_all_params: bool = False
    position: PositionSeries | None = None
    own_filter: OwnFilter | None = None
    vision: frozenset[str] = frozenset()
    level: LevelSeries | None = None
    truth: AttitudeSeries | None = None
    is_simulated: bool = False
    clock: BootClock | None = None
    ground: GroundSensors = NO_GROUND_SENSORS
    is_copter: bool = False
    is_submarine: bool = False
    are_stamps_steady: bool = True
    moves: tuple[Move, ...] = ()
    origin: Origin | None = None
    fixes: Fixes = NO_FIXES
    odometry: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def best_attitude(self) -> AttitudeSeries | None:
        """The attitude by a simulator, or else by the vehicle's own account; None if nothing shows it."""
        return self.truth or self.attitude

    def is_attitude_wrong(self, time_us: Ints) -> Bools:
        """Return at which times the best attitude is no measure, because the vehicle's filter had lost itself."""
        if self.own_filter is None or self.truth is not None:
            return np.zeros(len(time_us), dtype=np.bool_)
        return self.own_filter.lost_itself(time_us)

    def overridden_by(self, other: "VehicleData") -> "VehicleData":
        """Return this vehicle's data, replaced by another recording's as far as that describes its motion and filter.

        The sensors of flow and ranges are those of both.
        """
        return replace(
            self,
            attitude=other.attitude or self.attitude,
            height=other.height or self.height,
            position=other.position or self.position,
            level=other.level or self.level,
            truth=other.truth or self.truth,
            own_filter=other.own_filter or self.own_filter,
            moves=other.moves if other.own_filter else self.moves,
            origin=other.origin or self.origin,
            fixes=other.fixes if len(other.fixes) else self.fixes,
            odometry=other.odometry if len(other.odometry) else self.odometry,
            ground=self.ground.beside(other.ground),
            is_copter=self.is_copter or other.is_copter,
            is_submarine=self.is_submarine or other.is_submarine,
        )


class _Listener:
    MESSAGES: Final = frozenset(
        {
            *GroundListener.MESSAGES,
            *ParamListener.MESSAGES,
            *PositionListener.MESSAGES,
            *FilterListener.MESSAGES,
            *EstimateListener.MESSAGES,
            *VISION_NAMES,
            "HEARTBEAT",
            "ATTITUDE",
            "GLOBAL_POSITION_INT",
            "SIM_STATE",
            "SIMSTATE",
            "STATUSTEXT",
        }
    )

    def __init__(self) -> None:
        self.system_id: int | None = None
        self._ground = GroundListener()
        self._attitudes: dict[int, list[tuple[int, int, float, float, float]]] = {}
        self._heights: dict[int, list[tuple[int, float]]] = {}
        self._params: defaultdict[int, ParamListener] = defaultdict(ParamListener)
        self._texts: dict[int, list[tuple[int, int, str]]] = {}
        self._positions: defaultdict[int, PositionListener] = defaultdict(PositionListener)
        self._filters: defaultdict[int, FilterListener] = defaultdict(FilterListener)
        self._estimates: defaultdict[int, EstimateListener] = defaultdict(EstimateListener)
        self._truths: dict[int, list[tuple[float, ...]]] = {}
        self._stamps: dict[Sender, list[tuple[int, int, int]]] = {}
        self._kinds: dict[int, int] = {}

    def take(self, time_us: int, number: int, header: Header, message: Message | None) -> None:
        sender = header.system_id
        self._ground.take(time_us, number, header, message)
        self._params[sender].take(time_us, header.component_id, message)
        if isinstance(message, STAMPED_TYPES):
            whose = Sender(sender, header.component_id, header.name)
            self._stamps.setdefault(whose, []).append((time_us, stamp_of(message), header.sequence))
        if header.component_id != MAV_COMP_ID_AUTOPILOT1:
            return
        self._positions[sender].take(time_us, message)
        self._filters[sender].take(time_us, message)
        self._estimates[sender].take(time_us, message)
        if isinstance(message, HEARTBEAT):
            self._kinds[sender] = message.type
        if self.system_id is None and is_autopilot(header.component_id, message):
            self.system_id = sender
        elif isinstance(message, ATTITUDE):
            angles = message.roll, message.pitch, message.yaw
            self._attitudes.setdefault(sender, []).append((time_us, message.time_boot_ms * 1000, *angles))
        elif isinstance(message, GLOBAL_POSITION_INT):
            self._heights.setdefault(sender, []).append((time_us, -1e-3 * message.relative_alt))
        elif isinstance(message, SIM_STATE | SIMSTATE):
            self._truths.setdefault(sender, []).append((time_us, message.roll, message.pitch, message.yaw))
        elif isinstance(message, STATUSTEXT):
            self._texts.setdefault(sender, []).append((time_us, message.severity, message.text))

    def vehicle(self, given: Mapping[str, float], firmware: Firmware) -> VehicleData:
        by_rate = firmware.reads_flow_rates
        are_steady = all(sender_clock(_track(whose, rows)) is None for whose, rows in self._stamps.items())
        if self.system_id is None:
            return VehicleData(are_stamps_steady=are_steady, ground=self._ground.sensors(None, given, by_rate))
        heard = self._params[self.system_id].told()
        first, changes = _values(heard)
        texts = tuple(self._texts.get(self.system_id, []))
        new_values = [(change.time_us, change.name, change.new) for change in changes]
        params = sources_of((*first.items(), *((name, value) for _, name, value in new_values)))
        attitude, places = _series(self._attitudes.get(self.system_id, [])), self._positions[self.system_id]
        truth, estimate = _truth(self._truths.get(self.system_id, [])), self._estimates[self.system_id]
        return VehicleData(
            self.system_id,
            None if attitude is None else replace(attitude, follows_stream=follows_yaw(params)),
            _heights(self._heights.get(self.system_id, [])),
            first,
            changes,
            texts,
            has_all_params=heard.has_all,
            position=places.position(params),
            own_filter=self._filters[self.system_id].own_filter(
                first, new_values, [(time_us, text) for time_us, _, text in texts]
            ),
            level=places.level(params),
            moves=estimate.moves,
            origin=estimate.origin,
            fixes=estimate.fixes,
            truth=truth,
            is_simulated=truth is not None or is_of_simulator(first),
            is_copter=self._kinds.get(self.system_id) in _COPTERS,
            is_submarine=self._kinds.get(self.system_id) == MAV_TYPE_SUBMARINE,
            are_stamps_steady=are_steady,
            clock=boot_clock([row[:2] for row in self._attitudes.get(self.system_id, [])]),
            ground=self._ground.sensors(self.system_id, {**first, **given}, by_rate),
        )


def _track(whose: Sender, rows: list[tuple[int, int, int]]) -> Track:
    arrival_us, stamps, sequence = zip(*rows, strict=True)
    return track_of(whose, range(1, len(rows) + 1), arrival_us, stamps, sequence)


def _values(heard: HeardParams) -> tuple[dict[str, float], tuple[ParamChange, ...]]:
    first: dict[str, float] = {}
    last: dict[str, float] = {}
    changes = []
    for time_us, name, number in heard.values:
        if not np.isfinite(number):
            continue
        if name in last and last[name] != number:
            changes.append(ParamChange(time_us, name, last[name], number))
        first.setdefault(name, number)
        last[name] = number
    return first, tuple(changes)


def _series(heard: list[tuple[int, int, float, float, float]]) -> AttitudeSeries | None:
    if len(heard) < 2:
        return None
    table = np.array(heard, dtype=np.float64)
    table = table[np.isfinite(table).all(axis=1)]
    if len(table) < 2:
        return None
    # Its own clock has no jitter of the link; the least delay ties it to the times of arrival.
    time_us = table[:, 1] + np.min(table[:, 0] - table[:, 1])
    order = np.argsort(time_us, kind="stable")
    return AttitudeSeries(time_us[order].astype(np.int64), table[order, 2:])


def _truth(heard: list[tuple[float, ...]]) -> AttitudeSeries | None:
    table = np.array(heard, dtype=np.float64).reshape(-1, 4)
    table = table[np.isfinite(table).all(axis=1)]
    return AttitudeSeries(table[:, 0].astype(np.int64), table[:, 1:], "SIMSTATE") if len(table) > 1 else None


def is_of_simulator(names: Iterable[str]) -> bool:
    """Return whether some parameters are of a vehicle in ArduPilot's simulator."""
    return any(name.startswith("SIM_") for name in names)


def _heights(heard: list[tuple[int, float]]) -> HeightSeries | None:
    if len(heard) < 2:
        return None
    return HeightSeries(np.array([row[0] for row in heard], np.int64), np.array([row[1] for row in heard], np.float64))


def listen(
    stream: Stream, given: Mapping[str, float] = MappingProxyType({}), firmware: Firmware = DEFAULT
) -> VehicleData:
    """Return what an autopilot reports in a stream; of several, the one that is heard first.

    Given parameters win over those heard. ``firmware`` is the release that takes the flow of companions.
    """
    listener, time_us, vision = _Listener(), 0, set[str]()
    for place, (header, message) in received_in(stream, _Listener.MESSAGES):
        arrival_us = stream.messages[place].arrival_us
        time_us = time_us if arrival_us is None else arrival_us
        listener.take(time_us, place + 1, header, message)
        if header.name in VISION_NAMES:
            vision.add(header.name)
    return replace(listener.vehicle({**stream.params, **given}, firmware), vision=frozenset(vision))


def vehicle_of_log(path: Path) -> VehicleData:
    """Return what a DataFlash log holds of the vehicle; nothing for another kind of file, or an unreadable one."""
    try:
        is_log = content_of(path) is Content.DATAFLASH_LOG
        return vehicle_in(path, read_columns(path)) if is_log else VehicleData()
    except InputError:
        return VehicleData()


def vehicle_in(path: Path, log: LogColumns) -> VehicleData:
    """Return what a DataFlash log that has been read holds of the vehicle."""
    truth, fixes, records = truth_in(log), fixes_in(log), filter_records_in(log)
    own_filter = own_filter_in(log, records)
    banners = [text for _, text in own_filter.texts]
    data = VehicleData(
        is_copter=any(text.startswith("ArduCopter V") for text in banners),
        is_submarine=any(text.startswith("ArduSub V") for text in banners),
        position=position_in(log),
        own_filter=own_filter,
        level=level_in(log),
        moves=moves_in(records),
        origin=origin_in(log, fixes),
        fixes=fixes,
        odometry=odometry_in(log),
        ground=ground_sensors_in(log),
        truth=None if truth is None else AttitudeSeries(truth[:, 0].astype(np.int64), np.radians(truth[:, 1:]), "SIM"),
    )
    try:
        states = recorded_states(path, log)
    except InputError:  # without ATT
        return data
    att = timed(np.column_stack([states.att_time_us, states.att_rpy_deg]))
    attitude = None
    if len(att):
        rpy_rad = np.radians(att[:, 1:])
        attitude = AttitudeSeries(att[:, 0].astype(np.int64), rpy_rad, "ATT", follows_yaw(params_in(log)))
    position = timed(np.column_stack([states.pos_time_us, states.pos_ned]))
    height = HeightSeries(position[:, 0].astype(np.int64), position[:, 3]) if len(position) > 1 else None
    return replace(data, attitude=attitude, height=height)
