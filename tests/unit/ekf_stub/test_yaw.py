# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where yaw comes from, when it is set and how it is fused: by the camera, by GPS, by its velocity, or not at all."""

import itertools
import math
from typing import Any

import pytest

from ap_core.vector3 import Vector3f
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import euler_of, wrap_pi
from ekf_stub.release import FEBRUARY_2026, JULY_2025, FilterRelease
from tests.unit.ekf_stub.filter_rig import (
    HOME,
    MODE_ABSOLUTE,
    SLOW_LOOP_US,
    FilterRig,
    Start,
    by_gps,
    compared,
    has_pose,
    navigating,
    standing,
)

GATE = 9.0  # EK3_YAW_I_GATE of 300, squared
FIVE_DEG = math.radians(5)


def seen(sources: str = "66666", **options: object) -> FilterRig:
    """Return a vehicle whose yaw was aligned to north by its camera, and whose sensors say nothing for now."""
    rig = navigating(sources, **options)
    rig.lose("camera", "baro")
    rig.forget()
    return rig


def tell(start: Start, yaw: float, err: float = 0.2) -> tuple[FilterRig, FilterRig]:
    """Let a yaw come due in a vehicle; return it and one without."""

    def say(rig: FilterRig) -> None:
        rig.camera(yaw=yaw, yaw_err=err)

    return compared(start, say, has_pose)


def yaw_variance(rig: FilterRig) -> float:
    return rig.core.state.look_along_yaw(True)


# By the camera


def test_first_yaw_is_aligned_to_and_tilt_stays() -> None:
    rig = FilterRig()
    rig.roll, rig.pitch = 0.02, -0.02
    rig.run(3.0)
    tilt = rig.report.tilt_error_rad
    rig.forget()
    rig.camera(yaw=1.5, yaw_err=0.3)
    rig.run_until(lambda: rig.core.yaw.aligned)
    assert euler_of(rig.core.state.quat) == pytest.approx((0.02, -0.02, 1.5), abs=1e-3)  # what tilt was off by before
    assert rig.told()[0] == "yaw aligned"
    assert rig.core.yaw_resets == 1
    assert ("yaw", "model_aligned") in rig.became()
    # AND it is as uncertain as it was measured, and tilt as before
    assert yaw_variance(rig) == pytest.approx(0.3**2, rel=0.03)  # along the axes of the body, for the most part
    assert rig.report.tilt_error_rad == pytest.approx(tilt, rel=0.02)  # a little of yaw looks like it
    # AND the outputs have turned by as much, and what attitude had to do with other states is forgotten
    assert rig.report.rpy_rad[2] == pytest.approx(1.5, abs=1e-3)
    assert not rig.covariance()[:4, 4:7].any()


def test_yaw_waits_for_tilt_but_counts_as_in_use() -> None:
    rig = standing(run_s=1.1)
    assert not rig.core.uses_ext_nav_for_yaw(rig.now_ms)
    rig.camera(yaw=1.5)
    rig.run(0.2)
    assert not rig.core.yaw.aligned
    assert ("yaw", "model_unused") in rig.became()
    assert rig.core.uses_ext_nav_for_yaw(rig.now_ms)


@pytest.mark.parametrize(("err", "noise"), [(0.2, 0.2), (0.0, FIVE_DEG), (0.06, FIVE_DEG), (0.5, 0.5)])
def test_yaw_is_fused_with_its_error_of_5_degrees_at_least(err: float, noise: float) -> None:
    told, other = tell(seen, 0.1, err)
    spread = yaw_variance(other) + noise**2
    innovation = other.heading - 0.1
    assert told.report.yaw_innovation == pytest.approx(innovation, abs=1e-6)
    assert told.report.yaw_ratio == pytest.approx(innovation**2 / (GATE * spread), rel=1e-3)
    assert told.heading - other.heading == pytest.approx(-innovation * yaw_variance(other) / spread, rel=1e-2)
    code, ratio, tested = told.last_test("yaw")
    assert (code, ratio, tested) == ("model_fused", pytest.approx(math.sqrt(told.report.yaw_ratio)), abs(innovation))
    assert told.told() == []


