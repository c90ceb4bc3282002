# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso ekf``: what it prints, what it writes, its exit codes, and its one-line errors."""

import json
import lzma
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink.DFReader import DFReader_binary

from tests.places import RECORDED
from tests.unit.viso.command_line import Outcome, Viso, failed_with
from viso.commands import ekf as ekf_command
from viso.compare import tolerances
from viso.compare.tolerances import FLIGHT, TOLERANCES, Tolerance
from viso.firmware.flown import JudgedBy
from viso.firmware.releases import JULY_2025, Firmware
from viso.replay.ekf.run import EkfRun

LOG = RECORDED / "logs" / "voxl.BIN.xz"
UNTIL_S = 6.6  # after aiding, yaw and origin
SHORT_BYTES = 400_000  # some time after that


@pytest.fixture
def viso(viso: Viso) -> Viso:
    """Return a function that runs the beginning of ``viso ekf``."""
    return lambda *args, until=UNTIL_S: viso("ekf", *args, "--until", until)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the beginning of the log, unpacked; it is cut within a record, as by a vehicle that loses power."""
    path = tmp_path_factory.mktemp("short") / "voxl.BIN"
    path.write_bytes(lzma.decompress(LOG.read_bytes())[:SHORT_BYTES])
    return path


@pytest.fixture(scope="module")
def ran(short: Path) -> EkfRun:
    """Return a run over the beginning of a recorded log, at its end."""
    run = EkfRun(short, until_s=UNTIL_S)
    run.run()
    return run


@pytest.fixture
def known(ran: EkfRun, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Let the command know what comes of the run; return what it knows."""
    replay, lanes = ran.comparison(), [(5.2, "EKF3 lane switch 1")]
    known = SimpleNamespace(run=lambda _on_progress: None, output=ran.output, comparison=lambda _core: replay)
    known.imus, known.our_lanes, known.recorded_lanes, known.notes = {0: 0, 1: 2}, lanes, lanes, ()

    def make(_log: Path, until_s: float, core: int | None, firmware: Firmware | None) -> SimpleNamespace:
        known.core, known.judged_by = core, JudgedBy(firmware or JULY_2025, "the banner says so")
        return known

    monkeypatch.setattr(ekf_command, "EkfRun", make)
    return known


