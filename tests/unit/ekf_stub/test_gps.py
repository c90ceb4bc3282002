# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""GPS: when it is good enough, what is said until then, how far it is believed, and what it tells of accelerometers."""

import math
from typing import Any

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from tests.unit.ekf_stub.filter_rig import (
    GLITCHING,
    HOME,
    MODE_ABSOLUTE,
    NO_AIDING,
    QUALITY_GOOD,
    SLOW_LOOP_US,
    FilterRig,
    Start,
    by_gps,
    compared,
    reckoned,
    standing,
    weight,
)

VEL, POS = 4, 7
GATE = 25.0


def waiting(seconds: float, sources: str = "33131", **fields: Any) -> FilterRig:
    """Return a vehicle that has had solutions for so long."""
    rig = standing(sources, has_compass=True, run_s=3.0, loop_us=SLOW_LOOP_US)
    rig.forget()
    rig.gps = {"horizontal_accuracy": 5.0, "vertical_accuracy": 7.5, "speed_accuracy": 1.0, **fields}
    rig.feeds.add("gps")
    rig.run(seconds)
    return rig


# Checks


@pytest.mark.parametrize(("seconds", "good"), [(10.0, False), (10.4, True)])
def test_gps_is_good_more_than_10_s_after_its_first_fix_and_then_sets_the_origin(seconds: float, good: bool) -> None:
    rig = waiting(seconds)
    assert rig.core.gps.checks.good is good
    assert bool(rig.core.flags & QUALITY_GOOD) is good
    assert (rig.core.origin == HOME) is good
    assert rig.told() == ["origin set"] * good


def test_gps_does_not_move_an_origin_that_was_set() -> None:
    rig = waiting(9.0)
    rig.lanes.set_origin(Location(1, 2, 3))
    rig.run(2.0)
    assert rig.core.gps.checks.good
    assert rig.core.origin == Location(1, 2, 3)


@pytest.mark.parametrize(("fields", "reason"), [
    ({}, "EKF starting GPS checks"),
    ({"fix_type": 2}, "Waiting for 3D fix"),
])  # fmt: skip
def test_first_solution_is_told_of(fields: dict[str, Any], reason: str) -> None:
    rig = waiting(0.1, **fields)
    assert rig.core.gps.checks.reason == reason
    assert rig.lanes.unhealthy_reason(0) == reason  # as the vehicle asks before arming, if the core is not well
    assert standing("33131").core.gps.checks.reason == ""


@pytest.mark.parametrize(("fields", "reason"), [
    ({"num_sats": 5}, "GPS numsats 5 (needs 6)"),
    ({"hdop": 251}, "GPS HDOP 2.5 (needs 2.5)"),
    ({"hdop": 65535}, "GPS HDOP 655.3 (needs 2.5)"),
    ({"horizontal_accuracy": 5.1}, "GPS horiz error 5.1m (needs 5.0)"),
    ({"vertical_accuracy": 7.6}, "GPS vert error 7.6m (needs < 7.5)"),
    ({"speed_accuracy": 1.1}, "GPS speed error 1.1 (needs < 1.0)"),
    ({"num_sats": 0, "hdop": 900, "speed_accuracy": 9.0}, "GPS numsats 0 (needs 6)"),
])  # fmt: skip
def test_failing_check_is_told_and_starts_the_10_s_anew(fields: dict[str, Any], reason: str) -> None:
    rig = waiting(11.0, **fields)
    assert (rig.core.gps.checks.good, rig.core.gps.checks.reason) == (False, reason)
    rig.gps = {"num_sats": 6, "hdop": 250}
    rig.run(9.8)
    assert not rig.core.gps.checks.good
    rig.run(0.6)
    assert rig.core.gps.checks.good


def test_accuracies_that_the_receiver_does_not_give_are_not_checked() -> None:
    rig = waiting(10.4, horizontal_accuracy=None, vertical_accuracy=None, speed_accuracy=None)
    assert rig.core.gps.checks.good