def test_innovation_goes_the_short_way_round() -> None:
    def start() -> FilterRig:
        rig = FilterRig(loop_us=SLOW_LOOP_US)
        rig.yaw = 3.1
        rig.feeds.add("camera")
        rig.run(3.5)
        rig.lose("camera")
        return rig

    told, other = tell(start, -3.1)
    assert told.report.yaw_innovation == pytest.approx(6.2 - 2 * math.pi, abs=0.01)
    assert told.heading > other.heading or told.heading < 0


@pytest.mark.parametrize(("in_flight", "is_fused"), [(False, True), (True, False)])
def test_yaw_beyond_the_gate_is_rejected_in_flight_only(in_flight: bool, is_fused: bool) -> None:
    def start() -> FilterRig:
        rig = seen()
        if in_flight:
            rig.arm()
            rig.flying_ms = 6000
            rig.run(0.1)
            assert rig.core.vehicle.in_flight
        return rig

    told, other = tell(start, 1.57)
    assert told.report.yaw_innovation == pytest.approx(-1.57, abs=0.01)
    assert told.report.yaw_ratio > 1
    # On the ground no more than half a radian of it counts.
    part = yaw_variance(other) / (yaw_variance(other) + 0.04)
    assert told.heading == pytest.approx(other.heading + (0.5 * part if is_fused else 0.0), rel=0.02, abs=1e-9)
    assert ("yaw", "model_fused" if is_fused else "model_gate_yaw") in told.became()


@pytest.mark.parametrize(("percent", "sigmas"), [(300, 3.0), (100, 1.0), (1, 1.0)])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_is_as_wide_as_its_parameter_but_not_less_than_a_sigma(
    percent: float, sigmas: float, passes: bool
) -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.set_param("YAW_I_GATE", percent)
        rig.arm()
        rig.flying_ms = 6000
        rig.run(0.1)
        return rig

    _, other = tell(start, 0.0)
    off = sigmas * math.sqrt(yaw_variance(other) + 0.04) * (0.999 if passes else 1.001)
    told, _ = tell(start, other.heading + off)
    assert ("yaw", "model_fused" if passes else "model_gate_yaw") in told.became()


def test_jump_of_the_camera_says_nothing_of_yaw() -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.reset_ms = 7
        return rig

    told, _ = tell(start, 1.0)
    assert told.core.yaw_resets == 1
    assert ("yaw", "model_fused") in told.became()


def test_source_that_was_another_one_aligns_anew() -> None:
    def start() -> FilterRig:
        rig = seen()
        rig.set_param("SRC1_YAW", 2)
        rig.run(0.1)
        rig.set_param("SRC1_YAW", 6)
        rig.run(0.1)
        return rig

    told, _ = tell(start, 1.5)
    assert "yaw aligned" in told.told()
    assert told.core.yaw_resets == 2
    assert told.heading == pytest.approx(1.5, abs=1e-3)


@pytest.mark.parametrize("sources", ["66661", "66662"])
def test_yaw_of_the_camera_is_not_used_for_another_source(sources: str) -> None:
    rig = standing(sources)
    rig.camera(yaw=1.5)
    rig.run(0.2)
    assert not rig.core.yaw.aligned
    assert abs(rig.heading) < 1e-3


# Assumed, while it is missing


def test_missing_yaw_is_assumed_to_stay_now_and_then_until_it_is_aligned() -> None:
    rig = standing()
    times = []
    before = yaw_variance(rig)
    for _ in range(200):
        rig.one_pass()
        if rig.core.stepped:
            if yaw_variance(rig) < before - 1e-7:
                times.append(rig.now_ms)
            before = yaw_variance(rig)
    # More than 140 ms after the last, in steps of 12.5 ms.
    assert {after - before for before, after in itertools.pairwise(times)} <= {149, 150, 151}
    assert len(times) >= 3
    assert rig.core.uses_ext_nav_for_yaw(rig.now_ms)


