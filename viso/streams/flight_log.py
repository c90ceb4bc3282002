# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""DataFlash logs of ArduPilot: from VISP, VISV, VISO and PARM records back to the messages behind them.

The records hold the sender's stamp (RTimeUS), the time of handling (TimeUS) and the corrected time (CTimeMS), so that
the replayed stream has the timing of the flight.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from mav_handlers.wire.codec import Codec, full_length
from mav_handlers.wire.messages import (
    ODOMETRY,
    PARAM_SET,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.companion.sender import MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
from viso.errors import InputError
from viso.firmware.flown import FlownVersion, profile_for, version_in
from viso.logs.recorded import RecordError, notes_of_lost, numbers, read_columns, records_in, text, whole
from viso.streams.capture import MAX_PARAMETER
from viso.streams.rebuilding import DeltaRecord, PoseRecord, Rebuilder, Record, Three, VelocityRecord
from viso.streams.stream import MAX_GAP_US, Aspect, Stream, StreamMessage

TOGETHER_US: Final = 2000
"""The two records of one ODOMETRY are less apart; a pass of the main loop takes longer."""
BAUD_RATES: Final = (57600, 115200, 230400, 460800, 921600, 1500000)
_FRAME_BYTES: Final = 12
_UNEXPLAINED_US: Final = 5000
_GROUND_STATION: Final = (255, 190)
_MAV_PARAM_TYPE_REAL32: Final = 9
_ALIGNED: Final = "VisOdom: yaw shifted"
# Labels of earlier firmware, 3.6 to 4.5.
_OLD_LABELS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {"R": ("Roll",), "P": ("Pitch",), "Y": ("Yaw",), "Rst": ("RstCnt", "ResetCnt"), "RTimeUS": ("RemTimeUS",)}
)
_CORRECTED: Final = "CTimeMS"  # firmware of 3.6 does not log it, and logs angles in rad
# Others are counters and calibrations that the autopilot writes itself.
_FOLLOWED: Final = ("VISO_", "EK3_")
_MAX_STAMP: Final = (1 << 64) - 1
_MAX_MS: Final = (1 << 32) - 1
_RECORDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "ODOMETRY": "VISP and VISV",
        "VISION_POSITION_ESTIMATE": "VISP",
        "VISION_SPEED_ESTIMATE": "VISV",
        "VISION_POSITION_DELTA": "VISO",
    }
)


@dataclass(slots=True)
class _ParamChange:
    """A parameter that got another value while the log was written; time in us since boot."""

    time_us: int
    name: str
    value: float


@dataclass(slots=True)
class _Aligned:
    """The backend has aligned the camera's yaw."""


_Event = Record | _ParamChange | _Aligned


