# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From the records that external navigation left in a log back to messages that leave the same records.

This undoes what AP_VisualOdom does between message and record: scale, orientation, and the errors that it makes of a
covariance. What is lost for good stays lost: a covariance below the least error, the camera's frame before alignment.
"""

import math
from collections.abc import Iterator
from functools import lru_cache, partial
from typing import Final, NamedTuple

import numpy as np

from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.rotations import Rotation, quaternion_from_rotation, rotate_vector
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ap_visualodom.var_info import VisualOdom_Type
from mav_handlers.covariance import ErrorFormula, cube_root_of_squares
from mav_handlers.handlers.vision import MAV_FRAME_BODY_FRD, MAV_FRAME_LOCAL_FRD
from mav_handlers.wire.messages import (
    ODOMETRY,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
)

Three = tuple[float, float, float]
Covariance = tuple[float, ...]

UNKNOWN: Final[Covariance] = (math.nan, *(0.0,) * 20)
_UNKNOWN_SPEED: Final[Covariance] = (math.nan, *(0.0,) * 8)
_NO_RATES: Final[Three] = (math.nan, math.nan, math.nan)
_ESTIMATOR_TYPE_UNKNOWN: Final = 0
_POSITION: Final = (0, 6, 11)
_ATTITUDE: Final = (15, 18, 20)
_NONE: Final[Three] = (0.0, 0.0, 0.0)
_STEPS: Final = 4
_AXES: Final = (Vector3f(1, 0, 0), Vector3f(0, 1, 0), Vector3f(0, 0, 1))
_MAX_U64: Final = (1 << 64) - 1


class PoseRecord(NamedTuple):
    """VISP: times in us and ms, position in m, roll, pitch and yaw in degrees, errors in m and rad."""

    time_us: int
    remote_us: int
    corrected_ms: int
    position: Three
    rpy_deg: Three
    pos_err: float
    ang_err: float
    resets: int
    quality: int


class VelocityRecord(NamedTuple):
    """VISV: times in us and ms, velocity in m/s."""

    time_us: int
    remote_us: int
    corrected_ms: int
    velocity: Three
    resets: int
    quality: int


class DeltaRecord(NamedTuple):
    """VISO: time in us, duration in s, changes of angle in rad and of position in m, confidence."""

    time_us: int
    duration_s: float
    angle: Three
    position: Three
    confidence: float


Record = PoseRecord | VelocityRecord | DeltaRecord


class Rebuilder:
    """Makes messages of records, by the VISO_ parameters of their time.

    ``formula`` is that by which the release that wrote the log makes an error of a covariance. Once the backend has
    ``aligned`` the camera's yaw, VISO_ORIENT is in its attitudes.
    """

    def __init__(self, formula: ErrorFormula) -> None:
        self._formula = formula
        self._params = ParamTable([make_params()])
        self.aligned = False

    def set_param(self, name: str, value: float) -> None:
        """Take a parameter of the log; one that is none of VISO_ does nothing."""
        if self._params.find(name) is not None:
            self._params.set(name, value)

    @property
    def aligns(self) -> bool:
        """Whether the backend turns and shifts what the camera says."""
        return self._params.get_int("VISO_TYPE") in (VisualOdom_Type.IntelT265, VisualOdom_Type.VOXL)

    @property
    def orientation(self) -> int:
        """VISO_ORIENT, as an orientation number."""
        return self._params.get_int("VISO_ORIENT") & 0xFF

    def odometry(self, pose: PoseRecord, velocity: VelocityRecord) -> ODOMETRY:
        """Return the message that leaves both records."""
        quat = self._attitude(pose)
        # As the handler turns the velocity by what the message says.
        vel = quat.inverse().rotate_vector(Vector3f(*velocity.velocity))
        return ODOMETRY(
            pose.remote_us,
            MAV_FRAME_LOCAL_FRD,
            MAV_FRAME_BODY_FRD,
            *self._position(pose),
            tuple(map(float, quat.to_wxyz())),
            *_floats(vel),
            *_NO_RATES,
            self._covariance(pose),
            UNKNOWN,
            pose.resets,
            _ESTIMATOR_TYPE_UNKNOWN,
            pose.quality,
        )

    def vision_position_estimate(self, pose: PoseRecord) -> VISION_POSITION_ESTIMATE:
        """Return the message that leaves a VISP record of quality 0."""
        if self._turns():
            roll, pitch, yaw = map(float, self._attitude(pose).to_euler())
        else:
            roll, pitch, yaw = map(math.radians, pose.rpy_deg)
        return VISION_POSITION_ESTIMATE(
            pose.remote_us, *self._position(pose), roll, pitch, yaw, self._covariance(pose), pose.resets
        )

    def vision_speed_estimate(self, velocity: VelocityRecord) -> VISION_SPEED_ESTIMATE:
        """Return the message that leaves a VISV record of quality 0."""
        return VISION_SPEED_ESTIMATE(velocity.remote_us, *velocity.velocity, _UNKNOWN_SPEED, velocity.resets)

    def vision_position_delta(self, delta: DeltaRecord) -> VISION_POSITION_DELTA:
        """Return the message that leaves a VISO record; its own stamp, which nothing reads, is that of the record."""
        duration_us = delta.duration_s * 1e6
        whole_us = round(duration_us) if 0 <= duration_us <= _MAX_U64 / 2 else 0
        angle, position = self._unrotated(delta.angle), self._unrotated(delta.position)
        return VISION_POSITION_DELTA(delta.time_us, whole_us, angle, position, delta.confidence)

    def _turns(self) -> bool:
        return self.aligns and self.aligned and self.orientation != Rotation.NONE

    def _attitude(self, pose: PoseRecord) -> Quaternion:
        quat = Quaternion.from_euler(*(f32(math.radians(angle)) for angle in pose.rpy_deg))
        return quat * quaternion_from_rotation(self.orientation, InternalErrors()) if self._turns() else quat

    def _position(self, pose: PoseRecord) -> Three:
        scale = self._params.get_float("VISO_SCALE")
        x, y, z = (unscaled(value, scale) for value in pose.position)
        return x, y, z

    def _covariance(self, pose: PoseRecord) -> Covariance:
        least_m, least_rad = (self._params.get_float(f"VISO_{name}_M_NSE") for name in ("POS", "YAW"))
        pos_err = pose.pos_err if pose.pos_err > least_m else 0.0
        ang_err = pose.ang_err if pose.ang_err > least_rad else 0.0
        return covariance_of(pos_err, ang_err, self._formula)

    def _unrotated(self, vector: Three) -> Three:
        """Return the vector that VISO_ORIENT turns into this one: a product with the transposed matrix."""
        if self.orientation == Rotation.NONE:
            return vector
        errors, turned = InternalErrors(), Vector3f(*vector)
        columns = (rotate_vector(axis, self.orientation, errors) for axis in _AXES)
        x, y, z = (float(c.x * turned.x + c.y * turned.y + c.z * turned.z) for c in columns)
        return x, y, z


def _floats(vector: Vector3f) -> Three:
    x, y, z = map(float, vector.to_tuple())
    return x, y, z


def unscaled(value: float, scale: np.float32) -> float:
    """Return a number whose float32 product with ``scale`` is ``value``, or is nearest to it; 0 for a scale of 0."""
    if scale == 0 or not math.isfinite(value) or scale == 1:
        return 0.0 if scale == 0 else value
    with np.errstate(over="ignore"):
        guess = f32(value) / scale
        near = (guess, np.nextafter(guess, f32(-np.inf)), np.nextafter(guess, f32(np.inf)))
        return float(min(near, key=lambda number: abs(float(number * scale) - value)))


def covariance_of(pos_err: float, ang_err: float, formula: ErrorFormula) -> Covariance:
    """Return the 21 numbers of a covariance of which a release's formula makes these errors, in m and rad.

    The variances of the three axes are the same, but for the last bit. Without any error the covariance is unknown: its
    first element is NaN.
    """
    if not pos_err > 0 and not ang_err > 0:
        return UNKNOWN
    elements = [0.0] * 21
    for diagonal, error in ((_POSITION, pos_err), (_ATTITUDE, ang_err)):
        for index, variance in zip(diagonal, _variances(error, formula) if error > 0 else _NONE, strict=True):
            elements[index] = variance
    return tuple(elements)


@lru_cache(maxsize=4096)
def _variances(error: float, formula: ErrorFormula) -> Three:
    """Return the variances of three axes that make an error, found by trial near what theory says."""
    near = partial(_near, error, formula)
    exact = next((variances for variances in near() if _error_of(variances, formula) == error), None)
    return exact or min(near(), key=lambda variances: abs(_error_of(variances, formula) - error))


def _near(error: float, formula: ErrorFormula) -> Iterator[Three]:
    """Yield variances to try; those further off, which few errors take, are made only where they are asked for."""
    guess = f32(math.sqrt(error**3 / 3) if formula is cube_root_of_squares else error**2 / 3)
    for steps in (1, 16):
        for first in _around(guess, _STEPS):
            yield from ((first, first, last) for last in _around(first, steps))


def _around(number: float | np.float32, steps: int) -> list[float]:
    """Return a number of binary32 and its neighbours, the nearest first."""
    down = up = f32(number)
    found = [float(number)]
    for _ in range(steps):
        down, up = np.nextafter(down, f32(0)), np.nextafter(up, f32(np.inf))
        found += [float(down), float(up)]
    return found


def _error_of(variances: Three, formula: ErrorFormula) -> float:
    with np.errstate(over="ignore"):
        return float(formula(*map(f32, variances)))
