# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the simulated camera reports, in its own frame and time, and its faults."""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
import quaternion

from mav_handlers.wire.messages import ODOMETRY
from viso.companion.sender import OffsetClock
from viso.companion.simulated_camera import CameraFaults, Flight, SimulatedCamera, Span

FLIGHT = Flight(start_s=2.0, heading_rad=0.7)
EXACT = SimulatedCamera(
    FLIGHT, 1, position_noise_m=0.0, velocity_noise_m_s=0.0, angle_noise_rad=0.0, drift_m_per_sqrt_s=0.0
)
TIMES_S = (0.0, 3.0, 9.5, 17.3, 31.0)

Array = npt.NDArray[np.float64]


def report(camera: SimulatedCamera, time_s: float) -> ODOMETRY:
    message = camera.report(round(time_s * 1e6))
    assert message is not None
    return message


def position(message: ODOMETRY) -> Array:
    return np.array([message.x, message.y, message.z])


def attitude(message: ODOMETRY) -> quaternion.quaternion:
    return quaternion.quaternion(*message.q)


def local_velocity(message: ODOMETRY) -> Array:
    body = np.array([message.vx, message.vy, message.vz])
    rotated: Array = quaternion.rotate_vectors(attitude(message), body)
    return rotated


def turned(vector: Array, yaw_rad: float) -> Array:
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1], vector[2]])


def reports(camera: SimulatedCamera, count: int = 100) -> list[ODOMETRY | None]:
    return [camera.report(number * 33_333) for number in range(count)]


@pytest.mark.parametrize("time_s", TIMES_S)
def test_camera_without_errors_reports_the_flight(time_s: float) -> None:
    message = report(EXACT, time_s)
    assert position(message) == pytest.approx(FLIGHT.position_ned(time_s))
    assert local_velocity(message) == pytest.approx(FLIGHT.velocity_ned(time_s), abs=1e-9)


@pytest.mark.parametrize("yaw_rad", [-2.0, 0.5, math.pi])
@pytest.mark.parametrize("time_s", TIMES_S)
def test_body_velocity_turned_by_the_attitude_is_the_local_velocity(yaw_rad: float, time_s: float) -> None:
    message = report(replace(EXACT, frame_yaw_rad=yaw_rad), time_s)
    assert local_velocity(message) == pytest.approx(turned(FLIGHT.velocity_ned(time_s), yaw_rad), abs=1e-9)


@pytest.mark.parametrize("yaw_rad", [-2.0, 0.5, math.pi])
@pytest.mark.parametrize("time_s", TIMES_S)
def test_position_is_in_the_cameras_frame(yaw_rad: float, time_s: float) -> None:
    message = report(replace(EXACT, frame_yaw_rad=yaw_rad), time_s)
    assert position(message) == pytest.approx(turned(FLIGHT.position_ned(time_s), yaw_rad), abs=1e-9)


@pytest.mark.parametrize("time_s", TIMES_S)
def test_attitude_is_roll_pitch_and_yaw_in_that_order(time_s: float) -> None:
    roll, pitch, yaw = FLIGHT.attitude_rpy_rad(time_s)
    expected = (
        quaternion.from_rotation_vector([0, 0, yaw])
        * quaternion.from_rotation_vector([0, pitch, 0])
        * quaternion.from_rotation_vector([roll, 0, 0])
    )
    assert quaternion.rotation_intrinsic_distance(attitude(report(EXACT, time_s)), expected) < 1e-9


@pytest.mark.parametrize("time_s", TIMES_S)
def test_attitude_has_length_one(time_s: float) -> None:
    assert np.linalg.norm(report(SimulatedCamera(FLIGHT, 3), time_s).q) == pytest.approx(1)


def test_frames_are_those_that_the_autopilot_accepts() -> None:
    message = report(EXACT, 5.0)
    assert (message.frame_id, message.child_frame_id, message.estimator_type) == (20, 12, 3)


def test_time_is_the_cameras() -> None:
    clock = OffsetClock(offset_us=1_700_000_000_000_000, drift_ppm=30)
    assert report(replace(EXACT, clock=clock), 10.0).time_usec == 1_700_000_010_000_300