@pytest.mark.parametrize(("bad_s", "good"), [(4.8, True), (5.4, False)])
def test_gps_is_bad_when_it_fails_for_5_s(bad_s: float, good: bool) -> None:
    rig = waiting(10.4)
    rig.gps = {"num_sats": 5}
    rig.run(bad_s)
    assert rig.core.gps.checks.good is good


@pytest.mark.parametrize(("accuracy", "good"), [(6.4, True), (6.6, False)])
def test_limits_are_wider_once_it_is_good(accuracy: float, good: bool) -> None:
    rig = waiting(10.4)
    rig.gps = {"horizontal_accuracy": accuracy}
    rig.run(6.0)
    assert rig.core.gps.checks.good is good


def test_limits_are_scaled() -> None:
    rig = waiting(0.5)
    rig.set_param("CHECK_SCALE", 150)
    rig.gps = {"horizontal_accuracy": 7.4}
    rig.run(10.4)
    assert rig.core.gps.checks.good


@pytest.mark.parametrize(("check", "fields", "reason"), [
    (1 << 6, {"has_vertical_velocity": True, "vel_ned": Vector3f(0, 0, -1)}, "GPS vertical speed "),
    (1 << 7, {"vel_ned": Vector3f(1, 0, 0)}, "GPS horizontal speed "),
])  # fmt: skip
@pytest.mark.parametrize(("checks", "armed"), [(True, False), (False, False), (True, True)])
def test_gps_that_moves_on_the_ground_is_bad_where_that_is_checked(
    check: int, fields: dict[str, Any], reason: str, checks: bool, armed: bool
) -> None:
    rig = standing("33131", has_compass=True, run_s=3.0, loop_us=SLOW_LOOP_US)
    rig.set_param("GPS_CHECK", check if checks else 0)
    rig.lanes.set_origin(HOME)
    rig.arm(armed)
    rig.gps = fields
    rig.feeds.add("gps")
    rig.run(11.0)
    fails = checks and not armed
    assert rig.core.gps.checks.good is not fails
    assert rig.core.gps.checks.reason.startswith(reason) is fails


def test_place_that_drifts_on_the_ground_is_bad_where_that_is_checked() -> None:
    rig = waiting(0.5)
    rig.set_param("GPS_CHECK", 1 << 5)
    for number in range(55):
        rig.gps_shift = (10.0 if number % 2 else 0.0), 0.0, 0.0
        rig.run(0.2)
    assert not rig.core.gps.checks.good
    assert rig.core.gps.checks.reason.startswith("GPS drift ")


def test_yaw_that_cannot_be_believed_ends_the_use_of_gps() -> None:
    rig = waiting(10.4)
    rig.set_param("YAW_I_GATE", 100)
    rig.set_param("YAW_M_NSE", 0.05)
    for number in range(60):
        rig.field_ned = (238.0 if number % 2 else -238.0), 0.0, -529.0
        rig.run(0.1)
    assert not rig.core.gps.checks.good
    assert rig.core.gps.checks.reason.startswith("Mag yaw error x=")


# What starts aiding


def test_gps_starts_aiding_when_all_is_well_and_counts_as_good_later() -> None:
    rig = by_gps()
    assert rig.mode == MODE_ABSOLUTE
    assert rig.core.flags & QUALITY_GOOD
    rig = waiting(10.0)
    rig.know_gyros()
    rig.run(0.6)
    assert "is using GPS" in rig.told()


@pytest.mark.parametrize("lack", ["checks", "yaw", "gyros", "source"])
def test_gps_does_not_start_aiding_while_something_is_lacking(lack: str) -> None:
    rig = waiting(10.0)
    if lack != "gyros":
        rig.know_gyros()
    if lack == "checks":
        rig.gps = {"num_sats": 4}
    elif lack == "yaw":
        rig.core.yaw.aligned = False
        rig.feeds.discard("compass")
        rig.set_param("SRC1_YAW", 2)
    elif lack == "source":
        rig.set_param("SRC1_POSXY", 0)
    rig.run(1.5)
    assert rig.mode == NO_AIDING


def test_accuracy_counts_as_good_10_s_after_innovations_began_to_pass() -> None:
    # It is judged from the first solution on, and innovations of a vehicle that stands pass at once.
    rig = waiting(9.8)
    assert not rig.core.gps.accuracy_good
    rig.run(0.8)
    assert rig.core.gps.accuracy_good


