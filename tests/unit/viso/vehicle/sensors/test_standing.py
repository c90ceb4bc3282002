# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle on the bench feels gravity alone, and its slow sensors say the same at the recorded rate."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.location import Location
from ekf_stub.inputs.sensors import Sensors
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import BenchSource

G = 9.80665
LOOP_US = 2500


def sense(source: BenchSource, now_us: int) -> Sensors:
    sensors = source.sense(now_us)
    assert sensors is not None
    return sensors


def test_level_vehicle_feels_gravity_along_its_axis() -> None:
    delta = sense(BenchSource(ImuOptions(heading_rad=1.0)), 1_000_000).delta
    assert delta.del_vel == pytest.approx([0, 0, -G * 0.0025], abs=1e-9)
    assert delta.del_ang.tolist() == [0, 0, 0]
    assert delta.del_vel_dt == delta.del_ang_dt == float(np.float32(0.0025))


@given(st.floats(-math.pi, math.pi), st.floats(-1.5, 1.5))
def test_gravity_tells_roll_and_pitch(roll: float, pitch: float) -> None:
    x, y, z = sense(BenchSource(ImuOptions(), roll_rad=roll, pitch_rad=pitch), LOOP_US).delta.del_vel / (G * 0.0025)
    assert math.asin(max(-1.0, min(x, 1.0))) == pytest.approx(pitch, abs=1e-5)
    assert math.remainder(math.atan2(-y, -z) - roll, 2 * math.pi) == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize(("interval_us", "dt"), [
    (2499, 0.002499), (5000, 0.005), (100, 0.000625), (10_000_000, 0.01)
])  # fmt: skip
def test_interval_is_that_since_the_last_pass_within_limits(interval_us: int, dt: float) -> None:
    source = BenchSource(ImuOptions())
    sense(source, 1_000_000)
    delta = sense(source, 1_000_000 + interval_us).delta
    assert delta.del_vel_dt == pytest.approx(dt, rel=1e-6)
    assert delta.del_vel[2] == pytest.approx(-G * dt, rel=1e-6)


def test_time_that_has_been_brings_nothing_new() -> None:
    source = BenchSource(ImuOptions())
    sense(source, 1_000_000)
    assert source.sense(1_000_000) is None
    assert source.sense(999_999) is None
    assert sense(source, 1_002_500).delta.del_vel_dt == pytest.approx(0.0025)


def test_slow_sensors_are_read_every_100_ms() -> None:
    source = BenchSource(ImuOptions(has_compass=lambda: True))
    seen: dict[tuple[tuple[int, float], int], int] = {}
    for now_us in range(0, 400_000, LOOP_US):
        sensors = sense(source, now_us)
        if sensors.baro is not None:
            assert sensors.mag is not None
            seen.setdefault((sensors.baro, sensors.mag[0]), now_us)
    readings = [((stamp, 0.0), 1000 * stamp) for stamp in (50, 150, 250, 350)]
    assert seen == {reading: reading[1] + LOOP_US for reading in readings}


def test_compass_is_there_when_it_is_in_use() -> None:
    in_use = False
    source = BenchSource(ImuOptions(heading_rad=math.pi / 2, has_compass=lambda: in_use))
    assert sense(source, 1_000_000).mag is None
    in_use = True
    assert sense(source, 1_002_500).mag is None  # until it is read again
    mag = sense(source, 1_052_500).mag
    assert mag is not None
    assert mag[1] == pytest.approx([0.0, -238.08746, -528.91174], abs=1e-4)


def test_compass_feels_the_field_of_the_origin() -> None:
    source = BenchSource(ImuOptions(has_compass=lambda: True))
    assert sense(source, 1_000_000).declination == 0.0
    source.stand_at(Location(473977420, 85455940, 0))  # Zurich
    sensors = sense(source, 1_052_500)
    assert sensors.mag is not None
    assert sensors.mag[1] == pytest.approx([217.51, 12.12, 429.56], abs=0.01)
    assert sensors.declination == pytest.approx(math.atan2(12.12, 217.51), abs=1e-4)


def test_nothing_new_is_made_while_nothing_changes() -> None:
    source = BenchSource(ImuOptions(has_compass=lambda: True))
    passes = [sense(source, now_us) for now_us in range(1_000_000, 2_000_000, LOOP_US)]
    assert len(set(map(id, passes))) == 11  # one, and one for each reading


def test_arming_does_not_move_it() -> None:
    source = BenchSource(ImuOptions(heading_rad=0.5))
    before = sense(source, 1_000_000).delta
    source.set_armed(True)
    assert np.array_equal(sense(source, 1_002_500).delta.del_vel, before.del_vel)
    assert source.yaw_rad() == 0.5


def test_errors_are_drawn_anew_for_every_pass() -> None:
    source = BenchSource(ImuOptions(errors=SensorErrors(gyro_noise_deg_s_rthz=0.1), seed=3))
    angles = {tuple(sense(source, now_us).delta.del_ang.tolist()) for now_us in range(0, 250_000, LOOP_US)}
    assert len(angles) == 100
