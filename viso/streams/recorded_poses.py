# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded trajectories with all their faults: what a sender would send that passes poses on as they are.

A player leaves out what cannot be used; this leaves everything in: NaN, attitudes that are no rotations, times that
step back. It is for those who want to know what is wrong with a recording.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mav_handlers.handlers import VISION_NAMES
from mav_handlers.wire.codec import Codec
from viso.companion.sender import MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
from viso.errors import InputError, as_input_errors
from viso.geometry.rotation import Array, euler_from_quats, inverse, product, quat_wxyz_from_rotation, rotate
from viso.geometry.trajectory import Pose
from viso.geometry.trajectory_files import Records, TrajectoryError
from viso.streams.messages import FORMS, Report
from viso.streams.readers import Source, load_records
from viso.streams.stream import MAX_GAP_US, Aspect, Stream, StreamMessage
from viso.streams.trajectory import TrajectoryOptions, axes_of

Times = NDArray[np.int64]

FORMS_AS_RECORDED: Final = ("odometry", "vision", "vision+speed", "mocap")
"""Those of ``FORMS`` that tell of one pose alone."""

_MAX_STAMP_US: Final = (1 << 62) - 1
_LONGEST_GAP_US: Final = 3_600_000_000
"""A time further ahead of the one before is damaged, or in another unit."""
_USUAL_US: Final = 33_333
_QUICKEST_US, _SLOWEST_US = 1_000, 2_000_000
_QUALITY: Final = 100
_CALLED: Final = MappingProxyType({name: name for name in VISION_NAMES})
"""A trajectory names no sender."""


@dataclass(frozen=True, slots=True, eq=False)
class _Poses:
    """Poses in the autopilot's axes, as recorded: position in m, attitude w, x, y, z, velocity in m/s in the world."""

    stamp_us: Times
    positions: Array
    quats_wxyz: Array
    velocities: Array
    covariances: Array | None

    def report(self, index: int) -> Report:
        covariance = None if self.covariances is None else self.covariances[index]
        pose = Pose(self.positions[index], self.quats_wxyz[index], self.velocities[index], covariance, 0)
        return _AsRecorded(int(self.stamp_us[index]), pose, quality=_QUALITY)


class _AsRecorded(Report):
    """A report of an attitude that may be no rotation."""

    @property
    def velocity_body(self) -> tuple[float, float, float]:
        return _in_body(self.pose.quat_wxyz, self.pose.velocity)

    @property
    def angles_rad(self) -> tuple[float, float, float]:
        return _euler(self.pose.quat_wxyz)


def _in_body(quat_wxyz: Array, velocity: Array) -> tuple[float, float, float]:
    """Return a velocity in the axes of the body; as it is where the attitude has no direction."""
    norm = float(np.linalg.norm(quat_wxyz))
    if not math.isfinite(norm) or norm < 1e-6:
        x, y, z = velocity.tolist()
        return x, y, z
    x, y, z = rotate(inverse(quat_wxyz / norm), velocity).tolist()
    return x, y, z


def _euler(quat_wxyz: Array) -> tuple[float, float, float]:
    """Return roll, pitch and yaw in rad of an attitude of whatever norm but 0; NaN of others."""
    norm = float(np.linalg.norm(quat_wxyz))
    if not math.isfinite(norm) or norm == 0:
        return math.nan, math.nan, math.nan
    roll, pitch, yaw = euler_from_quats(quat_wxyz / norm).tolist()
    return roll, pitch, yaw


