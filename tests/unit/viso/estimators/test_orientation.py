# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixed axes are found and told apart: those of the body, of the world, or of both."""

import math

import numpy as np
import pytest
import quaternion

from tests.unit.viso.estimators.conftest import Flight
from tests.unit.viso.estimators.motions import Motion, integrated, motion
from viso.estimators.axis_rotations import PROPER, AxisMap, rotation_matrix
from viso.estimators.orientation import estimate_orientation, estimate_world_axes
from viso.geometry.rotation import Array, quats_from_euler

OWN = AxisMap((1, 2, 3))
FLU = AxisMap((1, -2, -3))
OPTICAL = AxisMap((2, 3, 1))
NWU_OF_NED = quaternion.from_rotation_vector([math.pi, 0.0, 0.0])
ENU_OF_NED = quaternion.from_rotation_matrix(AxisMap((2, 1, -3)).matrix)  # it is its own inverse


def turned(quat_wxyz: Array, *, body: Array) -> Array:
    """Return attitudes of a camera whose axes a matrix [3, 3] turns into the vehicle's."""
    quats: Array = quaternion.as_float_array(
        quaternion.as_quat_array(quat_wxyz) * quaternion.from_rotation_matrix(body)
    )
    return quats


@pytest.fixture(scope="module")
def vehicle() -> Motion:
    return motion(np.random.default_rng(20))


@pytest.mark.slow
@pytest.mark.parametrize("orient", [0, 2, 4, 6, 24, 25])
def test_mountings_made_of_the_recorded_flight_are_found(flight: Flight, orient: int) -> None:
    seen = turned(flight.quat_wxyz, body=rotation_matrix(orient))
    found = estimate_orientation(flight.stamp_us, seen, flight.att_us, flight.att_wxyz)
    assert (found.sufficient, found.axes.rotation) == (True, orient)
    assert found.choice.correlation - found.choice.second_correlation > 0.1


@pytest.mark.parametrize("body", PROPER)
def test_every_map_is_found_by_turning(vehicle: Motion, body: Array) -> None:
    rng = np.random.default_rng(21)
    seen = vehicle.seen(rng, body=quaternion.from_rotation_matrix(body), delay_ms=40)
    found = estimate_orientation(*seen, vehicle.time_us, vehicle.quat_wxyz, delay_ms=40)
    assert found.sufficient
    assert found.axes == AxisMap.of(body)


def test_camera_that_is_askew_is_nearest_to_a_right_angle(vehicle: Motion) -> None:
    askew = quaternion.from_rotation_vector([0.0, math.radians(20), 0.0])
    seen = vehicle.seen(np.random.default_rng(22), body=askew)
    found = estimate_orientation(*seen, vehicle.time_us, vehicle.quat_wxyz)
    assert (found.sufficient, found.axes.rotation) == (True, 0)


def test_camera_halfway_between_two_mountings_is_neither(vehicle: Motion) -> None:
    halfway = quaternion.from_rotation_vector([0.0, 0.0, math.radians(45)])
    seen = vehicle.seen(np.random.default_rng(23), body=halfway, noise_rad=0.01)
    found = estimate_orientation(*seen, vehicle.time_us, vehicle.quat_wxyz)
    assert found.choice.correlation - found.choice.second_correlation < 0.05


