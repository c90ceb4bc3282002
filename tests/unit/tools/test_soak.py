# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The soak's judgement on its figures."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from tools.soak import Figures, Peer, free_port, intervals, report, spread

GOOD = Figures(seconds=180, sent=36000, accepted=36000, begin_mb=100.0, third_mb=120.0, end_mb=121.0)


@pytest.fixture
def peer() -> Iterator[Peer]:
    made = Peer(free_port(), 190)
    yield made
    made.close()


def test_nothing_lost_and_nothing_grown_is_no_finding(peer: Peer) -> None:
    assert GOOD.findings([peer]) == []


@pytest.mark.parametrize(
    ("figures", "finding"),
    [
        (replace(GOOD, accepted=35990), "10 samples not accepted"),
        (replace(GOOD, end_mb=131.0), "memory grew by 11.0 MB"),
    ],
)
def test_loss_and_growth_are_findings(peer: Peer, figures: Figures, finding: str) -> None:
    assert figures.findings([peer]) == [finding]


def test_growth_in_a_short_run_is_none(peer: Peer) -> None:
    assert replace(GOOD, seconds=179, end_mb=131.0).findings([peer]) == []


def test_frames_that_the_vehicle_sent_and_nobody_got_are_a_finding(peer: Peer) -> None:
    peer.missing, peer.damaged = 2, 1
    assert GOOD.findings([peer]) == ["component 190: 1 damaged", "component 190: 2 missing"]


def test_spread_tells_median_and_extreme() -> None:
    assert spread([*range(100), 1000.0]) == "median 50.0, 99 % 99.0, longest 1000.0 ms"
    assert spread([]) == "never"


def test_intervals_lie_between_the_times() -> None:
    assert intervals([100, 200, 305]) == [100.0, 105.0]


def test_report_names_what_met_another_verdict(peer: Peer) -> None:
    figures = replace(GOOD, other_verdicts={"HEARTBEAT handled": 60})
    assert report(figures, [peer])[-1].endswith("HEARTBEAT handled: 60")
