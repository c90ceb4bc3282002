# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that were planted are found again, and no more is claimed than the data tell."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest

from viso.geometry.rotation import so3_exp, yaw_of
from viso.landmarks.fit import PoseErrors, fit_pose_errors
from viso.landmarks.observation import project
from viso.landmarks.residuals import landmark_residuals
from viso.landmarks.types import Camera, Detection, Detections, Landmark, VehiclePose

CAMERA = Camera(offset_forward_m=0.5, offset_left_m=-0.2, pitch_trim_rad=-0.2)
PLACES = np.random.default_rng(99).uniform((-200, -200, 0), (400, 200, 5), (80, 3))
LANDMARKS = [Landmark(str(index), *place) for index, place in enumerate(PLACES.tolist())]
Motion = Callable[[float], VehiclePose]


def swaying(t_s: float) -> VehiclePose:
    """Return the pose of a flight that sways ahead, 20 m above the ground."""
    return VehiclePose(t_s, 3.0 * t_s - 90, 10 * math.sin(t_s / 5), 0.3 * math.sin(t_s / 2), 20.0)


def rolling(t_s: float) -> VehiclePose:
    """Return the same with all angles."""
    turns = np.diag([0.2 * math.sin(t_s), 0.1 * math.cos(t_s), 0.3 * math.sin(t_s / 2)])
    roll, pitch, yaw = (so3_exp(turn) for turn in turns)
    attitude = yaw @ pitch @ roll
    return replace(swaying(t_s), yaw_rad=yaw_of(attitude), world_R_body=attitude)


def standing(t_s: float) -> VehiclePose:
    return VehiclePose(t_s, 0.0, 0.0, 0.3, 20.0)


def turning(t_s: float) -> VehiclePose:
    return VehiclePose(t_s, 0.0, 0.0, 0.2 * t_s, 20.0)


@dataclass(frozen=True)
class Recording:
    """A flight with errors; times are stamped from an arbitrary start."""

    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    delay_s: float = 0.0
    motion: Motion = swaying
    seed: int = 0
    noise_px: float = 1.0
    wrong_share: float = 0.1
    duration_s: float = 60.0
    start_s: float = 1000.0

    @cached_property
    def poses(self) -> list[VehiclePose]:
        return [self._reported(index / 20) for index in range(round(20 * self.duration_s) + 1)]

    @cached_property
    def pictures(self) -> list[Detections]:
        rng = np.random.default_rng(self.seed)
        return [self._picture(index / 5, rng) for index in range(round(5 * self.duration_s) + 1)]

    def _reported(self, t_s: float) -> VehiclePose:
        pose = self.motion(t_s)
        back = so3_exp(np.array([0.0, 0.0, -self.yaw_rad]))
        attitude = None if pose.world_R_body is None else back @ pose.world_R_body
        yaw_rad = math.remainder(pose.yaw_rad - self.yaw_rad, 2 * math.pi)
        return replace(pose, t_s=self.start_s + t_s, yaw_rad=yaw_rad, world_R_body=attitude)

    def _picture(self, t_s: float, rng: np.random.Generator) -> Detections:
        camera = replace(CAMERA, pitch_trim_rad=CAMERA.pitch_trim_rad + self.pitch_rad)
        projection = project(camera, self.motion(t_s), PLACES)
        seen = np.flatnonzero(projection.in_image)[:6]
        pixels = projection.uv_px[seen] + self.noise_px * rng.standard_normal((len(seen), 2))
        wrong = rng.random(len(seen)) < self.wrong_share
        pixels[wrong] = rng.uniform((0, 0), (1280, 1024), (np.count_nonzero(wrong), 2))
        found = zip((LANDMARKS[index].id for index in seen), pixels.tolist(), strict=True)
        return Detections(self.start_s + t_s + self.delay_s, tuple(Detection(name, *uv) for name, uv in found))

    def fit(self) -> PoseErrors:
        return fit_pose_errors(CAMERA, self.poses, LANDMARKS, self.pictures)


def untold(errors: PoseErrors) -> tuple[str, ...]:
    """Return the names of what the data do not tell."""
    named = {"yaw_offset": errors.yaw_offset_rad, "pitch_trim": errors.pitch_trim_rad, "delay": errors.delay_s}
    return tuple(name for name, value in named.items() if value is None)


