# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What recordings share: order of arrival, thinning, the axes of the body, the truth."""

import dataclasses
import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.sources.base import (
    Recording,
    SourceError,
    Thinning,
    body_rotation,
    in_order_of_arrival,
    make_frame,
)
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.types import (
    CameraCalibration,
    DistortionModel,
    ImuBias,
    ImuSample,
    NavCameraFrame,
    SensorEvent,
    WarmStartPose,
)
from viso.geometry.pose import SE3
from viso.geometry.rotation import so3_exp
from viso.geometry.trajectory import Trajectory

PIXELS = np.zeros((4, 6), np.uint8)


def sample(t_ms: int) -> ImuSample:
    return ImuSample(t_ms * 1_000_000, np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]))


def frame(t_ms: int) -> NavCameraFrame:
    return make_frame(0, t_ms * 1_000_000, PIXELS, "small")


def calibration() -> CameraCalibration:
    B_T_C = SE3(MOUNTINGS["forward"], np.array([0.1, 0.0, 0.0]))
    return CameraCalibration("small", "0", 6, 4, 5.0, 5.0, 2.5, 1.5, DistortionModel.NONE, np.zeros(0), B_T_C)


def recording() -> Recording:
    def data() -> Iterator[SensorEvent]:
        yield from (sample(0), frame(1), sample(2))

    poses = Trajectory(np.array([0, 10]), np.array([[0, 0, 0], [2, 4, 6.0]]), np.array([[1, 0, 0, 0]] * 2))
    start = WarmStartPose(SE3.identity(), np.array([3.0, 0, 0]), ImuBias(np.array([0.1, 0.2, 0.3]), np.arange(3.0)))
    return Recording(calibration(), data, poses, start)


# Order


def times(events: Iterator[SensorEvent]) -> list[str]:
    named = []
    for event in events:
        is_frame = isinstance(event, NavCameraFrame)
        t_ns = event.capture_timestamp if isinstance(event, NavCameraFrame) else event.t_ns
        named.append(f"{'frame' if is_frame else 'imu'} {t_ns // 1_000_000}")
    return named


def test_frame_comes_after_the_first_sample_that_is_not_before_it() -> None:
    events = in_order_of_arrival(map(sample, (0, 5, 10, 15)), map(frame, (5, 7)), 0.0)
    assert times(events) == ["imu 0", "imu 5", "frame 5", "imu 10", "frame 7", "imu 15"]


def test_offset_of_the_camera_counts() -> None:
    events = in_order_of_arrival(map(sample, (0, 5, 10, 15)), [frame(3)], 0.004)
    assert times(events) == ["imu 0", "imu 5", "imu 10", "frame 3", "imu 15"]


def test_frames_go_on_where_inertial_data_end() -> None:
    assert times(in_order_of_arrival([sample(0)], map(frame, (5, 9)), 0.0)) == ["imu 0", "frame 5", "frame 9"]


@given(st.sets(st.integers(0, 50), max_size=20), st.sets(st.integers(0, 50), max_size=8), st.integers(-9, 9))
def test_nothing_is_lost_and_every_window_is_there(imu_ms: set[int], frame_ms: set[int], offset_ms: int) -> None:
    events = list(in_order_of_arrival(map(sample, sorted(imu_ms)), map(frame, sorted(frame_ms)), offset_ms * 1e-3))
    assert len(events) == len(imu_ms) + len(frame_ms)
    newest_ms = -100
    for event in events:
        if isinstance(event, ImuSample):
            newest_ms = event.t_ns // 1_000_000
        elif isinstance(event, NavCameraFrame):
            due_ms = event.capture_timestamp // 1_000_000 + offset_ms
            assert newest_ms >= due_ms or newest_ms == max(imu_ms, default=-100)


def test_what_was_long_before_the_first_frame_is_left_out() -> None:
    def data() -> Iterator[SensorEvent]:
        yield from (sample(0), sample(899), sample(900), sample(1000), frame(1000), sample(1005))

    assert times(Recording(calibration(), data).events()) == ["imu 900", "imu 1000", "frame 1000", "imu 1005"]


# Thinning


def test_every_ninth_frame_is_left_of_30_a_second() -> None:
    thinning = Thinning(3.33, 1e9 / 30)
    assert [index for index in range(40) if thinning.wants(round(index * 1e9 / 30))] == [0, 9, 18, 27, 36]


def test_without_a_rate_all_are_wanted() -> None:
    thinning = Thinning(None)
    assert all(thinning.wants(t_ns) for t_ns in range(5))


