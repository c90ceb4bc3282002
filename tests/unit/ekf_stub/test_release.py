# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What 4.6 fuses otherwise than later releases do: one behaviour a field."""

import math
from dataclasses import replace
from typing import Any

import pytest

from ap_core.vector3 import Vector3f
from ekf_stub.release import JULY_2025, STABLE_4_6, FilterRelease
from tests.unit.ekf_stub.filter_rig import (
    SLOW_LOOP_US,
    FilterRig,
    Start,
    by_gps,
    compared,
    has_pose,
    navigating,
    reckoned,
)

VEL, POS = 4, 7
GATE = 25.0  # of 500
NAN = math.nan

WEIGHS_AS_GPS = replace(JULY_2025, weighs_as_gps=True)
SCALES_ALL_NOISE = replace(JULY_2025, scales_all_noise=True)
FUSES_ANY_CLIMB = replace(JULY_2025, fuses_any_climb=True)
KEEPS_COMPASS = replace(JULY_2025, keeps_compass=True)
LANES_ARE_AUTOMATIC = replace(JULY_2025, lanes_are_automatic=True)


def seen(release: FilterRelease, sources: str = "66166", *, with_gps: bool = False, **gps: Any) -> FilterRig:
    """Return a vehicle that navigates by its camera, with a GPS that nothing names, and whose sensors are silent."""
    rig = navigating(sources, "velocity", release=release)
    if with_gps:
        rig.gps = dict(gps)
        rig.feeds.add("gps")
        rig.run(0.5)
    rig.lose("camera", "velocity", "baro", "gps")
    rig.run(0.2)
    rig.forget()
    return rig


def pose(start: Start, x: float, err: float = 0.2) -> tuple[FilterRig, FilterRig]:
    """Let a pose come due in a vehicle; return it and one without."""
    return compared(start, lambda rig: rig.camera(x, 0.0, 0.0, yaw=NAN, err=err), has_pose)


def velocity(start: Start, z: float, err: float = 0.1) -> tuple[FilterRig, FilterRig]:
    """Let a velocity come due in a vehicle; return it and one without."""
    return compared(start, lambda rig: rig.velocity(0.1, -0.2, z, err=err), lambda core: core.ext_nav.has_velocity)


# Which variances count


@pytest.mark.parametrize(("release", "sigma"), [(JULY_2025, 0.2), (WEIGHS_AS_GPS, 3.0), (STABLE_4_6, 3.0)])
def test_pose_has_the_accuracy_of_gps_while_that_gives_one(release: FilterRelease, sigma: float) -> None:
    def start() -> FilterRig:
        return seen(release, with_gps=True, horizontal_accuracy=3.0, speed_accuracy=0.4)

    told, other = pose(start, 2.0)
    spread = sum(other.core.state.cov.variances()[POS : POS + 2])
    off = (other.core.state.pos[0] - 2.0) ** 2 + other.core.state.pos[1] ** 2
    assert told.report.pos_ratio == pytest.approx(off / (GATE * (spread + 2 * sigma**2)), rel=1e-6)


@pytest.mark.parametrize(("release", "sigma"), [(JULY_2025, 50.0), (WEIGHS_AS_GPS, 10.0)])
def test_pose_without_a_gps_has_its_own_error_up_to_a_limit(release: FilterRelease, sigma: float) -> None:
    told, other = pose(lambda: seen(release), 1.0, err=50.0)
    assert told.core.state.pos[0] == pytest.approx(reckoned(other, (POS, 1.0, sigma**2))[POS], abs=1e-9)


@pytest.mark.parametrize(
    ("release", "gps", "err", "ne", "d"),
    [
        (JULY_2025, {"speed_accuracy": 0.4}, 0.1, 0.1, 0.1),
        (WEIGHS_AS_GPS, {"speed_accuracy": 0.4}, 0.1, 0.4, 0.5),
        (WEIGHS_AS_GPS, {"speed_accuracy": None}, 0.1, 0.1, 0.1),
        (JULY_2025, {}, 40.0, 40.0, 40.0),
        (WEIGHS_AS_GPS, {}, 40.0, 5.0, 5.0),
    ],
)
def test_velocity_has_the_accuracy_of_gps_while_that_gives_one(
    release: FilterRelease, gps: dict[str, Any], err: float, ne: float, d: float
) -> None:
    def start() -> FilterRig:
        return seen(release, with_gps=bool(gps), horizontal_accuracy=0.5, **gps)

    told, other = velocity(start, 0.3, err)
    states = reckoned(other, (VEL, 0.1, ne**2), (VEL + 1, -0.2, ne**2), (VEL + 2, 0.3, d**2))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-6)


