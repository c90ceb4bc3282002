# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How requests for files, logs and signing reach their servers, and who gets the answers."""

import struct
from typing import TYPE_CHECKING

import pytest

from mav_handlers.transfers.ftp_wire import PAYLOAD_BYTES, Opcode
from mav_handlers.verdicts import HANDLED, LOG_ARMED, LOG_NOT_READY
from mav_handlers.wire.messages import (
    FILE_TRANSFER_PROTOCOL,
    LOG_ERASE,
    LOG_REQUEST_DATA,
    LOG_REQUEST_END,
    LOG_REQUEST_LIST,
    SETUP_SIGNING,
    STATUSTEXT,
    Message,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

PARAMETER_FILE = b"@PARAM/param.pck"
KEY = SETUP_SIGNING(1, 1, (7,) * 32, 1000)


def to_open(name: bytes) -> FILE_TRANSFER_PROTOCOL:
    payload = struct.pack("<HBBBBBxI", 1, 0, Opcode.OPEN_FILE_RO, len(name), 0, 0, 0) + name
    return FILE_TRANSFER_PROTOCOL(0, 1, 1, tuple(payload.ljust(PAYLOAD_BYTES, b"\0")))


def opcodes(client: "Client") -> list[int]:
    return [reply.payload[3] for reply in client.read_of(FILE_TRANSFER_PROTOCOL)]


class TestFiles:
    """FILE_TRANSFER_PROTOCOL."""

    def test_request_is_answered_to_its_sender(self, client: "Client") -> None:
        assert client.tell(to_open(PARAMETER_FILE)) is HANDLED
        [reply] = client.read_of(FILE_TRANSFER_PROTOCOL)
        assert (reply.target_system, reply.target_component) == (255, 190)
        assert (reply.payload[0], reply.payload[3]) == (2, Opcode.ACK)

    def test_answer_goes_to_the_link_of_the_request(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, 115200))
        bench.clients[1].tell(to_open(PARAMETER_FILE))
        assert [opcodes(client) for client in bench.clients] == [[], [Opcode.ACK]]

    def test_opening_the_parameters_is_followed_by_the_banner(self, bench: "Bench", client: "Client") -> None:
        client.tell(to_open(PARAMETER_FILE))
        bench.run_ms(3)
        kinds = [type(message) for message in client.read()]
        assert kinds == [FILE_TRANSFER_PROTOCOL, STATUSTEXT, STATUSTEXT, STATUSTEXT]

    def test_file_that_is_not_there_is_refused_without_a_banner(self, bench: "Bench", client: "Client") -> None:
        client.tell(to_open(b"nothing"))
        bench.run_ms(3)
        [reply] = client.read()
        assert isinstance(reply, FILE_TRANSFER_PROTOCOL)
        assert reply.payload[3] == Opcode.NACK


@pytest.mark.parametrize(
    "message",
    [LOG_REQUEST_LIST(1, 1, 0, 1), LOG_REQUEST_DATA(1, 1, 1, 0, 9), LOG_REQUEST_END(1, 1), LOG_ERASE(1, 1)],
    ids=lambda message: type(message).__name__,
)
class TestLogs:
    """LOG_REQUEST_LIST, LOG_REQUEST_DATA, LOG_REQUEST_END, LOG_ERASE."""

    def test_request_while_booting_is_ignored_in_silence(self, make_bench: "MakeBench", message: Message) -> None:
        bench = make_bench(until_ms=0)
        assert bench.client.tell(message) is LOG_NOT_READY
        assert bench.client.read() == []

    def test_request_while_armed_is_refused_to_the_asking_link(self, make_bench: "MakeBench", message: Message) -> None:
        bench = make_bench(bauds=(None, None), until_ms=7000)
        for client in bench.clients:
            client.command(400, 1, 21196)
        bench.run_ms(3)
        for client in bench.clients:
            client.read()
        assert bench.clients[1].tell(message) is LOG_ARMED
        bench.run_ms(3)
        assert [client.read_texts() for client in bench.clients] == [[], ["Disarm for log download"]]


class TestSigning:
    """SETUP_SIGNING."""

    def test_refusal_while_armed_is_told_to_the_asking_link_alone(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None), until_ms=7000)
        for client in bench.clients:
            client.command(400, 1, 21196)
        bench.run_ms(3)
        for client in bench.clients:
            client.read()
        bench.clients[1].tell(KEY)
        bench.run_ms(3)
        assert [client.read_texts() for client in bench.clients] == [[], ["ERROR: Won't setup signing when armed"]]
