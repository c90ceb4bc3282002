# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The door of the estimator: what is taken, with which time, and what is refused."""

from collections import Counter
from typing import TypeVar

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Rule
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ext_nav_ingest import MIN_YAW_ERR, ExtNavIngest
from ekf_stub.inputs.obs_ring import RingSizes

NAN = float("nan")
INF = float("inf")
WRAP = 1 << 32
T = TypeVar("T")
LEVEL = Quaternion()


class Door:
    """An ingest that is ready, and short ways to it."""

    def __init__(self, *, set_up: bool = True, buffers: bool = True) -> None:
        self.counts: Counter[tuple[str, str]] = Counter()
        params = {"VIS_VERR_MIN": 0.1, "VIS_VERR_MAX": 0.9}
        self.ingest = ExtNavIngest(self.counts, params.__getitem__)
        if set_up:
            self.ingest.set_up(RingSizes(6, 5, 2) if buffers else None)
        self.ingest.initialised = True

    def pose(
        self,
        stamp_ms: int = 5000,
        *,
        pos: Vector3f | None = None,
        quat: Quaternion = LEVEL,
        pos_err: float = 0.2,
        ang_err: float = 0.2,
        delay_ms: int = 10,
        reset_ms: int = 0,
    ) -> Rule:
        errors = f32(pos_err), f32(ang_err)
        return self.ingest.write_pose(pos or Vector3f(), quat, errors, stamp_ms, delay_ms, reset_ms)

    def velocity(self, stamp_ms: int = 5000, *, vel: Vector3f | None = None, err: float = 0.1) -> Rule:
        return self.ingest.write_velocity(vel or Vector3f(), f32(err), stamp_ms, 10)

    def odometry(
        self,
        stamp_ms: int = 5000,
        *,
        del_pos: Vector3f | None = None,
        del_ang: Vector3f | None = None,
        del_time: float = 0.05,
        quality: float = 100.0,
        delay_ms: int = 10,
        pos_offset: Vector3f | None = None,
    ) -> Rule:
        deltas = (del_pos or Vector3f(), del_ang or Vector3f(), f32(del_time))
        return self.ingest.write_odometry(f32(quality), deltas, stamp_ms, delay_ms, pos_offset or Vector3f())


def due(sample: T | None) -> T:
    """Return a sample that must have come due."""
    assert sample is not None
    return sample


@pytest.fixture
def door() -> Door:
    return Door()


WRITERS = ("pose", "velocity", "odometry")


@pytest.mark.parametrize("kind", WRITERS)
def test_sample_is_taken_and_counted(door: Door, kind: str) -> None:
    assert getattr(door, kind)() is rules.TAKEN
    assert door.counts[kind, "taken"] == 1


@pytest.mark.parametrize("kind", WRITERS)
def test_nothing_is_taken_before_there_are_cores(kind: str) -> None:
    door = Door(set_up=False)
    assert getattr(door, kind)() is rules.NOT_STARTED
    assert door.counts == {(kind, "not_started"): 1}


@pytest.mark.parametrize(("kind", "rule"), [
    ("pose", rules.NOT_INITIALISED),
    ("velocity", rules.TAKEN),
    ("odometry", rules.NOT_INITIALISED),
])  # fmt: skip
def test_only_velocity_is_taken_before_there_is_a_state(door: Door, kind: str, rule: Rule) -> None:
    door.ingest.initialised = False
    assert getattr(door, kind)() is rule


@pytest.mark.parametrize("kind", WRITERS)
def test_sample_without_a_buffer_is_discarded(kind: str) -> None:
    door = Door(buffers=False)
    assert getattr(door, kind)() is rules.NO_BUFFER


def test_pose_without_a_buffer_counts_as_fresh_all_the_same() -> None:
    door = Door(buffers=False)
    door.pose(5000)
    assert door.ingest.pose_stamp_ms == 5000


@pytest.mark.parametrize("bad", [
    {"pos": Vector3f(NAN, 0, 0)},
    {"pos": Vector3f(0, 0, NAN)},
    {"pos_err": NAN},
])  # fmt: skip
def test_pose_that_is_not_a_number_is_refused_and_leaves_no_trace(door: Door, bad: dict[str, float]) -> None:
    assert door.pose(**bad) is rules.NOT_A_NUMBER  # type: ignore[arg-type]  # one of many keywords
    assert door.ingest.pose_stamp_ms == 0


