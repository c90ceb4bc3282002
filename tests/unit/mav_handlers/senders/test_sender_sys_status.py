# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""SYS_STATUS: masks and counters."""

from typing import TYPE_CHECKING

import pytest

from ap_core.internal_error import InternalError
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.senders.sys_status import (
    SENSOR_3D_MAG,
    SENSOR_AHRS,
    SENSOR_BATTERY,
    SENSOR_GPS,
    SENSOR_LOGGING,
    SENSOR_MOTOR_OUTPUTS,
    SENSOR_PREARM_CHECK,
    SENSOR_VISION_POSITION,
    SENSOR_XY_POSITION_CONTROL,
    SENSOR_Z_ALTITUDE_CONTROL,
    sensor_bits,
    sys_status,
)
from mav_handlers.wire.messages import VISION_SPEED_ESTIMATE
from viso.vehicle.copter.modes import MODES

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench
    from tests.unit.mav_handlers.senders.conftest import Desk

# Gyro, accelerometer, barometer, rate, attitude and yaw control, motors, radio, terrain, propulsion.
ALWAYS = 0x1 | 0x2 | 0x8 | 0x400 | 0x800 | 0x1000 | 0x8000 | 0x10000 | 0x400000 | 0x40000000
POSITION_CONTROL = SENSOR_Z_ALTITUDE_CONTROL | SENSOR_XY_POSITION_CONTROL
FENCE = 0x100000
PROXIMITY = 0x4000000
CHANGING = SENSOR_AHRS | SENSOR_3D_MAG | SENSOR_GPS | SENSOR_LOGGING | SENSOR_PREARM_CHECK | SENSOR_VISION_POSITION


def see(bench: "Bench") -> None:
    bench.client.tell(VISION_SPEED_ESTIMATE(0, 0.0, 0.0, 0.0))


def bits(bench: "Bench", sensor: int) -> tuple[bool, ...]:
    return tuple(bool(mask & sensor) for mask in sensor_bits(bench.vehicle))


def test_sys_status_is_withheld_until_initialised(make_bench: "MakeBench") -> None:
    bare = make_bench(until_ms=0)
    assert sys_status(bare.vehicle, bare.client.channel, 0) is None


def test_masks_are_those_of_the_simulated_vehicle(bench: "Bench") -> None:
    present, enabled, healthy = (mask & ~CHANGING for mask in sensor_bits(bench.vehicle))
    assert present == ALWAYS | POSITION_CONTROL | FENCE | SENSOR_BATTERY
    assert enabled == ALWAYS
    assert healthy == ALWAYS | FENCE | PROXIMITY | SENSOR_BATTERY


def test_message_holds_the_masks(desk: "Desk") -> None:
    now = desk.ask(sys_status)
    told = (
        now.onboard_control_sensors_present,
        now.onboard_control_sensors_enabled,
        now.onboard_control_sensors_health,
    )
    assert told == sensor_bits(desk.vehicle)


@pytest.mark.parametrize(
    ("mode", "runs"), [(0, 0), (2, SENSOR_Z_ALTITUDE_CONTROL), (4, POSITION_CONTROL), (18, 0)], ids="mode {}".format
)
def test_position_controllers_are_those_that_the_mode_runs(
    desk: "Desk", monkeypatch: pytest.MonkeyPatch, mode: int, runs: int
) -> None:
    monkeypatch.setattr(desk.bench.vehicle.copter.modes, "current", MODES[mode])
    assert [mask & POSITION_CONTROL for mask in sensor_bits(desk.vehicle)] == [POSITION_CONTROL, runs, runs]


@pytest.mark.parametrize("settled", [False, True])
@pytest.mark.parametrize("healthy", [False, True])
def test_ahrs_is_enabled_once_it_has_settled_and_then_may_be_healthy(
    desk: "Desk", settled: bool, healthy: bool
) -> None:
    desk.ahrs.is_initialised, desk.ahrs.is_healthy = settled, healthy
    assert bits(desk.bench, SENSOR_AHRS) == (True, settled, settled and healthy)


@pytest.mark.parametrize(
    ("at_boot", "now", "expected"),
    [(0, 0, (True, False, True)), (4, 4, (True,) * 3), (4, 0, (True, True, False)), (0, 4, (True, False, True))],
)
def test_battery_is_enabled_with_a_monitor_and_healthy_while_that_is_configured(
    make_bench: "MakeBench", at_boot: int, now: int, expected: tuple[bool, ...]
) -> None:
    bench = make_bench(BATT_MONITOR=at_boot)
    bench.vehicle.params.set("BATT_MONITOR", now)
    assert bits(bench, SENSOR_BATTERY) == expected


@pytest.mark.parametrize("on", [False, True])
def test_motors_are_enabled_unless_the_safety_switch_is_on(bench: "Bench", on: bool) -> None:
    bench.vehicle.copter.safety_on = on
    assert bits(bench, SENSOR_MOTOR_OUTPUTS) == (True, not on, True)


@pytest.mark.parametrize("enabled", [False, True])
def test_compass_is_there_when_compasses_are_looked_for(make_bench: "MakeBench", enabled: bool) -> None:
    assert bits(make_bench(COMPASS_ENABLE=enabled), SENSOR_3D_MAG) == (enabled,) * 3


@pytest.mark.parametrize(
    ("fix_type", "expected"),
    [(None, (False,) * 3), (0, (False,) * 3), (1, (True, True, False)), (2, (True, True, False)), (3, (True,) * 3)],
)
def test_gps_is_healthy_with_a_3d_fix(desk: "Desk", fix_type: int | None, expected: tuple[bool, ...]) -> None:
    if fix_type is not None:
        desk.gps = GpsSample(1000, fix_type, Location(1, 1, 1), Vector3f(), 9)
    assert bits(desk.bench, SENSOR_GPS) == expected


