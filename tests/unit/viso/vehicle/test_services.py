# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the endpoint offers beside navigation: forwarding, files, logs, signing, and parameters that last."""

import hashlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.verdict import Verdict
from mav_handlers.signing import MemoryKeyStore
from mav_handlers.transfers.ftp_wire import Request
from mav_handlers.transfers.param_pck import parse_query
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    COMMAND_ACK,
    COMMAND_LONG,
    FILE_TRANSFER_PROTOCOL,
    HEARTBEAT,
    LOG_DATA,
    LOG_ENTRY,
    LOG_ERASE,
    LOG_REQUEST_DATA,
    LOG_REQUEST_LIST,
    PARAM_SET,
    SETUP_SIGNING,
    STATUSTEXT,
    VISION_POSITION_ESTIMATE,
    Message,
)
from viso.logs.files import LogStore
from viso.parameters.store import ParamStore
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

M = TypeVar("M", bound=Message)

POSE = VISION_POSITION_ESTIMATE(usec=1, x=1.0, y=2.0, z=3.0, roll=0.0, pitch=0.0, yaw=0.0)
ALIVE = HEARTBEAT(6, 8, 0, 0, 4, 3)
KEY = tuple(hashlib.sha256(b"a key").digest())
OPEN_RO, READ, BURST, LIST = 4, 5, 15, 3
EOF = 6
BOOTING_PERIOD_US = 10_000
"""Of the main loop while nobody looks: as seldom as the sensors allow."""


class Peer:
    """A component on one of the vehicle's links."""

    def __init__(self, rig: "Rig", link: int, system_id: int, component_id: int) -> None:
        self._rig = rig
        self.channel = rig.vehicle.endpoint.channels[link]
        self.codec = Codec(system_id, component_id)
        self._decoder = Codec(system_id, component_id)

    def send(self, message: Message) -> Verdict:
        """Send a message and return the verdict on it."""
        return self._rig.deliver(self, self.codec.encode(message))

    def frames(self) -> list[Received]:
        """Return what has come since the last call."""
        self._decoder.feed(self.channel.take_output())
        return [frame for frame in iter(self._decoder.next_received, None) if isinstance(frame, Received)]

    def got(self, kind: type[M]) -> list[M]:
        """Return the messages of one kind that have come, and forget the others."""
        return [frame.message for frame in self.frames() if isinstance(frame.message, kind)]


class Rig:
    """A vehicle with two links, its logs and its stored parameters in a folder."""

    def __init__(self, folder: Path, **overrides: float) -> None:
        self.logs = LogStore(folder / "logs")
        config = VehicleConfig(
            links=2,
            overrides={"VISO_TYPE": 1, **overrides},
            log_store=self.logs,
            param_store=ParamStore(folder / "storage.parm"),
            signing_store=MemoryKeyStore(),
        )
        self.vehicle = Vehicle(config)
        for name in ("telemetry", "companion"):
            self.vehicle.endpoint.open_channel(name)
        self.scheduler = Scheduler(self.vehicle)
        self.ground = Peer(self, 0, 255, 190)
        self.companion = Peer(self, 1, 1, 197)
        self.scheduler.period_us = BOOTING_PERIOD_US
        self.run(5.0)
        self.scheduler.period_us = LOOP_PERIOD_US
        for peer in (self.ground, self.companion):
            peer.send(ALIVE)
        self.run(0.1)
        for peer in (self.ground, self.companion):
            peer.frames()

    def deliver(self, peer: Peer, data: bytes) -> Verdict:
        while self.vehicle.endpoint.next_event() is not None:
            pass
        self.scheduler.deliver(peer.channel, data)
        event = self.vehicle.endpoint.next_event()
        assert event is not None
        return event.verdict

    def run(self, seconds: float) -> None:
        self.scheduler.run_until(self.scheduler.now_us + round(seconds * 1e6))


MakeRig = Callable[..., Rig]


@pytest.fixture
def make_rig(tmp_path: Path) -> Iterator[MakeRig]:
    rigs: list[Rig] = []

    def make(**overrides: float) -> Rig:
        rigs.append(Rig(tmp_path, **overrides))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.vehicle.close()


@pytest.fixture
def rig(make_rig: MakeRig) -> Rig:
    return make_rig()


