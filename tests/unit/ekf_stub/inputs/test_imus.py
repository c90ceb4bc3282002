# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which gyro and accelerometer a core uses."""

import numpy as np
import pytest

from ekf_stub.filter.inertial import Array, InertialDelta
from ekf_stub.inputs.imus import ImuReading, Imus

DT = 0.0025


def reading(number: int, *, has_gyro: bool = True, has_accel: bool = True) -> ImuReading:
    three = np.full(3, 0.001 * (number + 1))
    return ImuReading(InertialDelta(three, three, DT, DT), has_gyro, has_accel)


def imus(*readings: ImuReading) -> Imus:
    """Return IMUs that have said something in one pass."""
    made = Imus()
    made.update(readings, DT)
    return made


def first(vector: Array) -> float:
    return float(vector[0])


def test_core_uses_its_own_imu() -> None:
    readings = reading(0), reading(1)
    assert imus(*readings).delta_of(1) is readings[1].delta


@pytest.mark.parametrize(
    ("spoilt", "sensors", "deltas"), [("has_gyro", (0, 1), (0.001, 0.002)), ("has_accel", (1, 0), (0.002, 0.001))]
)
def test_sensor_that_fails_is_replaced_by_the_first(
    spoilt: str, sensors: tuple[int, int], deltas: tuple[float, float]
) -> None:
    some = imus(reading(0), reading(1, **{spoilt: False}))
    delta = some.delta_of(1)
    assert (some.gyro_of(1), some.accel_of(1)) == sensors
    assert (first(delta.del_ang), first(delta.del_vel)) == deltas


def test_first_one_is_the_first_that_may_be_used() -> None:
    some = imus(reading(0, has_gyro=False, has_accel=False), reading(1), reading(2))
    assert (some.first_gyro, some.first_accel) == (1, 1)
    assert first(some.delta_of(0).del_ang) == 0.002


def test_rates_are_filtered_and_those_of_a_sensor_not_to_be_used_are_left_out() -> None:
    rates = imus(reading(0), reading(1, has_gyro=False)).rates_of(1)
    assert rates is not None
    gyro, accel = rates.gyros[0], rates.accels[1]
    assert gyro is not None
    assert accel is not None
    assert rates.gyros[1:] == [None, None]
    assert 2 * gyro[0] == pytest.approx(accel[0])
    assert 0.0 < gyro[0] < 0.4


def test_without_news_they_say_what_they_said() -> None:
    some = imus(reading(0), reading(1))
    before = some.rates_of(0)
    assert before is not None
    gyro = before.gyros[0]
    some.update((), DT)
    after = some.rates_of(0)
    assert after is not None
    assert after.gyros[0] != gyro
    assert first(some.delta_of(1).del_ang) == 0.002


def test_only_imu_has_none_to_learn_of() -> None:
    assert imus(reading(0)).rates_of(0) is None


def test_core_of_an_imu_that_says_nothing_has_the_first_ones_data() -> None:
    assert not Imus().has_data_of(0)
    assert imus(reading(0)).has_data_of(1)