# Solutions


@pytest.mark.parametrize(("fix_type", "taken"), [(1, False), (2, False), (3, True), (6, True)])
def test_solution_with_a_3d_fix_is_taken(fix_type: int, taken: bool) -> None:
    rig = waiting(0.3, fix_type=fix_type)
    assert (rig.core.gps.received_ms > 0) is taken


@pytest.mark.parametrize(("after_ms", "is_new"), [(0, False), (50, False), (51, True)])
def test_solutions_within_50_ms_are_passed_over(after_ms: int, is_new: bool) -> None:
    rig = waiting(1.0)
    rig.lose("gps")
    first_ms = rig.core.gps.received_ms
    rig.gps = {"time_ms": first_ms + after_ms}
    rig.feeds.add("gps")
    rig.one_pass()
    assert (rig.core.gps.received_ms > first_ms) is is_new


@pytest.mark.parametrize(("lag_s", "lag_ms"), [(0.0, 0), (0.1, 100), (0.12, 120), (0.22, 220)])
def test_solution_counts_from_the_origin_and_is_as_old_as_its_receiver_is_late(lag_s: float, lag_ms: int) -> None:
    rig = standing("33131", has_compass=True, longest_delay_ms=250)
    rig.lanes.set_origin(HOME)
    rig.gps_shift = 30.0, -40.0, -5.0
    rig.gps = {"vel_ned": Vector3f(1, 2, 3), "yaw_deg": 90.0, "lag_s": float(np.float32(lag_s))}
    rig.feeds.add("gps")
    rig.run(0.02)
    fix = rig.core.gps.newest
    assert fix is not None
    assert fix.time_ms == rig.core.gps.received_ms - lag_ms - 6
    assert fix.pos == pytest.approx((30, -40, -5), abs=0.02)  # a place is told to a centimetre
    assert fix.vel == pytest.approx((1, 2, 3))
    assert fix.yaw == pytest.approx(math.pi / 2)


def test_solution_is_never_older_than_the_horizon_nor_of_the_future() -> None:
    rig = standing("66166", has_compass=True)
    rig.lanes.set_origin(HOME)
    rig.feeds.add("gps")
    rig.run(0.02)
    fix = rig.core.gps.newest
    assert fix is not None
    assert fix.time_ms >= rig.core.ext_nav.horizon_ms - 13  # which has gone on since by a step
    assert fix.time_ms > rig.core.gps.received_ms - 200
    rig.gps = {"time_ms": rig.now_ms + 9000}
    rig.run(0.4)
    newest = rig.core.gps.newest
    assert newest is not None
    assert newest.time_ms <= rig.now_ms


