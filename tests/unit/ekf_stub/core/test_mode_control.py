# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the vehicle flies, by what it navigates, and what the filter says of itself."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.filter.states import ATT, GYRO, POS, VEL
from ekf_stub.fusion.aiding import ALL_LOST_MS, AidingMode
from ekf_stub.inputs.gps_sample import GpsSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.core_rig import CoreRig

MakeCore = Callable[..., "CoreRig"]

HOME = Location(-353632610, 1491652300, 58400)
PARKED, NAVIGATING, MOVING = 0x100A7, 0x1233F, 0x1012F  # of XKF4.SS
USING_POSITION, GLITCHING, QUALITY_GOOD, INITIALISED = 1 << 13, 1 << 14, 1 << 15, 1 << 16
TAKEOFF, TOUCHDOWN = 1 << 11, 1 << 12


def navigating(make_core: MakeCore, sources: str = "66666", **params: float) -> "CoreRig":
    """Return a core that navigates by poses of 0, and has no more to tell."""
    rig = make_core(sources, **params)
    rig.stream(1.0, rig.pose)
    assert rig.core.aiding.mode is AidingMode.ABSOLUTE
    rig.told()
    return rig


def arm(rig: "CoreRig", **frame: Any) -> None:
    rig.frame.update(armed=True, **frame)
    rig.run_for(0.0025)


# Flight


def test_disarmed_vehicle_is_on_the_ground(make_core: MakeCore) -> None:
    rig = make_core()
    rig.frame["flying_ms"] = 60_000
    rig.core.state.pos = np.array([0.0, 0.0, -100.0])
    rig.run_for(0.0025)
    vehicle = rig.core.control.vehicle
    assert (vehicle.on_ground, vehicle.in_flight, vehicle.armed) == (True, False, False)


def test_armed_vehicle_is_neither_on_the_ground_nor_surely_in_flight(make_core: MakeCore) -> None:
    rig = make_core()
    arm(rig)
    vehicle = rig.core.control.vehicle
    assert (vehicle.on_ground, vehicle.in_flight, vehicle.armed) == (False, False, True)


@pytest.mark.parametrize(("climb_m", "in_flight"), [(1.49, False), (1.51, True)])
def test_vehicle_flies_when_it_has_climbed_1_5_m_since_it_was_armed(
    make_core: MakeCore, climb_m: float, in_flight: bool
) -> None:
    rig = make_core()
    rig.core.state.pos = np.array([0.0, 0.0, -5.0])
    rig.run_for(0.0025)
    rig.core.state.pos = rig.core.state.pos - [0, 0, climb_m]
    arm(rig)
    assert rig.core.control.vehicle.in_flight is in_flight


@pytest.mark.parametrize(("flying_ms", "in_flight"), [(5000, False), (5001, True)])
def test_vehicle_flies_when_it_says_so_for_5_s(make_core: MakeCore, flying_ms: int, in_flight: bool) -> None:
    rig = make_core()
    arm(rig, flying_ms=flying_ms)
    assert rig.core.control.vehicle.in_flight is in_flight


def test_vehicle_flies_until_it_is_disarmed(make_core: MakeCore) -> None:
    rig = make_core()
    arm(rig, flying_ms=6000)
    arm(rig, flying_ms=0)
    assert rig.core.control.vehicle.in_flight
    rig.frame["armed"] = False
    rig.run_for(0.0025)
    assert not rig.core.control.vehicle.in_flight


@pytest.mark.parametrize(("fields", "near"), [
    ({}, False),
    ({"takeoff_expected": True}, True),
    ({"touchdown_expected": True}, True),
])  # fmt: skip
def test_vehicle_that_expects_the_ground_is_near_it(make_core: MakeCore, fields: dict[str, bool], near: bool) -> None:
    rig = make_core()
    arm(rig, **fields)
    assert rig.core.control.vehicle.near_ground is near


# What starts aiding


def test_pose_starts_aiding_one_frame_after_the_step_in_which_it_came_due(make_core: MakeCore) -> None:
    rig = make_core()
    rig.told()
    rig.pose(1, 2, -0.5)
    while not rig.core.delayed.has_pose:
        rig.run_for(0.0025)
    assert [text for _, text in rig.said] == ["yaw aligned"]
    rig.run_for(0.0025)
    assert rig.told() == ["yaw aligned", "is using external nav data", "initial pos NED = 1.0,2.0,-0.5 (m)"]