def test_logging_is_enabled_while_disarmed_if_the_parameter_says_so(make_bench: "MakeBench") -> None:
    assert bits(make_bench(LOG_DISARMED=1), SENSOR_LOGGING) == (True, True, True)
    assert bits(make_bench(LOG_DISARMED=0), SENSOR_LOGGING) == (True, False, True)


def test_logging_is_enabled_while_armed(make_bench: "MakeBench", monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(LOG_DISARMED=0)
    monkeypatch.setattr(bench.vehicle.copter.arming, "armed", True)
    assert bits(bench, SENSOR_LOGGING) == (True, True, True)


@pytest.mark.parametrize(("age_ms", "enabled"), [(14_999, True), (15_000, False)])
def test_logging_is_enabled_for_15_s_after_a_failed_attempt_to_arm(
    make_bench: "MakeBench", age_ms: int, enabled: bool
) -> None:
    bench = make_bench(LOG_DISARMED=0)
    assert not bench.vehicle.copter.arm(do_checks=True)
    bench.vehicle.clock.set_us(bench.now_us + age_ms * 1000)
    assert bits(bench, SENSOR_LOGGING) == (True, enabled, True)


def test_logging_is_unhealthy_after_a_failure(bench: "Bench") -> None:
    bench.vehicle.logger.failure = "no space left"
    assert bits(bench, SENSOR_LOGGING) == (True, True, False)


def test_vision_sensor_is_absent_when_disabled(make_bench: "MakeBench") -> None:
    assert bits(make_bench(VISO_TYPE=0), SENSOR_VISION_POSITION) == (False, False, False)


def test_vision_sensor_is_present_and_unhealthy_without_data(bench: "Bench") -> None:
    assert bits(bench, SENSOR_VISION_POSITION) == (True, True, False)


@pytest.mark.parametrize(("age_ms", "healthy"), [(0, True), (299, True), (300, False)])
def test_vision_sensor_is_healthy_for_300_ms_after_data(bench: "Bench", age_ms: int, healthy: bool) -> None:
    see(bench)
    bench.run_ms(age_ms)
    assert bits(bench, SENSOR_VISION_POSITION) == (True, True, healthy)


def test_vision_sensor_without_a_backend_is_present_and_never_healthy(make_bench: "MakeBench") -> None:
    bench = make_bench(VISO_TYPE=4)
    see(bench)
    assert bits(bench, SENSOR_VISION_POSITION) == (True, True, False)


def test_prearm_bit_is_unhealthy_while_checks_fail(bench: "Bench") -> None:
    assert bits(bench, SENSOR_PREARM_CHECK) == (True, True, False)


def test_prearm_bit_is_healthy_once_checks_pass(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench.vehicle.copter.arming, "passed", True)
    assert bits(bench, SENSOR_PREARM_CHECK) == (True, True, True)


def test_prearm_bit_is_healthy_while_armed(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench.vehicle.copter, "is_armed", lambda: True)
    assert bits(bench, SENSOR_PREARM_CHECK) == (True, True, True)


def test_prearm_bit_stays_healthy_after_disarming_until_checks_are_made(bench: "Bench") -> None:
    bench.vehicle.copter.arming.armed = True
    bench.vehicle.copter.arming.update()
    bench.vehicle.copter.arming.armed = False
    assert bits(bench, SENSOR_PREARM_CHECK) == (True, True, True)
    bench.vehicle.copter.arming.update()
    assert bits(bench, SENSOR_PREARM_CHECK) == (True, True, False)


def test_prearm_bit_is_not_enabled_without_checks(make_bench: "MakeBench") -> None:
    assert bits(make_bench(ARMING_CHECK=0), SENSOR_PREARM_CHECK) == (True, False, False)


def test_load_and_battery_are_placeholders(desk: "Desk") -> None:
    now = desk.ask(sys_status)
    assert (now.load, now.voltage_battery, now.current_battery, now.battery_remaining) == (0, 12600, 0, 100)


@pytest.mark.parametrize(
    ("error", "counts"), [(InternalError.CONSTRAINING_NAN, (0x400, 0)), (InternalError.BAD_ROTATION, (0, 0x40))]
)
def test_internal_errors_are_told_in_two_halves(desk: "Desk", error: InternalError, counts: tuple[int, int]) -> None:
    desk.vehicle.internal_errors(error)
    desk.vehicle.internal_errors(error)
    now = desk.ask(sys_status)
    assert (now.errors_count1, now.errors_count2) == counts
    assert now.errors_count4 == 2


def test_lost_log_records_are_counted_in_16_bits(desk: "Desk") -> None:
    desk.vehicle.logger.losses["1.BIN: No space left on device"] = 65536 + 3
    assert desk.ask(sys_status).errors_count3 == 3


def test_received_packets_that_were_dropped_are_counted_in_16_bits(desk: "Desk") -> None:
    desk.channel.packets_dropped = 65536 + 5
    assert desk.ask(sys_status).errors_comm == 5


def test_damaged_frame_is_a_dropped_packet(bench: "Bench") -> None:
    frame = bytearray(bench.client.codec.encode(VISION_SPEED_ESTIMATE(0, 0.0, 0.0, 0.0)))
    frame[-1] ^= 1
    bench.client.send_bytes(bytes(frame))
    message = sys_status(bench.vehicle, bench.client.channel, bench.now_us)
    assert message is not None
    assert message.errors_comm == 1
