# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of external navigation as columns of samples: what the handlers of ``handlers.vision`` make of them.

Bit for bit the same, for the batch port (``ap_visualodom.batch``).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from ap_core.dataflash_dtype import Column
from ap_core.fmath import f32
from ap_core.fmath_arrays import (
    Floats,
    array_of,
    cbrtf_array,
    quaternion_from_euler_arrays,
    quaternion_of_arrays,
    sqrtf_array,
    vector_of_arrays,
)
from ap_visualodom.batch_samples import Poses, Velocities
from mav_handlers.covariance import ErrorFormula, cube_root_of_squares, no_errors, root_of_sum
from mav_handlers.handlers.vision import odometry_frames_accepted
from mav_handlers.jitter_columns import correct_column
from mav_handlers.jitter_correction import JitterCorrection
from mav_handlers.release import REFERENCE, EndpointRelease
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)

_POSITION: Final = (0, 6, 11)
_ATTITUDE: Final = (15, 18, 20)
_ZERO: Final = f32(0)

_FORMULAS: Final[Mapping[ErrorFormula, Callable[[Floats, Floats, Floats], Floats]]] = {
    cube_root_of_squares: lambda a, b, c: cbrtf_array(a * a + b * b + c * c),
    root_of_sum: lambda a, b, c: sqrtf_array(a + b + c),
}


class Arrived(NamedTuple):
    """A message, and when it came.

    Attributes:
        now_us: when it is handled, since boot.
        local_us: the latest time at which it can have been sent, since boot (``Channel.arrival_us``).
        message: one that :func:`is_sample` is true of.
    """

    now_us: int
    local_us: int
    message: Message


class VisionColumns(NamedTuple):
    """Samples of messages.

    Attributes:
        poses, velocities: the samples.
        first_place: of each message, the place of its first sample; an ODOMETRY has two.
    """

    poses: Poses
    velocities: Velocities
    first_place: Column


def is_sample(message: Message | None) -> bool:
    """Tell whether a message becomes a pose or a velocity."""
    return type(message) in _KINDS and (not isinstance(message, ODOMETRY) or odometry_frames_accepted(message))


def error_columns(covariance: Floats, release: EndpointRelease) -> tuple[Floats, Floats]:
    """Return posErr and angErr of covariances: 21 columns, a row a message; see :func:`covariance.pose_errors`."""
    formula = _FORMULAS.get(release.error_formula) or np.frompyfunc(release.error_formula, 3, 1)
    with np.errstate(all="ignore"):
        errors = (formula(*(covariance[:, column] for column in axes)) for axes in (_POSITION, _ATTITUDE))
        pos_err, ang_err = (np.where(np.isnan(covariance[:, 0]), _ZERO, error).astype(f32) for error in errors)
    return pos_err, ang_err


class _Pose(NamedTuple):
    """Columns of poses of one kind of messages."""

    pos: Floats
    quat: Floats
    errors: tuple[Floats, Floats]
    reset_counter: Column
    quality: Column


_Messages = Sequence[Any]


def _rows(values: Sequence[Any]) -> Floats:
    return np.array(values, f32).reshape(len(values), -1)


def _positions(messages: _Messages) -> Floats:
    return _rows([(one.x, one.y, one.z) for one in messages]).T


def _zeros(messages: _Messages) -> Column:
    return np.zeros(len(messages), np.int8)


def _euler_poses(messages: _Messages, release: EndpointRelease) -> _Pose:
    euler_rad = _rows([(one.roll, one.pitch, one.yaw) for one in messages]).T
    with np.errstate(all="ignore"):
        quat = array_of(quaternion_from_euler_arrays(euler_rad), len(messages))
    errors = error_columns(_rows([one.covariance for one in messages]), release)
    counter = np.array([getattr(one, "reset_counter", 0) for one in messages], np.uint8)
    return _Pose(_positions(messages), quat, errors, counter, _zeros(messages))


def _mocap_poses(messages: _Messages, release: EndpointRelease) -> _Pose:
    covariance = _rows([one.covariance for one in messages])
    if release.mocap_errors is no_errors:
        covariance = np.zeros_like(covariance)
    errors = error_columns(covariance, release)
    quat = _rows([one.q for one in messages]).T
    return _Pose(_positions(messages), quat, errors, _zeros(messages), _zeros(messages))


def _odometry_poses(messages: _Messages, release: EndpointRelease) -> _Pose:
    errors = error_columns(_rows([one.pose_covariance for one in messages]), release)
    quat = _rows([one.q for one in messages]).T
    counter, quality = (
        np.array([getattr(one, label) for one in messages], kind)
        for label, kind in (("reset_counter", np.uint8), ("quality", np.int8))
    )
    return _Pose(_positions(messages), quat, errors, counter, quality)