# Forwarding


def test_pose_of_a_companion_shows_up_at_the_ground_station_as_it_was_sent(rig: Rig) -> None:
    frame = rig.companion.codec.encode(POSE)
    assert rig.deliver(rig.companion, frame).rule.code == "consumed"
    (seen,) = [received for received in rig.ground.frames() if received.header.name == "VISION_POSITION_ESTIMATE"]
    assert seen.header.frame == frame
    assert (seen.header.system_id, seen.header.component_id) == (1, 197)


def test_nothing_is_forwarded_back_to_where_it_came_from(rig: Rig) -> None:
    rig.companion.send(POSE)
    assert rig.companion.got(VISION_POSITION_ESTIMATE) == []


def test_command_for_a_companion_is_forwarded_and_not_executed(rig: Rig) -> None:
    assert rig.ground.send(COMMAND_LONG(1, 197, 400, 0, 1, 0, 0, 0, 0, 0, 0)).rule.code == "other_target"
    assert [message.command for message in rig.companion.got(COMMAND_LONG)] == [400]
    assert rig.ground.got(COMMAND_ACK) == []
    assert not rig.vehicle.copter.is_armed()


def test_private_link_is_left_out(make_rig: MakeRig) -> None:
    rig = make_rig(MAV1_OPTIONS=2)
    rig.companion.send(POSE)
    assert rig.ground.got(VISION_POSITION_ESTIMATE) == []


@pytest.mark.slow
def test_peer_that_does_not_read_loses_forwarded_frames_which_are_counted(rig: Rig) -> None:
    for _ in range(3000):
        rig.companion.send(POSE)
    assert rig.ground.channel.frames_not_sent > 0
    assert len(rig.ground.channel.take_output()) < 70_000


# Files


def _ask(rig: Rig, opcode: int, data: bytes = b"", *, offset: int = 0, size: int | None = None, seq: int = 1) -> bytes:
    length = len(data) if size is None else size
    header = seq.to_bytes(2, "little") + bytes((0, opcode, length, 0, 0, 0)) + offset.to_bytes(4, "little")
    payload = (header + data).ljust(251, b"\0")
    assert Request.parse(payload) is not None
    rig.ground.send(FILE_TRANSFER_PROTOCOL(0, 1, 1, tuple(payload)))
    replies = rig.ground.got(FILE_TRANSFER_PROTOCOL)
    assert (replies[0].target_system, replies[0].target_component) == (255, 190)
    return bytes(replies[0].payload)


def test_parameters_come_as_one_packed_file(rig: Rig) -> None:
    name = b"@PARAM/param.pck?withdefaults=1"
    assert parse_query("param.pck?withdefaults=1") is not None
    opened = _ask(rig, OPEN_RO, name)
    assert opened[3] == 128
    assert int.from_bytes(opened[12:16], "little") == 12 * rig.vehicle.params.count
    head = _ask(rig, READ, size=200, seq=2)
    assert head[12:14] == bytes((0x1C, 0x67))
    assert int.from_bytes(head[16:18], "little") == rig.vehicle.params.count


def test_opening_the_parameters_introduces_the_vehicle(rig: Rig) -> None:
    _ask(rig, OPEN_RO, b"@PARAM/param.pck")
    rig.run(0.1)
    assert any(rig.vehicle.firmware.version_text in text.text for text in rig.ground.got(STATUSTEXT))


@pytest.mark.parametrize("path", [b"/etc/passwd", b"logs/../storage.parm", b"storage.parm", b"../storage.parm"])
def test_files_outside_the_tree_are_not_there(rig: Rig, path: bytes) -> None:
    assert _ask(rig, OPEN_RO, path)[3] == 129


def test_log_folder_can_be_listed(rig: Rig) -> None:
    listing = _ask(rig, LIST, b"logs")
    assert b"F00000001.BIN\t" in listing


# Logs


def _download(rig: Rig, log_id: int, size: int) -> bytes:
    rig.ground.send(LOG_REQUEST_DATA(1, 1, log_id, 0, size))
    data = b""
    while packets := rig.ground.got(LOG_DATA):
        data += b"".join(bytes(packet.data[: packet.count]) for packet in packets)
        rig.run(0.0025)
    return data


