# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages become columns with the values that the handlers hand to AP_VisualOdom, to the bit."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_core.verdict import Verdict
from ap_visualodom.verdicts import CONSUMED
from mav_handlers.handlers import VISION_HANDLERS
from mav_handlers.jitter_correction import JitterCorrection
from mav_handlers.vision_columns import Arrived, is_sample, vision_columns
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    HEARTBEAT,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.firmware.releases import PROFILES

FLOATS = st.floats(width=32)
STAMPS = st.integers(0, 2**63)
COVARIANCES = st.lists(FLOATS | st.just(0.01), min_size=21, max_size=21).map(tuple)
THREE = st.tuples(FLOATS, FLOATS, FLOATS)
FOUR = st.tuples(FLOATS, FLOATS, FLOATS, FLOATS)
COUNTERS, QUALITIES = st.integers(0, 255), st.integers(-1, 100)
COVARIANCE_3 = (0.0,) * 9


def make(kind: Any, *values: Any) -> Any:
    return kind(*values)


def odometry(stamp: int, pos: Any, q: Any, vel: Any, covariance: Any, counter: int, quality: int) -> Any:
    motion = (*vel, 0.0, 0.0, 0.0)
    return make(ODOMETRY, stamp, 20, 12, *pos, q, *motion, covariance, covariance, counter, 0, quality)


MESSAGES = st.one_of(
    st.builds(
        lambda kind, stamp, pos, euler, covariance, counter: make(kind, stamp, *pos, *euler, covariance, counter),
        st.sampled_from([VISION_POSITION_ESTIMATE, GLOBAL_VISION_POSITION_ESTIMATE]),
        *(STAMPS, THREE, THREE, COVARIANCES, COUNTERS),
    ),
    st.builds(
        lambda stamp, pos, euler, covariance: make(VICON_POSITION_ESTIMATE, stamp, *pos, *euler, covariance),
        *(STAMPS, THREE, THREE, COVARIANCES),
    ),
    st.builds(
        lambda stamp, q, pos, covariance: make(ATT_POS_MOCAP, stamp, q, *pos, covariance),
        *(STAMPS, FOUR, THREE, COVARIANCES),
    ),
    st.builds(odometry, STAMPS, THREE, FOUR, THREE, COVARIANCES, COUNTERS, QUALITIES),
    st.builds(
        lambda stamp, vel, counter: make(VISION_SPEED_ESTIMATE, stamp, *vel, COVARIANCE_3, counter),
        *(STAMPS, THREE, COUNTERS),
    ),
)


@dataclass
class Calls:
    """Stands in for AP_VisualOdom: notes what it is given, attitudes as quaternions."""

    now_us: int = 0
    made: list[tuple[Any, ...]] = field(default_factory=list)

    def handle_pose_estimate(
        self, remote_us: int, time_ms: int, pos: Vector3f, attitude: Quaternion, *rest: Any
    ) -> Verdict:
        self.made.append((self.now_us, remote_us, time_ms, pos.to_tuple(), attitude.to_wxyz(), *rest))
        return CONSUMED

    def handle_pose_estimate_euler(
        self, remote_us: int, time_ms: int, pos: Vector3f, euler: Vector3f, *rest: Any
    ) -> Verdict:
        return self.handle_pose_estimate(remote_us, time_ms, pos, Quaternion.from_euler(*euler.to_tuple()), *rest)

    def handle_vision_speed_estimate(self, remote_us: int, time_ms: int, vel: Vector3f, *rest: Any) -> Verdict:
        self.made.append((self.now_us, remote_us, time_ms, vel.to_tuple(), *rest))
        return CONSUMED


def by_handlers(arrived: Sequence[Arrived], release: str) -> list[tuple[Any, ...]]:
    calls, corrector = Calls(), JitterCorrection()
    vehicle = SimpleNamespace(visual_odom=calls, release=PROFILES[release].endpoint)
    for one in arrived:
        calls.now_us = one.now_us

        def correct(_kind: type[Message], remote_us: int, local_us: int = one.local_us) -> int:
            return corrector.correct_offboard_timestamp_usec(remote_us, local_us) // 1000 % 2**32

        context: Any = SimpleNamespace(vehicle=vehicle, correct_time_ms=correct)
        VISION_HANDLERS[type(one.message)](context, one.message)
    return calls.made


