# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The sensors of SYS_STATUS, bit by bit, as a vehicle of the reference told them."""

from typing import Final

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from mav_handlers.senders.sys_status import sensor_bits
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import VISION_SPEED_ESTIMATE
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

BOOTED_US: Final = 2_500_000
SETTLED_US: Final = 23_000_000

ENABLED_AT_BOOT: Final = 0x51419C8F
"""As received from the reference with VISO_TYPE set and without a battery monitor, before its AHRS had settled."""

PRESENT_ONLY: Final = (
    mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
)
"""Of what the reference has and does not run, by GCS::update_sensor_status_flags and its copter's part."""

HEALTHY_WITHOUT_BEING_ENABLED: Final = (
    mavlink.MAV_SYS_STATUS_SENSOR_BATTERY | mavlink.MAV_SYS_STATUS_GEOFENCE | mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY
)
UNHEALTHY: Final = mavlink.MAV_SYS_STATUS_PREARM_CHECK


def booted(viso_type: int, until_us: int) -> Vehicle:
    """Return a vehicle that has just heard of its camera."""
    vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": viso_type}))
    if until_us == BOOTED_US:
        vehicle.advance(range(until_us, until_us + 1))
    else:
        Scheduler(vehicle).run_until(until_us)
    channel = vehicle.endpoint.open_channel("camera")
    vehicle.receive_bytes(channel, Codec(1, 197).encode(VISION_SPEED_ESTIMATE(until_us, 0.0, 0.0, 0.0)))
    return vehicle


@pytest.mark.parametrize("viso_type", [1, 2, 3])
def test_bits_after_boot_are_those_of_the_reference(viso_type: int) -> None:
    present, enabled, healthy = sensor_bits(booted(viso_type, BOOTED_US))
    assert hex(enabled) == hex(ENABLED_AT_BOOT)
    assert hex(present) == hex(ENABLED_AT_BOOT | PRESENT_ONLY)
    assert hex(healthy) == hex(ENABLED_AT_BOOT & ~UNHEALTHY | HEALTHY_WITHOUT_BEING_ENABLED)


@pytest.mark.slow
def test_ahrs_joins_them_once_it_has_settled() -> None:
    present, enabled, healthy = sensor_bits(booted(1, SETTLED_US))
    assert hex(enabled) == hex(ENABLED_AT_BOOT | mavlink.MAV_SYS_STATUS_AHRS)
    assert hex(present) == hex(ENABLED_AT_BOOT | PRESENT_ONLY)
    wanted = ENABLED_AT_BOOT & ~UNHEALTHY | HEALTHY_WITHOUT_BEING_ENABLED | mavlink.MAV_SYS_STATUS_AHRS
    assert hex(healthy & ~UNHEALTHY) == hex(wanted)
