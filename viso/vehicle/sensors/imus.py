# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The IMUs of the firmware's simulator, each with a calibration of its own.

Source: AP_InertialSensor/AP_InertialSensor_Backend.cpp (_rotate_and_correct_accel).
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from ap_core.param import FromParams, ParamTable
from ekf_stub.core.imus import IMU_COLUMNS, MAX_IMUS
from ekf_stub.inputs.measurements import Array, InertialDelta
from viso.vehicle.sensors.errors import to_single


class Calibration(NamedTuple):
    """What an accelerometer's data are corrected by: this is taken off, in m/s/s, and the rest scaled; each [3]."""

    offset: Array
    scale: Array


_NAMES: Final = ("ACC", "ACC2", "ACC3")
_DEL_VEL: Final = slice(0, 3)
_DEL_ANG: Final = slice(3, 6)
_DEL_VEL_DT: Final = slice(6, 7)


def calibrations_of(params: ParamTable) -> Callable[[], Sequence[Calibration]]:
    """Return what returns the calibrations by INS_ACCOFFS and so on, of as many IMUs as SIM_IMU_COUNT says now."""
    names = _NAMES[: min(max(params.get_int("SIM_IMU_COUNT"), 1), MAX_IMUS)]

    def vector(name: str) -> Array:
        return np.array([float(params.get_float(f"INS_{name}_{axis}")) for axis in "XYZ"])

    return FromParams(params, lambda: [Calibration(vector(f"{name}OFFS"), vector(f"{name}SCAL")) for name in names])


def calibrated(rows: Array, calibrations: Sequence[Calibration]) -> Array:
    """Return the data of IMUs, shape (n, 8 times as many), from what they measure.

    Args:
        rows: the same of each of them, or of one IMU for all, shape (n, 8).
        calibrations: of each.
    """
    measured = rows.reshape(len(rows), -1, IMU_COLUMNS)
    found = np.repeat(measured, len(calibrations), axis=1) if measured.shape[1] == 1 else measured.copy()
    for imu, (offset, scale) in enumerate(calibrations):
        one = found[:, imu]
        one[:, _DEL_VEL] = to_single((one[:, _DEL_VEL] - offset * one[:, _DEL_VEL_DT]) * scale)
    return found.reshape(len(rows), -1)


def deltas_of(row: Array) -> list[InertialDelta]:
    """Return the inertial data of each IMU in a row."""
    return [
        InertialDelta(one[_DEL_VEL], one[_DEL_ANG], float(one[6]), float(one[7]))
        for one in row.reshape(-1, IMU_COLUMNS)
    ]
