# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A pass of the main loop in one compiled call, behind the interface of the plain one. Needs the extra numba.

`ekf_stub.filter.inertial_pass` is the definition and the default.
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from ekf_stub.compiled import compiled_pass_kernel as kernel
from ekf_stub.compiled.compiled_state import CompiledErrorState
from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import EKF_TARGET_DT, Array, InertialDelta, InertialStep
from ekf_stub.filter.inertial_pass import InertialPass, Kernel
from ekf_stub.filter.output_predictor import Output, OutputChanges
from ekf_stub.reports.core_report import StillnessReport, Three

_NOW: Final = slice(kernel.NOW, kernel.NOW + kernel.OUTPUT_SIZE)
_BIAS_RATES: Final = slice(kernel.BIAS_RATES, kernel.BIAS_RATES + 6)


def _row(output: Output) -> tuple[float, ...]:
    quat, vel, pos = output
    return quat.w, quat.x, quat.y, quat.z, vel.x, vel.y, vel.z, pos.x, pos.y, pos.z


def _output(row: Array) -> Output:
    numbers = row.tolist()
    return Output(
        quaternion.quaternion(*numbers[:4]),
        quaternion.quaternion(0.0, *numbers[4:7]),
        quaternion.quaternion(0.0, *numbers[7:]),
    )


class CompiledOutput(OutputChanges):
    """The present state (`OutputState`), and its history back to the horizon, as numbers in arrays.

    ``mem`` is what is kept from pass to pass, ``history`` a ring, shape (length, 10), a row a step: attitude, velocity,
    position.
    """

    def __init__(self, mem: Array, state: ErrorState, length: int) -> None:
        self._mem = mem
        mem[_NOW] = (state.quat.w, state.quat.x, state.quat.y, state.quat.z, *state.vel, *state.pos)
        self.history: Array = np.tile(mem[_NOW], (length, 1))
        mem[kernel.HEAD] = 0
        mem[kernel.ANGLE_CORRECTION : kernel.HEIGHT_RATE] = 0.0
        mem[kernel.ANGLE_ERROR : kernel.HEAD] = 0.0
        mem[kernel.HEIGHT_RATE], mem[kernel.FILTERED_DOWN] = state.vel[2], state.pos[2]
        mem[kernel.FILTERED_ACCEL] = 0.0

    @property
    def now(self) -> Output:
        return _output(self._mem[_NOW])

    @property
    def height_rate(self) -> float:
        return self._mem.item(kernel.HEIGHT_RATE)

    @property
    def angle_error(self) -> float:
        return 2.0 * self._length(kernel.ANGLE_ERROR)

    @property
    def vel_error(self) -> float:
        return self._length(kernel.VEL_ERROR)

    @property
    def pos_error(self) -> float:
        return self._length(kernel.POS_ERROR)

    def _length(self, first: int) -> float:
        return math.hypot(*self._mem[first : first + 3].tolist())

    def restart_height_filter(self, *, vel: float | None = None) -> None:
        self._mem[kernel.FILTERED_DOWN] = self._mem[_NOW][-1]
        if vel is not None:
            self._mem[kernel.HEIGHT_RATE] = vel

    def _change(self, change: Callable[[Output], Output]) -> None:
        for row in (*self.history, self._mem[_NOW]):
            row[:] = _row(change(_output(row)))


class CompiledStillness:
    """What the test for standing still says; see `ekf_stub.filter.stillness.Stillness`.

    Attributes:
        known: bits of the kernel.
        is_still, is_tested: two of them.
    """

    def __init__(self, mem: Array) -> None:
        self._mem = mem
        self.note(0)

    def note(self, known: int) -> None:
        """Note what is known after a pass."""
        self.known = known
        self.is_still = known & kernel.IS_STILL != 0
        self.is_tested = known & kernel.HAS_RATIOS != 0

    @property
    def report(self) -> StillnessReport | None:
        ratios = self._mem[kernel.RATIOS : kernel.DT_EKF_AVG].tolist()
        return StillnessReport(self.is_still, *ratios) if self.is_tested else None


