# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs whose end is the tail of an older one."""

from pathlib import Path

import pytest

from tests.places import DATA
from tests.unit.viso.command_line import Viso
from tests.unit.viso.report.log_maker import LogMaker, flight
from viso.logs.recorded import notes_of_lost, read_columns

OVERLAPPED = DATA / "strangers" / "overlapped.BIN.xz"
CLOCK = DATA / "strangers" / "clock_35x.BIN.xz"
SAYS = "another log, such as the tail of an older one: TimeUS steps back from 142.9 to 142.5 s; they are left out"


def with_tail(path: Path) -> Path:
    """Return a flight of 12 s, behind which stand 200 poses of an older one, 40 m away."""
    maker = flight()
    for number in range(200):
        maker.add("VISP", 2.0 + 0.01 * number, PX=40.0)
    return maker.save(path)


def test_log_ends_where_its_time_steps_back() -> None:
    log = read_columns(OVERLAPPED)
    _, times_us, _ = log.times_us()
    assert (times_us[1:] >= times_us[:-1]).all()
    (note,) = notes_of_lost(log)
    assert note == f"the last 1112 bytes are {SAYS}"


@pytest.mark.parametrize("command", ["doctor", "report"])
def test_commands_say_where_another_log_begins(viso: Viso, tmp_path: Path, command: str) -> None:
    output = ["-o", str(tmp_path)] if command == "report" else []
    shown = viso(command, str(OVERLAPPED), *output)
    assert f"{OVERLAPPED}: the last 1112 bytes are {SAYS}" in shown.err
    assert "moved" not in shown.out


@pytest.mark.parametrize("command", [("doctor",), ("report", "--tum", "flight.tum"), ("replay",)])
def test_poses_of_an_older_log_are_left_out(
    viso: Viso, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    name, *options = command
    log = with_tail(tmp_path / "tail.BIN")
    shown = viso(name, str(log), *options)
    assert "another log, such as the tail of an older one: TimeUS steps back from 11.9 to 2.0 s" in shown.err
    alone = viso(name, str(flight().save(tmp_path / "tail.BIN")), *options)
    assert shown.out == alone.out


def test_damaged_times_are_no_other_log(tmp_path: Path) -> None:
    maker = LogMaker()
    for number in range(100):
        time_s = 10.0 + 0.1 * number
        maker.add("VISP", {40: 2.0, 41: 3.0, 60: 90.0, 61: 80.0}.get(number, time_s))
    log = read_columns(maker.save(tmp_path / "damaged.BIN"))
    assert not log.lost
    assert log.counts["VISP"] == 100


def test_log_sorted_by_types_is_one_log(tmp_path: Path) -> None:
    maker = LogMaker()
    for name in ("XKF4", "VISP"):
        for number in range(50):
            maker.add(name, 10.0 + 0.1 * number)
    assert not read_columns(maker.save(tmp_path / "sorted.BIN")).lost


# A clock that 1.3 s prove to be wrong


def test_clock_that_is_far_too_fast_is_named_within_a_second(viso: Viso, tmp_path: Path) -> None:
    shown = viso("doctor", str(CLOCK))
    assert "the sender's clock runs 29 times too fast" in shown.out
    assert shown.code == 1
    assert viso("report", str(CLOCK), "-o", str(tmp_path)).out.startswith("TROUBLE: ")