@pytest.mark.parametrize("seed", range(4))
def test_turning_about_one_axis_does_not_settle_the_others(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = motion(rng, axes=(0, 0, 1))
    noisy = vehicle.rates_rad + rng.normal(0, 0.01, vehicle.rates_rad.shape)
    found = estimate_orientation(*vehicle.seen(rng), vehicle.time_us, integrated(vehicle.time_us, noisy))
    assert not found.sufficient


@pytest.mark.parametrize("seed", range(4))
def test_vehicle_at_rest_settles_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vehicle = motion(rng, rate_rad=1e-9)
    noise = rng.normal(0, 0.01, vehicle.rates_rad.shape)
    found = estimate_orientation(*vehicle.seen(rng), vehicle.time_us, integrated(vehicle.time_us, noise))
    assert not found.sufficient


def test_estimate_at_rest_that_follows_the_camera_settles_nothing() -> None:
    rng = np.random.default_rng(30)
    vehicle = motion(rng, rate_rad=0.003)
    found = estimate_orientation(*vehicle.seen(rng, noise_rad=1e-5), vehicle.time_us, vehicle.quat_wxyz)
    assert found.choice.is_clear
    assert not found.sufficient


def test_attitudes_that_never_change_settle_nothing() -> None:
    times, still = np.arange(0, 20e6, 5e4), np.tile([1.0, 0.0, 0.0, 0.0], (400, 1))
    assert not estimate_orientation(times, still, times, still).sufficient


def test_few_seconds_settle_the_mounting() -> None:
    rng = np.random.default_rng(29)
    vehicle = motion(rng, span_s=5.0)
    found = estimate_orientation(*vehicle.seen(rng), vehicle.time_us, vehicle.quat_wxyz)
    assert (found.sufficient, found.axes.rotation) == (True, 0)


def test_too_few_samples_settle_nothing() -> None:
    assert not estimate_orientation([], np.zeros((0, 4)), [], np.zeros((0, 4))).sufficient


def test_mix_up_is_told_in_words(vehicle: Motion) -> None:
    seen = vehicle.seen(np.random.default_rng(24), body=quaternion.from_rotation_matrix(FLU.matrix))
    found = estimate_orientation(*seen, vehicle.time_us, vehicle.quat_wxyz)
    assert found.name == "FLU"
    assert found.text.startswith("camera x is vehicle x (forward), camera y is vehicle -y (left)")
    assert found.axes.rotation == 8


@pytest.mark.parametrize(("world", "world_name"), [
    (quaternion.one, "NED"),
    (ENU_OF_NED, "ENU"),
    (NWU_OF_NED, "NWU"),
])  # fmt: skip
@pytest.mark.parametrize("body", [OWN, FLU, OPTICAL])
def test_mix_ups_of_world_and_of_body_are_told_apart(
    vehicle: Motion, world: quaternion.quaternion, world_name: str, body: AxisMap
) -> None:
    to_camera = quaternion.from_rotation_matrix(body.matrix)
    seen = vehicle.seen(np.random.default_rng(25), world=world, body=to_camera, delay_ms=30)
    found = estimate_orientation(*seen, vehicle.time_us, vehicle.quat_wxyz, delay_ms=30)
    assert found.axes == body
    outer = estimate_world_axes(*seen, vehicle.time_us, vehicle.quat_wxyz, body_axes=found.axes, delay_ms=30)
    assert outer.sufficient
    assert outer.name == world_name
    assert outer.is_up == (world_name != "NED")


@pytest.mark.parametrize(("up", "heading_deg"), [(False, 130), (True, 130), (False, 230)])
def test_heading_of_a_world_that_points_anywhere_is_told(vehicle: Motion, up: bool, heading_deg: int) -> None:
    heading = quats_from_euler([[0.0, 0.0, -math.radians(heading_deg)]])
    world = (NWU_OF_NED if up else quaternion.one) * quaternion.as_quat_array(heading)[0]
    seen = vehicle.seen(np.random.default_rng(26), world=world)
    outer = estimate_world_axes(*seen, vehicle.time_us, vehicle.quat_wxyz, body_axes=OWN)
    assert outer.heading_deg == pytest.approx(heading_deg, abs=max(5 * outer.sigma_deg, 0.1))
    assert not outer.has_compass_axes
    assert outer.name == f"z {'up' if up else 'down'}, x towards {heading_deg} deg"


def test_world_with_its_y_down_has_its_name(vehicle: Motion) -> None:
    to_world = quaternion.from_rotation_matrix(AxisMap((2, 3, 1)).matrix.T)  # x east, y down, z north
    seen = vehicle.seen(np.random.default_rng(27), world=to_world)
    outer = estimate_world_axes(*seen, vehicle.time_us, vehicle.quat_wxyz, body_axes=OWN)
    assert outer.name == "EDN"


def test_world_of_a_wrong_body_is_not_taken() -> None:
    rng = np.random.default_rng(28)
    vehicle = motion(rng, span_s=200.0, rate_rad=2.0)
    seen = vehicle.seen(rng, body=quaternion.from_rotation_matrix(FLU.matrix))
    found = estimate_world_axes(*seen, vehicle.time_us, vehicle.quat_wxyz, body_axes=OWN)
    assert not found.sufficient


@pytest.mark.slow
def test_world_of_the_recorded_flight_is_the_earth(flight: Flight) -> None:
    found = estimate_world_axes(flight.stamp_us, flight.quat_wxyz, flight.att_us, flight.att_wxyz, body_axes=OWN)
    assert (found.sufficient, found.name) == (True, "NED")


def test_too_few_attitudes_tell_no_world() -> None:
    found = estimate_world_axes([], np.zeros((0, 4)), [], np.zeros((0, 4)), body_axes=OWN)
    assert (found.sufficient, found.sigma_deg) == (False, math.inf)
