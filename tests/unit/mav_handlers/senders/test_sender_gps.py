# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GPS_RAW_INT with and without a GPS, and GPS2_RAW."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.senders.gps import gps2_raw, gps_raw_int
from mav_handlers.wire.messages import GPS2_RAW, GPS_RAW_INT

if TYPE_CHECKING:
    from tests.unit.mav_handlers.senders.conftest import Desk

HERE = Location(473_977_420, 85_455_940, 48_800)
SAMPLE = GpsSample(12_545, 3, HERE, Vector3f(0, -2.5, 1), num_sats=14, hdop=80, vdop=120, last_fix_ms=12_345)


def test_without_a_gps_there_is_no_fix_and_dilutions_are_unknown(desk: "Desk") -> None:
    assert desk.ask(gps_raw_int) == GPS_RAW_INT(0, 0, 0, 0, 0, 65535, 65535, 0, 0, 0)


def test_a_solution_is_told_in_the_units_of_the_message(desk: "Desk") -> None:
    desk.gps = SAMPLE
    assert desk.ask(gps_raw_int) == GPS_RAW_INT(
        time_usec=12_345_000,
        fix_type=3,
        lat=473_977_420,
        lon=85_455_940,
        alt=488_000,
        eph=80,
        epv=120,
        vel=250,
        cog=27_000,
        satellites_visible=14,
    )


def test_accuracies_are_told_in_millimetres(desk: "Desk") -> None:
    desk.gps = replace(SAMPLE, horizontal_accuracy=1.5, vertical_accuracy=2.25, speed_accuracy=0.125)
    now = desk.ask(gps_raw_int)
    assert (now.h_acc, now.v_acc, now.vel_acc, now.hdg_acc) == (1500, 2250, 125, 0)


@pytest.mark.parametrize(("yaw_deg", "told"), [(None, 0), (0.0, 36_000), (360.0, 36_000), (90.5, 9050)])
def test_yaw_of_north_is_36000_and_none_is_0(desk: "Desk", yaw_deg: float | None, told: int) -> None:
    desk.gps = replace(SAMPLE, yaw_deg=yaw_deg)
    assert desk.ask(gps_raw_int).yaw == told


def test_speed_beyond_the_field_wraps(desk: "Desk") -> None:
    desk.gps = replace(SAMPLE, vel_ned=Vector3f(700, 0, 0))
    assert desk.ask(gps_raw_int).vel == 70_000 - 65_536


def test_solution_beyond_float32_is_told_without_complaint(desk: "Desk") -> None:
    desk.gps = replace(SAMPLE, vel_ned=Vector3f(3e38, 3e38, 0), horizontal_accuracy=3e38, yaw_deg=3e38)
    with np.errstate(over="raise", invalid="raise"):
        assert desk.channel.send(desk.ask(gps_raw_int))


def test_second_gps_is_told_if_there_is_to_be_one(desk: "Desk") -> None:
    desk.second_gps = SAMPLE
    assert desk.has_nothing(gps2_raw)
    desk.vehicle.params.set("GPS2_TYPE", 1)
    assert desk.ask(gps2_raw) == GPS2_RAW(
        time_usec=12_345_000,
        fix_type=3,
        lat=473_977_420,
        lon=85_455_940,
        alt=488_000,
        eph=80,
        epv=120,
        vel=250,
        cog=27_000,
        satellites_visible=14,
        dgps_numch=0,
        dgps_age=0,
    )
    desk.second_gps = None
    assert desk.ask(gps2_raw) == GPS2_RAW(0, 0, 0, 0, 0, 65535, 65535, 0, 0, 0, 0, 0)
