# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listing, downloading and erasing logs, and who may do so when."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.verdict import Verdict
from mav_handlers.transfers.log_transfer import PACKETS_PER_PASS, LogTransfer
from mav_handlers.verdicts import HANDLED, LOG_ARMED, LOG_BUSY, LOG_NOT_READY, LOG_REPEATED, LOG_UNKNOWN
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import LOG_DATA, LOG_ENTRY, Message

DISARM = (3, "Disarm for log download")
IN_PROGRESS = (6, "Log download in progress")
ALL = 0xFFFFFFFF
NOW_US = 60_000_000


class MemoryReader:
    """A log in memory, which counts as read while it is open."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.closed = False

    def read(self, offset: int, count: int) -> bytes:
        return self.data[offset : offset + count]

    def close(self) -> None:
        self.closed = True


class MemoryLibrary:
    """Logs in memory; ``open_tail`` is what the log being written still has to write."""

    def __init__(self, *logs: bytes) -> None:
        self.logs = list(logs)
        self.open_tail = b""
        self.calls: list[str] = []
        self.readers: list[MemoryReader] = []

    def count(self) -> int:
        return len(self.logs)

    def entry(self, log_id: int) -> tuple[int, int]:
        return (len(self.logs[log_id - 1]), 1_700_000_000 + log_id) if log_id <= len(self.logs) else (0, 0)

    def open(self, log_id: int) -> MemoryReader:
        self.readers.append(MemoryReader(self.logs[log_id - 1] if log_id <= len(self.logs) else b""))
        return self.readers[-1]

    def begin_transfer(self) -> None:
        self.calls.append("begin")
        if self.open_tail:
            self.logs[-1] += self.open_tail

    def end_transfer(self) -> None:
        self.calls.append("end")

    def erase_all(self) -> None:
        self.calls.append("erase")
        self.logs.clear()


class Rig:
    """A transfer with logs, links 0 and 1, and the texts that each link was told."""

    def __init__(self, *logs: bytes) -> None:
        self.library = MemoryLibrary(*logs)
        self.transfer = LogTransfer(self.library, self.send_text_to)
        self.texts: list[tuple[int, tuple[int, str]]] = []

    def send_text_to(self, channel_index: int, severity: int, text: str) -> None:
        self.texts.append((channel_index, (severity, text)))

    def refuse(self, link: int, *, armed: bool) -> Verdict | None:
        return self.transfer.refuse(link, armed=armed, writes_enabled=True)

    def ask_list(self, start: int = 0, end: int = 0xFFFF, *, link: int = 0, armed: bool = False) -> Verdict:
        return self.refuse(link, armed=armed) or self.transfer.request_list(link, start, end)

    def ask_data(self, log_id: int, ofs: int = 0, count: int = ALL, *, link: int = 0, armed: bool = False) -> Verdict:
        return self.refuse(link, armed=armed) or self.transfer.request_data(link, log_id, ofs, count)

    def pump(
        self, link: int = 0, *, armed: bool = False, heartbeat_us: int = NOW_US, max_packets: int = PACKETS_PER_PASS
    ) -> list[Message]:
        return self.transfer.pump(link, NOW_US, armed=armed, heartbeat_us=heartbeat_us, max_packets=max_packets)

    def entries(self) -> list[LOG_ENTRY]:
        found = []
        while messages := self.pump():
            assert len(messages) == 1
            found += [message for message in messages if isinstance(message, LOG_ENTRY)]
        return found

    def packets(self, max_packets: int = PACKETS_PER_PASS) -> list[LOG_DATA]:
        found: list[LOG_DATA] = []
        while messages := self.pump(max_packets=max_packets):
            found += [message for message in messages if isinstance(message, LOG_DATA)]
        return found


def content(packets: list[LOG_DATA]) -> bytes:
    return b"".join(bytes(packet.data[: packet.count]) for packet in packets)


def log_of(size: int) -> bytes:
    return bytes(index * 7 % 251 for index in range(size))


def request(transfer: LogTransfer, name: str, link: int, *, armed: bool = False, writes: bool = True) -> Verdict:
    """Ask for something as the handlers do."""
    requests: dict[str, Callable[[], Verdict]] = {
        "list": lambda: transfer.request_list(link, 0, 0xFFFF),
        "data": lambda: transfer.request_data(link, 1, 0, ALL),
        "end": transfer.request_end,
        "erase": transfer.erase,
    }
    return transfer.refuse(link, armed=armed, writes_enabled=writes) or requests[name]()


REQUESTS = ("list", "data", "end", "erase")
every_request = pytest.mark.parametrize("request_name", REQUESTS)


class TestWho:
    @every_request
    def test_request_while_booting_is_ignored_in_silence(self, request_name: str) -> None:
        rig = Rig(log_of(5))
        verdict = request(rig.transfer, request_name, 0, armed=True, writes=False)
        assert (verdict, rig.texts, rig.library.calls, rig.pump()) == (LOG_NOT_READY, [], [], [])

    @every_request
    def test_request_while_armed_is_refused_with_a_text(self, request_name: str) -> None:
        rig = Rig(log_of(5))
        verdict = request(rig.transfer, request_name, 1, armed=True)
        assert (verdict, rig.texts, rig.library.calls, rig.pump(1)) == (LOG_ARMED, [(1, DISARM)], [], [])

    def test_text_while_armed_comes_once(self) -> None:
        rig = Rig(log_of(5))
        for name in REQUESTS:
            request(rig.transfer, name, 0, armed=True)
            request(rig.transfer, name, 1, armed=True)
        assert rig.texts == [(0, DISARM)]

    @every_request
    def test_text_while_armed_comes_again_after_a_request_while_disarmed(self, request_name: str) -> None:
        rig = Rig(log_of(5))
        rig.ask_list(armed=True)
        request(rig.transfer, request_name, 0)
        rig.ask_list(armed=True)
        assert rig.texts == [(0, DISARM), (0, DISARM)]

    def test_request_while_booting_does_not_renew_the_text(self) -> None:
        rig = Rig(log_of(5))
        rig.ask_list(armed=True)
        request(rig.transfer, "list", 0, writes=False)
        rig.ask_list(armed=True)
        assert rig.texts == [(0, DISARM)]

    @pytest.mark.parametrize("link", [0, 1])
    def test_second_list_is_told_that_a_download_is_in_progress(self, link: int) -> None:
        rig = Rig(log_of(5))
        rig.ask_list()
        assert rig.ask_list(link=link) is LOG_BUSY
        assert rig.texts == [(link, IN_PROGRESS)]

    @pytest.mark.parametrize("link", [0, 1])
    def test_list_during_a_download_is_told_so(self, link: int) -> None:
        rig = Rig(log_of(5))
        rig.ask_data(1)
        assert rig.ask_list(link=link) is LOG_BUSY
        assert rig.texts == [(link, IN_PROGRESS)]

    def test_data_request_on_the_same_link_is_dropped_in_silence(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        assert rig.ask_data(1, 90, 90) is LOG_REPEATED
        assert rig.texts == []
        assert content(rig.packets()) == log_of(200)

    def test_data_request_on_another_link_is_told_that_a_download_is_in_progress(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        assert rig.ask_data(1, link=1) is LOG_BUSY
        assert rig.texts == [(1, IN_PROGRESS)]

    def test_data_request_during_a_listing_on_the_same_link_is_dropped_in_silence(self) -> None:
        rig = Rig(log_of(5), log_of(5))
        rig.ask_list()
        assert rig.ask_data(1) is LOG_REPEATED
        assert (rig.texts, len(rig.entries())) == ([], 2)

    def test_nothing_goes_to_a_link_that_did_not_ask(self) -> None:
        rig = Rig(log_of(5))
        rig.ask_list(link=1)
        assert rig.pump(0) == []
        assert len(rig.pump(1)) == 1


class TestListing:
    def test_no_logs_give_one_entry_of_zeros(self) -> None:
        rig = Rig()
        assert rig.ask_list() is HANDLED
        assert rig.entries() == [LOG_ENTRY(0, 0, 0, 0, 0)]

    def test_entries_name_size_time_count_and_last(self) -> None:
        rig = Rig(log_of(5), log_of(70_000))
        rig.ask_list()
        assert rig.entries() == [LOG_ENTRY(1, 2, 2, 1_700_000_001, 5), LOG_ENTRY(2, 2, 2, 1_700_000_002, 70_000)]

    @pytest.mark.parametrize(
        ("start", "end", "ids"),
        [
            (0, 0xFFFF, [1, 2, 3, 4]),
            (1, 4, [1, 2, 3, 4]),
            (2, 3, [2, 3]),
            (3, 9, [3, 4]),
            (4, 4, [4]),
            (5, 9, [4]),
            (9, 2, [2]),
            (3, 0, [1]),
            (0, 0, [1]),
        ],
    )
    def test_range_is_clipped_to_the_logs(self, start: int, end: int, ids: list[int]) -> None:
        rig = Rig(*[b"x"] * 4)
        rig.ask_list(start, end)
        entries = rig.entries()
        assert [entry.id for entry in entries] == ids
        assert {entry.last_log_num for entry in entries} == {ids[-1]}
        assert {entry.num_logs for entry in entries} == {4}

    def test_one_entry_comes_a_pass_however_much_the_link_takes(self) -> None:
        rig = Rig(log_of(1), log_of(2))
        rig.ask_list()
        assert [len(rig.pump()) for _ in range(3)] == [1, 1, 0]

    def test_listing_does_not_disturb_logging_nor_arming(self) -> None:
        rig = Rig(log_of(5))
        rig.ask_list()
        assert (rig.library.calls, rig.transfer.is_active) == ([], False)

    def test_a_log_that_vanishes_while_listing_has_no_size(self) -> None:
        rig = Rig(log_of(5), log_of(5))
        rig.ask_list()
        rig.pump()
        rig.library.logs.pop()
        assert rig.pump() == [LOG_ENTRY(2, 2, 2, 0, 0)]

    def test_list_is_possible_again_after_the_last_entry(self) -> None:
        rig = Rig(log_of(5))
        rig.ask_list()
        rig.entries()
        assert rig.ask_list(link=1) is HANDLED


class TestData:
    @pytest.mark.parametrize(
        ("size", "counts"),
        [
            (0, [0]),
            (1, [1]),
            (89, [89]),
            (90, [90]),
            (91, [90, 1]),
            (180, [90, 90]),
            (200, [90, 90, 20]),
        ],
    )
    def test_whole_log_ends_with_a_short_packet_unless_it_is_a_multiple_of_90(
        self, size: int, counts: list[int]
    ) -> None:
        rig = Rig(log_of(size))
        assert rig.ask_data(1) is HANDLED
        packets = rig.packets()
        assert [packet.count for packet in packets] == counts
        assert [packet.ofs for packet in packets] == [90 * index for index in range(len(counts))]
        assert content(packets) == log_of(size)

    @pytest.mark.parametrize(
        ("ofs", "count", "expected"),
        [
            (0, 0, [(0, 0)]),
            (100, 90, [(100, 90)]),
            (100, 91, [(100, 90), (190, 1)]),
            (190, ALL, [(190, 10)]),
            (200, ALL, [(200, 0)]),
            (ALL, ALL, [(ALL, 0)]),
        ],
    )
    def test_part_of_a_log(self, ofs: int, count: int, expected: list[tuple[int, int]]) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1, ofs, count)
        assert [(packet.ofs, packet.count) for packet in rig.packets()] == expected

    def test_data_is_padded_with_zeros(self) -> None:
        rig = Rig(b"\xff\xff")
        rig.ask_data(1)
        assert rig.packets() == [LOG_DATA(1, 0, 2, (255, 255, *(0,) * 88))]

    def test_packets_name_their_log(self) -> None:
        rig = Rig(b"a", b"b", b"c")
        rig.ask_data(2)
        assert [(packet.id, content([packet])) for packet in rig.packets()] == [(2, b"b")]

    @pytest.mark.parametrize("log_id", [0, 3, 0xFFFF])
    def test_unknown_id_gives_nothing(self, log_id: int) -> None:
        rig = Rig(b"a", b"b")
        assert rig.ask_data(log_id) is LOG_UNKNOWN
        assert (rig.pump(), rig.texts, rig.library.calls, rig.transfer.is_active) == ([], [], [], False)

    def test_log_is_sent_with_what_was_still_to_be_written(self) -> None:
        rig = Rig(log_of(5), b"begin")
        rig.library.open_tail = b"end"
        rig.ask_data(2)
        assert content(rig.packets()) == b"beginend"

    def test_log_that_shrinks_ends_early(self) -> None:
        rig = Rig(log_of(300))
        rig.ask_data(1)
        rig.pump(max_packets=1)
        rig.library.readers[0].data = log_of(100)
        assert [packet.count for packet in rig.packets()] == [10]
        assert not rig.transfer.is_active

    def test_log_that_grows_is_sent_as_it_was(self) -> None:
        rig = Rig(log_of(95))
        rig.ask_data(1)
        rig.library.readers[0].data = log_of(500)
        assert content(rig.packets()) == log_of(95)

    @pytest.mark.parametrize("max_packets", [1, 10, 40, 250])
    def test_pass_sends_no_more_than_the_link_takes(self, max_packets: int) -> None:
        rig = Rig(log_of(90 * 300))
        rig.ask_data(1)
        assert len(rig.pump(max_packets=max_packets)) == max_packets

    def test_simulator_sends_40_packets_a_pass(self) -> None:
        rig = Rig(log_of(90 * 100))
        rig.ask_data(1)
        assert len(rig.pump()) == 40

    @pytest.mark.parametrize("request_name", ["list", "data"])
    def test_link_that_takes_nothing_loses_nothing(self, request_name: str) -> None:
        rig = Rig(log_of(5))
        request(rig.transfer, request_name, 0)
        assert rig.pump(max_packets=0) == []
        assert len(rig.pump()) == 1

    @pytest.mark.parametrize("request_name", ["list", "data"])
    @pytest.mark.parametrize(("silence_us", "messages"), [(3_000_000, 1), (3_000_001, 0)])
    def test_nothing_is_sent_once_a_heartbeat_is_3_s_late(
        self, request_name: str, silence_us: int, messages: int
    ) -> None:
        rig = Rig(log_of(5))
        request(rig.transfer, request_name, 0)
        assert len(rig.pump(heartbeat_us=NOW_US - silence_us)) == messages

    def test_messages_fit_the_wire(self) -> None:
        rig = Rig(log_of(100))
        rig.ask_data(1)
        sent = rig.packets()
        codec = Codec(1, 1)
        codec.feed(b"".join(codec.encode(message) for message in sent))
        received = [codec.next_received() for _ in sent]
        assert [event.message for event in received if isinstance(event, Received)] == sent


class TestLogging:
    def test_logging_is_suspended_from_request_to_last_packet(self) -> None:
        rig = Rig(log_of(100))
        rig.ask_data(1)
        assert (rig.library.calls, rig.transfer.is_active) == (["begin"], True)
        rig.packets()
        assert (rig.library.calls, rig.transfer.is_active) == (["begin", "end"], False)
        assert rig.library.readers[0].closed

    def test_end_request_stops_at_once(self) -> None:
        rig = Rig(log_of(9000))
        rig.ask_data(1)
        rig.pump(max_packets=1)
        assert rig.transfer.request_end() is HANDLED
        assert (rig.pump(), rig.library.calls, rig.transfer.is_active) == ([], ["begin", "end"], False)

    def test_end_request_stops_a_listing(self) -> None:
        rig = Rig(log_of(5), log_of(5))
        rig.ask_list()
        rig.transfer.request_end()
        assert (rig.pump(), rig.library.calls) == ([], [])

    def test_end_request_without_a_transfer_does_nothing(self) -> None:
        rig = Rig(log_of(5))
        assert rig.transfer.request_end() is HANDLED
        assert rig.library.calls == []

    def test_armed_vehicle_sends_nothing_and_logs(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        assert (rig.pump(armed=True), rig.pump(armed=True)) == ([], [])
        assert rig.library.calls == ["begin", "end"]

    def test_sending_goes_on_after_disarming(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        first = rig.pump(max_packets=1)
        rig.pump(armed=True)
        rest = rig.packets()
        assert content([*(message for message in first if isinstance(message, LOG_DATA)), *rest]) == log_of(200)
        assert rig.library.calls == ["begin", "end", "begin", "end"]

    def test_listing_goes_on_after_disarming(self) -> None:
        rig = Rig(log_of(5))
        rig.ask_list()
        assert rig.pump(armed=True) == []
        assert len(rig.entries()) == 1

    def test_end_request_after_a_pause_ends_the_transfer_once(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        rig.transfer.pause()
        rig.transfer.request_end()
        assert (rig.library.calls, rig.transfer.is_active) == (["begin", "end"], False)


class TestErase:
    def test_erase_has_no_answer(self) -> None:
        rig = Rig(log_of(5))
        assert rig.transfer.erase() is HANDLED
        assert (rig.library.calls, rig.pump(), rig.texts) == (["erase"], [], [])

    def test_log_being_sent_is_sent_to_its_end(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        rig.transfer.erase()
        assert content(rig.packets()) == log_of(200)

    def test_log_that_was_erased_during_a_pause_ends_with_an_empty_packet(self) -> None:
        rig = Rig(log_of(200))
        rig.ask_data(1)
        rig.transfer.pause()
        rig.transfer.erase()
        assert [packet.count for packet in rig.packets()] == [0]


u16 = st.integers(0, 0xFFFF) | st.integers(0, 5)
u32 = st.integers(0, ALL) | st.integers(0, 400)
link = st.integers(0, 2)
STEPS = st.one_of(
    st.tuples(st.just("list"), link, u16, u16, st.booleans()),
    st.tuples(st.just("data"), link, u16, u32, u32, st.booleans()),
    st.tuples(st.just("end"), link, st.booleans()),
    st.tuples(st.just("erase"), link, st.booleans()),
    st.tuples(st.just("pump"), link, st.booleans(), st.integers(0, 50)),
)


def take_step(rig: Rig, step: tuple[Any, ...]) -> list[Message]:
    name, *rest = step
    if name == "pump":
        link_index, armed, max_packets = rest
        return rig.pump(link_index, armed=armed, max_packets=max_packets)
    link_index, *arguments, armed = rest
    methods: dict[str, Callable[..., object]] = {
        "list": lambda *args: rig.transfer.request_list(link_index, *args),
        "data": lambda *args: rig.transfer.request_data(link_index, *args),
        "end": rig.transfer.request_end,
        "erase": rig.transfer.erase,
    }
    if rig.refuse(link_index, armed=armed) is None:
        methods[name](*arguments)
    return []


def is_part_of_a_log(packet: LOG_DATA) -> bool:
    return content([packet]) == log_of(400)[packet.ofs : packet.ofs + packet.count]


@given(st.lists(st.integers(0, 400), max_size=4), st.lists(STEPS, max_size=40))
def test_no_sequence_of_requests_raises_or_leaves_logging_suspended(
    sizes: list[int], steps: list[tuple[Any, ...]]
) -> None:
    rig = Rig(*(log_of(size) for size in sizes))
    codec = Codec(1, 1)
    for message in (message for step in steps for message in take_step(rig, step)):
        assert codec.encode(message)
        assert isinstance(message, LOG_ENTRY) or (isinstance(message, LOG_DATA) and is_part_of_a_log(message))
    rig.transfer.request_end()
    assert rig.library.calls.count("begin") == rig.library.calls.count("end")
    assert all(reader.closed for reader in rig.library.readers)


@given(st.integers(0, 1000), st.integers(1, 300), st.integers(1, 50))
def test_chunks_of_any_size_give_the_file(size: int, chunk: int, max_packets: int) -> None:
    rig = Rig(log_of(size))
    received = bytearray()
    for ofs in range(0, size, chunk):
        assert rig.ask_data(1, ofs, chunk) is HANDLED
        received += content(rig.packets(max_packets))
    assert bytes(received) == log_of(size)
