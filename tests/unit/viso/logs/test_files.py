# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Log files: numbering, LASTLOG.TXT, chunks on disk, errors and killed processes."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.DFReader import DFReader_binary

from viso.logs.files import CHUNK_BYTES, FLUSH_INTERVAL_US, LogFile, LogStore, LogStoreError

RECORD = bytes.fromhex("a395b5") + bytes(9)

WRITE_UNTIL_KILLED = """
import os, signal, sys
from pathlib import Path
from ap_core.dataflash import DataFlashWriter
from ap_core.log_structure import COMMON_STRUCTURES, EV
from viso.logs.files import LogStore

log = LogStore(Path(sys.argv[1])).open_next()
writer = DataFlashWriter(COMMON_STRUCTURES)
for record in writer.start_up([("VISO_TYPE", 1.0, 0.0)], time_us=0):
    log.write(record)
for index in range(1000):
    log.write(writer.record(EV, (index, index)))
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def store(tmp_path: Path) -> LogStore:
    return LogStore(tmp_path / "logs")


def write_log(store: LogStore, data: bytes = RECORD) -> int:
    with store.open_next() as log:
        log.write(data)
    return log.number


def lastlog(store: LogStore) -> bytes:
    return store.path_of(1).with_name("LASTLOG.TXT").read_bytes()


def set_lastlog(store: LogStore, content: bytes) -> None:
    path = store.path_of(1).with_name("LASTLOG.TXT")
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)


def test_first_log_is_number_1(store: LogStore) -> None:
    with store.open_next() as log:
        assert (log.number, log.path.name) == (1, "00000001.BIN")


def test_directory_is_made_with_its_parents(tmp_path: Path) -> None:
    assert write_log(LogStore(tmp_path / "a" / "b")) == 1


def test_lastlog_holds_the_number_and_a_line_end(store: LogStore) -> None:
    for _ in range(5):
        write_log(store)
    assert lastlog(store) == b"5\r\n"


def test_no_draft_of_lastlog_stays_behind(store: LogStore) -> None:
    number = write_log(store)
    names = sorted(path.name for path in store.path_of(number).parent.iterdir())
    assert names == ["00000001.BIN", "LASTLOG.TXT"]


def test_empty_last_log_is_used_again(store: LogStore) -> None:
    write_log(store)
    assert [write_log(store, b""), write_log(store)] == [2, 2]


def test_missing_last_log_gives_its_number_back(store: LogStore) -> None:
    set_lastlog(store, b"7\r\n")
    assert write_log(store) == 7


def test_numbers_wrap_after_the_highest(tmp_path: Path) -> None:
    store = LogStore(tmp_path, max_files=3)
    set_lastlog(store, b"3\r\n")
    store.path_of(3).write_bytes(RECORD)
    assert write_log(store) == 1


def test_number_beyond_the_highest_wraps(tmp_path: Path) -> None:
    store = LogStore(tmp_path, max_files=3)
    set_lastlog(store, b"400\r\n")
    assert write_log(store) == 1


def test_logs_with_data_are_passed_over_not_overwritten(store: LogStore) -> None:
    for _ in range(3):
        write_log(store)
    set_lastlog(store, b"1\r\n")
    assert write_log(store, b"new") == 4
    assert [store.path_of(number).read_bytes() for number in (1, 2, 3)] == [RECORD] * 3


def test_full_set_of_numbers_is_an_error(tmp_path: Path) -> None:
    store = LogStore(tmp_path, max_files=2)
    write_log(store)
    write_log(store)
    with pytest.raises(LogStoreError, match=r"all 2 log numbers are taken") as error:
        store.open_next()
    assert str(tmp_path) in str(error.value)


def test_log_being_written_by_another_is_passed_over(store: LogStore) -> None:
    with store.open_next() as first, LogStore(first.path.parent).open_next() as second:
        assert (first.number, second.number) == (1, 2)


@pytest.mark.parametrize("content", [b"", b"garbage", b"-3\r\n", b"\xff\xfe\x00"])
def test_senseless_lastlog_is_replaced_by_a_look_at_the_files(store: LogStore, content: bytes) -> None:
    write_log(store)
    write_log(store)
    set_lastlog(store, content)
    assert write_log(store) == 3
    assert lastlog(store) == b"3\r\n"


def test_missing_lastlog_is_replaced_by_a_look_at_the_files(store: LogStore) -> None:
    write_log(store)
    store.path_of(1).with_name("LASTLOG.TXT").unlink()
    assert write_log(store) == 2


def test_lastlog_with_remains_of_a_longer_number_is_understood(store: LogStore) -> None:
    set_lastlog(store, b"9\r\n\n")
    assert store.last_number() == 9


def test_lastlog_of_zero_starts_at_1(store: LogStore) -> None:
    set_lastlog(store, b"0\r\n")
    assert write_log(store) == 1


def test_other_files_are_no_logs(store: LogStore) -> None:
    write_log(store)
    directory = store.path_of(1).parent
    for name in ("notes.txt", "00000009.bin", "9.BIN", "00000000.BIN"):
        (directory / name).write_bytes(RECORD)
    assert store.log_numbers() == [1]


def test_log_numbers_begin_with_the_oldest_after_a_wrap(tmp_path: Path) -> None:
    store = LogStore(tmp_path, max_files=4)
    for number in (1, 2, 3, 4):
        store.path_of(number).write_bytes(RECORD)
    set_lastlog(store, b"2\r\n")
    assert store.log_numbers() == [3, 4, 1, 2]


def test_log_numbers_leave_out_empty_logs(store: LogStore) -> None:
    write_log(store)
    write_log(store, b"")
    assert store.log_numbers() == [1]


def test_log_numbers_of_a_missing_directory_are_none(store: LogStore) -> None:
    assert store.log_numbers() == []


def test_max_files_below_2_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="max_files is 1"):
        LogStore(tmp_path, max_files=1)


def test_directory_that_cannot_be_made_is_an_error_naming_it(tmp_path: Path) -> None:
    (tmp_path / "logs").write_text("a file")
    with pytest.raises(LogStoreError) as error:
        LogStore(tmp_path / "logs").open_next()
    assert str(error.value) == f"{tmp_path / 'logs'}: File exists"


def test_log_that_cannot_be_opened_is_an_error_naming_it(store: LogStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("viso.logs.files.os.open", refuse)
    with pytest.raises(LogStoreError) as error:
        store.open_next()
    assert str(error.value) == f"{store.path_of(1)}: Read-only file system"


def test_lastlog_that_cannot_be_written_is_an_error_naming_it(tmp_path: Path) -> None:
    (tmp_path / "LASTLOG.TXT").mkdir()
    with pytest.raises(LogStoreError, match=r"LASTLOG\.TXT: Is a directory$"):
        LogStore(tmp_path).open_next()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["00000001.BIN", "LASTLOG.TXT"]


def test_directory_in_place_of_a_log_is_passed_over(store: LogStore) -> None:
    store.path_of(1).mkdir(parents=True)
    set_lastlog(store, b"0\r\n")
    assert write_log(store) == 2


def test_records_wait_until_a_chunk_is_full(store: LogStore) -> None:
    with store.open_next() as log:
        log.write(bytes(CHUNK_BYTES - 1))
        assert log.path.stat().st_size == 0
        log.write(RECORD)
        assert log.path.stat().st_size == CHUNK_BYTES - 1 + len(RECORD)


def test_size_counts_waiting_records(store: LogStore) -> None:
    with store.open_next() as log:
        log.write(RECORD)
        assert log.size == len(RECORD)


def test_flush_writes_what_is_waiting(store: LogStore) -> None:
    with store.open_next() as log:
        log.write(RECORD)
        assert log.flush()
        assert log.path.read_bytes() == RECORD


@pytest.mark.parametrize(
    ("now_us", "written"), [(FLUSH_INTERVAL_US - 1, 0), (FLUSH_INTERVAL_US, len(RECORD)), (-1, len(RECORD))]
)
def test_flush_is_due_after_2_seconds_or_a_clock_set_back(store: LogStore, now_us: int, written: int) -> None:
    with store.open_next() as log:
        log.flush_if_due(10 * FLUSH_INTERVAL_US)
        log.write(RECORD)
        assert log.flush_if_due(10 * FLUSH_INTERVAL_US + now_us)
        assert log.path.stat().st_size == written


def test_close_writes_what_is_waiting(store: LogStore) -> None:
    log = store.open_next()
    log.write(RECORD)
    log.close()
    log.close()
    assert (log.path.read_bytes(), log.closed, log.dropped) == (RECORD, True, 0)


def test_write_to_a_closed_log_is_refused(store: LogStore) -> None:
    log = store.open_next()
    log.close()
    with pytest.raises(ValueError, match="write to a closed log"):
        log.write(RECORD)


def full_disk() -> LogFile:
    path = Path("/dev/full")
    return LogFile(path, 1, os.open(path, os.O_WRONLY))


def test_full_disk_stops_the_log_and_counts_every_lost_write() -> None:
    log = full_disk()
    results = [log.write(RECORD), log.flush(), log.write(RECORD), log.flush_if_due(0), log.flush()]
    assert results == [True, False, False, False, False]
    assert (log.dropped, log.reason) == (2, "/dev/full: No space left on device")


def test_full_disk_at_a_chunk_loses_the_chunk() -> None:
    log = full_disk()
    assert [log.write(bytes(CHUNK_BYTES - 1)), log.write(RECORD)] == [True, False]
    assert (log.closed, log.dropped) == (True, 2)


def test_full_disk_at_close_is_counted() -> None:
    log = full_disk()
    log.write(RECORD)
    log.close()
    assert log.dropped == 1


def test_deleted_log_is_noticed_and_what_came_after_its_deletion_is_lost(store: LogStore) -> None:
    log = store.open_next()
    log.write(RECORD)
    assert log.flush_if_due(FLUSH_INTERVAL_US)
    log.path.unlink()
    assert log.write(RECORD)
    assert log.write(RECORD)
    assert log.flush_if_due(2 * FLUSH_INTERVAL_US - 1)
    assert not log.flush_if_due(2 * FLUSH_INTERVAL_US)
    assert not log.write(RECORD)
    assert (log.dropped, log.reason) == (3, f"{log.path}: deleted while it was written")


def test_deleted_log_is_noticed_at_the_next_chunk(store: LogStore) -> None:
    log = store.open_next()
    log.path.unlink()
    assert not log.write(bytes(CHUNK_BYTES))
    assert (log.closed, log.dropped) == (True, 1)


def test_log_is_looked_at_once_a_chunk(store: LogStore, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []
    look = os.fstat

    def counted(descriptor: int) -> os.stat_result:
        looks.append(descriptor)
        return look(descriptor)

    with store.open_next() as log:
        monkeypatch.setattr("viso.logs.files.os.fstat", counted)
        for _ in range(2 * CHUNK_BYTES // len(RECORD)):
            log.write(RECORD)
    assert len(looks) <= 3


def test_short_writes_are_continued(store: LogStore, monkeypatch: pytest.MonkeyPatch) -> None:
    whole_write = os.write
    monkeypatch.setattr("viso.logs.files.os.write", lambda fd, data: whole_write(fd, data[:5]))
    with store.open_next() as log:
        log.write(RECORD)
    assert log.path.read_bytes() == RECORD


@pytest.mark.slow
def test_killed_process_leaves_a_readable_log(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", WRITE_UNTIL_KILLED, str(tmp_path)], timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL
    reader = DFReader_binary(str(tmp_path / "00000001.BIN"))
    events = []
    while (message := reader.recv_match(type="EV")) is not None:
        events.append(message.TimeUS)
    reader.filehandle.close()
    assert events == list(range(len(events)))
    assert 1000 - len(events) <= CHUNK_BYTES // len(RECORD) + 1


@pytest.mark.slow
def test_log_after_a_killed_process_gets_the_next_number(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", WRITE_UNTIL_KILLED, str(tmp_path)], timeout=60, check=False)
    assert write_log(LogStore(tmp_path)) == 2


def test_file_system_without_locks_is_good_enough(store: LogStore, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("viso.logs.files.fcntl.flock", refuse)
    assert write_log(store) == 1
