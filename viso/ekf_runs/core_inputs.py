# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of several sensors a core uses (AP_NavEKF3/AP_NavEKF3_Measurements.cpp, update_sensor_selection)."""

from collections.abc import Callable

from ekf_stub.core.ekf3_core import AFFINITY_BARO, AFFINITY_GPS, AFFINITY_MAG
from ekf_stub.filter.inactive_biases import ImuRates
from ekf_stub.filter.inertial import InertialDelta
from ekf_stub.inputs.compasses import NO_COMPASS, Compasses
from ekf_stub.inputs.gps_sample import FIX_3D, GpsSample
from viso.ekf_runs.inputs import ReplayInputs
from viso.logs.record_fields import RecordError


class CoreInputs:
    """The sensors of a core: its own IMU while that can be used; of others that of its number, if it has affinity.

    An IMU of which there are no data cannot be used. ``affinity`` returns EK3_AFFINITY.
    """

    def __init__(self, inputs: ReplayInputs, number: int, imu: int, affinity: Callable[[], int]) -> None:
        self._inputs = inputs
        self._number = number
        self._imu = imu
        self._affinity = affinity
        self._said, self._own_said = NO_COMPASS, NO_COMPASS

    @property
    def accel(self) -> int:
        """The number of the accelerometer."""
        return self._inputs.imus.accel_of(self._imu)

    @property
    def has_data(self) -> bool:
        """Whether there are inertial data."""
        return self._inputs.imus.has_data_of(self._imu)

    def delta(self) -> InertialDelta:
        """Return the inertial data. Raises RecordError where the IMU in use has none."""
        try:
            return self._inputs.imus.delta_of(self._imu)
        except KeyError as imu:
            raise RecordError(f"no RISI record of IMU {imu}, which RISH names as the first that can be used") from imu

    def imu_rates(self) -> ImuRates | None:
        """Return what all IMUs say, None where there is but one."""
        return self._inputs.imus.rates_of(self._imu)

    def baro(self) -> tuple[int, float] | None:
        """Return the barometer's reading (update_baro_selection)."""
        baros = self._inputs.baros
        own = self._affinity() & AFFINITY_BARO and baros.get(self._number)
        if own and own.is_healthy:
            return own.value
        primary = baros.get(self._inputs.primary_baro)
        return None if primary is None else primary.value

    def compasses(self) -> Compasses:
        """Return what the compasses say, and which of them is the core's own: the same until that changes."""
        if not self._affinity() & AFFINITY_MAG:
            return self._inputs.compasses
        if self._said is not self._inputs.compasses:
            self._said = self._inputs.compasses
            self._own_said = self._said._replace(own=self._number)
        return self._own_said

    def gps(self) -> GpsSample | None:
        """Return the newest solution of a receiver (update_gps_selection)."""
        if self._affinity() & AFFINITY_GPS:
            own = self._inputs.gps_of(self._number)
            if own is not None and own.fix_type >= FIX_3D:
                return own
        return self._inputs.gps
