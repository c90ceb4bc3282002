# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator's flow sensor (FLOW_TYPE 10), and a vehicle that flies by it and by the simulator's range finder."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
import pytest

from ap_core.clock import NEVER, VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.measurements import FlowMeasurement
from mav_handlers.senders.ground import optical_flow
from mav_handlers.senders.position import global_position_int
from mav_handlers.senders.sys_status import SENSOR_LASER_POSITION, SENSOR_OPTICAL_FLOW, sensor_bits
from mav_handlers.wire.messages import OPTICAL_FLOW, RC_CHANNELS_OVERRIDE
from viso.firmware.log_releases import OF
from viso.parameters.table import make_groups
from viso.testing import Autopilot, AutopilotOptions
from viso.testing.golden import GoldenFiles
from viso.vehicle.copter.modes import ModeNumber
from viso.vehicle.flow import OpticalFlow
from viso.vehicle.sensors.airframe import AirframeState
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.simulated_flow import SimulatedFlow

if TYPE_CHECKING:
    from pathlib import Path

UPDATE_MS = 5
STILL = (0.0, 0.0, 0.0)


class Rig:
    """A flow sensor without noise, unless told otherwise, on a vehicle in some state."""

    def __init__(self, **params: float) -> None:
        source = FlyingSource(ImuOptions())
        self.airframe = source.airframe
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(1, None))
        for name, value in {"FLOW_TYPE": 10, "SIM_FLOW_ENABLE": 1, "SIM_FLOW_RND": 0, **params}.items():
            self.params.set(name, value)
        self.measured: list[tuple[FlowMeasurement, int]] = []
        self.records: list[dict[str, Any]] = []
        simulated = SimulatedFlow(self.clock, self.airframe, source, self.params)
        self.flow = OpticalFlow(self.clock, self.params, cast(AhrsBase, self), self, simulated=simulated)
        self.clock.set_us(3_000_000)

    def write_flow(self, measured: FlowMeasurement, time_ms: int) -> None:
        """Remember what is handed over (AhrsBase)."""
        self.measured.append((measured, time_ms))

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        assert structure is OF
        structure.pack(values)
        self.records.append(dict(zip(structure.fields, values, strict=True)))

    def run_ms(self, duration_ms: int) -> None:
        for _ in range(duration_ms // UPDATE_MS):
            self.clock.set_us(self.clock.micros64() + 1000 * UPDATE_MS)
            self.flow.update()

    def be(self, height_m: float, vel: Any = STILL, rpy: Any = STILL, rates: Any = STILL) -> None:
        """Be somewhere, with a velocity, attitude and body rates."""
        self.airframe.state = AirframeState((0.0, 0.0, -height_m), vel, rpy)
        self.airframe.felt = lambda: (STILL, rates)  # type: ignore[method-assign]

    def see(self, *state: Any) -> FlowMeasurement:
        """Return what is measured in a state."""
        self.be(*state)
        self.run_ms(100)
        return self.measured[-1][0]


@pytest.mark.parametrize(("state", "flow"), [
    ((5.0, (2.0, 0.0, 0.0)), (0.0, 0.4)),
    ((5.0, (0.0, 2.0, 0.0)), (-0.4, 0.0)),
    ((10.0, (2.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2)), (0.2, 0.0)),
    ((10.0, (0.0, 0.0, 3.0)), (0.0, 0.0)),
    ((10.0, (2.0, 0.0, 0.0), STILL, (0.3, -0.1, 5.0)), (0.3, 0.1)),
    ((5.0, (2.0, 0.0, 0.0), (0.5, 0.0, 0.0)), (0.0, 0.4 * math.cos(0.5))),
    ((5.0, (0.0, 2.0, 0.0), (0.5, 0.0, 0.0)), (-0.4 * math.cos(0.5) ** 2, 0.0)),
])  # fmt: skip
def test_flow_is_that_of_motion_and_rotation(state: Any, flow: tuple[float, float]) -> None:
    measured = Rig().see(*state)
    assert measured.flow == pytest.approx(flow, abs=2e-3)
    assert measured.gyro == pytest.approx(state[3][:2] if len(state) > 3 else (0.0, 0.0))
    assert measured.quality == 51


@pytest.mark.parametrize(
    "state", [(0.0, (2.0, 0.0, 0.0)), (-0.1, (2.0, 0.0, 0.0)), (5.0, (2.0, 0.0, 0.0), (1.6, 0, 0))]
)
def test_ground_that_is_not_seen_does_not_move(state: Any) -> None:
    assert Rig().see(*state).flow == pytest.approx((0.0, 0.0), abs=1e-6)


def test_sensor_sits_where_the_simulator_is_told_to() -> None:
    turning = (5.0, STILL, STILL, (0.0, 0.0, 2.0))
    rig = Rig(SIM_FLOW_POS_X=0.5, SIM_FLOW_POS_Z=1.0)
    assert rig.see(*turning).flow == pytest.approx((-1.0 / 4.0, 0.0), abs=1e-3)
    assert rig.measured[-1][0].offset == (0.0, 0.0, 0.0)


def test_axes_are_scaled_and_turned_as_parameters_say() -> None:
    rig = Rig(FLOW_FXSCALER=100, FLOW_FYSCALER=-200, FLOW_ORIENT_YAW=9000)
    assert rig.see(5.0, (2.0, 1.0, 0.0)).flow == pytest.approx((-0.4 * 0.8, -0.2 * 1.1), abs=2e-3)


@pytest.mark.parametrize(("hertz", "period_ms"), [(10, 100), (20, 50), (30, 35), (400, 5)])
def test_it_measures_as_often_as_asked(hertz: int, period_ms: int) -> None:
    rig = Rig(SIM_FLOW_RATE=hertz)
    rig.be(5.0)
    rig.run_ms(1000)
    times = [time_ms for _, time_ms in rig.measured]
    assert set(np.diff(times)) == {period_ms}
    assert [record["Qual"] for record in rig.records] == [51] * len(times)


@pytest.mark.parametrize("params", [{"SIM_FLOW_ENABLE": 0}, {"SIM_FLOW_RATE": 0}, {"FLOW_TYPE": 1}])
def test_it_measures_nothing_unless_it_is_on(params: dict[str, float]) -> None:
    rig = Rig(**params)
    rig.run_ms(1000)
    assert not rig.measured
    assert not rig.flow.healthy()
    assert rig.flow.enabled()


def test_it_is_healthy_while_it_is_on() -> None:
    rig = Rig()
    rig.run_ms(100)
    assert rig.flow.healthy()
    rig.params.set("SIM_FLOW_ENABLE", 0)
    rig.run_ms(505)
    assert not rig.flow.healthy()


def test_updates_may_be_left_out_until_it_says_that_it_is_not_idle() -> None:
    rig = Rig()
    rig.run_ms(5)
    last_us = 1000 * rig.measured[-1][1]
    assert rig.flow.idle_until_us() == last_us + 100_000
    rig.params.set("SIM_FLOW_ENABLE", 0)
    assert rig.flow.idle_until_us() == last_us + 500_000
    rig.run_ms(500)
    assert rig.flow.idle_until_us() == NEVER


def test_delay_is_of_so_many_measurements_once_they_are_filled() -> None:
    rig = Rig(SIM_FLOW_DELAY=3)
    flows = [rig.see(10.0, (float(speed), 0.0, 0.0)) for speed in range(1, 12)]
    # The firmware's buffer is filled with the first but for its last place.
    assert [round(10 * one.flow[1]) for one in flows] == [1, 1, 1, 0, 2, 3, 4, 5, 6, 7, 8]
    assert [one.quality for one in flows] == [51, 51, 51, 0, *[51] * 7]


@pytest.mark.parametrize("delay", [-5, 20, 100])
def test_delay_beyond_the_buffer_is_no_longer_than_that(delay: int) -> None:
    rig = Rig(SIM_FLOW_DELAY=delay)
    flows = [rig.see(10.0, (float(speed), 0.0, 0.0)) for speed in range(1, 42)]
    assert round(10 * flows[-1].flow[1]) == (41 if delay < 0 else 21)


def test_noise_is_as_large_as_asked() -> None:
    rig = Rig(SIM_FLOW_RND=0.05, SIM_FLOW_RATE=200)
    rig.be(5.0)
    rig.run_ms(2000)
    flows = np.array([measured.flow for measured, _ in rig.measured])
    assert 0.045 < np.abs(flows).max() <= 0.05
    assert np.abs(flows.mean(axis=0)).max() < 0.01


def test_messages_are_not_for_it() -> None:
    assert not Rig().flow.take(OPTICAL_FLOW(0, 0, 1, 1, 0.0, 0.0, 100, 0.0))


# Flights

BY_FLOW: Final = {
    "GPS1_TYPE": 0,
    "VISO_TYPE": 0,
    "COMPASS_ENABLE": 1,
    "EK3_SRC1_POSXY": 0,
    "EK3_SRC1_VELXY": 5,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 0,
    "EK3_SRC1_YAW": 1,
    "FLOW_TYPE": 10,
    "SIM_FLOW_ENABLE": 1,
}
WITH_RANGES: Final = {
    **BY_FLOW,
    "RNGFND1_TYPE": 1,
    "RNGFND1_MIN": 0,
    "RNGFND1_MAX": 40,
    "RNGFND1_SCALING": 12.12,
    "RNGFND1_PIN": 0,
}
IGNORED = 65535


class Pilot:
    """Flies a vehicle by its sticks."""

    def __init__(self, folder: "Path", params: dict[str, float]) -> None:
        options = AutopilotOptions(imu="fly", firmware="2025-07", params=params)
        self.autopilot = Autopilot(options, GoldenFiles(folder, update=False))
        self.vehicle = self.autopilot.vehicle
        self.sticks = [1500, 1500, 1000, 1500]
        self.autopilot.every(200, self._send)

    def _send(self) -> None:
        others = dict.fromkeys((f"chan{number}_raw" for number in range(5, 19)), IGNORED)
        roll, pitch, throttle, yaw = self.sticks
        self.autopilot.send(
            RC_CHANNELS_OVERRIDE(1, 1, roll, pitch, throttle, yaw, **others), system_id=255, component_id=190
        )

    def enter(self, mode: ModeNumber) -> bool:
        return self.vehicle.copter.set_mode(mode)

    def works(self, sensor: int) -> tuple[bool, bool, bool]:
        present, enabled, healthy = (mask & sensor != 0 for mask in sensor_bits(self.vehicle))
        return present, enabled, healthy

    def told(self) -> tuple[float, float]:
        """Return height above home and speed as GLOBAL_POSITION_INT tells them, m and m/s."""
        channel = self.vehicle.endpoint.channels[0]
        message = global_position_int(self.vehicle, channel, self.autopilot.now_us)
        assert message is not None
        return 1e-3 * message.relative_alt, 1e-2 * math.hypot(message.vx, message.vy)


@pytest.mark.slow
def test_flight_by_flow_keeps_speed_and_height_to_what_its_sensors_see(tmp_path: "Path") -> None:
    pilot = Pilot(tmp_path, WITH_RANGES)
    autopilot = pilot.autopilot
    autopilot.advance(s=25)
    assert pilot.works(SENSOR_OPTICAL_FLOW) == pilot.works(SENSOR_LASER_POSITION) == (True, True, True)
    assert pilot.enter(ModeNumber.ALT_HOLD)
    assert pilot.vehicle.copter.arm(do_checks=True)
    autopilot.advance(s=3)
    pilot.sticks[2] = 1800
    autopilot.advance(s=6)
    pilot.sticks[2] = 1500
    assert pilot.enter(ModeNumber.LOITER)
    autopilot.advance(s=2)
    low_m, _ = pilot.told()
    assert low_m == pytest.approx(-autopilot.truth.pos_ned[2], abs=0.3)
    pilot.sticks[1] = 1000
    speeds, heights = [], []
    for second in range(50):
        pilot.sticks[2] = 1500 if second < 15 else 1900
        autopilot.advance(s=1)
        height_m, speed_m_s = pilot.told()
        heights.append(height_m)
        speeds.append(speed_m_s)
        assert speed_m_s < 1.5 * height_m + 0.5
    assert speeds[10:15] == pytest.approx([1.5 * low_m] * 5, rel=0.06)
    assert heights[-1] == pytest.approx(0.7 * 40 - 1, abs=0.3)
    message = optical_flow(pilot.vehicle, pilot.vehicle.endpoint.channels[0], autopilot.now_us)
    assert message is not None
    flow_m_s = math.hypot(message.flow_comp_m_x, message.flow_comp_m_y) * heights[-1]
    assert flow_m_s == pytest.approx(math.hypot(*autopilot.truth.vel_ned[:2]), abs=2.0)
    autopilot.close()


@pytest.mark.slow
def test_flow_without_ranges_gives_no_position(tmp_path: "Path") -> None:
    pilot = Pilot(tmp_path, {**BY_FLOW, "GPS1_TYPE": 1})
    pilot.autopilot.advance(s=20)
    assert pilot.works(SENSOR_OPTICAL_FLOW) == (True, True, True)
    assert pilot.works(SENSOR_LASER_POSITION) == (False, False, False)
    assert pilot.enter(ModeNumber.LOITER)
    pilot.autopilot.advance(s=32)
    pilot.autopilot.assert_text("PreArm: Need Position Estimate")
    assert not pilot.vehicle.copter.arm(do_checks=True)
    pilot.autopilot.close()
