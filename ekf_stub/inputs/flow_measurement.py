# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a flow sensor tells the estimator (AP_OpticalFlow/AP_OpticalFlow.h, OpticalFlow_state)."""

from typing import NamedTuple

from ekf_stub.reports.core_report import Three


class FlowMeasurement(NamedTuple):
    """What a flow sensor measures: rates about x and y, rad/s, positive as the sensor itself turns.

    Attributes:
        quality: 0..255; 0 is unusable.
        flow: by what it sees.
        gyro: by its own gyro.
        offset: its place on the vehicle or from the IMU, m, body (FRD).
    """

    quality: int
    flow: tuple[float, float]
    gyro: tuple[float, float]
    offset: Three = (0.0, 0.0, 0.0)
