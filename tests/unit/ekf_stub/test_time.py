# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times: every 49.7 days milliseconds of 32 bits wrap, passes come late, and stamps run back; the filter goes on.

Across the wrap what happens is the same as at any other time: texts and flags at the same relative times, and
estimates, to the bit.
"""

from collections.abc import Callable

import pytest

from tests.unit.ekf_stub.filter_rig import (
    MODE_ABSOLUTE,
    NAVIGATING,
    SLOW_LOOP_US,
    WRAP_US,
    FilterRig,
    navigating,
)

USUAL_US = 20 * 86_400_000_000
TENTH_US = 100_000

Sample = tuple[int, int, int, int, tuple[object, ...]]


class Voyage:
    """A run of the filter, of which samples are taken ten times per second."""

    def __init__(self, sources: str, *feeds: str, has_compass: bool, start_us: int) -> None:
        self.rig = FilterRig(sources, has_compass=has_compass, start_us=start_us, loop_us=SLOW_LOOP_US)
        self.rig.feeds.update(feeds)
        self._start_us = start_us
        self.samples: list[Sample] = []

    def run_until(self, end_s: float) -> None:
        """Go on to a time since the start."""
        rig = self.rig
        while rig.now_us - self._start_us < 1e6 * end_s:
            rig.one_pass()
            since_us = rig.now_us - self._start_us
            if rig.core.initialised and since_us % TENTH_US == 0:
                core, report = rig.core, rig.report
                numbers = report.rpy_rad, report.vel_ned, report.pos_ned, report.variances
                self.samples.append((since_us, core.flags, report.timeouts, core.aiding.mode, numbers))

    def went(self) -> tuple[list[Sample], list[tuple[int, str]]]:
        """Return what it said, and what it told at which time since the start."""
        start_ms = self._start_us // 1000
        return self.samples, [(time_ms - start_ms, text) for time_ms, text in self.rig.said]


def lose_pose(start_us: int) -> Voyage:
    """Have poses until 6 s, none until 15 s, then some that are elsewhere."""
    voyage = Voyage("66666", "camera", has_compass=False, start_us=start_us)
    voyage.run_until(6)
    voyage.rig.feeds.discard("camera")
    voyage.run_until(15)
    voyage.rig.feeds.add("camera")
    voyage.rig.camera_shift = 3.0, 0.0, -2.0
    voyage.run_until(17)
    assert any(sample[2] & 3 == 3 for sample in voyage.samples)
    assert voyage.samples[-1][3] == MODE_ABSOLUTE
    return voyage


def stand(start_us: int) -> Voyage:
    """Wait for external navigation that does not come, with a compass."""
    voyage = Voyage("66661", has_compass=True, start_us=start_us)
    voyage.run_until(10)
    return voyage


def fly(start_us: int) -> Voyage:
    """Take off, and see nothing from 7 s on, so that aiding stops at 22 s, and see again."""
    voyage = Voyage("66666", "camera", "velocity", has_compass=False, start_us=start_us)
    voyage.run_until(4)
    voyage.rig.arm()
    voyage.rig.accel_ned = 0.2, 0.1, -0.5
    voyage.run_until(5)
    voyage.rig.accel_ned = 0.0, 0.0, 0.0
    voyage.run_until(7)
    voyage.rig.feeds -= {"camera", "velocity"}
    voyage.run_until(23)
    voyage.rig.feeds |= {"camera", "velocity"}
    voyage.run_until(25)
    assert "stopped aiding" in voyage.rig.texts
    return voyage


def restart(start_us: int) -> Voyage:
    """Move while parked, as velocities say, until the filter restarts."""
    voyage = Voyage("06666", "velocity", has_compass=False, start_us=start_us)
    voyage.run_until(3)
    voyage.rig.vel = 5.0, 0.0, 0.0
    voyage.run_until(12)
    assert "forced reset" in voyage.rig.texts
    return voyage


def gps(start_us: int) -> Voyage:
    """Wait until GPS is good."""
    voyage = Voyage("33131", "gps", has_compass=True, start_us=start_us)
    voyage.run_until(14)
    assert "origin set" in voyage.rig.texts
    return voyage


def before_wrap_us(wrap_s: float) -> int:
    """Return a time that is so long before the wrap; readings are taken every tenth of a second since boot."""
    return (WRAP_US - round(1e6 * wrap_s)) // TENTH_US * TENTH_US


@pytest.mark.parametrize(("run", "wrap_s"), [
    (lose_pose, 5),
    (lose_pose, 10),
    (stand, 0.5),
    (stand, 5),
    (fly, 4.5),
    (fly, 22),
    (restart, 8),
    (gps, 11),
])  # fmt: skip
def test_wrap_makes_no_difference(run: Callable[[int], Voyage], wrap_s: float) -> None:
    # Both begin at the same fraction of a second, so that all that is rounded is rounded alike.
    start_us = before_wrap_us(wrap_s)
    usual_us = USUAL_US + (start_us - USUAL_US) % 1_000_000
    assert run(start_us).went() == run(usual_us).went()


def test_nothing_happens_2_to_the_32_milliseconds_after_what_happened_at_boot() -> None:
    # GIVEN a vehicle that navigates since soon after boot
    rig = navigating(loop_us=SLOW_LOOP_US)
    before = rig.core.flags
    # WHEN it is up for 49.7 days, of which little but the ends is run
    for part in range(1, 4):
        rig.now_us = WRAP_US * part // 3 // SLOW_LOOP_US * SLOW_LOOP_US - 2_000_000
        rig.run(2.5)
    rig.run(12.0)
    # THEN it goes on navigating
    assert rig.core.flags == before == NAVIGATING
    assert rig.miss_m() < 0.05


# Passes that come late


@pytest.mark.parametrize("gap_s", [0.1, 1.0, 6.0])
def test_filter_goes_on_after_a_gap(gap_s: float) -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    for _ in range(5):
        rig.skip(gap_s)
        rig.run(0.3)
    rig.run(1.0)
    assert rig.mode == MODE_ABSOLUTE
    assert rig.core.flags == NAVIGATING
    assert rig.miss_m() < 0.05


def test_stamps_that_run_back_are_taken_and_fused() -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.feeds.discard("camera")
    for number in range(30):
        rig.camera(stamp_ms=rig.now_ms - (30 if number % 2 else 0))
        rig.run(0.04)
    codes = {code for kind, code in rig.became() if kind == "pose"}
    assert codes <= {"model_fused", "model_superseded"}
    assert rig.miss_m() < 0.05


def test_clock_of_passes_that_runs_back_does_not_stop_the_filter() -> None:
    rig = navigating(loop_us=SLOW_LOOP_US)
    rig.now_us -= 3_000_000
    rig.run(8.0)
    assert rig.core.flags == NAVIGATING
    assert rig.miss_m() < 0.05


def test_late_passes_are_made_up_for() -> None:
    rig = navigating()
    rig.is_late = True
    rig.move(1.0, 0.0, 0.0, 0.5)
    rig.run(1.0)
    assert rig.core.output.now.vel[0] == pytest.approx(0.5, abs=0.05)
    assert rig.miss_m() < 0.05
