# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a running vehicle says."""

from collections.abc import Callable

import pytest

from emulator.console import out
from emulator.live_report import LiveReport
from mav_handlers.endpoint import MessageEvent
from tests.unit.emulator.conftest import BOOTED_US, Bench


def at(after_boot_s: float) -> str:
    """Return how a line of that time begins."""
    return f"{BOOTED_US / 1e6 + after_boot_s:9.3f} s  "


def test_first_verdict_of_each_kind_is_told(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench(VISO_TYPE=1, VISO_QUAL_MIN=50)
    LiveReport(out).watch(bench.vehicle)
    bench.see(0.2)
    bench.see(0.2, quality=5)
    assert capsys.readouterr().out == f"{at(0.2)}first ODOMETRY ignored: quality is below VISO_QUAL_MIN\n"


def test_texts_are_told_with_time_and_severity(
    make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]
) -> None:
    bench = make_bench()
    LiveReport(out).watch(bench.vehicle)
    bench.vehicle.texts.send_text(2, "Hello")
    assert capsys.readouterr().out == f"{at(0.0)}(2) Hello\n"


def test_listeners_are_told_of_every_message_with_its_link(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(VISO_TYPE=1)
    heard: list[tuple[str, MessageEvent]] = []
    LiveReport(out, [lambda link, event: heard.append((link, event))] * 2).watch(bench.vehicle)
    bench.see(0.1)
    assert [(link, event.name) for link, event in heard] == [("client", "ODOMETRY")] * 4


def test_restart_is_told(make_bench: Callable[..., Bench], capsys: pytest.CaptureFixture[str]) -> None:
    report = LiveReport(out)
    report.watch(make_bench().vehicle)
    report.watch(make_bench().vehicle)
    assert capsys.readouterr().out == f"{at(0.0)}restart\n"
