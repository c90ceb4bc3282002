# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages as the autopilot handled them, and the contents of a sender's messages of one type as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ap_core.log_field import LogValue
from ap_core.verdict import Verdict, VerdictKind
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.geometry.rotation import quats_from_euler, rotate
from viso.vehicle.outcomes import HandedSample

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

POSE_TYPES: Final = (
    VISION_POSITION_ESTIMATE,
    GLOBAL_VISION_POSITION_ESTIMATE,
    VICON_POSITION_ESTIMATE,
    ATT_POS_MOCAP,
    ODOMETRY,
)
VELOCITY_TYPES: Final = (VISION_SPEED_ESTIMATE, ODOMETRY)
STAMPED_TYPES: Final = (*POSE_TYPES, VISION_SPEED_ESTIMATE)
_EULER_TYPES: Final = (VISION_POSITION_ESTIMATE, GLOBAL_VISION_POSITION_ESTIMATE, VICON_POSITION_ESTIMATE)
Called = Mapping[str, str]
"""What a recording without names of messages holds of each, by the name of the message made of it."""

NAMED: Final[Called] = MappingProxyType({})
_MOST_US: Final = 1 << 62


def timed(table: Floats) -> Floats:
    """Return the rows whose first number, us, is a possible time; damaged records have others."""
    return np.asarray(table[np.abs(table[:, 0]) < _MOST_US], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class HandledMessage:
    """A message of the stream, or bytes that are none, and what the autopilot did with it.

    Attributes:
        number: in the stream, from 1.
        arrival_us: when the autopilot handled it, us since boot.
        system_id, component_id, sequence: of its header; 0 for bytes that are no frame.
        version: of MAVLink; 0 for bytes that are no frame.
        name: MAVLink's name of it; BAD_DATA for bytes that are no frame.
        message: its contents, if its type is one of ours; None for the autopilot's own telemetry.
        frame: its bytes; empty for bytes that are no frame, and for the autopilot's own telemetry.
        verdict: the autopilot's.
        records: the VISO, VISP and VISV records that it caused.
        samples: those that were handed to the filter, with their outcomes.
    """

    number: int
    arrival_us: int
    system_id: int
    component_id: int
    sequence: int
    version: int
    name: str
    message: Message | None
    frame: bytes
    verdict: Verdict
    records: tuple[tuple[str, tuple[LogValue, ...]], ...]
    samples: tuple[HandedSample, ...]

    @property
    def sender(self) -> tuple[int, int]:
        """System and component."""
        return self.system_id, self.component_id

    @property
    def is_taken(self) -> bool:
        """Whether it reached the backend, so that it counts for health."""
        return self.verdict.kind in (VerdictKind.ACCEPTED, VerdictKind.IGNORED)


@dataclass(frozen=True, slots=True)
class Sender:
    """The sender of one type of messages: the ids of system and component, and the messages' name.

    ``called`` is what the recording holds of the messages, if it has neither ids nor names.
    """

    system_id: int
    component_id: int
    name: str
    called: str = ""

    def __str__(self) -> str:
        return self.called or f"{self.name} from {self.system_id}/{self.component_id}"


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """N messages of one type from one sender, in the order of arrival.

    Attributes:
        sender: whose.
        numbers: of the messages in the stream, from 1.
        arrival_us: us since the autopilot's boot.
        stamp_us: as sent, less the first one; us of the sender's clock if the sender is right about the unit.
        first_stamp: the first one as sent.
        sequence: of the frame.
    """

    sender: Sender
    numbers: Ints
    arrival_us: Ints
    stamp_us: Ints
    first_stamp: int
    sequence: Ints

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def span_s(self) -> float:
        """From the first arrival to the last."""
        return float(self.arrival_us[-1] - self.arrival_us[0]) * 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """The poses in the messages of a track.

    Attributes:
        track: the messages.
        pos_m: N x 3, as sent.
        quat_wxyz: N x 4, from Euler angles or as sent.
        euler_rad: N x 3, roll, pitch, yaw as sent; None for messages that carry a quaternion.
        covariance: N x 21, as sent.
        reset_counter: N; 0 where the message carries none.
        quality: N; 0 where the message carries none.
    """

    track: Track
    pos_m: Floats
    quat_wxyz: Floats
    euler_rad: Floats | None
    covariance: Floats
    reset_counter: Ints
    quality: Ints

    @property
    def has_attitude(self) -> bool:
        """Whether any attitude is there: senders of positions alone fill it with zeros, NaN or identity."""
        vectors = np.abs(self.quat_wxyz[:, 1:])
        return bool((vectors > 0).any() or np.isinf(self.quat_wxyz).any())


@dataclass(frozen=True, slots=True, eq=False)
class Velocities:
    """The velocities in the messages of a track.

    Attributes:
        track: the messages.
        sent: N x 3, m/s as sent.
        used: N x 3, m/s as the autopilot understands it: NED, that of ODOMETRY turned by its quaternion.
    """

    track: Track
    sent: Floats
    used: Floats


def stamp_of(message: object) -> int:
    """Return the stamp of a message as sent; 0 if it has none."""
    return int(getattr(message, "usec", None) or getattr(message, "time_usec", 0) or 0)


def _ints(values: Sequence[int]) -> Ints:
    return np.array(values, dtype=np.int64)


def track_of(
    sender: Sender, numbers: Sequence[int], arrival_us: Sequence[int], stamps: Sequence[int], sequence: Sequence[int]
) -> Track:
    """Return a track of its messages, whose stamps are as sent."""
    since_first = [max(-_MOST_US, min(stamp - stamps[0], _MOST_US)) for stamp in stamps]
    return Track(sender, _ints(numbers), _ints(arrival_us), _ints(since_first), stamps[0], _ints(sequence))


def _track(sender: Sender, handled: Sequence[HandledMessage]) -> Track:
    return track_of(
        sender,
        [message.number for message in handled],
        [message.arrival_us for message in handled],
        [stamp_of(message.message) for message in handled],
        [message.sequence for message in handled],
    )


def grouped(
    messages: Sequence[HandledMessage], types: tuple[type, ...], called: Called = NAMED
) -> dict[Sender, list[HandledMessage]]:
    """Return messages of some types by sender, in order of first appearance."""
    groups: dict[Sender, list[HandledMessage]] = {}
    for message in messages:
        if isinstance(message.message, types):
            name = message.name
            sender = Sender(message.system_id, message.component_id, name, called.get(name, ""))
            groups.setdefault(sender, []).append(message)
    return groups


def stamped_tracks(messages: Sequence[HandledMessage], called: Called = NAMED) -> tuple[Track, ...]:
    """Return the tracks of all messages whose stamps the autopilot reads."""
    return tuple(_track(sender, handled) for sender, handled in grouped(messages, STAMPED_TYPES, called).items())


def reordered(quat_wxyz: Floats) -> Floats:
    """Return N x 4 quaternions that were in the order x, y, z, w, in the order w, x, y, z."""
    return np.roll(quat_wxyz, 1, axis=1)


def down_in_body(euler_rad: Floats) -> Floats:
    """Return N x 3 unit vectors down in body axes, from N x 3 roll, pitch and yaw."""
    roll, pitch = euler_rad[:, 0], euler_rad[:, 1]
    return np.column_stack((-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)))


