# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every source of inertial data is told, and what most of them have in common."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ekf_stub.inputs.inertial import Array
from viso.geometry import quaternions as quaternion
from viso.sensors.errors import NO_ERRORS, ErrorModel, SensorErrors
from viso.sensors.readings import PERIOD_US, ideal_field, last_reading_us

_NOTHING_AHEAD: Final[Array] = np.zeros((0, 8))


@dataclass(frozen=True, slots=True)
class ImuOptions:
    """What a source of inertial data may use.

    Attributes:
        heading_rad: where the vehicle points at first, if the source itself does not know.
        has_compass: says whether there is a compass, and in use.
        errors: what is wrong with the sensors.
        seed: of the random part of the errors.
    """

    heading_rad: float = 0.0
    has_compass: Callable[[], bool] = lambda: False
    errors: SensorErrors = NO_ERRORS
    seed: int = 0


class UnmovedSource:
    """What a source does that does not heed arming; ``SensorSource`` tells what it is to do."""

    has_recorded_heights = False

    def __init__(self, options: ImuOptions) -> None:
        self._options = options
        self._model = ErrorModel(options.errors, options.seed)
        self._next_reading_us = 0
        self._baro: tuple[int, float] | None = None
        self._mag: tuple[int, Array] | None = None

    def _read(self, now_us: int, height_m: float, quat: quaternion.quaternion) -> None:
        """Read the barometer, and the compass if there is one, of a vehicle with an attitude (body to NED)."""
        reading_us = last_reading_us(now_us)
        if reading_us is None:
            return
        self._next_reading_us = reading_us + PERIOD_US
        self._baro = reading_us // 1000, float(np.float32(height_m))
        self._mag = (reading_us, ideal_field(quat)) if self._options.has_compass() else None

    def ahead(self, times_us: range) -> Array:
        """Say nothing beforehand."""
        return _NOTHING_AHEAD

    def pass_over(self, times_us: range) -> None:
        """Do nothing: nothing was said beforehand."""

    def set_armed(self, armed: bool) -> None:
        """Go on as before, armed or not."""

    def is_at_rest(self, until_us: int) -> bool:
        """Stand still as long as nothing comes that says otherwise."""
        return True
