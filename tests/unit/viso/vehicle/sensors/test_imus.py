# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""IMUs of a vehicle that flies, each with its calibration."""

import numpy as np
import pytest

from ap_core.param import ParamTable
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.inputs.sensors import Sensors
from viso.parameters.table import make_groups
from viso.vehicle.sensors.errors import NO_ERRORS, SensorErrors
from viso.vehicle.sensors.imus import calibrated, calibrations_of
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions

PASS_US = 2500
NOISY = SensorErrors(gyro_noise_deg_s_rthz=0.01)


def params_with(**values: float) -> ParamTable:
    params = ParamTable(make_groups(1))
    for name, value in values.items():
        params.set(name, value)
    return params


def source_with(errors: SensorErrors = NO_ERRORS, **values: float) -> FlyingSource:
    return FlyingSource(ImuOptions(params=params_with(**values), with_each_imu=True, errors=errors))


def sensed(source: FlyingSource, now_us: int) -> Sensors:
    sensors = source.sense(now_us)
    assert sensors is not None
    return sensors


def accelerations(sensors: Sensors) -> list[list[float]]:
    return [(one.delta.del_vel / one.delta.del_vel_dt).round(4).tolist() for one in sensors.imus]


def test_what_is_measured_is_less_the_offset_and_then_scaled() -> None:
    source = source_with(INS_ACCOFFS_X=5, INS_ACCOFFS_Y=-1, INS_ACC2SCAL_Z=1.1)
    first, second = accelerations(sensed(source, PASS_US))
    assert first == pytest.approx([-5, 1, -GRAVITY_MSS], abs=1e-3)
    assert second == pytest.approx([0, 0, -1.1 * GRAVITY_MSS], abs=1e-3)


def test_first_of_them_is_the_vehicles() -> None:
    sensors = sensed(source_with(INS_ACCOFFS_X=5), PASS_US)
    assert sensors.delta is sensors.imus[0].delta


def test_calibration_counts_from_the_next_pass_on() -> None:
    params = params_with()
    source = FlyingSource(ImuOptions(params=params, with_each_imu=True))
    sensed(source, PASS_US)
    params.set("INS_ACCOFFS_X", 2)
    assert accelerations(sensed(source, 2 * PASS_US))[0][0] == pytest.approx(-2, abs=1e-3)


@pytest.mark.parametrize(("count", "imus"), [(0, 1), (1, 1), (2, 2), (3, 3), (9, 3)])
def test_there_are_as_many_as_the_simulator_has(count: int, imus: int) -> None:
    assert len(sensed(source_with(SIM_IMU_COUNT=count), PASS_US).imus) == imus


def test_all_have_the_same_data_unless_asked_for() -> None:
    source = FlyingSource(ImuOptions(params=params_with(INS_ACCOFFS_X=5)))
    sensors = sensed(source, PASS_US)
    assert sensors.imus == ()
    assert sensors.delta.del_vel[0] == 0.0


def test_each_has_noise_of_its_own() -> None:
    first, second = (one.delta.del_ang for one in sensed(source_with(NOISY), PASS_US).imus)
    assert not np.array_equal(first, second)


@pytest.mark.parametrize("errors", [NO_ERRORS, NOISY], ids=["ideal", "noisy"])
def test_same_is_told_ahead(errors: SensorErrors) -> None:
    one_by_one, ahead = (source_with(errors, INS_ACCOFFS_X=5, INS_ACC2SCAL_X=1.2) for _ in range(2))
    for source in (one_by_one, ahead):
        for now_us in range(PASS_US, 60_000, PASS_US):
            sensed(source, now_us)
    times_us = range(60_000, 80_000, PASS_US)
    rows = [
        [*(one.delta.del_vel), *one.delta.del_ang] for now_us in times_us for one in sensed(one_by_one, now_us).imus
    ]
    told = ahead.ahead(times_us)
    assert told.shape == (len(times_us), 16)
    assert told.reshape(-1, 8)[:, :6].tolist() == np.array(rows).tolist()


def test_data_of_several_imus_stay_apart() -> None:
    rows = np.arange(16.0).reshape(1, 16)
    calibrations = calibrations_of(params_with(INS_ACC2OFFS_X=1))()
    assert calibrated(rows, calibrations).tolist() == [[*range(8), 8.0 - 14.0, *range(9, 16)]]