@pytest.mark.parametrize(("release", "sigma"), [(JULY_2025, 0.3), (WEIGHS_AS_GPS, 2.0)])
def test_velocity_of_gps_has_the_error_of_one_of_the_camera_that_comes_due_with_it(
    release: FilterRelease, sigma: float
) -> None:
    def tell(rig: FilterRig) -> None:
        rig.gps = {"vel_ned": Vector3f(1.0, 0.0, 0.0)}
        rig._feed_gps()
        rig.velocity(9.0, 9.0, 9.0, err=2.0, delay_ms=200)

    def start() -> FilterRig:
        rig = by_gps("33101", release=release, SRC2_POSXY=6)
        rig.lose("gps", "baro")
        return rig

    told, other = compared(start, tell, lambda core: core.gps.is_due)
    assert told.core.ext_nav.has_velocity
    spread = sum(other.core.state.cov.variances()[VEL : VEL + 2])
    north, east, _ = other.core.state.vel
    off = (north - 1.0) ** 2 + east**2
    assert told.report.vel_ratio == pytest.approx(off / (GATE * (spread + 2 * sigma**2)), rel=1e-3)


@pytest.mark.parametrize(("release", "scale"), [(JULY_2025, 1.0), (SCALES_ALL_NOISE, 2.0), (STABLE_4_6, 2.0)])
def test_pose_counts_for_less_with_few_satellites(release: FilterRelease, scale: float) -> None:
    told, other = pose(lambda: seen(release, with_gps=True, num_sats=4), 1.0)
    assert told.core.state.pos[0] == pytest.approx(reckoned(other, (POS, 1.0, (scale * 0.2) ** 2))[POS], abs=1e-6)


@pytest.mark.parametrize(("release", "scale"), [(JULY_2025, 1.0), (SCALES_ALL_NOISE, 2.0)])
def test_velocity_of_the_camera_counts_for_less_with_few_satellites(release: FilterRelease, scale: float) -> None:
    told, other = velocity(lambda: seen(release, with_gps=True, num_sats=4), 0.3)
    noise = (scale * 0.1) ** 2
    states = reckoned(other, (VEL, 0.1, noise), (VEL + 1, -0.2, noise), (VEL + 2, 0.3, noise))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-6)


# Vertical velocity


@pytest.mark.parametrize("sources", ["66106", "66166"])
def test_vertical_velocity_of_the_camera_is_fused_whatever_its_source(sources: str) -> None:
    told, other = velocity(lambda: seen(FUSES_ANY_CLIMB, sources), 0.3)
    states = reckoned(other, (VEL, 0.1, 0.01), (VEL + 1, -0.2, 0.01), (VEL + 2, 0.3, 0.01))
    assert told.core.state.vel == pytest.approx(states[VEL : VEL + 3], abs=1e-6)
    spread = sum(other.core.state.cov.variances()[VEL : VEL + 3])
    off = math.dist(other.core.state.vel, (0.1, -0.2, 0.3))
    assert told.report.vel_ratio == pytest.approx(off**2 / (GATE * (spread + 3 * 0.01)), rel=1e-4)
    assert told.last_test("velocity")[2] == pytest.approx(off)


@pytest.mark.parametrize(("sources", "axes"), [("33101", 2), ("33131", 3)])
def test_climb_of_gps_is_fused_while_it_is_wanted(sources: str, axes: int) -> None:
    def start() -> FilterRig:
        rig = by_gps(sources, release=FUSES_ANY_CLIMB)
        rig.gps = {"has_vertical_velocity": True}
        rig.run(0.5)
        rig.lose("gps", "baro")
        return rig

    def tell(rig: FilterRig) -> None:
        rig.feeds.add("gps")
        rig.gps = {"has_vertical_velocity": True, "vel_ned": Vector3f(0.0, 0.0, 1.0)}

    told, other = compared(start, tell, lambda core: core.gps.is_due)
    assert (told.core.state.vel[2] > other.core.state.vel[2] + 0.01) is (axes == 3)


