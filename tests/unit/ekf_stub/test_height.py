# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensor gives the height, what it is worth, and what becomes of a height that is lost."""

import itertools
import math

import pytest

from ap_core.vector3 import Vector3f
from ekf_stub.core.core import Core
from ekf_stub.core.params import BARO, EXTNAV, GPS, NONE, RANGEFINDER
from ekf_stub.inputs.measurements import RangeStatus
from ekf_stub.release import APRIL_2026, JULY_2025, FilterRelease
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
    reckoned,
    standing,
)

NAN = math.nan
VEL, POS = 4, 7
GATE = 25.0  # EK3_HGT_I_GATE of 500, squared
HEIGHT_LOST = 4


def is_new(core: Core) -> bool:
    return core.height.is_new


def press(start: Start, height: float) -> tuple[FilterRig, FilterRig]:
    """Let a height of the barometer come due in a vehicle; return it and one without."""
    return compared(start, lambda rig: rig.core.inputs.set_baro(rig.now_ms, height), is_new)


def pose(start: Start, z: float, err: float = 0.2) -> tuple[FilterRig, FilterRig]:
    """Let a pose come due in a vehicle; return it and one without."""
    return compared(start, lambda rig: rig.camera(0.0, 0.0, z, yaw=NAN, err=err), has_pose)


def quiet(sources: str = "66166", **options: object) -> FilterRig:
    """Return a vehicle that navigates by its camera, and whose sensors say nothing for now."""
    rig = navigating(sources, **options)
    rig.lose("camera", "baro")
    rig.forget()
    return rig


def down_of(rig: FilterRig) -> float:
    return rig.core.state.pos[2]


def variance_of(rig: FilterRig) -> float:
    return rig.core.state.cov.var(POS + 2)


# The barometer


@pytest.mark.parametrize(("noise", "sigma"), [(0.01, 0.1), (2.0, 2.0), (5.0, 5.0), (1000.0, 100.0)])
def test_height_of_the_barometer_is_fused_with_a_noise_within_limits(noise: float, sigma: float) -> None:
    def start() -> FilterRig:
        rig = quiet()
        rig.set_param("ALT_M_NSE", noise)
        return rig

    told, other = press(start, 0.3)
    states = reckoned(other, (POS + 2, -0.3, sigma**2))
    assert down_of(told) == pytest.approx(states[POS + 2], abs=1e-9)
    assert told.core.aiding.height_ms == told.now_ms
    spread = variance_of(other) + sigma**2
    assert told.report.height_ratio == pytest.approx((down_of(other) + 0.3) ** 2 / (GATE * spread))


def test_same_reading_of_the_barometer_counts_once() -> None:
    rig = standing("00101")
    times = set()
    for _ in range(400):
        rig.one_pass()
        times.add(rig.core.aiding.height_ms)
    assert len(times) == 11


@pytest.mark.parametrize("navigates", [False, True])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_of_height_is_wider_for_a_vehicle_that_stands(navigates: bool, passes: bool) -> None:
    def start() -> FilterRig:
        rig = quiet() if navigates else standing("66166")
        rig.lose("baro")
        return rig

    _, other = press(start, 0.0)
    limit = math.sqrt((1.0 if navigates else 3.0) * GATE * (variance_of(other) + 4.0))
    told, other = press(start, limit * (0.999 if passes else 1.001) - down_of(other))
    assert (down_of(told) < down_of(other) - 0.05) is passes
    assert (told.core.aiding.height_ms == told.now_ms) is passes
    assert told.report.pos_innovation[2] == pytest.approx(limit, rel=2e-3)


def test_height_of_a_standing_vehicle_that_is_armed_has_the_narrow_gate() -> None:
    def start() -> FilterRig:
        rig = standing("66166")
        rig.lose("baro")
        rig.arm()
        rig.one_pass()
        return rig

    _, other = press(start, 0.0)
    told, _ = press(start, 1.2 * math.sqrt(GATE * (variance_of(other) + 4.0)))
    assert told.core.aiding.height_ms < told.now_ms


def test_low_air_pressure_at_take_off_is_not_believed() -> None:
    """The vehicle seems to sink by 3 m as its rotors blow at the ground: only what is beyond the dead zone counts."""

    def start() -> FilterRig:
        rig = quiet()
        rig.arm(takeoff=True)
        return rig

    told, other = press(start, -3.0)
    assert told.report.pos_innovation[2] == pytest.approx(-0.5)
    part = variance_of(other) / (variance_of(other) + 16.0)  # half as much of it is believed
    assert down_of(told) - down_of(other) == pytest.approx(0.5 * part, rel=1e-4)
    assert told.report.height_ratio == pytest.approx((down_of(other) - 3) ** 2 / (GATE * (variance_of(other) + 16)))


