# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle does in its modes, with an estimator that knows where it is, or does not."""

import math

import pytest

from ap_core.vector3 import Vector3f
from ekf_stub.reports import ControlLimits, FilterFlag
from tests.unit.viso.vehicle.copter.flying.conftest import Flyer
from viso.firmware.releases import STABLE_4_6
from viso.vehicle.copter.flying.position_control import Estimate, PositionControl
from viso.vehicle.copter.modes import ModeNumber
from viso.vehicle.sensors.source import HOME
from viso.vehicle.sensors.vectors import ZERO


def test_armed_vehicle_stands_until_it_takes_off(flyer: Flyer) -> None:
    flyer.set_mode(ModeNumber.GUIDED)
    flyer.copter.arm(do_checks=False)
    flyer.guide(pos_ned_m=(4.0, 0.0, -5.0))
    flyer.run(2.0)
    assert flyer.pos == (0.0, 0.0, 0.0)


def test_it_lifts_off_when_the_recorded_motors_did(flyer: Flyer) -> None:
    flyer.set_mode(ModeNumber.GUIDED)
    flyer.copter.arm(do_checks=False)
    flyer.copter.take_off(500.0, must_navigate=True)
    flyer.run(3.2)
    assert flyer.copter.is_landed()
    flyer.run(0.5)
    assert not flyer.copter.is_landed()
    assert flyer.copter.is_taking_off()
    assert flyer.pos[2] < 0.0


def test_it_flies_to_a_place_and_stays(up: Flyer) -> None:
    up.guide(pos_ned_m=(4.0, -3.0, -8.0))
    up.run(12.0)
    assert up.pos == pytest.approx((4.0, -3.0, -8.0), abs=0.05)
    assert max(map(abs, up.airframe.state.vel)) < 0.05


@pytest.mark.parametrize(("name", "value", "most"), [("WPNAV_SPEED", 150.0, 1.5), ("WPNAV_SPEED", 400.0, 4.0)])
def test_it_keeps_the_speed_of_its_parameters(up: Flyer, name: str, value: float, most: float) -> None:
    up.rig.params.set(name, value)
    up.guide(pos_ned_m=(60.0, 0.0, -5.0))
    up.run(8.0)
    assert up.airframe.state.vel[0] == pytest.approx(most, rel=0.05)


def test_speed_that_a_command_asks_for_holds_until_the_mode_changes(up: Flyer) -> None:
    assert up.copter.flight is not None
    up.copter.flight.change_speed(1, 2.0)
    up.guide(pos_ned_m=(60.0, 0.0, -5.0))
    up.run(6.0)
    assert up.airframe.state.vel[0] == pytest.approx(2.0, rel=0.1)


def test_velocity_that_is_not_repeated_ends_after_guid_timeout(up: Flyer) -> None:
    up.guide(vel_ned_m_s=(1.0, 0.0, -0.5))
    up.run(2.5)
    assert up.airframe.state.vel == pytest.approx((1.0, 0.0, -0.5), abs=0.1)
    up.run(4.0)
    assert max(map(abs, up.airframe.state.vel)) < 0.05


def test_velocity_down_to_the_ground_lands(up: Flyer) -> None:
    for _ in range(12):
        up.guide(vel_ned_m_s=(0.0, 0.0, 0.8))
        up.run(1.0)
    assert up.copter.is_landed()
    assert up.copter.is_armed()


def test_nose_follows_the_way_unless_told_otherwise(up: Flyer) -> None:
    up.guide(pos_ned_m=(0.0, 8.0, -5.0))
    up.run(8.0)
    assert up.yaw_deg == pytest.approx(90.0, abs=3.0)
    up.rig.params.set("WP_YAW_BEHAVIOR", 0)
    up.guide(pos_ned_m=(0.0, 0.0, -5.0))
    up.run(8.0)
    assert up.yaw_deg == pytest.approx(90.0, abs=3.0)
    up.guide(pos_ned_m=(0.0, 0.0, -5.0), yaw_rad=math.radians(-45.0))
    up.run(5.0)
    assert up.yaw_deg == pytest.approx(-45.0, abs=1.0)


