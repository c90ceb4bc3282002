# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The compiled pass does what the plain one does, but for rounding: over seconds, with resets, and restarted."""

from collections.abc import Callable, Sequence
from dataclasses import astuple

import numpy as np
import pytest

from ekf_stub.compiled.compiled_pass import CompiledPass
from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import GRAVITY_MSS, Array, InertialDelta, InertialStep
from ekf_stub.filter.inertial_pass import InertialPass
from ekf_stub.filter.output_predictor import OutputState

DT = 0.0025
LENGTH = 7
SCALE = 2.0
WORST = 1e-9
"""By how much rad, m and m/s may differ after some seconds; the rounding of one pass is some 1e-16."""

NOTHING = InertialDelta(np.zeros(3), np.zeros(3), 0.0, 0.0)


class Pair:
    """The same pass twice, of a filter that is led about.

    Attributes:
        state: the filter.
        both: the plain pass, and the compiled one.
        steps: how many steps were completed.
        still: in how many passes the vehicle stood still.
    """

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self.state = ErrorState(quat_of_euler(0.1, -0.2, 2.5), np.full(6, 0.1))
        self.state.learn_biases(1.0, 0.0125)
        self.both = InertialPass(), CompiledPass()
        self.steps = self.still = 0
        for path in self.both:
            path.sense(NOTHING)
            for _ in range(3):
                path.sense(self._delta(0.0))
        self.begin()

    def begin(self) -> None:
        for path in self.both:
            path.begin(self.state, LENGTH)
            path.sample(InertialDelta(np.full(3, 0.01), np.full(3, 0.001), DT, DT), 0, scale=SCALE)

    def _delta(self, sigma: float) -> InertialDelta:
        dts = DT * self._rng.uniform(0.8, 1.2, 2) if sigma else (DT, DT)
        by_gravity = np.array([0.0, 0.0, -GRAVITY_MSS * dts[0]])
        return InertialDelta(
            self._rng.normal(0, sigma, 3) + by_gravity, self._rng.normal(0, sigma, 3), float(dts[0]), float(dts[1])
        )

    def run(self, passes: int, sigma: float, scale: float | None = SCALE) -> None:
        """Go on; a filter is wherever it is, and the output after it."""
        for number in range(passes):
            delta = self._delta(sigma)
            steps = [path.advance(delta, number, self.state, scale=scale, height_filter_hz=2.0) for path in self.both]
            assert same_step(*steps)
            if steps[0] is not None:
                self.steps += 1
                self._lead()
                for path in self.both:
                    path.follow(delta, self.state, delay_s=0.06, tau_s=0.25, height_filter_hz=2.0)
            self.still += self.both[0].stillness.is_still
            self.compare()

    def _lead(self) -> None:
        rng, state = self._rng, self.state
        state.vel, state.pos = state.vel + rng.normal(0, 0.02, 3), state.pos + rng.normal(0, 0.02, 3)
        state.gyro_bias, state.accel_bias = rng.normal(0, 1e-6, 3), rng.normal(0, 1e-5, 3)
        state.quat = (state.quat * quat_of_euler(*rng.normal(0, 0.01, 3))).normalized()

    def change(self, change: Callable[[OutputState], None]) -> None:
        for path in self.both:
            change(path.output)
        self.compare()

    def compare(self) -> None:
        plain, compiled = self.both
        assert are_near(numbers(compiled.output), numbers(plain.output))
        assert abs(compiled.dt_ekf_avg - plain.dt_ekf_avg) <= WORST * plain.dt_ekf_avg
        assert are_near(compiled.accel(), plain.accel())
        ours, other = plain.stillness, compiled.stillness
        assert (other.is_still, other.is_tested) == (ours.is_still, ours.is_tested)
        assert (other.report is None) == (ours.report is None)
        if ours.report is not None and other.report is not None:
            assert all(
                abs(one - another) <= max(1e-6 * abs(one), WORST)
                for one, another in zip(astuple(ours.report), astuple(other.report), strict=True)
            )


def are_near(some: Sequence[float], others: Sequence[float]) -> bool:
    return all(abs(one - other) <= WORST for one, other in zip(some, others, strict=True))