@pytest.mark.parametrize("what", ["takeoff", "touchdown"])
def test_rise_near_the_ground_is_believed(what: str) -> None:
    def start() -> FilterRig:
        rig = quiet()
        rig.arm(takeoff=what == "takeoff", touchdown=what == "touchdown")
        return rig

    told, other = press(start, 3.0)
    assert told.report.pos_innovation[2] == pytest.approx(3.0 + down_of(other))


def test_sinking_that_is_beyond_the_dead_zone_counts() -> None:
    def start() -> FilterRig:
        rig = quiet()
        rig.set_param("HGT_I_GATE", 1000)
        rig.arm(touchdown=True)
        return rig

    told, other = press(start, -10.0)
    assert told.report.pos_innovation[2] == pytest.approx(-10.0 + 3.5 + down_of(other))


# The camera


@pytest.mark.parametrize(("err", "sigma"), [(0.01, 0.1), (0.5, 0.5), (50.0, 10.0)])
def test_height_of_a_pose_is_fused_with_its_error_within_limits(err: float, sigma: float) -> None:
    def start() -> FilterRig:
        rig = quiet("66666")
        rig.camera(yaw=NAN)  # so that it is the source
        rig.run(0.1)
        rig.forget()
        return rig

    told, other = pose(start, -0.2, err)
    # Position is fused first, with which height has next to nothing to do.
    part = variance_of(other) / (variance_of(other) + sigma**2)
    assert down_of(told) - down_of(other) == pytest.approx(part * (-0.2 - down_of(other)), rel=1e-3)
    assert ("height", "model_fused") in told.became()


def test_height_of_a_pose_beyond_its_gate_is_rejected() -> None:
    def start() -> FilterRig:
        rig = quiet("66666")
        rig.camera(yaw=NAN)
        rig.run(0.1)
        rig.forget()
        return rig

    told, other = pose(start, -20.0)
    assert down_of(told) == pytest.approx(down_of(other), abs=1e-6)  # position is fused, and says a little of it
    code, ratio, innovation = told.last_test("height")
    assert (code, ratio > 1) == ("model_gate_height", True)
    assert innovation == pytest.approx(20.0 + down_of(other))


def test_height_of_a_pose_is_fused_without_aiding_too() -> None:
    rig = standing("06666")
    rig.feeds.add("camera")
    rig.camera_shift = 100.0, 100.0, -0.5
    rig.run(2.0)
    assert rig.core.state.pos == pytest.approx((0.0, 0.0, -0.5), abs=0.01)
    assert ("height", "model_fused") in rig.became()


@pytest.mark.parametrize(("age_s", "active"), [(0.48, EXTNAV), (0.52, BARO)])
def test_poses_are_the_source_while_they_are_fresh(age_s: float, active: int) -> None:
    rig = quiet("66666")
    rig.camera(yaw=NAN)
    rig.run(age_s)
    assert rig.core.height.active == active


def test_pose_counts_as_the_source_as_soon_as_it_is_taken_but_measures_as_it_comes_due() -> None:
    rig = standing()
    assert rig.core.height.active == BARO
    rig.camera(0.0, 0.0, -5.0)
    rig.step()
    assert (rig.core.height.active, rig.core.height.is_new) == (EXTNAV, False)
    rig.run_until(lambda: rig.core.ext_nav.has_pose)
    assert rig.core.height.down == -5.0
    assert rig.core.height.variance == pytest.approx(0.04)


@pytest.mark.parametrize("sources", ["66166", "66066"])
def test_poses_of_no_source_measure_no_height(sources: str) -> None:
    def start() -> FilterRig:
        return quiet(sources)

    told, _ = pose(start, -5.0)
    assert told.core.height.active != EXTNAV
    assert down_of(told) > -0.1


# Changing over


