# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flow sensor: averages between updates, rates, log records and health."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.clock import VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.measurements import FlowMeasurement
from mav_handlers.wire.messages import OPTICAL_FLOW
from viso.firmware.log_releases import OF
from viso.firmware.releases import FEBRUARY_2026, JULY_2025, PROFILES, Firmware
from viso.parameters.sensors import FLOW_WITH_OPTIONS
from viso.parameters.table import make_groups
from viso.vehicle.flow import OpticalFlow

UPDATE_US = 5000


def flow(x: int, y: int = 0, quality: int = 100) -> OPTICAL_FLOW:
    return OPTICAL_FLOW(0, 0, x, y, 9.0, 9.0, quality, 9.0, 9.0, 9.0)


def in_rad_s(x: float, y: float = 0.0, quality: int = 100) -> OPTICAL_FLOW:
    """Return a message with rates in rad/s beside other flow_x and flow_y."""
    return OPTICAL_FLOW(0, 0, 100, -50, 9.0, 9.0, quality, 9.0, x, y)


class Rig:
    """A flow sensor of a release that is updated every 5 ms, on a vehicle with given body rates."""

    def __init__(self, flow_type: int = 5, firmware: Firmware = JULY_2025, **params: float) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(1, make_params(), firmware.params))
        for name, value in {"FLOW_TYPE": flow_type, **params}.items():
            self.params.set(name, value)
        self.gyro = Vector3f()
        self.records: list[dict[str, Any]] = []
        self.measured: list[tuple[FlowMeasurement, int]] = []
        ahrs = cast(AhrsBase, self)
        self.flow = OpticalFlow(self.clock, self.params, ahrs, self, reads_rates=firmware.reads_flow_rates)
        self.clock.set_us(3_000_000)

    def get_gyro(self) -> Vector3f:
        """Return the body rates (AhrsBase)."""
        return self.gyro

    def write_flow(self, measured: FlowMeasurement, time_ms: int) -> None:
        """Remember what is handed over (AhrsBase)."""
        self.measured.append((measured, time_ms))

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        assert structure is OF
        structure.pack(values)
        self.records.append(dict(zip(structure.fields, values, strict=True)))

    def run_us(self, duration_us: int) -> None:
        for _ in range(duration_us // UPDATE_US):
            self.clock.set_us(self.clock.micros64() + UPDATE_US)
            self.flow.update()

    def see(self, *packets: OPTICAL_FLOW) -> dict[str, Any]:
        """Hear messages at one moment and return the record of the next update."""
        self.see_unlogged(*packets)
        return self.records[-1]

    def see_unlogged(self, *packets: OPTICAL_FLOW) -> None:
        """Hear messages at one moment, and update."""
        for packet in packets:
            assert self.flow.take(packet)
        self.run_us(UPDATE_US)


@pytest.mark.parametrize("flow_type", [0, 1, 10])
def test_other_types_take_no_messages(flow_type: int) -> None:
    rig = Rig(flow_type)
    assert not rig.flow.take(flow(1))
    rig.run_us(50_000)
    assert rig.records == []
    assert not rig.flow.healthy()


def test_sensor_needs_its_type_at_boot() -> None:
    rig = Rig(flow_type=0)
    rig.params.set("FLOW_TYPE", 5)
    assert rig.flow.enabled()
    assert not rig.flow.take(flow(1))


def test_type_0_switches_it_off_while_it_lasts() -> None:
    rig = Rig()
    rig.params.set("FLOW_TYPE", 0)
    assert not rig.flow.take(flow(1))
    rig.params.set("FLOW_TYPE", 5)
    assert rig.flow.take(flow(1))


def test_nothing_is_logged_without_messages() -> None:
    rig = Rig()
    rig.run_us(1_000_000)
    assert rig.records == []


def test_first_flow_has_no_rates() -> None:
    rig = Rig()
    rig.gyro = Vector3f(1, 2, 3)
    record = rig.see(flow(100, -50))
    assert record == {"TimeUS": 3_005_000, "Qual": 100, "flowX": 0, "flowY": 0, "bodyX": 0, "bodyY": 0}


def test_rates_are_the_flow_times_the_interval() -> None:
    rig = Rig()
    rig.see(flow(0))
    rig.run_us(95_000)
    record = rig.see(flow(100, -50))
    assert (record["flowX"], record["flowY"]) == (pytest.approx(10.0), pytest.approx(-5.0))
    assert isinstance(record["flowX"], np.float32)


@pytest.mark.parametrize(("x", "y", "interval_us", "rates"), [
    (-3, 5, 34_986, (-0.020991599187254906, 0.034985996782779694)),
    (-6, -1, 47_481, (-0.05697719752788544, -0.009496199898421764)),
    (1, -47, 39_984, (0.007996799424290657, -0.37584957480430603)),
    (-1, 120, 39_984, (-0.007996799424290657, 0.9596158862113953)),
    (-82, 95, 39_984, (-0.655737578868866, 0.7596958875656128)),
    (-118, 85, 42_483, (-1.0025986433029175, 0.7222108840942383)),
    (-123, 61, 42_483, (-1.0450817346572876, 0.5182925462722778)),
])  # fmt: skip
def test_rates_are_those_of_a_recording(x: int, y: int, interval_us: int, rates: tuple[float, float]) -> None:
    rig = Rig(FLOW_FXSCALER=-800, FLOW_FYSCALER=-800)
    rig.see(flow(0))
    rig.clock.set_us(rig.clock.micros64() + interval_us - UPDATE_US)
    record = rig.see(flow(x, y))
    assert (float(record["flowX"]), float(record["flowY"])) == rates


@pytest.mark.parametrize(("yaw_cdeg", "rates"), [
    (9000, (5.0, 10.0)),
    (-9000, (-5.0, -10.0)),
    (18000, (-10.0, 5.0)),
    (4500, (15 / 2**0.5, 5 / 2**0.5)),
])  # fmt: skip
def test_flow_is_turned_as_the_sensor_is(yaw_cdeg: int, rates: tuple[float, float]) -> None:
    rig = Rig(FLOW_ORIENT_YAW=yaw_cdeg)
    rig.see(flow(0))
    rig.gyro = Vector3f(1, 2, 3)
    rig.run_us(95_000)
    record = rig.see(flow(100, -50))
    assert (record["flowX"], record["flowY"]) == pytest.approx(rates, abs=1e-5)
    assert (record["bodyX"], record["bodyY"]) == (1, 2)


def test_estimator_is_handed_what_is_logged() -> None:
    rig = Rig(FLOW_POS_X=0.5, FLOW_POS_Z=-0.25, LOG_BITMASK=0)
    rig.see_unlogged(flow(0))
    rig.gyro = Vector3f(1, -2, 9)
    rig.run_us(95_000)
    rig.see_unlogged(flow(100, -50, 77))
    _, (measured, time_ms) = rig.measured
    assert (measured.quality, measured.gyro, measured.offset) == (77, (1, -2), (0.5, 0.0, -0.25))
    assert measured.flow == pytest.approx((10.0, -5.0))
    assert time_ms == 3105
    assert rig.flow.newest is measured


def test_body_rates_are_averaged_since_the_last_flow() -> None:
    rig = Rig()
    rig.see(flow(0))
    rig.gyro = Vector3f(1, -2, 9)
    rig.run_us(5000)
    rig.gyro = Vector3f(3, -4, 9)
    record = rig.see(flow(1))
    assert (record["bodyX"], record["bodyY"]) == (2, -3)


def test_body_rates_are_averaged_over_1000_updates_at_most() -> None:
    rig = Rig()
    rig.gyro = Vector3f(1, 1, 0)
    rig.run_us(1000 * UPDATE_US)
    rig.gyro = Vector3f(3, 3, 0)
    rig.run_us(1000 * UPDATE_US)
    # As long a silence has no rates itself; the next flow restarts.
    assert rig.see(flow(1))["bodyX"] == 0
    assert rig.see(flow(1))["bodyX"] == 3


@pytest.mark.parametrize(("pause_us", "has_rates"), [(490_000, True), (495_000, False)])
def test_flow_after_half_a_second_of_silence_has_no_rates(pause_us: int, has_rates: bool) -> None:
    rig = Rig()
    rig.see(flow(0))
    rig.run_us(pause_us)
    assert bool(rig.see(flow(100))["flowX"]) is has_rates


@pytest.mark.slow
@given(
    packets=st.lists(
        st.builds(flow, st.integers(-32768, 32767), st.integers(-32768, 32767), st.integers(0, 255)),
        min_size=1,
        max_size=200,
    )
)
def test_flow_and_quality_are_averaged_between_updates(packets: list[OPTICAL_FLOW]) -> None:
    rig = Rig()
    rig.see(flow(0))
    rig.run_us(95_000)
    record = rig.see(*packets)
    count = len(packets)
    assert record["Qual"] == sum(packet.quality for packet in packets) // count
    assert float(record["flowX"]) == pytest.approx(sum(packet.flow_x for packet in packets) / count * 0.1, rel=1e-5)
    assert float(record["flowY"]) == pytest.approx(sum(packet.flow_y for packet in packets) / count * 0.1, rel=1e-5)


def test_sum_of_quality_wraps_at_16_bits() -> None:
    assert Rig().see(*[flow(0, 0, 255)] * 258)["Qual"] == (255 * 258 - 65536) // 258


def test_nothing_is_logged_without_the_bit_for_flow() -> None:
    rig = Rig(LOG_BITMASK=180222 & ~(1 << 11))
    assert rig.flow.take(flow(1))
    rig.run_us(5000)
    assert rig.records == []


def test_it_is_healthy_for_half_a_second() -> None:
    rig = Rig()
    rig.see(flow(1))
    rig.run_us(495_000)
    assert rig.flow.healthy()
    rig.run_us(5000)
    assert not rig.flow.healthy()


READS_RATES: Final = tuple(firmware for firmware in PROFILES.values() if firmware.reads_flow_rates)
later = pytest.mark.parametrize("firmware", READS_RATES, ids=lambda one: one.name)


def test_releases_that_read_flow_rates() -> None:
    assert [firmware.name for firmware in READS_RATES] == ["2026-02", "4.7", "2026-04"]
    assert [name for name, one in PROFILES.items() if one.params.flow is FLOW_WITH_OPTIONS] == [
        firmware.name for firmware in READS_RATES
    ]


@later
def test_rates_in_rad_s_are_not_multiplied(firmware: Firmware) -> None:
    rig = Rig(firmware=firmware, FLOW_FXSCALER=-800)
    rig.see(in_rad_s(1.0))
    rig.run_us(95_000)
    record = rig.see(in_rad_s(0.5, -0.25))
    assert (record["flowX"], record["flowY"]) == (pytest.approx(0.1), -0.25)


@later
@pytest.mark.parametrize(("rate", "quality", "options", "recorded"), [
    ((1.354, -1.478), 188, 0, (1.7076189517974854, -1.0620827674865723)),
    ((-0.904, -0.618), 241, 0, (-0.17722085118293762, -0.9586443901062012)),
    ((0.454, -1.621), 140, 0, (1.247822880744934, -1.5256925821304321)),
    ((-0.031, 1.97), 133, 0, (-1.2007927894592285, 2.0364341735839844)),
    ((0.0, 0.0), 100, 0, (0.0, 0.0)),
    ((-1.712, -1.77), 100, 1, (0.024155139923095703, -2.4386379718780518)),
    ((0.376, -1.046), 100, 1, (0.8555378913879395, -0.955435037612915)),
    ((1.406, 0.07), 100, 1, (0.8103421926498413, 0.5648461580276489)),
])  # fmt: skip
def test_rates_in_rad_s_are_those_of_a_recording(
    firmware: Firmware, rate: tuple[float, float], quality: int, options: int, recorded: tuple[float, float]
) -> None:
    """As the simulator of 4.7 logged them, of 120 messages that all come out alike."""
    scale = {"FLOW_FXSCALER": -300, "FLOW_FYSCALER": 200, "FLOW_ORIENT_YAW": 3000}
    rig = Rig(firmware=firmware, FLOW_OPTIONS=options, **scale)
    rig.see(in_rad_s(1.0))
    rig.gyro = Vector3f(1e-4, 1e-4, 0)
    x, y = (float(np.float32(one)) for one in rate)
    record = rig.see(in_rad_s(x, y, quality))
    assert (float(record["flowX"]), float(record["flowY"]), record["Qual"]) == (*recorded, quality)
    assert bool(record["bodyX"]) is bool(record["bodyY"]) is (options == 0)


def test_rates_in_rad_s_are_turned_as_the_sensor_is() -> None:
    rig = Rig(firmware=FEBRUARY_2026, FLOW_ORIENT_YAW=9000)
    rig.see(in_rad_s(1.0))
    record = rig.see(in_rad_s(0.5, -0.25))
    assert (record["flowX"], record["flowY"]) == pytest.approx((0.25, 0.5))


@pytest.mark.parametrize("firmware", [one for one in PROFILES.values() if one not in READS_RATES], ids=lambda o: o.name)
def test_earlier_releases_ignore_rates_in_rad_s(firmware: Firmware) -> None:
    rig = Rig(firmware=firmware)
    rig.see(in_rad_s(1.0))
    rig.run_us(95_000)
    record = rig.see(in_rad_s(0.5, -0.25))
    assert (record["flowX"], record["flowY"]) == (pytest.approx(10.0), pytest.approx(-5.0))


@later
@pytest.mark.parametrize("rates", [(0.0, 0.0), (1e-7, -1e-7)])
def test_flow_x_and_flow_y_count_while_no_rate_differs_from_zero(
    firmware: Firmware, rates: tuple[float, float]
) -> None:
    rig = Rig(firmware=firmware)
    rig.see(in_rad_s(*rates))
    rig.run_us(95_000)
    record = rig.see(in_rad_s(*rates))
    assert (record["flowX"], record["flowY"]) == (pytest.approx(10.0), pytest.approx(-5.0))


@pytest.mark.parametrize("rates", [(0.5, 0.0), (0.0, 0.5), (math.nan, 0.0)])
def test_after_the_first_rate_in_rad_s_only_rates_count(rates: tuple[float, float]) -> None:
    rig = Rig(firmware=FEBRUARY_2026)
    rig.see(in_rad_s(*rates))
    record = rig.see(in_rad_s(0.0, 0.0))
    assert (record["flowX"], record["flowY"]) == (0.0, 0.0)


def test_first_rate_in_rad_s_forgets_what_was_summed() -> None:
    rig = Rig(firmware=FEBRUARY_2026)
    rig.see(flow_without_rate := replace(flow(1000), flow_rate_x=0.0, flow_rate_y=0.0))
    record = rig.see(flow_without_rate, in_rad_s(0.5, quality=50), in_rad_s(0.75, quality=60))
    assert (record["flowX"], record["Qual"]) == (0.625, 55)


def test_rates_that_are_no_numbers_reach_the_estimator_as_such() -> None:
    rig = Rig(firmware=FEBRUARY_2026, FLOW_ORIENT_YAW=9000)
    rig.see(in_rad_s(1.0))
    for rate in (math.nan, math.inf):
        record = rig.see(in_rad_s(rate, -rate), in_rad_s(-rate, rate))
        assert math.isnan(record["flowX"])


@later
@pytest.mark.parametrize(("options", "body"), [(0, (1.0, 2.0)), (1, (0.0, 0.0)), (3, (0.0, 0.0)), (2, (1.0, 2.0))])
def test_stabilised_sensor_has_no_body_rates(firmware: Firmware, options: int, body: tuple[float, float]) -> None:
    rig = Rig(firmware=firmware, FLOW_OPTIONS=options)
    rig.see(in_rad_s(1.0))
    rig.gyro = Vector3f(1, 2, 3)
    record = rig.see(in_rad_s(0.5, -0.25))
    assert (record["bodyX"], record["bodyY"]) == body
    assert (record["flowX"], record["flowY"]) == (0.5, -0.25)
    assert rig.measured[-1][0].gyro == body
