# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each message of the vehicle says."""

import math
from typing import TYPE_CHECKING

import pytest

from ap_core.internal_error import InternalError
from mav_handlers.ports import Location
from mav_handlers.senders import (
    CAPABILITIES,
    CAPABILITY_MAVLINK2,
    SENDERS,
    SENSOR_PREARM_CHECK,
    SENSOR_VISION_POSITION,
    STREAM_GROUPS,
    attitude,
    autopilot_version,
    gps_global_origin,
    heartbeat,
    home_position,
    sensor_bits,
    sys_status,
    system_time,
)
from mav_handlers.wire.messages import ATTITUDE, HEARTBEAT, SYS_STATUS, VISION_SPEED_ESTIMATE, Message

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench

HERE = Location(473_977_420, 85_455_940, 48_800)


@pytest.fixture
def bare(make_bench: "MakeBench") -> "Bench":
    """A vehicle that has not run yet."""
    return make_bench(until_ms=0)


def beat(bench: "Bench") -> HEARTBEAT:
    return heartbeat(bench.vehicle, bench.client.channel, bench.now_us)


def status(bench: "Bench") -> SYS_STATUS:
    message = sys_status(bench.vehicle, bench.client.channel, bench.now_us)
    assert message is not None
    return message


def see(bench: "Bench") -> None:
    bench.client.tell(VISION_SPEED_ESTIMATE(0, 0.0, 0.0, 0.0))


def vision_bits(bench: "Bench") -> tuple[bool, ...]:
    return tuple(bool(mask & SENSOR_VISION_POSITION) for mask in sensor_bits(bench.vehicle))


def prearm_bits(bench: "Bench") -> tuple[bool, ...]:
    return tuple(bool(mask & SENSOR_PREARM_CHECK) for mask in sensor_bits(bench.vehicle))


def test_every_sender_bears_the_name_of_its_message() -> None:
    known = {cls.__name__ for cls in Message.__subclasses__()}
    assert set(SENDERS) <= known


def test_stream_groups_hold_messages_that_can_be_sent() -> None:
    assert {name for _, names in STREAM_GROUPS.values() for name in names} <= set(SENDERS)


def test_heartbeat_of_a_disarmed_quad_has_base_mode_81_and_standby(bench: "Bench") -> None:
    assert beat(bench) == HEARTBEAT(
        type=2, autopilot=3, base_mode=81, custom_mode=0, system_status=3, mavlink_version=3
    )


def test_heartbeat_of_an_armed_quad_on_the_ground_is_standby_too(bench: "Bench") -> None:
    bench.vehicle.arm(do_checks=False)
    assert (beat(bench).base_mode, beat(bench).system_status) == (81 + 128, 3)


def test_heartbeat_says_boot_until_initialised(bare: "Bench") -> None:
    assert beat(bare).system_status == 1


def test_heartbeat_is_critical_after_an_internal_error(bench: "Bench") -> None:
    bench.vehicle.internal_errors(InternalError.CONSTRAINING_NAN)
    assert beat(bench).system_status == 5


def test_attitude_is_zero_before_there_is_one(bare: "Bench") -> None:
    assert attitude(bare.vehicle, bare.client.channel, 1_234_567) == ATTITUDE(1234, 0, 0, 0, 0, 0, 0)


def test_attitude_is_level_on_the_bench(bench: "Bench") -> None:
    assert attitude(bench.vehicle, bench.client.channel, bench.now_us) == ATTITUDE(5000, 0, 0, 0, 0, 0, 0)


def test_boot_time_wraps_in_32_bits(bench: "Bench") -> None:
    now_us = ((1 << 32) + 7) * 1000
    assert attitude(bench.vehicle, bench.client.channel, now_us).time_boot_ms == 7
    assert system_time(bench.vehicle, bench.client.channel, now_us).time_boot_ms == 7


def test_sys_status_is_withheld_until_initialised(bare: "Bench") -> None:
    assert sys_status(bare.vehicle, bare.client.channel, 0) is None


def test_load_and_battery_are_placeholders(bench: "Bench") -> None:
    now = status(bench)
    assert (now.load, now.voltage_battery, now.current_battery, now.battery_remaining) == (0, 65535, -1, -1)


@pytest.mark.parametrize(
    ("error", "counts"), [(InternalError.CONSTRAINING_NAN, (0x400, 0)), (InternalError.BAD_ROTATION, (0, 0x40))]
)
def test_sys_status_shows_internal_errors_in_two_halves(
    bench: "Bench", error: InternalError, counts: tuple[int, int]
) -> None:
    bench.vehicle.internal_errors(error)
    bench.vehicle.internal_errors(error)
    assert (status(bench).errors_count1, status(bench).errors_count2) == counts
    assert status(bench).errors_count4 == 2


def test_sys_status_shows_lost_log_records(bench: "Bench") -> None:
    bench.log.dropped = 65536 + 3
    assert status(bench).errors_count3 == 3


def test_vision_sensor_is_absent_when_disabled(make_bench: "MakeBench") -> None:
    assert vision_bits(make_bench(VISO_TYPE=0)) == (False, False, False)


