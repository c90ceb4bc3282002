# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a source of sensors' data must give, and what it may leave out."""

import dataclasses

import numpy as np
import pytest

from ekf_stub.inputs.measurements import InertialDelta
from ekf_stub.inputs.sensors import Sensors, SensorSource

REST = InertialDelta(np.array([0.0, 0.0, -0.0245]), np.zeros(3), 0.0025, 0.0025)


def test_source_without_sensors_says_nothing_and_rests() -> None:
    source = SensorSource()
    assert source.sense(2500) is None
    assert source.ahead(range(0, 5000, 2500)).shape == (0, 8)
    assert source.is_at_rest(10**9)
    assert (source.gps(), source.expected(), source.yaw_rad()) == (None, None, 0.0)


def test_sensors_may_have_inertial_data_alone() -> None:
    sensors = Sensors(REST)
    assert (sensors.baro, sensors.mag, sensors.declination) == (None, None, 0)


def test_what_sensors_said_does_not_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Sensors(REST).declination = 1.0  # type: ignore[misc]  # that it cannot be set is what is tested
