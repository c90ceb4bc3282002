# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong with the sensors: bias, noise and scale, drawn from a seed."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from ekf_stub.core.imus import MAX_IMUS
from ekf_stub.inputs.measurements import Array, ImuReading, InertialDelta, row_of
from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.vehicle.sensors.vectors import Three

MAX_ERROR: Final = 1000.0

_NONE: Final = (0.0, 0.0, 0.0)
_DRAWN: Final = 64  # passes for which noise is drawn at once
_OPTION: Final = "--imu-error"
_IMU, _BARO, _COMPASS = range(3)  # each with a random sequence of its own
_IMUS: Final = "imus"
_LIMITS: Final = {_IMUS: (1.0, float(MAX_IMUS))}
_DIFFERING: Final = ("gyro_bias_deg_s", "gyro_noise_deg_s_rthz", "accel_bias_m_s2", "accel_noise_m_s2_rthz")
"""What each of several IMUs has of its own."""


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """The errors of each sensor; none by default.

    Attributes:
        gyro_bias_deg_s, accel_bias_m_s2: added to what is measured, by axis, body (FRD).
        gyro_noise_deg_s_rthz, accel_noise_m_s2_rthz: density of white noise, a unit per root hertz: over an interval
            of t seconds angle or velocity err by this times the root of t.
        gyro_scale_percent, accel_scale_percent: by how much too large all axes read.
        baro_bias_m, baro_noise_m: added to the height; the noise is of each reading.
        compass_noise_mgauss: of each axis of each reading.
        imus: how many IMUs err, each in its own way: noise and, beyond the first one, biases are drawn for each, the
            biases as large as those given.
    """

    gyro_bias_deg_s: Three = _NONE
    gyro_noise_deg_s_rthz: float = 0.0
    gyro_scale_percent: float = 0.0
    accel_bias_m_s2: Three = _NONE
    accel_noise_m_s2_rthz: float = 0.0
    accel_scale_percent: float = 0.0
    baro_bias_m: float = 0.0
    baro_noise_m: float = 0.0
    compass_noise_mgauss: float = 0.0
    imus: float = 1.0


NO_ERRORS: Final = SensorErrors()
ERROR_NAMES: Final = tuple(field.name for field in fields(SensorErrors))


def to_single(values: Array | Sequence[float]) -> Array:
    """Return numbers rounded to single precision, as an array of doubles."""
    return np.asarray(values, dtype=np.float32).astype(np.float64)


def exact_delta(del_vel: Iterable[float], del_ang: Iterable[float], dt: float) -> InertialDelta:
    """Return inertial data of ``dt`` seconds rounded to single precision, as ``Sensors`` wants them."""
    six = to_single((*del_vel, *del_ang))
    dt_single = float(np.float32(dt))
    return InertialDelta(six[:3], six[3:], dt_single, dt_single)


_DT_OF_SIX: Final = (6, 6, 6, 7, 7, 7)
"""Where the seconds are of each of the six changes of velocity and angle in a row."""


class _ImuErrors:
    """What is wrong with one IMU."""

    def __init__(self, errors: SensorErrors, seed: int, imu: int) -> None:
        self._noise = np.random.default_rng([seed, _IMU, imu] if imu else [seed, _IMU])
        signs = self._noise.choice((-1.0, 1.0), (2, 3)) if imu else np.ones((2, 3))
        self._scale = 1.0 + 0.01 * np.repeat((errors.accel_scale_percent, errors.gyro_scale_percent), 3)
        self._bias = np.hstack(
            (signs[1] * np.array(errors.accel_bias_m_s2), signs[0] * np.radians(errors.gyro_bias_deg_s))
        )
        self._density = np.repeat((errors.accel_noise_m_s2_rthz, math.radians(errors.gyro_noise_deg_s_rthz)), 3)
        self._has_noise = bool(errors.accel_noise_m_s2_rthz or errors.gyro_noise_deg_s_rthz)
        self._coming = np.zeros((0, 6))

    def ahead(self, rows: Array) -> Array:
        """Return the inertial data of the next passes, shape (n, 8), with the errors; they stay the next ones."""
        dt = rows[:, _DT_OF_SIX]
        six = rows[:, :6] * self._scale + self._bias * dt
        if self._has_noise:
            six += self._density * np.sqrt(np.maximum(dt, 0.0)) * self._next_noise(len(rows))
        return np.concatenate((to_single(six), rows[:, 6:8]), axis=1)

    def _next_noise(self, passes: int) -> Array:
        missing = passes - len(self._coming)
        if missing > 0:
            self._coming = np.vstack((self._coming, self._noise.standard_normal((max(missing, _DRAWN), 6))))
        return self._coming[:passes]

    def pass_over(self, passes: int) -> None:
        """Leave passes behind."""
        self._coming = self._coming[passes:]

    def spoil(self, delta: InertialDelta) -> InertialDelta:
        """Return the inertial data of the next pass with the errors, and leave it behind."""
        (row,) = self.ahead(row_of(delta)[np.newaxis])
        self.pass_over(1)
        return InertialDelta(row[:3], row[3:6], delta.del_vel_dt, delta.del_ang_dt)


