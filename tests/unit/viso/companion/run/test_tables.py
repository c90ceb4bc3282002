# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of an odometry, live and in the end."""

import dataclasses
from io import StringIO

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.unit.viso.vio_results import SECOND_NS, Flight, flown
from viso.companion.run.log import VioLog
from viso.companion.run.tables import STYLES, live_table, summary_table
from viso.companion.vio.config import VioConfig
from viso.companion.vio.types import VioState
from viso.geometry.trajectory import Trajectory


def drawn(table: Table) -> str:
    console = Console(file=StringIO(), width=140)
    console.print(table)
    return str(console.file.getvalue())  # type: ignore[attr-defined]


def test_live_table_shows_the_last_frame() -> None:
    text = drawn(live_table(flown(Flight().init().fly(2)).last))
    for cell in ("TRACKING", "all clear", "100", "90", "12.5 px", "2.00     0.00     2.00", "0.14 m", "20"):
        assert f" {cell} " in text


def test_live_table_has_no_figures_without_an_output() -> None:
    assert " - " in drawn(live_table(flown(Flight().lose()).last))


def test_live_table_shows_how_an_engine_fares() -> None:
    frame = flown(Flight().init().fly(2)).last
    assert frame is not None
    result = dataclasses.replace(frame.result, counters={"restarts": 1, "late_answers": 2, "hangs": 0})
    frame = dataclasses.replace(frame, result=result)
    assert "1 restarts, 2 late" in drawn(live_table(frame))


def test_live_table_is_there_before_the_first_frame() -> None:
    assert "inliers" in drawn(live_table(None))


def test_every_state_has_a_colour() -> None:
    assert set(STYLES) == set(VioState)


def test_closing_table_tells_all() -> None:
    times = np.arange(8) * SECOND_NS
    truth = Trajectory(times, np.column_stack([0.8 * np.arange(8), np.zeros((8, 2))]), np.tile([1.0, 0, 0, 0], (8, 1)))
    summary = flown(Flight().init().fly(5).lose()).summary(truth) | {"sent": {"HEARTBEAT": 3, "ODOMETRY": 40}}
    text = drawn(summary_table("flight.mp4", summary))
    for part in (
        "flight.mp4: 7 frames in 6.0 s",
        "1 INIT, 5 TRACKING, 1 LOST",
        "LOST (too_few_inliers)",
        "4.0 m in 5 poses",
        "0.283 m over 3.2 m, 8.8%; scale +25.0%",
        "100 in the median",
        "20.0 ms in the median, 95 % below 20.0 ms",
        "2 frames",
        "3 HEARTBEAT, 40 ODOMETRY",
    ):
        assert part in text


def test_closing_table_tells_how_an_engine_fared() -> None:
    summary = VioLog(VioConfig()).summary(None)
    counters = {"restarts": 1, "late_answers": 0, "exits": 2}
    assert "1 restarts, 2 exits" in drawn(summary_table("none", {**summary, "engine": counters}))
    assert "no failure" in drawn(summary_table("none", {**summary, "engine": {"restarts": 0}}))


def test_closing_table_of_nothing_is_one() -> None:
    summary = VioLog(VioConfig()).summary(None) | {"sent": {}}
    text = drawn(summary_table("none", summary))
    assert "the truth is not known" in text
    assert "nothing" in text


def test_what_was_sent_is_left_out_without_a_vehicle() -> None:
    assert "sent" not in drawn(summary_table("none", VioLog(VioConfig()).summary(None)))
