# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which core is the primary one: on the ground, in flight, and as the vehicle is about to give up."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from ap_core.location import Location
from ekf_stub.core.ekf3_core import CommonOrigin
from ekf_stub.core.frame import Frame
from ekf_stub.core.lanes import Lanes
from ekf_stub.filter.inertial import InertialDelta

FRAME_US = 10_000
REST = InertialDelta(np.zeros(3), np.zeros(3), 0.01, 0.01)
SYDNEY, PARIS = Location(-338_688_000, 1_512_093_000, 500), Location(488_566_000, 23_522_000, 3500)


class Core:
    """A core that is as good as it is told to be."""

    def __init__(self) -> None:
        self.initialised = self.is_healthy = self.is_aligned = self.stepped = True
        self.score, self.yaw_resets, self.height_resets = 0.0, 0, 0
        self.control = SimpleNamespace(tilt_aligned=True, healthy=lambda _now_ms: self.is_healthy)
        self.yaw = SimpleNamespace(aligned=True)
        self.origin: Location | None = None

    def run(self, _frame: Frame) -> None: ...

    def error_score(self) -> float:
        return self.score

    def set_origin(self, origin: Location) -> bool:
        self.origin = origin
        return True

    def reset_height_datum(self) -> None:
        self.height_resets += 1


class Rig:
    """Lanes of such cores, which have been healthy for long enough to be chosen from."""

    def __init__(self, count: int = 3, **params: float) -> None:
        self.params = {"PRIMARY": 0.0, "OPTIONS": 0.0, "ERR_THRESH": 0.2, **params}
        self.texts: list[tuple[int, str]] = []
        self.cores, self.common = [Core() for _ in range(count)], CommonOrigin()
        self.lanes = Lanes(cast(Any, self.cores), self.common, self.params.__getitem__, self)
        self.now_us = 1_000_000
        self.run(10.02, armed=False)

    def send_text(self, severity: int, text: str) -> None:
        self.texts.append((severity, text))

    def run(self, duration_s: float = 0.01, *, armed: bool = True) -> int:
        """Run for a while, and return the primary core."""
        for _ in range(round(duration_s * 1e6 / FRAME_US)):
            self.now_us += FRAME_US
            self.lanes.run([Frame(self.now_us, REST, armed=armed)] * len(self.cores))
        return self.lanes.primary


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_first_core_is_the_primary_one_unless_another_is_chosen() -> None:
    assert Rig().lanes.primary == 0
    assert Rig(PRIMARY=2.0).lanes.primary == 2
    assert Rig(PRIMARY=3.0).lanes.primary == Rig(PRIMARY=-1.0).lanes.primary == 0


@pytest.mark.parametrize("count", [1, 3])
def test_choice_of_the_user_counts_at_once_on_the_ground_and_by_an_option_in_flight(count: int) -> None:
    rig = Rig(count)
    rig.lanes = Lanes(cast(Any, rig.cores), rig.common, rig.params.__getitem__, rig, 3)
    rig.params["PRIMARY"] = 1.0
    assert rig.run(armed=False) == 1
    rig.params["PRIMARY"] = 2.0
    assert rig.run() == 1
    assert rig.texts == []
    rig.params["OPTIONS"] = 2.0
    assert rig.run() == 2
    assert rig.texts == [(2, "EKF3 lane switch 2")]
    assert rig.lanes.primary_filter is cast(Any, rig.cores[-1])


def test_unhealthy_core_hands_over_to_the_better_one(rig: Rig) -> None:
    rig.cores[0].score, rig.cores[1].score, rig.cores[2].score = 0.3, 0.09, 0.05
    assert rig.run() == 0
    rig.cores[0].is_healthy = False
    assert rig.run() == 2
    assert rig.texts == [(2, "EKF3 lane switch 2")]


def test_bad_score_is_enough_to_hand_over(rig: Rig) -> None:
    rig.cores[0].score = 1.1
    assert rig.run() == 1


def test_much_better_core_takes_over_in_the_end(rig: Rig) -> None:
    rig.cores[0].score, rig.cores[1].score, rig.cores[2].score = 0.5, 0.26, 0.4
    assert rig.run(0.02) == 0
    assert rig.lanes.relative_errors == pytest.approx([0.0, -0.48, 0.0])
    assert rig.run() == 1
    assert rig.lanes.relative_errors == [0.0, 0.0, 0.0]