def by_columns(arrived: Sequence[Arrived], release: str) -> list[tuple[Any, ...]]:
    columns = vision_columns(arrived, JitterCorrection(), PROFILES[release].endpoint)
    rows: dict[int, tuple[Any, ...]] = {}
    poses, velocities = columns.poses, columns.velocities
    for row, place in enumerate(poses.place.tolist()):
        times = int(poses.time_us[row]), int(poses.remote_us[row]), int(poses.time_ms[row])
        errors = poses.pos_err[row], poses.ang_err[row]
        tail = int(poses.reset_counter[row]), int(poses.quality[row])
        rows[place] = (*times, tuple(poses.pos[:, row]), tuple(poses.quat[:, row]), *errors, *tail)
    for row, place in enumerate(velocities.place.tolist()):
        times = int(velocities.time_us[row]), int(velocities.remote_us[row]), int(velocities.time_ms[row])
        tail = int(velocities.reset_counter[row]), int(velocities.quality[row])
        rows[place] = (*times, tuple(velocities.vel[:, row]), *tail)
    assert sorted(rows) == list(range(len(rows)))
    return [rows[place] for place in sorted(rows)]


def bits(rows: Sequence[Any]) -> list[Any]:
    """Return rows with floats as their bits, every NaN the same."""
    return [
        bits(one) if isinstance(one, tuple | list) else
        (None if np.isnan(one) else int(one.view(np.uint32))) if isinstance(one, np.float32) else one
        for one in rows
    ]  # fmt: skip


@pytest.mark.parametrize("release", PROFILES)
@settings(max_examples=25)
@given(messages=st.lists(st.tuples(MESSAGES, st.integers(0, 2_000_000)), max_size=12))
def test_messages_become_what_the_handlers_make_of_them(release: str, messages: list[tuple[Message, int]]) -> None:
    arrived = [
        Arrived(10_000_000 + 20_000 * number, 9_999_000 + 20_000 * number + lag_us, message)
        for number, (message, lag_us) in enumerate(messages)
    ]
    with np.errstate(all="ignore"):
        assert bits(by_columns(arrived, release)) == bits(by_handlers(arrived, release))


def test_places_count_samples_and_tell_where_a_message_begins() -> None:
    one = odometry(1, (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), (0.0,) * 21, 0, 50)
    speed = VISION_SPEED_ESTIMATE(1, 0, 0, 0, COVARIANCE_3, 0)
    columns = vision_columns([Arrived(1, 1, message) for message in (one, speed, one)], JitterCorrection())
    assert columns.first_place.tolist() == [0, 2, 3]
    assert columns.poses.place.tolist() == [0, 3]
    assert columns.velocities.place.tolist() == [1, 2, 4]


def test_no_messages_become_no_samples() -> None:
    columns = vision_columns([], JitterCorrection())
    assert (len(columns.poses), len(columns.velocities)) == (0, 0)


def test_only_poses_and_velocities_in_accepted_frames_are_samples() -> None:
    good = odometry(1, (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), (0.0,) * 21, 0, 50)
    other_frame = make(ODOMETRY, 1, 1, 12, *good_fields(good))
    delta = VISION_POSITION_DELTA(1, 1, (0.0,) * 3, (0.0,) * 3, 50.0)
    others = (other_frame, delta, HEARTBEAT(0, 0, 0, 0, 0, 3), None)
    assert is_sample(good)
    assert not any(map(is_sample, others))


def good_fields(message: ODOMETRY) -> tuple[Any, ...]:
    return (
        *(message.x, message.y, message.z, message.q, message.vx, message.vy, message.vz),
        *(message.rollspeed, message.pitchspeed, message.yawspeed, message.pose_covariance),
        *(message.velocity_covariance, message.reset_counter, message.estimator_type, message.quality),
    )
