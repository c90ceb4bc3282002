# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator's range finder, by its range (RNGFND1_TYPE 100) and by its voltage (1)."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.clock import VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ap_core.rotations import Rotation
from ekf_stub.inputs.measurements import DOWNWARD, RangeStatus
from viso.firmware.releases import JULY_2025, PROFILES, Firmware
from viso.parameters.table import make_groups
from viso.vehicle.ranges import RANGE_PERIOD_US, RangeFinders
from viso.vehicle.sensors.airframe import AirframeState
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.simulated_ranges import SimulatedRanges

ANALOG = {"RNGFND1_TYPE": 1, "RNGFND1_MIN": 0, "RNGFND1_MAX": 40, "RNGFND1_SCALING": 12.12, "RNGFND1_PIN": 0}
"""As the firmware's own tests set it up."""


class Rig:
    """A range finder of type 100, unless told otherwise, on a vehicle in some state."""

    def __init__(self, params: Mapping[str, float] = MappingProxyType({}), firmware: Firmware = JULY_2025) -> None:
        source = FlyingSource(ImuOptions())
        self.airframe = source.airframe
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(1, None, firmware.params))
        for name, value in {"RNGFND1_TYPE": 100, **params}.items():
            self.params.set(name, value)
        self.records: list[dict[str, Any]] = []
        simulated = SimulatedRanges(self.airframe, source, self.params)
        self.ranges = RangeFinders(self.clock, self.params, self, firmware.params.range_unit, simulated)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        structure.pack(values)
        self.records.append(dict(zip(structure.fields, values, strict=True)))

    def see(self, height_m: float, roll_deg: float = 0.0, pitch_deg: float = 0.0) -> tuple[Any, RangeStatus]:
        """Return range and status at a height and attitude."""
        rpy = math.radians(roll_deg), math.radians(pitch_deg), 0.5
        self.airframe.state = AirframeState(pos=(9.0, -4.0, -height_m), rpy=rpy)
        self.clock.set_us(self.clock.micros64() + RANGE_PERIOD_US)
        self.ranges.update()
        state = self.ranges.state()
        assert state is not None
        return state.finders[0].distance, RangeStatus(state.finders[0].status)


@pytest.mark.parametrize(("height_m", "seen"), [
    (0.0, (0.0, RangeStatus.TOO_NEAR)),
    (-0.02, (0.0, RangeStatus.TOO_NEAR)),
    (5.0, (5.0, RangeStatus.GOOD)),
    (7.5, (7.5, RangeStatus.TOO_FAR)),
])  # fmt: skip
def test_range_is_the_height(height_m: float, seen: tuple[float, RangeStatus]) -> None:
    distance, status = Rig().see(height_m)
    assert (distance, status) == (pytest.approx(seen[0], abs=0.011), seen[1])


@pytest.fixture(scope="module")
def tilting() -> Rig:
    """Return a range finder for many attitudes."""
    return Rig()


@given(roll_deg=st.floats(-89.0, 89.0), pitch_deg=st.floats(-60.0, 60.0))
def test_tilt_lengthens_the_range(tilting: Rig, roll_deg: float, pitch_deg: float) -> None:
    upright = math.cos(math.radians(roll_deg)) * math.cos(math.radians(pitch_deg))
    assert tilting.see(3.0, roll_deg, pitch_deg)[0] == pytest.approx(3.0 / upright, abs=0.011 / upright)


def test_nothing_is_in_sight_upside_down_or_beyond_100_km() -> None:
    rig = Rig()
    rig.see(3.0)
    assert rig.see(5.0, roll_deg=100.0) == (pytest.approx(3.0, abs=0.011), RangeStatus.NO_DATA)
    assert rig.see(100_001.0)[1] is RangeStatus.NO_DATA
    assert rig.ranges.failure() == "Rangefinder 1: No Data"


def test_it_looks_where_it_is_told_to() -> None:
    rig = Rig({"SIM_SONAR_ROT": Rotation.PITCH_315})
    assert rig.see(3.0)[0] == pytest.approx(3.0 * math.sqrt(2), abs=0.02)
    assert rig.see(3.0, pitch_deg=-45.0)[0] == pytest.approx(3.0, abs=0.011)
    assert rig.see(3.0, pitch_deg=60.0)[1] is RangeStatus.NO_DATA
    rig.params.set("SIM_SONAR_ROT", Rotation.NONE)
    assert rig.see(3.0, pitch_deg=-90.0)[1] is RangeStatus.NO_DATA


