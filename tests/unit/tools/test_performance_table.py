# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of the page about speed: what they say of figures that were given, not measured."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyperf
import pytest

from tools.performance_table import Figure, figures_of, main, target_rows

PAGE = "".join(f"<!-- measured: {name} -->\nold\n<!-- end -->\n" for name in ("where", "performance", "targets"))


def points(*blocks: int) -> list[dict[str, float]]:
    return [
        {"minute": minute, "rss_mib": 20.0 * minute, "blocks": number, "log_mib": 1.5 * minute}
        for minute, number in enumerate(blocks, 1)
    ]


def suite(**values_s: Sequence[float]) -> pyperf.BenchmarkSuite:
    """Return a file of figures, with the seconds of each round."""
    metadata = {"packages": "numpy 2", "commit": "0123456789abcdef"}
    return pyperf.BenchmarkSuite([
        pyperf.Benchmark([pyperf.Run(seconds, metadata={"name": name, **metadata})])
        for name, seconds in values_s.items()
    ])  # fmt: skip


def mark_of(figures: Mapping[str, Figure], what: str, memory: Sequence[object] = ()) -> tuple[str, str]:
    [row] = [row for row in target_rows(figures, memory) if row[0] == what]
    return row[2], row[3]


def test_best_rounds_are_compared() -> None:
    figures = figures_of(suite(message=[3e-5, 4e-5], parse=[1e-5, 2e-5]))
    assert figures["message"].best_s == 3e-5
    assert figures["message"].ratio == pytest.approx(3)
    assert figures["parse"].ratio is None
    assert figures_of(suite(message=[3e-5]))["message"].ratio is None


@pytest.mark.parametrize(("ratio", "mark"), [(2.39, "met"), (2.41, "missed")])
def test_ratio_is_held_to_its_target(ratio: float, mark: str) -> None:
    what = "ODOMETRY, bytes to records, by pymavlink's parse"
    assert mark_of({"message": Figure(1e-5, 1e-5, ratio)}, what) == (f"{ratio} times", mark)


@pytest.mark.parametrize(("times", "mark"), [(201, "met"), (199, "missed")])
def test_speed_is_held_to_its_target(times: int, mark: str) -> None:
    figures = {"loop": Figure(1 / times, 1.0)}
    assert mark_of(figures, "vehicle with filter")[1] == mark
    assert mark_of(figures, "vehicle with filter, interpreted") == ("not measured", "")


@pytest.mark.parametrize(
    ("memory", "mark"),
    [(points(*[300] * 9, 1000, 1009), "met"), (points(*[300] * 9, 1000, 1011), "missed"), (points(400), "")],
)
def test_memory_is_to_be_flat_once_it_has_settled(memory: list[dict[str, float]], mark: str) -> None:
    assert mark_of({}, "an hour at 200 Hz, what Python keeps", memory)[1] == mark


@pytest.fixture
def speed(tmp_path: Path) -> str:
    path = tmp_path / "speed.json"
    suite(growth=[4e-5], message=[3e-5, 3e-5, 5e-5], parse=[1e-5], loop=[0.01]).dump(str(path))
    return str(path)


def test_page_gets_its_tables(tmp_path: Path, speed: str) -> None:
    page, memory = tmp_path / "page.md", tmp_path / "memory.json"
    page.write_text(PAGE, encoding="utf-8")
    memory.write_text(json.dumps(points(*[2000] * 12)), encoding="utf-8")
    assert main([speed, "--page", str(page), "--memory", str(memory)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "old" not in text
    assert "| message | 33,333 messages | 30 | 48 | 3 |" in text
    assert "| growth | 25,000 messages | 40 | 40 | 1.33 |" in text
    assert "| parse |" not in text
    assert "numpy 2 |" in text
    assert "| commit | 0123456789 |" in text
    assert "2,000 to 2,000 blocks, resident 200 to 240 MiB, log 18 MiB, 12 minutes | met |" in text


def test_without_a_page_the_tables_are_printed(capsys: pytest.CaptureFixture[str], speed: str) -> None:
    assert main([speed]) == 0
    assert "| loop | 100 s simulated |" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["nothing", "{}", "[]"])
def test_file_that_holds_no_figures_is_told(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "speed.json"
    path.write_text(text, encoding="utf-8")
    assert main([str(path)]) == 2
    assert "performance_table: " in capsys.readouterr().err


def test_page_without_a_place_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str], speed: str) -> None:
    page = tmp_path / "page.md"
    page.write_text("nothing", encoding="utf-8")
    assert main([speed, "--page", str(page)]) == 2
    assert "where" in capsys.readouterr().err
