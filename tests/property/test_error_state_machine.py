# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever the filter is given, in whatever order: it stays finite, within its limits, and its covariance one.

A state machine draws inertial data, measurements, resets and parameters, any float among them. What must hold all the
while:

- the covariance is symmetric to the bit and finite, no variance is negative, and no mix of errors has a negative
  variance but for rounding;
- the attitude is of length one, all other states are finite and within the firmware's limits;
- the present state that is told is finite;
- no arithmetic warns.

The slow test runs 250,000 steps, of which a third have measurements: flights, bumps and standstills, aided or not,
with measurements from exact to useless and innovations from none to absurd.
"""

import math

import numpy as np
import pytest
import quaternion
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from ekf_stub.compiled.compiled_pass import COMPILED
from ekf_stub.filter.attitude import quat_of_euler
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import GRAVITY_MSS, Array, InertialDelta, InertialGuard, InertialStep
from ekf_stub.filter.inertial_pass import PLAIN, Kernel
from ekf_stub.filter.output_predictor import OutputState
from ekf_stub.filter.process_model import ProcessNoise
from ekf_stub.filter.states import ACCEL, ATT, BODY, EARTH, GYRO, POS, STATES, VEL

DT = 0.0125
NOISE = ProcessNoise(gyro=0.015, accel=0.35, gyro_bias=0.001, accel_bias=0.02, earth_field=0.001, body_field=0.0001)
VARIANCES = np.array([0.09, 0.09, 0.25, 0.25, 0.25, 4.0])
PARTS = (ATT, VEL, POS, GYRO, ACCEL, EARTH, BODY)
NAMES = ("vel", "pos", "gyro_bias", "accel_bias", "earth_field", "body_field")
ROUNDING = 1e-9  # of a mix of errors in units of their sigmas
# A variance below this and the products that it is compared with have lost digits, as nothing smaller has all of them.
NO_VARIANCE = np.finfo(float).tiny / np.finfo(float).eps

ANY = st.one_of(st.floats(-1, 1), st.floats(-100, 100), st.floats())
ANY_VECTOR = st.tuples(ANY, ANY, ANY).map(np.array)
SHORT = st.one_of(st.floats(0, 0.02), st.floats(0, 1), st.floats())
ROW = st.lists(st.floats(-10, 10), min_size=STATES, max_size=STATES).map(np.array)
INDEX = st.integers(0, STATES - 1)
AXIS = st.integers(0, 2)


def check_filter(state: ErrorState) -> None:
    cov = state.cov
    assert np.array_equal(cov, cov.T)
    assert np.isfinite(cov).all()
    variances = cov.diagonal()
    assert (variances >= 0).all()
    sigma = np.sqrt(np.where(variances > NO_VARIANCE, variances, 1.0))
    assert np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0] > -ROUNDING
    assert abs(state.quat) == pytest.approx(1.0)
    assert (np.abs(state.vel) <= 500).all()
    assert (np.abs(state.pos) <= 1e6).all()
    assert np.isfinite(state.states).all()
    assert np.isfinite(state.accel_filtered).all()
    assert 0 <= state.predicted_tilt_variance <= 0.3


def check_output(output: OutputState) -> None:
    now = output.now
    assert abs(now.quat) == pytest.approx(1.0)
    assert np.isfinite([*now.vel, *now.pos, output.height_rate]).all()
    assert np.isfinite([output.angle_error, output.vel_error, output.pos_error]).all()


class FilterMachine(RuleBasedStateMachine):
    """The filter and what follows it."""

    kernel: Kernel = PLAIN

    @initialize(
        euler=st.tuples(st.floats(-3, 3), st.floats(-1.57, 1.57), st.floats(-3, 3)),
        variances=st.lists(ANY, min_size=6, max_size=6).map(np.array),
        length=st.integers(1, 20),
        forgets=st.booleans(),
    )
    def begin(self, euler: tuple[float, float, float], variances: Array, length: int, forgets: bool) -> None:
        self.state = self.kernel.make_state(quat_of_euler(*euler), variances)
        self.state.forgets_frozen = forgets
        self.path = self.kernel.make_pass()
        self.path.begin(self.state, length)
        self.output = self.path.output
        self.guard = InertialGuard()

    @rule(
        vel=ANY_VECTOR,
        ang=ANY_VECTOR,
        dts=st.tuples(SHORT, SHORT),
        passes=st.integers(1, 12),
        scale=st.none() | ANY,
        hertz=ANY,
        modes=st.tuples(st.booleans(), st.booleans()),
    )
    def go_on(
        self,
        vel: Array,
        ang: Array,
        dts: tuple[float, float],
        passes: int,
        scale: float | None,
        hertz: float,
        modes: tuple[bool, bool],
    ) -> None:
        delta = self.guard.sound(InertialDelta(vel, ang, *dts))
        aided, on_ground = modes
        for _ in range(passes):
            step = self.path.advance(delta, 0, self.state, scale=scale, height_filter_hz=hertz)
            if step is not None:
                self.state.predict(step, NOISE, self.path.dt_ekf_avg, aided=aided, on_ground=on_ground)
                self.path.follow(delta, self.state, delay_s=0.06, tau_s=0.25, height_filter_hz=hertz)

    @rule(
        vel=ANY_VECTOR,
        ang=ANY_VECTOR,
        dts=st.tuples(SHORT, SHORT),
        noise=st.lists(ANY, min_size=6, max_size=6),
        modes=st.tuples(st.booleans(), st.booleans()),
    )
    def predict(
        self, vel: Array, ang: Array, dts: tuple[float, float], noise: list[float], modes: tuple[bool, bool]
    ) -> None:
        aided, on_ground = modes
        step = InertialStep(0, vel, ang, *dts)
        self.state.predict(step, ProcessNoise(*noise), self.path.dt_ekf_avg, aided=aided, on_ground=on_ground)

    @rule(index=INDEX, innovation=ANY, variance=ANY)
    def update_state(self, index: int, innovation: float, variance: float) -> None:
        refused = self.state.refused
        was_fused = self.state.update_state(index, innovation, variance)
        sound = math.isfinite(innovation) and 0 <= variance < math.inf
        assert not was_fused or sound
        assert (self.state.refused == refused) == (sound and abs(innovation) <= 1e7)

    @rule(wanted=st.lists(st.tuples(INDEX, ANY, ANY), min_size=1, max_size=6))
    def update_states(self, wanted: list[tuple[int, float, float]]) -> None:
        assert len(self.state.update_states(wanted)) == len(wanted)

    @rule(row=ROW, innovation=ANY, variance=ANY)
    def update(self, row: Array, innovation: float, variance: float) -> None:
        self.state.update(row, innovation, variance)

    @rule(row=ROW, innovation=ANY, variance=ANY)
    def fuse(self, row: Array, innovation: float, variance: float) -> None:
        self.state.fuse(row, innovation, variance)

    @rule(innovation=ANY, variance=ANY, by_321=st.booleans())
    def update_yaw(self, innovation: float, variance: float, by_321: bool) -> None:
        self.state.update(self.state.yaw_row(by_321=by_321), innovation, variance)

    @rule(part=st.sampled_from(PARTS[1:]), variance=ANY)
    def clear(self, part: slice, variance: float) -> None:
        self.state.clear(part, variance)

    @rule(yaw=ANY, variance=ANY, by_321=st.booleans())
    def set_yaw(self, yaw: float, variance: float, by_321: bool) -> None:
        self.output.rotate(self.state.set_yaw(yaw, variance, by_321=by_321))

    @rule(limit=ANY)
    def learn_biases(self, limit: float) -> None:
        self.state.learn_biases(limit, self.path.dt_ekf_avg)

    @rule(learns=st.booleans())
    def learn_field(self, learns: bool) -> None:
        self.state.learns_field = learns

    @rule(name=st.sampled_from(NAMES), value=ANY_VECTOR)
    def put(self, name: str, value: Array) -> None:
        before = getattr(self.state, name).copy()
        setattr(self.state, name, value)
        if not np.isfinite(value).all():
            assert np.array_equal(getattr(self.state, name), before)

    @rule(axis=AXIS, value=ANY)
    def overwrite(self, axis: int, value: float) -> None:
        self.output.overwrite(pos={axis: value})
        self.output.overwrite(vel={axis: value})
        self.output.restart_height_filter(vel=float(self.state.vel[2]))

    @rule(pos=ANY_VECTOR)
    def shift(self, pos: Array) -> None:
        self.output.shift(pos)

    @invariant()
    def is_sound(self) -> None:
        if hasattr(self, "state"):
            check_filter(self.state)
            check_output(self.output)


class CompiledMachine(FilterMachine):
    """The same with the compiled filter."""

    kernel = COMPILED


@pytest.mark.slow
@pytest.mark.parametrize("machine", [FilterMachine, CompiledMachine])
def test_filter_stands_whatever_it_is_given(machine: type[FilterMachine]) -> None:
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=8, stateful_step_count=30, deadline=None, derandomize=True),
    )


@pytest.mark.slow
@pytest.mark.parametrize("machine", [FilterMachine, CompiledMachine])
def test_filter_stands_whatever_it_is_given_for_longer(machine: type[FilterMachine]) -> None:
    run_state_machine_as_test(machine, settings=settings(max_examples=50, stateful_step_count=60, deadline=None))


# Long runs


class Wanderer:
    """A filter that is led about at random; the seed decides on all of it.

    Attributes:
        state: the filter.
        fused: how many measurements were.
    """

    PHASE = 400

    def __init__(self, seed: int, kernel: Kernel = PLAIN) -> None:
        self._rng = np.random.default_rng(seed)
        self.state = kernel.make_state(quat_of_euler(0.1, 0.2, 0.3), VARIANCES)
        self.state.forgets_frozen = False
        self.fused = 0

    def run(self, phases: int, *, check_each: int) -> None:
        """Go through phases of five seconds; check the filter after each so many steps."""
        for _ in range(phases):
            self._begin_phase()
            for number, draw in enumerate(self._rng.random((self.PHASE, 12)).tolist(), 1):
                self._step(draw)
                if number % check_each == 0:
                    check_filter(self.state)

    def _begin_phase(self) -> None:
        rng, state = self._rng, self.state
        self._aided, self._on_ground = rng.random() < 0.6, rng.random() < 0.4
        self._rates = (rng.random(8) * rng.choice([0.0, 0.1, 1.0])).tolist()
        self._innovation = 10.0 ** rng.uniform(-2, 8 if rng.random() < 0.2 else 1)
        self._sigma_exponents = (-5.0, 3.0) if rng.random() < 0.3 else (-1.5, 0.5)
        self._del_ang = rng.normal(size=3) * 10.0 ** rng.uniform(-5, -1)
        gravity = -GRAVITY_MSS * DT * state.rotation[2]
        self._del_vel = gravity + rng.normal(size=3) * 10.0 ** rng.uniform(-4, 0)
        if rng.random() < 0.2:
            state.learn_biases(rng.uniform(0.5, 2.5), DT)
        if rng.random() < 0.3:
            self._toggle_field()
        if rng.random() < 0.3:
            state.set_yaw(rng.uniform(-3, 3), self._variance(rng.random()))
        if rng.random() < 0.3:
            state.clear(PARTS[rng.integers(1, 3)], self._variance(rng.random()) * rng.integers(2))
        if rng.random() < 0.1:
            state.pos, state.vel = rng.normal(size=3) * 1e3, rng.normal(size=3) * 10

    def _toggle_field(self) -> None:
        state = self.state
        state.learns_field = not state.learns_field
        state.earth_field = self._rng.uniform(-0.5, 0.5, 3)
        state.clear(slice(EARTH.start, BODY.stop), 0.0025)

    def _variance(self, draw: float) -> float:
        low, high = self._sigma_exponents
        variance: float = 10.0 ** (2 * (low + draw * (high - low)))
        return variance

    def _step(self, draw: list[float]) -> None:
        state, scale = self.state, 0.5 + draw[0]
        step = InertialStep(0, scale * self._del_vel, scale * self._del_ang, DT, DT)
        state.predict(step, NOISE, DT, aided=self._aided, on_ground=self._on_ground)
        if draw[1] < 0.33:
            innovation, variance = self._innovation * (draw[2] - 0.5), self._variance(draw[3])
            for axis, rate in enumerate(self._rates[:6]):
                if draw[4 + axis] < rate:
                    self.fused += state.update_state(VEL.start + axis, innovation, variance)
            if draw[10] < self._rates[6]:
                row = state.yaw_row(by_321=state.prefers_321())
                self.fused += state.update(row, max(-0.5, min(innovation, 0.5)), variance)
            if state.learns_field and draw[11] < self._rates[7]:
                row = self._field_row(int(3 * draw[3]))
                self.fused += state.fuse(row, draw[2] - 0.5, float(row @ state.cov @ row) + 0.0025)

    def _field_row(self, axis: int) -> Array:
        row = np.zeros(STATES)
        row[ATT] = 0.8 * self.state.rotation[:, axis].sum()
        row[EARTH] = self.state.rotation[:, axis]
        row[BODY.start + axis] = 1.0
        return row


@pytest.mark.slow
def test_covariance_is_one_throughout_many_steps() -> None:
    wanderer = Wanderer(seed=1)
    wanderer.run(100_000 // Wanderer.PHASE, check_each=Wanderer.PHASE)
    assert wanderer.fused > 25_000


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "kernel"), [(2, PLAIN), (2, COMPILED), pytest.param(3, PLAIN, marks=pytest.mark.slow)]
)
def test_covariance_is_one_after_each_of_some_thousand_steps(seed: int, kernel: Kernel) -> None:
    Wanderer(seed, kernel).run(8, check_each=1)


def test_same_input_gives_the_same_bytes() -> None:
    def run() -> tuple[bytes, bytes, bytes]:
        wanderer = Wanderer(seed=4)
        wanderer.run(4, check_each=Wanderer.PHASE)
        state = wanderer.state
        return state.cov.tobytes(), state.states.tobytes(), quaternion.as_float_array(state.quat).tobytes()

    assert run() == run()
