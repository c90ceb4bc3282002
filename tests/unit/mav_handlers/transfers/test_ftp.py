# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The FTP server against files in memory: every operation, sessions, repetition, bursts in steps."""

import errno
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.transfers.ftp import FtpPeer, FtpReply, FtpServer
from mav_handlers.transfers.ftp_ports import Entry, Failure, FtpFiles, ReadableFile, WritableFile
from mav_handlers.transfers.ftp_wire import Opcode

ACK, NACK = 128, 129
GCS = FtpPeer(0, 255, 190)
OTHER = FtpPeer(1, 254, 190)
LONG = bytes(range(256)) * 20
SHORT = b"short"


@dataclass
class Memory:
    """An open file in memory; reading from ``bad_from`` on fails, writing beyond 1000 fails."""

    data: bytearray
    bad_from: int | None = None
    closed: bool = False

    @property
    def size(self) -> int:
        return len(self.data)

    def read(self, offset: int, count: int) -> bytes | Failure:
        assert not self.closed
        if self.bad_from is not None and offset >= self.bad_from:
            return Failure(errno.EIO)
        return bytes(self.data[offset : offset + count])

    def write(self, offset: int, data: bytes) -> Failure | None:
        assert not self.closed
        if offset > 1000:
            return Failure(errno.ENOSPC)
        self.data[offset : offset + len(data)] = data
        return None

    def close(self) -> None:
        self.closed = True


@dataclass
class Tree:
    """Files in memory, one directory."""

    contents: dict[str, bytes] = field(default_factory=dict)
    listing: Sequence[Entry] = ()
    bad_from: int | None = None
    opened: list[Memory] = field(default_factory=list)
    calls: list[tuple[str, ...]] = field(default_factory=list)

    def list_directory(self, path: str) -> Sequence[Entry] | Failure:
        self.calls.append(("list", path))
        return self.listing if path in ("/", "/dir") else Failure(errno.ENOTDIR)

    def open_read(self, path: str) -> ReadableFile | Failure:
        if path not in self.contents:
            return Failure(errno.ENOENT)
        self.opened.append(Memory(bytearray(self.contents[path]), self.bad_from))
        return self.opened[-1]

    def open_write(self, path: str, *, create: bool) -> WritableFile | Failure:
        self.calls.append(("write", path, "create" if create else "keep"))
        if path == "locked":
            return Failure(errno.EROFS)
        self.opened.append(Memory(bytearray()))
        return self.opened[-1]

    def remove(self, path: str) -> Failure | None:
        self.calls.append(("remove", path))
        return None if path in self.contents else Failure(errno.ENOENT)

    def make_directory(self, path: str) -> Failure | None:
        self.calls.append(("mkdir", path))
        return Failure(errno.EEXIST) if path in self.contents else None

    def rename(self, old_path: str, new_path: str) -> Failure | None:
        self.calls.append(("rename", old_path, new_path))
        return None if old_path in self.contents else Failure(errno.EACCES)


@dataclass(frozen=True)
class Answer:
    """A reply taken apart."""

    seq: int
    session: int
    opcode: int
    req_opcode: int
    burst_complete: int
    offset: int
    data: bytes


def take_apart(reply: FtpReply) -> Answer:
    payload = reply.payload
    assert len(payload) == 251
    seq, session, opcode, size, req_opcode, burst_complete, pad, offset = struct.unpack_from("<HBBBBBBI", payload)
    assert pad == 0
    assert payload[12 + size :] == bytes(239 - size)
    return Answer(seq, session, opcode, req_opcode, burst_complete, offset, payload[12 : 12 + size])


def make_request(
    opcode: int, data: bytes = b"", *, seq: int, session: int = 0, offset: int = 0, size: int | None = None
) -> bytes:
    length = len(data) if size is None else size
    return (struct.pack("<HBBBBBBI", seq, session, opcode, length, 0, 0, 0, offset) + data).ljust(251, b"\0")


