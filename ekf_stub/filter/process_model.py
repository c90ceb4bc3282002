# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How errors grow in a step of the filter (AP_NavEKF3/AP_NavEKF3_core.cpp, CovariancePrediction)."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.attitude import by_rotation
from ekf_stub.filter.covariance import diagonal
from ekf_stub.filter.inertial import Array, limited
from ekf_stub.filter.nominal_state import NominalState
from ekf_stub.filter.states import ACCEL, ATT, GYRO, POS, STATES, VEL

MAX_GROWING_POS_VAR: Final = 1e4
BAD_ACCEL_NOISE: Final = 5.0  # m/s/s

_AXES: Final = np.eye(3)
_DOWN_AXIS: Final = np.diag([0.0, 0.0, 1.0])


def _places(rows: slice, columns: slice) -> list[int]:
    return [row * STATES + column for row in range(STATES)[rows] for column in range(STATES)[columns]]


# Where in the transition that stands which differs from step to step; all at once takes half the time.
_CHANGING: Final = np.array([*_places(slice(0, VEL.stop), ATT), *_places(ATT, GYRO), *_places(VEL, ACCEL)])


@dataclass(frozen=True, slots=True)
class ProcessNoise:
    """Noise densities as EK3_GYRO_P_NSE, ACC_P_NSE, GBIAS_P_NSE, ABIAS_P_NSE, MAGE_P_NSE and MAGB_P_NSE give them."""

    gyro: float
    accel: float
    gyro_bias: float
    accel_bias: float
    earth_field: float = 0.0
    body_field: float = 0.0

    def attitude_variance(self, dt: float) -> float:
        """Return what a step of length ``dt`` adds to the variance of a rotation about any axis, rad^2."""
        return (dt * limited(self.gyro, 0.0, 1.0)) ** 2

    def variances(self, dt: float, *, biases: bool, fields: bool) -> tuple[float, ...]:
        """Return what a step of ``dt`` seconds adds to the variances of velocity and what follows it.

        ``biases`` and ``fields`` say whether those are estimated.
        """
        vel = (dt * limited(self.accel, 0.0, BAD_ACCEL_NOISE)) ** 2
        gyro = accel = earth = body = 0.0
        if biases:
            gyro = (dt * dt * limited(self.gyro_bias, 0.0, 1.0)) ** 2
            accel = (dt * dt * limited(self.accel_bias, 0.0, 1.0)) ** 2
        if fields:
            earth = (dt * limited(self.earth_field, 0.0, 1.0)) ** 2
            body = (dt * limited(self.body_field, 0.0, 1.0)) ** 2
        return 3 * (vel,) + 3 * (0.0,) + 3 * (gyro,) + 3 * (accel,) + 3 * (earth,) + 3 * (body,)


def _by_attitude(
    quat: quaternion.quaternion, del_ang: tuple[float, float, float], del_vel: tuple[float, float, float]
) -> tuple[float, ...]:
    """Return how attitude and velocity after a step depend on the attitude before it, row by row, 28 numbers."""
    w, x, y, z = 2 * quat.w, 2 * quat.x, 2 * quat.y, 2 * quat.z
    ax, ay, az = del_ang
    ax, ay, az = 0.5 * ax, 0.5 * ay, 0.5 * az
    vx, vy, vz = del_vel
    return (
        *(1.0, -ax, -ay, -az),
        *(ax, 1.0, az, -ay),
        *(ay, -az, 1.0, ax),
        *(az, ay, -ax, 1.0),
        *(vz * y - vy * z, vy * y + vz * z, vz * w + vy * x - 2 * vx * y, vz * x - vy * w - 2 * vx * z),
        *(vx * z - vz * x, vx * y - 2 * vy * x - vz * w, vx * x + vz * z, vx * w - 2 * vy * z + vz * y),
        *(vy * x - vx * y, vx * z + vy * w - 2 * vz * x, vy * z - vx * w - 2 * vz * y, vx * x + vy * y),
    )


class ProcessModel:
    """Predicts covariances."""

    def __init__(self) -> None:
        self._transition: Array = np.eye(STATES)
        self._half, self._predicted = np.empty((STATES, STATES)), np.empty((STATES, STATES))
        self._moves_for: tuple[float, bool] | None = None

    def predict(
        self,
        cov: Array,
        state: NominalState,
        del_ang: tuple[float, float, float],
        del_vel: tuple[float, float, float],
        dt: float,
        attitude_variance: float,
        variances: Array,
    ) -> None:
        """Move a covariance on by a step, given in rad and m/s, body; the state is that at its end.

        ``attitude_variance`` is added to the variance of a rotation about any axis, rad^2, ``variances``, shape (18,),
        to those of velocity and what follows it.
        """
        by_turn = by_rotation(state.quat)
        turn, rotation = by_turn.reshape(-1).tolist(), state.rotation.reshape(-1).tolist()
        negative = [-number for number in (*turn, *rotation)]
        transition, predicted = self._transition, self._predicted
        transition.reshape(-1)[_CHANGING] = (*_by_attitude(state.quat, del_ang, del_vel), *negative)
        # FIRMWARE PARITY: where the firmware keeps a position from growing less certain it keeps its covariances too.
        is_lost = cov.item(POS.start, POS.start) + cov.item(POS.start + 1, POS.start + 1) > MAX_GROWING_POS_VAR
        if (dt, is_lost) != self._moves_for:
            self._moves_for = dt, is_lost
            np.multiply(dt, _DOWN_AXIS if is_lost else _AXES, out=transition[POS, VEL])
        np.dot(np.dot(transition, cov, out=self._half), transition.T, out=predicted)
        predicted[ATT, ATT] += attitude_variance * by_turn.dot(by_turn.T)
        np.add(predicted, predicted.T, out=cov)
        cov *= 0.5
        diagonal(cov)[VEL.start :] += variances