class _LogContent:
    """What a log holds that matters here, in its order: takes the records of a log one after the other."""

    def __init__(self, lost: tuple[str, ...]) -> None:
        self.params: dict[str, float] = {}
        self.events: list[_Event] = []
        self.flown: FlownVersion | None = None
        self.texts_of_alignment = 0
        self.lost = lost
        self.numbers: Counter[str] = Counter()
        self._latest: dict[str, float] = {}
        self._latest_us = 0
        self._takers: Mapping[str, Callable[[Any], None]] = {
            "VISP": self._take_visp,
            "VISV": self._take_visv,
            "VISO": self._take_viso,
            "PARM": self._take_parm,
            "MSG": self._take_msg,
            "VER": self._take_ver,
        }

    @property
    def has_vision(self) -> bool:
        """Whether there is any record of external navigation."""
        return any(isinstance(event, PoseRecord | VelocityRecord | DeltaRecord) for event in self.events)

    @property
    def kinds(self) -> list[str]:
        """The types of records to be given."""
        return list(self._takers)

    def take(self, record: Any) -> None:
        """Take a record; raises RecordError, after which ``numbers`` tells the number of the record among its type."""
        kind, events = record.get_type(), self.events
        self.numbers[kind] += 1
        count = len(events)
        self._takers[kind](record)
        if len(events) > count and not isinstance(events[-1], _Aligned):
            self._check_time(kind, events[-1].time_us)

    def _check_time(self, kind: str, time_us: int) -> None:
        if time_us - self._latest_us > MAX_GAP_US:
            raise RecordError(f"{kind}.TimeUS is more than a day after the one before")
        self._latest_us = max(self._latest_us, time_us)

    def _take_visp(self, record: Any) -> None:
        position, angles = _three(record, "PX", "PY", "PZ"), _three(record, *(_label(record, name) for name in "RPY"))
        roll, pitch, yaw = angles if hasattr(record, _CORRECTED) else map(math.degrees, angles)
        # Firmware before 4.1 has no errors to log.
        pos_err, ang_err = numbers(record, "PErr", "AErr") if hasattr(record, "PErr") else (0.0, 0.0)
        quality = _quality(record)
        times, rpy_deg, resets = _times(record), (roll, pitch, yaw), _resets(record)
        self.events.append(PoseRecord(*times, position, rpy_deg, pos_err, ang_err, resets, quality))

    def _take_visv(self, record: Any) -> None:
        velocity = _three(record, "VX", "VY", "VZ")
        self.events.append(VelocityRecord(*_times(record), velocity, _resets(record), _quality(record)))

    def _take_viso(self, record: Any) -> None:
        angle, position = (_three(record, *(f"{what}D{axis}" for axis in "XYZ")) for what in ("Ang", "Pos"))
        time_us = _within(record, "TimeUS", 0, _MAX_STAMP)
        duration_s, confidence = numbers(record, "dt", "conf")
        self.events.append(DeltaRecord(time_us, duration_s, angle, position, confidence))

    def _take_parm(self, record: Any) -> None:
        name, (value,) = text(record, "Name"), numbers(record, "Value")
        if not abs(value) <= MAX_PARAMETER:
            return
        before = self._latest.get(name)
        self._latest[name] = value
        if before is None:
            self.params[name] = value
        elif name.startswith(_FOLLOWED) and value != before:
            self.events.append(_ParamChange(_within(record, "TimeUS", 0, _MAX_STAMP), name, value))

    def _take_msg(self, record: Any) -> None:
        said = text(record, "Message")
        self.flown = self.flown or version_in(said)
        if said.startswith(_ALIGNED):
            self.texts_of_alignment += 1
            self.events.append(_Aligned())

    def _take_ver(self, record: Any) -> None:
        said = getattr(record, "FWS", None)
        self.flown = self.flown or (version_in(said) if isinstance(said, str) else None)


def _label(record: Any, name: str) -> str:
    return next((label for label in (name, *_OLD_LABELS.get(name, ())) if hasattr(record, label)), name)


def _within(record: Any, label: str, low: int, high: int) -> int:
    (value,) = whole(record, label) if not isinstance(getattr(record, label, None), int) else (getattr(record, label),)
    if not low <= value <= high:
        raise RecordError(f"{record.get_type()}.{label} is {value}")
    return int(value)


def _times(record: Any) -> tuple[int, int, int]:
    time_us, remote_us = (_within(record, _label(record, name), 0, _MAX_STAMP) for name in ("TimeUS", "RTimeUS"))
    corrected_ms = _within(record, _CORRECTED, 0, _MAX_MS) if hasattr(record, _CORRECTED) else time_us // 1000
    return time_us, remote_us, corrected_ms


def _resets(record: Any) -> int:
    # Firmware up to 4.0 knows none.
    label = _label(record, "Rst")
    return _within(record, label, 0, 255) if hasattr(record, label) else 0


def _three(record: Any, *labels: str) -> Three:
    x, y, z = numbers(record, *labels)
    return x, y, z


def _quality(record: Any) -> int:
    # Firmware before 4.5 logs none.
    return _within(record, "Q", -128, 127) if hasattr(record, "Q") else 0


