# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a sweep: what is kept, what is done again, and what is refused."""

import csv
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from viso.errors import InputError
from viso.replay.figures import OBJECTIVES, Row
from viso.sweep.dimensions import Axis
from viso.sweep.job import Result
from viso.sweep.plan import InputFile, Recorded, SweepPlan
from viso.sweep.store import CSV, DEFINITION, JOURNAL, PARQUET, SweepFolder, columns, table_rows

PLAN = SweepPlan(
    (Recorded("one", InputFile("/one.tum", "0" * 64), "follow"),),
    (Axis("VISO_DELAY_MS", (0.0, 10.0, 20.0, 30.0)),),
    {"2025-07": {}},
    ("2025-07",),
)


def row(nis: float | None, **figures: float | None) -> Row:
    return {**dict.fromkeys(OBJECTIVES), "nis": nis, **figures}


def fill(path: Path, *numbers: int) -> None:
    with SweepFolder(path, PLAN) as folder:
        for number in numbers:
            folder.add(Result(number, row(0.1 * number, tested=number)))


def done(path: Path) -> dict[int, Row]:
    with SweepFolder(path, PLAN) as folder:
        return dict(folder.done)


def test_what_was_done_is_there_again(tmp_path: Path) -> None:
    fill(tmp_path, 2, 0)
    assert done(tmp_path) == {0: row(0.0, tested=0), 2: row(0.2, tested=2)}
    fill(tmp_path, 1)
    assert sorted(done(tmp_path)) == [0, 1, 2]


def test_point_that_is_done_stays_as_it_was(tmp_path: Path) -> None:
    fill(tmp_path, 1)
    with SweepFolder(tmp_path, PLAN) as folder:
        folder.add(Result(1, row(99.0)))
    assert done(tmp_path)[1]["nis"] == 0.1
    assert len((tmp_path / JOURNAL).read_text().splitlines()) == 1


def test_point_that_failed_is_not_done(tmp_path: Path) -> None:
    with SweepFolder(tmp_path, PLAN) as folder:
        folder.add(Result(1, None, "bad luck"))
    assert done(tmp_path) == {}


@settings(max_examples=25)
@given(lost=st.integers(1, 400))
def test_line_that_was_cut_short_is_done_again_and_no_other(
    tmp_path_factory: pytest.TempPathFactory, lost: int
) -> None:
    path = tmp_path_factory.mktemp("cut")
    fill(path, 0, 1, 2)
    journal = path / JOURNAL
    whole = journal.read_bytes()
    journal.write_bytes(whole[:-lost])
    lines = whole[:-lost].count(b"\n")
    assert sorted(done(path)) == list(range(lines))
    fill(path, *range(lines, 4))
    assert sorted(done(path)) == [0, 1, 2, 3]
    assert all(json.loads(line) for line in journal.read_text().splitlines())


def test_another_definition_is_refused_and_says_what_differs(tmp_path: Path) -> None:
    fill(tmp_path, 0)
    with pytest.raises(InputError) as error:
        SweepFolder(tmp_path, replace(PLAN, baud=57600))
    assert str(error.value) == (
        f"{tmp_path / DEFINITION}: another sweep: baud was null, now it is 57600; "
        "-o with another folder begins a new one"
    )
    assert sorted(done(tmp_path)) == [0]


@pytest.mark.parametrize(("changed", "what"), [
    (lambda plan: replace(plan, axes=(Axis("VISO_DELAY_MS", (0.0, 5.0)),)), "set.VISO_DELAY_MS.values was [0.0, 10.0"),
    (lambda plan: replace(plan, axes=(Axis("VISO_SCALE", (1.0,)),)), "set.VISO_DELAY_MS was"),
    (lambda plan: replace(plan, seeds=(1,)), "seeds was [null], now it is [1]"),
    (lambda plan: replace(plan, code="2"), 'code was "", now it is "2"'),
    (lambda plan: replace(plan, settings={"2025-07": {"VISO_TYPE": 1.0}}), "settings.2025-07.VISO_TYPE was not there"),
    (
        lambda plan: replace(plan, recordings=(replace(plan.recordings[0], file=InputFile("/one.tum", "1" * 64)),)),
        "streams.one.files.one.tum was",
    ),
])  # fmt: skip
def test_whatever_defines_a_sweep_counts(tmp_path: Path, changed: Callable[[SweepPlan], SweepPlan], what: str) -> None:
    fill(tmp_path)
    with pytest.raises(InputError) as error:
        SweepFolder(tmp_path, changed(PLAN))
    assert f"another sweep: {what}" in str(error.value)


def test_folder_is_for_one_command_at_a_time(tmp_path: Path) -> None:
    with (
        SweepFolder(tmp_path, PLAN),
        pytest.raises(InputError, match="another viso sweep is at work here"),
    ):
        SweepFolder(tmp_path, PLAN)
    assert done(tmp_path) == {}


@pytest.mark.parametrize("line", ["{}", "[1]", '{"point": "x", "figures": {}}', "nonsense"])
def test_journal_that_is_none_is_one_line(tmp_path: Path, line: str) -> None:
    fill(tmp_path, 0)
    with (tmp_path / JOURNAL).open("a") as journal:
        journal.write(line + "\n")
    with pytest.raises(InputError, match=r"points.jsonl:2: not a point of a sweep"):
        SweepFolder(tmp_path, PLAN)


def test_definition_that_is_none_is_one_line(tmp_path: Path) -> None:
    fill(tmp_path, 0)
    (tmp_path / DEFINITION).write_text("{")
    with pytest.raises(InputError, match="not the definition of a sweep"):
        SweepFolder(tmp_path, PLAN)
    (tmp_path / DEFINITION).unlink()
    with pytest.raises(InputError, match="points of a sweep that nothing defines"):
        SweepFolder(tmp_path, PLAN)


def test_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file: File exists"):
        SweepFolder(tmp_path / "file", PLAN)


def test_no_descriptor_is_left_open(tmp_path: Path) -> None:
    before = set(os.listdir("/proc/self/fd"))
    fill(tmp_path, 0)
    with pytest.raises(InputError):
        SweepFolder(tmp_path, replace(PLAN, baud=1))
    assert set(os.listdir("/proc/self/fd")) == before


def test_tables_have_the_same_figures_bit_for_bit(tmp_path: Path) -> None:
    with SweepFolder(tmp_path, PLAN) as folder:
        folder.add(Result(3, row(0.1 + 0.2, resets=2)))
        folder.add(Result(1, row(None)))
        folder.write_tables()
    table = pq.read_table(tmp_path / PARQUET)
    assert table.column_names == columns(PLAN)
    rows = table.to_pylist()
    assert rows == table_rows(PLAN, {1: row(None), 3: row(0.1 + 0.2, resets=2)})
    assert [one["point"] for one in rows] == [1, 3]
    with (tmp_path / CSV).open() as file:
        read = list(csv.DictReader(file))
    assert [one["nis"] for one in read] == ["", repr(0.1 + 0.2)]
    assert (read[1]["VISO_DELAY_MS"], read[1]["resets"], read[1]["stream"]) == ("30.0", "2", "one")