def test_downloaded_log_equals_the_file(rig: Rig) -> None:
    for _ in range(40):
        rig.companion.send(POSE)
        rig.run(0.033)
    rig.ground.frames()
    rig.ground.send(LOG_REQUEST_LIST(1, 1, 0, 0xFFFF))
    (entry,) = rig.ground.got(LOG_ENTRY)
    assert (entry.id, entry.num_logs) == (1, 1)
    data = _download(rig, 1, 0xFFFFFFFF)
    assert data == rig.logs.path_of(1).read_bytes()
    assert len(data) >= entry.size > 10_000


def test_download_closes_the_log_and_another_follows(rig: Rig) -> None:
    _download(rig, 1, 0xFFFFFFFF)
    rig.run(2.0)
    assert rig.logs.log_numbers() == [1, 2]


def test_arming_is_refused_during_a_download(rig: Rig) -> None:
    rig.ground.send(LOG_REQUEST_DATA(1, 1, 1, 0, 0xFFFFFFFF))
    rig.companion.send(POSE)
    rig.ground.send(COMMAND_LONG(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
    rig.run(0.01)
    assert "Arm: Downloading logs" in [text.text for text in rig.ground.got(STATUSTEXT)]


def test_erase_starts_again_with_log_1(rig: Rig) -> None:
    rig.ground.send(LOG_ERASE(1, 1))
    rig.run(2.0)
    assert rig.logs.log_numbers() == [1]
    assert rig.vehicle.logger.is_open


# Signing


def _sign(codec: Codec, frame: bytes) -> bytes:
    signer = dialect.MAVLink(None, srcSystem=1, srcComponent=197)
    signer.signing.secret_key = bytes(KEY)
    signer.signing.sign_outgoing = True
    signer.signing.timestamp = 10**13
    signer.signing.link_id = 1
    decoded = dialect.MAVLink(None).parse_buffer(frame)[0]
    return bytes(decoded.pack(signer))


def test_with_a_key_set_up_unsigned_frames_are_refused_but_on_the_first_link(rig: Rig) -> None:
    assert rig.ground.send(SETUP_SIGNING(1, 1, KEY, 1000)).rule.code == "handled"
    assert rig.companion.send(POSE).kind == "dropped"
    assert rig.ground.send(ALIVE).rule.code == "handled"


def test_signed_frames_are_taken_and_answers_are_signed(rig: Rig) -> None:
    rig.ground.send(SETUP_SIGNING(1, 1, KEY, 1000))
    signed = _sign(rig.companion.codec, rig.companion.codec.encode(POSE))
    assert rig.deliver(rig.companion, signed).rule.code == "consumed"
    rig.run(1.1)
    beats = [frame for frame in rig.companion.frames() if frame.header.name == "HEARTBEAT"]
    assert beats
    assert all(frame.header.frame[2] & 1 for frame in beats)


def test_key_is_not_forwarded(rig: Rig) -> None:
    rig.ground.send(SETUP_SIGNING(1, 197, KEY, 1000))
    assert rig.companion.got(SETUP_SIGNING) == []


# Parameters that last


def test_set_parameter_survives_a_restart(make_rig: MakeRig) -> None:
    first = make_rig()
    first.ground.send(PARAM_SET(1, 1, "VISO_DELAY_MS", 42.0, 9))
    first.run(1.1)
    assert make_rig().vehicle.params.get_int("VISO_DELAY_MS") == 42


def test_set_parameter_survives_closing_at_once(make_rig: MakeRig) -> None:
    first = make_rig()
    first.ground.send(PARAM_SET(1, 1, "VISO_SCALE", 1.25, 9))
    first.vehicle.close()
    assert float(make_rig().vehicle.params.get_float("VISO_SCALE")) == 1.25


@pytest.mark.slow
def test_value_of_the_command_line_wins_over_a_stored_one_and_is_not_stored(make_rig: MakeRig) -> None:
    first = make_rig()
    first.ground.send(PARAM_SET(1, 1, "VISO_DELAY_MS", 42.0, 9))
    first.vehicle.close()
    assert make_rig(VISO_DELAY_MS=7).vehicle.params.get_int("VISO_DELAY_MS") == 7
    assert make_rig().vehicle.params.get_int("VISO_DELAY_MS") == 42
