# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recorded flight with a camera, read once."""

from dataclasses import dataclass

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from tests.dfreader import read_log
from tests.places import RECORDED
from tests.unit.viso.estimators.motions import integrated
from viso.geometry.rotation import Array, quats_from_euler
from viso.vehicle.sensors.flown.source import read_flight

LOG = RECORDED / "logs" / "flight_t265.BIN.xz"
HALF_A_STEP_US = 1250  # the rotation of a pass is what happened since the one before


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """Columns of a log: corrected stamp, arrival and sender's stamp of each pose in us, its quaternion and position;
    time in us and quaternion of each ATT; time in us and position, NED, of each XKF1.
    """

    stamp_us: Array
    arrival_us: Array
    remote_us: Array
    quat_wxyz: Array
    pos_m: Array
    att_us: Array
    att_wxyz: Array
    ekf_us: Array
    ekf_ned_m: Array


def _collect(log: DFReader_binary) -> Flight:
    poses, attitudes, states = [], [], []
    while (record := log.recv_match(type=["VISP", "ATT", "XKF1"])) is not None:
        kind = record.get_type()
        if kind == "ATT":
            attitudes.append((record.TimeUS, record.Roll, record.Pitch, record.Yaw))
        elif kind == "XKF1" and record.C == 0:
            states.append((record.TimeUS, record.PN, record.PE, record.PD))
        elif kind == "VISP":
            place = (record.PX, record.PY, record.PZ)
            poses.append((record.CTimeMS * 1e3, record.TimeUS, record.RTimeUS, record.R, record.P, record.Y, *place))
    pose, att, ekf = (np.array(rows, np.float64) for rows in (poses, attitudes, states))
    return Flight(
        stamp_us=pose[:, 0],
        arrival_us=pose[:, 1],
        remote_us=pose[:, 2],
        quat_wxyz=quats_from_euler(np.radians(pose[:, 3:6])),
        pos_m=pose[:, 6:],
        att_us=att[:, 0],
        att_wxyz=quats_from_euler(np.radians(att[:, 1:])),
        ekf_us=ekf[:, 0],
        ekf_ned_m=ekf[:, 1:],
    )


@pytest.fixture(scope="package")
def flight() -> Flight:
    """Return the records of ``flight_t265``, whose vehicle has VISO_DELAY_MS at 30."""
    return read_log(LOG, _collect)


def read_gyro() -> tuple[Array, Array]:
    """Return the times in us of the passes of the flight's main loop, and attitudes made of their body rates."""
    passes = read_flight(LOG)
    time_us = passes.time_us.astype(np.float64) - HALF_A_STEP_US
    return time_us, integrated(time_us, passes.deltas[:, 3:6] / passes.deltas[:, 7:])