def test_condition_yaw_turns_the_way_and_as_fast_as_asked(up: Flyer) -> None:
    assert up.copter.flight is not None
    up.copter.flight.turn_to(math.radians(90.0), math.radians(30.0), -1, is_relative=False)
    up.run(3.0)
    assert up.yaw_deg == pytest.approx(-90.0, abs=6.0)
    up.run(8.0)
    assert up.yaw_deg == pytest.approx(90.0, abs=1.0)
    up.copter.flight.turn_to(math.radians(20.0), 0.0, -1, is_relative=True)
    up.run(3.0)
    assert up.yaw_deg == pytest.approx(70.0, abs=1.0)


def test_land_descends_slowly_and_disarms(up: Flyer) -> None:
    up.set_mode(ModeNumber.LAND)
    up.run(3.0)
    assert up.airframe.state.vel[2] == pytest.approx(0.5, abs=0.05)
    assert up.run(15.0, until=lambda: not up.copter.is_armed())
    up.run(1.0)
    assert up.airframe.state.is_at_rest()


def test_rtl_climbs_along_its_cone_returns_waits_and_lands(up: Flyer) -> None:
    up.guide(pos_ned_m=(3.0, 0.0, -5.0))
    up.run(8.0)
    up.set_mode(ModeNumber.RTL)
    up.run(6.0)
    highest = -up.pos[2]
    assert highest == pytest.approx(9.0, abs=0.6)  # RTL_CONE_SLOPE times the way home
    assert not up.copter.is_landing()
    assert up.run(30.0, until=up.copter.is_landing)
    assert up.run(60.0, until=lambda: not up.copter.is_armed())
    assert up.pos == pytest.approx((0.0, 0.0, 0.0), abs=0.6)


def test_brake_stops_where_it_is(up: Flyer) -> None:
    up.guide(pos_ned_m=(60.0, 0.0, -5.0))
    up.run(4.0)
    at_m = up.pos[0]
    up.set_mode(ModeNumber.BRAKE)
    up.run(4.0)
    assert abs(up.airframe.state.vel[0]) < 0.1
    assert up.pos[0] - at_m < 12.0


def test_sticks_move_it_in_loiter_and_it_stays_without_them(up: Flyer) -> None:
    up.set_mode(ModeNumber.LOITER)
    for _ in range(3):
        up.copter.receiver.override((1500, 1300, 1600, 65535))
        up.run(1.0)
    vel = up.airframe.state.vel
    assert vel[0] > 3.0
    assert vel[2] == pytest.approx(-0.0712 * 2.5, abs=0.05)
    up.run(12.0)  # nobody repeats them
    assert max(map(abs, up.airframe.state.vel)) < 0.1


def limit(flyer: Flyer, **limits: float) -> None:
    """Let the estimator ask for limits."""
    flyer.rig.ahrs.limits = ControlLimits(**limits)


@pytest.mark.parametrize(("asked", "got"), [(2.0, 2.0), (400.0, 12.5), (0.0, 0.2)])
def test_loiter_is_no_faster_than_the_estimator_asks_for(up: Flyer, asked: float, got: float) -> None:
    limit(up, speed_m_s=asked)
    up.set_mode(ModeNumber.LOITER)
    for _ in range(6):
        up.copter.receiver.override((1500, 1000, 1500, 1500))
        up.run(1.0)
    assert math.hypot(*up.airframe.state.vel[:2]) == pytest.approx(got, rel=0.05)


@pytest.mark.parametrize("mode", [ModeNumber.ALT_HOLD, ModeNumber.LOITER])
def test_climb_ends_where_the_estimator_asks_for(up: Flyer, mode: ModeNumber) -> None:
    limit(up, up_m=12.0)
    up.set_mode(mode)
    for _ in range(12):
        up.copter.receiver.override((1500, 1500, 2000, 1500))
        up.run(1.0)
    assert up.pos[2] == pytest.approx(-12.0, abs=0.2)


@pytest.mark.parametrize(("throttle", "rate"), [(2000, 0.75), (1500, 0.0), (1000, 2.5)])
def test_vehicle_above_the_limit_comes_down_unless_its_stick_is_centred(up: Flyer, throttle: int, rate: float) -> None:
    up.guide(pos_ned_m=(0.0, 0.0, -20.0))
    up.run(15.0)
    limit(up, up_m=10.0)
    up.set_mode(ModeNumber.LOITER)
    for _ in range(2):
        up.copter.receiver.override((1500, 1500, throttle, 1500))
        up.run(1.0)
    assert up.airframe.state.vel[2] == pytest.approx(rate, abs=0.1)


