# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many poses the batch port takes, beside the scalar port, and what one costs if ten or a hundred times as many."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ap_visualodom.batch import BatchVisualOdom
from ap_visualodom.batch_samples import Poses, Velocities
from ap_visualodom.visualodom_type import VisualOdom_Type
from ekf_stub.ahrs.ahrs_settable import SettableAhrs
from ekf_stub.reports.core_texts import NoTexts
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import PERIOD_US

POSES: Final = 5_000
SCALAR_POSES: Final = 200
_BACKENDS: Final = {
    "MAV": VisualOdom_Type.MAV,
    "IntelT265": VisualOdom_Type.IntelT265,
    "VOXL": VisualOdom_Type.VOXL,
}
_TIMES: Final = {"": 1, ", 10 times as many": 10, ", 100 times as many": 100}


class _NoRecords:
    def write(self, structure: LogStructure, values: Any) -> None:
        """Forget the record."""


def poses_of_a_flight(count: int, seed: int = 0) -> Poses:
    """Return poses of a camera that turns and moves at random, 30 a second."""
    rng = np.random.default_rng(seed)
    time_us = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(PERIOD_US)
    time_ms = (time_us // np.uint64(1000)).astype(np.uint32)
    quat = rng.normal(size=(4, count)).astype(f32)
    quat /= np.sqrt((quat * quat).sum(axis=0))
    pos, errors = rng.normal(size=(3, count)).astype(f32), rng.random((2, count)).astype(f32)
    counter, quality = np.zeros(count, np.uint8), rng.integers(1, 101, count, np.int8)
    return Poses(np.arange(count), time_us, time_us, time_ms, pos, quat, errors[0], errors[1], counter, quality)


def no_velocities() -> Velocities:
    """Return a table without rows."""
    stamps = (np.zeros(0, np.uint64), np.zeros(0, np.uint64))
    counts = np.zeros(0, np.uint8), np.zeros(0, np.int8)
    return Velocities(np.zeros(0, np.int64), *stamps, np.zeros(0, np.uint32), np.zeros((3, 0), f32), *counts)


class BenchPort:
    """The library with a backend, which is aligned with the first pose, by columns and pose by pose."""

    def __init__(self, kind: VisualOdom_Type) -> None:
        self._clock = VirtualClock()
        self._ahrs = SettableAhrs(is_initialised=True, is_dcm_yaw_initialised=True, yaw=f32(0.5))
        params = make_params()
        params.set("_TYPE", kind)
        vehicle: dict[str, Any] = {"gcs": NoTexts(), "logger": _NoRecords(), "errors": InternalErrors()}
        self.batch = BatchVisualOdom(params, ahrs=self._ahrs, clock=self._clock, **vehicle)
        self.scalar = AP_VisualOdom(params, ahrs=self._ahrs, clock=self._clock, **vehicle)
        self.batch.visual_odom.init()
        self.scalar.init()

    def run(self, poses: Poses, now_s: NowS) -> Part:
        """Take poses by columns, and some of them one by one."""
        begin_s = now_s()
        self.batch.handle(poses, no_velocities())
        elapsed_s = now_s() - begin_s
        return Part(elapsed_s, len(poses), self._one_by_one_s(poses, now_s) * len(poses) / SCALAR_POSES)

    def _one_by_one_s(self, poses: Poses, now_s: NowS) -> float:
        rows = [
            (Vector3f(*poses.pos[:, row]), Quaternion(*poses.quat[:, row]), poses.pos_err[row], poses.ang_err[row])
            for row in range(SCALAR_POSES)
        ]
        begin_s = now_s()
        for time_us, row in enumerate(rows):
            self._clock.set_us(time_us)
            self.scalar.handle_pose_estimate(time_us, time_us // 1000, *row, 0, 90)
        elapsed_s = now_s() - begin_s
        self._ahrs.calls.clear()
        return elapsed_s


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Make the library with each backend, and poses."""
    libraries = {name: BenchPort(kind) for name, kind in _BACKENDS.items()}
    flights = {name: poses_of_a_flight(times * POSES) for name, times in _TIMES.items()}

    def run_round() -> Mapping[str, Part]:
        parts = {name: library.run(flights[""], now_s) for name, library in libraries.items()}
        for name, flight in list(flights.items())[1:]:
            parts["IntelT265" + name] = libraries["IntelT265"].run(flight, now_s)
        return parts

    yield run_round
