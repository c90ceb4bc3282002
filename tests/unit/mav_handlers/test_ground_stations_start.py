# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What ground stations ask as they connect: everything is answered that the firmware answers, and nothing else."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.transfers.ftp_wire import Opcode
from mav_handlers.wire import messages as m
from mav_handlers.wire.codec import Received, message_name
from mav_handlers.wire.messages import Message

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import MakeBench

REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 512, 511
SENT_MESSAGES: Final = (148, 242, 49, 24, 30, 33, 1, 65)
"""AUTOPILOT_VERSION, HOME_POSITION, GPS_GLOBAL_ORIGIN, GPS_RAW_INT, ATTITUDE, GLOBAL_POSITION_INT, SYS_STATUS, RC."""
NOT_HERE: Final = (300, 397, 395, 259, 280, 411)
"""PROTOCOL_VERSION, COMPONENT_METADATA, COMPONENT_INFORMATION, cameras', gimbals', CURRENT_EVENT_SEQUENCE."""
STREAMS: Final = (1, 2, 3, 6, 10, 11, 12)
OLD_STYLE_PARAMS: Final = ("SYSID_SW_MREV", "MAV_TYPE", "BRD_SERIAL_NUM", "NO_SUCH_PARAM")


@dataclass(frozen=True, slots=True)
class Question:
    """A request, and by which message it is answered; by none if ``answer`` is None."""

    request: Message | bytes
    answer: Callable[[Message], bool] | None


def _command(number: int, *params: float) -> m.COMMAND_LONG:
    return m.COMMAND_LONG(1, 1, number, 0, *(*params, *(0.0,) * 7)[:7])


def _acknowledges(number: int) -> Callable[[Message], bool]:
    return lambda told: isinstance(told, m.COMMAND_ACK) and told.command == number


def _is_a(kind: type[Message], **fields: Any) -> Callable[[Message], bool]:
    return lambda told: isinstance(told, kind) and all(getattr(told, name) == to for name, to in fields.items())


def _raw(raw: Any) -> bytes:
    return bytes(raw.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=190)))


def _commands(*numbers: int) -> Iterator[Question]:
    for number in numbers:
        yield Question(_command(number), _acknowledges(number))


def _asking_for(ids: Sequence[int]) -> Iterator[Question]:
    for number in ids:
        yield Question(_command(REQUEST_MESSAGE, number), _acknowledges(REQUEST_MESSAGE))


def _missions() -> Iterator[Question]:
    for kind in (0, 1, 2):
        yield Question(m.MISSION_REQUEST_LIST(1, 1, kind), _is_a(m.MISSION_COUNT, mission_type=kind))
        yield Question(m.MISSION_REQUEST_INT(1, 1, 7, kind), _is_a(m.MISSION_ACK, mission_type=kind))


def _unanswered() -> Iterator[Question]:
    """Yield what this firmware knows no answer to: pings, extended parameters, and points of the old protocols."""
    yield Question(_raw(dialect.MAVLink_ping_message(1, 0, 0, 0)), None)
    yield Question(_raw(dialect.MAVLink_ping_message(1, 0, 1, 1)), None)
    yield Question(_raw(dialect.MAVLink_param_ext_request_list_message(1, 1)), None)
    yield Question(_raw(dialect.MAVLink_param_ext_request_read_message(1, 1, b"CAM_MODE", -1)), None)
    yield Question(_raw(dialect.MAVLink_fence_fetch_point_message(1, 1, 0)), None)
    yield Question(_raw(dialect.MAVLink_rally_fetch_point_message(1, 1, 0)), None)


def _qgroundcontrol() -> Iterator[Question]:
    yield from _asking_for((148, 300))
    yield from _commands(520, 519)
    yield from _asking_for((435, 397, 395))
    yield Question(_command(REQUEST_MESSAGE, 435), _is_a(m.AVAILABLE_MODES))
    yield from _unanswered()
    for stream in STREAMS:
        yield Question(m.REQUEST_DATA_STREAM(1, 1, 2, stream, 1), None)
    yield Question(_ftp("@PARAM/param.pck"), _is_a(m.FILE_TRANSFER_PROTOCOL))
    yield Question(m.PARAM_REQUEST_LIST(1, 1), _is_a(m.PARAM_VALUE, param_index=0))
    for index in range(20):
        yield Question(m.PARAM_REQUEST_READ(1, 1, "", index), _is_a(m.PARAM_VALUE, param_index=index))
    yield from _missions()
    yield from _commands(410)
    yield from _asking_for((*SENT_MESSAGES, *NOT_HERE))
    yield Question(_command(SET_MESSAGE_INTERVAL, 242, 1e6), _acknowledges(SET_MESSAGE_INTERVAL))
    yield Question(m.TIMESYNC(0, 123_456_789), _is_a(m.TIMESYNC, ts1=123_456_789))