class Client:
    """Numbers its requests and knows the time."""

    def __init__(self, files: FtpFiles) -> None:
        self.texts: list[tuple[int, str]] = []
        self.full: set[int] = set()
        self.server = FtpServer(
            files, lambda severity, text: self.texts.append((severity, text)), lambda channel: channel not in self.full
        )
        self.now_us = 10_000_000
        self.seq = 100
        self.last_request = b""

    def send(self, payload: bytes, peer: FtpPeer = GCS) -> list[Answer]:
        self.last_request = payload
        return [take_apart(reply) for reply in self.server.handle(payload, self.now_us, peer)]

    def ask_all(
        self,
        opcode: int,
        data: bytes = b"",
        *,
        session: int = 0,
        offset: int = 0,
        size: int | None = None,
        peer: FtpPeer = GCS,
    ) -> list[Answer]:
        self.seq += 1000
        request = make_request(opcode, data, seq=self.seq, session=session, offset=offset, size=size)
        return self.send(request, peer)

    def ask(
        self, opcode: int, data: bytes = b"", *, session: int = 0, offset: int = 0, size: int | None = None
    ) -> Answer:
        [answer] = self.ask_all(opcode, data, session=session, offset=offset, size=size)
        return answer

    def go_on(self) -> list[Answer]:
        return [take_apart(reply) for reply in self.server.continue_burst(self.now_us)]

    def pass_ms(self, duration_ms: int) -> None:
        self.now_us += duration_ms * 1000


@pytest.fixture
def tree() -> Tree:
    return Tree({"long": LONG, "short": SHORT, "empty": b"", "@PARAM/param.pck": b"p", "/@PARAM/param.pck": b"p"})


@pytest.fixture
def client(tree: Tree) -> Client:
    return Client(tree)


def test_nothing_is_acknowledged_with_the_next_number(client: Client) -> None:
    answer = client.ask(Opcode.NONE, session=7)
    assert answer == Answer(client.seq + 1, 7, ACK, Opcode.NONE, 0, 0, b"")


def test_number_wraps_after_65535(client: Client) -> None:
    [answer] = client.send(make_request(Opcode.NONE, seq=65535))
    assert answer.seq == 0


@pytest.mark.parametrize("opcode", [Opcode.TRUNCATE_FILE, 16, 77, 255])
def test_unknown_operation_fails_and_is_told(client: Client, opcode: int) -> None:
    answer = client.ask(opcode)
    assert (answer.opcode, answer.req_opcode, answer.data) == (NACK, opcode, b"\x01")
    assert client.texts == [(7, f"Unsupported FTP: {opcode}")]


def test_size_beyond_the_data_is_refused(client: Client) -> None:
    assert client.ask(Opcode.NONE, size=240).data == b"\x03"


@pytest.mark.parametrize("opcode", [Opcode.ACK, Opcode.NACK])
def test_stray_reply_stays_without_answer(client: Client, opcode: int) -> None:
    assert client.ask_all(opcode) == []
    assert client.texts == []


def test_stray_reply_sent_twice_is_answered_by_what_was_prepared(client: Client) -> None:
    client.ask_all(Opcode.ACK)
    [answer] = client.send(client.last_request)
    assert (answer.seq, answer.opcode, answer.req_opcode) == (client.seq + 1, Opcode.NONE, ACK)