def known(value: float | None) -> float:
    assert value is not None
    return value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("yaw_deg", "pitch_deg", "delay_s", "motion"),
    [
        (10.0, 1.0, 0.3, swaying),
        (3.1, 0.0, 0.15, rolling),
        pytest.param(-10.0, -2.0, 0.0, swaying, marks=pytest.mark.slow),
        pytest.param(0.0, 0.5, 0.02, rolling, marks=pytest.mark.slow),
        pytest.param(175.0, 0.0, 0.1, swaying, marks=pytest.mark.slow),
    ],
)
def test_planted_errors_are_recovered(yaw_deg: float, pitch_deg: float, delay_s: float, motion: Motion) -> None:
    errors = Recording(math.radians(yaw_deg), math.radians(pitch_deg), delay_s, motion).fit()
    assert math.degrees(known(errors.yaw_offset_rad)) == pytest.approx(yaw_deg, abs=0.2)
    assert math.degrees(known(errors.pitch_trim_rad)) == pytest.approx(pitch_deg, abs=0.1)
    assert known(errors.delay_s) == pytest.approx(delay_s, abs=0.02)
    assert untold(errors) == ()
    assert known(errors.rms_px) == pytest.approx(1.0, abs=0.1)
    assert errors.used > 5 * errors.rejected


@pytest.mark.slow
def test_without_noise_the_errors_are_exact() -> None:
    # Poses every 0.05 s with straight lines between them: that is what is left.
    errors = Recording(0.1, 0.02, 0.1, noise_px=0.0, wrong_share=0.0).fit()
    assert known(errors.yaw_offset_rad) == pytest.approx(0.1, abs=1e-6)
    assert known(errors.pitch_trim_rad) == pytest.approx(0.02, abs=1e-6)
    assert known(errors.delay_s) == pytest.approx(0.1, abs=1e-6)


@pytest.mark.slow
def test_a_third_of_wrong_matches_does_no_harm() -> None:
    errors = Recording(0.17, 0.02, 0.2, wrong_share=0.33, duration_s=30.0).fit()
    assert math.degrees(known(errors.yaw_offset_rad)) == pytest.approx(math.degrees(0.17), abs=0.2)
    assert known(errors.delay_s) == pytest.approx(0.2, abs=0.02)


def test_adding_what_was_found_takes_the_innovations_away() -> None:
    recording = Recording(0.1, 0.02, 0.0, noise_px=0.0, wrong_share=0.0, duration_s=10.0)
    errors = recording.fit()
    camera = replace(CAMERA, pitch_trim_rad=CAMERA.pitch_trim_rad + known(errors.pitch_trim_rad))
    pose = recording.poses[100]
    pose = replace(pose, yaw_rad=pose.yaw_rad + known(errors.yaw_offset_rad))
    residuals = landmark_residuals(camera, pose, LANDMARKS, recording.pictures[25])
    assert len(residuals.innovations) == 6
    for innovation in residuals.innovations:
        assert (innovation.du_px, innovation.dv_px) == pytest.approx((0, 0), abs=0.01)


@pytest.mark.slow
def test_the_uncertainties_are_honest() -> None:
    truth = np.array([0.1, 0.02, 0.12])
    errors = [Recording(0.1, 0.02, 0.12, seed=seed, duration_s=15.0).fit() for seed in range(16)]
    off = (
        np.array([[known(one.yaw_offset_rad), known(one.pitch_trim_rad), known(one.delay_s)] for one in errors]) - truth
    )
    sigmas = np.array(
        [[known(one.yaw_sigma_rad), known(one.pitch_sigma_rad), known(one.delay_sigma_s)] for one in errors]
    )
    nees = np.square(off / sigmas).mean(axis=0)
    # Of chi-square with 16 degrees of freedom, divided by 16: 99.9 % are within.
    assert (nees > 0.22).all()
    assert (nees < 2.6).all()


@pytest.mark.slow
def test_more_pictures_tell_more() -> None:
    short, long = Recording(duration_s=10.0).fit(), Recording(duration_s=40.0).fit()
    assert known(long.yaw_sigma_rad) < 0.7 * known(short.yaw_sigma_rad)


def test_a_vehicle_that_stands_does_not_tell_the_delay() -> None:
    errors = Recording(0.1, 0.02, 0.2, standing, duration_s=10.0).fit()
    assert untold(errors) == ("delay",)
    assert (errors.delay_s, errors.delay_sigma_s) == (None, None)
    assert known(errors.yaw_offset_rad) == pytest.approx(0.1, abs=1e-3)
    assert known(errors.pitch_trim_rad) == pytest.approx(0.02, abs=1e-3)