class ErrorModel:
    """Adds errors to the data of ideal sensors; the same seed gives the same errors.

    Every sensor has a random sequence of its own, so that adding or removing one leaves the others as they were.
    """

    def __init__(self, errors: SensorErrors, seed: int = 0) -> None:
        self._errors = errors
        self.is_ideal = replace(errors, imus=1.0) == NO_ERRORS
        self._imus = [_ImuErrors(errors, seed, imu) for imu in range(MAX_IMUS)]
        self._spoiled = self._imus[: int(errors.imus)]
        self._baro, self._compass = (np.random.default_rng([seed, sensor]) for sensor in (_BARO, _COMPASS))
        self._last_baro: tuple[int, float] = (-1, 0.0)
        self._last_mag: tuple[int, Array] = (-1, np.zeros(3))

    def apply(self, sensors: Sensors) -> Sensors:
        """Return the data of the sensors with their errors, exact in single precision.

        A reading of barometer or compass is told by its time: it keeps its errors while it is repeated.
        """
        if self.is_ideal:
            return sensors
        imus = sensors.imus
        if not imus and self._errors.imus > 1:
            imus = (ImuReading(sensors.delta),) * int(self._errors.imus)
        if imus:
            imus = tuple(
                one._replace(delta=errors.spoil(one.delta)) for one, errors in zip(imus, self._imus, strict=False)
            )
        return Sensors(
            imus[0].delta if imus else self._imus[0].spoil(sensors.delta),
            None if sensors.baro is None else self._spoil_baro(*sensors.baro),
            None if sensors.mag is None else self._spoil_mag(*sensors.mag),
            sensors.declination,
            imus,
        )

    def ahead(self, rows: Array) -> Array:
        """Return the data of IMUs in the next passes, shape (n, 8 times as many), from those of ideal ones, (n, 8)."""
        return rows if self.is_ideal else np.concatenate([imu.ahead(rows) for imu in self._spoiled], axis=1)

    def pass_over(self, passes: int) -> None:
        """Skip passes that got the data of ``ahead``."""
        for imu in () if self.is_ideal else self._spoiled:
            imu.pass_over(passes)

    def _spoil_baro(self, time_ms: int, height: float) -> tuple[int, float]:
        if time_ms != self._last_baro[0]:
            noise = self._errors.baro_noise_m * self._baro.standard_normal()
            self._last_baro = time_ms, float(np.float32(height + self._errors.baro_bias_m + noise))
        return self._last_baro

    def _spoil_mag(self, time_us: int, field: Array) -> tuple[int, Array]:
        if time_us != self._last_mag[0]:
            noise = self._errors.compass_noise_mgauss * self._compass.standard_normal(3)
            self._last_mag = time_us, to_single(field + noise)
        return self._last_mag


def parse_errors(assignments: Sequence[str]) -> SensorErrors:
    """Return the errors that ``NAME=VALUE`` texts give; a bias takes one value for all axes, or ``X,Y,Z``.

    Raises InputError for an unknown name, an unusable value, or several IMUs of which all would say the same.
    """
    values: dict[str, Any] = dict(map(_parse_error, assignments))
    errors = SensorErrors(**values)
    if errors.imus > 1 and not any(np.any(values.get(name, 0.0)) for name in _DIFFERING):
        raise InputError(
            f"{_OPTION} imus={errors.imus:g}: IMUs differ by one of {', '.join(_DIFFERING)}; none is given"
        )
    return errors


def _parse_error(text: str) -> tuple[str, float | Three]:
    name, _, value = (part.strip() for part in text.partition("="))
    known = {field.name: field.default for field in fields(SensorErrors)}
    if name not in known:
        raise InputError(f"{_OPTION} {text!r}: no such error; there are {', '.join(known)}")
    try:
        numbers = [float(part) for part in value.split(",")]
    except ValueError:
        numbers = []
    has_axes = known[name] == _NONE
    if len(numbers) not in ((1, 3) if has_axes else (1,)):
        raise InputError(f"{_OPTION} {text!r}: not NAME=NUMBER{' or NAME=X,Y,Z' if has_axes else ''}")
    lowest, highest = _LIMITS.get(name, (0.0 if "_noise_" in name else -MAX_ERROR, MAX_ERROR))
    if not all(lowest <= number <= highest for number in numbers):
        raise InputError(f"{_OPTION} {text!r}: not from {lowest:g} to {highest:g}")
    if name == _IMUS and not numbers[0].is_integer():
        raise InputError(f"{_OPTION} {text!r}: not a whole number")
    if not has_axes:
        return name, numbers[0]
    x, y, z = numbers if len(numbers) == 3 else 3 * numbers
    return name, (x, y, z)