class TestListDirectory:
    def test_entries_have_two_nuls_each(self, client: Client, tree: Tree) -> None:
        tree.listing = (Entry("00000001.BIN", 1234), Entry("sub"))
        answer = client.ask(Opcode.LIST_DIRECTORY, b"/")
        assert answer.opcode == ACK
        assert answer.data == b"F00000001.BIN\t1234\0\0Dsub\0\0"

    def test_offset_counts_entries(self, client: Client, tree: Tree) -> None:
        tree.listing = (Entry("a"), Entry("b"))
        answer = client.ask(Opcode.LIST_DIRECTORY, b"/", offset=1)
        assert (answer.offset, answer.data) == (1, b"Db\0\0")

    @pytest.mark.parametrize("offset", [2, 3, 0xFFFFFFFF])
    def test_end_is_a_nack(self, client: Client, tree: Tree, offset: int) -> None:
        tree.listing = (Entry("a"), Entry("b"))
        answer = client.ask(Opcode.LIST_DIRECTORY, b"/", offset=offset)
        assert (answer.opcode, answer.offset, answer.data) == (NACK, offset, b"\x06")

    def test_entry_that_does_not_fit_comes_with_the_next_request(self, client: Client, tree: Tree) -> None:
        tree.listing = [Entry("n" * 116), Entry("m" * 117), Entry("o")]
        first = client.ask(Opcode.LIST_DIRECTORY, b"/")
        assert first.data == b"D" + b"n" * 116 + b"\0\0" + b"D" + b"m" * 117 + b"\0\0"
        assert client.ask(Opcode.LIST_DIRECTORY, b"/", offset=2).data == b"Do\0\0"

    def test_list_ends_at_an_entry_that_never_fits(self, client: Client, tree: Tree) -> None:
        tree.listing = [Entry("n" * 237), Entry("o")]
        assert client.ask(Opcode.LIST_DIRECTORY, b"/").data == b"\x06"

    def test_trailing_slash_is_dropped(self, client: Client, tree: Tree) -> None:
        client.ask(Opcode.LIST_DIRECTORY, b"/dir/")
        client.ask(Opcode.LIST_DIRECTORY, b"/")
        assert tree.calls == [("list", "/dir"), ("list", "/")]

    def test_failure_carries_its_errno(self, client: Client) -> None:
        answer = client.ask(Opcode.LIST_DIRECTORY, b"long", offset=5)
        assert (answer.offset, answer.data) == (5, bytes([2, errno.ENOTDIR]))

    def test_malformed_path_keeps_the_offset(self, client: Client) -> None:
        answer = client.ask(Opcode.LIST_DIRECTORY, offset=5)
        assert (answer.offset, answer.data) == (5, b"\x03")

    def test_bytes_that_are_no_text_come_back_as_they_are(self, client: Client, tree: Tree) -> None:
        tree.listing = [Entry(b"\xff".decode("utf-8", "surrogateescape"), 0)]
        assert client.ask(Opcode.LIST_DIRECTORY, b"/").data == b"F\xff\t0\0\0"


