# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The byte entry point as a fuzz target: what a string of operations does to a fresh vehicle with two links.

An operation begins with a byte: its lowest three bits choose the operation, the next one the link. Whole frames get
their checksum here, for a fuzzer does not guess one. Where the data end in the middle, zeros follow.
"""

import functools
import struct
from collections import Counter
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from mav_handlers.channel import OUTPUT_LIMIT_BYTES, Channel
from mav_handlers.endpoint import MessageEvent
from mav_handlers.handlers import HANDLERS
from mav_handlers.handlers.commands import COMMANDS
from mav_handlers.params.reads import READ_QUEUE_LENGTH
from mav_handlers.statustext import QUEUE_CAPACITY
from mav_handlers.wire.codec import DRAFTS, message_id
from viso.logs.files import LogStore
from viso.logs.logger import MemoryLog
from viso.parameters.table import make_groups
from viso.vehicle.vehicle import Vehicle, VehicleConfig

BAUDS = (None, 57600)
LINKS = len(BAUDS)
MAX_OPERATIONS = 60
BOOT_US = (0, 2_500_000, 3_600_000, 5_000_000)
HANDLED_IDS = sorted(message_id(cls.__name__) for cls in HANDLERS)
DEFINITIONS = {**dialect.mavlink_map, **{draft.id: draft for draft in DRAFTS}}
ALL_IDS = sorted(DEFINITIONS)
COMMAND_NUMBERS = sorted(COMMANDS)
SOURCES = ((255, 190), (1, 197), (1, 1), (0, 0), (7, 1), (51, 68))
LONGEST_REPLY_BYTES = 8 * 280


@functools.cache
def parameter_names() -> tuple[str, ...]:
    """Return the names of all parameters of a vehicle with two links."""
    return tuple(param.name for param in ParamTable(make_groups(LINKS, make_params())))


class _Reader:
    """Takes numbers off the data, zeros once they are used up."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    @property
    def at_end(self) -> bool:
        return self._at >= len(self._data)

    def take(self, count: int) -> bytes:
        taken = self._data[self._at : self._at + count]
        self._at += count
        return taken.ljust(count, b"\0")

    def byte(self) -> int:
        return self.take(1)[0]

    def word(self) -> int:
        return int.from_bytes(self.take(2), "little")


def frame_of(msg_id: int, payload: bytes, source: tuple[int, int], sequence: int, version: int) -> bytes:
    """Return a frame with the right checksum; version 1 is for ids below 256, and its payload has its full length."""
    cls = DEFINITIONS.get(msg_id)
    if version == 1:
        length = cls.unpacker.size if cls is not None else len(payload)
        body = bytes((length, sequence, *source, msg_id & 255)) + payload[:length].ljust(length, b"\0")
        start = dialect.PROTOCOL_MARKER_V1
    else:
        body = bytes((len(payload), 0, 0, sequence, *source)) + msg_id.to_bytes(3, "little") + payload
        start = dialect.PROTOCOL_MARKER_V2
    crc = dialect.x25crc(body + bytes((cls.crc_extra if cls is not None else 0,))).crc
    return bytes((start,)) + body + struct.pack("<H", crc)