def test_horizontal_corrections_are_as_weak_as_the_estimator_asks_for() -> None:
    off, pushed = [], []
    for gain in (1.0, 0.25):
        limits = ControlLimits(gain=gain)
        off.append(PositionControl().acceleration(Estimate((1.0, 2.0, 3.0), ZERO, 0.0, limits), 0.02))
        pushed.append(PositionControl().acceleration(Estimate(ZERO, (1.0, 2.0, 3.0), 0.0, limits), 0.02))
    assert off[1] == pytest.approx((off[0][0] / 16, off[0][1] / 16, off[0][2]))
    assert pushed[1] == pytest.approx((pushed[0][0] / 4, pushed[0][1] / 4, pushed[0][2]))


@pytest.mark.parametrize("mode", [ModeNumber.STABILIZE, ModeNumber.ALT_HOLD, ModeNumber.LOITER])
def test_throttle_stick_lifts_it(flyer: Flyer, mode: ModeNumber) -> None:
    flyer.set_mode(mode)
    assert flyer.copter.arm(do_checks=False)
    for _ in range(6):
        flyer.copter.receiver.override((1500, 1500, 1700, 1500))
        flyer.run(1.0)
    assert flyer.pos[2] < -1.0
    assert not flyer.copter.landing.landed


def test_throttle_stick_lifts_nothing_in_guided(flyer: Flyer) -> None:
    flyer.set_mode(ModeNumber.GUIDED)
    assert flyer.copter.arm(do_checks=False)
    flyer.copter.receiver.override((1500, 1500, 1900, 1500))
    flyer.run(2.9)
    assert flyer.copter.landing.landed


def test_stick_in_its_middle_keeps_it_armed(flyer: Flyer) -> None:
    flyer.set_mode(ModeNumber.ALT_HOLD)
    assert flyer.copter.arm(do_checks=False)
    flyer.copter.landing.wants_disarming(armed=False)
    for throttle_us, is_armed in ((1500, False), (1000, True)):
        for _ in range(11):
            flyer.copter.receiver.override((1500, 1500, throttle_us, 1500))
            flyer.run(1.0)
            wants = flyer.copter.landing.wants_disarming(armed=True)
        assert wants is is_armed


def test_sticks_lean_it_in_alt_hold(up: Flyer) -> None:
    up.set_mode(ModeNumber.ALT_HOLD)
    up.copter.receiver.override((1700, 1500, 1500, 1500))
    up.run(1.5)
    assert math.degrees(up.airframe.state.rpy[0]) == pytest.approx(30.0 * 180 / 380, abs=0.3)
    up.copter.receiver.override((0, 0, 0, 0))
    up.run(1.0)
    assert math.degrees(up.airframe.state.rpy[0]) == pytest.approx(0.0, abs=0.5)


def test_estimate_that_is_reset_does_not_throw_it_about(up: Flyer) -> None:
    up.off_ned = (6.0, 0.0, 0.0)
    up.run(3.0)
    assert up.pos == pytest.approx((0.0, 0.0, -5.0), abs=0.3)


def test_estimate_that_drifts_flies_it_away(up: Flyer) -> None:
    for number in range(50):
        up.off_ned = (-0.04 * number, 0.0, 0.0)
        up.run(0.1)
    assert up.pos[0] == pytest.approx(2.0, abs=0.5)


def test_heading_that_is_wrong_makes_it_circle(up: Flyer) -> None:
    up.off_yaw_rad = math.radians(80.0)
    up.guide(pos_ned_m=(4.0, 0.0, -5.0), yaw_rad=0.0)
    up.run(4.0)
    assert abs(up.pos[1]) > 1.0