def covariance_of(message: object) -> tuple[float, ...] | None:
    """Return the 21 numbers of a pose's covariance as sent; None for a message without a pose."""
    if not isinstance(message, POSE_TYPES):
        return None
    return message.pose_covariance if isinstance(message, ODOMETRY) else message.covariance


def _poses(sender: Sender, handled: Sequence[HandledMessage]) -> Poses:
    messages = [message.message for message in handled]
    pos_m = np.array([(m.x, m.y, m.z) for m in messages if isinstance(m, POSE_TYPES)], dtype=np.float64)
    euler_rad = None
    if isinstance(messages[0], _EULER_TYPES):
        euler_rad = np.array([(m.roll, m.pitch, m.yaw) for m in messages if isinstance(m, _EULER_TYPES)], np.float64)
        with np.errstate(all="ignore"):
            quat_wxyz = quats_from_euler(euler_rad)
    else:
        quat_wxyz = np.array([m.q for m in messages if isinstance(m, ATT_POS_MOCAP | ODOMETRY)], np.float64)
    return Poses(
        _track(sender, handled),
        pos_m,
        quat_wxyz,
        euler_rad,
        np.array([covariance_of(m) for m in messages], np.float64),
        _ints([getattr(m, "reset_counter", 0) for m in messages]),
        _ints([getattr(m, "quality", 0) for m in messages]),
    )


def pose_tracks(messages: Sequence[HandledMessage], called: Called = NAMED) -> tuple[Poses, ...]:
    """Return the poses of each sender and type of message."""
    return tuple(_poses(sender, handled) for sender, handled in grouped(messages, POSE_TYPES, called).items())


def _velocities(sender: Sender, handled: Sequence[HandledMessage]) -> Velocities:
    messages = [message.message for message in handled]
    if isinstance(messages[0], ODOMETRY):
        odometry = [m for m in messages if isinstance(m, ODOMETRY)]
        sent = np.array([(m.vx, m.vy, m.vz) for m in odometry], dtype=np.float64)
        used = rotate(np.array([m.q for m in odometry], dtype=np.float64), sent)
    else:
        speeds = [m for m in messages if isinstance(m, VISION_SPEED_ESTIMATE)]
        sent = used = np.array([(m.x, m.y, m.z) for m in speeds], dtype=np.float64)
    return Velocities(_track(sender, handled), sent, used)


def velocity_tracks(messages: Sequence[HandledMessage], called: Called = NAMED) -> tuple[Velocities, ...]:
    """Return the velocities of each sender and type of message."""
    return tuple(_velocities(sender, handled) for sender, handled in grouped(messages, VELOCITY_TYPES, called).items())


def median_of(values: Floats) -> float:
    """Return the median of what is finite; 0 if nothing is."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else 0.0
