# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle tells of itself over MAVLink: which release it is, and its parameters, wherever they are.

Ground stations fetch parameters in two ways. Of the old one the recording holds the autopilot's PARAM_VALUE. The new
one is a file by MAVLink FTP, @PARAM/param.pck; MAVProxy then writes the values as PARAM_VALUE of the vehicle's system
and a component of its own.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

from mav_handlers.transfers.ftp_wire import Opcode, Reply
from mav_handlers.transfers.param_pck import parse_param_pck
from mav_handlers.wire.messages import (
    AUTOPILOT_VERSION,
    FILE_TRANSFER_PROTOCOL,
    HEARTBEAT,
    PARAM_VALUE,
    STATUSTEXT,
    Message,
)
from viso.firmware.flown import FlownVersion, JudgedBy, profile_for, version_in, version_of_number
from viso.firmware.releases import Firmware
from viso.streams.stream import Stream, received_in

MAV_COMP_ID_AUTOPILOT1: Final = 1
MAV_AUTOPILOT_INVALID: Final = 8
_MAV_AUTOPILOT_ARDUPILOTMEGA: Final = 3
_OF_AN_AUTOPILOT: Final = "AHRS_EKF_TYPE"
_LARGEST_FILE: Final = 1 << 20  # of parameters; logs are larger
VEHICLES: Final = {
    kind: vehicle
    for vehicle, kinds in (
        ("Plane", (1, *range(19, 26))),
        ("Copter", (2, 3, 4, 13, 14, 15, 29, 35)),
        ("Rover", (10, 11)),
        ("Sub", (12,)),
        ("Tracker", (5,)),
        ("Blimp", (7,)),
    )
    for kind in kinds
}
"""By MAV_TYPE."""


def is_autopilot(component_id: int, message: Message | None) -> bool:
    """Return whether a message is the heartbeat of an autopilot."""
    is_beat = isinstance(message, HEARTBEAT) and message.autopilot != MAV_AUTOPILOT_INVALID
    return is_beat and component_id == MAV_COMP_ID_AUTOPILOT1


def what_lacks(stream: Stream) -> tuple[str, ...]:
    """Return a note if a recording of a link holds no autopilot, or of one its heartbeats alone."""
    system_id, what = None, "no autopilot is"
    for _, (header, message) in received_in(stream):
        if system_id is None and is_autopilot(header.component_id, message):
            system_id, what = header.system_id, "of the autopilot only heartbeats are"
        sender = header.system_id, header.component_id
        if sender == (system_id, MAV_COMP_ID_AUTOPILOT1) and not isinstance(message, HEARTBEAT):
            return ()
    return (f"{stream.name}: {what} in this recording: what it answered, and what its filter did, is not known",)


def version_heard(stream: Stream) -> FlownVersion | None:
    """Return the release of the autopilot that is heard first, by its own words, else by its number."""
    beat, texts, numbers = None, dict[int, FlownVersion](), dict[int, AUTOPILOT_VERSION]()
    for _, (header, message) in received_in(stream, ("HEARTBEAT", "STATUSTEXT", "AUTOPILOT_VERSION")):
        system_id = header.system_id
        if header.component_id != MAV_COMP_ID_AUTOPILOT1:
            continue
        if isinstance(message, STATUSTEXT) and (told := version_in(message.text)) is not None:
            texts.setdefault(system_id, told)
        elif isinstance(message, AUTOPILOT_VERSION):
            numbers.setdefault(system_id, message)
        elif isinstance(message, HEARTBEAT) and beat is None and is_autopilot(header.component_id, message):
            beat = system_id, message
        if beat is not None and beat[0] in texts:
            return texts[beat[0]]
    if beat is None or beat[0] not in numbers or beat[1].autopilot != _MAV_AUTOPILOT_ARDUPILOTMEGA:
        return None
    return version_told(numbers[beat[0]], beat[1].type)


def version_told(message: AUTOPILOT_VERSION, mav_type: int) -> FlownVersion | None:
    """Return the release of an autopilot by its number; ``mav_type`` is that of its heartbeat."""
    source_hash = bytes(message.flight_custom_version).rstrip(b"\0").decode("ascii", "replace")
    return version_of_number(message.flight_sw_version, source_hash, VEHICLES.get(mav_type, ""))


class HeardValue(NamedTuple):
    """A parameter's value, and when it was heard in us since boot."""

    time_us: int
    name: str
    value: float


class HeardParams(NamedTuple):
    """An autopilot's parameters, in the order in which they were heard, and whether all of them were."""

    values: tuple[HeardValue, ...] = ()
    has_all: bool = False