def _odometry_velocities(messages: _Messages) -> Floats:
    quat, vel = _rows([one.q for one in messages]).T, _rows([(one.vx, one.vy, one.vz) for one in messages]).T
    with np.errstate(all="ignore"):
        turned = quaternion_of_arrays(quat).rotate_vector(vector_of_arrays(vel))
    return array_of(turned, len(messages))


_POSES: Final[Mapping[int, Callable[[_Messages, EndpointRelease], _Pose]]] = {
    0: _euler_poses,
    1: _mocap_poses,
    2: _odometry_poses,
}
_ODOMETRY: Final = 2
_SPEED: Final = 3
_VELOCITIES: Final[Mapping[int, Callable[[_Messages], Floats]]] = {_ODOMETRY: _odometry_velocities, _SPEED: _positions}
_KINDS: Final[Mapping[type[Message] | type[None], int]] = {
    VISION_POSITION_ESTIMATE: 0,
    GLOBAL_VISION_POSITION_ESTIMATE: 0,
    VICON_POSITION_ESTIMATE: 0,
    ATT_POS_MOCAP: 1,
    ODOMETRY: _ODOMETRY,
    VISION_SPEED_ESTIMATE: _SPEED,
}


def vision_columns(
    arrived: Sequence[Arrived], corrector: JitterCorrection, release: EndpointRelease = REFERENCE
) -> VisionColumns:
    """Return the samples of messages of one link.

    Args:
        arrived: the messages, in order.
        corrector: of the link; it goes on from these messages.
        release: which release to be.
    """
    messages = [one.message for one in arrived]
    kinds = np.array([_KINDS[type(one)] for one in messages], np.int64)
    first_place = np.cumsum(np.where(kinds == _ODOMETRY, 2, 1)) - np.where(kinds == _ODOMETRY, 2, 1)
    common = _Common(arrived, kinds, first_place, corrector)
    return VisionColumns(_poses(common, messages, release), _velocities(common, messages), first_place)


class _Common:
    """What all samples have: kind, place and times, a row a message."""

    def __init__(
        self, arrived: Sequence[Arrived], kinds: Column, first_place: Column, corrector: JitterCorrection
    ) -> None:
        self.kinds, self.first_place = kinds, first_place
        self.now_us = np.array([one.now_us for one in arrived], np.uint64)
        local_us = np.array([one.local_us for one in arrived], np.uint64)
        self.remote_us = np.array([_stamp(one.message) for one in arrived], np.uint64)
        corrected_us = correct_column(corrector, self.remote_us, local_us)
        self.time_ms = (corrected_us // np.uint64(1000)).astype(np.uint32)

    def of(self, rows: Column) -> tuple[Column, Column, Column]:
        """Return the times of some messages."""
        return self.now_us[rows], self.remote_us[rows], self.time_ms[rows]


def _stamp(message: Any) -> int:
    return int(message.time_usec if isinstance(message, ODOMETRY | ATT_POS_MOCAP) else message.usec)


def _poses(common: _Common, messages: _Messages, release: EndpointRelease) -> Poses:
    rows = np.flatnonzero(common.kinds != _SPEED)
    count = len(rows)
    pos, quat = np.zeros((3, count), f32), np.zeros((4, count), f32)
    errors = np.zeros((2, count), f32)
    counter, quality = np.zeros(count, np.uint8), np.zeros(count, np.int8)
    for kind, make in _POSES.items():
        at = np.flatnonzero(common.kinds[rows] == kind)
        if len(at):
            made = make([messages[row] for row in rows[at].tolist()], release)
            pos[:, at], quat[:, at], errors[:, at] = made.pos, made.quat, made.errors
            counter[at], quality[at] = made.reset_counter, made.quality
    return Poses(common.first_place[rows], *common.of(rows), pos, quat, errors[0], errors[1], counter, quality)


def _velocities(common: _Common, messages: _Messages) -> Velocities:
    rows = np.flatnonzero((common.kinds == _SPEED) | (common.kinds == _ODOMETRY))
    vel = np.zeros((3, len(rows)), f32)
    for kind, make in _VELOCITIES.items():
        at = np.flatnonzero(common.kinds[rows] == kind)
        if len(at):
            vel[:, at] = make([messages[row] for row in rows[at].tolist()])
    counter = np.array([messages[row].reset_counter for row in rows.tolist()], np.uint8)
    quality = np.array([getattr(messages[row], "quality", 0) for row in rows.tolist()], np.int8)
    place = common.first_place[rows] + (common.kinds[rows] == _ODOMETRY)
    return Velocities(place, *common.of(rows), vel, counter, quality)
