# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a source of sensors' data must give, and what it may leave out."""

import dataclasses

import numpy as np
import pytest

from ekf_stub.inputs.inertial import Array, InertialDelta
from ekf_stub.inputs.sensors import Sensors, SensorSource

REST = InertialDelta(np.array([0.0, 0.0, -0.0245]), np.zeros(3), 0.0025, 0.0025)


class Rest:
    """The least that a source of sensors' data is."""

    has_recorded_heights = False

    def sense(self, now_us: int) -> Sensors | None:
        return Sensors(REST) if now_us else None

    def ahead(self, times_us: range) -> Array:
        return np.zeros((0, 8))

    def pass_over(self, times_us: range) -> None: ...

    def set_armed(self, armed: bool) -> None: ...

    def is_at_rest(self, until_us: int) -> bool:
        return until_us > 0

    def yaw_rad(self) -> float:
        return 0.5


def test_source_may_have_inertial_data_alone_or_nothing() -> None:
    source: SensorSource = Rest()
    assert source.sense(0) is None
    sensors = source.sense(2500)
    assert sensors is not None
    assert (sensors.baro, sensors.mag, sensors.declination) == (None, None, 0)


def test_what_sensors_said_does_not_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Sensors(REST).declination = 1.0  # type: ignore[misc]  # that it cannot be set is what is tested