def test_solution_is_moved_from_the_antenna_to_the_imu() -> None:
    # GIVEN a vehicle that heads east and turns, with an antenna ahead of and above the IMU
    rig = FilterRig("33131", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.yaw = math.pi / 2
    rig.run(3.0)
    rig.lanes.set_origin(HOME)
    rig.gps = {"vel_ned": Vector3f(1, 2, 3), "antenna": (0.5, 0.0, -0.4)}
    rig.feeds.add("gps")
    rig.run(0.5)
    for fix in (rig.core.gps.delayed, rig.core.gps.newest_at_imu()):
        assert fix is not None
        assert fix.pos == pytest.approx((0.0, -0.5, 0.4), abs=0.02)  # a place is told to 11 mm
        assert fix.vel == pytest.approx((1, 2, 3), abs=1e-3)
    newest = rig.core.gps.newest
    assert newest is not None
    assert newest.pos == pytest.approx((0, 0, 0), abs=1e-3)
    # AND as it turns, the antenna goes round
    rig.yaw_rate = 2.0
    rig.run(0.36)  # so that the horizon, 320 ms back, has turned a little
    moved = rig.core.gps.newest_at_imu()
    assert moved is not None
    assert moved.vel[0] - 1 == pytest.approx(2.0 * 0.5, abs=0.1)  # to the south at first


# How far it is believed


def fix(
    start: Start, place: tuple[float, float, float] = (0.0, 0.0, 0.0), **fields: Any
) -> tuple[FilterRig, FilterRig]:
    """Let a solution come due in a vehicle; return it and one without."""

    def without_sensors() -> FilterRig:
        rig = start()
        rig.lose("gps", "baro", "compass")
        rig.run(0.1)
        return rig

    def tell(rig: FilterRig) -> None:
        rig.gps, rig.gps_shift = fields, place
        rig.feeds.add("gps")
        rig._due_us["gps"] = 0
        rig.feed()
        rig.feeds.discard("gps")

    return compared(without_sensors, tell, lambda core: core.gps.is_due)


def test_gps_gives_position_and_velocity() -> None:
    vel: dict[str, Any] = {"vel_ned": Vector3f(0.1, -0.2, 0.3), "has_vertical_velocity": True}
    told, other = fix(by_gps, (1.0, -1.0, 0.0), **vel)
    delayed = told.core.gps.delayed
    assert delayed is not None
    north, east, _ = delayed.pos
    accel = (0.05 * math.dist(other.core.state.accel_filtered, (0, 0, 0))) ** 2
    own = 0.09 + accel, 0.09 + accel, 0.25 + accel
    vels = [(VEL + i, v, own[i]) for i, v in enumerate((0.1, -0.2, 0.3))]
    states = reckoned(other, *vels, (POS, north, 0.25 + accel), (POS + 1, east, 0.25 + accel))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-5)
    assert told.core.state.pos[:2] == pytest.approx(states[POS : POS + 2], abs=1e-5)


@pytest.mark.parametrize(("sources", "has_vertical"), [("33131", False), ("33101", True)])
def test_gps_gives_vertical_velocity_if_it_has_one_and_is_its_source(sources: str, has_vertical: bool) -> None:
    vel: dict[str, Any] = {"vel_ned": Vector3f(0.1, -0.2, 0.3), "has_vertical_velocity": has_vertical}
    told, other = fix(lambda: by_gps(sources), **vel)
    assert told.core.state.vel[0] > other.core.state.vel[0]
    assert told.core.state.vel[2] == pytest.approx(other.core.state.vel[2], abs=1e-3)


def test_gps_may_give_position_alone() -> None:
    told, other = fix(lambda: by_gps("30101"), (1.0, -1.0, 0.0), vel_ned=Vector3f(5, 5, 0))
    assert told.core.state.pos[0] > other.core.state.pos[0]
    assert told.report.vel_ratio == other.report.vel_ratio


def test_accuracies_of_the_gps_count_but_not_at_the_gate_of_velocity() -> None:
    told, other = fix(by_gps, (1.0, 0.0, 0.0), vel_ned=Vector3f(0.1, 0, 0), horizontal_accuracy=2.0, speed_accuracy=1.0)
    delayed = told.core.gps.delayed
    assert delayed is not None
    vels = (VEL, 0.1, 1.0), (VEL + 1, 0.0, 1.0)
    states = reckoned(other, *vels, (POS, delayed.pos[0], 4.0), (POS + 1, delayed.pos[1], 4.0))
    assert told.core.state.pos[0] == pytest.approx(states[POS], abs=1e-5)
    assert told.core.state.vel[0] == pytest.approx(states[VEL], abs=1e-5)
    spread = sum(other.core.state.cov.variances()[VEL : VEL + 2]) + 2 * 0.09
    off = math.dist(other.core.state.vel[:2], (0.1, 0.0))
    assert told.report.vel_ratio == pytest.approx(off**2 / (GATE * spread), rel=0.01)  # acceleration counts a little


@pytest.mark.parametrize(("satellites", "scale"), [(10, 1.0), (5, 1.4), (4, 2.0)])
def test_few_satellites_count_for_less(satellites: int, scale: float) -> None:
    told, other = fix(by_gps, (1.0, 0.0, 0.0), num_sats=satellites, horizontal_accuracy=1.0)
    assert told.core.gps.noise_scaler == scale
    delayed = told.core.gps.delayed
    assert delayed is not None
    by_vel = [(VEL, 0.0, 0.09 * scale**2), (VEL + 1, 0.0, 0.09 * scale**2)]
    states = reckoned(other, *by_vel, (POS, delayed.pos[0], scale**2), (POS + 1, delayed.pos[1], scale**2))
    assert told.core.state.pos[0] == pytest.approx(states[POS], abs=1e-5)