def test_little_that_a_core_is_better_counts_for_nothing(rig: Rig) -> None:
    rig.cores[0].score, rig.cores[1].score, rig.cores[2].score = 0.25, 0.1, 0.3
    assert rig.run(1.0) == 0
    assert rig.lanes.error_scores == [0.25, 0.1, 0.3]
    assert rig.lanes.relative_errors == [0.0, 0.0, 1.0]


def test_core_that_has_been_the_primary_one_is_not_chosen_again_for_ten_seconds() -> None:
    rig = Rig(count=2)
    rig.cores[0].score = 1.1
    assert rig.run() == 1
    rig.cores[0].score, rig.cores[1].score = 0.0, 1.1
    assert rig.run() == 0
    rig.cores[0].score, rig.cores[1].score = 1.1, 0.0
    assert rig.run(9.9) == 0
    assert rig.run(0.2) == 1


def test_core_with_yaw_is_better_than_one_without(rig: Rig) -> None:
    rig.cores[0].yaw.aligned = rig.cores[1].yaw.aligned = False
    assert rig.run() == 2


def test_nothing_is_chosen_before_the_primary_core_has_been_healthy_for_ten_seconds() -> None:
    late = Rig(count=2)
    late.lanes = Lanes(cast(Any, late.cores), late.common, late.params.__getitem__, late)
    late.cores[0].score = 1.1
    assert late.run(10.0) == 0
    assert late.run(0.02) == 1


def test_core_of_the_user_comes_back_on_the_ground_without_a_word(rig: Rig) -> None:
    rig.cores[0].score = 1.1
    rig.run()
    rig.texts.clear()
    rig.cores[0].is_healthy = False
    assert rig.run(armed=False) == 1
    rig.cores[0].is_healthy = True
    assert rig.run(armed=False) == 0
    assert rig.texts == []


def test_manual_choice_alone_counts(rig: Rig) -> None:
    rig.params["OPTIONS"] = 2.0
    rig.cores[0].is_healthy = False
    assert rig.run() == 0
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 0
    rig.params["PRIMARY"] = 1.0
    assert rig.run() == 1
    assert rig.texts == [(2, "EKF3 lane switch 1")]


def test_last_resort_is_the_core_of_the_lowest_score(rig: Rig) -> None:
    rig.cores[0].score, rig.cores[1].score, rig.cores[2].score = 0.8, 0.7, 0.6
    rig.cores[2].is_aligned = False
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 1
    rig.cores[2].is_aligned = True
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 1  # not twice in five seconds
    rig.run(5.0, armed=True)
    rig.lanes.check_lane_switch()
    assert rig.lanes.primary == 2


def test_no_core_above_the_limit_is_a_last_resort() -> None:
    rig = Rig(count=2)
    rig.cores[0].score, rig.cores[1].score = 1.0, 0.95
    rig.lanes.check_lane_switch()
    assert (rig.lanes.primary, rig.texts) == (0, [])


def test_yaw_jumps_as_the_primary_core_aligns_it_or_changes(rig: Rig) -> None:
    assert rig.lanes.yaw_reset_ms == 0
    rig.cores[1].yaw_resets = 1
    rig.run()
    assert rig.lanes.yaw_reset_ms == 0
    rig.cores[0].yaw_resets = 1
    rig.run()
    aligned_ms = rig.now_us // 1000
    assert rig.lanes.yaw_reset_ms == aligned_ms
    rig.cores[0].is_healthy = False
    rig.cores[0].score = 0.3
    rig.run()
    assert rig.lanes.yaw_reset_ms == rig.now_us // 1000 > aligned_ms


def test_origin_goes_to_all_cores_once(rig: Rig) -> None:
    assert rig.lanes.set_origin(PARIS)
    assert [core.origin for core in rig.cores] == [PARIS] * 3
    rig.common.place = PARIS
    assert not rig.lanes.set_origin(SYDNEY)
    assert rig.texts == [(4, "EKF3: origin already set")]
    rig.lanes.reset_height_datum()
    assert [core.height_resets for core in rig.cores] == [1, 1, 1]