class CompiledPass(InertialPass):
    """Stillness, down-sampling and output of a pass."""

    output: CompiledOutput

    def __init__(self) -> None:
        self._mem: Array = np.zeros(kernel.SIZE)
        self._row = b""
        self.stillness = self._answer = CompiledStillness(self._mem)
        self._restart()

    def _restart(self) -> None:
        mem = self._mem
        mem[kernel.DT_EKF_AVG] = self.dt_ekf_avg = EKF_TARGET_DT
        mem[kernel.DEL_VEL : kernel.STEP] = 0.0
        mem[kernel.TURNED] = 1.0
        mem[kernel.GYRO_BEFORE : kernel.RATIOS] = 0.0
        self._answer.note(kernel.HAS_BEFORE)
        mem[_BIAS_RATES] = 0.0

    def accel(self) -> Three:
        x, y, z = self._mem[kernel.ACCEL_FILTERED : kernel.BIAS_RATES].tolist()
        return x, y, z

    def gyro(self) -> Three:
        x, y, z = self._mem[kernel.GYRO_FILTERED : kernel.ACCEL_FILTERED].tolist()
        return x, y, z

    def sense(self, delta: InertialDelta) -> None:
        kernel.sense(self._mem, delta.del_vel, delta.del_ang, delta.del_vel_dt, delta.del_ang_dt)

    def begin(self, state: ErrorState, length: int) -> None:
        self._restart()
        self.output = CompiledOutput(self._mem, state, length)

    def sample(self, delta: InertialDelta, now_ms: int, *, scale: float | None) -> None:
        if scale is not None:
            self._answer.note(kernel.test(self._mem, self._answer.known, scale))
        kernel.add(self._mem, delta.del_vel, delta.del_ang, delta.del_vel_dt, delta.del_ang_dt, True)

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
        answer = self._answer
        known = kernel.advance(
            self._mem,
            delta.del_vel,
            delta.del_ang,
            delta.del_vel_dt,
            delta.del_ang_dt,
            state.states,
            answer.known,
            scale is not None,
            0.0 if scale is None else scale,
            height_filter_hz,
            may_step,
        )
        return self._note(known, now_ms)

    def advance_all(
        self, rows: Array, times_us: range, state: ErrorState, *, scale: float | None, height_filter_hz: float
    ) -> tuple[int, InertialStep | None]:
        count, known = kernel.advance_all(
            self._mem,
            rows,
            state.states,
            self._answer.known,
            scale is not None,
            0.0 if scale is None else scale,
            height_filter_hz,
            len(times_us),
        )
        return count, self._note(known, times_us[count - 1] // 1000)

    def _note(self, known: int, now_ms: int) -> InertialStep | None:
        """Note what is known after a pass; return the step that it completes, if it does."""
        is_step = known & kernel.IS_STEP
        if known - is_step != self._answer.known:
            self._answer.note(known - is_step)
        if not is_step:
            return None
        self.dt_ekf_avg = self._mem.item(kernel.DT_EKF_AVG)
        step = self._mem[kernel.STEP : kernel.NOW].copy()
        return InertialStep(now_ms, step[:3], step[3:6], step.item(6), step.item(7))

    def follow(
        self, delta: InertialDelta, state: ErrorState, *, delay_s: float, tau_s: float, height_filter_hz: float
    ) -> None:
        quat = state.quat
        kernel.follow(
            self._mem,
            self.output.history,
            delta.del_vel,
            delta.del_ang,
            delta.del_vel_dt,
            delta.del_ang_dt,
            (quat.w, quat.x, quat.y, quat.z),
            state.states,
            delay_s,
            tau_s,
            height_filter_hz,
            state.accel_is_bad,
        )


COMPILED: Final = Kernel(CompiledErrorState, CompiledPass)
"""Both parts of the filter compiled."""
