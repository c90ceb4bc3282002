# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator asks of the vehicle around it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from ap_core.location import Location
from ap_core.sinks import TextSink
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.obs_ring import RingSizes, ring_sizes
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_texts import NoTexts

_INTS: Final[Mapping[str, int]] = {
    "EK3_ENABLE": 1,
    "EK3_IMU_MASK": 3,
    "EK3_MAG_CAL": 3,
    "EK3_HGT_DELAY": 60,
    "EK3_FLOW_DELAY": 10,
    "EK3_BCN_DELAY": 50,
    "VISO_DELAY_MS": 10,
}
_NUMBERS: Final[Mapping[str, float]] = {
    "EK3_VELNE_M_NSE": 0.3,
    "EK3_VELD_M_NSE": 0.5,
    "EK3_VEL_I_GATE": 500,
    "EK3_POSNE_M_NSE": 0.5,
    "EK3_POS_I_GATE": 500,
    "EK3_GLITCH_RAD": 25,
    "EK3_ALT_M_NSE": 2.0,
    "EK3_HGT_I_GATE": 500,
    "EK3_HGT_DELAY": 60,
    "EK3_MAG_M_NSE": 0.05,
    "EK3_MAG_CAL": 3,
    "EK3_MAG_I_GATE": 300,
    "EK3_GYRO_P_NSE": 0.015,
    "EK3_ACC_P_NSE": 0.35,
    "EK3_GBIAS_P_NSE": 0.001,
    "EK3_ABIAS_P_NSE": 0.02,
    "EK3_NOAID_M_NSE": 10.0,
    "EK3_YAW_M_NSE": 0.5,
    "EK3_YAW_I_GATE": 300,
    "EK3_TAU_OUTPUT": 25,
    "EK3_MAGE_P_NSE": 0.001,
    "EK3_MAGB_P_NSE": 0.0001,
    "EK3_ACC_BIAS_LIM": 1.0,
    "EK3_VIS_VERR_MIN": 0.1,
    "EK3_VIS_VERR_MAX": 0.9,
    "EK3_HRT_FILT": 2.0,
    "EK3_MAG_EF_LIM": 50,
    "EK3_OGNM_TEST_SF": 2.0,
}
_MAG_DELAY_MS: Final = 60
_GPS_LAG_MS: Final = 200  # of a receiver whose own is not known
_MAX_DELAY_MS: Final = 250


def _default_number(name: str) -> float:
    """Return the default of a parameter by its name after ``EK3_``."""
    return _NUMBERS[f"EK3_{name}"]


def _nothing() -> None:
    """Stand for a listener that nobody has put there."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The vehicle as the estimator sees it; by default one that is disarmed and has everything but GPS reception.

    Attributes:
        texts: where texts for the ground station go.
        get_int: returns an integer parameter by its full name.
        ekf3_number: returns a parameter by its name after ``EK3_``; asked for many times in a pass.
        gps: returns the newest solution of the GPS.
        is_armed: tells whether the vehicle is armed.
        is_fitted: tells whether there is a sensor, by its name in ``source_check.SENSORS``.
        on_yaw_reset: is called as yaw has been aligned.
        flying_ms: for how long the vehicle has been flying, 0 on the ground.
        home: returns home, None while it is unset.
        imu_pos: returns the place of the first IMU on the vehicle, m, body (FRD).
    """

    texts: TextSink = field(default_factory=NoTexts)
    get_int: Callable[[str], int] = _INTS.__getitem__
    ekf3_number: Callable[[str], float] = _default_number
    gps: Callable[[], GpsSample | None] = lambda: None
    is_armed: Callable[[], bool] = lambda: False
    is_fitted: Callable[[str], bool] = lambda _sensor: True
    on_yaw_reset: Callable[[], None] = _nothing
    flying_ms: Callable[[], int] = lambda: 0
    home: Callable[[], Location | None] = lambda: None
    imu_pos: Callable[[], Vector3f] = Vector3f

    def imu_mask(self) -> int:
        """Return which IMUs get a core; none when EK3_ENABLE is off."""
        return self.get_int("EK3_IMU_MASK") if self.get_int("EK3_ENABLE") else 0

    def buffer_sizes(self, sources: EkfSources, *, has_camera: bool) -> RingSizes:
        """Return the lengths of the estimator's buffers (NavEKF3_core::setup_core)."""
        delays = [self.get_int(f"EK3_{name}_DELAY") for name in ("HGT", "FLOW", "BCN")]
        if sources.uses_gps():
            delays.append(_GPS_LAG_MS)
        if has_camera:
            delays.append(min(self.get_int("VISO_DELAY_MS"), _MAX_DELAY_MS))
        return ring_sizes(max(*delays, _MAG_DELAY_MS))
