# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of the page about speed: what they say of figures that were given, not measured."""

import json
import os
from collections.abc import Sequence
from pathlib import Path

import pytest

from tools import performance_table
from tools.performance_table import ON_BOTH_KERNELS, TARGETS, Measured, main, measure_apart, target_rows
from viso.bench.measure import Figure
from viso.vehicle.kernels import KERNEL_VARIABLE, NUMBA, PLAIN

PAGE = "".join(f"<!-- measured: {name} -->\nold\n<!-- end -->\n" for name in ("where", "performance", "targets"))


def figure(name: str, cost_us: float = 10.0, ratio: float | None = None) -> Figure:
    return Figure(name, "things", 1e6 / cost_us, cost_us, cost_us, cost_us, 100.0, 5, ratio)


def points(*blocks: int) -> list[dict[str, float | None]]:
    return [
        {"minute": minute, "rss_mib": 20.0 * minute, "blocks": number, "log_mib": 1.5 * minute}
        for minute, number in enumerate(blocks, 1)
    ]


def mark_of(measured: Measured, what: str, memory: Sequence[object] = ()) -> tuple[str, str]:
    [row] = [row for row in target_rows(measured, memory) if row[0] == what]
    return row[2], row[3]


@pytest.mark.parametrize(("ratio", "mark"), [(3.99, "met"), (4.01, "missed")])
def test_endpoint_is_held_to_four_times_pymavlinks_parse(ratio: float, mark: str) -> None:
    measured = {("message", PLAIN): [figure("ODOMETRY with covariance", ratio=ratio)]}
    assert mark_of(measured, TARGETS[0].what) == (f"{ratio} times", mark)


@pytest.mark.parametrize(("cost_us", "mark"), [(1e6 / 91, "met"), (1e6 / 89, "missed")])
def test_vehicle_is_held_to_ninety_times_real_time(cost_us: float, mark: str) -> None:
    measured = {("loop", NUMBA): [figure("yaw of the camera", cost_us)]}
    assert mark_of(measured, "vehicle with filter, compiled")[1] == mark
    assert mark_of(measured, "vehicle with filter, plain") == ("not measured", "")


@pytest.mark.parametrize(
    ("memory", "mark"),
    [(points(*[300] * 9, 1000, 1009), "met"), (points(*[300] * 9, 1000, 1011), "missed"), (points(400), "")],
)
def test_memory_is_to_be_flat_once_it_has_settled(memory: list[dict[str, float | None]], mark: str) -> None:
    assert mark_of({}, "an hour at 200 Hz, what Python keeps", memory)[1] == mark


@pytest.fixture
def kernels(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """Have benches tell on which kernels they were run, in place of measuring."""
    ran: dict[str, list[str]] = {}

    def note(name: str, kernel: str, _seconds: float) -> list[Figure]:
        ran.setdefault(name, []).append(kernel)
        return [figure("one", ratio=2.0)]

    monkeypatch.setattr(performance_table, "measure_apart", note)
    return ran


def test_page_gets_its_tables_and_only_those_with_a_filter_run_twice(
    tmp_path: Path, kernels: dict[str, list[str]]
) -> None:
    page, memory = tmp_path / "page.md", tmp_path / "memory.json"
    page.write_text(PAGE, encoding="utf-8")
    memory.write_text(json.dumps({"benches": {}, "memory": points(*[2000] * 12)}), encoding="utf-8")
    assert main(["--page", str(page), "--memory", str(memory)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    assert "| loop, numba | one | 100,000 things | 10 | 10 | 2 |" in text
    assert "2,000 to 2,000 blocks, resident 200 to 240 MiB, log 18 MiB, 12 minutes | met |" in text
    assert {name for name, ran in kernels.items() if ran == [PLAIN, NUMBA]} == set(ON_BOTH_KERNELS)
    assert all(ran == [PLAIN] for name, ran in kernels.items() if name not in ON_BOTH_KERNELS)


def test_bench_is_measured_in_a_process_of_its_own_that_alone_gets_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KERNEL_VARIABLE, PLAIN)
    figures = measure_apart("ekf_step", NUMBA, 0.0)
    assert [figure.rounds >= 5 for figure in figures] == [True] * 3
    assert os.environ[KERNEL_VARIABLE] == PLAIN


def test_without_a_page_the_tables_are_printed(capsys: pytest.CaptureFixture[str], kernels: object) -> None:
    assert main([]) == 0
    assert "| growth | one |" in capsys.readouterr().out


def test_page_without_a_place_is_told_before_anything_is_measured(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kernels: dict[str, list[str]]
) -> None:
    page = tmp_path / "page.md"
    page.write_text("nothing", encoding="utf-8")
    assert main(["--page", str(page)]) == 2
    assert "where" in capsys.readouterr().err
    assert not kernels