def test_vision_sensor_is_present_and_unhealthy_without_data(bench: "Bench") -> None:
    assert vision_bits(bench) == (True, True, False)


@pytest.mark.parametrize(("age_ms", "healthy"), [(0, True), (299, True), (300, False)])
def test_vision_sensor_is_healthy_for_300_ms_after_data(bench: "Bench", age_ms: int, healthy: bool) -> None:
    see(bench)
    bench.run_ms(age_ms)
    assert vision_bits(bench) == (True, True, healthy)


def test_vision_sensor_without_a_backend_is_present_and_never_healthy(make_bench: "MakeBench") -> None:
    bench = make_bench(VISO_TYPE=4)
    see(bench)
    assert vision_bits(bench) == (True, True, False)


def test_prearm_bit_is_unhealthy_while_checks_fail(bench: "Bench") -> None:
    assert prearm_bits(bench) == (True, True, False)


def test_prearm_bit_is_healthy_once_checks_pass(bench: "Bench") -> None:
    see(bench)
    bench.vehicle.run_prearm_checks()
    assert prearm_bits(bench) == (True, True, True)


def test_prearm_bit_is_healthy_while_armed(bench: "Bench") -> None:
    bench.vehicle.arm(do_checks=False)
    assert prearm_bits(bench) == (True, True, True)


def test_prearm_bit_is_not_enabled_without_checks(make_bench: "MakeBench") -> None:
    assert prearm_bits(make_bench(ARMING_CHECK=0)) == (True, False, False)


def test_time_of_day_is_zero_while_unknown(bench: "Bench") -> None:
    assert system_time(bench.vehicle, bench.client.channel, bench.now_us).time_unix_usec == 0


def test_origin_and_home_say_nothing_while_unset(bench: "Bench") -> None:
    assert gps_global_origin(bench.vehicle, bench.client.channel, bench.now_us) is None
    assert home_position(bench.vehicle, bench.client.channel, bench.now_us) is None


def test_origin_is_told_in_millimetres_with_the_time_since_boot(bench: "Bench") -> None:
    bench.vehicle.set_origin(HERE)
    message = gps_global_origin(bench.vehicle, bench.client.channel, 42)
    assert message is not None
    assert (message.latitude, message.longitude, message.altitude) == (473_977_420, 85_455_940, 488_000)
    assert message.time_usec == 42


def test_home_is_at_the_origin(bench: "Bench") -> None:
    bench.vehicle.set_origin(HERE)
    bench.run_ms(3)
    message = home_position(bench.vehicle, bench.client.channel, 42)
    assert message is not None
    assert (message.latitude, message.longitude, message.altitude) == (473_977_420, 85_455_940, 488_000)
    assert (message.x, message.y, message.z) == (0, 0, 0)


def test_home_has_no_attitude_and_no_approach(bench: "Bench") -> None:
    bench.vehicle.set_origin(HERE)
    bench.run_ms(3)
    message = home_position(bench.vehicle, bench.client.channel, 42)
    assert message is not None
    assert all(math.isnan(component) for component in message.q)
    assert (message.approach_x, message.approach_y, message.approach_z) == (0, 0, 0)


def test_home_without_an_origin_has_no_relative_position(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench.vehicle, "home", lambda: HERE)
    message = home_position(bench.vehicle, bench.client.channel, 42)
    assert message is not None
    assert all(math.isnan(axis) for axis in (message.x, message.y, message.z))


def test_home_s_height_is_told_downwards_from_the_origin(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
    bench.vehicle.set_origin(HERE)
    monkeypatch.setattr(bench.vehicle, "home", lambda: Location(HERE.lat, HERE.lng, HERE.alt_cm + 250))
    message = home_position(bench.vehicle, bench.client.channel, 42)
    assert message is not None
    assert message.z == pytest.approx(-2.5)


def test_altitude_beyond_the_field_wraps(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
    high = Location(1, 1, 214_748_368)
    monkeypatch.setattr(bench.vehicle, "home", lambda: high)
    monkeypatch.setattr(bench.vehicle, "origin", lambda: high)
    origin = gps_global_origin(bench.vehicle, bench.client.channel, 0)
    home = home_position(bench.vehicle, bench.client.channel, 0)
    assert origin is not None
    assert home is not None
    assert origin.altitude == home.altitude == 2_147_483_680 - (1 << 32)


def test_version_and_hash_are_those_of_the_reference(bench: "Bench") -> None:
    message = autopilot_version(bench.vehicle, bench.client.channel, 0)
    version, _, source_hash = bench.vehicle.firmware_version()
    assert message.flight_sw_version == version == 0x04070000
    assert bytes(message.flight_custom_version).decode() == source_hash


def test_capabilities_of_a_mavlink_2_link(bench: "Bench") -> None:
    assert autopilot_version(bench.vehicle, bench.client.channel, 0).capabilities == 64495 == CAPABILITIES


def test_capabilities_of_a_mavlink_1_link_lack_mavlink_2(make_bench: "MakeBench") -> None:
    bench = make_bench(version=1)
    message = autopilot_version(bench.vehicle, bench.client.channel, 0)
    assert message.capabilities == 64495 - CAPABILITY_MAVLINK2
