# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of the main loop that are run in blocks: the same comes of them as of one at a time, to the bit."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.unit.ekf_stub.filter_rig import SLOW_LOOP_US, FilterRig

PASSES = 120
EVERY = 3
"""Passes between two of which sensors may say something."""


def flying(cores: int) -> FilterRig:
    """Return a vehicle that is about to navigate, whose IMUs differ if there are several."""
    rig = FilterRig("66661", has_compass=True, cores=cores, loop_us=SLOW_LOOP_US)
    rig.accel_bias = [(0.05 * number, 0.0, 0.1 * number) for number in range(cores)]
    rig.run(2.0)
    rig.feeds |= {"camera", "velocity"}
    rig.yaw_rate, rig.accel_ned = 0.3, (0.5, 0.2, -0.1)
    return rig


def flown(cores: int, sizes: list[int], *, clears: bool) -> tuple[Any, ...]:
    """Run passes in blocks of some sizes, over and over; return all that came of them.

    Args:
        clears: whether whoever runs them takes what was said after each part of a block.
    """
    rig = flying(cores)
    left, turn, calls = PASSES, 0, 0
    while left:
        rig.feed()
        # Sensors speak up only between blocks of at most so many passes.
        rows: list[float] = []
        for _ in range(min(EVERY, left)):
            rig.now_us += rig.loop_us
            rows += rig.next_row()
        count, done = min(EVERY, left), 0
        while done < count:
            size = sizes[turn % len(sizes)]
            turn += 1
            end = min(done + size, count)
            while done < end:
                calls += 1
                after = rig.lanes.advance(rows, done, end)
                assert done < after <= end
                done = after
                if clears:
                    rig.listen()
        rig.listen()
        left -= count
    states = [
        (core.state.quat, core.state.vel, core.state.pos, core.state.gyro_bias, core.state.accel_bias)
        for core in rig.lanes.cores
    ]
    outputs = [(core.output.now.quat, core.output.now.vel, core.output.now.pos) for core in rig.lanes.cores]
    variances = [core.state.cov.variances() for core in rig.lanes.cores]
    texts, outcomes = [text for _, text in rig.said], (rig.outcomes, rig.outcome_times_ms, rig.tested)
    return states, outputs, variances, texts, outcomes, rig.lanes.primary, rig.lanes.error_scores


@pytest.mark.parametrize("cores", [1, 2])
def test_something_happens_meanwhile(cores: int) -> None:
    states, _, _, texts, outcomes, _, _ = flown(cores, [1], clears=True)
    assert {"tilt alignment complete", "MAG0 initial yaw alignment complete", "is using external nav data"} <= set(
        texts
    )
    assert len(outcomes[0]) > 100
    assert len(states) == cores


@pytest.mark.parametrize("cores", [1, 2])
@settings(max_examples=8)
@given(sizes=st.lists(st.integers(1, EVERY), min_size=1, max_size=6), clears=st.booleans())
def test_blocks_of_any_sizes_give_the_same(cores: int, sizes: list[int], clears: bool) -> None:
    assert flown(cores, sizes, clears=clears) == flown(cores, [1], clears=True)


def test_block_ends_with_the_pass_in_which_somebody_has_to_act() -> None:
    # GIVEN a filter that is about to have a state
    rig = FilterRig()
    rows: list[float] = []
    for _ in range(500):
        rig.now_us += rig.loop_us
        rows += rig.next_row()
    # WHEN it is given more
    count = rig.lanes.advance(rows, 0, 500)
    # THEN it stops as it says that it has one
    assert count == 401
    rig.listen()
    assert rig.texts == ["initialised"]
    assert rig.lanes.now_us == round(rows[(count - 1) * 11])
    # AND goes on from there
    assert rig.lanes.advance(rows, count, 500) > count


def test_quiet_block_runs_to_its_end() -> None:
    rig = FilterRig()
    rows: list[float] = []
    for _ in range(300):
        rig.now_us += rig.loop_us
        rows += rig.next_row()
    assert rig.lanes.advance(rows, 0, 300) == 300
    assert rig.lanes.advance(rows, 300, 300) == 300
