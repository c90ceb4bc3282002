# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Barometers of the firmware's simulator, and which of them a vehicle that flies goes by."""

import pytest

from ap_core.param import ParamTable
from ekf_stub.inputs.measurements import BaroReading
from ekf_stub.inputs.sensors import Sensors
from viso.parameters.table import make_groups
from viso.vehicle.sensors.barometers import SimulatedBarometer
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions

STEP_MS = 100


class Rig:
    """A barometer that is read ten times per second, and its first reading taken, at the height 0."""

    def __init__(self, **values: float) -> None:
        self.params = ParamTable(make_groups(1))
        self.now_ms = 50
        self._barometer = SimulatedBarometer(self.params.group("SIM_BARO_"), 0, 0)
        self.set(**values)
        self.height_m = 0.0
        self.read()

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self.params.set(f"SIM_BARO_{name}", value)

    def read(self, times: int = 1) -> BaroReading:
        for _ in range(times):
            reading = self._barometer.read(self.now_ms, self.height_m)
            self.now_ms += STEP_MS
        return reading


def test_ideal_one_tells_the_height() -> None:
    rig = Rig()
    rig.height_m = 12.5
    assert rig.read() == BaroReading(150, 12.5)


def test_glitch_is_added_but_for_what_there_was_at_boot() -> None:
    rig = Rig(GLITCH=3)
    assert rig.read().height == 0.0
    rig.set(GLITCH=10)
    assert rig.read().height == pytest.approx(7.0)


def test_height_drifts() -> None:
    rig = Rig(DRIFT=0.5)
    assert rig.read(20).height == pytest.approx(1.0)


def test_noise_is_within_its_limits() -> None:
    rig = Rig(RND=0.2)
    heights = [rig.read().height for _ in range(200)]
    assert 0.3 < max(heights) - min(heights) <= 0.4


def test_frozen_one_repeats_its_last_height() -> None:
    rig = Rig()
    rig.height_m = 2.0
    rig.read()
    rig.set(FREEZE=1)
    rig.height_m = 5.0
    assert rig.read() == BaroReading(250, 2.0)


def test_disabled_one_keeps_its_reading_and_fails_after_half_a_second() -> None:
    rig = Rig()
    rig.set(DISABLE=1)
    rig.height_m = 5.0
    assert [rig.read() for _ in range(5)] == [
        *[BaroReading(50, 0.0)] * 4,
        BaroReading(50, 0.0, is_healthy=False),
    ]
    rig.set(DISABLE=0)
    assert rig.read() == BaroReading(650, 5.0)


@pytest.mark.parametrize(("delay_ms", "height_m"), [(100, 4.0), (250, 2.5), (499, 0.01)])
def test_late_one_tells_a_height_of_before(delay_ms: int, height_m: float) -> None:
    rig = Rig(DELAY=delay_ms)
    for height in range(1, 6):
        rig.height_m = float(height)
        reading = rig.read()
    assert reading.height == pytest.approx(height_m)


def sensed(now_us: int = 160_000, **values: float) -> Sensors:
    params = ParamTable(make_groups(1))
    params.set("SIM_BAR2_RND", 0)
    source = FlyingSource(ImuOptions(params=params))
    sensors = source.sense(60_000)
    for name, value in values.items():
        params.set(name, value)
    for time_us in range(160_000, now_us + 1, 100_000):
        sensors = source.sense(time_us)
    assert sensors is not None
    return sensors


def test_vehicle_has_two_of_which_the_first_counts() -> None:
    sensors = sensed(SIM_BARO_GLITCH=4, SIM_BAR2_GLITCH=7)
    assert sensors.baros == (BaroReading(150, 4.0), BaroReading(150, 7.0))
    assert sensors.baro == (150, 4.0)


def test_second_counts_when_the_first_has_failed() -> None:
    sensors = sensed(760_000, SIM_BARO_DISABLE=1, SIM_BAR2_GLITCH=7)
    assert sensors.baro == (750, 7.0)


def test_without_barometers_there_is_no_height() -> None:
    params = ParamTable(make_groups(1))
    params.set("SIM_BARO_COUNT", 0)
    sensors = FlyingSource(ImuOptions(params=params)).sense(160_000)
    assert sensors is not None
    assert (sensors.baro, sensors.baros) == (None, ())
