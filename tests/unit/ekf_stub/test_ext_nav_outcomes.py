# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whoever listens at the estimator's door hears what becomes of each sample, once."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ext_nav_ingest import ExtNavIngest, FilterOutcome
from ekf_stub.inputs.obs_ring import RingSizes
from tests.unit.ekf_stub.bench_rig import BenchRig
from viso.sensors.options import ImuOptions

NAN = float("nan")
DELAY_MS = 10
EARLIER_MS = DELAY_MS + 6  # a sample's stamp is taken back by the delay and half a step


class Listener:
    """A door with room for three samples of each kind, and what is heard at it: kind, code, ratio, time in ms."""

    def __init__(self, *, buffers: bool = True, set_up: bool = True) -> None:
        self.counts: Counter[tuple[str, str]] = Counter()
        self.ingest = ExtNavIngest(self.counts, lambda _name: 0.1)
        if set_up:
            self.ingest.set_up(RingSizes(3, 3, 3) if buffers else None)
        self.ingest.initialised = True
        self.outcomes: list[FilterOutcome] = []
        self.ingest.on_outcome = self.outcomes.append

    def pose(self, stamp_ms: int, x: float = 0.0, quat: Quaternion | None = None) -> None:
        self.ingest.write_pose(Vector3f(x, 0, 0), quat or Quaternion(), (f32(0.2), f32(0.2)), stamp_ms, DELAY_MS, 0)

    def velocity(self, stamp_ms: int) -> None:
        self.ingest.write_velocity(Vector3f(), f32(0.1), stamp_ms, DELAY_MS)

    def odometry(self, stamp_ms: int, del_time: float = 0.05) -> None:
        deltas = Vector3f(), Vector3f(), f32(del_time)
        self.ingest.write_odometry(f32(100), deltas, stamp_ms, DELAY_MS, Vector3f())

    def heard(self) -> list[tuple[str, str, int]]:
        """Return kind, code and time in ms of what was heard since the last call."""
        heard = [(outcome.kind, outcome.rule.code, outcome.time_ms) for outcome in self.outcomes]
        self.outcomes.clear()
        return heard


@pytest.fixture
def listener() -> Listener:
    return Listener()


def test_pose_is_heard_of_as_position_and_yaw(listener: Listener) -> None:
    listener.pose(5000)
    observed_ms = 5000 - EARLIER_MS
    assert listener.heard() == [("pose", "taken", observed_ms), ("yaw", "taken", observed_ms)]


def test_time_is_that_with_which_a_sample_waits(listener: Listener) -> None:
    listener.ingest.horizon_ms = 5100
    listener.velocity(5000)
    assert listener.heard() == [("velocity", "taken", 5100)]


@pytest.mark.parametrize("kind", ["pose", "velocity", "odometry"])
def test_sample_too_soon_is_heard_of(listener: Listener, kind: str) -> None:
    for stamp_ms in (5000, 5010):
        getattr(listener, kind)(stamp_ms)
    (told,) = (outcome for outcome in listener.outcomes if outcome.rule is rules.TOO_SOON)
    assert (told.kind, told.ratio) == (kind, None)
    assert told.time_ms == 5010 - (DELAY_MS if kind == "odometry" else EARLIER_MS)


def test_what_is_no_number_is_heard_of(listener: Listener) -> None:
    listener.pose(5000, x=NAN)
    listener.pose(5100, quat=Quaternion(NAN, 0, 0, 0))
    assert listener.heard() == [
        ("pose", "nan", 5000 - EARLIER_MS),
        ("pose", "taken", 5100 - EARLIER_MS),
        ("yaw", "yaw_nan", 5100 - EARLIER_MS),
    ]


def test_odometry_that_is_too_short_is_heard_of(listener: Listener) -> None:
    listener.odometry(5000, del_time=0.001)
    assert listener.heard() == [("odometry", "too_short", 5000 - DELAY_MS)]


@pytest.mark.parametrize(("buffers", "set_up", "code"), [(False, True, "no_buffer"), (True, False, "not_started")])
def test_closed_door_is_heard_of(buffers: bool, set_up: bool, code: str) -> None:
    listener = Listener(buffers=buffers, set_up=set_up)
    listener.velocity(5000)
    assert listener.heard() == [("velocity", code, 5000 - EARLIER_MS)]


