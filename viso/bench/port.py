# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many poses the ported library takes: scaled, aligned, judged, given to an estimator and a log that do nothing."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Final

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ap_visualodom.visualodom_type import VisualOdom_Type
from ekf_stub.ahrs.ahrs_settable import SettableAhrs
from ekf_stub.reports.core_texts import NoTexts
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import PERIOD_US

POSES_A_ROUND: Final = 200
_BACKENDS: Final = {"MAV": VisualOdom_Type.MAV, "IntelT265": VisualOdom_Type.IntelT265}


class _NoRecords:
    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Forget the record."""


class _Driven:
    def __init__(self, kind: VisualOdom_Type) -> None:
        self._clock = VirtualClock()
        self._ahrs = SettableAhrs(is_initialised=True, is_dcm_yaw_initialised=True, yaw=f32(0.5))
        params = make_params()
        params.set("_TYPE", kind)
        self._visual_odom = AP_VisualOdom(
            params, ahrs=self._ahrs, gcs=NoTexts(), logger=_NoRecords(), clock=self._clock, errors=InternalErrors()
        )
        self._visual_odom.init()

    def run(self, poses: int, now_s: NowS) -> Part:
        pos, att, pos_err, ang_err = Vector3f(1, 2, -3), Quaternion(0.9, 0.1, -0.2, 0.374), f32(0.01), f32(0.02)
        first_us = self._clock.micros64()
        begin_s = now_s()
        for time_us in range(first_us + PERIOD_US, first_us + (poses + 1) * PERIOD_US, PERIOD_US):
            self._clock.set_us(time_us)
            self._visual_odom.handle_pose_estimate(time_us, time_us // 1000, pos, att, pos_err, ang_err, 0, 90)
        elapsed_s = now_s() - begin_s
        self._ahrs.calls.clear()
        return Part(elapsed_s, poses)


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Make the library with each backend."""
    libraries = {name: _Driven(kind) for name, kind in _BACKENDS.items()}

    def run_round() -> Mapping[str, Part]:
        return {name: library.run(POSES_A_ROUND, now_s) for name, library in libraries.items()}

    yield run_round
