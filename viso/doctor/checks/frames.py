# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN2: frames of reference, and velocities compared with the path."""

import math
from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from mav_handlers.verdicts import ODOMETRY_FRAMES
from mav_handlers.wire.messages import ODOMETRY
from viso.doctor.checks import limits
from viso.doctor.checks.beside_vehicle import heading_departs
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.motion import LEAST_SPEED, Motion, agreement, best_axes, heading_between, typical_speed
from viso.doctor.evidence.tracks import Floats
from viso.streams.stream_kinds import Aspect

_ORDER: Final = "XN2-10"
_FRAMES: Final = {
    0: "GLOBAL",
    1: "LOCAL_NED",
    4: "LOCAL_ENU",
    7: "LOCAL_OFFSET_NED",
    8: "BODY_NED",
    9: "BODY_OFFSET_NED",
    12: "BODY_FRD",
    13: "BODY_FLU (old)",
    14: "MOCAP_NED (old)",
    15: "MOCAP_ENU (old)",
    16: "VISION_NED (old)",
    17: "VISION_ENU (old)",
    18: "ESTIM_NED (old)",
    19: "ESTIM_ENU (old)",
    20: "LOCAL_FRD",
    21: "LOCAL_FLU",
}
_ENU: Final = frozenset({4, 15, 17, 19, 21})
_NED: Final = frozenset({1, 7, 14, 16, 18, 20})
_BODY_FRD: Final = frozenset({8, 12})


def _fix_of_frames(frame_id: int, child_id: int) -> str:
    """Return what the sender of ODOMETRY in these frames has to change."""
    if frame_id == child_id == 20:
        return (
            "Only the label of the velocity is wrong if it is in body axes: set child_frame_id to 12. Older VOXL "
            "software labels it so; there velocities are in local axes, so turn them by the inverse of q, or update it."
        )
    if frame_id in _ENU or child_id in (13, 21):
        return (
            "As the ids say, data are in ROS axes (ENU, FLU): change them to (y, x, -z) in the world and "
            "(x, -y, -z) in the body, q with them, then set frame_id 20 and child_frame_id 12. MAVROS does it: publish "
            "to its odometry/out topic rather than making the message yourself."
        )
    if frame_id in _NED and child_id in _BODY_FRD:
        return (
            "Data can stay as they are: set frame_id 20 and child_frame_id 12. PX4 takes LOCAL_NED as well, "
            "ArduPilot does not."
        )
    if frame_id in _NED and child_id in _NED | {0}:
        return (
            "Turn the velocity into body axes by the inverse of q, then set frame_id 20 and child_frame_id 12. "
            "Bridges written for PX4 or for older MAVROS send such pairs."
        )
    return "Set frame_id 20 (MAV_FRAME_LOCAL_FRD) and child_frame_id 12 (MAV_FRAME_BODY_FRD), with data to match."


def _name(frame: int) -> str:
    return f"{frame} ({_FRAMES.get(frame, 'unknown')})"


@check(
    code="XN2-01",
    severity=Severity.ERROR,
    title="ODOMETRY in frames that the autopilot drops",
    firmware=(
        "Only frame_id 20 (LOCAL_FRD) with child_frame_id 12 (BODY_FRD) is accepted. Any other is dropped: it is not "
        "logged, does not count for health, and no text reports it."
    ),
    source=ODOMETRY_FRAMES.rule.source,
    fix="Set frame_id 20 and child_frame_id 12, with data to match.",
    needs={Aspect.LINK},
)
def odometry_frames(evidence: Evidence) -> Iterator[Sighting]:
    found = [message for message in evidence.stream.vision if message.verdict is ODOMETRY_FRAMES]
    pairs = Counter(
        (message.message.frame_id, message.message.child_frame_id)
        for message in found
        if isinstance(message.message, ODOMETRY)
    )
    total = sum(message.name == "ODOMETRY" for message in evidence.stream.vision)
    for (frame_id, child_id), count in pairs.most_common():
        of_pair = [
            message
            for message in found
            if isinstance(message.message, ODOMETRY)
            and (message.message.frame_id, message.message.child_frame_id) == (frame_id, child_id)
        ]
        text = f"{share(count, total)} ODOMETRY with frame_id {_name(frame_id)} and child_frame_id {_name(child_id)}"
        yield Sighting.in_messages(text, of_pair, _fix_of_frames(frame_id, child_id))


def _scaled(motion: Motion, velocities: Floats) -> Floats:
    speed = typical_speed(velocities)
    return velocities * (typical_speed(motion.path) / speed) if speed > 0 else velocities


def _is_comparable(motion: Motion) -> bool:
    return motion.is_enough and typical_speed(motion.sent) > limits.ZERO_SPEED_SHARE * min(
        LEAST_SPEED, typical_speed(motion.path)
    )


class _Mixed(NamedTuple):
    """A mix-up that makes velocities fit the path: the code of its check, how well they fit, a text, and a fix."""

    code: str
    correlation: float
    text: str
    fix: str | None = None


def _as_used(motion: Motion) -> float:
    return agreement(motion.path, _scaled(motion, motion.used)).correlation


def _frame_mix(motion: Motion) -> _Mixed:
    """Return how velocities fit if they are in the other frame than the message says."""
    is_body = motion.velocity_sender.name == "ODOMETRY"
    other = agreement(motion.path, _scaled(motion, motion.sent if is_body else motion.turned)).correlation
    where = "local" if is_body else "body"
    fix = (
        "Turn the velocity into the body's axes by the inverse of q."
        if is_body
        else "Turn the velocity by the attitude into the axes of the positions."
    )
    return _Mixed("XN2-03", other, f"the velocity fits the path only if it is in {where} axes", fix)


