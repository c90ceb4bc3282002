# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans: which points follow, and that the same plan has the same ones."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from viso.errors import InputError
from viso.sweep.dimensions import Axis
from viso.sweep.plan import LATIN, RANDOM, Faults, InputFile, Recorded, Sampling, SweepPlan, check_plan, input_file

A, B = Axis("A", (1.0, 2.0)), Axis("B", (3.0, 4.0, 5.0))
SPAN, WHOLE = Axis("S", span=(-1.0, 1.0)), Axis("W", span=(0.0, 9.0), is_whole=True)


def recorded(name: str) -> Recorded:
    return Recorded(name, InputFile(f"/there/{name}.tum", "0" * 64), "follow")


@pytest.fixture
def plan() -> SweepPlan:
    return SweepPlan((recorded("one"),), (A, B), {"2025-07": {}}, ("2025-07",))


def test_grid_has_every_combination_once_the_last_axis_fastest(plan: SweepPlan) -> None:
    points = list(plan.points())
    assert [point.number for point in points] == list(range(6)) == list(range(plan.size))
    assert [point.values for point in points] == [(1, 3), (1, 4), (1, 5), (2, 3), (2, 4), (2, 5)]


def test_streams_firmware_faults_and_seeds_multiply(plan: SweepPlan) -> None:
    more = replace(
        plan,
        recordings=(recorded("one"), recorded("two")),
        firmware=("4.6", "2025-07"),
        faults=(Faults(), Faults("bad", "faults: []")),
        seeds=(1, 2, 3),
    )
    points = list(more.points())
    assert len(points) == more.size == 6 * 2 * 2 * 2 * 3
    assert len({(p.recording, p.firmware, p.faults, p.seed, p.values) for p in points}) == len(points)


@pytest.mark.parametrize("method", [RANDOM, LATIN])
def test_draws_are_the_same_every_time_and_others_with_another_seed(plan: SweepPlan, method: str) -> None:
    drawn = replace(plan, axes=(SPAN, WHOLE), sampling=Sampling(method, 20, seed=5))
    first = [point.values for point in drawn.points()]
    assert first == [point.values for point in drawn.points()]
    assert len(first) == drawn.size == 20
    other = replace(drawn, sampling=Sampling(method, 20, seed=6))
    assert first != [point.values for point in other.points()]


def test_latin_hypercube_without_scipy_says_what_to_install(plan: SweepPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.stats", None)
    with pytest.raises(InputError, match=r"pip install 'ardupilot-viso\[sweep\]'$"):
        list(replace(plan, axes=(SPAN,), sampling=Sampling(LATIN, 20)).points())


def test_latin_hypercube_has_one_point_in_each_slice_of_each_axis(plan: SweepPlan) -> None:
    drawn = replace(plan, axes=(SPAN, WHOLE), sampling=Sampling(LATIN, 10))
    values = np.array([point.values for point in drawn.points()])
    assert sorted(np.floor((values[:, 0] + 1) * 5).tolist()) == list(range(10))
    assert sorted(values[:, 1].tolist()) == list(range(10))


def test_every_stream_gets_the_same_draws(plan: SweepPlan) -> None:
    drawn = replace(plan, recordings=(recorded("one"), recorded("two")), axes=(SPAN,), sampling=Sampling(RANDOM, 3))
    points = list(drawn.points())
    assert [point.values for point in points[:3]] == [point.values for point in points[3:]]


def test_spans_are_for_samples(plan: SweepPlan) -> None:
    with pytest.raises(InputError, match=r"--set S=-1:1: a grid needs a step; a span is for --sample"):
        check_plan(replace(plan, axes=(SPAN,)))


def test_something_has_to_change(plan: SweepPlan) -> None:
    with pytest.raises(InputError, match="nothing is changed"):
        check_plan(replace(plan, axes=()))


def test_too_many_points_are_refused_before_they_are_made(plan: SweepPlan) -> None:
    wide = Axis("A", tuple(map(float, range(10_000))))
    with pytest.raises(InputError, match="100000000 points"):
        check_plan(replace(plan, axes=(wide, replace(wide, name="B"))))


def test_definition_is_what_files_hold_not_where_they_are(plan: SweepPlan) -> None:
    moved = replace(plan, recordings=(replace(recorded("one"), file=InputFile("/elsewhere/one.tum", "0" * 64)),))
    assert moved.as_dict() == plan.as_dict()
    changed = replace(plan, recordings=(replace(recorded("one"), file=InputFile("/there/one.tum", "1" * 64)),))
    assert changed.as_dict() != plan.as_dict()


def test_hash_tells_contents_of_files_and_folders_apart(tmp_path: Path, write: Callable[[str, str], Path]) -> None:
    one, two = write("one", "a"), write("two", "b")
    assert input_file(one).sha256 != input_file(two).sha256
    before = input_file(tmp_path).sha256
    write("two", "c")
    assert input_file(tmp_path).sha256 != before


def test_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file or directory"):
        input_file(tmp_path / "missing.tlog")


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str], Path]:
    def run(name: str, text: str) -> Path:
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return run