def test_yaw_is_not_assumed_after_it_was_aligned() -> None:
    rig = seen()
    before = yaw_variance(rig)
    rig.run(1.0)
    assert yaw_variance(rig) > before


def test_vehicle_that_stands_still_keeps_the_yaw_that_it_had_when_it_moved_last() -> None:
    # GIVEN a vehicle at rest without a source of yaw, whose gyro has a little bias
    rig = standing("66660", loop_us=SLOW_LOOP_US)
    rig.gyro_bias = [(0.0, 0.0, 0.01)]
    rig.run(10.0)
    # THEN it knows by its rest that it does not turn
    assert rig.core.stillness.is_still
    assert abs(rig.heading) < 0.02
    assert rig.report.gyro_bias[2] == pytest.approx(0.01, rel=0.2)  # still being learned


@pytest.mark.parametrize("sources", ["66660", "66668"])
def test_vehicle_without_a_yaw_to_measure_assumes_it(sources: str) -> None:
    rig = standing(sources)
    assert yaw_variance(rig) < 0.01
    assert not rig.core.yaw.aligned
    # AND by a camera it does not navigate on the ground
    rig.feeds.add("camera")
    rig.run(0.3)
    assert not rig.core.yaw.aligned


# Whether it is in use


@pytest.mark.parametrize(("after_ms", "in_use"), [(4999, True), (5000, False)])
def test_camera_counts_as_the_source_for_5_s_after_its_last_yaw(after_ms: int, in_use: bool) -> None:
    told, _ = tell(seen, 0.0)
    assert told.core.uses_ext_nav_for_yaw(told.now_ms + after_ms) is in_use
    told.set_param("SRC1_YAW", 1)
    assert not told.core.uses_ext_nav_for_yaw(told.now_ms)


def test_camera_counts_as_the_source_just_after_boot_even_without_a_state() -> None:
    rig = standing(run_s=0.5)
    assert rig.core.uses_ext_nav_for_yaw(4999)
    assert not rig.core.uses_ext_nav_for_yaw(5000)
    assert not standing("66661", run_s=0.5).core.uses_ext_nav_for_yaw(4999)


@pytest.mark.parametrize(("sources", "has_compass", "source", "uses"), [
    ("66661", True, 1, True),
    ("66661", False, 0, False),
    ("66663", True, 3, True),
    ("66663", False, 3, False),
    ("66666", True, 6, False),
])  # fmt: skip
def test_compass_that_is_not_there_is_no_source(sources: str, has_compass: bool, source: int, uses: bool) -> None:
    rig = standing(sources, has_compass=has_compass)
    assert (rig.core.yaw.source, rig.core.yaw.uses_compass) == (source, uses)


# Without a source


def test_vehicle_without_any_yaw_source_does_not_navigate_on_the_ground() -> None:
    rig = seen()
    rig.set_param("SRC1_YAW", 0)
    rig.one_pass()
    assert rig.told() == ["stopped aiding"]
    assert not rig.core.yaw.aligned


def test_vehicle_without_yaw_forgets_its_flight_as_it_is_disarmed() -> None:
    # GIVEN a vehicle without a source of yaw that is armed, and has gone somewhere
    rig = standing("66660", loop_us=SLOW_LOOP_US)
    rig.arm()
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    rig.move(1.0, -0.5, -0.2, 1.0)
    rig.run(1.0)
    assert rig.mode == MODE_ABSOLUTE
    assert rig.core.state.pos[0] > 1.0
    rig.lose("camera", "velocity")
    gyro = rig.report.variances[10:13]
    rig.forget()
    # WHEN it is disarmed
    rig.arm(False)
    rig.one_pass()
    # THEN it begins where it counts as being, knows no yaw, and keeps what it knows of its gyros
    assert rig.told() == ["stopped aiding"]
    assert not rig.core.yaw.aligned
    assert rig.core.state.pos[:2] == pytest.approx((0.0, 0.0), abs=1e-3)
    assert rig.core.state.vel[:2] == pytest.approx((0.0, 0.0), abs=1e-2)  # a step of what it felt
    assert rig.report.variances[10:13] == pytest.approx(gyro, rel=0.05)
    cov = rig.covariance()
    assert abs(cov[10:13, 4:10]).max() < 1e-3 * math.sqrt(cov[10, 10])