def _read(path: Path, *, may_be_empty: bool) -> _LogContent:
    columns = read_columns(path)
    content = _LogContent(tuple(notes_of_lost(columns)))
    for record in records_in(columns, content.kinds):
        try:
            content.take(record)
        except RecordError as error:
            kind = record.get_type()
            raise InputError(f"{path}: {kind} record {content.numbers[kind]}: {error}") from error
    if not may_be_empty and not content.has_vision:
        raise InputError(f"{path}: no VISP, VISV or VISO records: VISO_TYPE was 0, or no external navigation came")
    return content


def read_flight_log(path: Path, *, may_be_empty: bool = False) -> Stream:
    """Read the external navigation of a DataFlash log (.BIN, packed or not), and its parameters.

    VISP and VISV of one moment become an ODOMETRY, unless the log shows that they came apart; a VISP alone becomes a
    VISION_POSITION_ESTIMATE, a VISV alone a VISION_SPEED_ESTIMATE, a VISO a VISION_POSITION_DELTA. A parameter of VISO_
    or EK3_ that changed becomes a PARAM_SET. Raises InputError that names the file, and the record where that is to
    blame; also if there is no external navigation, unless it ``may_be_empty``.
    """
    content = _read(path, may_be_empty=may_be_empty)
    apart = _came_apart(content.events)
    messages: list[StreamMessage] = []
    sent: Counter[str] = Counter()
    latest_us = 0
    camera, ground = Codec(1, MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY), Codec(*_GROUND_STATION)
    for time_us, message in _rebuilt(content, together=not apart):
        latest_us = max(latest_us, time_us)
        codec = ground if isinstance(message, PARAM_SET) else camera
        messages.append(StreamMessage(latest_us, codec.encode(message)))
        sent[type(message).__name__] += 1
    baud = _baud_of(content.events, sent)
    notes = tuple(f"{path}: {note}" for note in _notes(content, sent, baud, apart=apart))
    return Stream(
        path.name.split(".")[0],
        tuple(messages),
        content.params,
        baud,
        shared_arrival=True,
        notes=notes,
        lacks=frozenset({Aspect.LINK}),
        flown=content.flown,
        called=_RECORDS,
    )


def _came_apart(events: Sequence[_Event]) -> bool:
    """Return whether poses and velocities came in messages of their own.

    Quality comes with ODOMETRY only. Without any, a pose and a velocity of one stamp that were handled in different
    passes of the main loop cannot have been one message.
    """
    records = [event for event in events if isinstance(event, PoseRecord | VelocityRecord)]
    return not any(record.quality for record in records) and any(
        _of_one_stamp(first, second) and second.time_us - first.time_us >= TOGETHER_US
        for first, second in pairwise(records)
    )


def _of_one_stamp(first: _Event, second: _Event | None) -> bool:
    return (
        isinstance(first, PoseRecord)
        and isinstance(second, VelocityRecord)
        and (first.remote_us, first.resets, first.quality) == (second.remote_us, second.resets, second.quality)
    )


def _rebuilt(content: _LogContent, *, together: bool) -> Iterator[tuple[int, Message]]:
    """Yield when each message was handled, and the message."""
    rebuilder = Rebuilder(profile_for(content.flown, content.params).firmware.endpoint.error_formula)
    for name, value in content.params.items():
        rebuilder.set_param(name, value)
    # A log that begins later does not tell when the camera was aligned: it was, then.
    rebuilder.aligned = not content.texts_of_alignment
    events = content.events
    skip = False
    for event, following in zip_longest(events, events[1:]):
        if skip:
            skip = False
        elif isinstance(event, _Aligned):
            rebuilder.aligned = True
        elif isinstance(event, _ParamChange):
            rebuilder.set_param(event.name, event.value)
            yield event.time_us, PARAM_SET(1, 1, event.name, event.value, _MAV_PARAM_TYPE_REAL32)
        elif isinstance(event, DeltaRecord):
            yield event.time_us, rebuilder.vision_position_delta(event)
        elif isinstance(event, VelocityRecord):
            yield event.time_us, rebuilder.vision_speed_estimate(event)
        elif together and isinstance(following, VelocityRecord) and _is_one_message(event, following):
            skip = True
            yield event.time_us, rebuilder.odometry(event, following)
        else:
            yield event.time_us, rebuilder.vision_position_estimate(event)


