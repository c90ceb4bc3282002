# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Following a vehicle's filter."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs, RecordedStates
from ekf_stub.reports import AidingMode
from mav_handlers.wire.messages import VISION_POSITION_DELTA
from tests.unit.viso.conftest import Bench, odometry
from viso.vehicle.outcomes import FilterWatch, OutcomeKind, SampleTest, is_final, outcome_kind
from viso.vehicle.vehicle import Vehicle, VehicleConfig

BY_EXT_NAV = {
    "VISO_TYPE": 1,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 6,
    "EK3_SRC1_VELZ": 6,
    "EK3_SRC1_YAW": 6,
    "GPS1_TYPE": 0,
}
LOOP_US = 2500


class Rig:
    """A vehicle that stands still, whose camera sends ODOMETRY, and the watch of its filter."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.watch = FilterWatch(bench.vehicle)
        self.told: list[SampleTest] = []
        self.watch.listeners.append(self.told.append)

    def see(self, duration_s: float, **fields: Any) -> None:
        """Send ODOMETRY at 20 Hz, and look after each pass of the main loop."""
        for _ in range(round(duration_s * 20)):
            self.bench.send(odometry(self.bench.scheduler.now_us, **fields))
            self.wait(0.05)

    def wait(self, duration_s: float) -> None:
        for _ in range(round(duration_s * 1e6 / LOOP_US)):
            self.bench.run_for(LOOP_US * 1e-6)
            self.watch.look()

    def outcomes(self, kind: str) -> list[OutcomeKind]:
        rules = [test.outcome.rule for test in self.told if test.outcome.kind == kind]
        return [outcome_kind(rule) for rule in rules if is_final(rule)]


@pytest.fixture
def rig(make_bench: Callable[..., Bench]) -> Rig:
    return Rig(make_bench(**BY_EXT_NAV))


@pytest.fixture
def steady(rig: Rig) -> Rig:
    """Return one whose camera has sent for 2 s."""
    rig.see(2.0)
    return rig


@pytest.fixture
def settled(rig: Rig) -> Rig:
    """Return one whose camera has sent for 4 s."""
    rig.see(4.0)
    return rig


def test_outcomes_of_a_steady_stream(steady: Rig) -> None:
    assert (
        set(steady.outcomes("pose")[5:])
        == set(steady.outcomes("velocity")[5:])
        == set(steady.outcomes("yaw")[5:])
        == {OutcomeKind.FUSED}
    )


def test_aiding_starts_with_the_text_that_says_so(steady: Rig) -> None:
    (said_us,) = (time_us for time_us, _, text in steady.bench.texts if text == "EKF3 IMU0 is using external nav data")
    assert steady.watch.aiding() == [
        (0, said_us, AidingMode.NONE),
        (said_us, steady.bench.scheduler.now_us, AidingMode.ABSOLUTE),
    ]


@pytest.mark.slow
def test_aiding_ends_with_the_text_that_says_so(steady: Rig) -> None:
    steady.wait(17.0)
    (said_us,) = (time_us for time_us, _, text in steady.bench.texts if text == "EKF3 IMU0 stopped aiding")
    assert steady.watch.aiding()[2] == (said_us, steady.bench.scheduler.now_us, AidingMode.NONE)


def test_without_a_state_there_is_no_aiding(make_bench: Callable[..., Bench]) -> None:
    watch = FilterWatch(make_bench(boot=False).vehicle)
    assert watch.mode() is AidingMode.NONE
    assert watch.aiding() == [(0, 0, AidingMode.NONE)]


@pytest.mark.parametrize(("kind", "fields", "innovation", "unit_tolerance"), [
    ("pose", {"x": 3.0, "y": 4.0}, 5.0, 0.01),
    ("height", {"z": 9.0}, 9.0, 0.01),
    ("velocity", {"vx": 6.0, "vy": -8.0}, 10.0, 0.01),
])  # fmt: skip
def test_how_far_off_a_sample_is(
    settled: Rig, kind: str, fields: dict[str, float], innovation: float, unit_tolerance: float
) -> None:
    rig = settled
    before = rig.watch.innovations[kind].worst
    rig.told.clear()
    rig.see(0.5, **fields)
    rejected = [test for test in rig.told if outcome_kind(test.outcome.rule) is OutcomeKind.REJECTED]
    assert {test.outcome.kind for test in rejected} == {kind}
    assert before < unit_tolerance
    assert [test.outcome.innovation for test in rejected] == pytest.approx([innovation] * len(rejected), rel=0.02)
    worst = rig.watch.innovations[kind]
    assert worst.rejected == len(rejected) > 3
    assert worst.worst == pytest.approx(innovation, rel=0.02)
    assert worst.worst_ratio == max(test.outcome.ratio or 0 for test in rejected) > 1


def test_yaw_is_in_degrees(settled: Rig) -> None:
    settled.told.clear()
    half = 0.0872664626 / 2  # rad, 5 deg in all
    settled.see(0.3, q=(1.0 - half**2 / 2, 0.0, 0.0, half))
    tests = [test for test in settled.told if test.outcome.kind == "yaw" and test.outcome.innovation is not None]
    assert max(test.outcome.innovation or 0.0 for test in tests) == pytest.approx(5.0, abs=0.5)


@pytest.mark.slow
def test_odometry_is_the_length_of_its_velocity(make_bench: Callable[..., Bench]) -> None:
    rig = Rig(make_bench(**{**BY_EXT_NAV, "EK3_SRC1_POSXY": 0, "EK3_SRC1_POSZ": 1, "EK3_SRC1_VELZ": 0}))
    for _ in range(20):
        rig.bench.send(VISION_POSITION_DELTA(0, 100_000, (0.0, 0.0, 0.0), (0.03, 0.04, 0.0), 100.0))
        rig.wait(0.1)
    first = next(test for test in rig.told if test.outcome.kind == "odometry" and test.outcome.innovation is not None)
    assert first.outcome.innovation == pytest.approx(0.5, rel=0.05)


@pytest.mark.slow
def test_what_is_not_tested_has_no_innovation(make_bench: Callable[..., Bench]) -> None:
    rig = Rig(make_bench(**{**BY_EXT_NAV, "EK3_SRC1_YAW": 1}))
    rig.see(1.0)
    assert set(rig.outcomes("yaw")) == {OutcomeKind.UNUSED}
    assert "yaw" not in rig.watch.innovations
    assert {test.outcome.innovation for test in rig.told if test.outcome.kind == "yaw"} == {None}


def test_times_are_those_of_the_vehicle(rig: Rig) -> None:
    rig.see(1.0)
    times_us = [test.time_us for test in rig.told]
    assert times_us == sorted(times_us)
    assert times_us[0] == 6_000_000


def test_vehicle_without_a_filter_cannot_be_followed() -> None:
    at_rest = RecordedStates(np.zeros(1), np.zeros((1, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), math.inf)
    config = VehicleConfig(lambda vehicle: RecordedAhrs(vehicle.clock, vehicle.sources, vehicle.replay_log, at_rest))
    vehicle = Vehicle(config)
    with pytest.raises(ValueError, match="without a filter"):
        FilterWatch(vehicle)


@pytest.mark.slow
def test_nothing_that_is_sent_breaks_it(rig: Rig) -> None:
    wild = {"x": float("inf"), "vx": 3e38, "z": -3e38, "q": (0.0, 0.0, 0.0, 0.0)}
    rig.see(1.0)
    rig.see(1.0, **wild)
    rig.see(1.0)
    assert rig.watch.mode() is AidingMode.ABSOLUTE
    figures = [(one.rms, one.worst, one.worst_ratio) for one in rig.watch.innovations.values()]
    assert np.isfinite(figures).all()
