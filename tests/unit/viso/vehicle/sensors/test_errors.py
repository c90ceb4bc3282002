# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors err as they are told to, the same way for the same seed, and read single precision."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ekf_stub.inputs.measurements import ImuReading, InertialDelta
from ekf_stub.inputs.sensors import Sensors
from viso.errors import InputError
from viso.vehicle.sensors.errors import NO_ERRORS, ErrorModel, SensorErrors, exact_delta, parse_errors

DT = 0.0025
PASSES = 20_000
FOUR_SIGMA = 4.0

NAMES = (
    "gyro_bias_deg_s, gyro_noise_deg_s_rthz, gyro_scale_percent, accel_bias_m_s2, accel_noise_m_s2_rthz, "
    "accel_scale_percent, baro_bias_m, baro_noise_m, compass_noise_mgauss, imus"
)


def sensors(time_us: int = 50_000, rate: float = 0.1, accel: float = -9.80665) -> Sensors:
    delta = InertialDelta(np.array([0.0, 0.0, accel * DT]), np.array([rate * DT, 0.0, 0.0]), DT, DT)
    return Sensors(delta, (time_us // 1000, 12.5), (time_us, np.array([200.0, -30.0, -500.0])), 0.2)


def is_single(sensors: Sensors) -> bool:
    assert sensors.baro is not None
    assert sensors.mag is not None
    numbers = np.array([*sensors.delta.del_vel, *sensors.delta.del_ang, sensors.baro[1], *sensors.mag[1]])
    return bool((numbers == numbers.astype(np.float32)).all())


def run(errors: SensorErrors, seed: int = 0, passes: int = PASSES) -> list[Sensors]:
    model = ErrorModel(errors, seed)
    return [model.apply(sensors(100_000 * number)) for number in range(passes)]


def test_sensors_without_errors_are_left_alone() -> None:
    given = sensors()
    assert ErrorModel(NO_ERRORS).apply(given) is given


def test_biases_and_scales_are_added() -> None:
    errors = SensorErrors(
        gyro_bias_deg_s=(1.0, -2.0, 3.0),
        gyro_scale_percent=10.0,
        accel_bias_m_s2=(0.1, 0.2, -0.3),
        accel_scale_percent=-1.0,
        baro_bias_m=0.5,
    )
    spoilt = ErrorModel(errors).apply(sensors())
    assert spoilt.delta.del_ang / DT == pytest.approx([0.11 + math.radians(1), math.radians(-2), math.radians(3)])
    assert spoilt.delta.del_vel / DT == pytest.approx([0.1, 0.2, -9.80665 * 0.99 - 0.3])
    assert spoilt.baro == (50, 13.0)
    assert spoilt.mag is not None
    assert spoilt.mag[1].tolist() == [200, -30, -500]
    assert spoilt.declination == 0.2
    assert (spoilt.delta.del_vel_dt, spoilt.delta.del_ang_dt) == (DT, DT)


@pytest.fixture(scope="module")
def noisy() -> list[Sensors]:
    """Return readings with all noise there is."""
    noise = SensorErrors(
        gyro_noise_deg_s_rthz=0.5, accel_noise_m_s2_rthz=0.02, baro_noise_m=0.3, compass_noise_mgauss=4.0
    )
    return run(noise)


@pytest.mark.slow
def test_angle_and_velocity_walk_as_the_noise_density_says(noisy: list[Sensors]) -> None:
    angles = np.array([one.delta.del_ang for one in noisy]) - [0.1 * DT, 0, 0]
    velocities = np.array([one.delta.del_vel for one in noisy]) - [0, 0, -9.80665 * DT]
    relative = FOUR_SIGMA / math.sqrt(2 * angles.size)
    assert np.std(angles) == pytest.approx(math.radians(0.5) * math.sqrt(DT), rel=relative)
    assert np.std(velocities) == pytest.approx(0.02 * math.sqrt(DT), rel=relative)
    time_s = PASSES * DT
    assert np.abs(angles.sum(0)).max() < FOUR_SIGMA * math.radians(0.5) * math.sqrt(time_s)
    assert np.abs(velocities.sum(0)).max() < FOUR_SIGMA * 0.02 * math.sqrt(time_s)


@pytest.mark.slow
def test_noise_of_axes_and_passes_is_independent(noisy: list[Sensors]) -> None:
    angles = np.array([one.delta.del_ang for one in noisy])
    correlations = np.corrcoef(np.column_stack([angles[:-1], angles[1:]]).T)
    assert np.abs(correlations - np.eye(6)).max() < (FOUR_SIGMA + 1) / math.sqrt(PASSES)


@pytest.mark.slow
def test_readings_of_barometer_and_compass_scatter(noisy: list[Sensors]) -> None:
    heights = np.array([one.baro[1] for one in noisy if one.baro])
    fields = np.array([one.mag[1] for one in noisy if one.mag])
    assert np.mean(heights) == pytest.approx(12.5, abs=FOUR_SIGMA * 0.3 / math.sqrt(PASSES))
    assert np.std(heights) == pytest.approx(0.3, rel=FOUR_SIGMA / math.sqrt(2 * PASSES))
    assert np.std(fields, axis=0) == pytest.approx([4.0] * 3, rel=FOUR_SIGMA / math.sqrt(2 * PASSES))
    assert np.array_equal(noisy[0].delta.del_ang, np.float32(noisy[0].delta.del_ang))


def test_reading_keeps_its_error_while_it_is_repeated() -> None:
    model = ErrorModel(SensorErrors(baro_noise_m=0.3, compass_noise_mgauss=4.0))
    first, again, next_one = (model.apply(sensors(time_us)) for time_us in (50_000, 50_000, 150_000))
    assert first.mag is not None
    assert again.mag is not None
    assert first.baro == again.baro != next_one.baro
    assert first.mag[1].tolist() == again.mag[1].tolist()


def test_errors_depend_on_the_seed_alone() -> None:
    errors = parse_errors(["gyro_noise_deg_s_rthz=1", "baro_noise_m=1"])
    first, same, other = (run(errors, seed, 100)[-1] for seed in (7, 7, 8))
    assert first.delta.del_ang.tolist() == same.delta.del_ang.tolist() != other.delta.del_ang.tolist()
    assert first.baro == same.baro != other.baro


def test_one_sensor_does_not_change_the_noise_of_another() -> None:
    errors = SensorErrors(gyro_noise_deg_s_rthz=1.0, baro_noise_m=1.0, compass_noise_mgauss=1.0)
    whole, bare = ErrorModel(errors), ErrorModel(errors)
    for time_us in (50_000, 150_000):
        given = sensors(time_us)
        with_compass = whole.apply(given)
        without = bare.apply(Sensors(given.delta, given.baro))
    assert with_compass.delta.del_ang.tolist() == without.delta.del_ang.tolist()
    assert with_compass.baro == without.baro
    assert without.mag is None


def test_result_is_exact_in_single_precision() -> None:
    errors = SensorErrors((0.1, 0.2, 0.3), 0.1, 0.7, (0.1, 0.2, 0.3), 0.1, 0.7, 0.1, 0.1, 0.1)
    assert all(map(is_single, run(errors, passes=100)))


def test_delta_is_rounded_to_single_precision() -> None:
    delta = exact_delta((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), 0.0025)
    assert delta.del_vel.tolist() == [float(np.float32(number)) for number in (0.1, 0.2, 0.3)]
    assert delta.del_ang.tolist() == [float(np.float32(number)) for number in (0.4, 0.5, 0.6)]
    assert delta.del_vel_dt == delta.del_ang_dt == float(np.float32(0.0025))


def test_errors_are_read_from_assignments() -> None:
    texts = ["gyro_bias_deg_s=0.5", "accel_bias_m_s2 = 0.1,-0.2, 0", "baro_noise_m=0.1", "baro_noise_m=0.2"]
    expected = SensorErrors(gyro_bias_deg_s=(0.5, 0.5, 0.5), accel_bias_m_s2=(0.1, -0.2, 0.0), baro_noise_m=0.2)
    assert parse_errors(texts) == expected
    assert parse_errors([]) == NO_ERRORS


@pytest.mark.parametrize("other", [[], ["gyro_bias_deg_s=0"], ["accel_scale_percent=1", "baro_noise_m=1"]])
def test_several_imus_without_what_makes_them_differ_are_refused(other: list[str]) -> None:
    with pytest.raises(
        InputError, match=r"^--imu-error imus=2: IMUs differ by one of gyro_bias_deg_s, .*; none is given"
    ):
        parse_errors(["imus=2", *other])
    assert parse_errors(["imus=1", *other]).imus == 1
    assert parse_errors(["imus=2", "accel_bias_m_s2=0,0,0.1", *other]).imus == 2


def test_several_imus_err_each_in_its_own_way() -> None:
    errors = SensorErrors(gyro_bias_deg_s=(1.0, 2.0, 3.0), accel_noise_m_s2_rthz=0.1)
    alone = run(errors, passes=20)
    several = run(replace(errors, imus=3.0), passes=20)
    assert [len(one.imus) for one in alone] == [0] * 20
    assert [one.imus[0].delta.del_vel.tolist() for one in several] == [one.delta.del_vel.tolist() for one in alone]
    turned = [np.degrees(imu.delta.del_ang / DT) - [math.degrees(0.1), 0.0, 0.0] for imu in several[0].imus]
    assert turned[0] == pytest.approx([1.0, 2.0, 3.0], abs=1e-4)
    assert np.abs(turned) == pytest.approx(np.tile([1.0, 2.0, 3.0], (3, 1)), abs=1e-4)
    assert len({tuple(imu.delta.del_vel.tolist()) for one in several for imu in one.imus}) == 60


def test_imus_that_differ_already_err_each_for_itself() -> None:
    one = sensors()
    slower = replace(one.delta, del_ang=0.5 * one.delta.del_ang)
    spoilt = ErrorModel(SensorErrors(gyro_bias_deg_s=(1.0, 0.0, 0.0))).apply(
        replace(one, imus=(ImuReading(one.delta), ImuReading(slower, has_accel=False)))
    )
    first, second = (abs(imu.delta.del_ang[0] / DT - rate) for imu, rate in zip(spoilt.imus, (0.1, 0.05), strict=True))
    assert (first, second) == (pytest.approx(math.radians(1)), pytest.approx(math.radians(1)))
    assert spoilt.delta is spoilt.imus[0].delta
    assert not spoilt.imus[1].has_accel


def test_ideal_imus_are_left_alone_however_many() -> None:
    given = sensors()
    assert ErrorModel(SensorErrors(imus=2.0)).apply(given) is given


@pytest.mark.parametrize(("text", "error"), [
    ("gyro_bias=1", f"no such error; there are {NAMES}"),
    ("", f"no such error; there are {NAMES}"),
    ("imus=4", "not from 1 to 3"),
    ("baro_bias_m", "not NAME=NUMBER"),
    ("baro_bias_m=", "not NAME=NUMBER"),
    ("baro_bias_m=high", "not NAME=NUMBER"),
    ("baro_bias_m=1,2,3", "not NAME=NUMBER"),
    ("gyro_bias_deg_s=1,2", "not NAME=NUMBER or NAME=X,Y,Z"),
    ("gyro_bias_deg_s=1,2,", "not NAME=NUMBER or NAME=X,Y,Z"),
    ("gyro_bias_deg_s=1,2,nan", "not from -1000 to 1000"),
    ("accel_scale_percent=inf", "not from -1000 to 1000"),
    ("accel_noise_m_s2_rthz=-1", "not from 0 to 1000"),
    ("baro_noise_m=1001", "not from 0 to 1000"),
])  # fmt: skip
def test_unusable_assignment_is_refused(text: str, error: str) -> None:
    with pytest.raises(InputError) as raised:
        parse_errors([text])
    assert str(raised.value) == f"--imu-error {text!r}: {error}"