# By a GPS that gives yaw


def gps_yaw(sources: str, yaw_deg: float | None, *, run_s: float = 2.6) -> FilterRig:
    """Return a vehicle with an origin whose GPS gives a yaw."""
    rig = FilterRig(sources, has_compass=True)
    rig.feeds.discard("compass")
    rig.run(run_s)
    rig.lanes.set_origin(HOME)
    rig.gps = {"yaw_deg": yaw_deg}
    rig.feeds.add("gps")
    return rig


def test_gps_aligns_yaw_and_is_fused_with_5_degrees() -> None:
    rig = gps_yaw("66662", 270.0)
    rig.run(0.5)
    assert "yaw aligned" in rig.told()
    assert rig.heading == pytest.approx(-math.pi / 2, abs=1e-3)
    before = yaw_variance(rig)
    assert before == pytest.approx(FIVE_DEG**2 / 2, rel=0.6)  # once or twice measured
    rig.gps = {"yaw_deg": 276.0}
    rig.run_until(lambda: abs(rig.report.yaw_innovation) > 0.05)
    assert rig.report.yaw_innovation == pytest.approx(-math.radians(6), abs=1e-3)
    expected = math.radians(6) ** 2 / (GATE * (FIVE_DEG**2 + before))
    assert rig.report.yaw_ratio == pytest.approx(expected, rel=0.5)


def test_gps_without_a_yaw_leaves_it_assumed() -> None:
    rig = gps_yaw("66662", None)
    rig.run(0.5)
    assert not rig.core.yaw.aligned
    assert yaw_variance(rig) < 0.01


def test_gps_waits_for_tilt() -> None:
    rig = gps_yaw("66662", 270.0, run_s=1.1)
    rig.run(0.6)
    assert not rig.core.tilt_aligned
    assert not rig.core.yaw.aligned


def test_compass_is_not_used_beside_a_gps_that_gives_yaw_and_is_without() -> None:
    # GIVEN a GPS that says east, and a compass that says north
    rig = gps_yaw("66663", 90.0)
    rig.run(0.5)
    assert "yaw aligned" in rig.told()
    rig.feeds.add("compass")
    rig.run(1.0)
    # THEN GPS counts
    assert rig.heading == pytest.approx(math.pi / 2, abs=0.01)
    assert rig.core.yaw.mag_fusion == 0
    # AND where it gives no yaw, the compass
    rig = gps_yaw("66663", None)
    rig.yaw = -1.0
    rig.feeds.add("compass")
    rig.run(1.0)
    assert rig.heading == pytest.approx(-1.0, abs=0.01)


# By the velocity of GPS


def flying(sources: str, **options: Any) -> FilterRig:
    """Return a vehicle that flies by GPS or is about to, its nose at 1 rad."""
    rig = FilterRig(sources, has_compass=sources[4] == "1", loop_us=SLOW_LOOP_US, **options)
    rig.yaw = 1.0
    rig.lanes.set_origin(HOME)
    rig.feeds.add("gps")
    rig.gps = {"speed_accuracy": 0.3, "has_vertical_velocity": True}
    rig.run(3.0)
    rig.know_gyros()
    rig.run(10.0)
    rig.forget()
    rig.arm()
    rig.flying_ms = 6000
    return rig


def fly(sources: str, seconds: float, *, accel: float = 6.0, **params: Any) -> FilterRig:
    """Return such a vehicle after some seconds of flight back and forth along its nose."""
    rig = flying(sources, **params)
    back_and_forth(rig, seconds, accel)
    return rig