@pytest.mark.parametrize("bad", [{"quat": Quaternion(f32(1), f32(NAN), f32(0), f32(0))}, {"ang_err": NAN}])
def test_pose_without_a_yaw_gives_its_position_only(door: Door, bad: dict[str, float]) -> None:
    assert door.pose(**bad) is rules.TAKEN  # type: ignore[arg-type]  # one of many keywords
    door.ingest.horizon_ms = 5000
    assert door.ingest.recall_pose() is not None
    assert door.ingest.recall_yaw() is None
    assert door.counts["yaw", "yaw_nan"] == 1


def test_infinities_pass(door: Door) -> None:
    assert door.pose(pos=Vector3f(INF, -INF, 0), pos_err=INF) is rules.TAKEN
    assert door.pose(6000, quat=Quaternion(f32(INF), f32(INF), f32(0), f32(-INF))) is rules.TAKEN


@pytest.mark.parametrize("bad", [{"vel": Vector3f(0, NAN, 0)}, {"err": NAN}])
def test_velocity_that_is_not_a_number_is_refused(door: Door, bad: dict[str, float]) -> None:
    assert door.velocity(**bad) is rules.NOT_A_NUMBER  # type: ignore[arg-type]  # one of many keywords
    assert not door.ingest.have_velocity


@pytest.mark.parametrize("bad", [
    {"quality": NAN},
    {"del_pos": Vector3f(NAN, 0, 0)},
    {"del_ang": Vector3f(0, NAN, 0)},
    {"del_time": NAN},
    {"pos_offset": Vector3f(0, 0, NAN)},
])  # fmt: skip
def test_odometry_that_is_not_a_number_is_refused(door: Door, bad: dict[str, float]) -> None:
    assert door.odometry(**bad) is rules.NOT_A_NUMBER  # type: ignore[arg-type]  # one of many keywords


@pytest.mark.parametrize("kind", ["pose", "velocity"])
@pytest.mark.parametrize(("later_ms", "rule"), [(0, rules.TOO_SOON), (19, rules.TOO_SOON), (20, rules.TAKEN)])
@pytest.mark.parametrize("first_ms", [5000, WRAP - 10])
def test_samples_keep_20_ms_apart_by_their_stamps(
    door: Door, kind: str, later_ms: int, rule: Rule, first_ms: int
) -> None:
    getattr(door, kind)(first_ms)
    assert getattr(door, kind)((first_ms + later_ms) % WRAP) is rule


@pytest.mark.parametrize("kind", ["pose", "velocity"])
@pytest.mark.parametrize("back_ms", [1, 30, 4000])
def test_stamp_that_steps_backwards_is_taken(door: Door, kind: str, back_ms: int) -> None:
    getattr(door, kind)(5000)
    assert getattr(door, kind)(5000 - back_ms) is rules.TAKEN


def test_refused_sample_does_not_move_the_interval_on(door: Door) -> None:
    door.pose(5000)
    door.pose(5015)
    assert door.pose(5020) is rules.TAKEN


@pytest.mark.parametrize(("delay_ms", "later_ms", "rule"), [
    (0, 49, rules.TOO_SOON),
    (0, 50, rules.TAKEN),
    (10, 39, rules.TOO_SOON),
    (10, 40, rules.TAKEN),
    (50, 0, rules.TAKEN),
])  # fmt: skip
def test_interval_of_odometry_is_shorter_by_its_delay(door: Door, delay_ms: int, later_ms: int, rule: Rule) -> None:
    door.odometry(5000, delay_ms=delay_ms)
    assert door.odometry(5000 + later_ms, delay_ms=delay_ms) is rule


@pytest.mark.parametrize(("del_time", "rule"), [(0.0124, rules.TOO_SHORT), (0.0125, rules.TAKEN), (0, rules.TOO_SHORT)])
def test_odometry_must_span_a_step(door: Door, del_time: float, rule: Rule) -> None:
    assert door.odometry(del_time=del_time) is rule