def test_other_source_is_followed_ungated_and_leaves_the_covariance() -> None:
    # GIVEN a vehicle whose height is the barometer's
    def start() -> FilterRig:
        rig = quiet("66166")
        # WHEN the camera becomes its source, a kilometre up
        rig.set_param("SRC1_POSZ", EXTNAV)
        return rig

    before = variance_of(quiet("66166"))

    told, other = pose(start, -1000.0)
    # THEN state and output go there, and all is as certain as after any other pose
    assert down_of(told) == pytest.approx(-1000.0, abs=1e-6)
    assert told.core.output.now.pos[2] == pytest.approx(-1000.0, abs=0.1)
    assert told.report.height_ratio == pytest.approx(0.0, abs=1e-9)
    assert variance_of(told) < variance_of(other) < 2 * before
    # AND the rate of height does not jump
    assert abs(told.report.height_rate) < 0.1


def test_gap_too_short_for_the_barometer_to_measure_changes_nothing() -> None:
    def start() -> FilterRig:
        rig = quiet("66666")
        rig.camera(yaw=NAN)
        rig.run(0.53)
        assert rig.core.height.active == BARO
        return rig

    told, other = pose(start, -9.0)
    assert told.core.height.active == EXTNAV
    # It fails its gate, as if nothing had been; position is fused, and says a little of height.
    assert down_of(told) == pytest.approx(down_of(other), abs=1e-6)


@pytest.mark.parametrize(("height", "followed"), [(4.0, 4.0 * (1 - 0.9**3)), (99.0, 1.5)])
def test_barometer_is_followed_by_a_tenth_a_reading_or_half_a_metre_while_it_is_not_the_source(
    height: float, followed: float
) -> None:
    # GIVEN a vehicle whose height is the camera's, and a barometer that says otherwise from now on
    def start() -> FilterRig:
        rig = navigating("66666")
        rig.lose("baro")
        for _ in range(3):
            rig.core.inputs.set_baro(rig.now_ms, height)
            rig.run(0.15)
        # WHEN the camera is lost after three readings
        rig.lose("camera")
        rig.skip(0.4)
        return rig

    told, _ = press(start, height)
    # THEN the barometer counts from where it was followed to
    assert told.core.height.active == BARO
    assert told.core.height.down == pytest.approx(followed - height, abs=1e-3)  # the camera's height is 0.1 mm


# Losing it


def test_vehicle_without_a_barometer_loses_its_height_after_5_s() -> None:
    rig = standing("00101", loop_us=SLOW_LOOP_US)
    rig.lose("baro")
    rig.skip(4.6)
    rig.run(0.04)
    assert not rig.core.height.is_lost
    rig.run(0.4)
    assert rig.core.height.is_lost
    assert rig.core.flags == 0x10083


@pytest.mark.parametrize(("silence_s", "lost"), [(9.7, False), (10.2, True)])
def test_height_is_lost_after_10_s_where_velocity_goes_on(silence_s: float, lost: bool) -> None:
    rig = navigating("66166", "velocity", loop_us=SLOW_LOOP_US)
    rig.lose("baro")
    rig.run(0.1)
    since_s = 1e-3 * (rig.now_ms - rig.core.aiding.height_ms)
    rig.run(silence_s - since_s)
    assert rig.core.height.is_lost is lost
    assert bool(rig.core.timeouts(rig.now_ms) & HEIGHT_LOST) is lost


def test_height_that_is_lost_is_reset_to() -> None:
    # GIVEN a parked vehicle that has had no height for 5 s
    def start() -> FilterRig:
        rig = quiet("66166", loop_us=SLOW_LOOP_US)
        rig.skip(5.0)
        rig.run(0.1)
        assert rig.core.height.is_lost
        return rig

    # WHEN one comes, however far away
    told, _ = press(start, 1000.0)
    # THEN it is gone to, and the vehicle does not climb
    assert down_of(told) == -1000.0
    assert told.core.output.now.pos[2] == pytest.approx(-1000.0, abs=1e-3)
    assert told.core.state.vel[2] == 0.0
    assert (variance_of(told), told.core.state.cov.var(VEL + 2)) == (4.0, 0.25)
    assert not told.core.height.is_lost
    assert told.core.aiding.height_ms == told.now_ms


