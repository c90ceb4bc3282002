# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One core: starting up, restarting, its origin, and places and heights that others tell it."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.core.frame import Frame
from ekf_stub.filter.attitude import euler_of
from ekf_stub.filter.inactive_biases import GAIN, ImuRates
from ekf_stub.filter.inertial import EKF_TARGET_DT, GRAVITY_MSS, InertialDelta
from ekf_stub.filter.states import POS, VEL
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.gps_sample import GpsSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.core_rig import CoreRig

MakeCore = Callable[..., "CoreRig"]

START_MS = 10_000
HOME = Location(-353632610, 1491652300, 58400)
STEP_MS = 13


def navigating(make_core: MakeCore, sources: str = "66666", **params: float) -> "CoreRig":
    """Return a core that navigates by poses of 0, and has no more to tell."""
    rig = make_core(sources, **params)
    rig.stream(1.0, rig.pose)
    assert rig.core.aiding.mode is AidingMode.ABSOLUTE
    rig.told()
    return rig


# Starting up


def test_core_has_a_state_after_a_second_of_inertial_data(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.0)
    assert not rig.core.initialised
    rig.run_for(0.01)
    assert rig.core.initialised
    assert rig.said == [(START_MS + 1002, "initialised")]


def test_core_steps_80_times_a_second(make_core: MakeCore) -> None:
    rig = make_core()
    steps = 0
    for _ in range(400):
        rig.run_for(0.0025)
        steps += rig.core.stepped
    assert steps == 80
    assert rig.core.dt_ekf_avg == pytest.approx(0.0125, rel=1e-3)


def test_data_of_the_frame_after_the_state_began_count_twice(make_core: MakeCore) -> None:
    rig, dt = make_core(run_s=1.0025), 0.0054  # of which two make a step
    assert rig.core.initialised
    rig.now_us += 2500
    delta = InertialDelta(np.array(rig.accel) * dt, np.zeros(3), dt, dt)
    rig.core.run(Frame(rig.now_us, delta, **rig.frame))
    assert rig.core.stepped


def test_core_that_is_late_steps_every_ninth_frame(make_core: MakeCore) -> None:
    rig = make_core()
    rig.frame["is_late"] = True
    made = []
    for frame in range(60):
        rig.run_for(0.0025)
        made += [frame] * rig.core.stepped
    assert {after - before for before, after in pairwise(made)} == {9}


def test_horizon_lies_as_many_steps_back_as_the_buffer_is_long(make_core: MakeCore) -> None:
    rig = make_core()
    while not rig.core.stepped:
        rig.run_for(0.0025)
    assert rig.now_ms - rig.core.ingest.horizon_ms == pytest.approx(62.5, abs=1)


@pytest.mark.parametrize("rpy_deg", [(0.0, 0.0), (10.0, 0.0), (0.0, -10.0), (20.0, 30.0), (180.0, 0.0), (0.0, 89.0)])
def test_first_attitude_is_what_the_accelerometers_show(make_core: MakeCore, rpy_deg: tuple[float, float]) -> None:
    roll, pitch = map(math.radians, rpy_deg)
    rig = make_core(run_s=0.0)
    down = np.array([-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)])
    rig.accel = -GRAVITY_MSS * down
    rig.run_for(1.01)
    found = euler_of(rig.core.state.quat)
    assert abs(math.remainder(found[0] - roll, 2 * math.pi)) < 1e-3
    assert found[1:] == pytest.approx((pitch, 0.0), abs=1e-3)


def test_first_variances_are_those_of_the_parameters(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.0025, VELNE_M_NSE=0.4, VELD_M_NSE=0.6, POSNE_M_NSE=0.7, ALT_M_NSE=3.0)
    diagonal = rig.core.state.cov.diagonal()
    assert diagonal[VEL] == pytest.approx([0.16, 0.16, 0.36])
    assert diagonal[POS] == pytest.approx([0.49, 0.49, 9.0])
    assert diagonal[10:13].tolist() == [0, 0, 0]