def test_aiding_by_a_pose_resets_position_height_and_velocity_to_it(make_core: MakeCore) -> None:
    rig = make_core("60106")
    rig.core.state.vel = np.array([1.0, 1.0, 1.0])
    rig.pose(1, 2, -5)
    while rig.core.aiding.mode is AidingMode.NONE:
        rig.run_for(0.0025)
    assert rig.core.state.pos == pytest.approx([1, 2, -5])
    assert rig.core.state.vel == pytest.approx([0, 0, 0])
    diagonal = rig.core.state.cov.diagonal()
    assert diagonal[POS] == pytest.approx([0.04, 0.04, 0.04], rel=0.01)
    assert diagonal[VEL] == pytest.approx([625, 625, 0.25], rel=0.01)
    assert (rig.core.aiding.pos_timeout, rig.core.aiding.vel_timeout) == (False, False)


def test_velocity_that_was_ever_received_is_told_and_taken_as_aiding_starts(make_core: MakeCore) -> None:
    rig = make_core("60106")
    rig.told()
    rig.stream(0.2, rig.pose, lambda: rig.speed(1, -0.04, 2))
    assert rig.told()[-1] == "initial vel NED = 1.0,-0.0,2.0 (m/s)"


def test_velocity_that_was_received_but_has_not_come_due_is_told_as_0(make_core: MakeCore) -> None:
    rig = make_core()
    rig.core.ingest.have_velocity = True
    rig.told()
    rig.stream(0.2, rig.pose)
    assert rig.told()[-1] == "initial vel NED = 0.0,0.0,0.0 (m/s)"


def test_pose_does_not_start_aiding_before_tilt_is_known(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.01)
    rig.pose()
    rig.run_for(0.2)
    assert not rig.core.control.tilt_aligned
    assert rig.core.aiding.mode is AidingMode.NONE


def by_gps(make_core: MakeCore) -> "CoreRig":
    """Return a core that has all that it takes to start by GPS, but for solutions."""
    rig = make_core("30101", has_compass=True)
    rig.core.set_origin(HOME)
    rig.core.gps.checks.good = True
    rig.core.state.clear(GYRO, 1e-10)
    return rig


def fix(rig: "CoreRig") -> None:
    rig.frame["gps"] = GpsSample(rig.now_ms, 3, HOME, Vector3f(), num_sats=10, hdop=100)


def test_gps_starts_aiding_when_all_is_well(make_core: MakeCore) -> None:
    rig = by_gps(make_core)
    rig.stream(1.0, lambda: fix(rig), period_s=0.2)
    assert "is using GPS" in rig.told()
    assert rig.core.aiding.mode is AidingMode.ABSOLUTE


@pytest.mark.parametrize("lack", ["checks", "yaw", "gyros", "source"])
def test_gps_does_not_start_aiding_while_something_is_lacking(make_core: MakeCore, lack: str) -> None:
    rig = by_gps(make_core)
    if lack == "checks":
        rig.core.gps.checks.good = False
    elif lack == "yaw":
        rig.core.yaw.aligned, rig.field = False, None
    elif lack == "gyros":
        rig.core.state.clear(GYRO, 1e-6)
    else:
        rig.params.set("EK3_SRC1_POSXY", 0)
    rig.stream(1.0, lambda: fix(rig), period_s=0.2)
    assert rig.core.aiding.mode is AidingMode.NONE


def odometry(rig: "CoreRig", *, quality: float = 100.0) -> None:
    deltas = Vector3f(), Vector3f(), f32(0.05)
    rig.core.ingest.write_odometry(f32(quality), deltas, rig.now_ms, 10, Vector3f())


@pytest.mark.parametrize(("gyro_deg_s", "starts"), [(0.14, True), (0.4, False)])
def test_odometry_starts_relative_aiding_once_gyros_are_known(
    make_core: MakeCore, gyro_deg_s: float, starts: bool
) -> None:
    rig = make_core("06101", has_compass=True)
    rig.core.state.clear(GYRO, np.radians(gyro_deg_s * rig.core.dt_ekf_avg) ** 2)
    rig.told()
    rig.stream(0.3, lambda: odometry(rig), period_s=0.06)
    assert (rig.core.aiding.mode is AidingMode.RELATIVE) is starts
    assert ("started relative aiding" in rig.told()) is starts


