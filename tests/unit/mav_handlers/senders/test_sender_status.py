# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Heartbeat, version, time and landed state."""

from typing import TYPE_CHECKING

import pytest

from ap_core.internal_error import InternalError
from mav_handlers.senders.status import (
    CAPABILITIES,
    CAPABILITY_MAVLINK2,
    autopilot_version,
    extended_sys_state,
    heartbeat,
    system_time,
)
from mav_handlers.wire.messages import EXTENDED_SYS_STATE, HEARTBEAT

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, MakeBench
    from tests.unit.mav_handlers.senders.conftest import Desk


def beat(bench: "Bench") -> HEARTBEAT:
    return heartbeat(bench.vehicle, bench.client.channel, bench.now_us)


def test_heartbeat_of_a_disarmed_quad_has_base_mode_81_and_standby(bench: "Bench") -> None:
    assert beat(bench) == HEARTBEAT(
        type=2, autopilot=3, base_mode=81, custom_mode=0, system_status=3, mavlink_version=3
    )


def test_heartbeat_of_an_armed_quad_on_the_ground_is_standby_too(
    bench: "Bench", monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.vehicle.copter, "is_armed", lambda: True)
    assert (beat(bench).base_mode, beat(bench).system_status) == (81 + 128, 3)


def test_heartbeat_says_boot_until_initialised(make_bench: "MakeBench") -> None:
    assert beat(make_bench(until_ms=0)).system_status == 1


def test_heartbeat_is_critical_after_an_internal_error(bench: "Bench") -> None:
    bench.vehicle.internal_errors(InternalError.CONSTRAINING_NAN)
    assert beat(bench).system_status == 5


def test_heartbeat_tells_the_mode(bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench.vehicle.copter, "custom_mode", lambda: 27)
    assert beat(bench).custom_mode == 27


def test_multicopter_is_on_the_ground(desk: "Desk") -> None:
    assert desk.ask(extended_sys_state) == EXTENDED_SYS_STATE(vtol_state=3, landed_state=1)


@pytest.mark.parametrize(("does", "landed_state"), [("", 2), ("is_taking_off", 3), ("is_landing", 4)])
def test_flying_vehicle_is_in_the_air_taking_off_or_landing(
    desk: "Desk", monkeypatch: pytest.MonkeyPatch, does: str, landed_state: int
) -> None:
    for what in ("is_landed", "is_taking_off", "is_landing"):
        monkeypatch.setattr(desk.vehicle.copter, what, lambda what=what: what == does)
    assert desk.ask(extended_sys_state) == EXTENDED_SYS_STATE(vtol_state=3, landed_state=landed_state)
    assert desk.ask(heartbeat).system_status == 4


def test_mode_that_holds_position_counts_as_guided(desk: "Desk", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk.vehicle.copter, "is_holding_position", lambda: True)
    assert desk.ask(heartbeat).base_mode == 89


def test_time_of_day_is_zero_while_unknown(desk: "Desk") -> None:
    now = desk.ask(system_time)
    assert (now.time_unix_usec, now.time_boot_ms) == (0, 42_500)


def test_time_of_day_is_the_vehicles(desk: "Desk", monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk.vehicle.rtc, "utc_us", lambda: 1_700_000_000_000_000)
    assert desk.ask(system_time).time_unix_usec == 1_700_000_000_000_000


def test_version_and_hash_are_those_of_the_reference(desk: "Desk") -> None:
    message = desk.ask(autopilot_version)
    firmware = desk.vehicle.firmware
    assert message.flight_sw_version == firmware.sw_version == 0x04070000
    assert bytes(message.flight_custom_version).decode() == firmware.source_hash


def test_capabilities_are_the_references_but_for_what_is_not_here(desk: "Desk") -> None:
    attitude_target, terrain, compass_calibration = 1 << 6, 1 << 9, 1 << 12
    assert desk.ask(autopilot_version).capabilities == 64495 - attitude_target - terrain - compass_calibration


def test_capabilities_of_a_mavlink_1_link_lack_mavlink_2(make_bench: "MakeBench") -> None:
    bench = make_bench(version=1)
    message = autopilot_version(bench.vehicle, bench.client.channel, 0)
    assert message.capabilities == CAPABILITIES - CAPABILITY_MAVLINK2


@pytest.mark.parametrize(("system_id", "name"), [(1, b"00017669736f000000"), (255, b"00ff7669736f000000")])
def test_unique_id_is_made_of_the_system_id(desk: "Desk", system_id: int, name: bytes) -> None:
    desk.vehicle.params.set("MAV_SYSID", system_id)
    message = desk.ask(autopilot_version)
    assert bytes(message.uid2) == name
    assert message.uid == 0