class TestEkfFailsafe:
    """What FS_EKF_ACTION makes of an estimator that fails."""

    @pytest.mark.parametrize(
        ("action", "mode", "entered", "told"),
        [
            (1, ModeNumber.GUIDED, ModeNumber.LAND, "EKF Failsafe: changed to LAND Mode"),
            (2, ModeNumber.GUIDED, ModeNumber.ALT_HOLD, "EKF Failsafe: changed to ALT_HOLD Mode"),
            (0, ModeNumber.GUIDED, ModeNumber.GUIDED, "EKF Failsafe"),
            (1, ModeNumber.ALT_HOLD, ModeNumber.ALT_HOLD, "EKF Failsafe"),
            (3, ModeNumber.ALT_HOLD, ModeNumber.LAND, "EKF Failsafe: changed to LAND Mode"),
        ],
    )
    def test_it_leaves_modes_that_need_a_position(
        self, up: Flyer, action: int, mode: ModeNumber, entered: ModeNumber, told: str
    ) -> None:
        up.rig.params.set("FS_EKF_ACTION", action)
        up.set_mode(mode)
        self.fail(up)
        assert up.copter.modes.current.number == entered
        assert told in up.rig.take_texts()

    @pytest.mark.parametrize(
        ("action", "mode", "entered", "told"),
        [
            (0, ModeNumber.GUIDED, ModeNumber.LAND, ["EKF Failsafe: changed to LAND Mode"]),
            (1, ModeNumber.ALT_HOLD, ModeNumber.ALT_HOLD, []),
            (1, ModeNumber.LAND, ModeNumber.LAND, []),
        ],
    )
    def test_4_6_has_no_action_that_only_reports(
        self, up: Flyer, action: int, mode: ModeNumber, entered: ModeNumber, told: list[str]
    ) -> None:
        up.rig.use_firmware(STABLE_4_6)
        up.rig.params.set("FS_EKF_ACTION", action)
        up.set_mode(mode)
        self.fail(up)
        assert up.copter.modes.current.number == entered
        assert [text for text in up.rig.take_texts() if text.startswith("EKF Failsafe")] == told

    def test_it_waits_then_lands_without_a_position(self, up: Flyer) -> None:
        self.fail(up)
        up.run(3.5)
        assert up.pos[2] == pytest.approx(-5.0, abs=0.2)
        assert up.run(20.0, until=lambda: not up.copter.is_armed())

    def test_vehicle_that_lands_holds_its_position_no_longer(self, up: Flyer) -> None:
        up.set_mode(ModeNumber.LAND)
        up.run(0.1)
        assert up.copter.flight is not None
        assert up.copter.flight.land.holds_position
        self.fail(up)
        assert not up.copter.flight.land.holds_position

    def fail(self, up: Flyer) -> None:
        up.copter.check_estimator()
        up.rig.ahrs.navigate(FilterFlag.ATTITUDE, FilterFlag.VERT_POS, FilterFlag.VERT_VEL)
        up.is_lost = True
        up.run(0.02)
        for _ in range(10):
            up.copter.check_estimator()


def test_vehicle_tells_its_truth_on_earth(up: Flyer) -> None:
    assert up.copter.flight is not None
    up.guide(vel_ned_m_s=(2.0, 0.0, 0.0))
    up.run(2.0)
    truth = up.copter.flight.truth()
    assert truth.place == HOME.offset(Vector3f(*up.pos))
    assert truth.vel_ned_m_s == up.airframe.state.vel
    assert math.hypot(*truth.acc_frd_m_s2) == pytest.approx(9.8, abs=0.5)


# A manual throttle


@pytest.mark.parametrize(
    ("throttle_us", "least_m_s", "most_m_s"), [(1500, -0.05, 0.05), (1700, 0.5, 9), (1400, -9, -0.5)]
)
def test_throttle_of_stabilize_is_a_thrust(up: Flyer, throttle_us: int, least_m_s: float, most_m_s: float) -> None:
    up.set_mode(ModeNumber.STABILIZE)
    up.copter.receiver.override((1500, 1500, throttle_us, 1500))
    up.run(1.0)
    assert least_m_s < -up.airframe.state.vel[2] < most_m_s


def test_climb_goes_on_in_stabilize_with_a_centred_throttle(up: Flyer) -> None:
    # Nothing holds the height: after a climb only the drag brakes.
    up.set_mode(ModeNumber.STABILIZE)
    for throttle_us, seconds in ((1700, 1.0), (1500, 2.0)):
        up.copter.receiver.override((1500, 1500, throttle_us, 1500))
        up.run(seconds)
    assert up.airframe.state.vel[2] < -1.0


def test_vehicle_lands_with_the_throttle_down_in_stabilize(flyer: Flyer) -> None:
    flyer.set_mode(ModeNumber.STABILIZE)
    flyer.run(0.1)
    assert flyer.copter.arm(do_checks=False)
    for throttle_us, seconds in ((1600, 4.5), (1450, 2.0), (1000, 2.5)):
        flyer.copter.receiver.override((1500, 1500, throttle_us, 1500))
        flyer.run(seconds)
    assert flyer.copter.landing.landed