class _Run:
    """One vehicle, and what it has been given so far."""

    def __init__(self, folder: Path) -> None:
        self.logs: list[MemoryLog] = []
        self._config = VehicleConfig(
            links=LINKS,
            defaults={"VISO_TYPE": 3, "MAV1_EXTRA1": 10},
            open_log=self._open_log,
            log_store=LogStore(folder),
        )
        self._sequence = 0
        self._boot()

    def _boot(self) -> None:
        self.now_us = 0
        self.vehicle = Vehicle(self._config)
        endpoint = self.vehicle.endpoint
        self.channels = [endpoint.open_channel(f"link{number}", baud=baud) for number, baud in enumerate(BAUDS)]
        self._frame_bytes = [0] * LINKS
        self._verdicts: list[Counter[tuple[str, str]]] = [Counter() for _ in range(LINKS)]
        endpoint.on_event = self._take_event
        for time_us in BOOT_US:
            self.pass_time(time_us)

    def _open_log(self) -> MemoryLog:
        self.logs.append(MemoryLog())
        return self.logs[-1]

    def _take_event(self, event: MessageEvent) -> None:
        if event.header is not None:
            self._frame_bytes[event.channel] += len(event.header.frame)
            self._verdicts[event.channel][event.name, event.verdict.rule.code] += 1

    def pass_time(self, time_us: int) -> None:
        self.now_us = time_us
        self.vehicle.advance(range(time_us, time_us + 1))

    def deliver(self, channel: Channel, data: bytes) -> None:
        self.vehicle.receive_bytes(channel, data)

    def operate(self, reader: _Reader) -> None:
        """Do the next operation."""
        head = reader.byte()
        channel = self.channels[head >> 3 & 1]
        match head & 7:
            case 0:
                self.deliver(channel, reader.take(reader.byte()))
            case 1 | 2 | 3 as how:
                ids = ALL_IDS if how == 3 else HANDLED_IDS
                self._send(reader, channel, ids[reader.word() % len(ids)], version=1 if how == 2 else 2)
            case 4:
                self._damage(reader, channel)
            case 5:
                self.pass_time(self.now_us + 2500 * (1 << reader.byte() % 24))
            case 6:
                self._set_parameter(reader, channel)
            case _:
                self._command(reader, channel)
        if self.vehicle.reboot_requested:
            self.finish()
            self._boot()

    def _source(self, reader: _Reader) -> tuple[int, int]:
        return SOURCES[reader.byte() % len(SOURCES)]

    def _frame(self, msg_id: int, payload: bytes, source: tuple[int, int], version: int = 2) -> bytes:
        self._sequence = (self._sequence + 1) % 256
        return frame_of(msg_id, payload, source, self._sequence, version)

    def _send(self, reader: _Reader, channel: Channel, msg_id: int, version: int) -> None:
        source = self._source(reader)
        payload = reader.take(reader.byte())
        self.deliver(channel, self._frame(msg_id, payload, source, version if msg_id < 256 else 2))

    def _damage(self, reader: _Reader, channel: Channel) -> None:
        """Send a frame with one byte changed, and cut short."""
        msg_id = HANDLED_IDS[reader.byte() % len(HANDLED_IDS)]
        at, mask, kept = reader.byte(), reader.byte(), reader.byte()
        frame = bytearray(self._frame(msg_id, reader.take(reader.byte()), SOURCES[0]))
        frame[at % len(frame)] ^= mask
        self.deliver(channel, bytes(frame[: len(frame) - kept % 4]))

    def _set_parameter(self, reader: _Reader, channel: Channel) -> None:
        names = parameter_names()
        name = names[reader.word() % len(names)].encode()
        payload = reader.take(4) + bytes((0, 0)) + name.ljust(16, b"\0") + bytes((9,))
        self.deliver(channel, self._frame(dialect.MAVLINK_MSG_ID_PARAM_SET, payload, SOURCES[0]))

    def _command(self, reader: _Reader, channel: Channel) -> None:
        number = COMMAND_NUMBERS[reader.byte() % len(COMMAND_NUMBERS)]
        kind = dialect.MAVLINK_MSG_ID_COMMAND_INT if reader.byte() & 1 else dialect.MAVLINK_MSG_ID_COMMAND_LONG
        payload = reader.take(28) + number.to_bytes(2, "little") + bytes((0, 0)) + reader.take(3)
        self.deliver(channel, self._frame(kind, payload, SOURCES[0]))

    def check(self) -> None:
        """Assert what must hold at any time."""
        for channel in self.channels:
            bad = sum(amount for key, amount in channel.counters.items() if key[0] == "BAD_DATA")
            counted = self._frame_bytes[channel.index] + bad + channel.codec.unread_bytes
            assert channel.bytes_received == counted, "bytes that are in no frame and in no count"
            verdicts = Counter({key: n for key, n in channel.counters.items() if key[0] != "BAD_DATA"})
            heard = self._verdicts[channel.index]
            assert Counter({(name, code): n for (name, _, code), n in verdicts.items()}) == heard
            assert sum(heard.values()) == channel.frames_received
            assert len(channel.take_output()) < OUTPUT_LIMIT_BYTES + LONGEST_REPLY_BYTES
        assert len(self.vehicle.texts.pending()) <= QUEUE_CAPACITY
        assert self.vehicle.endpoint.param_reads.waiting <= READ_QUEUE_LENGTH

    def finish(self) -> None:
        """Let the vehicle send what it still has to, close it, and look at its logs."""
        for _ in range(3):
            self.pass_time(self.now_us + 100_000)
            self.check()
        self.vehicle.close()
        for log in self.logs:
            assert log_is_whole(log.data), "a log that is no chain of records"


def log_is_whole(data: bytes | bytearray) -> bool:
    """Return whether a log consists of nothing but records of described types."""
    lengths = {128: 89}
    at = 0
    while at < len(data):
        if data[at : at + 2] != b"\xa3\x95" or data[at + 2] not in lengths:
            return False
        if data[at + 2] == 128:
            lengths[data[at + 3]] = data[at + 4]
        at += lengths[data[at + 2]]
    return at == len(data)


def _put_logs(folder: Path) -> None:
    """Let a folder hold the two logs that a vehicle finds, whatever the one before did to them."""
    for number, size in ((1, 300), (2, 90)):
        path = folder / f"{number:08d}.BIN"
        if not path.exists():
            path.write_bytes(bytes(number for _ in range(size)))


def run(data: bytes, folder: Path) -> None:
    """Do what the data say to a fresh vehicle.

    Args:
        data: operations.
        folder: for the vehicle's logs; nothing else is to use it.

    Raises:
        Exception: a finding.
    """
    _put_logs(folder)
    vehicle = _Run(folder)
    reader = _Reader(data)
    for _ in range(MAX_OPERATIONS):
        if reader.at_end:
            break
        vehicle.operate(reader)
        vehicle.check()
    vehicle.finish()
