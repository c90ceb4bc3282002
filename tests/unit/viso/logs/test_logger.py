# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When a log is open, what it begins with, and what happens when it cannot be written."""

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.clock import VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import EV, MSG, LogStructure
from ap_core.param import ParamTable
from viso.errors import InputError
from viso.logs.files import LogStoreError, single_log
from viso.logs.logger import STRUCTURES, Logger, LogSink, MemoryLog
from viso.parameters.table import make_groups

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench

MakeBench = Callable[..., "Bench"]
QUIET_NAN_BITS = 0x7FC04152
BOOTED_S = 2.455
FULL = "1.BIN: No space left on device"


class FailingLog(MemoryLog):
    """A log whose disk is full after so many writes."""

    def __init__(self, good_writes: int) -> None:
        super().__init__()
        self.good_writes = good_writes

    def write(self, data: bytes) -> bool:
        if len(self.data) >= self.good_writes:
            self.lose(1)
            return False
        self.data += b"."
        return True

    def lose(self, records: int) -> None:
        self.dropped += records
        self.reason = FULL

    def flush_if_due(self, now_us: int) -> bool:
        return self.reason is None


class Rig:
    """A logger by itself; ``next_log`` is what opening gives, or raises."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(0))
        self.next_log: LogSink | LogStoreError = MemoryLog()
        self.attempts: list[int] = []
        self.begun = 0
        self.logger = Logger(self.clock, self._open, self._begin)

    def _open(self) -> LogSink:
        self.attempts.append(self.clock.millis())
        if isinstance(self.next_log, LogStoreError):
            raise self.next_log
        return self.next_log

    def _begin(self) -> None:
        self.begun += 1

    def update(self, *, wanted: bool = True, after_ms: int = 0) -> None:
        self.clock.set_us(self.clock.micros64() + after_ms * 1000)
        self.logger.update(wanted, self.params)


@pytest.fixture
def rig() -> Rig:
    return Rig()


def fill_the_disk(rig: Rig) -> None:
    """Open a log that then loses a record, and takes no more."""
    log = rig.next_log = FailingLog(10_000)
    rig.update()
    log.good_writes = 0
    rig.logger.write(EV, (1, 10))


def write_one_of_each_kind(rig: Rig) -> None:
    rig.logger.write(EV, (1, 10))
    rig.logger.write_named("TSYN", "TimeUS,SysID,RTT", "s-s", "F-F", "QBQ", (1, 2, 3))
    rig.logger.write_parameter("VISO_TYPE", np.float32(1))


def names(records: Sequence[dict[str, object]]) -> list[object]:
    return [record["name"] for record in records]


# LOG_DISARMED


def test_log_is_open_from_the_end_of_booting_by_default(make_bench: MakeBench) -> None:
    bench = make_bench(boot=False)
    bench.run_to(BOOTED_S - 0.0025)
    assert not bench.vehicle.logger.is_open
    bench.run_to(BOOTED_S)
    assert bench.vehicle.logger.is_open


def test_no_log_before_arming_with_log_disarmed_0(make_bench: MakeBench) -> None:
    bench = make_bench(LOG_DISARMED=0)
    assert bench.logs == []
    bench.command(400, 1)
    assert len(bench.logs) == 1


def test_log_that_arming_opens_holds_the_fact(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(LOG_DISARMED=0)
    bench.command(400, 1)
    records = bench.log_records(tmp_path)
    assert [(r["ArmState"], r["Forced"], r["Method"]) for r in records if r["name"] == "ARM"] == [(1, 0, 1)]
    assert [r["Id"] for r in records if r["name"] == "EV"] == [10, 60]


@pytest.mark.slow
def test_log_closes_15_seconds_after_disarming(make_bench: MakeBench) -> None:
    bench = make_bench(LOG_DISARMED=0)
    bench.command(400, 1)
    bench.run_for(5)
    bench.command(400, 0)
    bench.run_for(14.9)
    assert bench.vehicle.logger.is_open
    bench.run_for(0.2)
    assert not bench.vehicle.logger.is_open


@pytest.mark.slow
def test_failed_attempt_to_arm_is_logged_for_15_seconds(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(LOG_DISARMED=0, VISO_TYPE=1)
    assert bench.command(400, 1) == 4
    assert bench.vehicle.logger.is_open
    bench.run_for(15.1)
    assert not bench.vehicle.logger.is_open


@pytest.mark.slow
def test_arming_again_opens_another_log(make_bench: MakeBench) -> None:
    bench = make_bench(LOG_DISARMED=0)
    for _ in range(2):
        bench.command(400, 1)
        bench.command(400, 0)
        bench.run_for(16)
    assert len(bench.logs) == 2


@pytest.mark.slow
def test_log_stays_open_when_disarmed_with_log_disarmed_1(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.command(400, 1)
    bench.command(400, 0)
    bench.run_for(20)
    assert bench.vehicle.logger.is_open
    assert len(bench.logs) == 1


# What a log holds


def test_log_begins_with_its_own_description(make_bench: MakeBench) -> None:
    bench = make_bench(boot=False)
    bench.run_to(BOOTED_S)
    assert bytes(bench.logs[0].data[:9]) == bytes.fromhex("a3 95 80 80 59 46 4d 54 00")


def test_log_begins_with_parameters_then_texts_version_and_mode(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(boot=False, VISO_TYPE=1)
    bench.run_to(BOOTED_S)
    records = bench.log_records(tmp_path)
    kinds = [kind for index, kind in enumerate(names(records)) if index == 0 or kind != names(records)[index - 1]]
    assert kinds == ["PARM", "MSG", "VER", "MSG", "MODE", "MSG"]
    assert [record["Message"] for record in records if record["name"] == "MSG"] == [
        *("ArduCopter V4.7.1 (dbe79216)", "00017669736f00000000000000000000", "Frame: QUAD/PLUS"),
        *("ArduPilot Ready", "AHRS: DCM active"),
    ]


@pytest.mark.slow
def test_start_up_tells_value_and_effective_default(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(VISO_TYPE=1)
    (row,) = (r for r in bench.log_records(tmp_path) if r["name"] == "PARM" and r["Name"] == "VISO_TYPE")
    assert (row["Value"], row["Default"]) == (1.0, 1.0)


def test_changed_parameter_makes_two_records_without_a_default(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(VISO_TYPE=1)
    start_up = len(bench.log_records(tmp_path))
    bench.set("VISO_delay_ms", 30)
    bench.run_for(0.1)
    rows = [record for record in bench.log_records(tmp_path)[start_up:] if record["name"] == "PARM"]
    assert [(row["Name"], row["Value"]) for row in rows] == [("VISO_delay_ms", 30.0), ("VISO_DELAY_MS", 30.0)]
    assert [np.float32(row["Default"]).tobytes() for row in rows] == [np.uint32(QUIET_NAN_BITS).tobytes()] * 2


def test_record_reaches_the_listener_without_a_log(rig: Rig) -> None:
    heard: list[tuple[str, list[LogValue]]] = []

    def listen(structure: LogStructure, values: Sequence[LogValue]) -> None:
        heard.append((structure.name, list(values)))

    rig.logger.on_write = listen
    rig.logger.write(EV, (5, 10))
    assert heard == [("EV", [5, 10])]
    assert rig.logger.records == 0


def test_named_record_and_parameter_need_a_log(rig: Rig) -> None:
    rig.logger.write_named("TSYN", "TimeUS,SysID,RTT", "s-s", "F-F", "QBQ", (1, 2, 3))
    rig.logger.write_parameter("VISO_TYPE", np.float32(1))
    assert rig.logger.size == 0


def test_named_record_is_described_before_it_comes(rig: Rig) -> None:
    log = MemoryLog()
    rig.next_log = log
    rig.update()
    before = len(log.data)
    rig.logger.write_named("TSYN", "TimeUS,SysID,RTT", "s-s", "F-F", "QBQ", (1, 2, 3))
    new = bytes(log.data[before:])
    assert new[:3] == bytes.fromhex("a3 95 80")
    assert new[-20:-17] == bytes.fromhex("a3 95 fe")


def test_types_are_unique_and_in_the_firmwares_order() -> None:
    order = [structure.name for structure in STRUCTURES]
    assert len(set(order)) == len(order)
    landmarks = ["FMT", "UNIT", "FMTU", "MULT", "PARM", "MSG", "MODE", "RVOH", "REPH", "VISO", "VISP", "VISV"]
    assert sorted(landmarks, key=order.index) == landmarks


def test_records_and_bytes_are_counted(rig: Rig) -> None:
    log = MemoryLog()
    rig.next_log = log
    rig.update()
    records = rig.logger.records
    rig.logger.write(EV, (1, 10))
    assert rig.logger.records == records + 1
    assert rig.logger.size == len(log.data)


# Opening and closing


def test_opening_tells_that_a_log_begins(rig: Rig) -> None:
    rig.update()
    rig.update(after_ms=1000)
    assert rig.begun == 1


def test_log_is_closed_when_not_wanted(rig: Rig) -> None:
    rig.update()
    rig.update(wanted=False)
    assert not rig.logger.is_open
    rig.logger.close()


def test_without_a_place_for_logs_there_is_none() -> None:
    clock = VirtualClock()
    logger = Logger(clock, None)
    logger.update(True, ParamTable(make_groups(0)))
    logger.write(MSG, (1, "nothing"))
    assert not logger.is_open
    assert logger.failure is None


def test_failure_to_open_is_kept_and_tried_again_after_5_seconds(rig: Rig) -> None:
    rig.next_log = LogStoreError("logs: no space left")
    rig.update()
    rig.update(after_ms=4999)
    assert rig.attempts == [0]
    rig.update(after_ms=1)
    assert rig.attempts == [0, 5000]
    assert rig.logger.failure == "logs: no space left"


def test_success_after_a_failure_clears_it(rig: Rig) -> None:
    rig.next_log = LogStoreError("logs: no space left")
    rig.update()
    rig.next_log = MemoryLog()
    rig.update(after_ms=5000)
    assert rig.logger.is_open
    assert rig.logger.failure is None


def test_failure_to_open_fails_the_pre_arm_check(make_bench: MakeBench) -> None:
    def refuse() -> LogSink:
        raise LogStoreError("logs: no space left")

    bench = make_bench(open_log=refuse)
    bench.command(401)
    assert [text for _, _, text in bench.texts if text.startswith("PreArm")] == ["PreArm: Logging failed"]


def test_failing_writes_are_counted_and_reported(rig: Rig) -> None:
    fill_the_disk(rig)
    assert rig.logger.failure == FULL
    assert rig.logger.dropped == 1


def test_failing_flush_is_reported(rig: Rig) -> None:
    log = FailingLog(10_000)
    rig.next_log = log
    rig.update()
    assert rig.logger.failure is None
    log.lose(3)
    rig.update(after_ms=2000)
    assert rig.logger.failure == FULL
    assert rig.logger.losses == {FULL: 3}


def test_log_that_takes_no_more_is_followed_by_a_new_one_after_5_seconds(rig: Rig) -> None:
    fill_the_disk(rig)
    log = rig.next_log = MemoryLog()
    rig.update(after_ms=4999)
    assert not rig.logger.is_open
    rig.update(after_ms=1)
    assert rig.logger.is_open
    assert rig.logger.failure is None
    assert log.data.startswith(bytes.fromhex("a3 95 80 80 59 46 4d 54 00"))
    assert rig.begun == 2


def test_record_that_finds_no_log_is_lost_for_the_latest_reason(rig: Rig) -> None:
    fill_the_disk(rig)
    rig.next_log = LogStoreError("2.BIN: read-only file system")
    write_one_of_each_kind(rig)
    rig.update(after_ms=5000)
    write_one_of_each_kind(rig)
    assert rig.logger.losses == {FULL: 4, "2.BIN: read-only file system": 3}
    assert rig.logger.dropped == 7


def test_start_up_block_that_does_not_fit_is_lost_with_a_reason(rig: Rig) -> None:
    rig.next_log = FailingLog(10_000)
    rig.update()
    whole = rig.logger.records
    other = Rig()
    other.next_log = FailingLog(3)
    other.update()
    assert other.logger.losses == {FULL: whole - 3}


def test_record_that_nobody_wants_is_not_lost(rig: Rig) -> None:
    fill_the_disk(rig)
    rig.update(wanted=False)
    write_one_of_each_kind(rig)
    assert rig.logger.dropped == 1
    rig.update()
    write_one_of_each_kind(rig)
    assert rig.logger.dropped == 4


def test_failure_is_told_once_and_so_is_its_end(rig: Rig, caplog: pytest.LogCaptureFixture) -> None:
    fill_the_disk(rig)
    rig.next_log = FailingLog(3)
    rig.update(after_ms=5000)
    rig.next_log = LogStoreError("2.BIN: read-only file system")
    rig.update(after_ms=5000)
    assert caplog.messages == [f"log: {FULL}"]
    rig.next_log = MemoryLog()
    rig.update(after_ms=5000)
    assert caplog.messages[1:] == [f"log: restarted, {rig.logger.dropped} records are lost"]


def test_failure_that_is_told_at_the_end_is_told_then_alone(rig: Rig, caplog: pytest.LogCaptureFixture) -> None:
    with contextlib.suppress(InputError), single_log(Path("/dev/full")) as open_log:
        rig.next_log = open_log()
        rig.update()
    assert rig.logger.failure == "/dev/full: No space left on device"
    assert caplog.messages == []


def test_dropped_records_of_closed_logs_stay_counted(rig: Rig) -> None:
    log = FailingLog(10_000)
    rig.next_log = log
    rig.update()
    log.lose(3)
    rig.update(wanted=False)
    rig.next_log = MemoryLog()
    rig.update()
    assert rig.logger.dropped == 3


def test_records_lost_on_closing_are_a_failure(rig: Rig) -> None:
    log = FailingLog(10_000)
    rig.next_log = log
    rig.update()
    log.lose(3)
    rig.logger.close()
    assert rig.logger.failure == FULL


def test_records_of_the_beginning_may_end_the_log() -> None:
    rig = Rig()
    rig.next_log = FailingLog(3)
    rig.update()
    assert rig.logger.failure == FULL
