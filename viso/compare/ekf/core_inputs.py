# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of several sensors a core uses (AP_NavEKF3/AP_NavEKF3_Measurements.cpp, update_sensor_selection)."""

from ekf_stub.core.core import AFFINITY_BARO, AFFINITY_GPS, AFFINITY_MAG
from ekf_stub.core.inputs import Compasses
from ekf_stub.inputs.gps_sample import FIX_3D, GpsSample
from viso.compare.ekf.inputs import ReplayInputs


class CoreInputs:
    """The sensors of a core by its number: those of that number, if it has affinity by EK3_AFFINITY."""

    def __init__(self, inputs: ReplayInputs, number: int) -> None:
        self._inputs = inputs
        self._number = number
        self._compasses: Compasses | None = None
        self._own_compasses: Compasses | None = None

    def baro(self, affinity: int) -> tuple[int, float] | None:
        """Return the barometer's reading (update_baro_selection)."""
        baros = self._inputs.baros
        own = affinity & AFFINITY_BARO and baros.get(self._number)
        if own and own.is_healthy:
            return own.value
        primary = baros.get(self._inputs.primary_baro)
        return None if primary is None else primary.value

    def compasses(self, affinity: int) -> Compasses:
        """Return what the compasses say, and which of them is the core's own: the same until that changes."""
        given = self._inputs.compasses
        if not affinity & AFFINITY_MAG:
            return given
        if self._own_compasses is None or self._compasses is not given:
            self._compasses, self._own_compasses = given, given.of_core(self._number)
        return self._own_compasses

    def gps(self, affinity: int) -> GpsSample | None:
        """Return the newest solution of a receiver (update_gps_selection)."""
        if affinity & AFFINITY_GPS:
            own = self._inputs.gps_of(self._number)
            if own is not None and own.fix_type >= FIX_3D:
                return own
        return self._inputs.gps
