# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What inertial data go through in every pass of the main loop, 400 times per second.

The test for standing still, the down-sampler and, once the filter has a state, the output predictor. They are together
because that is what a kernel compiles as one: see `ekf_stub.compiled.compiled_pass`.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array, DownSampler, InertialDelta, InertialStep, delta_of
from ekf_stub.filter.output_predictor import OutputPredictor, OutputState
from ekf_stub.filter.stillness import Stillness
from ekf_stub.reports.core_report import StillnessReport, Three

NO_RATES: Final[tuple[Three, Three]] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class StillnessAnswer(Protocol):
    """What the test for standing still says, see `ekf_stub.filter.stillness.Stillness`."""

    @property
    def is_still(self) -> bool:
        """The vehicle stands still on the ground, as far as is known."""

    @property
    def is_tested(self) -> bool:
        """The test runs, so that its answer counts."""

    @property
    def report(self) -> StillnessReport | None:
        """What the last test found; None while it does not run."""


class InertialPass:
    """The three, in their order.

    Attributes:
        stillness: what the test for standing still says.
        output: the present state, from ``begin`` on.
        dt_ekf_avg: the average interval of the filter's steps, s.
    """

    stillness: StillnessAnswer
    output: OutputState
    _delta: InertialDelta

    def __init__(self) -> None:
        self.stillness = self._stillness = Stillness()
        self._sampler = DownSampler()
        self.dt_ekf_avg = self._sampler.dt_ekf_avg
        self._bias_rates = NO_RATES
        self._row = b""

    def accel(self) -> Three:
        """Return the specific force, filtered at 10 Hz, m/s/s, body (FRD)."""
        return self._stillness.accel.value

    def gyro(self) -> Three:
        """Return the body rates, filtered at 10 Hz, rad/s, body (FRD)."""
        return self._stillness.gyro.value

    def sense(self, delta: InertialDelta) -> None:
        """Take the data of a pass while there is no state."""
        self._stillness.sense(delta)

    def begin(self, state: ErrorState, length: int) -> None:
        """Restart with a state, whose horizon lies ``length`` steps back; what is filtered goes on."""
        self.output = self._output = OutputPredictor(state, length)
        self._sampler = DownSampler()
        self.dt_ekf_avg = self._sampler.dt_ekf_avg
        self._stillness.reset()
        self._bias_rates = NO_RATES

    def sample(self, delta: InertialDelta, now_ms: int, *, scale: float | None) -> None:
        """Test for standing still, and add up the data of a pass, which are taken once more in ``advance``."""
        if scale is not None:
            self._stillness.test(*self._bias_rates, self.dt_ekf_avg, scale)
        self._sampler.add(delta, now_ms)
        self.dt_ekf_avg = self._sampler.dt_ekf_avg

    def advance(
        self,
        delta: InertialDelta,
        now_ms: int,
        state: ErrorState,
        *,
        scale: float | None,
        height_filter_hz: float,
        may_step: bool = True,
    ) -> InertialStep | None:
        """Take the sound data of a pass; return the step that it completes, if it does.

        The output moves on by the pass. Where a step is due it does so in ``follow``, with the state after the step.
        ``scale`` is that of the limits of the test for standing still (EK3_OGNM_TEST_SF), None lets the test rest;
        ``height_filter_hz`` is EK3_HRT_FILT.
        """
        self._stillness.sense(delta)
        if scale is None:
            self._stillness.skip()
        else:
            self._stillness.test(*self._bias_rates, self.dt_ekf_avg, scale)
        step = self._sampler.add(delta, now_ms, may_step=may_step)
        if step is None:
            self._output.integrate(delta, state, self.dt_ekf_avg, height_filter_hz=height_filter_hz)
        else:
            self.dt_ekf_avg = self._sampler.dt_ekf_avg
        return step

    def advance_all(
        self, rows: Array, times_us: range, state: ErrorState, *, scale: float | None, height_filter_hz: float
    ) -> tuple[int, InertialStep | None]:
        """Take the sound data of several passes, until a step is complete or the test's answer changes.

        ``rows`` has the data, shape (n, 8), a row a pass (`ekf_stub.filter.inertial.row_of`). Return how many passes
        have taken theirs, and the step that the last of them has completed, if it has.
        """
        stillness = self.stillness
        before = stillness.is_still, stillness.is_tested
        for count, now_us in enumerate(times_us, 1):
            delta = self.delta_of(rows[count - 1])
            step = self.advance(delta, now_us // 1000, state, scale=scale, height_filter_hz=height_filter_hz)
            if step is not None or (stillness.is_still, stillness.is_tested) != before:
                return count, step
        return len(times_us), None

    def delta_of(self, row: Array) -> InertialDelta:
        """Return the inertial data that eight numbers are (`ekf_stub.filter.inertial.row_of`)."""
        data = row.tobytes()
        if data != self._row:  # a vehicle at rest has the same ones, pass by pass
            self._row, self._delta = data, delta_of(row)
        return self._delta

    def follow(
        self, delta: InertialDelta, state: ErrorState, *, delay_s: float, tau_s: float, height_filter_hz: float
    ) -> None:
        """Move the output on by the pass of a step, and steer it towards the filter; take over its biases.

        ``state`` is the filter after the step, whose horizon lies ``delay_s`` back, ``tau_s`` the time constant of
        velocity and position.
        """
        dt = self._sampler.dt_ekf_avg
        self._bias_rates = state.bias_rates(dt)
        self._output.integrate(delta, state, dt, height_filter_hz=height_filter_hz)
        self._output.follow(state, delay_s=delay_s, tau_s=tau_s, dt_ekf_avg=dt)


class Kernel(NamedTuple):
    """What makes the two parts of the filter that compute.

    ``make_state`` makes its state from an attitude and the variances of velocity and position, ``make_pass`` what
    inertial data go through.
    """

    make_state: Callable[[quaternion.quaternion, Array], ErrorState]
    make_pass: Callable[[], InertialPass]


PLAIN: Final = Kernel(ErrorState, InertialPass)
"""Python with numpy: the definition and the default. `ekf_stub.compiled.compiled_pass` has a faster one."""
