# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN6: jumps and reset counters."""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import aligned_us, follows_vehicle
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, how_often
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES, time_base_us
from viso.doctor.evidence.tracks import POSE_TYPES, Bools, Floats, Poses, median_of
from viso.geometry.rotation import euler_from_quats
from viso.streams.stream_kinds import Aspect

_RESET: Final = "AP_VisualOdom_Backend.cpp, AP_VisualOdom_Backend::get_reset_timestamp_ms"
_CONSUME: Final = "AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::should_consume_sensor_data"
_NEAR: Final = 5
_OF_ONE_JUMP: Final = 3
_TYPE_VOXL: Final = 3


class _Steps(NamedTuple):
    """How far each pose but the first is from where the pose before it leads to.

    Attributes:
        position_m: off by.
        yaw_rad: change of yaw.
        turn_rad: off by.
        dt_s: since the one before.
        counter_changed: whether the reset counter did.
        usual_m: the median of ``position_m``.
    """

    position_m: Floats
    yaw_rad: Floats
    turn_rad: Floats
    dt_s: Floats
    counter_changed: Bools
    usual_m: float


def _steps(poses: Poses) -> _Steps:
    time_s = time_base_us(poses.track) * 1e-6
    dt = np.diff(time_s)
    step = np.diff(poses.pos_m, axis=0)
    speed = step / np.maximum(dt, 1e-3)[:, None]
    size = np.linalg.norm(speed, axis=1, keepdims=True)
    speed = np.where(size > limits.JUMP_SPEED_M_S, speed * (limits.JUMP_SPEED_M_S / size), speed)
    before = np.vstack([speed[1:2], speed[:-1]])  # it may move from the first pose on
    off = np.linalg.norm(step - np.nan_to_num(before) * dt[:, None], axis=1)
    alone = np.linalg.norm(step, axis=1)
    off = np.minimum(off, alone)
    yaw = np.diff(euler_from_quats(poses.quat_wxyz)[:, 2])
    turn = np.arctan2(np.sin(yaw), np.cos(yaw))
    usual = median_of(off)
    turn_before = np.concatenate([turn[1:2], turn[:-1]])
    turn_off = np.minimum(np.abs(np.arctan2(np.sin(turn - turn_before), np.cos(turn - turn_before))), np.abs(turn))
    return _Steps(off, turn, turn_off, dt, np.diff(poses.reset_counter) != 0, usual)


def _jumped(steps: _Steps) -> Bools:
    allowed = (
        np.maximum(limits.JUMP_M, limits.JUMP_TIMES_USUAL * steps.usual_m)
        + 0.5 * limits.JUMP_ACCELERATION_M_S2 * np.minimum(steps.dt_s, limits.JUMP_WITHIN_S) ** 2
    )
    return np.asarray(steps.position_m > allowed, dtype=np.bool_)


def _turned(steps: _Steps, poses: Poses) -> Bools:
    pitch = np.abs(euler_from_quats(poses.quat_wxyz)[1:, 1])
    level = pitch < limits.LEVEL_PITCH_RAD
    allowed = (
        limits.JUMP_RAD
        + 0.5 * limits.JUMP_TURN_RAD_S2 * np.minimum(steps.dt_s, limits.JUMP_TURN_WITHIN_S) ** 2
        + limits.SHAKEN_TIMES * _shaking_rad(steps.turn_rad)
    )
    return np.asarray((level | (_rotation_off_rad(poses) > allowed)) & (steps.turn_rad > allowed), dtype=np.bool_)


def _rotation_off_rad(poses: Poses) -> Floats:
    """Return by how much the angle of each rotation exceeds that of the one before."""
    quat = poses.quat_wxyz / np.linalg.norm(poses.quat_wxyz, axis=1, keepdims=True)
    angle = 2 * np.arccos(np.clip(np.abs((quat[1:] * quat[:-1]).sum(axis=1)), 0, 1))
    return np.asarray(angle - np.concatenate([angle[1:2], angle[:-1]]), dtype=np.float64)


def _shaking_rad(turn_rad: Floats) -> Floats:
    """Return how much turns near each step differ from one to the next; those of a jump there and back are left out."""
    padded = np.pad(np.nan_to_num(turn_rad), _NEAR)
    near = np.sort(sliding_window_view(padded, 2 * _NEAR + 1), axis=1)
    return np.asarray(near[:, -1 - _OF_ONE_JUMP], dtype=np.float64)


def _at_steps(poses: Poses, mask: Bools, text: str) -> Sighting:
    track, chosen = poses.track, np.flatnonzero(mask) + 1
    return Sighting.in_track(f"{track.sender}: {text}, the first at {at(track.arrival_us[chosen[0]])}", track, chosen)


class _Resets(NamedTuple):
    """Which steps of a track jump, turn, or change the reset counter, and which of these belong together."""

    steps: _Steps
    jumped: Bools
    turned: Bools
    changed: Bools
    shifted: Bools