def test_odometry_from_the_beginning_starts_relative_aiding_as_soon_as_tilt_is_known(make_core: MakeCore) -> None:
    rig = make_core("06000", run_s=0.1)
    rig.stream(6, lambda: odometry(rig), period_s=0.06)
    times_ms = {text: time_ms for time_ms, text in rig.said}
    assert times_ms["started relative aiding"] == times_ms["tilt alignment complete"]


def test_poor_odometry_starts_nothing(make_core: MakeCore) -> None:
    rig = make_core("06101", has_compass=True)
    rig.core.state.clear(GYRO, 1e-12)
    rig.stream(0.3, lambda: odometry(rig, quality=-20), period_s=0.06)
    assert rig.core.aiding.mode is AidingMode.NONE


@pytest.mark.parametrize(("after_s", "starts"), [(0.185, True), (0.195, False)])
def test_odometry_starts_aiding_within_200_ms_of_its_time(make_core: MakeCore, after_s: float, starts: bool) -> None:
    rig = make_core("06101", has_compass=True)
    odometry(rig)  # it is of 10 ms ago
    rig.run_for(after_s)
    rig.core.state.clear(GYRO, 1e-12)
    rig.run_for(0.0025)
    assert (rig.core.aiding.mode is AidingMode.RELATIVE) is starts


# What ends it