@pytest.mark.parametrize(("sources", "noise"), [("33131", 1.0), ("60131", 0.5)])
def test_position_that_is_assumed_for_want_of_gps_counts_for_less(sources: str, noise: float) -> None:
    # GIVEN a vehicle that does not navigate, and so sees few satellites as far as it knows
    def start() -> FilterRig:
        rig = standing(sources, has_compass=True, loop_us=SLOW_LOOP_US)
        rig.feeds.add("gps")
        rig.run(0.3)
        rig.lose("baro")
        rig.accel_bias = [(2.0, 0.0, 0.0)]
        rig.run(0.3)
        rig.accel_bias = [(0.0, 0.0, 0.0)]
        return rig

    told, other = compared(
        start, lambda rig: rig.core.inputs.set_baro(rig.now_ms, 0.0), lambda core: core.height.is_new
    )
    moved = 1 - told.core.state.pos[0] / other.core.state.pos[0]
    assert told.core.gps.noise_scaler == 2.0
    assert moved == pytest.approx(weight(other.core.state.cov.var(POS), noise), rel=0.01)


def test_accuracies_have_limits_and_those_not_given_are_0() -> None:
    rig = by_gps()
    for given, expected in ((0.1, (0.3, 0.5, 0.75)), (1e3, (50, 100, 100)), (None, (0, 0, 0))):
        rig.gps = {"speed_accuracy": given, "horizontal_accuracy": given, "vertical_accuracy": given}
        rig.run(0.3)
        gps = rig.core.gps
        assert (gps.speed_accuracy, gps.pos_accuracy, gps.height_accuracy) == pytest.approx(expected)


@pytest.mark.parametrize(("after_s", "held"), [(0.6, 8.8), (1.0, 8.0), (5.0, 1.0)])
def test_worst_accuracy_decays_within_5_s(after_s: float, held: float) -> None:
    rig = by_gps()
    rig.gps = {"horizontal_accuracy": 10.0}
    rig.run(0.21)
    rig.lose("gps")
    rig.gps = {"horizontal_accuracy": 1.0, "time_ms": rig.core.gps.received_ms + round(1000 * after_s)}
    rig.feeds.add("gps")
    rig.run(0.1)
    assert rig.core.gps.pos_accuracy == pytest.approx(held)


def test_accuracy_is_bad_beyond_a_speed_accuracy_of_1_5_until_it_is_below_1() -> None:
    rig = by_gps()
    rig.gps = {"speed_accuracy": 2.0}
    rig.run(4.0)
    assert not rig.core.gps.accuracy_good
    assert rig.core.flags & GLITCHING
    rig.gps = {"speed_accuracy": 1.2}
    rig.run(10.0)
    assert not rig.core.gps.accuracy_good
    rig.gps = {"speed_accuracy": 0.5}
    rig.run(15.0)
    assert rig.core.gps.accuracy_good


def test_gps_that_jumps_is_rejected_and_glitches() -> None:
    rig = by_gps()
    rig.run(1.0)
    rig.gps_shift = 1000.0, 0.0, 0.0
    rig.run(1.0)
    assert rig.report.pos_ratio > 1
    assert abs(rig.core.state.pos[0]) < 0.5
    rig.run(0.8)
    assert not rig.core.gps.accuracy_good
    # AND once position is lost, it is gone to
    rig.run(12.0)
    assert rig.core.state.pos[0] == pytest.approx(1000.0, abs=5.0)


def test_lost_gps_counts_as_not_used() -> None:
    rig = by_gps()
    rig.lose("gps")
    assert rig.core.gps.is_in_use
    rig.skip(15.0)
    rig.run(0.1)
    assert rig.mode == NO_AIDING
    assert not rig.core.gps.is_in_use


