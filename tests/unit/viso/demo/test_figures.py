# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A closed loop in figures: from made-up errors, and from a short flight."""

import json
from dataclasses import asdict
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from tests.unit.viso.demo.hops import COMPANION_S, HOP_COVERED_S, HOP_END_S, between, hop, make_setup
from viso.demo.errors import PoseErrors
from viso.demo.figures import LoopFigures, accuracy_of, figures_of, figures_table
from viso.demo.loop import CompanionLoop
from viso.demo.loop_plot import save_plot
from viso.demo.record import COMPANION
from viso.geometry.rotation import Array
from viso.logs.logger import MemoryLog

pytestmark = pytest.mark.slow  # a flight with a companion


def errors(errors_ned: list[tuple[float, float, float]], sigma_m: float) -> PoseErrors:
    """Return errors at one place after the other."""
    off = np.array(errors_ned, np.float64)
    count = len(off)
    angles: Array = np.linspace(-1.0, 1.0, count) * (np.pi / 180)
    sigmas_m: Array = np.full_like(off, sigma_m)
    return PoseErrors(np.arange(count, dtype=np.float64), off, np.zeros_like(off), sigmas_m, np.abs(angles), angles)


def test_accuracy_is_that_of_the_errors() -> None:
    accuracy = accuracy_of(errors([(3.0, 4.0, 1.0), (0.0, 0.0, -2.0), (0.0, 1.0, 0.0)], 1.5))
    assert accuracy is not None
    assert accuracy.horizontal_rms_m == pytest.approx(np.sqrt(26 / 3))
    assert (accuracy.horizontal_max_m, accuracy.horizontal_end_m) == (5.0, 1.0)
    assert accuracy.height_rms_m == pytest.approx(np.sqrt(5 / 3))
    assert accuracy.height_max_m == 2.0
    assert accuracy.yaw_rms_deg == pytest.approx(np.sqrt(2 / 3))
    assert accuracy.tilt_rms_deg == pytest.approx(np.sqrt(2 / 3))
    assert accuracy.within_2_sigma == pytest.approx(8 / 9)


def test_nothing_has_no_accuracy() -> None:
    assert accuracy_of(between(errors([(0.0, 0.0, 0.0)], 1.0), 5.0, 6.0)) is None


@pytest.fixture(scope="module")
def loop() -> CompanionLoop:
    """A short flight."""
    return hop()


@pytest.fixture(scope="module")
def figures(loop: CompanionLoop) -> LoopFigures:
    """Its figures."""
    return figures_of(loop)


def test_both_ends_are_close_to_the_truth(figures: LoopFigures) -> None:
    for accuracy in (figures.odometry, figures.estimate):
        assert accuracy is not None
        assert accuracy.horizontal_max_m < 0.3
        assert accuracy.yaw_rms_deg < 3.0


def test_darkness_degrades_and_beginning_anew_steps_the_counter(loop: CompanionLoop) -> None:
    said = [one for one in loop.record.all_texts if one.who == COMPANION and one.time_us > HOP_COVERED_S[0] * 1e6]
    assert [one.text.split(":")[0] for one in said if "->" in one.text] == [
        *("TRACKING -> DEGRADED", "DEGRADED -> INIT", "INIT -> TRACKING"),
    ]
    counters = [one.message.reset_counter for one in loop.record.arrived]
    assert counters == sorted(counters)
    assert set(counters) == {0, 1}
    dark_us = [1e6 * (HOP_COVERED_S[0] + 0.4), 1e6 * HOP_COVERED_S[1]]
    dark = [one.message.quality for one in loop.record.arrived if dark_us[0] < one.time_us < dark_us[1]]
    assert dark
    assert 1 <= min(dark) <= max(dark) < 50
    codes = {code for name, _, code in loop.vehicle.endpoint.verdict_counts() if name == "ODOMETRY"}
    assert codes == {"consumed", "quality_below_min"}


@pytest.mark.slow
def test_loop_can_be_drawn(loop: CompanionLoop, tmp_path: Path) -> None:
    save_plot(loop, tmp_path / "loop.png")
    assert (tmp_path / "loop.png").read_bytes().startswith(b"\x89PNG")


def test_path_is_as_long_as_what_was_flown(figures: LoopFigures, loop: CompanionLoop) -> None:
    flight = loop.setup.flight
    t_s = np.arange(0.0, HOP_END_S - COMPANION_S, 0.02)
    speed_m_s = np.linalg.norm(flight.trajectory.motion(t_s).velocity_w, axis=1)
    assert figures.path_m == pytest.approx(speed_m_s.sum() * 0.02, rel=0.01)


def test_states_and_modes_fill_the_time(figures: LoopFigures) -> None:
    assert sum(figures.states.values()) == pytest.approx(HOP_END_S - COMPANION_S, abs=0.01)
    assert sum(figures.aiding.values()) == pytest.approx(HOP_END_S, abs=0.01)
    assert set(figures.states) == {"INIT", "TRACKING", "DEGRADED"}
    assert set(figures.aiding) == {"none", "absolute"}


def test_messages_add_up(figures: LoopFigures, loop: CompanionLoop) -> None:
    arrived = loop.record.arrived
    assert figures.sent == len(arrived) == figures.accepted + sum(figures.withheld.values())
    assert set(figures.withheld) == {"quality_below_min"}
    assert figures.accepted - 4 <= figures.fused <= figures.accepted


def test_qualities_are_those_of_the_messages(figures: LoopFigures, loop: CompanionLoop) -> None:
    qualities = [one.message.quality for one in loop.record.arrived]
    assert figures.qualities is not None
    least, median, most = figures.qualities
    assert (least, most) == (min(qualities), max(qualities))
    assert least < median <= most


def test_beginning_anew_is_one_reset_at_both_ends(figures: LoopFigures) -> None:
    assert figures.reset_counter == 1
    assert len(figures.position_resets) == 1


def rendered(figures: LoopFigures) -> str:
    """Return the table as a narrow terminal shows it."""
    console = Console(file=StringIO(), width=80, force_terminal=False)
    console.print(figures_table(figures))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_table_tells_it_all_on_a_narrow_terminal(figures: LoopFigures) -> None:
    text = rendered(figures)
    for words in ("horizontal", "TRACKING", "absolute", "quality_below_min", "heading", str(figures.sent)):
        assert words in text
    assert "…" not in text


def test_rows_for_machines_are_json(figures: LoopFigures) -> None:
    row = json.loads(json.dumps(asdict(figures)))
    assert row["sent"] == figures.sent
    assert figures.odometry is not None
    assert row["odometry"]["horizontal_rms_m"] == figures.odometry.horizontal_rms_m


@pytest.mark.slow
def test_loop_that_has_not_begun_has_figures() -> None:
    loop = CompanionLoop(make_setup(7.0), MemoryLog)
    loop.run_until(100_000)
    figures = figures_of(loop)
    assert (figures.path_m, figures.odometry, figures.estimate, figures.qualities) == (0.0, None, None, None)
    assert "-" in rendered(figures)