def _mission_planner() -> Iterator[Question]:
    for stream in STREAMS:
        yield Question(m.REQUEST_DATA_STREAM(1, 1, 4, stream, 1), None)
    yield from _commands(520, 42428)
    yield from _asking_for(SENT_MESSAGES)
    yield Question(m.AUTOPILOT_VERSION_REQUEST(1, 1), _is_a(m.AUTOPILOT_VERSION))
    yield Question(_ftp("@PARAM/param.pck?withdefaults=1"), _is_a(m.FILE_TRANSFER_PROTOCOL))
    for name in OLD_STYLE_PARAMS:
        yield Question(m.PARAM_REQUEST_READ(1, 1, name, -1), None)
    for name in ("MAV_SYSID", "VISO_TYPE", "EK3_SRC1_POSXY", "STAT_BOOTCNT", "FORMAT_VERSION"):
        yield Question(m.PARAM_REQUEST_READ(1, 1, name, -1), _is_a(m.PARAM_VALUE, param_id=name))
    for index in range(5):
        yield Question(m.PARAM_REQUEST_READ(1, 1, "", index), _is_a(m.PARAM_VALUE, param_index=index))
    yield from _unanswered()
    yield from _missions()
    yield Question(m.LOG_REQUEST_LIST(1, 1, 0, 0xFFFF), _is_a(m.LOG_ENTRY))
    yield from _commands(410, 2000, 2505, 521, 527)
    yield Question(m.COMMAND_INT(1, 1, 0, REQUEST_MESSAGE, 0, 0, 148.0, *(0.0,) * 3, 0, 0, 0.0), _is_a(m.COMMAND_ACK))
    for message in (m.SYSTEM_TIME(1_700_000_000_000_000, 0), m.HEARTBEAT(6, 8, 0, 0, 4, 3)):
        yield Question(message, None)


def _ftp(path: str) -> m.FILE_TRANSFER_PROTOCOL:
    name = path.encode()
    head = bytes((0, 0, 0, Opcode.OPEN_FILE_RO, len(name), 0, 0, 0, 0, 0, 0, 0))
    return m.FILE_TRANSFER_PROTOCOL(0, 1, 1, tuple((head + name).ljust(251, b"\0")))


STATIONS: Final = {"QGroundControl": _qgroundcontrol, "Mission Planner": _mission_planner}


@pytest.mark.parametrize("station", STATIONS)
def test_first_requests_are_answered_as_the_firmware_does(make_bench: "MakeBench", station: str) -> None:
    bench = make_bench(until_ms=7000)
    client, questions = bench.client, list(STATIONS[station]())
    assert len(questions) >= 50
    frames: list[Received] = []
    for question in questions:
        request = question.request
        client.send_bytes(request if isinstance(request, bytes) else client.codec.encode(request))
        bench.run_ms(2.5)
        frames += client.read_received()
    bench.run_ms(400)
    frames += client.read_received()
    told = [frame.message for frame in frames if frame.message is not None]
    unanswered = [one.request for one in questions if one.answer is not None and not any(map(one.answer, told))]
    assert unanswered == []
    asked_in_vain = {"PING", "PARAM_EXT_VALUE", "FENCE_POINT", "RALLY_POINT", "PARAM_ERROR"}
    assert asked_in_vain.isdisjoint(frame.header.name for frame in frames)
    assert not {one.param_id for one in told if isinstance(one, m.PARAM_VALUE)} & set(OLD_STYLE_PARAMS)


def test_every_message_that_is_asked_for_is_one() -> None:
    assert None not in [message_name(number) for number in SENT_MESSAGES]