def test_climb_is_fused_with_velocities_that_are_not_navigated_by() -> None:
    def start() -> FilterRig:
        rig = FilterRig("06101", has_compass=True, release=FUSES_ANY_CLIMB, loop_us=SLOW_LOOP_US)
        rig.run(2.6)
        rig.lose("baro")
        return rig

    told, other = velocity(start, 0.3)
    assert told.core.state.vel[2] > other.core.state.vel[2] + 0.01


@pytest.mark.parametrize(("release", "is_bad"), [(JULY_2025, False), (FUSES_ANY_CLIMB, True)])
def test_accelerometers_are_doubted_by_the_camera_where_a_gps_has_told_climb(
    release: FilterRelease, is_bad: bool
) -> None:
    # GIVEN a vehicle with a GPS that has told its climb, and that navigates by its camera
    rig = by_gps("33131", release=release, SRC2_POSXY=6)
    rig.gps = {"has_vertical_velocity": True}
    rig.run(0.5)
    rig.use("66161")
    rig.feeds.add("camera")
    rig.lose("gps")
    # WHEN barometer and camera say that it climbs, while the accelerometer does not
    rig.baro_shift = 20.0
    rig.run(0.3)
    for _ in range(2):
        rig.velocity(0.0, 0.0, -3.0)
        rig.run(0.4)
    assert rig.core.state.accel_is_bad is is_bad


# Compasses


def losing_its_compass(release: FilterRelease, count: int) -> FilterRig:
    """Return a vehicle in flight with some compasses, of which the first fails its gate."""
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US, release=release)
    rig.compass_count = count
    rig.run(3.0)
    rig.arm()
    rig.flying_ms = 6000
    rig.run(0.1)
    rig.skip(31.0)
    north, _, down = rig.field_ned
    rig.field_ned = -north, 0.0, down
    rig.run(0.4)
    rig.skip(10.0)
    rig.run(0.4)
    return rig


def switched(rig: FilterRig) -> list[str]:
    return [text for text in rig.texts if "switching" in text]


def test_search_for_a_compass_ends_with_the_first_that_works() -> None:
    assert switched(losing_its_compass(KEEPS_COMPASS, 3)) == ["switching to compass 1"]


def test_compass_is_kept_on_the_ground() -> None:
    rig = losing_its_compass(KEEPS_COMPASS, 2)
    rig.forget()
    rig.arm(False)
    rig.run(0.2)
    assert (rig.core.yaw.compass.number, switched(rig)) == (1, [])


# Cores


def with_two_cores(release: FilterRelease) -> FilterRig:
    """Return an armed vehicle with two cores that may choose."""
    rig = FilterRig("66666", cores=2, loop_us=SLOW_LOOP_US, release=release)
    rig.feeds |= {"camera", "velocity"}
    rig.run(3.5)
    rig.skip(10.0)
    rig.run(0.5)
    rig.arm()
    rig.forget()
    return rig


@pytest.mark.parametrize(("release", "primary"), [(JULY_2025, 0), (LANES_ARE_AUTOMATIC, 1)])
def test_option_for_choice_by_hand_is_unknown(release: FilterRelease, primary: int) -> None:
    rig = with_two_cores(release)
    rig.set_param("OPTIONS", 2)
    rig.accel_bias[0] = (0.0, 0.0, 4.0)
    rig.run(8.0)
    assert rig.lanes.primary == primary


@pytest.mark.parametrize(("release", "waits"), [(JULY_2025, False), (LANES_ARE_AUTOMATIC, True)])
def test_core_that_was_left_waits(release: FilterRelease, waits: bool) -> None:
    rig = with_two_cores(release)
    rig.accel_bias[0] = (0.0, 0.0, 4.0)
    rig.run_until(lambda: rig.lanes.primary == 1, 10.0)
    switched_us = rig.now_us
    rig.accel_bias = [(0.0, 0.0, 0.0), (0.0, 0.0, 8.0)]
    rig.run_until(lambda: rig.lanes.primary == 0, 60.0)
    assert (rig.now_us - switched_us > 10_000_000) is waits


def test_stable_release_has_all_of_this() -> None:
    assert (
        replace(
            JULY_2025,
            weighs_as_gps=True,
            scales_all_noise=True,
            fuses_any_climb=True,
            keeps_compass=True,
            lanes_are_automatic=True,
            aligns_source_in_use=True,
            shares_source_set=True,
        )
        == STABLE_4_6
    )