def test_biases_are_learned_from_the_frame_after_tilt_is_known_on(make_core: MakeCore) -> None:
    rig = make_core(run_s=1.0025)
    while "tilt alignment complete" not in rig.told():
        assert not rig.core.state.learns_biases
        rig.run_for(0.0025)
    assert START_MS + 1500 < rig.now_ms < START_MS + 3000
    assert not rig.core.state.learns_biases  # in that frame their variances are still 0
    rig.run_for(0.0025)
    assert rig.core.state.learns_biases
    gyro, accel = math.radians(2.5) * rig.core.dt_ekf_avg, 0.2 * rig.core.dt_ekf_avg
    diagonal = rig.core.state.cov.diagonal()
    assert diagonal[10:13] == pytest.approx([gyro**2] * 3, rel=0.02)
    assert diagonal[15] == pytest.approx(accel**2, rel=0.02)


def test_earth_turns_as_it_does_at_home(make_core: MakeCore) -> None:
    rig = make_core(run_s=0.0)
    rig.frame["home_lat"] = HOME.lat
    rig.run_for(1.01)
    latitude = math.radians(-35.3632610)
    expected = 7.292115e-5 * np.array([math.cos(latitude), 0, -math.sin(latitude)])
    assert rig.core.state.earth_rate_ned == pytest.approx(expected)


def test_turning_vehicle_turns_in_the_filter(make_core: MakeCore) -> None:
    rig = make_core("00101", run_s=1.01)
    rig.rate = (0.0, 0.0, 0.5)
    rig.run_for(2.0)
    assert euler_of(rig.core.output.now.quat)[2] == pytest.approx(1.0, abs=0.02)


