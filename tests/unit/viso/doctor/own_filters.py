# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs and telemetry of vehicles whose filter says what a test wants it to say."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from ap_core.dataflash_columns import LogColumns
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import EKF_STATUS_REPORT, HEARTBEAT, PARAM_VALUE, STATUSTEXT, SYS_STATUS, Message
from tests.unit.viso.report.log_maker import NAVIGATES, LogMaker
from viso.doctor.evidence.own_filter import OwnFilter
from viso.doctor.evidence.own_log import own_filter_in
from viso.doctor.evidence.vehicle_data import listen
from viso.streams.stream_kinds import Stream, StreamMessage

EXTNAV: Final[Mapping[str, float]] = {
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 0,
    "EK3_SRC1_YAW": 6,
}
GPS: Final[Mapping[str, float]] = {
    "EK3_SRC1_POSXY": 3,
    "EK3_SRC1_VELXY": 3,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 3,
    "EK3_SRC1_YAW": 1,
}
QUIET: Final[Mapping[str, Any]] = {"SV": 0.1, "SP": 0.2, "SH": 0.05, "SM": 0.1, "SS": NAVIGATES, "TS": 0x30}
AUTOPILOT: Final = (1, 1)
VISION_BIT: Final = 1 << 7
ARMED: Final = 128

Status = Callable[[float], Mapping[str, Any]]


def quiet(_time_s: float) -> Mapping[str, Any]:
    """Return nothing that differs from a filter that is content."""
    return {}


def during(start_s: float, end_s: float, **fields: Any) -> Status:
    """Return what a filter says within a time."""
    return lambda time_s: fields if start_s <= time_s < end_s else {}


def logged(
    status: Status = quiet,
    params: Mapping[str, float] = EXTNAV,
    length_s: float = 60.0,
    others: Sequence[tuple[float, str, Mapping[str, Any]]] = (),
    cores: Mapping[int, Status] | None = None,
) -> LogMaker:
    """Return a log of a vehicle from 10 s after boot on, with ten XKF4 a second.

    Args:
        status: what they say beside ``QUIET``, by the time since the log's begin.
        params: at boot.
        length_s: of the log.
        others: other records: time since the log's begin, name, fields.
        cores: what further cores say.
    """
    maker = LogMaker()
    for name, value in params.items():
        maker.parameter(name, value)
    rows = [(time_s, name, dict(fields)) for time_s, name, fields in others]
    for number in range(int(length_s * 10) + 1):
        time_s = number * 0.1
        for core, of_core in {0: status, **(cores or {})}.items():
            rows.append((time_s, "XKF4", {**QUIET, "C": core, **of_core(time_s)}))
    for time_s, name, fields in sorted(rows, key=lambda row: row[0]):
        maker.add(name, 10.0 + time_s, **fields)
    return maker


def own_of(maker: LogMaker) -> OwnFilter:
    """Return what the filter of a made log said."""
    return own_filter_in(LogColumns(maker.data))


def heartbeat(*, armed: bool = False) -> HEARTBEAT:
    """Return an autopilot's heartbeat."""
    return HEARTBEAT(2, 3, ARMED * armed, 0, 4, 3)


def report(**fields: Any) -> EKF_STATUS_REPORT:
    """Return a report of a filter that is content, but for some fields."""
    ratios = {"velocity_variance": 0.1, "pos_horiz_variance": 0.2, "pos_vert_variance": 0.05, "compass_variance": 0.1}
    values = {"flags": 0x33F, **ratios, "terrain_alt_variance": 0.0, **fields}
    return EKF_STATUS_REPORT(**values)


def sys_status(*, healthy: bool, enabled: bool = True) -> SYS_STATUS:
    """Return what the autopilot says of its vision sensor."""
    bits = (VISION_BIT * enabled, VISION_BIT * enabled, VISION_BIT * healthy)
    return SYS_STATUS(*bits, *(0,) * 10)


def heard(
    messages: Sequence[tuple[float, Message]],
    params: Mapping[str, float] = EXTNAV,
    sender: tuple[int, int] = AUTOPILOT,
) -> OwnFilter | None:
    """Return what is heard of a filter in telemetry of an autopilot: its parameters first, then some messages."""
    codecs = {AUTOPILOT: Codec(*AUTOPILOT), sender: Codec(*sender)}
    frames = [StreamMessage(0, codecs[AUTOPILOT].encode(heartbeat()))]
    for number, (name, value) in enumerate(params.items()):
        told = PARAM_VALUE(name, value, 9, len(params), number)
        frames.append(StreamMessage(0, codecs[AUTOPILOT].encode(told)))
    for time_s, message in messages:
        frames.append(StreamMessage(round(time_s * 1e6), codecs[sender].encode(message)))
    return listen(Stream("made", tuple(frames))).own_filter


def text(said: str, severity: int = 4) -> STATUSTEXT:
    """Return a text of the autopilot."""
    return STATUSTEXT(severity, said)