def test_vehicle_without_any_yaw_source_does_not_navigate_on_the_ground(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    rig.params.set("EK3_SRC1_YAW", 0)
    rig.run_for(0.0025)
    assert rig.told() == ["stopped aiding"]
    assert not rig.core.yaw.aligned


def test_end_of_aiding_holds_the_position_and_puts_height_where_the_barometer_is(make_core: MakeCore) -> None:
    rig = make_core("60106")
    rig.height = 0.5
    rig.stream(3.0, lambda: rig.pose(3, 4, -0.5))
    rig.core.odometry.is_fused = True
    rig.core.fusion.innovations.pos_ratio = rig.core.fusion.innovations.vel_ratio = 7.0
    before = rig.core.output.now.pos.copy()
    rig.core.aiding.times.pos = rig.core.aiding.times.vel = rig.now_ms - ALL_LOST_MS - 1
    rig.run_for(0.0025)
    assert rig.core.aiding.mode is AidingMode.NONE
    assert rig.core.state.pos == pytest.approx([3, 4, -0.5], abs=0.2)
    assert rig.core.state.pos[2] == pytest.approx(-0.5, abs=1e-3)
    assert rig.core.resets.last_known_ne == pytest.approx([3, 4], abs=0.1)
    assert rig.core.output.now.pos[2] == pytest.approx(before[2], abs=0.01)
    assert (rig.core.fusion.innovations.pos_ratio, rig.core.fusion.innovations.vel_ratio) == (0, 0)
    assert (rig.core.aiding.pos_timeout, rig.core.aiding.vel_timeout) == (False, True)
    assert not rig.core.odometry.is_fused


# Health


def test_core_is_healthy_a_second_after_it_began(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.005)
    healthy_ms = rig.now_ms + 1000
    assert not rig.core.control.healthy(healthy_ms - 1)
    assert rig.core.control.healthy(healthy_ms)


@pytest.mark.parametrize(("ratios", "healthy"), [
    ((1.1, 1.1, 1.1), False),
    ((0.9, 1.1, 1.1), True),
    ((1.1, 0.9, 1.1), True),
    ((1.1, 1.1, 0.9), True),
])  # fmt: skip
def test_core_is_unhealthy_when_everything_fails_its_gate(
    make_core: MakeCore, ratios: tuple[float, float, float], healthy: bool
) -> None:
    rig = navigating(make_core)
    innovations = rig.core.fusion.innovations
    innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio = ratios
    assert rig.core.control.healthy(rig.now_ms) is healthy


@pytest.mark.parametrize(("innovation", "armed", "aiding", "healthy"), [
    ((0.7, 0.7), False, False, True),
    ((0.8, 0.8), False, False, False),
    ((0.8, 0.8), True, False, True),
    ((0.8, 0.8), False, True, True),
])  # fmt: skip
def test_core_is_unhealthy_when_a_parked_vehicle_seems_to_move(
    make_core: MakeCore, innovation: tuple[float, float], armed: bool, aiding: bool, healthy: bool
) -> None:
    rig = navigating(make_core) if aiding else make_core()
    if armed:
        arm(rig)
    rig.core.fusion.innovations.pos[:2] = innovation
    assert rig.core.control.healthy(rig.now_ms) is healthy


# Flags


def test_flags_of_the_situations_that_were_recorded(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.1)
    assert rig.flags == 0
    rig.run_for(3)
    assert rig.flags == PARKED
    rig.stream(1.0, rig.pose)
    assert rig.flags == NAVIGATING
    rig.run_for(4.1)
    assert rig.flags == NAVIGATING & ~USING_POSITION


def test_core_without_tilt_is_initialised_and_no_more(make_core: MakeCore, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make_core(run_s=1.01)
    monkeypatch.setattr("ekf_stub.core.mode_control.TILT_ALIGNED_VAR", 0.0)
    rig.run_for(1.2)
    assert rig.flags == INITIALISED


def test_flags_tell_of_what_the_vehicle_expects(make_core: MakeCore) -> None:
    rig = make_core()
    rig.frame.update(takeoff_expected=True, touchdown_expected=True)
    rig.run_for(0.02)
    assert rig.flags == PARKED | TAKEOFF | TOUCHDOWN


@pytest.mark.slow
def test_flags_tell_of_the_gps(make_core: MakeCore) -> None:
    rig = by_gps(make_core)
    rig.stream(1.0, lambda: fix(rig), period_s=0.2)
    assert rig.flags == NAVIGATING | QUALITY_GOOD | GLITCHING  # its accuracy counts as good after 10 s
    rig.stream(10.2, lambda: fix(rig), period_s=0.2)
    assert rig.flags == NAVIGATING | QUALITY_GOOD


def test_flags_of_relative_aiding(make_core: MakeCore) -> None:
    rig = make_core("06101", has_compass=True)
    rig.core.state.clear(GYRO, 1e-12)
    rig.stream(0.5, lambda: odometry(rig), period_s=0.06)
    assert rig.flags == MOVING


# Timeouts


@pytest.mark.parametrize(("now_ms", "drag"), [(5000, 0), (5001, 32)])
def test_airspeed_is_always_lost_and_drag_5_s_after_boot(make_core: MakeCore, now_ms: int, drag: int) -> None:
    assert make_core().core.control.timeouts(now_ms) == 16 + 2 + drag


@pytest.mark.parametrize(("what", "bit"), [("pos", 1), ("vel", 2), ("height", 4)])
def test_what_is_lost_has_a_bit_each(make_core: MakeCore, what: str, bit: int) -> None:
    rig = navigating(make_core)
    assert rig.core.control.timeouts(rig.now_ms) == 48
    rig.core.aiding.pos_timeout = what == "pos"
    rig.core.aiding.vel_timeout = what == "vel"
    rig.core.height.is_lost = what == "height"
    assert rig.core.control.timeouts(rig.now_ms) == 48 + bit


def test_tilt_counts_as_known_below_5_degrees(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.01)
    rig.core.state.clear(ATT, np.radians(1.0) ** 2)
    rig.run_for(0.03)
    assert rig.core.control.tilt_aligned
    assert "tilt alignment complete" in rig.told()


# Without a yaw source


def test_vehicle_without_yaw_forgets_its_flight_as_it_is_disarmed(make_core: MakeCore) -> None:
    rig = make_core("66660", run_s=4.0)
    arm(rig)
    rig.stream(1.0, rig.pose)
    core = rig.core
    core.yaw.aligned = True
    core.state.pos, core.state.vel = np.array([3.0, -2.0, -1.0]), np.array([1.0, 2.0, 0.0])
    before = core.state.cov.diagonal()[GYRO].copy()
    rig.told()
    rig.frame["armed"] = False
    rig.run_for(0.0025)
    assert rig.told() == ["stopped aiding"]
    assert not core.yaw.aligned
    assert core.state.pos[:2] == pytest.approx([0, 0], abs=1e-3)
    assert core.state.vel == pytest.approx([0, 0, 0], abs=0.01)
    assert core.state.cov.diagonal()[GYRO] == pytest.approx(before, rel=0.01)