@pytest.mark.parametrize(("armed", "flying_ms", "expected"), [(False, 0, 0.0), (True, 0, None), (True, 6000, 2.0)])
def test_vertical_velocity_after_a_reset_of_height(armed: bool, flying_ms: int, expected: float | None) -> None:
    # GIVEN a vehicle whose height is the camera's, and which has had none for long
    def start() -> FilterRig:
        rig = navigating("60606", "velocity", loop_us=SLOW_LOOP_US)
        rig.lose("camera", "baro", "velocity")
        rig.skip(10.2)
        rig.arm(armed)
        rig.flying_ms = flying_ms
        rig.run(0.1)
        assert rig.core.height.is_lost
        return rig

    # WHEN a pose comes, after a velocity
    def tell(rig: FilterRig) -> None:
        rig.velocity(0.0, 0.0, 2.0, err=0.3)
        rig.camera(0.0, 0.0, -5.0, yaw=NAN)

    told, other = compared(start, tell, has_pose)
    # THEN it is 0 on the ground, as before when that is not sure, and the camera's in flight
    assert down_of(told) == -5.0
    assert told.core.state.vel[2] == pytest.approx(other.core.state.vel[2] if expected is None else expected)
    assert told.core.state.cov.var(VEL + 2) == pytest.approx(0.09)


def test_vertical_velocity_of_the_camera_is_for_heights_of_the_same() -> None:
    def start() -> FilterRig:
        rig = navigating("60106", "velocity", loop_us=SLOW_LOOP_US)
        rig.lose("camera", "baro", "velocity")
        rig.skip(10.2)
        rig.arm()
        rig.flying_ms = 6000
        rig.velocity(0.0, 0.0, 2.0)
        rig.run(0.2)
        return rig

    told, other = press(start, 5.0)
    assert down_of(told) == -5.0
    assert told.core.state.vel[2] == pytest.approx(other.core.state.vel[2])


# None at all


def test_without_a_source_height_is_0_now_and_then() -> None:
    rig = quiet("66066")
    times = []
    for _ in range(200):
        rig.one_pass()
        if rig.core.stepped and rig.core.height.is_new:
            times.append(rig.now_ms)
    assert rig.core.height.active == NONE
    # More than 70 ms after the last, in a step of 12.5 ms; ms are whole.
    assert all(70 < after - before <= 84 for before, after in itertools.pairwise(times))
    assert len(times) >= 6
    assert (rig.core.height.down, rig.core.height.variance) == (0.0, 4.0)


@pytest.mark.parametrize(("noise", "armed", "variance"), [(5.0, True, 25.0), (1.0, True, 4.0), (5.0, False, 4.0)])
def test_without_a_source_the_noise_is_the_barometers_in_flight(noise: float, armed: bool, variance: float) -> None:
    rig = quiet("66066", ALT_M_NSE=noise)
    rig.arm(armed)
    rig.run(0.2)
    assert rig.core.height.variance == variance


# As aiding starts


@pytest.mark.parametrize(("release", "sources", "is_reset"), [
    (JULY_2025, "60106", True),
    (APRIL_2026, "60106", False),
    (APRIL_2026, "60606", True),
])  # fmt: skip
def test_height_starts_at_that_of_the_camera(release: FilterRelease, sources: str, is_reset: bool) -> None:
    rig = standing(sources, release=release)
    rig.camera(0.0, 0.0, -20.0)
    rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
    assert (down_of(rig) == pytest.approx(-20.0)) is is_reset


def test_aiding_by_a_pose_resets_position_height_and_velocity_to_it() -> None:
    rig = standing("60106")
    rig.camera(1.0, 2.0, -5.0)
    rig.run_until(lambda: rig.mode == MODE_ABSOLUTE)
    assert rig.core.state.pos == pytest.approx((1.0, 2.0, -5.0))
    assert rig.core.state.vel == (0.0, 0.0, 0.0)
    variances = rig.core.state.cov.variances()
    assert variances[POS : POS + 3] == pytest.approx([0.04] * 3)
    assert variances[VEL : VEL + 3] == pytest.approx([625.0, 625.0, 0.25])


# Range finders


def hovering(up_m: float = 10.0, **params: float) -> FilterRig:
    """Return a vehicle at a height that the barometer gives, and the range finder up to half of its 40 m."""
    rig = FilterRig("66106", loop_us=SLOW_LOOP_US)
    rig.pos, rig.ground = (0.0, 0.0, -up_m), 0.0
    rig.feeds |= {"camera", "velocity", "ranges"}
    rig.arm()
    rig.run(9.0)  # ranges fail their gate for 5 s, as height has been reset since the first
    assert rig.mode == MODE_ABSOLUTE
    for name, value in {"RNG_USE_HGT": 50, "RNG_USE_SPD": 3, **params}.items():
        rig.set_param(name, value)
    rig.run(0.2)
    rig.forget()
    return rig