def _in_axes(records: Records, axes: str) -> _Poses:
    """Return records in the autopilot's axes; numbers that are none stay so."""
    world, body = axes_of(axes)
    sign = math.copysign(1.0, float(np.linalg.det(world)))  # mirrored axes are so on both sides
    left, right = (quat_wxyz_from_rotation(sign * matrix) for matrix in (world, body))
    positions = np.array(records.positions, dtype=np.float64).reshape(-1, 3)
    quats = np.array(records.quats_wxyz, dtype=np.float64).reshape(-1, 4)
    turned = product(product(left, quats), inverse(right))
    velocities = np.zeros_like(positions)
    if records.velocities is not None:
        velocities = np.array(records.velocities, dtype=np.float64).reshape(-1, 3)
    covariances = None
    if records.covariances is not None:
        change = np.zeros((6, 6))
        change[:3, :3], change[3:, 3:] = world, sign * world  # a rotation vector is an axial one
        covariances = change @ np.array(records.covariances, dtype=np.float64).reshape(-1, 6, 6) @ change.T
    stamps = np.minimum(np.array(records.times_ns, dtype=np.int64) // 1000, _MAX_STAMP_US)
    return _Poses(
        stamps,
        _as_sent(positions @ world.T),
        _as_sent(turned),
        _as_sent(velocities @ world.T),
        None if covariances is None else _as_sent(covariances),
    )


def _as_sent(values: Array) -> Array:
    """Return numbers as binary32 holds them: what is too large for it is infinite."""
    return np.asarray(values.astype(np.float32), dtype=np.float64)


def _arrivals_us(records: Records, stamp_us: Times) -> Times:
    """Return when each record comes, in us since the first: as the file tells, else as its times let one think."""
    if records.arrivals_ns is not None:
        told = np.array(records.arrivals_ns, dtype=np.int64) // 1000
        arrivals_us = np.asarray(np.maximum.accumulate(told - told[0]), dtype=np.int64)
        late = np.flatnonzero(np.diff(arrivals_us) > MAX_GAP_US)
        if len(late):
            raise InputError(f"{records.source}: message {int(late[0]) + 2}: more than a day after the one before")
        return arrivals_us
    step = np.diff(stamp_us)
    usual = float(np.median(step[step > 0])) if (step > 0).any() else _USUAL_US
    # Times of another unit: a camera gives a pose every few ms, not every half a minute.
    scales = (1.0, 1e-3, 1e3, 1e-6, 1e6)
    scale = next((factor for factor in scales if _QUICKEST_US <= usual * factor <= _SLOWEST_US), 0.0)
    period = usual * scale if scale else _USUAL_US
    taken = np.where((step > 0) & (step * scale < _LONGEST_GAP_US), step * scale, period) if scale else period
    steps = np.broadcast_to(np.asarray(taken, dtype=np.float64), step.shape)
    return np.concatenate([[0], np.cumsum(np.rint(steps).astype(np.int64))]).astype(np.int64)


def _lacks(records: Records) -> frozenset[Aspect]:
    lacks = {Aspect.LINK, Aspect.RESETS, Aspect.QUALITY}
    if records.arrivals_ns is None:
        lacks.add(Aspect.ARRIVAL)
    if records.covariances is None:
        lacks.add(Aspect.COVARIANCE)
    return frozenset(lacks)


def _frames(records: Records, poses: _Poses, form: str, lead_us: int) -> Iterator[StreamMessage]:
    codec = Codec(1, MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY)
    encode = FORMS[form].encode
    for index, arrival_us in enumerate(_arrivals_us(records, poses.stamp_us).tolist()):
        for message in encode(poses.report(index)):
            yield StreamMessage(lead_us + arrival_us, codec.encode(message))


def read_as_recorded(path: Path, lead_us: int, options: TrajectoryOptions, form: str | None = None) -> Stream:
    """Read a trajectory as messages that hold what the file holds, usable or not; a rate in the options is not obeyed.

    Raises InputError if it cannot be read, or an option cannot be used.
    """
    check_form(form)
    with as_input_errors(TrajectoryError):
        records = load_records(Source(path, options.topic, options.times), options.format_name)
    return replace(as_recorded(records, lead_us, options.axes, form), name=path.stem)


def as_recorded(records: Records, lead_us: int, axes: str, form: str | None = None) -> Stream:
    """Return messages that hold what records hold, usable or not; the first comes ``lead_us`` after boot.

    ``axes`` are as of ``viso play``. A ``form``, of those that ``check_form`` lets pass, is what to send; None for the
    message that carries what they hold, and no more: ODOMETRY with velocities, VISION_POSITION_ESTIMATE with
    covariances, else ATT_POS_MOCAP. Raises InputError if there are no records, or an option cannot be used.
    """
    source = records.source
    if not len(records.times_ns):
        raise InputError(f"{source}: no poses")
    moves = records.velocities is not None
    if form in ("odometry", "vision+speed") and not moves:
        raise InputError(f"--as {form}: {source} holds no velocities")
    chosen = form or ("odometry" if moves else "mocap" if records.covariances is None else "vision")
    with np.errstate(all="ignore"):
        messages = tuple(_frames(records, _in_axes(records, axes), chosen, lead_us))
    notes = [f"{source}: {count} with {reason}" for reason, count in records.left_out.items()]
    what = "poses and velocities" if moves else "poses, no velocities"
    notes.append(f"{source}: {what}; taken as {axes} (--axes), sent as {chosen} (--as)")
    return Stream(source, messages, notes=tuple(notes), lacks=_lacks(records), called=_CALLED)


def check_form(form: str | None) -> None:
    """Raise InputError unless poses can be sent as that as they are: None, or one of ``FORMS_AS_RECORDED``."""
    if form is not None and form not in FORMS_AS_RECORDED:
        raise InputError(f"--as {form}: as recorded, there are {', '.join(FORMS_AS_RECORDED)}")
