# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recordings of a vehicle alone, without external navigation: how it is set up is all that they tell."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from ap_core.dataflash import DataFlashWriter
from ap_core.log_structure import FMT, FMTU, MSG, MULT, PARM, UNIT, LogStructure
from ap_core.param import ParamGroup, ParamInfo, ParamTable, ParamType
from mav_handlers.transfers.ftp_wire import DATA_BYTES, Opcode, Reply
from mav_handlers.transfers.param_pck import build_param_pck
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    FILE_TRANSFER_PROTOCOL,
    HEARTBEAT,
    PARAM_VALUE,
    STATUSTEXT,
    SYS_STATUS,
    Message,
)
from viso.streams.stream import Stream
from viso.streams.stream_kinds import read_whole_stream
from viso.streams.telemetry_log import read_telemetry_log

AUTOPILOT: Final = 1
MAVPROXY: Final = 190
CAMERA: Final = 100
COPTER: Final = 2
SUB: Final = 12
BANNER: Final = "ArduCopter V4.6.3 (3fc7011a)"

Said = Sequence[tuple[int, Message]]
"""Who says what, by component."""

GPS_ALONE: Final[Mapping[str, float]] = {
    "AHRS_EKF_TYPE": 3,
    "EK3_ENABLE": 1,
    "VISO_TYPE": 0,
    "SYSID_THISMAV": 1,
    "EK3_SRC1_POSXY": 3,
    "EK3_SRC1_VELXY": 3,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 3,
    "EK3_SRC1_YAW": 1,
}
SOURCES: Final[Mapping[str, float]] = {
    **GPS_ALONE,
    **{f"EK3_SRC1_{name}": 6 for name in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")},
}
READY: Final[Mapping[str, float]] = {**SOURCES, "VISO_TYPE": 1}
MANY: Final[Mapping[str, float]] = {f"SERVO_{number}": number for number in range(400)}


def beats(kind: int = COPTER, banner: str = BANNER, *, sensor: bool | None = None) -> list[tuple[int, Message]]:
    """Return what every autopilot says, and a SYS_STATUS if its sensor of external navigation is told."""
    said: list[tuple[int, Message]] = [(AUTOPILOT, HEARTBEAT(kind, 3, 81, 0, 3, 3)), (AUTOPILOT, STATUSTEXT(6, banner))]
    if sensor is not None:
        said.append((AUTOPILOT, SYS_STATUS(0x80 * sensor | 1, 1, 1, *(0,) * 10)))
    return said


def listed(params: Mapping[str, float], component: int = AUTOPILOT, total: int | None = None) -> Said:
    """Return a list of parameters as PARAM_VALUE of a component; ``total`` is how many there are, if not all are."""
    count = len(params) if total is None else total
    return [
        (component, PARAM_VALUE(name, value, 9, count, index)) for index, (name, value) in enumerate(params.items())
    ]


def packed(params: Mapping[str, float], *, with_defaults: bool = False, lost: int | None = None) -> Said:
    """Return a list of parameters as a transfer of @PARAM/param.pck, of which ``lost`` is a piece that is not there."""
    table = ParamTable([ParamGroup("", [ParamInfo(name, ParamType.FLOAT, 0.0, "") for name in params])])
    for name, value in params.items():
        table.set(name, value)
    return transferred(build_param_pck(table, read_size=DATA_BYTES, with_defaults=with_defaults), lost)


def transferred(data: bytes, lost: int | None = None) -> Said:
    """Return a file that a client reads by FTP, the last piece first and the first twice."""
    pieces = [(offset, data[offset : offset + DATA_BYTES]) for offset in range(0, len(data), DATA_BYTES)]
    kept = [piece for number, piece in enumerate(pieces) if number != lost] or [(0, b"")]
    replies = [
        Reply(1, 5, Opcode.OPEN_FILE_RO, Opcode.ACK, data=bytes(4)),
        *(Reply(2, 5, Opcode.BURST_READ_FILE, Opcode.ACK, offset=offset, data=piece) for offset, piece in kept[::-1]),
        Reply(3, 5, Opcode.READ_FILE, Opcode.ACK, offset=kept[0][0], data=kept[0][1]),
        Reply(4, 5, Opcode.READ_FILE, Opcode.NACK, data=b"\x06"),
    ]
    return [(AUTOPILOT, FILE_TRANSFER_PROTOCOL(0, 255, 190, tuple(reply.pack()))) for reply in replies]


def recorded(folder: Path, *said: Said) -> Stream:
    """Return a telemetry log of messages that came one after the other."""
    codecs: dict[int, Codec] = {}
    data = bytearray()
    for number, (component, message) in enumerate(one for part in said for one in part):
        frame = codecs.setdefault(component, Codec(1, component)).encode(message)
        data += (1_700_000_000_000_000 + 1000 * number).to_bytes(8, "big") + frame
    path = folder / "made.tlog"
    path.write_bytes(data)
    return read_telemetry_log(path, 30_000_000)


def logged(
    folder: Path,
    params: Mapping[str, float],
    banner: str = BANNER,
    records: Sequence[tuple[LogStructure, tuple[Any, ...]]] = (),
) -> Path:
    """Return a DataFlash log of a vehicle with these parameters, and perhaps further records."""
    layouts = {one.name: one for one in (FMT, UNIT, FMTU, MULT, PARM, MSG, *(layout for layout, _ in records))}
    writer = DataFlashWriter(list(layouts.values()))
    parts = list(writer.start_up([(name, value, 0.0) for name, value in params.items()], time_us=1000))
    parts.append(writer.record(MSG, (2000, banner)))
    parts += [writer.record(layout, values) for layout, values in records]
    path = folder / "made.BIN"
    path.write_bytes(b"".join(parts))
    return path


WAYS: Final[Mapping[str, Callable[[Path, Mapping[str, float]], Stream]]] = {
    "PARAM_VALUE": lambda folder, params: recorded(folder, beats(), listed(params)),
    "MAVProxy": lambda folder, params: recorded(folder, beats(), listed(params, MAVPROXY)),
    "FTP": lambda folder, params: recorded(folder, beats(), packed(params)),
    "FTP with defaults": lambda folder, params: recorded(folder, beats(), packed(params, with_defaults=True)),
    "log": lambda folder, params: read_whole_stream(logged(folder, params), 0),
}
"""How a recording comes to hold parameters."""

_SECOND_SET: Final = {**GPS_ALONE, "EK3_SRC2_POSXY": 6, "EK3_SRC2_YAW": 6}
_NO_TYPE: Final = {name: value for name, value in SOURCES.items() if name != "VISO_TYPE"}

SET_UPS: Final[Mapping[str, tuple[Mapping[str, float], list[str]]]] = {
    "nothing asks for it": (GPS_ALONE, ["XN7-17"]),
    "nothing asks, another estimator": ({**GPS_ALONE, "AHRS_EKF_TYPE": 10}, ["XN7-17"]),
    "nothing asks, no compass": ({**GPS_ALONE, "COMPASS_USE": 0}, ["XN7-17"]),
    "sources, type 0": (SOURCES, ["XN7-01"]),
    "sources, type 0, simulated attitude": ({**SOURCES, "AHRS_EKF_TYPE": 10}, ["XN7-01", "XN7-12"]),
    "second set, type 0": (_SECOND_SET, ["XN7-01"]),
    "build without": ({**MANY, **_NO_TYPE}, ["XN7-01"]),
    "all set up": (READY, ["XN1-01"]),
    "type alone": ({**GPS_ALONE, "VISO_TYPE": 1}, ["XN1-01"]),
    "type, EKF2": ({**READY, "AHRS_EKF_TYPE": 2}, ["XN1-01", "XN7-12"]),
    "type, illegal source": ({**READY, "EK3_SRC1_POSZ": 5}, ["XN1-01", "XN7-07"]),
    "type, no yaw": ({**READY, "EK3_SRC1_YAW": 0}, ["XN1-01", "XN7-08"]),
}
"""Parameters of a vehicle to which no external navigation came, and all that is to be found, in the order of codes."""
