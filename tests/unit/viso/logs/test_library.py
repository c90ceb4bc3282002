# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs on disk as the log transfer sees them, also while they vanish."""

import errno
import fcntl
import os
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ap_core.clock import VirtualClock
from mav_handlers.transfers.log_transfer import LogLibrary, LogTransfer
from mav_handlers.wire.messages import LOG_DATA
from viso.logs.files import LogFile, LogStore
from viso.logs.library import REOPEN_US, FileReader, NoLogs, StoredLogs
from viso.logs.logger import Logger

UTC_US = 1_760_000_000_999_999


class Rig:
    """A library over a folder, and a log of the vehicle's own that it can close."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.store = LogStore(directory)
        self.clock = VirtualClock(5_000_000)
        self.utc_us = UTC_US
        self.open_log: LogFile | None = None
        self.logs = StoredLogs(self.store, self.clock, cast(Logger, self), lambda: self.utc_us)

    @property
    def open_number(self) -> int | None:
        """The number of the log that takes records now (Logger)."""
        return None if self.open_log is None else self.open_log.number

    def close(self) -> None:
        """Close the log (Logger)."""
        if self.open_log is not None:
            self.open_log.close()
            self.open_log = None

    def write(self, *contents: bytes) -> None:
        for content in contents:
            with self.store.open_next() as log:
                log.write(content)

    def begin_log(self, content: bytes) -> LogFile:
        self.open_log = self.store.open_next()
        self.open_log.write(content)
        self.open_log.flush()
        return self.open_log

    def names(self) -> list[str]:
        return sorted(path.name for path in self.directory.iterdir())

    def send_text_to(self, channel_index: int, severity: int, text: str) -> None:
        raise AssertionError("nothing is refused here")


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path / "logs")


def test_folder_that_is_not_there_has_no_logs(rig: Rig) -> None:
    assert rig.logs.count() == 0


def test_logs_are_counted_when_asked(rig: Rig) -> None:
    rig.write(b"a", b"b")
    assert rig.logs.count() == 2
    rig.write(b"c")
    assert rig.logs.count() == 3


def test_ids_run_from_the_oldest_also_after_the_numbers_have_wrapped(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    for number, size in ((1, 10), (2, 20), (499, 30), (500, 40)):
        rig.store.path_of(number).write_bytes(bytes(size))
    (tmp_path / "LASTLOG.TXT").write_bytes(b"2\r\n")
    assert rig.logs.count() == 4
    assert [rig.logs.entry(log_id)[0] for log_id in (1, 2, 3, 4)] == [30, 40, 10, 20]


def test_time_of_a_closed_log_is_that_of_its_file(rig: Rig) -> None:
    rig.write(b"abc")
    os.utime(rig.store.path_of(1), (1.0, 1_234_567_890.9))
    rig.logs.count()
    assert rig.logs.entry(1) == (3, 1_234_567_890)


@pytest.mark.parametrize(("utc_us", "time_utc_s"), [(UTC_US, 1_760_000_000), (0, 0)])
def test_time_of_the_log_being_written_is_now_or_0_while_unknown(rig: Rig, utc_us: int, time_utc_s: int) -> None:
    rig.begin_log(b"abc")
    rig.utc_us = utc_us
    rig.logs.count()
    assert rig.logs.entry(1) == (3, time_utc_s)


@pytest.mark.parametrize(("mtime", "time_utc_s"), [(-5, 0), (1 << 33, 0xFFFFFFFF)])
def test_time_is_limited_to_32_bits(rig: Rig, mtime: int, time_utc_s: int) -> None:
    rig.write(b"abc")
    os.utime(rig.store.path_of(1), (mtime, mtime))
    rig.logs.count()
    assert rig.logs.entry(1) == (3, time_utc_s)


def test_size_is_limited_to_32_bits(rig: Rig) -> None:
    rig.write(b"abc")
    with rig.store.path_of(1).open("r+b") as log:
        log.truncate(1 << 33)
    rig.logs.count()
    assert rig.logs.entry(1)[0] == 0xFFFFFFFF


@pytest.mark.parametrize("log_id", [-1, 0, 2])
def test_id_that_does_not_exist_gives_zeros_and_no_data(rig: Rig, log_id: int) -> None:
    rig.write(b"abc")
    rig.logs.count()
    assert rig.logs.entry(log_id) == (0, 0)
    assert rig.logs.open(log_id).read(0, 90) == b""


def test_file_that_vanishes_gives_zeros_and_no_data(rig: Rig) -> None:
    rig.write(b"abc", b"def")
    rig.logs.count()
    rig.store.path_of(1).unlink()
    assert rig.logs.entry(1) == (0, 0)
    assert rig.logs.open(1).read(0, 90) == b""


def test_ids_stay_while_files_vanish_until_the_next_count(rig: Rig) -> None:
    rig.write(b"abc", b"def")
    rig.logs.count()
    rig.store.path_of(1).unlink()
    assert rig.logs.open(2).read(0, 90) == b"def"
    assert rig.logs.count() == 1
    assert rig.logs.open(1).read(0, 90) == b"def"


def test_file_deleted_while_it_is_read_is_read_to_its_end(rig: Rig) -> None:
    rig.write(b"abc")
    rig.logs.count()
    reader = rig.logs.open(1)
    rig.store.path_of(1).unlink()
    assert reader.read(1, 90) == b"bc"


@pytest.mark.parametrize(("offset", "count", "expected"), [(0, 2, b"ab"), (1, 90, b"bc"), (3, 90, b""), (0, 0, b"")])
def test_reading_from_any_offset(rig: Rig, offset: int, count: int, expected: bytes) -> None:
    rig.write(b"abc")
    rig.logs.count()
    assert rig.logs.open(1).read(offset, count) == expected


def test_error_while_reading_gives_no_data(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> bytes:
        raise OSError(errno.EIO, "Input/output error")

    rig.write(b"abc")
    rig.logs.count()
    reader = rig.logs.open(1)
    monkeypatch.setattr(os, "pread", fail)
    assert reader.read(0, 90) == b""


def test_closed_reader_reads_nothing_and_closes_again(rig: Rig) -> None:
    rig.write(b"abc")
    rig.logs.count()
    reader = rig.logs.open(1)
    reader.close()
    reader.close()
    assert reader.read(0, 90) == b""


def test_transfer_closes_the_log_with_all_that_waits(rig: Rig) -> None:
    rig.begin_log(b"abc").write(b"def")
    rig.logs.count()
    rig.logs.begin_transfer()
    assert rig.open_log is None
    assert rig.logs.entry(1)[0] == 6


def test_no_log_is_opened_during_a_transfer_and_for_a_second_after_it(rig: Rig) -> None:
    assert not rig.logs.suspends_logging
    rig.logs.begin_transfer()
    rig.clock.set_us(rig.clock.micros64() + 3_600_000_000)
    assert rig.logs.suspends_logging
    rig.logs.end_transfer()
    rig.clock.set_us(rig.clock.micros64() + REOPEN_US - 1)
    assert rig.logs.suspends_logging
    rig.clock.set_us(rig.clock.micros64() + 1)
    assert not rig.logs.suspends_logging


def test_log_after_a_transfer_is_a_new_one(rig: Rig) -> None:
    rig.begin_log(b"abc")
    rig.logs.begin_transfer()
    rig.logs.end_transfer()
    assert rig.begin_log(b"def").number == 2
    assert rig.logs.count() == 2


class TestErase:
    def test_every_log_and_lastlog_go_and_nothing_else(self, rig: Rig) -> None:
        rig.write(b"abc", b"def", b"")
        (rig.directory / "notes.txt").write_text("mine")
        (rig.directory / "00000009.BIN").mkdir()
        rig.logs.erase_all()
        assert rig.names() == ["00000009.BIN", "notes.txt"]

    def test_next_log_is_number_1(self, rig: Rig) -> None:
        rig.write(b"abc", b"def")
        rig.begin_log(b"ghi")
        rig.logs.erase_all()
        assert rig.begin_log(b"new").number == 1

    def test_log_being_written_is_closed_first(self, rig: Rig) -> None:
        rig.begin_log(b"abc")
        rig.logs.erase_all()
        assert (rig.open_log, rig.names()) == (None, [])

    def test_log_that_another_vehicle_writes_stays(self, rig: Rig) -> None:
        rig.write(b"abc")
        with LogStore(rig.directory).open_next() as other:
            other.write(b"other")
            rig.logs.erase_all()
        assert rig.names() == ["00000002.BIN"]
        assert rig.logs.count() == 1

    def test_logs_go_where_the_file_system_has_no_locks(self, rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
        def no_locks(*_: object) -> None:
            raise OSError(errno.ENOLCK, "No locks available")

        rig.write(b"abc")
        monkeypatch.setattr(fcntl, "flock", no_locks)
        rig.logs.erase_all()
        assert rig.names() == []

    def test_ids_are_gone_at_once(self, rig: Rig) -> None:
        rig.write(b"abc")
        rig.logs.count()
        rig.logs.erase_all()
        assert rig.logs.entry(1) == (0, 0)

    def test_log_is_opened_a_second_later(self, rig: Rig) -> None:
        rig.logs.erase_all()
        assert rig.logs.suspends_logging
        rig.clock.set_us(rig.clock.micros64() + REOPEN_US)
        assert not rig.logs.suspends_logging

    def test_folder_that_is_not_there_is_no_error(self, rig: Rig) -> None:
        rig.logs.erase_all()
        assert rig.logs.count() == 0

    def test_logs_that_cannot_be_deleted_stay(self, rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
        def refuse(*_: object, **__: object) -> None:
            raise PermissionError(errno.EACCES, "Permission denied")

        rig.write(b"abc")
        with monkeypatch.context() as patch:
            patch.setattr(Path, "unlink", refuse)
            rig.logs.erase_all()
        assert rig.logs.count() == 1


class TestNoLogs:
    def test_there_is_nothing_to_list_or_read(self) -> None:
        logs = NoLogs()
        assert (logs.count(), logs.entry(1), logs.open(1).read(0, 90)) == (0, (0, 0), b"")

    def test_logging_is_never_suspended(self) -> None:
        logs: Any = NoLogs()
        for call in (logs.begin_transfer, logs.end_transfer, logs.erase_all):
            call()
        assert not logs.suspends_logging


def test_both_are_log_libraries(rig: Rig) -> None:
    libraries: list[LogLibrary] = [rig.logs, NoLogs()]
    assert [library.count() for library in libraries] == [0, 0]


def download(rig: Rig, log_id: int, chunk: int) -> bytes:
    transfer = LogTransfer(rig.logs, rig.send_text_to)
    received = bytearray()
    while True:
        transfer.request_data(0, log_id, len(received), chunk)
        packets = [packet for packet in pump_all(transfer) if isinstance(packet, LOG_DATA)]
        received += b"".join(bytes(packet.data[: packet.count]) for packet in packets)
        if sum(packet.count for packet in packets) < chunk:
            return bytes(received)


def pump_all(transfer: LogTransfer) -> list[object]:
    found: list[object] = []
    while messages := transfer.pump(0, 0, armed=False, heartbeat_us=0):
        found += messages
    return found


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(min_size=1, max_size=5000), st.integers(1, 6000), st.integers(0, 2))
def test_download_in_chunks_of_any_size_gives_the_file(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, chunk: int, others: int
) -> None:
    rig = Rig(tmp_path_factory.mktemp("logs"))
    rig.write(*[b"other"] * others, content)
    assert download(rig, others + 1, max(chunk, len(content) // 20)) == content


def test_download_of_the_log_being_written_gives_all_of_it(rig: Rig) -> None:
    rig.begin_log(bytes(5000)).write(b"tail")
    assert download(rig, 1, 0xFFFFFFFF) == bytes(5000) + b"tail"


def test_reader_of_nothing_is_empty() -> None:
    assert FileReader(None).read(0, 90) == b""