def test_late_frame_does_not_bring_the_next_ones_nearer() -> None:
    thinning = Thinning(10.0)
    wanted_ms = [t_ms for t_ms in (0, 100, 350, 400, 450, 500) if thinning.wants(t_ms * 1_000_000)]
    assert wanted_ms == [0, 100, 350, 450]


@given(st.lists(st.integers(1, 200), min_size=2, max_size=60), st.floats(0.5, 50))
def test_never_more_than_asked_for(gaps_ms: list[int], fps: float) -> None:
    thinning = Thinning(fps)
    wanted = [t_ms for t_ms in itertools.accumulate(gaps_ms) if thinning.wants(t_ms * 1_000_000)]
    assert all(later - earlier >= 1e3 / fps - 1e-6 for earlier, later in itertools.pairwise(wanted))


# Axes


def test_axes_of_the_body_are_flu() -> None:
    np.testing.assert_array_equal(body_rotation("FLU"), np.eye(3))
    np.testing.assert_array_equal(body_rotation("FRD"), np.diag([1, -1, -1]))
    np.testing.assert_array_equal(body_rotation("URF") @ [1, 2, 3], [3, -2, 1])


def test_mounting_turns_on() -> None:
    nose_down = so3_exp(np.array([0, -0.3, 0]))  # about the vehicle's right
    ahead = body_rotation("FLU", nose_down) @ [1, 0, 0]
    np.testing.assert_allclose(ahead, [np.cos(0.3), 0, -np.sin(0.3)])


@pytest.mark.parametrize("letters", ["FRU", "FFU", "xyz", "FL"])
def test_letters_that_are_no_axes_are_refused(letters: str) -> None:
    with pytest.raises(ValueError, match=letters):
        body_rotation(letters)


def test_turning_keeps_what_does_not_depend_on_the_axes() -> None:
    plain, turn = recording(), body_rotation("URF")
    turned = plain.turned(turn)
    before, after = next(plain.events()), next(turned.events())
    assert isinstance(before, ImuSample)
    assert isinstance(after, ImuSample)
    np.testing.assert_allclose(after.accel, turn @ before.accel)
    np.testing.assert_allclose(after.gyro, turn @ before.gyro)
    assert plain.start is not None
    assert turned.start is not None
    # Where the camera is in the world, and how fast it moves there, is the same.
    cameras = [
        (start.body_T_world.inverse() @ one.calibration.B_T_C).matrix()
        for start, one in ((plain.start, plain), (turned.start, turned))
    ]
    np.testing.assert_allclose(cameras[0], cameras[1], atol=1e-12)
    np.testing.assert_allclose(turned.start.bias.accel, turn @ plain.start.bias.accel)
    np.testing.assert_allclose(turned.start.bias.gyro, turn @ plain.start.bias.gyro)
    velocities = [start.body_T_world.R.T @ start.velocity_b for start in (plain.start, turned.start)]
    np.testing.assert_allclose(velocities[0], velocities[1], atol=1e-12)


def test_turning_keeps_what_is_known_of_the_start() -> None:
    sigmas = np.arange(1.0, 16.0)
    start = WarmStartPose(SE3.identity(), np.zeros(3), ImuBias.zero(), np.diag(sigmas**2))
    turned = dataclasses.replace(recording(), start=start).turned(body_rotation("URF")).start
    assert turned is not None
    assert turned.covariance is not None
    # x, y, z become what was z, y, x in the body; the world's stay.
    expected = [3, 2, 1, 4, 5, 6, 7, 8, 9, 12, 11, 10, 15, 14, 13]
    np.testing.assert_allclose(turned.covariance, np.diag(np.array(expected, np.float64) ** 2), atol=1e-12)


def test_nothing_is_lost_where_there_is_nothing_to_turn() -> None:
    plain = recording()
    assert plain.turned(np.eye(3)) is plain


def test_turning_turns_the_true_attitude() -> None:
    turn = body_rotation("URF")
    poses = recording().turned(turn).poses
    assert poses is not None
    pose = poses.at(0)
    assert pose is not None
    np.testing.assert_allclose(pose.R, turn.T, atol=1e-12)


# Truth and errors


def test_frames_have_the_same_identifiers_each_time() -> None:
    assert frame(7).frame_id == frame(7).frame_id
    assert frame(7).frame_id < frame(8).frame_id
    assert make_frame(0, -5, PIXELS, "small").frame_id.int >= 0


def test_error_is_one_line() -> None:
    assert str(SourceError("a.mp4:\n broken")) == "a.mp4: broken"