@pytest.mark.parametrize(("up_m", "active"), [(10.0, RANGEFINDER), (13.5, RANGEFINDER), (14.5, BARO)])
def test_range_is_taken_near_the_ground(up_m: float, active: int) -> None:
    assert hovering(up_m).core.height.active == active


@pytest.mark.parametrize(("up_m", "active"), [(19.0, RANGEFINDER), (21.0, BARO)])
def test_range_is_kept_until_high(up_m: float, active: int) -> None:
    rig = hovering(10.0)
    rig.climb(up_m - 10.0, 4.0)
    rig.run(0.4)
    assert rig.core.height.active == active


@pytest.mark.parametrize(("speed", "active"), [(2.8, RANGEFINDER), (3.2, BARO)])
def test_range_is_kept_until_fast(speed: float, active: int) -> None:
    rig = hovering()
    rig.move(speed, 0.0, 0.0, 1.0)
    rig.run(0.5)
    assert rig.core.height.active == active
    # AND is taken again when the vehicle is a metre per second slower
    rig.move(1.8 - speed, 0.0, 0.0, 1.0)
    rig.run(0.5)
    assert rig.core.height.active == RANGEFINDER


def test_range_height_waits_for_stable_ground() -> None:
    rig = hovering()
    rig.core.set_terrain_stable(False)
    rig.run(0.02)
    assert rig.core.height.active == BARO
    rig.core.set_terrain_stable(True)
    rig.run(0.02)
    assert rig.core.height.active == RANGEFINDER


def test_word_of_the_ground_before_there_is_a_state_is_not_heard() -> None:
    rig = standing(run_s=0.5)
    rig.core.set_terrain_stable(False)
    rig.run(0.6)
    assert rig.core.height.terrain_is_stable


def test_range_is_not_taken_while_tilted() -> None:
    rig = FilterRig("66101", loop_us=SLOW_LOOP_US, RNG_USE_HGT=50)
    rig.roll, rig.ground = 0.85, 10.0
    rig.feeds |= {"camera", "ranges"}
    rig.run(4.0)
    assert rig.core.ranges.newest > 0
    assert rig.core.height.active == BARO


def test_range_tells_the_height_above_the_ground() -> None:
    # GIVEN a vehicle at a pitch, 5 m above the ground, whose height is the range finder's
    rig = FilterRig("66201", loop_us=SLOW_LOOP_US)
    rig.pitch, rig.ground = 0.3, 5.0
    rig.feeds |= {"camera", "ranges"}
    rig.arm()
    rig.run(4.0)
    assert rig.core.height.active == RANGEFINDER
    # THEN heights count from the ground, by a range that is longer, with an error by the slope of the ground
    assert rig.core.height.down == pytest.approx(rig.core.height.terrain.down - 5.0, abs=0.02)
    slope = 5.0 / math.cos(0.3) * 0.1 * math.sin(0.3)
    assert rig.core.height.variance == pytest.approx(0.25 + slope**2, rel=0.01)


def test_range_is_never_less_than_on_the_ground() -> None:
    rig = standing("66201", loop_us=SLOW_LOOP_US)
    for _ in range(20):
        rig.see_range(0.01, clearance=0.0)
        rig.run(0.06)
    assert rig.core.height.active == RANGEFINDER
    assert rig.core.height.terrain.down - rig.core.height.down == pytest.approx(0.05)


def test_barometer_stands_in_for_ranges_that_are_missing() -> None:
    rig = standing("66201")
    rig.ground = 0.1
    rig.feeds.add("ranges")
    rig.run(0.4)
    assert rig.core.height.active == RANGEFINDER
    rig.feeds.discard("ranges")
    rig.core.inputs.set_ranges(None)
    before_ms = rig.core.ranges.valid_ms
    rig.run_until(lambda: rig.core.height.active == BARO)
    assert rig.now_ms - before_ms == pytest.approx(500, abs=13)  # in a step


# Heights count from elsewhere


def test_height_counts_from_where_the_vehicle_stands_and_the_origin_goes_there() -> None:
    rig = standing("60166", run_s=4.0, loop_us=SLOW_LOOP_US)
    rig.lanes.set_origin(HOME)
    rig.baro_shift = 3.0
    rig.run(10)
    down = down_of(rig)
    assert down == pytest.approx(-3, abs=0.5)
    assert rig.lanes.reset_height_datum()
    assert down_of(rig) == 0
    assert rig.core.height.terrain.down == 0.0
    alt_cm = HOME.alt_cm + int(-100 * down)
    assert rig.core.origin_alt_cm() in (alt_cm, alt_cm - 1)  # single precision may lose one
    assert rig.core.origin == HOME