class _Transfer:
    """The pieces of a file that a client reads by MAVLink FTP."""

    def __init__(self) -> None:
        self._pieces: dict[int, bytes] = {}
        self._latest_us = 0

    def take(self, time_us: int, reply: Reply) -> None:
        self._pieces[reply.offset] = reply.data
        self._latest_us = time_us

    def contradicts(self, reply: Reply) -> bool:
        return self._pieces.get(reply.offset, reply.data) != reply.data

    def params(self) -> tuple[list[HeardValue], int]:
        """Return the parameters up to the first piece that is missing, and how many the vehicle has."""
        data = bytearray()
        for offset, piece in sorted(self._pieces.items()):
            if offset > len(data):
                break
            data[offset : offset + len(piece)] = piece
        params, total = parse_param_pck(bytes(data)) or ((), 0)
        return [HeardValue(self._latest_us, one.name, float(one.value)) for one in params], total


class ParamListener:
    """Collects the parameters of one system out of its messages."""

    MESSAGES: Final = ("PARAM_VALUE", "FILE_TRANSFER_PROTOCOL")

    def __init__(self) -> None:
        self._values: dict[int, list[tuple[HeardValue, int]]] = {}
        self._transfers: dict[tuple[int, int, int], _Transfer] = {}
        self._ended: list[_Transfer] = []

    def take(self, time_us: int, component_id: int, message: Message | None) -> None:
        """Take a message of any component of the system."""
        if isinstance(message, PARAM_VALUE):
            value = HeardValue(time_us, message.param_id, float(message.param_value))
            self._values.setdefault(component_id, []).append((value, message.param_count))
        elif isinstance(message, FILE_TRANSFER_PROTOCOL) and component_id == MAV_COMP_ID_AUTOPILOT1:
            client = message.target_system, message.target_component
            self._take_reply(time_us, client, Reply.parse(bytes(message.payload)))

    def _take_reply(self, time_us: int, client: tuple[int, int], reply: Reply) -> None:
        if reply.opcode != Opcode.ACK:
            return
        key = *client, reply.session
        if reply.req_opcode == Opcode.OPEN_FILE_RO:
            self._end(key)
        elif reply.req_opcode in (Opcode.READ_FILE, Opcode.BURST_READ_FILE) and reply.offset < _LARGEST_FILE:
            if key in self._transfers and self._transfers[key].contradicts(reply):
                self._end(key)  # of another file, whose opening is not in the recording
            self._transfers.setdefault(key, _Transfer()).take(time_us, reply)

    def _end(self, key: tuple[int, int, int]) -> None:
        if key in self._transfers:
            self._ended.append(self._transfers.pop(key))

    def told(self) -> HeardParams:
        """Return what was heard so far."""
        heard, most = list[HeardValue](), 0
        for component_id, values in self._values.items():
            # Cameras and gimbals have parameters as well.
            if component_id == MAV_COMP_ID_AUTOPILOT1 or any(one.name == _OF_AN_AUTOPILOT for one, _ in values):
                heard += [value for value, _ in values]
                most = max(most, *(count for _, count in values))
        for transfer in (*self._ended, *self._transfers.values()):
            values_of_file, total = transfer.params()
            heard += values_of_file
            most = max(most, total)
        heard.sort(key=lambda one: one.time_us)
        return HeardParams(tuple(heard), 0 < most <= len({one.name for one in heard}))


def params_heard(stream: Stream, end: int | None = None) -> HeardParams:
    """Return the parameters of the autopilot that is heard first in a stream, up to the message ``end``, from 0."""
    system_id, listeners = None, dict[int, ParamListener]()
    for number, (header, message) in received_in(stream, {"HEARTBEAT", *ParamListener.MESSAGES}):
        if end is not None and number >= end:
            break
        if system_id is None and is_autopilot(header.component_id, message):
            system_id = header.system_id
        listener = listeners.setdefault(header.system_id, ParamListener())
        listener.take(stream.messages[number].arrival_us or 0, header.component_id, message)
    return HeardParams() if system_id is None else listeners[system_id].told()


def params_of_recording(stream: Stream) -> Mapping[str, float]:
    """Return the vehicle's parameters as its recording has them, else as they were heard first in it."""
    if stream.params:
        return stream.params
    return {one.name: one.value for one in params_heard(stream).values[::-1] if math.isfinite(one.value)}


def firmware_of_recording(stream: Stream, given: Firmware | None = None) -> JudgedBy:
    """Return the release to judge a recording by; ``given`` is the one that the user asks for."""
    return profile_for(stream.flown, params_of_recording(stream), given)