def test_observation_is_the_stamp_less_delay_and_half_a_step(door: Door) -> None:
    door.pose(5000, delay_ms=30)
    door.velocity(5000)
    door.odometry(5000)
    door.ingest.horizon_ms = 5000
    assert due(door.ingest.recall_pose()).time_ms == 4964
    assert due(door.ingest.recall_velocity()).time_ms == 4984
    assert due(door.ingest.recall_odometry()).time_ms == 4990


def test_late_pose_is_stamped_with_the_horizon_and_late_odometry_is_not(door: Door) -> None:
    door.ingest.horizon_ms = 5000
    door.pose(4000)
    door.odometry(4000)
    assert due(door.ingest.recall_pose()).time_ms == 5000
    assert door.ingest.recall_odometry() is None
    assert door.counts["odometry", "model_too_old"] == 1


def test_reset_is_told_by_the_first_pose_after_it(door: Door) -> None:
    found = []
    for number, reset_ms in enumerate((0, 700, 700, 800)):
        door.pose(5000 + 50 * number, reset_ms=reset_ms)
        door.ingest.horizon_ms = 5000 + 50 * number
        found.append(due(door.ingest.recall_pose()).pos_reset)
    assert found == [False, True, False, True]


@pytest.mark.parametrize("dropped", [{"stamp_ms": 5010}, {"stamp_ms": 5030, "pos": Vector3f(NAN, 0, 0)}])
def test_reset_of_a_refused_pose_is_carried_by_the_next(door: Door, dropped: dict[str, int]) -> None:
    door.pose(5000)
    assert door.pose(reset_ms=700, **dropped) is not rules.TAKEN  # type: ignore[arg-type]  # some of many keywords
    door.pose(5040, reset_ms=700)
    door.ingest.horizon_ms = 5040
    assert due(door.ingest.recall_pose()).pos_reset


def test_yaw_error_is_at_least_5_degrees(door: Door) -> None:
    door.pose(ang_err=0.0, quat=Quaternion.from_euler(f32(0), f32(0), f32(1)))
    door.ingest.horizon_ms = 5000
    yaw = due(door.ingest.recall_yaw())
    assert yaw.yaw_err == MIN_YAW_ERR
    assert float(yaw.yaw) == pytest.approx(1)


@pytest.mark.parametrize(("quality", "err"), [(100, 0.1), (0, 0.9), (50, 0.5), (110, 0.02)])
def test_error_of_odometry_follows_its_quality(door: Door, quality: float, err: float) -> None:
    door.odometry(quality=quality, del_pos=Vector3f(0.1, 0, 0), del_time=0.05)
    door.ingest.horizon_ms = 5000
    sample = due(door.ingest.recall_odometry())
    assert float(sample.vel_err) == pytest.approx(err, abs=1e-6)
    assert float(sample.vel.x) == pytest.approx(2, abs=1e-6)


def test_odometry_may_overflow(door: Door) -> None:
    huge = float(np.finfo(np.float32).max)
    assert door.odometry(del_pos=Vector3f(huge, 0, 0), quality=-huge) is rules.TAKEN


def test_full_buffer_gives_up_its_oldest(door: Door) -> None:
    for number in range(6):
        door.pose(5000 + 20 * number)
    assert door.counts["pose", "model_overwritten"] == 1
    assert door.counts["pose", "taken"] == 6


def test_pose_superseded_in_a_step_is_counted(door: Door) -> None:
    door.pose(5000)
    door.pose(5020)
    door.ingest.horizon_ms = 5020
    assert due(door.ingest.recall_pose()).time_ms == 5004
    assert door.counts["pose", "model_superseded"] == 1


def test_reset_forgets_everything(door: Door) -> None:
    door.pose()
    door.velocity()
    door.ingest.reset()
    door.ingest.horizon_ms = 5000
    assert not door.ingest.initialised
    assert not door.ingest.have_velocity
    assert door.ingest.pose_stamp_ms == 0
    assert door.ingest.recall_pose() is None


def test_codes_are_unique() -> None:
    codes = [rule.code for rule in rules.RULES]
    assert len(set(codes)) == len(codes)