def back_and_forth(rig: FilterRig, seconds: float, accel: float = 6.0) -> None:
    sign = 1.0
    for _ in range(round(seconds / 0.02)):
        speed = rig.vel[0] * math.cos(1.0) + rig.vel[1] * math.sin(1.0)
        if not 2 < speed < 6:
            sign = 1.0 if speed <= 2 else -1.0
        rig.accel_ned = sign * accel * math.cos(1.0), sign * accel * math.sin(1.0), 0.0
        rig.one_pass()


def yaw_error_deg(rig: FilterRig) -> float:
    return math.degrees(wrap_pi(rig.heading - rig.yaw))


def test_yaw_is_aligned_by_the_gsf_and_then_fused() -> None:
    rig = fly("33138", 4.0)
    assert "yaw aligned using GPS" in rig.told()
    assert (rig.core.yaw.aligned, rig.core.yaw_resets) == (True, 1)
    assert abs(yaw_error_deg(rig)) < 10
    back_and_forth(rig, 6.0)
    assert abs(yaw_error_deg(rig)) < 8
    assert rig.core.yaw_resets == 1
    report = rig.report.gsf
    assert report is not None
    assert sum(report.weights) == pytest.approx(1.0)


def test_gsf_aligns_yaw_where_a_compass_is_missing() -> None:
    rig = fly("33130", 4.0)
    assert {"yaw aligned using GPS", "yaw aligned to GPS velocity"} & set(rig.told())
    assert abs(yaw_error_deg(rig)) < 15


def test_yaw_is_aligned_to_the_course_without_the_gsf() -> None:
    rig = fly("33130", 4.0, GSF_USE_MASK=0)
    assert "yaw aligned to GPS velocity" in rig.told()
    assert abs(yaw_error_deg(rig)) < 3


@pytest.mark.parametrize(("sources", "params"), [("33138", {"GSF_RUN_MASK": 2}), ("63138", {}), ("36138", {})])
def test_gsf_does_not_align_yaw_where_it_does_not_run(sources: str, params: dict[str, float]) -> None:
    rig = fly(sources, 4.0, **params)
    assert not rig.core.yaw.aligned
    assert rig.report.gsf is None


def test_gsf_waits_for_flight_and_for_a_gps_that_tells_velocity_well() -> None:
    rig = flying("33138")
    rig.arm(False)
    rig.flying_ms = 0
    back_and_forth(rig, 2.0)
    assert rig.report.gsf is None
    rig = flying("33138")
    rig.gps = {"speed_accuracy": 8.0}
    rig.run(2.0)
    back_and_forth(rig, 2.0)
    assert rig.report.gsf is None


def test_gsf_stops_when_the_vehicle_is_disarmed_and_begins_anew() -> None:
    rig = fly("33138", 3.0)
    assert rig.report.gsf is not None
    rig.arm(False)
    rig.flying_ms = 0
    rig.run(0.1)
    assert rig.report.gsf is None
    rig.arm()
    rig.flying_ms = 6000
    back_and_forth(rig, 0.3)
    report = rig.report.gsf
    assert report is not None
    assert max(report.weights) < 0.5


def test_nothing_is_known_of_yaw_while_there_is_no_acceleration() -> None:
    rig = fly("33138", 3.0, accel=0.0)
    report = rig.report.gsf
    assert report is not None
    assert math.degrees(math.sqrt(report.variance)) > 30
    assert not rig.core.yaw.aligned


def test_models_begin_anew_once_none_explains_the_velocity() -> None:
    rig = fly("33138", 4.0)
    rig.gps = {**rig.gps, "vel_ned": Vector3f(100, 100, 0)}
    rig.run(0.6)
    report = rig.report.gsf
    assert report is None or report.weights == pytest.approx((0.2,) * 5, abs=0.01)  # it may have begun already