class TestOpenAndRead:
    def test_open_tells_the_size(self, client: Client) -> None:
        answer = client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert (answer.opcode, answer.data) == (ACK, struct.pack("<I", len(LONG)))

    def test_path_may_count_its_nul(self, client: Client) -> None:
        assert client.ask(Opcode.OPEN_FILE_RO, b"long\0").opcode == ACK

    @pytest.mark.parametrize(("data", "size"), [(b"long", 0), (b"long", 3), (b"long", 6), (b"long\0x", 6)])
    def test_path_and_size_have_to_agree(self, client: Client, data: bytes, size: int) -> None:
        assert client.ask(Opcode.OPEN_FILE_RO, data, size=size).data == b"\x03"

    def test_absent_file_is_not_found(self, client: Client) -> None:
        assert client.ask(Opcode.OPEN_FILE_RO, b"absent").data == b"\x0a"

    def test_read_gives_what_is_asked_for(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        answer = client.ask(Opcode.READ_FILE, size=10, offset=250)
        assert (answer.opcode, answer.offset, answer.data) == (ACK, 250, LONG[250:260])

    def test_read_at_the_end_is_a_nack(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"short")
        answer = client.ask(Opcode.READ_FILE, size=10, offset=5)
        assert (answer.opcode, answer.offset, answer.data) == (NACK, 0, b"\x06")

    def test_failing_read_carries_its_errno(self, client: Client, tree: Tree) -> None:
        tree.bad_from = 0
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.ask(Opcode.READ_FILE, size=10).data == bytes([2, errno.EIO])

    @pytest.mark.parametrize("opcode", [Opcode.READ_FILE, Opcode.BURST_READ_FILE, Opcode.WRITE_FILE])
    def test_nothing_open_is_not_found(self, client: Client, opcode: int) -> None:
        assert client.ask(opcode, size=10).data == b"\x0a"

    @pytest.mark.parametrize("opcode", [Opcode.OPEN_FILE_RO, Opcode.OPEN_FILE_WO, Opcode.CREATE_FILE])
    def test_second_open_in_a_session_fails(self, client: Client, opcode: int) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.ask(opcode, b"short").data == b"\x01"

    def test_reading_can_be_opened_again_after_3_s_of_silence(self, client: Client, tree: Tree) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        client.pass_ms(3000)
        assert client.ask(Opcode.OPEN_FILE_RO, b"short").opcode == NACK
        client.pass_ms(3001)
        assert client.ask(Opcode.OPEN_FILE_RO, b"short").opcode == ACK
        assert tree.opened[0].closed


class TestWriting:
    def test_written_bytes_arrive(self, client: Client, tree: Tree) -> None:
        assert client.ask(Opcode.CREATE_FILE, b"new").opcode == ACK
        answer = client.ask(Opcode.WRITE_FILE, b"hello", offset=0)
        assert (answer.opcode, answer.offset, answer.data) == (ACK, 0, b"")
        assert client.ask(Opcode.WRITE_FILE, b"there", offset=5).offset == 5
        client.ask(Opcode.TERMINATE_SESSION)
        assert bytes(tree.opened[0].data) == b"hellothere"
        assert tree.opened[0].closed

    def test_only_create_creates(self, client: Client, tree: Tree) -> None:
        client.ask(Opcode.OPEN_FILE_WO, b"one")
        client.ask(Opcode.RESET_SESSIONS)
        client.ask(Opcode.CREATE_FILE, b"two", session=1)
        assert tree.calls == [("write", "one", "keep"), ("write", "two", "create")]

    def test_failing_write_carries_its_errno(self, client: Client) -> None:
        client.ask(Opcode.CREATE_FILE, b"new")
        assert client.ask(Opcode.WRITE_FILE, b"x", offset=1001).data == bytes([2, errno.ENOSPC])

    def test_read_only_file_carries_its_errno(self, client: Client) -> None:
        assert client.ask(Opcode.CREATE_FILE, b"locked").data == bytes([2, errno.EROFS])

    def test_malformed_path_is_refused(self, client: Client) -> None:
        assert client.ask(Opcode.CREATE_FILE).data == b"\x03"

    def test_file_open_for_writing_cannot_be_read(self, client: Client) -> None:
        client.ask(Opcode.CREATE_FILE, b"new")
        assert client.ask(Opcode.READ_FILE, size=1).data == b"\x01"
        assert client.ask(Opcode.BURST_READ_FILE, size=1).data == b"\x01"

    def test_file_open_for_reading_cannot_be_written(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.ask(Opcode.WRITE_FILE, b"x").data == b"\x01"


class TestChanges:
    @pytest.mark.parametrize("opcode", [Opcode.REMOVE_FILE, Opcode.REMOVE_DIRECTORY])
    def test_remove(self, client: Client, tree: Tree, opcode: int) -> None:
        assert client.ask(opcode, b"long").opcode == ACK
        assert client.ask(opcode, b"absent").data == b"\x0a"
        assert tree.calls == [("remove", "long"), ("remove", "absent")]

    def test_make_directory(self, client: Client) -> None:
        assert client.ask(Opcode.CREATE_DIRECTORY, b"new").opcode == ACK
        assert client.ask(Opcode.CREATE_DIRECTORY, b"long").data == b"\x08"

    @pytest.mark.parametrize("data", [b"long\0new", b"long\0new\0"])
    def test_rename(self, client: Client, tree: Tree, data: bytes) -> None:
        assert client.ask(Opcode.RENAME, data).opcode == ACK
        assert tree.calls == [("rename", "long", "new")]

    def test_failing_rename_carries_its_errno(self, client: Client) -> None:
        assert client.ask(Opcode.RENAME, b"absent\0new").data == bytes([2, errno.EACCES])

    @pytest.mark.parametrize(
        "opcode", [Opcode.REMOVE_FILE, Opcode.CREATE_DIRECTORY, Opcode.RENAME, Opcode.CALC_FILE_CRC32]
    )
    def test_no_path_is_refused(self, client: Client, opcode: int) -> None:
        assert client.ask(opcode).data == b"\x03"

    @pytest.mark.parametrize(
        ("data", "size"), [(b"a\0b", 2), (b"a\0b", 5), (b"a" * 238, 238), (b"a\0" + b"b" * 237, 238)]
    )
    def test_paths_of_a_rename_and_size_have_to_agree(self, client: Client, data: bytes, size: int) -> None:
        assert client.ask(Opcode.RENAME, data, size=size).data == b"\x03"


class TestSession:
    def test_terminating_closes_the_file(self, client: Client, tree: Tree) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long", session=3)
        assert client.ask(Opcode.TERMINATE_SESSION, session=3).opcode == ACK
        assert tree.opened[0].closed

    @pytest.mark.parametrize("opcode", [Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS])
    def test_ending_another_session_is_acknowledged_without_effect(
        self, client: Client, tree: Tree, opcode: int
    ) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long", session=3)
        assert client.ask(opcode, session=4).opcode == ACK
        assert not tree.opened[0].closed

    def test_another_session_has_to_wait(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long", session=3)
        assert client.ask(Opcode.LIST_DIRECTORY, b"/", session=4).data == b"\x04"

    def test_another_session_takes_over_after_3_s_of_silence(self, client: Client, tree: Tree) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long", session=3)
        client.pass_ms(2999)
        assert client.ask(Opcode.OPEN_FILE_RO, b"short", session=4).data == b"\x04"
        client.pass_ms(3000)
        assert client.ask(Opcode.OPEN_FILE_RO, b"short", session=4).opcode == ACK
        assert [file.closed for file in tree.opened] == [True, False]

    def test_session_is_shared_by_all_links(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"short", session=3)
        [answer] = client.ask_all(Opcode.READ_FILE, size=9, session=3, peer=OTHER)
        assert answer.data == SHORT

    def test_without_an_open_file_any_session_is_served(self, client: Client) -> None:
        assert client.ask(Opcode.NONE, session=9).opcode == ACK


class TestRepetition:
    def test_repeated_request_gets_the_same_reply_without_being_done_again(self, client: Client, tree: Tree) -> None:
        first = client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.send(client.last_request) == [first]
        assert len(tree.opened) == 1

    def test_reply_goes_over_the_link_of_the_first_request(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        [reply] = client.server.handle(client.last_request, client.now_us, FtpPeer(5, 255, 190))
        assert reply.peer == GCS

    def test_somebody_else_with_the_same_number_is_served(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.send(client.last_request, OTHER)[0].data == b"\x01"

    def test_operation_is_not_compared(self, client: Client) -> None:
        first = client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.send(make_request(Opcode.TERMINATE_SESSION, seq=client.seq)) == [first]

    def test_repetition_across_the_wrap_is_not_recognised(self, client: Client, tree: Tree) -> None:
        request = make_request(Opcode.CALC_FILE_CRC32, b"short", seq=65535)
        client.send(request)
        client.send(request)
        assert len(tree.opened) == 2


class TestCrc:
    @pytest.mark.parametrize("name", ["long", "short", "empty"])
    def test_checksum(self, client: Client, tree: Tree, name: str) -> None:
        answers = [*client.ask_all(Opcode.CALC_FILE_CRC32, name.encode()), *client.go_on()]
        plain = zlib.crc32(tree.contents[name], 0xFFFFFFFF) ^ 0xFFFFFFFF
        assert [answer.data for answer in answers] == [struct.pack("<I", plain)]
        assert tree.opened[0].closed

    def test_absent_file_is_not_found(self, client: Client) -> None:
        assert client.ask(Opcode.CALC_FILE_CRC32, b"absent").data == b"\x0a"

    def test_failing_read_carries_its_errno(self, client: Client, tree: Tree) -> None:
        tree.bad_from = 128
        assert client.ask(Opcode.CALC_FILE_CRC32, b"long").data == bytes([2, errno.EIO])
        assert tree.opened[0].closed

    def test_large_file_takes_several_calls(self, client: Client, tree: Tree) -> None:
        tree.contents["large"] = bytes(200_000)
        assert client.ask_all(Opcode.CALC_FILE_CRC32, b"large") == []
        assert client.server.busy
        answers = []
        for _ in range(4):
            answers += client.go_on()
        assert [answer.opcode for answer in answers] == [ACK]
        assert not client.server.busy

    def test_open_file_does_not_matter(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert client.ask(Opcode.CALC_FILE_CRC32, b"short").opcode == ACK


class TestBurst:
    def read_on(self, client: Client, first: list[Answer]) -> list[Answer]:
        answers = list(first)
        while client.server.busy:
            answers += client.go_on()
        return answers

    def burst(self, client: Client, name: bytes, *, size: int = 80, offset: int = 0) -> list[Answer]:
        client.ask(Opcode.OPEN_FILE_RO, name)
        return self.read_on(client, client.ask_all(Opcode.BURST_READ_FILE, size=size, offset=offset))

    def test_file_comes_whole_with_rising_numbers(self, client: Client) -> None:
        answers = self.burst(client, b"long", size=100)
        data = answers[:-1]
        assert b"".join(answer.data for answer in data) == LONG
        assert [answer.offset for answer in data] == list(range(0, len(LONG), 100))
        assert [answer.seq for answer in answers] == [client.seq + 1 + index for index in range(len(answers))]
        assert [answer.burst_complete for answer in data] == [0] * (len(data) - 1) + [1]

    def test_end_is_a_nack_at_the_end_of_the_file(self, client: Client) -> None:
        end = self.burst(client, b"long", size=100)[-1]
        assert (end.opcode, end.req_opcode, end.data) == (NACK, Opcode.BURST_READ_FILE, b"\x06")
        assert (end.offset, end.burst_complete) == (len(LONG), 1)

    def test_end_behind_a_full_packet_points_at_that_packet(self, client: Client) -> None:
        end = self.burst(client, b"long", size=128)[-1]
        assert (end.opcode, end.offset, end.burst_complete) == (NACK, len(LONG) - 128, 0)

    def test_size_0_stands_for_the_largest(self, client: Client) -> None:
        assert len(self.burst(client, b"long", size=0)[0].data) == 239

    def test_burst_starts_where_asked(self, client: Client) -> None:
        first = self.burst(client, b"long", size=10, offset=5)[0]
        assert (first.offset, first.data) == (5, LONG[5:15])

    def test_start_beyond_the_end_is_one_nack(self, client: Client) -> None:
        [end] = self.burst(client, b"short", offset=1000)
        assert (end.opcode, end.seq, end.offset, end.data) == (NACK, client.seq + 1, 0, b"\x06")

    def test_failing_read_ends_it(self, client: Client, tree: Tree) -> None:
        tree.bad_from = 100
        answers = self.burst(client, b"long", size=100)
        assert [answer.opcode for answer in answers] == [ACK, NACK]
        assert answers[1].data == bytes([2, errno.EIO])

    def test_500_packets_end_it_without_a_nack(self, client: Client) -> None:
        answers = self.burst(client, b"long", size=1)
        assert len(answers) == 500
        assert [index for index, answer in enumerate(answers) if answer.burst_complete] == [499]
        assert {answer.opcode for answer in answers} == {ACK}

    def test_request_numbered_like_the_last_of_500_packets_gets_that_packet(self, client: Client) -> None:
        last = self.burst(client, b"long", size=1)[-1]
        [answer] = client.send(make_request(Opcode.TERMINATE_SESSION, seq=last.seq))
        assert (answer.req_opcode, answer.data, answer.seq) == (Opcode.BURST_READ_FILE, last.data, last.seq + 1)

    def test_one_call_makes_a_few_packets(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert len(client.ask_all(Opcode.BURST_READ_FILE, size=10)) == 15
        assert len(client.go_on()) == 16

    def test_other_requests_wait_until_it_is_over(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        answers = client.ask_all(Opcode.BURST_READ_FILE, size=100)
        answers += client.ask_all(Opcode.NONE, peer=OTHER)
        answers = self.read_on(client, answers)
        assert [answer.req_opcode for answer in answers[-3:]] == [Opcode.BURST_READ_FILE] * 2 + [Opcode.NONE]

    def test_sixth_waiting_request_is_dropped(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        client.ask_all(Opcode.BURST_READ_FILE, size=20)
        client.full = {GCS.channel}
        for _ in range(6):
            client.ask_all(Opcode.NONE, peer=OTHER)
        client.full = set()
        answers = self.read_on(client, [])
        assert [answer.req_opcode for answer in answers].count(Opcode.NONE) == 5

    def test_nothing_is_lost_while_the_link_is_full(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        answers = client.ask_all(Opcode.BURST_READ_FILE, size=100)
        client.full = {GCS.channel}
        assert client.go_on() == []
        client.full = set()
        answers = self.read_on(client, answers)
        assert b"".join(answer.data for answer in answers[:-1]) == LONG

    def test_request_waits_while_the_link_is_full(self, client: Client) -> None:
        client.full = {GCS.channel}
        assert client.ask_all(Opcode.NONE) == []
        client.full = set()
        assert [answer.opcode for answer in client.go_on()] == [ACK]

    def test_link_without_flow_control_gets_a_third_of_its_rate(self, client: Client) -> None:
        slow = FtpPeer(0, 255, 190, bytes_per_second=5760)
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        sent = client.ask_all(Opcode.BURST_READ_FILE, size=0, peer=slow)
        for _ in range(999):
            client.pass_ms(1)
            sent += client.go_on()
        # A frame has 266 bytes: 138 ms each.
        assert len(sent) == 8

    def test_rate_of_0_does_not_divide(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        assert len(client.ask_all(Opcode.BURST_READ_FILE, peer=FtpPeer(0, 255, 190, bytes_per_second=0))) == 1


class TestBanner:
    def banners(self, client: Client, data: bytes, opcode: int = Opcode.OPEN_FILE_RO) -> list[bool]:
        request = make_request(opcode, data, seq=1)
        return [reply.banner for reply in client.server.handle(request, client.now_us, GCS)]

    def test_opening_the_parameters_asks_for_the_banner(self, client: Client) -> None:
        assert self.banners(client, b"@PARAM/param.pck") == [True]

    def test_repeated_reply_does_not_ask_again(self, client: Client) -> None:
        self.banners(client, b"@PARAM/param.pck")
        assert self.banners(client, b"@PARAM/param.pck") == [False]

    @pytest.mark.parametrize("path", [b"long", b"/@PARAM/param.pck", b"@PARAM/param.pckx"])
    def test_anything_else_does_not(self, client: Client, path: bytes) -> None:
        assert self.banners(client, path) == [False]

    def test_checksum_of_the_parameters_does_not(self, client: Client) -> None:
        assert self.banners(client, b"@PARAM/param.pck", Opcode.CALC_FILE_CRC32) == [False]


class TestSlowDown:
    def test_streams_are_slow_for_1_s_after_a_reply(self, client: Client) -> None:
        assert not client.server.slows_streams(client.now_us)
        client.ask(Opcode.NONE)
        assert client.server.slows_streams(client.now_us + 999_999)
        assert not client.server.slows_streams(client.now_us + 1_000_000)

    def test_terminating_ends_it(self, client: Client) -> None:
        client.ask(Opcode.OPEN_FILE_RO, b"long")
        client.ask(Opcode.TERMINATE_SESSION)
        assert not client.server.slows_streams(client.now_us)

    def test_streams_are_slow_in_the_first_second_after_boot(self, client: Client) -> None:
        assert client.server.slows_streams(999_999)
        assert not client.server.slows_streams(1_000_000)


def test_closing_lets_go_of_every_file(client: Client, tree: Tree) -> None:
    tree.contents["large"] = bytes(200_000)
    client.ask(Opcode.OPEN_FILE_RO, b"long")
    client.ask_all(Opcode.CALC_FILE_CRC32, b"large")
    client.server.close()
    assert [file.closed for file in tree.opened] == [True, True]
    assert not client.server.busy


def test_closing_an_idle_server_does_nothing(client: Client) -> None:
    client.server.close()
    assert client.ask(Opcode.NONE).opcode == ACK


def test_server_needs_nothing_but_files(tree: Tree) -> None:
    [reply] = FtpServer(tree).handle(make_request(99, seq=5), 0, GCS)
    assert take_apart(reply).data == b"\x01"


OPCODES = st.one_of(st.sampled_from(list(Opcode)), st.integers(0, 255))
PATHS = st.sampled_from([b"long", b"short", b"/", b"", b"long\0new", b"@PARAM/param.pck"])


@st.composite
def requests(draw: st.DrawFn) -> bytes:
    """Requests that often make sense."""
    data = draw(st.one_of(PATHS, st.binary(max_size=239)))
    size = draw(st.one_of(st.none(), st.integers(0, 255)))
    return make_request(
        draw(OPCODES),
        data,
        seq=draw(st.integers(0, 3)),
        session=draw(st.integers(0, 2)),
        offset=draw(st.one_of(st.integers(0, 300), st.integers(0, 0xFFFFFFFF))),
        size=size,
    )


@given(st.lists(st.tuples(st.one_of(requests(), st.binary(max_size=300)), st.integers(0, 4_000_000)), max_size=30))
def test_any_payloads_get_replies_of_251_bytes(sequence: list[tuple[bytes, int]]) -> None:
    client = Client(Tree({"long": LONG, "short": SHORT}, [Entry("a", 1), Entry("b")]))
    for payload, duration_us in sequence:
        client.now_us += duration_us
        assert len(client.send(payload)) <= 16
        assert len(client.go_on()) <= 16
