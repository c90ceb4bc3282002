# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Positions: from the origin, on the globe, of origin and home."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.senders.position import (
    global_position_int,
    gps_global_origin,
    home_position,
    local_position_ned,
    vfr_hud,
)
from mav_handlers.wire.messages import GLOBAL_POSITION_INT, LOCAL_POSITION_NED, VFR_HUD

if TYPE_CHECKING:
    from tests.unit.mav_handlers.senders.conftest import Desk

HERE = Location(473_977_420, 85_455_940, 48_800)
THERE = Location(-353_632_610, 1_491_652_300, 58_400)
POSITION = Vector3f(1.5, -2.5, -3.0)
VELOCITY = Vector3f(3.0, -4.0, 0.5)


class TestLocalPositionNed:
    """LOCAL_POSITION_NED."""

    def test_it_tells_position_and_velocity(self, desk: "Desk") -> None:
        desk.ahrs.pos, desk.ahrs.vel = POSITION, VELOCITY
        assert desk.ask(local_position_ned) == LOCAL_POSITION_NED(42_500, 1.5, -2.5, -3.0, 3.0, -4.0, 0.5)

    @pytest.mark.parametrize(("pos", "vel"), [(None, VELOCITY), (POSITION, None), (None, None)])
    def test_it_needs_both(self, desk: "Desk", pos: Vector3f | None, vel: Vector3f | None) -> None:
        desk.ahrs.pos, desk.ahrs.vel = pos, vel
        assert desk.has_nothing(local_position_ned)


class TestGlobalPositionInt:
    """GLOBAL_POSITION_INT."""

    def test_it_is_zero_before_the_first_place(self, desk: "Desk") -> None:
        assert desk.ask(global_position_int) == GLOBAL_POSITION_INT(42_500, 0, 0, 0, 0, 0, 0, 0, 0)

    def test_it_tells_the_place_in_millimetres(self, desk: "Desk") -> None:
        desk.ahrs.location = HERE
        now = desk.ask(global_position_int)
        assert (now.lat, now.lon, now.alt) == (473_977_420, 85_455_940, 488_000)

    def test_it_repeats_the_last_place(self, desk: "Desk") -> None:
        for place in (HERE, THERE):
            desk.ahrs.location = place
            desk.ask(global_position_int)
        desk.ahrs.location = None
        now = desk.ask(global_position_int)
        assert (now.lat, now.lon, now.alt) == (-353_632_610, 1_491_652_300, 584_000)

    def test_it_repeats_a_place_that_vfr_hud_learnt(self, desk: "Desk") -> None:
        desk.ahrs.location = HERE
        desk.ask(vfr_hud)
        desk.ahrs.location = None
        assert desk.ask(global_position_int).lat == HERE.lat

    def test_altitude_beyond_the_field_wraps(self, desk: "Desk") -> None:
        desk.ahrs.location = Location(1, 1, 214_748_368)
        assert desk.ask(global_position_int).alt == 2_147_483_680 - (1 << 32)

    @pytest.mark.parametrize(
        ("m_s", "cm_s"), [(0.019, 1), (-0.019, -1), (3.0, 300), (327.67, 32767), (400.0, 40_000 - 65_536)]
    )
    def test_velocity_is_truncated_towards_zero_and_wraps(self, desk: "Desk", m_s: float, cm_s: int) -> None:
        desk.ahrs.vel = Vector3f(m_s, 0, 0)
        assert desk.ask(global_position_int).vx == cm_s

    def test_velocity_is_north_east_down(self, desk: "Desk") -> None:
        desk.ahrs.vel = VELOCITY
        now = desk.ask(global_position_int)
        assert (now.vx, now.vy, now.vz) == (300, -400, 50)

    def test_velocity_that_is_not_finite_is_a_number_all_the_same(self, desk: "Desk") -> None:
        desk.ahrs.vel = Vector3f(math.nan, math.inf, -math.inf)
        now = desk.ask(global_position_int)
        assert (now.vx, now.vy, now.vz) == (0, 0, 0)

    def test_estimates_beyond_float32_are_told_without_complaint(self, desk: "Desk") -> None:
        desk.ahrs.vel = desk.ahrs.pos = Vector3f(3e38, 3e38, 3e38)
        desk.home = desk.origin = HERE
        with np.errstate(over="raise", invalid="raise"):
            messages = (desk.ask(global_position_int), desk.ask(vfr_hud), desk.ask(local_position_ned))
        assert messages[0].relative_alt == -(1 << 31)
        assert messages[1].groundspeed == math.inf
        assert desk.channel.send(*messages)

    def test_height_above_home_counts_from_home_not_from_the_origin(self, desk: "Desk") -> None:
        desk.ahrs.pos = POSITION
        desk.origin, desk.home = HERE, Location(HERE.lat, HERE.lng, HERE.alt_cm + 100)
        assert desk.ask(global_position_int).relative_alt == 2000

    @pytest.mark.parametrize("missing", ["pos", "home", "origin"])
    def test_height_above_home_is_the_barometers_while_anything_is_missing(self, desk: "Desk", missing: str) -> None:
        desk.ahrs.pos, desk.home, desk.origin = POSITION, HERE, HERE
        setattr(desk.ahrs if missing == "pos" else desk, missing, None)
        desk.ahrs.baro_m = 3.25
        assert desk.ask(global_position_int).relative_alt == 3250