@pytest.fixture(scope="module")
def written(ran: EkfRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log that comes of the run."""
    path = tmp_path_factory.mktemp("written") / "out.BIN"
    ran.output.save(path)
    return path


def records_of(path: Path, *kinds: str) -> list[Any]:
    with DFReader_binary(str(path)) as log:
        found = []
        while (record := log.recv_match(type=list(kinds))) is not None:
            found.append(record)
        return found


# What it prints


@pytest.mark.slow
def test_table_tells_figures_targets_and_marks(viso: Viso, short: Path, written: Path) -> None:
    outcome = viso(short, "-o", "new/out.BIN")
    cut = "note: damaged: 17 bytes in 1 places are in no record (the log ends within this record)\n"
    assert (outcome.code, outcome.err) == (0, cut)
    assert Path("new/out.BIN").read_bytes() == written.read_bytes()
    assert "voxl.BIN, core 0 (IMU 0): 15 records compared" in outcome.out
    rows = {cells[1].strip(): cells for line in outcome.out.splitlines() if len(cells := line.split("│")) > 4}
    assert [cell.strip() for cell in rows["PN"][3:5]] == ["0.001 m", "ok"]
    assert rows["PN"][2].split()[1:3] == ["m", "rms,"]
    assert [cell.strip() for cell in rows["texts"][2:5]] == ["7 equal, within 0.000 s", "equal, within 0.25 s", "ok"]
    assert "aiding starts at 5.090 s, the log's at 5.090 s" in outcome.out


@pytest.mark.usefixtures("known")
def test_bench_is_judged_by_its_events(viso: Viso, tmp_path: Path) -> None:
    (tmp_path / "bench_voxl.BIN.xz").symlink_to(LOG)
    outcome = viso("bench_voxl.BIN.xz")
    assert all(what in outcome.out for what in ("TS changes", "SS changes", "resets (OFN, OFE)", "SP side of 1"))


@pytest.mark.usefixtures("known")
def test_comparison_for_machines(viso: Viso) -> None:
    outcome = json.loads(viso(LOG, "--json").out)
    assert (outcome["log"], outcome["passed"]) == (str(LOG), True)
    assert (outcome["firmware"], outcome["firmware_reason"]) == ("2025-07", "the banner says so")
    first, second = outcome["cores"]
    assert (first["core"], first["imu"], second["core"], second["imu"]) == (0, 0, 1, 2)
    assert first["aiding_s"] == [5.08963, 5.08963]
    assert first["equal"] == {"TS": 1.0, "SS": 1.0, "both": 1.0}
    assert first["errors"]["PN"]["rms"] <= first["errors"]["PN"]["worst"]
    assert first["texts"] == {"lines": [], "matched": 7, "worst_s": 0.0}
    assert {"what", "figure", "target", "passed"} == set(first["checks"][0])
    assert outcome["lanes"] == {"lines": [], "matched": 1, "worst_s": 0.0}


def test_changes_of_the_primary_core_are_compared(viso: Viso, known: SimpleNamespace) -> None:
    assert "changes of the primary core: 1 equal, within 0.000 s" in viso(LOG).out
    known.our_lanes = []
    assert "5.200 s: MSG: only recorded: 'EKF3 lane switch 1'" in viso(LOG).out
    assert viso(LOG, "--check").code == 1


def test_core_alone_has_none_to_change_with(viso: Viso, known: SimpleNamespace) -> None:
    known.our_lanes, known.imus = [], {1: 2}
    outcome = viso(LOG, "--core", "1", "--check")
    assert (outcome.code, known.core) == (0, 1)
    assert "core 1 (IMU 2)" in outcome.out
    assert "primary" not in outcome.out
    assert json.loads(viso(LOG, "--core", "1", "--json").out)["lanes"] is None


def test_what_parameters_ask_for_in_vain_is_noted(viso: Viso, known: SimpleNamespace) -> None:
    known.notes = ("ARSPD_TYPE is 1: airspeed is not fused here",)
    assert viso(LOG).err == "note: ARSPD_TYPE is 1: airspeed is not fused here\n"


@pytest.mark.usefixtures("known")
def test_nothing_is_printed_without_a_comparison(viso: Viso) -> None:
    assert viso(LOG, "-o", "out.BIN", "--no-compare") == Outcome(0, "", "")
    assert Path("out.BIN").stat().st_size


def miss(monkeypatch: pytest.MonkeyPatch) -> None:
    strict = Tolerance(FLIGHT, ("XKF1.Yaw",), "deg", "none is met", rms=0.0)
    monkeypatch.setattr(tolerances, "TOLERANCES", (*TOLERANCES, strict))


@pytest.mark.usefixtures("known")
def test_missed_target_is_a_finding_only_when_asked(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    assert viso(LOG, "--check").code == 0
    miss(monkeypatch)
    outcome = viso(LOG)
    assert outcome.code == 0
    assert "missed" in outcome.out
    assert viso(LOG, "--check").code == 1


@pytest.mark.usefixtures("known")
def test_check_counts_without_a_comparison_too(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    miss(monkeypatch)
    assert viso(LOG, "--check", "--no-compare").code == 1


@pytest.mark.usefixtures("known")
def test_what_comes_after_the_end_of_a_log_is_not_compared(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(tolerances.END_S, "voxl", 5.1)
    outcome = json.loads(viso(LOG, "--json").out)
    assert [(core["records"], core["texts"]["matched"]) for core in outcome["cores"]] == [(0, 5), (0, 5)]


def test_texts_that_differ_are_printed(viso: Viso, known: SimpleNamespace) -> None:
    replay = known.comparison(0)
    texts = [(time_s, text.replace("tilt", "roll")) for time_s, text in replay.our_texts]
    known.comparison = lambda _core: replace(replay, our_texts=texts)
    out = viso(LOG).out
    assert "5.065 s: MSG: only ours: 'roll alignment complete'" in out
    assert "5.065 s: MSG: only recorded: 'tilt alignment complete'" in out


def test_log_without_estimates_is_noted(viso: Viso, known: SimpleNamespace) -> None:
    known.comparison = lambda _core: None
    assert viso(LOG) == Outcome(0, "", f"note: {LOG} has no XKF records to compare with\n")
    assert failed_with(viso(LOG, "--check"), f"{LOG}: no XKF records to compare with")


# What it writes


def test_pymavlink_reads_the_log_to_its_end(written: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with DFReader_binary(str(written)) as log:
        times_us = []
        while (record := log.recv_msg()) is not None:
            if "TimeUS" in record._fieldnames:
                times_us.append(record.TimeUS)
        assert log.remaining == 0
    assert times_us == sorted(times_us)
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_estimates_are_near_the_logs_own_record_by_record(short: Path, written: Path) -> None:
    theirs = [record for record in records_of(short, "XKF1") if record.TimeUS <= UNTIL_S * 1e6]
    ours = [record for record in records_of(written, "XKF1") if record.C == 0]
    assert [record.TimeUS for record in ours] == [record.TimeUS for record in theirs]
    assert all(abs(mine.PN - other.PN) < 0.05 for mine, other in zip(ours, theirs, strict=True))


@pytest.mark.slow
def test_mavlogdump_prints_the_estimates(written: Path) -> None:
    script = Path(sys.executable).parent / "mavlogdump.py"
    command = [sys.executable, str(script), "--types", "XKF4,MSG", str(written)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    lines = result.stdout.splitlines()
    assert sum("XKF4 {" in line for line in lines) == len(records_of(written, "XKF4"))
    assert any("EKF3 IMU1 is using external nav data" in line for line in lines)


@pytest.mark.slow
def test_interrupted_run_leaves_what_there_was(viso: Viso, monkeypatch: pytest.MonkeyPatch, short: Path) -> None:
    passed = EkfRun.passed

    def interrupt(run: EkfRun) -> None:
        passed(run)
        if run.time_s > 4.6:
            raise KeyboardInterrupt

    monkeypatch.setattr(EkfRun, "passed", interrupt)
    outcome = viso(short, "-o", "out.BIN")
    assert outcome.code != 0
    assert "note: interrupted; out.BIN ends at 4.625 s\n" in outcome.err
    texts = [record.Message for record in records_of(Path("out.BIN"), "MSG")]
    assert texts == ["EKF3 IMU0 initialised", "EKF3 IMU1 initialised"]
    assert [record.TimeUS for record in records_of(Path("out.BIN"), "XKF1")][-1] == 4_549_846


def test_failed_run_leaves_what_was_there(viso: Viso, tmp_path: Path) -> None:
    Path("out.BIN").write_bytes(b"before")
    Path("cut.BIN.xz").write_bytes(LOG.read_bytes()[:10_000])
    assert viso("cut.BIN.xz", "-o", "out.BIN").code == 2
    assert Path("out.BIN").read_bytes() == b"before"


# What cannot be used


def test_missing_log_is_one_line(viso: Viso) -> None:
    assert failed_with(viso("none.BIN", "-o", "out.BIN"), "none.BIN: No such file or directory")
    assert not Path("out.BIN").exists()


def test_damaged_xz_is_one_line(viso: Viso) -> None:
    Path("cut.BIN.xz").write_bytes(LOG.read_bytes()[:10_000])
    outcome = viso("cut.BIN.xz")
    assert (outcome.code, outcome.out, outcome.err.count("\n")) == (2, "", 1)
    assert outcome.err.startswith("viso: cut.BIN.xz: damaged xz file: ")


def test_file_that_is_no_log_is_one_line(viso: Viso) -> None:
    Path("text.BIN").write_text("hello")
    assert failed_with(viso("text.BIN"), "text.BIN: not a DataFlash log")


@pytest.mark.slow
def test_log_of_another_kind_is_one_line(viso: Viso, written: Path) -> None:
    assert failed_with(viso(written), f"{written}: no replay records; LOG_REPLAY was off, or the EKF was")


def test_place_that_cannot_be_written_to_is_told_ahead(viso: Viso, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ekf_command, "EkfRun", None)
    assert failed_with(viso(LOG, "-o", "."), ".: Is a directory")


@pytest.mark.parametrize("until", [0, -1, float("nan")])
def test_time_to_end_at_is_a_time(viso: Viso, until: float) -> None:
    assert failed_with(viso(LOG, until=until), f"--until {float(until)}: not a time since boot")