def test_covariance_is_that_of_the_noise() -> None:
    message = report(SimulatedCamera(FLIGHT, 1, position_noise_m=0.1, angle_noise_rad=0.02), 5.0)
    diagonal = [message.pose_covariance[index] for index in (0, 6, 11, 15, 18, 20)]
    assert diagonal == pytest.approx([0.01] * 3 + [0.0004] * 3)
    assert sum(message.pose_covariance) == pytest.approx(sum(diagonal))


def test_same_seed_gives_the_same_reports() -> None:
    assert reports(SimulatedCamera(FLIGHT, 5)) == reports(SimulatedCamera(FLIGHT, 5))


def test_another_seed_gives_other_reports() -> None:
    assert reports(SimulatedCamera(FLIGHT, 5)) != reports(SimulatedCamera(FLIGHT, 6))


@pytest.mark.slow
def test_noise_has_its_standard_deviation() -> None:
    camera = SimulatedCamera(Flight(1000.0), 7, position_noise_m=0.05, drift_m_per_sqrt_s=0.0)
    positions = np.array([position(report(camera, number / 30)) for number in range(2000)])
    assert positions.std(axis=0) == pytest.approx([0.05] * 3, rel=0.1)
    assert positions.mean(axis=0) == pytest.approx([0] * 3, abs=0.005)


@pytest.mark.slow
def test_position_drifts() -> None:
    camera = SimulatedCamera(Flight(1000.0), 7, position_noise_m=0.0, drift_m_per_sqrt_s=0.1)
    steps = np.diff([position(report(camera, float(number))) for number in range(1000)], axis=0)
    assert steps.std(axis=0) == pytest.approx([0.1] * 3, rel=0.1)


# Faults


def test_reset_counts_and_jumps() -> None:
    camera = replace(EXACT, faults=CameraFaults(reset_s=5.0, reset_jump_m=(1.0, 2.0, 3.0)))
    before, after = report(camera, 4.999), report(camera, 5.0)
    assert (before.reset_counter, after.reset_counter) == (0, 1)
    assert position(after) - FLIGHT.position_ned(5.0) == pytest.approx([1, 2, 3])
    assert position(before) == pytest.approx(FLIGHT.position_ned(4.999))


def test_counter_stays_after_a_reset() -> None:
    assert report(replace(EXACT, faults=CameraFaults(reset_s=5.0)), 30.0).reset_counter == 1


@pytest.mark.parametrize(("time_s", "quality"), [(3.9, 90), (4.0, 7), (5.9, 7), (6.0, 90)])
def test_quality_is_low_for_a_while(time_s: float, quality: int) -> None:
    camera = replace(EXACT, faults=CameraFaults(low_quality=Span(4.0, 6.0), low_quality_percent=7))
    assert report(camera, time_s).quality == quality


@pytest.mark.parametrize(("time_s", "silent"), [(3.9, False), (4.0, True), (5.9, True), (6.0, False)])
def test_nothing_is_reported_in_a_dropout(time_s: float, silent: bool) -> None:
    camera = replace(EXACT, faults=CameraFaults(dropout=Span(4.0, 6.0)))
    assert (camera.report(round(time_s * 1e6)) is None) is silent


@pytest.mark.parametrize(("time_s", "off_m"), [(3.9, 0.0), (4.0, 2.0), (5.9, 2.0), (6.0, 0.0)])
def test_place_is_taken_for_another_for_a_while(time_s: float, off_m: float) -> None:
    camera = replace(EXACT, faults=CameraFaults(mismatch=Span(4.0, 6.0), mismatch_m=(0.0, 2.0, 0.0)))
    message = report(camera, time_s)
    assert position(message) - FLIGHT.position_ned(time_s) == pytest.approx([0, off_m, 0], abs=1e-9)
    assert local_velocity(message) == pytest.approx(FLIGHT.velocity_ned(time_s), abs=1e-9)
    assert (message.reset_counter, message.quality) == (0, 90)


def test_faults_leave_the_noise_of_other_reports_as_it_is() -> None:
    faulty = SimulatedCamera(FLIGHT, 5, faults=CameraFaults(dropout=Span(1.0, 2.0)))
    assert reports(faulty)[61:] == reports(SimulatedCamera(FLIGHT, 5))[61:]