@lru_cache(maxsize=32)  # many checks ask
def _resets(poses: Poses) -> _Resets:
    steps = _steps(poses)
    jumped, turned, changed = _jumped(steps), _turned(steps, poses), steps.counter_changed
    leaps = jumped | turned
    # A counter that changes without a leap, and a leap without a change just before or after it.
    alone, bare = changed & ~leaps, leaps & ~changed
    shifted = np.zeros(len(changed), dtype=np.bool_)
    for index in np.flatnonzero(alone):
        near = slice(max(0, index - limits.COUNTER_NEIGHBOURS), index + limits.COUNTER_NEIGHBOURS + 1)
        if bare[near].any():
            shifted[index] = True
            shifted[near] |= bare[near]
    return _Resets(steps, jumped, turned, changed, shifted)


def _tracks(evidence: Evidence) -> Iterator[tuple[Poses, _Resets]]:
    for poses in evidence.stream.poses:
        if len(poses.track) < FEWEST_MESSAGES:
            continue
        resets = _resets(poses)
        # In a DataFlash log poses are as the autopilot aligned them: they jump at an alignment.
        arrival_us = poses.track.arrival_us[1:]
        by_autopilot = np.zeros(len(arrival_us), dtype=np.bool_)
        for time_us in aligned_us(evidence):
            by_autopilot |= np.abs(arrival_us - time_us) < limits.ALIGNED_WITHIN_US
        leaps = ~by_autopilot | resets.changed
        jumped = resets.jumped & leaps & ~follows_vehicle(evidence, arrival_us)
        yield poses, resets._replace(jumped=jumped, turned=resets.turned & leaps)


def jumps_in(evidence: Evidence) -> int:
    """Return how many jumps of position or yaw are in the stream itself."""
    return sum(int(np.count_nonzero(resets.jumped | resets.turned)) for _, resets in _tracks(evidence))


@check(
    code="XN6-01",
    severity=Severity.WARNING,
    title="Position jumps without a reset",
    firmware=(
        "The gate rejects the samples for 7 s, then the filter resets to them. While velocities pass it never resets, "
        "and horizontal position counts as lost after 10 s."
    ),
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED",
    fix="Increment reset_counter when the map is re-localised or tracking restarts; filter single outliers.",
)
def position_jump(evidence: Evidence) -> Iterator[Sighting]:
    for poses, resets in _tracks(evidence):
        mask = resets.jumped & ~resets.changed & ~resets.shifted
        if mask.any():
            largest = float(resets.steps.position_m[mask].max())
            text = f"the position jumps {how_often(mask.sum())}, by up to {largest:.1f} m, and reset_counter stays"
            yield _at_steps(poses, mask, text)


@check(
    code="XN6-02",
    severity=Severity.WARNING,
    title="Yaw jumps without a reset",
    firmware=(
        "With EK3_SRC1_YAW 6 a yaw beyond the gate is rejected for the rest of the flight. A reset counter would not "
        "help: it never resets yaw."
    ),
    source="AP_NavEKF3_MagFusion.cpp, NavEKF3_core::fuseEulerYaw",
    fix="Keep the yaw of the frame over a re-localisation, and shift the position alone.",
)
def yaw_jump(evidence: Evidence) -> Iterator[Sighting]:
    for poses, resets in _tracks(evidence):
        mask = resets.turned & ~resets.changed & ~resets.shifted
        if mask.any():
            largest = math.degrees(float(np.abs(resets.steps.yaw_rad[mask]).max()))
            yield _at_steps(poses, mask, f"the yaw jumps {how_often(mask.sum())}, by up to {largest:.0f} deg")


@check(
    code="XN6-12",
    severity=Severity.WARNING,
    title="Reset counter and jump do not come together",
    firmware=(
        "Type 3 maps the message with the new counter to where the camera was: if the jump comes one message later, "
        "all of it remains. Type 1 resets the filter to a sample from before the jump, and rejects what follows."
    ),
    source="AP_VisualOdom_IntelT265.cpp, AP_VisualOdom_IntelT265::handle_voxl_camera_reset_jump",
    fix=(
        "Change reset_counter with the first message after the jump. Look for a counter that is not read together with "
        "the pose."
    ),
    needs={Aspect.RESETS},
)
def counter_beside_jump(evidence: Evidence) -> Iterator[Sighting]:
    for poses, resets in _tracks(evidence):
        mask = resets.shifted & resets.changed
        if mask.any() and not _counter_flaps(poses):
            text = f"reset_counter changes {how_often(mask.sum())} a message or two before or behind the jump"
            yield _at_steps(poses, mask, text)