def test_accelerating_vehicle_moves_in_the_filter(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    rig.accel = (2.0, 0.0, -GRAVITY_MSS)
    rig.run_for(1.0)
    assert rig.core.output.now.vel == pytest.approx([2, 0, 0], abs=0.2)
    assert rig.core.output.now.pos == pytest.approx([1, 0, 0], abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("sources", ["66666", "00101"])
def test_bias_of_a_gyro_is_found(make_core: MakeCore, sources: str) -> None:
    rig = make_core(sources)
    rig.rate = (0.01, -0.02, 0.0)
    rig.run_for(15)
    assert rig.core.state.gyro_bias[:2] / rig.core.dt_ekf_avg == pytest.approx([0.01, -0.02], abs=0.003)


# Restarting


def moving_feed(rig: "CoreRig") -> None:
    """Let velocities say that the parked vehicle moves, until nothing is right any more."""
    while rig.flags:
        rig.stream(0.035, lambda: rig.speed(1.5))
    rig.told()


@pytest.mark.slow
def test_core_without_any_flag_for_5_s_begins_anew(make_core: MakeCore) -> None:
    rig = make_core("06166")
    moving_feed(rig)
    rig.stream(4.9, lambda: rig.speed(1.5))
    assert (rig.flags, rig.told()) == (0, [])
    rig.stream(0.2, lambda: rig.speed(1.5))
    assert rig.told() == ["forced reset", "initialised"]
    assert rig.core.state.pos.tolist() == pytest.approx([0, 0, 0], abs=0.1)
    rig.run_for(2.5)
    assert rig.told() == ["tilt alignment complete"]
    assert rig.flags == 0x100A7


def test_core_that_begins_anew_forgets_what_it_was_given(make_core: MakeCore) -> None:
    rig = make_core("06166")
    moving_feed(rig)
    rig.stream(4.9, lambda: rig.speed(1.5))
    assert rig.core.ingest.have_velocity
    rig.run_for(0.2)
    assert not rig.core.ingest.have_velocity
    assert (rig.core.aiding.mode, rig.core.yaw_resets) == (AidingMode.NONE, 0)


def test_armed_core_does_not_begin_anew(make_core: MakeCore, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = navigating(make_core)
    rig.frame["armed"] = True
    monkeypatch.setattr(rig.core.control, "healthy", lambda now_ms: False)
    rig.run_for(12)
    assert rig.flags == 0
    assert "forced reset" not in rig.told()


def test_core_that_never_had_a_flag_does_not_begin_anew(make_core: MakeCore, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make_core(run_s=1.01)
    monkeypatch.setattr(rig.core.control, "healthy", lambda now_ms: False)
    rig.run_for(7)
    assert rig.flags == 0
    assert "forced reset" not in rig.told()


@pytest.mark.slow
def test_core_that_begins_anew_keeps_its_origin_and_tells_of_it(make_core: MakeCore) -> None:
    rig = make_core("06166")
    rig.core.set_origin(HOME)
    rig.told()
    rig.stream(20, lambda: rig.speed(1.5))
    told = rig.told()
    assert told[:3] == ["forced reset", "origin set", "initialised"]
    assert rig.core.origin == HOME


# Its origin


def test_origin_is_set_once(make_core: MakeCore) -> None:
    rig = make_core()
    rig.told()
    assert rig.core.set_origin(HOME)
    assert not rig.core.set_origin(Location(1, 2, 3))
    assert (rig.core.origin, rig.core.origin_alt_cm()) == (HOME, 58400)
    assert rig.told() == ["origin set"]


def test_origin_leaves_the_position_and_moves_the_earth(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    before = rig.core.position()
    rig.core.set_origin(HOME)
    assert rig.core.position() == pytest.approx(before)
    latitude = math.radians(-35.3632610)
    assert rig.core.state.earth_rate_ned[2] == pytest.approx(-7.292115e-5 * math.sin(latitude))


def test_origin_may_be_set_before_there_is_a_state(make_core: MakeCore) -> None:
    rig = make_core(run_s=0.5)
    assert rig.core.set_origin(HOME)
    rig.run_for(1.0)
    assert rig.core.origin == HOME
    assert rig.core.origin_alt_cm() == 58400


@pytest.mark.parametrize(
    ("alt_cm", "told_cm"), [(58400, 58400), (58408, 58408), (58409, 58408), (58410, 58409), (58428, 58427)]
)
def test_told_height_of_the_origin_has_been_through_single_precision(
    make_core: MakeCore, alt_cm: int, told_cm: int
) -> None:
    rig = make_core()
    rig.core.set_origin(Location(HOME.lat, HOME.lng, alt_cm))
    assert rig.core.origin_alt_cm() == told_cm
    assert rig.core.position()[2] == pytest.approx(rig.core.output.now.pos[2] + 0.01 * (alt_cm - told_cm), abs=1e-9)


def gps(rig: "CoreRig", place: Location = HOME, **fields: Any) -> None:
    values: dict[str, Any] = {"fix_type": 3, "vel_ned": Vector3f(), "num_sats": 10, "hdop": 100, **fields}
    rig.frame["gps"] = GpsSample(time_ms=rig.now_ms, location=place, **values)


@pytest.mark.slow
def test_good_gps_sets_the_origin(make_core: MakeCore) -> None:
    rig = make_core("30101")
    rig.told()
    rig.stream(10.0, lambda: gps(rig), period_s=0.2)
    assert rig.core.origin is None
    rig.stream(0.6, lambda: gps(rig), period_s=0.2)
    assert rig.core.origin == HOME
    assert rig.told() == ["origin set"]


@pytest.mark.slow
def test_gps_does_not_move_an_origin_that_was_set(make_core: MakeCore) -> None:
    rig = make_core("30101")
    rig.core.set_origin(Location(1, 2, 3))
    rig.stream(11.0, lambda: gps(rig), period_s=0.2)
    assert rig.core.origin == Location(1, 2, 3)


@pytest.mark.parametrize(("has_origin", "known"), [(False, False), (True, True)])
def test_without_aiding_the_position_is_unknown_until_there_is_an_origin(
    make_core: MakeCore, has_origin: bool, known: bool
) -> None:
    rig = make_core()
    rig.core.output.overwrite(pos={0: 3.0, 1: 4.0, 2: 5.0})
    if has_origin:
        rig.core.set_origin(HOME)
    assert rig.core.position() == pytest.approx([3, 4, 5] if known else [0, 0, 5])


@pytest.mark.parametrize(("fix_type", "north"), [(1, 3.0), (2, 30.0), (3, 30.0)])
def test_without_aiding_the_position_is_the_gpss_if_it_has_a_fix(
    make_core: MakeCore, fix_type: int, north: float
) -> None:
    rig = make_core()
    rig.core.set_origin(HOME)
    rig.core.output.overwrite(pos={0: 3.0, 1: 4.0, 2: 5.0})
    gps(rig, HOME.offset(Vector3f(30, 40, 0)), fix_type=fix_type)
    rig.run_for(0.0025)
    assert rig.core.position() == pytest.approx([north, 4 / 3 * north, 5], abs=0.1)


def test_gps_does_not_count_for_the_position_while_aiding(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    rig.core.set_origin(HOME)
    gps(rig, HOME.offset(Vector3f(30, 40, 0)))
    rig.run_for(0.0025)
    assert rig.core.position() == pytest.approx([0, 0, 0], abs=0.05)


# Several cores


def test_position_counts_from_the_origin_that_all_cores_share(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    rig.core._common.place = HOME.offset(Vector3f(-100, 50, 2))
    assert rig.core.position()[:2] != pytest.approx([0, 0], abs=1e6)  # from 0 N, 0 E, while it has none of its own
    rig.core.set_origin(HOME)
    assert rig.core.position() == pytest.approx([100, -50, -2], abs=0.05)


def test_imu_that_stands_in_brings_its_own_bias(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    own, other = (0.0, 0.0, 0.0), (0.05, 0.0, 0.0)
    for _ in range(400):
        rig.frame["imu_rates"] = ImuRates(0, 0, [own, other], [own, own])
        rig.run_for(0.0025)
    before = rig.core.state.gyro_bias.copy()
    rig.frame["imu_rates"] = ImuRates(1, 0, [None, other], [own, own])
    rig.run_for(0.0025)
    learned = rig.core.state.gyro_bias - before
    assert learned == pytest.approx([400 * GAIN * EKF_TARGET_DT * 0.05, 0, 0], rel=0.1, abs=1e-7)


def test_score_is_that_of_the_worst_innovation(make_core: MakeCore, monkeypatch: pytest.MonkeyPatch) -> None:
    rig, affinity = navigating(make_core), 0.0
    core, innovations = rig.core, rig.core.fusion.innovations
    monkeypatch.setattr(core, "_get_float", lambda _name: affinity)
    assert not core.yaw.aligned or core.is_aligned
    core.yaw.aligned = True
    innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio = 0.2, 0.6, 0.3
    core.yaw.field.ratios[:] = 0.5, 1.0, 1.5
    assert core.error_score() == pytest.approx(0.4)
    innovations.height_ratio = 0.5
    assert core.error_score() == 0.5
    affinity = 4.0  # of the compass
    assert core.error_score() == pytest.approx(0.9)
    core.yaw.aligned = False
    assert core.error_score() == 0.0


# A place from elsewhere


def lost(make_core: MakeCore) -> "CoreRig":
    """Return a core with an origin whose poses ended 1.5 s ago."""
    rig = navigating(make_core)
    rig.core.set_origin(HOME)
    rig.run_for(1.5)
    return rig


def test_place_is_taken_when_no_position_has_passed_for_a_second(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    rig.core.set_origin(HOME)
    place = HOME.offset(Vector3f(50, -20, 9))
    rig.run_for(0.9)
    assert not rig.core.set_place(place, 1.0, rig.now_ms)
    rig.run_for(0.2)
    assert rig.core.set_place(place, 1.0, rig.now_ms)
    assert rig.core.state.pos == pytest.approx([50, -20, 0], abs=0.1)
    assert rig.core.output.now.pos == pytest.approx([50, -20, 0], abs=0.1)
    assert rig.core.resets.moved_ne == pytest.approx([50, -20], abs=0.1)


@pytest.mark.parametrize(("accuracy_m", "sigma"), [(3.0, 3.0), (0.1, 0.5), (math.nan, 0.5)])
def test_place_is_as_uncertain_as_is_said_but_not_less_than_the_parameter(
    make_core: MakeCore, accuracy_m: float, sigma: float
) -> None:
    rig = lost(make_core)
    assert rig.core.set_place(HOME, accuracy_m, rig.now_ms)
    assert rig.core.state.cov.diagonal()[POS.start : POS.start + 2] == pytest.approx([sigma**2] * 2)


@pytest.mark.parametrize(("age_ms", "ahead_s"), [(1000, 1.0), (0, 0.0), (-500, 0.0), (60_000, 5.0)])
def test_old_place_is_carried_on_by_the_velocity(make_core: MakeCore, age_ms: int, ahead_s: float) -> None:
    rig = lost(make_core)
    rig.core.state.vel = np.array([2.0, -4.0, 1.0])
    horizon_s = 1e-3 * (rig.now_ms - rig.core.ingest.horizon_ms)
    assert rig.core.set_place(HOME, 1.0, rig.now_ms - age_ms)
    expected = (ahead_s - horizon_s) * np.array([2.0, -4.0])
    assert rig.core.state.pos[:2] == pytest.approx(expected, abs=0.01)


def test_place_needs_an_origin_and_a_vehicle_that_navigates(make_core: MakeCore) -> None:
    rig = navigating(make_core)
    rig.run_for(1.5)
    assert not rig.core.set_place(HOME, 1.0, rig.now_ms)
    rig = make_core()
    rig.core.set_origin(HOME)
    assert not rig.core.set_place(HOME, 1.0, rig.now_ms)


# Its height


@pytest.mark.slow
def test_height_counts_from_where_the_vehicle_stands_and_the_origin_goes_there(make_core: MakeCore) -> None:
    rig = make_core("60166", run_s=4.0)
    rig.core.set_origin(HOME)
    rig.height = 3.0
    rig.run_for(10)
    down = float(rig.core.state.pos[2])
    assert down == pytest.approx(-3, abs=0.5)
    assert rig.core.reset_height_datum()
    assert rig.core.state.pos[2] == 0
    assert rig.core.origin_alt_cm() == 58400 + int(-100 * down) - 1  # single precision loses one
    assert rig.core.origin == HOME


def test_height_is_not_begun_anew_before_there_is_a_state_or_in_the_air(make_core: MakeCore) -> None:
    rig = make_core(run_s=0.5)
    assert not rig.core.reset_height_datum()
    rig.run_for(1.0)
    assert rig.core.reset_height_datum()
    rig.frame["armed"] = True
    rig.run_for(0.0025)
    assert not rig.core.reset_height_datum()


# What it is asked


def test_camera_counts_as_the_yaw_just_after_boot_even_without_a_state(make_core: MakeCore) -> None:
    rig = make_core(run_s=0.5)
    assert rig.core.uses_ext_nav_for_yaw(4999)
    assert not rig.core.uses_ext_nav_for_yaw(5000)
    assert not make_core("66661", run_s=0.5).core.uses_ext_nav_for_yaw(4999)


@pytest.mark.slow
def test_stillness_is_judged_on_the_ground_without_a_compass(make_core: MakeCore) -> None:
    rig = make_core(run_s=10)
    assert rig.core.is_still() is True
    rig.frame["armed"] = True
    rig.run_for(0.01)
    assert rig.core.is_still() is None
    assert make_core("66661", has_compass=True).core.is_still() is None


def test_same_barometer_reading_counts_once(make_core: MakeCore) -> None:
    """Without aiding every height goes with an assumed position, so that its times tell of heights."""
    rig = make_core("00101")
    times = set()
    for _ in range(400):
        rig.run_for(0.0025)
        times.add(rig.core.aiding.times.height)
    assert len(times) == 11


def test_core_without_a_barometer_loses_its_height_after_5_s(make_core: MakeCore) -> None:
    rig = make_core("00101")
    rig.height = None
    rig.run_for(4.9)
    assert not rig.core.height.is_lost
    rig.run_for(0.3)
    assert rig.core.height.is_lost
    assert rig.flags == 0x10083
