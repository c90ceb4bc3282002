# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes with a pass of the main loop."""

from typing import NamedTuple

from ekf_stub.filter.inactive_biases import ImuRates
from ekf_stub.filter.inertial import Array, InertialDelta
from ekf_stub.inputs.compasses import Compasses
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.range_state import RangeState


class Frame(NamedTuple):
    """What the filter is given in a frame.

    ``baro`` is (time of its last update in ms, height in m), ``mag`` (time in us, field in mGauss, body), ``gps`` the
    newest solution; None when there is none. ``lever_arm`` is the camera's place from the IMU in m, body, ``home_lat``
    the latitude of home in 1e-7 deg. ``declination`` (rad) is the compass's own; ``place_declination`` that of the
    origin by a table of the world, where there is one. ``ranges`` is what the range finders say, None when there are
    none, ``compasses`` what all compasses say, None where there is but the one that ``mag`` is of, and ``imu_rates``
    what all IMUs say, None where there is but one. ``place_field`` is the earth's magnetic field at the origin by a
    table of the world, Gauss, NED, where there is one. With ``is_late`` there is no time left for a step.
    """

    time_us: int
    delta: InertialDelta
    armed: bool = False
    flying_ms: int = 0
    takeoff_expected: bool = False
    touchdown_expected: bool = False
    baro: tuple[int, float] | None = None
    mag: tuple[int, Array] | None = None
    gps: GpsSample | None = None
    declination: float = 0.0
    place_declination: float | None = None
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    home_lat: int = 0
    ranges: RangeState | None = None
    compasses: Compasses | None = None
    imu_rates: ImuRates | None = None
    is_late: bool = False
    place_field: Array | None = None