def test_a_steady_turn_does_not_tell_delay_from_yaw() -> None:
    errors = Recording(0.1, 0.02, 0.2, turning, duration_s=20.0).fit()
    assert untold(errors) == ("delay",)
    sigma = known(errors.yaw_sigma_rad)
    assert sigma == pytest.approx(0.2 * 0.5, rel=0.2)
    assert abs(known(errors.yaw_offset_rad) - 0.1) < 3 * sigma
    assert known(errors.pitch_trim_rad) == pytest.approx(0.02, abs=1e-3)


def test_too_little_tells_nothing() -> None:
    recording = Recording(duration_s=5.0)
    poses, pictures = recording.poses, recording.pictures
    count = sum(len(picture.landmarks) for picture in pictures)
    for errors in (
        fit_pose_errors(CAMERA, [], LANDMARKS, pictures),
        fit_pose_errors(CAMERA, poses[:1], LANDMARKS, pictures),
        fit_pose_errors(CAMERA, [poses[0], poses[-1]], LANDMARKS, pictures),  # 5 s apart
        fit_pose_errors(CAMERA, [replace(pose, t_s=pose.t_s + 100) for pose in poses], LANDMARKS, pictures),
    ):
        assert untold(errors) == ("yaw_offset", "pitch_trim", "delay")
        assert (errors.used, errors.rejected, errors.rms_px) == (0, count, None)
    for errors in (
        fit_pose_errors(CAMERA, poses, [], pictures),
        fit_pose_errors(CAMERA, poses, LANDMARKS, []),
        fit_pose_errors(CAMERA, [], [], []),
    ):
        assert (errors.used, errors.rejected) == (0, 0)


def test_landmarks_behind_the_camera_are_no_stumbling_block() -> None:
    recording = Recording(0.1, 0.02, 0.1, duration_s=15.0)
    behind = [Landmark(f"behind {index}", -500.0, 10.0 * index) for index in range(3)]
    seen = tuple(Detection(one.id, 640.0, 512.0) for one in behind)
    pictures = [replace(one, landmarks=(*one.landmarks, *seen[:1])) for one in recording.pictures]
    errors = fit_pose_errors(CAMERA, recording.poses, [*LANDMARKS, *behind], pictures)
    assert known(errors.yaw_offset_rad) == pytest.approx(0.1, abs=1e-3)
    assert errors.rejected >= len(pictures)


@pytest.mark.slow
def test_order_and_repetition_of_poses_do_not_matter() -> None:
    recording = Recording(0.1, 0.02, 0.1, duration_s=10.0)
    poses = recording.poses
    again = fit_pose_errors(CAMERA, [*reversed(poses), *poses[:20]], LANDMARKS, recording.pictures)
    assert again == recording.fit()


@pytest.mark.slow
def test_a_detection_that_is_there_twice_counts_once() -> None:
    recording = Recording(duration_s=10.0)
    twice = [replace(one, landmarks=one.landmarks * 2) for one in recording.pictures]
    assert fit_pose_errors(CAMERA, recording.poses, LANDMARKS, twice) == recording.fit()


@pytest.mark.slow
def test_a_gap_in_the_poses_is_left_out() -> None:
    recording = Recording(0.1, 0.02, 0.1, duration_s=30.0)
    poses = [pose for pose in recording.poses if not 1010 < pose.t_s < 1015]
    errors = fit_pose_errors(CAMERA, poses, LANDMARKS, recording.pictures)
    assert known(errors.yaw_offset_rad) == pytest.approx(0.1, abs=1e-3)
    assert known(errors.delay_s) == pytest.approx(0.1, abs=0.01)
    assert errors.used < 0.85 * recording.fit().used


def test_too_few_detections_that_agree_tell_nothing() -> None:
    recording = Recording(noise_px=0.1, wrong_share=0.0, duration_s=5.0)
    good, bad = recording.pictures[10:12]
    wrong = tuple(replace(one, u_px=one.u_px + 300 * (-1) ** index) for index, one in enumerate(bad.landmarks[:4]))
    pictures = [good, replace(bad, landmarks=(*wrong, *bad.landmarks[4:]))]
    errors = fit_pose_errors(CAMERA, recording.poses, LANDMARKS, pictures)
    assert untold(errors) == ("yaw_offset", "pitch_trim", "delay")
    assert (errors.used, errors.rejected) == (0, 12)