@pytest.mark.parametrize(("release", "follows"), [(JULY_2025, False), (FEBRUARY_2026, True)])
def test_load_below_1_g_counts_for_tilt_since_february(release: FilterRelease, follows: bool) -> None:
    # GIVEN a vehicle that falls a little, at a tilt that its gyros did not see
    rig = flying("33138", release=release)
    rig.run(1.0)
    before = rig.core.yaw.by_gps.gsf.gyro_bias
    tilt, dt = 0.1, 0.02
    x, z = 0.9 * GRAVITY_MSS * math.sin(tilt), -0.9 * GRAVITY_MSS * math.cos(tilt)
    for _ in range(100):
        rig.run_row(x * dt, 0.0, z * dt, 0.0, 0.0, 0.0, dt, dt)
    # THEN the GSF finds a bias or not
    changed = abs(rig.core.yaw.by_gps.gsf.gyro_bias[1] - before[1]) > 1e-4
    assert changed is follows


def test_bias_of_the_gsfs_gyro_is_within_limits() -> None:
    rig = flying("33138")
    rig.gyro_bias = [(0.12, 0.0, 0.0)]
    rig.accel_bias = [(0.0, 0.0, -0.1)]  # as below 1 g the accelerometers count for nothing
    rig.run(10.0)
    bias = rig.core.yaw.by_gps.gsf.gyro_bias[0]
    assert 0.0 < bias <= math.radians(5.0)


@pytest.mark.parametrize("turn", [(0.0, 1.7, 0.0), (0.0, 0.0, 9.0), (1.5, 1.5, 1.5), (0.0, 3.0, 0.0)])
@pytest.mark.parametrize("vel", [(0.0, 0.0, -0.2), (90.0, 0.0, 0.0), (0.0, 50.0, 30.0)])
def test_turn_that_no_vehicle_makes_in_a_step_lets_the_gsf_begin_anew(
    turn: tuple[float, float, float], vel: tuple[float, float, float]
) -> None:
    # GIVEN a vehicle in flight; WHEN its gyros show a turn of more than a radian within 20 ms
    rig = fly("33138", 2.0)
    assert rig.report.gsf is not None
    rig.run_row(*vel, *turn, 0.02, 0.02)
    rig.run_row(*vel, *turn, 0.02, 0.02)
    rig.accel_ned = 0.0, 0.0, 0.0  # so that the accelerometers show tilt
    rig.run(2.0)
    # THEN it begins anew, and says nothing that is not a number
    back_and_forth(rig, 2.0)
    report = rig.report.gsf
    assert report is not None
    assert all(map(math.isfinite, (report.yaw, report.variance, *report.yaws, *report.weights)))


# An emergency


def test_emergency_resets_yaw_as_often_as_allowed_and_ends_the_use_of_the_compass() -> None:
    # GIVEN a vehicle that flies by GPS and compass
    rig = fly("33131", 4.0, GSF_RST_MAX=1)
    assert rig.core.yaw.uses_compass
    resets = rig.core.yaw_resets
    rig.forget()
    # WHEN it asks for help
    rig.lanes.request_yaw_reset()
    back_and_forth(rig, 0.3)
    # THEN yaw is reset by the GSF, and the compass is not used any more
    assert rig.told() == ["emergency yaw reset"]
    assert not rig.core.yaw.uses_compass
    assert rig.core.yaw_resets == resets + 1
    assert abs(yaw_error_deg(rig)) < 8
    # AND not a second time in this flight
    rig.lanes.request_yaw_reset()
    back_and_forth(rig, 0.3)
    assert rig.told() == []


def test_request_for_a_reset_lasts_5_s() -> None:
    rig = flying("33131")
    back_and_forth(rig, 0.5, 0.0)
    rig.lanes.request_yaw_reset()
    rig.forget()
    back_and_forth(rig, 5.2, 0.0)
    back_and_forth(rig, 3.0)
    assert "emergency yaw reset" not in rig.told()


def test_request_before_there_is_a_state_is_not_heard() -> None:
    rig = standing("33131", run_s=0.5)
    rig.lanes.request_yaw_reset()
    rig.run(0.7)
    assert rig.core.initialised


def test_vehicle_that_starts_by_gps_knows_yaw_by_its_compass() -> None:
    rig = by_gps()
    assert rig.core.yaw.aligned
    assert abs(rig.heading) < 0.01
