# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples in columns, and what AP_VisualOdom makes of them in columns: one row a sample.

Poses and velocities have tables of their own. ``place`` says where in the common sequence a row comes: each of the
numbers 0 .. N-1 is in one of the tables, and both ascend.
"""

from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np

from ap_core.dataflash_dtype import Column, Records
from ap_core.dataflash_packing import pack_columns
from ap_core.fmath_arrays import Floats
from ap_visualodom.log_structure import VISP, VISV
from ap_visualodom.verdicts import CONSUMED, VERDICTS

VERDICT_NUMBER: Final = {verdict: number for number, verdict in enumerate(VERDICTS)}
"""How a column of verdicts names them: by their place in VERDICTS."""
CONSUMED_NUMBER: Final = VERDICT_NUMBER[CONSUMED]


@dataclass(frozen=True, slots=True)
class _Table:
    """Columns of one length, which is that of the first; rows are along the last axis."""

    def __len__(self) -> int:
        return int(getattr(self, fields(self)[0].name).shape[-1])

    def rows(self, begin: int, end: int) -> Any:
        """Return the rows from ``begin`` up to ``end`` without copying them."""
        return type(self)(*(getattr(self, one.name)[..., begin:end] for one in fields(self)))


@dataclass(frozen=True, slots=True)
class Poses(_Table):
    """Poses as AP_VisualOdom::handle_pose_estimate gets them.

    Attributes:
        place: in the common sequence; int64.
        time_us: when it is handled, since boot; uint64.
        remote_us: the sender's stamp; uint64.
        time_ms: the time of the sample since boot, corrected for transport; uint32.
        pos: rows x, y, z in m, NED or FRD; float32.
        quat: rows w, x, y, z, body to earth; float32.
        pos_err: m; float32.
        ang_err: rad; float32.
        reset_counter: uint8.
        quality: -1 failed, 0 unknown, 1 worst .. 100 best; int8.
    """

    place: Column
    time_us: Column
    remote_us: Column
    time_ms: Column
    pos: Floats
    quat: Floats
    pos_err: Floats
    ang_err: Floats
    reset_counter: Column
    quality: Column


@dataclass(frozen=True, slots=True)
class Velocities(_Table):
    """Velocities as AP_VisualOdom::handle_vision_speed_estimate gets them; columns as in Poses.

    Attributes:
        vel: rows x, y, z in m/s NED; float32.
    """

    place: Column
    time_us: Column
    remote_us: Column
    time_ms: Column
    vel: Floats
    reset_counter: Column
    quality: Column


@dataclass(frozen=True, slots=True)
class PoseResults(_Table):
    """What became of poses, a row each.

    Attributes:
        verdict: a place in VERDICTS; the other columns say nothing of a pose that was dropped. uint8.
        pos: rows x, y, z in m NED, as logged and, if consumed, given to the EKF.
        quat: rows w, x, y, z, as given to the EKF.
        euler_deg: rows roll, pitch, yaw, as logged.
        pos_err: m, clamped.
        ang_err: rad, clamped.
        delay_ms: given to the EKF; int32.
        reset_ms: given to the EKF, of consumed poses; uint32.
        was_healthy: whether AP_VisualOdom still was healthy as the pose came.
    """

    verdict: Column
    pos: Floats
    quat: Floats
    euler_deg: Floats
    pos_err: Floats
    ang_err: Floats
    delay_ms: Column
    reset_ms: Column
    was_healthy: Column

    @classmethod
    def empty(cls, count: int) -> "PoseResults":
        """Return zeroed rows."""
        pos, quat, euler_deg, errors = (np.zeros((rows, count), np.float32) for rows in (3, 4, 3, 2))
        verdict, healthy = np.zeros(count, np.uint8), np.zeros(count, np.bool_)
        delay_ms, reset_ms = np.zeros(count, np.int32), np.zeros(count, np.uint32)
        return cls(verdict, pos, quat, euler_deg, errors[0], errors[1], delay_ms, reset_ms, healthy)

    def visp(self, poses: Poses) -> Records:
        """Return the VISP records, of all poses in their order; those of dropped ones mean nothing."""
        times = poses.time_us, poses.remote_us, poses.time_ms
        flags = poses.reset_counter, self.verdict != CONSUMED_NUMBER, poses.quality
        return pack_columns(VISP, [*times, *self.pos, *self.euler_deg, self.pos_err, self.ang_err, *flags])


@dataclass(frozen=True, slots=True)
class VelocityResults(_Table):
    """What became of velocities, a row each; columns as in PoseResults.

    Attributes:
        vel: rows x, y, z in m/s NED, as logged and, if consumed, given to the EKF.
        err: m/s.
    """

    verdict: Column
    vel: Floats
    err: Floats
    delay_ms: Column
    was_healthy: Column

    @classmethod
    def empty(cls, count: int) -> "VelocityResults":
        """Return zeroed rows."""
        vel, err = np.zeros((3, count), np.float32), np.zeros(count, np.float32)
        return cls(np.zeros(count, np.uint8), vel, err, np.zeros(count, np.int32), np.zeros(count, np.bool_))

    def visv(self, velocities: Velocities) -> Records:
        """Return the VISV records, of all velocities in their order; those of dropped ones mean nothing."""
        times = velocities.time_us, velocities.remote_us, velocities.time_ms
        flags = velocities.reset_counter, self.verdict != CONSUMED_NUMBER, velocities.quality
        return pack_columns(VISV, [*times, *self.vel, self.err, *flags])
