# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator asks of the vehicle around it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ap_core.fmath import f32
from ap_core.sinks import TextSink
from ekf_stub.core_texts import NoTexts
from ekf_stub.gps_sample import GpsSample
from ekf_stub.obs_ring import RingSizes, ring_sizes
from ekf_stub.sources import EkfSources

_INTS: Final[Mapping[str, int]] = {
    "EK3_ENABLE": 1,
    "EK3_IMU_MASK": 3,
    "EK3_MAG_CAL": 3,
    "EK3_HGT_DELAY": 60,
    "EK3_FLOW_DELAY": 10,
    "EK3_BCN_DELAY": 50,
    "VISO_DELAY_MS": 10,
}
_FLOATS: Final = {"EK3_VIS_VERR_MIN": f32(0.1), "EK3_VIS_VERR_MAX": f32(0.9)}
_MAG_DELAY_MS: Final = 60
_GPS_LAG_MS: Final = 200  # of a receiver whose own is not known
_MAX_DELAY_MS: Final = 250


def _nothing() -> None:
    """Stand for a listener that nobody has put there."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The vehicle as the estimator sees it; by default one that is disarmed and has everything but GPS reception.

    Attributes:
        texts: where texts for the ground station go.
        get_int: returns an integer parameter by its full name.
        get_float: returns a float parameter by its full name.
        gps: returns the newest solution of the GPS.
        is_armed: tells whether the vehicle is armed.
        is_fitted: tells whether there is a sensor, by its name in ``source_check.SENSORS``.
        on_yaw_reset: is called as yaw has been aligned.
    """

    texts: TextSink = field(default_factory=NoTexts)
    get_int: Callable[[str], int] = _INTS.__getitem__
    get_float: Callable[[str], np.float32] = _FLOATS.__getitem__
    gps: Callable[[], GpsSample | None] = lambda: None
    is_armed: Callable[[], bool] = lambda: False
    is_fitted: Callable[[str], bool] = lambda _sensor: True
    on_yaw_reset: Callable[[], None] = _nothing

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