def _order_mix(motion: Motion) -> Iterator[_Mixed]:
    """Yield how velocities of ODOMETRY fit if its quaternion is read as x, y, z, w (XN2-10, in axes.py)."""
    if motion.velocity_sender.name == "ODOMETRY" and motion.is_level_reordered:
        correlation = agreement(motion.path, _scaled(motion, motion.reordered)).correlation
        yield _Mixed(_ORDER, correlation, "")


def is_misordered(evidence: Evidence, motion: Motion) -> bool:
    """Return whether velocities fit a path only if the quaternion is read as x, y, z, w."""
    mixed = _mix_up(motion, is_of_log=Aspect.LINK in evidence.stream.lacks)
    return mixed is not None and mixed.code == _ORDER


def _message_mix(motion: Motion, *, is_of_log: bool) -> Iterator[_Mixed]:
    """Yield how velocities of a log fit if they came in body axes, in a message whose velocities are used unchanged.

    A log does not name the message, so that its velocities are read as those of ODOMETRY.
    """
    if is_of_log and motion.velocity_sender.name == "ODOMETRY":
        correlation = agreement(motion.path, _scaled(motion, motion.used_turned)).correlation
        text = "the velocity that the autopilot used fits the path only if it is in body axes"
        fix = (
            "If VISION_SPEED_ESTIMATE is sent, turn the velocity by the attitude into the axes of the positions. If "
            "ODOMETRY is sent, look for a velocity that is turned by the inverse of q twice."
        )
        yield _Mixed("XN2-03", correlation, text, fix)


def _axes_mix(motion: Motion) -> Iterator[_Mixed]:
    """Yield how velocities fit if axes are mixed up, in the local frame or in the body's."""
    axes, fit = best_axes(motion.path, _scaled(motion, motion.used))
    if not axes.is_identity:
        text = f"the path fits velocities if their north, east, down are taken as {axes.text}"
        yield _Mixed("XN2-04", fit.correlation, text)
    if motion.velocity_sender.name == "ODOMETRY":
        axes, fit = best_axes(motion.path_body, _scaled(motion, motion.sent))
        if not axes.is_identity:
            text = f"the path fits velocities if their forward, right, down are taken as {axes.text}"
            yield _Mixed("XN2-04", fit.correlation, text)


def _heading_mix(motion: Motion) -> Iterator[_Mixed]:
    """Yield how velocities fit if they are turned about the vertical, and not by a right angle."""
    angle, correlation = heading_between(motion.path, motion.used)
    if abs(math.remainder(angle, math.pi / 2)) > limits.HEADING_TURNED_RAD:
        text = f"velocities have to be turned by {math.degrees(angle):.0f} deg to fit the path"
        yield _Mixed("XN2-05", correlation, text)


@lru_cache(maxsize=32)  # four checks ask
def _mix_up(motion: Motion, *, is_of_log: bool) -> _Mixed | None:
    """Return the simplest mix-up with which velocities fit the path; None if they fit as they are, or with none."""
    if not _is_comparable(motion):
        return None
    least = max(limits.FITS_CORRELATION, _as_used(motion) + limits.BETTER_CORRELATION)
    best: _Mixed | None = None
    simple = *_order_mix(motion), _frame_mix(motion), *_message_mix(motion, is_of_log=is_of_log)
    for mixed in (*simple, *_heading_mix(motion), *_axes_mix(motion)):
        if mixed.correlation > least:
            best, least = mixed, mixed.correlation + limits.BETTER_CORRELATION
    return best


def _mixed_as(code: str, evidence: Evidence) -> Iterator[Sighting]:
    for motion in evidence.stream.motions:
        mixed = _mix_up(motion, is_of_log=Aspect.LINK in evidence.stream.lacks)
        if mixed is not None and mixed.code == code and not heading_departs(evidence, motion.velocity_sender):
            text = f"{motion.velocity_sender} against {motion.pose_sender.name}: {mixed.text}"
            fit = f"(correlation {mixed.correlation:.2f}, as the autopilot reads them {_as_used(motion):.2f})"
            yield Sighting.in_track(f"{text} {fit}", motion, fix=mixed.fix)


@check(
    code="XN2-03",
    severity=Severity.ERROR,
    title="Velocity in the wrong frame",
    firmware=(
        "The velocity of ODOMETRY is in the body frame, and the autopilot rotates it by q. That of "
        "VISION_SPEED_ESTIMATE is in the frame of the positions, and is used unchanged."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry and handle_vision_speed_estimate",
    fix="Send the velocity in the frame that the message asks for.",
)
def velocity_frame(evidence: Evidence) -> Iterator[Sighting]:
    return _mixed_as("XN2-03", evidence)


@check(
    code="XN2-04",
    severity=Severity.ERROR,
    title="Axes of path and velocities mixed up",
    firmware=(
        "The autopilot expects x forward or north, y right or east, z down in both. The filter gets two measurements "
        "that contradict each other."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix="Apply the same change of axes to positions, velocities and attitude.",
)
def velocity_axes(evidence: Evidence) -> Iterator[Sighting]:
    return _mixed_as("XN2-04", evidence)


@check(
    code="XN2-05",
    severity=Severity.WARNING,
    title="Attitude rotated against the path",
    firmware=(
        "The yaw of the attitude rotates the velocity of ODOMETRY. With EK3_SRC1_YAW 6 it is the vehicle's heading. "
        "Flown paths bend; beyond about 30 degrees the vehicle circles."
    ),
    source="GCS_Common.cpp, GCS_MAVLINK::handle_odometry",
    fix=(
        "Use one frame for attitude and position. Look for a yaw that is set or aligned in only one of them, or for a "
        "camera that does not point where the attitude says."
    ),
)
def velocity_heading(evidence: Evidence) -> Iterator[Sighting]:
    return _mixed_as("XN2-05", evidence)