@pytest.mark.parametrize(
    ("yaw_deg", "centidegrees", "whole"),
    [(0, 0, 0), (90.256, 9025, 90), (-0.5, 35950, 359), (-179.5, 18050, 180), (179.99, 17999, 179)],
)
def test_heading_is_0_to_360(desk: "Desk", yaw_deg: float, centidegrees: int, whole: int) -> None:
    desk.ahrs.face(0, 0, math.radians(yaw_deg))
    assert desk.ask(global_position_int).hdg == pytest.approx(centidegrees, abs=1)
    assert desk.ask(vfr_hud).heading == whole


def test_heading_of_no_attitude_is_a_heading_all_the_same(desk: "Desk") -> None:
    desk.ahrs.face(0, 0, math.nan)
    assert desk.ask(global_position_int).hdg == 36_000


class TestVfrHud:
    """VFR_HUD."""

    def test_it_tells_speed_altitude_and_climb(self, desk: "Desk") -> None:
        desk.ahrs.vel, desk.ahrs.location = VELOCITY, HERE
        assert desk.ask(vfr_hud) == VFR_HUD(airspeed=0, groundspeed=5, heading=0, throttle=0, alt=488, climb=-0.5)

    def test_it_is_zero_while_nothing_is_known(self, desk: "Desk") -> None:
        assert desk.ask(vfr_hud) == VFR_HUD(0, 0, 0, 0, 0, 0)

    def test_it_repeats_the_last_altitude(self, desk: "Desk") -> None:
        desk.ahrs.location = HERE
        desk.ask(vfr_hud)
        desk.ahrs.location = None
        assert desk.ask(vfr_hud).alt == 488

    def test_airspeed_is_the_speed_of_the_gps(self, desk: "Desk") -> None:
        desk.gps = GpsSample(1000, 3, HERE, Vector3f(6, 8, 9), 9)
        assert desk.ask(vfr_hud).airspeed == 10


class TestOriginAndHome:
    """GPS_GLOBAL_ORIGIN and HOME_POSITION."""

    def test_they_say_nothing_while_unset(self, desk: "Desk") -> None:
        assert desk.has_nothing(gps_global_origin)
        assert desk.has_nothing(home_position)

    def test_origin_is_told_in_millimetres_with_the_time_since_boot(self, desk: "Desk") -> None:
        desk.origin = HERE
        message = desk.ask(gps_global_origin, 42)
        assert (message.latitude, message.longitude, message.altitude) == (473_977_420, 85_455_940, 488_000)
        assert message.time_usec == 42

    def test_home_is_told_in_millimetres_with_the_time_since_boot(self, desk: "Desk") -> None:
        desk.home = desk.origin = HERE
        message = desk.ask(home_position, 42)
        assert (message.latitude, message.longitude, message.altitude) == (473_977_420, 85_455_940, 488_000)
        assert message.time_usec == 42

    def test_home_at_the_origin_is_at_zero(self, desk: "Desk") -> None:
        desk.home = desk.origin = HERE
        message = desk.ask(home_position)
        assert (message.x, message.y, message.z) == (0, 0, 0)

    def test_home_elsewhere_is_told_north_east_down_from_the_origin(self, desk: "Desk") -> None:
        desk.origin = HERE
        desk.home = Location(HERE.lat + 1000, HERE.lng - 1000, HERE.alt_cm + 250)
        message = desk.ask(home_position)
        assert (message.x, message.y, message.z) == pytest.approx((11.13, -7.54, -2.5), abs=0.01)

    def test_home_without_an_origin_has_no_relative_position(self, desk: "Desk") -> None:
        desk.home = HERE
        message = desk.ask(home_position)
        assert all(math.isnan(axis) for axis in (message.x, message.y, message.z))

    def test_home_has_no_attitude_and_no_approach(self, desk: "Desk") -> None:
        desk.home = HERE
        message = desk.ask(home_position)
        assert all(math.isnan(component) for component in message.q)
        assert (message.approach_x, message.approach_y, message.approach_z) == (0, 0, 0)

    def test_altitude_beyond_the_field_wraps(self, desk: "Desk") -> None:
        desk.home = desk.origin = Location(1, 1, 214_748_368)
        assert desk.ask(gps_global_origin).altitude == 2_147_483_680 - (1 << 32)
        assert desk.ask(home_position).altitude == 2_147_483_680 - (1 << 32)