def test_height_is_not_begun_anew_before_there_is_a_state_or_in_the_air_or_by_range() -> None:
    rig = standing(run_s=0.5)
    assert not rig.lanes.reset_height_datum()
    rig.run(1.0)
    assert rig.lanes.reset_height_datum()
    rig.arm()
    rig.one_pass()
    assert not rig.lanes.reset_height_datum()
    assert not hovering().lanes.reset_height_datum()
    by_range = standing("66201")
    by_range.feeds.add("ranges")
    by_range.run(0.4)
    assert by_range.core.height.active == RANGEFINDER
    assert not by_range.lanes.reset_height_datum()


# GPS


def test_gps_is_the_source_while_it_is_accurate_and_fresh() -> None:
    rig = by_gps("33331")
    assert rig.core.height.active == GPS
    assert rig.core.height.variance == pytest.approx(0.75**2)
    rig.feeds.discard("gps")
    before_ms = rig.core.gps.received_ms
    rig.run_until(lambda: rig.core.height.active == BARO, 3.0)
    assert rig.now_ms - before_ms == pytest.approx(2000, abs=21)  # more than that, in a step


def test_gps_that_is_not_accurate_enough_is_not_the_source() -> None:
    rig = standing("33331", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.lanes.set_origin(HOME)
    rig.gps = {"speed_accuracy": 3.0}
    rig.feeds.add("gps")
    rig.run(12.0)
    assert rig.core.height.active == BARO


def test_vertical_accuracy_of_the_gps_counts() -> None:
    rig = by_gps("33331")
    rig.gps = {"vertical_accuracy": 3.0}
    rig.run(0.6)
    assert rig.core.height.variance == pytest.approx(9.0)


def test_without_a_radius_a_height_of_the_gps_that_fails_its_gate_is_fused() -> None:
    rig = by_gps("33331")
    rig.set_param("GLITCH_RAD", 0)
    rig.gps_shift = 0.0, 0.0, -50.0
    rig.run(2.0)
    assert down_of(rig) < -20.0
    assert rig.core.aiding.height_ms > rig.now_ms - 300


# The origin's height


@pytest.mark.parametrize(("mask", "corrects_origin", "corrects_heights"), [
    (0, False, False),
    (1, True, False),
    (2, False, False),
    (5, True, True),
])  # fmt: skip
def test_gps_corrects_the_origin_or_the_heights_of_the_barometer(
    mask: int, corrects_origin: bool, corrects_heights: bool
) -> None:
    # GIVEN a vehicle that navigates by GPS with the barometer's height, which drifts
    rig = by_gps()
    rig.set_param("OGN_HGT_MASK", mask)
    rig.baro_shift = 2.0
    rig.run(20.0)
    excess = rig.core.height._origin_height.excess_m
    # THEN GPS tells how much lower the origin is, where it may
    assert (excess < -0.1) is corrects_origin
    assert (rig.core.height.down > -2.0 + 0.1) is corrects_heights


def test_gps_far_off_is_not_believed_of_the_origin() -> None:
    rig = by_gps()
    rig.set_param("OGN_HGT_MASK", 1)
    rig.gps_shift = 0.0, 0.0, 500.0
    rig.run(5.0)
    assert abs(rig.core.height._origin_height.excess_m) < 0.01


def test_range_finder_that_sees_nothing_is_no_source() -> None:
    rig = standing("66201")
    rig.see_range(3.0, status=RangeStatus.TOO_FAR)
    rig.run(0.5)
    assert rig.core.height.active == BARO
    assert rig.core.ranges.newest == 0.0


def test_gps_place_of_the_origin_is_where_heights_count_from() -> None:
    rig = by_gps()
    rig.gps_shift = 0.0, 0.0, -7.0
    rig.run(0.6)
    fix = rig.core.gps.newest
    assert fix is not None
    assert fix.pos[2] == pytest.approx(-7.0, abs=0.01)  # a place is told to a centimetre
    assert float(HOME.distance_ned(HOME.offset(Vector3f(0, 0, -7))).z) == pytest.approx(-7.0, abs=0.01)