@check(
    code="XN6-03",
    severity=Severity.WARNING,
    title="Reset counter changes without a jump",
    firmware=(
        "Type 1 resets the filter to the sample, which is harmless; type 2 ignores the camera for more than a second, "
        "type 3 aligns it again."
    ),
    source=_CONSUME,
    fix="Change reset_counter with the first message after a jump, and only then.",
    needs={Aspect.RESETS},
)
def counter_without_jump(evidence: Evidence) -> Iterator[Sighting]:
    for poses, resets in _tracks(evidence):
        if _counter_flaps(poses):
            continue
        steps = resets.steps
        near = max(limits.NO_JUMP_M, limits.NO_JUMP_TIMES_USUAL * steps.usual_m)
        quiet = (
            (steps.position_m < near) & (steps.turn_rad < limits.NO_JUMP_RAD) & (steps.dt_s < limits.NO_JUMP_WITHIN_S)
        )
        mask = np.asarray(resets.changed & quiet & ~resets.shifted, dtype=np.bool_)
        if mask.any():
            yield _at_steps(poses, mask, f"reset_counter changes {how_often(mask.sum())}, and the pose goes on")


def _counter_flaps(poses: Poses) -> bool:
    changes = int(np.count_nonzero(np.diff(poses.reset_counter)))
    return changes >= limits.FEWEST_FLAPS and changes > limits.FLAPS_HZ * max(poses.track.span_s, 1.0)


@check(
    code="XN6-04",
    severity=Severity.ERROR,
    title="Reset counter changes all the time",
    firmware=(
        "Type 1 resets the filter with every change, type 2 ignores everything, because it waits for a second without "
        "a change, and type 3 aligns again with every change."
    ),
    source=_CONSUME,
    fix="Do not count messages in reset_counter. Do not mix messages with and without one: without one it counts as 0.",
    needs={Aspect.RESETS},
)
def counter_always_changes(evidence: Evidence) -> Iterator[Sighting]:
    poses = [message for message in evidence.stream.vision if isinstance(message.message, POSE_TYPES)]
    if len(poses) < FEWEST_MESSAGES:
        return
    counters = [int(getattr(pose.message, "reset_counter", 0)) for pose in poses]
    changed = [pose for pose, a, b in zip(poses[1:], counters, counters[1:], strict=False) if a != b]
    span_s = max((poses[-1].arrival_us - poses[0].arrival_us) * 1e-6, 1.0)
    if len(changed) >= limits.FEWEST_FLAPS and len(changed) > limits.FLAPS_HZ * span_s:
        yield Sighting.in_messages(f"reset_counter changes {len(changed)} times in {span_s:.1f} s", changed)


@check(
    code="XN6-05",
    severity=Severity.WARNING,
    title="First reset counter is not 0",
    firmware=(
        "The autopilot starts from 0 and treats the first message as a reset: type 2 ignores the first second, type 3 "
        "says VisOdom: reset and maps the first position to 0."
    ),
    source=_RESET,
    fix="Start at 0, or accept it: it happens once.",
    needs={Aspect.RESETS},
)
def first_counter(evidence: Evidence) -> Iterator[Sighting]:
    for poses in evidence.stream.poses:
        first = int(poses.reset_counter[0])
        if first != 0:
            severity = Severity.WARNING if evidence.viso_type == _TYPE_VOXL else Severity.NOTE
            text = f"{poses.track.sender}: the first message has reset_counter {first}"
            yield Sighting.in_track(text, poses.track, slice(1), severity=severity)


@check(
    code="XN6-11",
    severity=Severity.ERROR,
    title="Two poses that contradict each other",
    firmware="Both count as one camera's: the filter is pulled back and forth, and rejects one or both.",
    source="AP_VisualOdom.cpp, AP_VisualOdom::handle_pose_estimate",
    fix="Send one of them.",
)
def contradicting_poses(evidence: Evidence) -> Iterator[Sighting]:
    """Find two senders of poses whose positions lie apart at the same time."""
    for index in range(1, len(evidence.stream.poses)):
        earlier, other = evidence.stream.poses[0], evidence.stream.poses[index]
        if len(earlier.track) < FEWEST_MESSAGES or len(other.track) < FEWEST_MESSAGES:
            continue
        first, last = earlier.track.arrival_us[0], earlier.track.arrival_us[-1]
        inside = (other.track.arrival_us >= first) & (other.track.arrival_us <= last)
        if np.count_nonzero(inside) < FEWEST_MESSAGES:
            continue
        times = other.track.arrival_us[inside]
        there = np.column_stack(
            [np.interp(times, earlier.track.arrival_us, earlier.pos_m[:, axis]) for axis in range(3)]
        )
        apart = median_of(np.linalg.norm(there - other.pos_m[inside], axis=1))
        if apart > limits.POSES_APART_M:
            yield Sighting.in_track(
                f"{earlier.track.sender} and {other.track.sender} are {apart:.1f} m apart", other.track, inside
            )