def test_sample_that_gives_way_is_the_oldest(listener: Listener) -> None:
    for stamp_ms in (5000, 5100, 5200, 5300):
        listener.velocity(stamp_ms)
    assert ("velocity", "model_overwritten", 5000 - EARLIER_MS) in listener.heard()


def test_samples_that_are_passed_over_are_told_from_the_one_that_is_not(listener: Listener) -> None:
    for stamp_ms in (5000, 5100, 5140):
        listener.velocity(stamp_ms)
    listener.heard()
    listener.ingest.horizon_ms = 5150
    sample = listener.ingest.recall_velocity()
    assert sample is not None
    assert sample.time_ms == 5140 - EARLIER_MS
    assert listener.heard() == [
        ("velocity", "model_too_old", 5000 - EARLIER_MS),
        ("velocity", "model_superseded", 5100 - EARLIER_MS),
    ]


def test_nothing_that_waits_is_told_of_after_a_reset(listener: Listener) -> None:
    listener.velocity(5000)
    listener.ingest.reset()
    listener.heard()
    listener.velocity(6000)
    listener.ingest.horizon_ms = 6050
    listener.ingest.recall_velocity()
    listener.ingest.horizon_ms = 6500
    listener.ingest.recall_velocity()
    assert listener.heard() == [("velocity", "taken", 6000 - EARLIER_MS)]


@given(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 120)), max_size=40))
def test_every_sample_that_is_taken_leaves_once(steps: list[tuple[int, int]]) -> None:
    listener, now_ms = Listener(), 1000
    left: Counter[int] = Counter()
    for stamp_offset_ms, dt_ms in steps:
        now_ms += dt_ms
        listener.ingest.horizon_ms = now_ms - 200
        sample = listener.ingest.recall_velocity()
        if sample is not None:
            left[sample.time_ms] += 1
        listener.velocity(now_ms - stamp_offset_ms)
    listener.ingest.horizon_ms = now_ms + 10_000
    assert listener.ingest.recall_velocity() is None
    taken = Counter(outcome.time_ms for outcome in listener.outcomes if outcome.rule is rules.TAKEN)
    lost_rules = (rules.OVERWRITTEN, rules.SUPERSEDED, rules.TOO_OLD)
    left.update(outcome.time_ms for outcome in listener.outcomes if outcome.rule in lost_rules)
    assert left == taken
    assert sum(listener.counts.values()) == len(listener.outcomes)


# Through the AHRS


def pose_to(ahrs: Ekf3Ahrs, stamp_ms: int) -> None:
    ahrs.writeExtNavData(Vector3f(), Quaternion(), f32(0.2), f32(0.2), stamp_ms, DELAY_MS, 0)


def test_ahrs_tells_from_before_the_filter_runs_until_it_does() -> None:
    bench = BenchRig("66666", has_compass=True, options=ImuOptions(), params={})
    outcomes: list[FilterOutcome] = []
    bench.ahrs.on_filter_outcome = outcomes.append
    for time_s in (3.0, 4.0, 6.0, 6.5):
        bench.run_to(time_s)
        pose_to(bench.ahrs, round(1000 * time_s))
    bench.run_to(7.0)
    poses = [outcome.rule.code for outcome in outcomes if outcome.kind == "pose"]
    assert poses[:3] == ["not_started", "not_initialised", "taken"]
    assert poses.count("taken") == 2
    assert poses[-1] == "model_fused"


def test_ahrs_without_a_listener_counts_all_the_same() -> None:
    bench = BenchRig("66666", has_compass=True, options=ImuOptions(), params={})
    pose_to(bench.ahrs, 0)
    assert bench.ahrs.ext_nav_counts == {("pose", "not_started"): 1}


def test_ahrs_without_cores_goes_on_refusing() -> None:
    bench = BenchRig("66666", has_compass=True, options=ImuOptions(), params={"EK3_IMU_MASK": 0})
    outcomes: list[FilterOutcome] = []
    bench.ahrs.on_filter_outcome = outcomes.append
    bench.run_to(6.0)
    pose_to(bench.ahrs, 6000)
    assert [outcome.rule for outcome in outcomes] == [rules.NOT_STARTED]
