# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an AHRS is made of."""

from dataclasses import dataclass

from ap_core.clock import VirtualClock
from ap_core.param import ParamTable
from ap_core.sinks import RecordSink, TextSink
from ap_core.vector3 import Vector3f
from ekf_stub.core.params import EkfSources
from ekf_stub.log.replay_log import ReplayLog
from ekf_stub.release import REFERENCE, FilterRelease


@dataclass(frozen=True, slots=True)
class AhrsParts:
    """What an AHRS shares with the vehicle around it.

    Attributes:
        clock: time since boot, which an AHRS that runs several passes moves on from one to the next.
        sources: the EKF's source sets.
        log: where inputs are logged.
        logger: where estimates are logged.
        params: all parameters.
        texts: where texts for ground stations go.
        release: which EKF3 it is.
    """

    clock: VirtualClock
    sources: EkfSources
    log: ReplayLog
    logger: RecordSink
    params: ParamTable
    texts: TextSink
    release: FilterRelease = REFERENCE

    def has_flow(self) -> bool:
        """Return whether there is to be a flow sensor (AP_OpticalFlow::enabled)."""
        return self.params.get_int("FLOW_TYPE") != 0

    def has_compass(self) -> bool:
        """Return whether there is a compass, and in use."""
        return self.params.get_int("COMPASS_ENABLE") != 0 and self.params.get_int("COMPASS_USE") != 0

    def imu_pos(self, imu: int = 0) -> Vector3f:
        """Return the place of an IMU on the vehicle, m, body (FRD)."""
        return Vector3f(*(self.params.get_float(f"INS_POS{imu + 1}_{axis}") for axis in "XYZ"))

    def imu_mask(self) -> int:
        """Return which IMUs get a core; none when EK3_ENABLE is off."""
        return self.params.get_int("EK3_IMU_MASK") if self.params.get_int("EK3_ENABLE") else 0