def test_it_sits_where_it_is_told_to() -> None:
    rig = Rig({"SIM_SONAR_POS_X": 1.0, "SIM_SONAR_POS_Z": 0.5})
    assert rig.see(3.0)[0] == pytest.approx(2.5, abs=0.011)
    low = 3.0 + math.sin(math.radians(20)) - 0.5 * math.cos(math.radians(20))
    assert rig.see(3.0, pitch_deg=20)[0] == pytest.approx(low / math.cos(math.radians(20)), abs=0.011)


def test_noise_is_as_large_as_asked() -> None:
    rig = Rig({"SIM_SONAR_RND": 0.5})
    seen = [rig.see(4.0)[0] for _ in range(200)]
    assert 3.49 < min(seen) < 3.6
    assert 4.4 < max(seen) < 4.51
    assert np.mean(seen) == pytest.approx(4.0, abs=0.1)
    assert min(rig.see(0.0)[0] for _ in range(20)) == 0.0


def test_what_is_logged_and_told() -> None:
    rig = Rig()
    rig.see(5.0)
    (record,), (report,) = rig.records, rig.ranges.reports()
    assert (record["Dist"], record["Stat"], record["Orient"], record["Quality"]) == (
        pytest.approx(5.0, abs=0.011),
        RangeStatus.GOOD,
        DOWNWARD,
        -1,
    )
    assert (report.kind, report.quality, report.most) == (4, -1, 7.0)


@pytest.mark.parametrize("firmware", [*PROFILES.values()], ids=[*PROFILES])
def test_every_release_has_it(firmware: Firmware) -> None:
    unit = firmware.params.range_unit
    rig = Rig({f"RNGFND1_{unit.most}": 30 / float(unit.metres)}, firmware)
    distance, status = rig.see(20.0)
    assert (distance, status) == (pytest.approx(20.0, abs=0.02), RangeStatus.GOOD)


# By its voltage


@pytest.mark.parametrize("height_m", [0.0, 0.5, 10.0, 35.0])
def test_voltage_means_the_range_in_whole_millivolts(height_m: float) -> None:
    rig = Rig(ANALOG)
    distance, status = rig.see(height_m)
    assert status is RangeStatus.GOOD
    millivolts = distance / 12.12 * 1000
    assert millivolts == pytest.approx(round(millivolts), abs=1e-3)
    assert distance == pytest.approx(height_m, abs=0.025)
    down = rig.ranges.downward()
    assert down is not None
    assert down[0] == distance
    assert down[1] == pytest.approx(1e-3 * millivolts)


def test_voltage_ends_at_5_volts() -> None:
    rig = Rig(ANALOG)
    assert rig.see(80.0) == (pytest.approx(60.6), RangeStatus.TOO_FAR)
    assert rig.see(5.0, roll_deg=120.0) == (pytest.approx(60.6), RangeStatus.TOO_FAR)


@pytest.mark.parametrize(("function", "offset", "metres"), [
    (0, 0.0, 10.0), (0, 0.5, 5.0), (0, 2.0, 0.0), (1, 2.5, 15.0), (1, 0.0, 0.0), (2, 0.0, 10.0), (2, 1.0, 0.0),
    (2, 0.99, 40.0), (3, 0.0, 0.0),
])  # fmt: skip
def test_functions_of_the_voltage(function: int, offset: float, metres: float) -> None:
    params = {"RNGFND1_SCALING": 10.0, "RNGFND1_FUNCTION": function, "RNGFND1_OFFSET": offset, "SIM_SONAR_SCALE": 10.0}
    assert Rig({**ANALOG, **params}).see(10.005)[0] == pytest.approx(metres, abs=0.03)


def test_glitches_are_as_likely_as_asked() -> None:
    rig = Rig({**ANALOG, "SIM_SONAR_GLITCH": 0.25})
    glitches = sum(rig.see(5.0)[0] > 60 for _ in range(400))
    assert 60 < glitches < 140
    rig.params.set("SIM_SONAR_GLITCH", 1.0)
    assert all(rig.see(5.0)[0] > 60 for _ in range(20))


def test_there_is_no_voltage_on_other_pins() -> None:
    assert Rig({**ANALOG, "RNGFND1_PIN": 13}).see(5.0) == (0.0, RangeStatus.GOOD)


def test_it_needs_a_pin() -> None:
    rig, none = Rig(ANALOG), Rig({**ANALOG, "RNGFND1_PIN": -1})
    rig.see(5.0)
    rig.params.set("RNGFND1_PIN", -1)
    assert rig.see(5.0)[0] == 0.0
    assert rig.ranges.failure() == "RNGFND1_PIN not set"
    assert none.ranges.failure() == "Rangefinder 1: Not Detected"