def _is_one_message(pose: PoseRecord, velocity: VelocityRecord) -> bool:
    return _of_one_stamp(pose, velocity) and abs(velocity.time_us - pose.time_us) < TOGETHER_US


def _baud_of(events: Sequence[_Event], sent: Counter[str]) -> int | None:
    """Return the usual rate of a UART that explains by how much the corrected time is before the handling.

    None for a link that takes no time, or if no rate explains it.
    """
    lengths = _waiting_lengths(sent)
    wanted = PoseRecord if any(isinstance(event, PoseRecord) for event in events) else VelocityRecord
    lags_us = [event.time_us - 1000 * event.corrected_ms for event in events if isinstance(event, wanted)]
    if not lags_us or not lengths:
        return None
    # The least delayed of all messages was delayed by the transport alone.
    least_us = min(lags_us)
    unexplained_us: dict[int | None, int] = {None: abs(least_us)}
    for rate in BAUD_RATES:
        unexplained_us[rate] = min(abs(length * (10_000_000 // rate) - least_us) for length in lengths)
    best = min(unexplained_us, key=lambda rate: unexplained_us[rate])
    return best if unexplained_us[best] <= _UNEXPLAINED_US else None


def _waiting_lengths(sent: Counter[str]) -> list[int]:
    """Return how many bytes may have to arrive before a pose can be handled, or a velocity if there is no pose."""
    odometry, pose, speed = (
        full_length(kind) + _FRAME_BYTES for kind in (ODOMETRY, VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE)
    )
    if sent[ODOMETRY.__name__]:
        return [odometry]
    if sent[VISION_POSITION_ESTIMATE.__name__]:
        return [pose, pose + speed] if sent[VISION_SPEED_ESTIMATE.__name__] else [pose]
    return [speed] if sent[VISION_SPEED_ESTIMATE.__name__] else []


def _notes(content: _LogContent, sent: Counter[str], baud: int | None, *, apart: bool) -> Iterator[str]:
    """Yield what the log cannot tell, and what was taken for true instead."""
    counts = ", ".join(f"{count} {name}" for name, count in sorted(sent.items()))
    yield from content.lost
    if not content.has_vision:
        return
    yield f"rebuilt from records: {counts}; what left no record (dropped messages, commands, the origin) is not there"
    if sent[ODOMETRY.__name__]:
        yield "each VISP with its VISV is taken for an ODOMETRY in the accepted frames"
    if apart:
        yield "VISP and VISV came apart: taken for VISION_POSITION_ESTIMATE and VISION_SPEED_ESTIMATE"
    if sent[VISION_POSITION_ESTIMATE.__name__]:
        yield "GLOBAL_VISION_POSITION_ESTIMATE, VICON_POSITION_ESTIMATE and ATT_POS_MOCAP leave the same VISP"
    if sent[ODOMETRY.__name__] or sent[VISION_POSITION_ESTIMATE.__name__]:
        yield "covariances are such as give PErr and AErr; unknown where these are the least that VISO_ allows"
    if content.params.get("VISO_TYPE") in (2, 3):
        yield (
            "VISO_TYPE 2 and 3 log poses that are aligned already, and are aligned again here; with "
            "--param VISO_TYPE=1 they are taken as logged"
        )
    yield f"transport time as of {'a link that takes none' if baud is None else f'{baud} baud'} (--baud sets another)"