def numbers(output: OutputState) -> list[float]:
    quat = output.now.quat
    errors = output.angle_error, output.vel_error, output.pos_error
    return [quat.w, quat.x, quat.y, quat.z, *output.now.vel, *output.now.pos, output.height_rate, *errors]


def same_step(plain: InertialStep | None, compiled: InertialStep | None) -> bool:
    if plain is None or compiled is None:
        return plain is compiled
    arrays: list[tuple[Array, Array]] = [(plain.del_vel, compiled.del_vel), (plain.del_ang, compiled.del_ang)]
    return (
        all(are_near(first.tolist(), second.tolist()) for first, second in arrays)
        and plain.time_ms == compiled.time_ms
        and compiled[3:] == pytest.approx(plain[3:], rel=WORST)
    )


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_both_go_the_same_way_and_stand_still_at_the_same_time(seed: int) -> None:
    pair = Pair(seed)
    pair.run(1500, sigma=0.0)
    assert pair.still > 500
    pair.run(800, sigma=0.01)
    assert pair.still < 2000
    assert 400 < pair.steps < 500


def test_resets_move_both() -> None:
    pair = Pair(seed=3)
    pair.run(203, sigma=0.001)
    pair.change(lambda output: output.shift(np.array([1.0, -2.0, 3.0])))
    pair.run(21, sigma=0.001)
    pair.change(lambda output: output.overwrite(pos={0: 4.0, 1: np.nan}, vel={2: -0.5}))
    pair.change(lambda output: output.overwrite(vel={0: 0.25}))
    pair.run(33, sigma=0.001)
    pair.change(lambda output: output.rotate(quat_of_euler(0.0, 0.0, 0.7)))
    pair.run(17, sigma=0.001)
    pair.change(lambda output: output.restart_height_filter())
    pair.run(50, sigma=0.001)
    pair.change(lambda output: output.restart_height_filter(vel=-1.5))
    pair.run(200, sigma=0.001)


@pytest.mark.slow
def test_rest_of_the_test_and_another_beginning_forget_the_same() -> None:
    pair = Pair(seed=4)
    pair.run(500, sigma=0.0)
    pair.run(3, sigma=0.0, scale=None)
    assert not pair.both[0].stillness.is_tested
    pair.run(40, sigma=0.0)
    pair.run(40, sigma=0.0, scale=-1.0)
    assert pair.both[0].stillness.is_tested
    pair.begin()
    pair.compare()
    pair.run(400, sigma=0.002)


def test_turn_of_more_than_half_a_circle_goes_the_shorter_way_round() -> None:
    pair = Pair(seed=5)
    whirl = InertialDelta(np.zeros(3), np.array([0.0, 0.9, 0.3]), DT, DT)
    steps = [steps_of(path, whirl, pair.state) for path in pair.both]
    assert len(steps[0]) == len(steps[1]) == 4
    assert all(map(same_step, *steps))
    assert all(np.linalg.norm(step.del_ang) < np.pi for step in steps[0])


def steps_of(path: InertialPass, delta: InertialDelta, state: ErrorState) -> list[InertialStep]:
    said = [path.advance(delta, 0, state, scale=None, height_filter_hz=2.0) for _ in range(20)]
    return [step for step in said if step is not None]


def test_output_of_bad_accelerometers_is_led_the_same_way() -> None:
    pair = Pair(seed=7)
    pair.run(20, sigma=0.001)
    pair.state.accel_is_bad = True
    pair.run(40, sigma=0.001)
    pair.state.accel_is_bad = False
    pair.run(20, sigma=0.001)


def test_step_that_may_not_be_made_waits_in_both() -> None:
    pair = Pair(seed=6)
    delta = InertialDelta(np.array([0.0, 0.0, -GRAVITY_MSS * DT]), np.zeros(3), DT, DT)
    for path in pair.both:
        said = [
            path.advance(delta, number, pair.state, scale=None, height_filter_hz=2.0, may_step=False)
            for number in range(30)
        ]
        assert [number for number, step in enumerate(said) if step is not None] == [8, 18, 28]