def test_change_from_the_camera_to_gps_is_followed() -> None:
    rig = by_gps()
    rig.use("66161")
    rig.run(0.3)
    rig.gps_shift = 100.0, -50.0, -5.0
    rig.use("33131")
    rig.run(0.5)
    assert rig.core.state.pos[:2] == pytest.approx((100.0, -50.0), abs=0.5)
    assert rig.report.moved_ne == pytest.approx((100.0, -50.0), abs=0.5)


def seem_to_move(rig: FilterRig) -> None:
    """Let velocities say of a parked vehicle for long that it moves."""
    for _ in range(250):
        rig.velocity(4.0)
        rig.run(0.04)
        if "forced reset" in rig.texts:
            return


def test_filter_that_begins_anew_forgets_solutions() -> None:
    rig = standing("06166", loop_us=SLOW_LOOP_US)
    rig.lanes.set_origin(HOME)
    rig.feeds.add("gps")
    rig.run(1.0)
    assert rig.core.gps.newest is not None
    rig.feeds.discard("gps")
    rig.core.inputs.set_gps(None)
    seem_to_move(rig)
    assert rig.texts[-2:] == ["forced reset", "initialised"]
    assert rig.core.gps.received_ms == 0
    assert rig.core.gps.delayed is None


def test_filter_with_a_good_gps_does_not_begin_anew_as_that_has_a_flag() -> None:
    rig = standing("06166", loop_us=SLOW_LOOP_US)
    rig.feeds.add("gps")
    rig.run(10.6)
    rig.lose("gps")
    seem_to_move(rig)
    assert rig.core.flags == QUALITY_GOOD
    assert "forced reset" not in rig.texts


# Accelerometers that are bad


def falling_accelerometer() -> FilterRig:
    """Return a vehicle in flight whose accelerometer suddenly shows that it climbs."""
    rig = by_gps()
    rig.gps = {"has_vertical_velocity": True}
    rig.arm()
    rig.flying_ms = 6000
    rig.run(1.0)
    assert not rig.core.state.accel_is_bad
    rig.accel_bias = [(0.0, 0.0, -6.0)]
    return rig


def test_height_and_climb_that_are_off_alike_are_the_accelerometers_fault() -> None:
    rig = falling_accelerometer()
    rig.run_until(lambda: rig.core.state.accel_is_bad, 5.0)
    # THEN GPS tells the climb
    assert rig.core.state.vel[2] == pytest.approx(0.0, abs=1.0)
    bias = rig.core.state.accel_bias
    rig.run(2.0)
    # AND no bias is learned of what is bad, and velocity and height are as uncertain as they are measured at least
    assert rig.core.state.accel_bias == pytest.approx(bias, abs=1e-6)  # the compass's heading says a little of it
    assert rig.core.state.cov.var(VEL + 2) >= 0.25
    assert rig.core.state.cov.var(POS + 2) >= 4.0
    # AND it is trusted again some time after all is well
    rig.accel_bias = [(0.0, 0.0, 0.0)]
    repaired_ms = rig.now_ms
    rig.run_until(lambda: not rig.core.state.accel_is_bad, 21.0)
    assert rig.now_ms - repaired_ms > 1000
    rig.run(2.0)
    assert rig.miss_m() < 1.0


def test_height_is_lost_with_accelerometers_that_have_been_bad_for_a_second() -> None:
    rig = falling_accelerometer()
    rig.run_until(lambda: rig.core.state.accel_is_bad, 5.0)
    rig.run(1.3)
    rig.baro_shift = 90.0
    # THEN the next heights are gone to at once, and not after 5 s
    rig.run_until(lambda: rig.core.state.pos[2] < -80.0, 3.0)


@pytest.mark.parametrize("sources", ["33101", "33331"])
def test_accelerometers_are_trusted_where_that_cannot_be_told(sources: str) -> None:
    rig = by_gps(sources)
    rig.gps = {"has_vertical_velocity": True}
    rig.arm()
    rig.run(0.5)
    rig.accel_bias = [(0.0, 0.0, -6.0)]
    rig.run(3.0)
    assert not rig.core.state.accel_is_bad
