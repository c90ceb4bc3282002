# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Made telemetry of a flight: what a companion sends of it, beside the vehicle's own ATTITUDE."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    ATTITUDE,
    HEARTBEAT,
    ODOMETRY,
    PARAM_VALUE,
    STATUSTEXT,
    VISION_POSITION_ESTIMATE,
    Message,
)
from viso.doctor import Evidence, gather
from viso.geometry.rotation import quats_from_euler
from viso.streams.stream_kinds import Stream, StreamMessage

Floats = NDArray[np.float64]
Change = Callable[[Floats], Floats]
"""Of roll, pitch and yaw, or of positions: N x 3 to N x 3, or of quaternions: N x 4."""

BOOT_S: Final = 30.0

COPTER: Final = 2
PARAMS: Final = MappingProxyType(
    {
        "VISO_TYPE": 1.0,
        "VISO_ORIENT": 0.0,
        "EK3_SRC1_POSXY": 6.0,
        "EK3_SRC1_VELXY": 0.0,
        "EK3_SRC1_POSZ": 1.0,
        "EK3_SRC1_VELZ": 0.0,
        "EK3_SRC1_YAW": 6.0,
    }
)


def same(values: Floats) -> Floats:
    """Return values as they are."""
    return values


@dataclass(frozen=True, slots=True)
class Motion:
    """How a vehicle moves.

    Attributes:
        length_s: of the flight.
        yaw_rad: how far it turns.
        tilt_rad: how far it leans at most.
        size_m: of its path.
        noise_rad: of the angles that the companion sends.
    """

    length_s: float = 40.0
    yaw_rad: float = 0.9
    tilt_rad: float = 0.05
    size_m: float = 2.0
    noise_rad: float = 0.0

    def angles(self, time_s: Floats) -> Floats:
        """Return N x 3 roll, pitch and yaw."""
        return np.column_stack(
            (
                self.tilt_rad * np.sin(1.9 * time_s + 0.3),
                self.tilt_rad * np.sin(1.3 * time_s),
                self.yaw_rad * np.sin(0.37 * time_s) + 0.3 * self.yaw_rad * np.sin(0.9 * time_s),
            )
        )

    def places(self, time_s: Floats) -> Floats:
        """Return N x 3 m north, east, down."""
        return self.size_m * np.column_stack(
            (np.sin(0.31 * time_s), np.cos(0.23 * time_s), -0.3 + 0.2 * np.cos(0.5 * time_s))
        )


MOVING: Final = Motion()


def telemetry(
    kind: str = "VISION_POSITION_ESTIMATE",
    motion: Motion = MOVING,
    *,
    angles: Change = same,
    quats: Change = same,
    places: Change = same,
    velocities: Callable[[Floats, Floats], Floats] | None = None,
    delay_s: Callable[[Floats], Floats] = np.zeros_like,
    hz: float = 30.0,
    attitude_hz: float = 10.0,
    params: Mapping[str, float] = PARAMS,
    vehicle: int = COPTER,
    others: Sequence[tuple[float, Message]] = (),
) -> Stream:
    """Return a recording of a flight.

    Args:
        kind: of message that the companion sends.
        motion: of the vehicle.
        angles, quats, places: what the companion makes of roll, pitch and yaw, of quaternions, and of positions.
        velocities: of ODOMETRY, from its quaternions and the velocity north, east, down; unknown without it.
        delay_s: how old contents are when they are sent, by the time of sending.
        hz: of the companion's messages.
        attitude_hz: of ATTITUDE.
        params: of the vehicle.
        vehicle: its MAV_TYPE.
        others: further messages of the autopilot, and their times in s.
    """
    autopilot, companion, noise = Codec(1, 1), Codec(1, 197), np.random.default_rng(1)
    sent: list[tuple[float, bytes]] = []

    def own(at_s: float, message: Message) -> None:
        sent.append((at_s, autopilot.encode(message)))

    own(0.0, HEARTBEAT(vehicle, 3, 217, 0, 4, 3))
    own(0.0, STATUSTEXT(6, "ArduCopter V4.6.3 (3fc7011a)"))
    for number, (name, value) in enumerate(params.items()):
        own(0.001 * number, PARAM_VALUE(name, value, 9, 1300, number))
    for at_s, other in others:
        own(at_s, other)
    time_s = np.arange(0.02, motion.length_s, 1 / attitude_hz)
    rpy, later = motion.angles(time_s), motion.angles(time_s + 0.01)
    rates = (later - rpy) / 0.01
    roll, pitch = rpy[:, 0], rpy[:, 1]
    body = np.column_stack(
        (
            rates[:, 0] - np.sin(pitch) * rates[:, 2],
            np.cos(roll) * rates[:, 1] + np.sin(roll) * np.cos(pitch) * rates[:, 2],
            np.cos(roll) * np.cos(pitch) * rates[:, 2] - np.sin(roll) * rates[:, 1],
        )
    )
    wrapped = np.angle(np.exp(1j * rpy))
    for one_s, angle, rate in zip(time_s.tolist(), wrapped.tolist(), body.tolist(), strict=True):
        own(one_s, ATTITUDE(round((BOOT_S + one_s) * 1e3), *angle, *rate))
    time_s = np.arange(0.03, motion.length_s, 1 / hz)
    then_s = time_s - delay_s(time_s)
    rpy = motion.angles(then_s)
    said = angles(rpy + motion.noise_rad * noise.standard_normal(rpy.shape))
    turned, path = quats(quats_from_euler(said)), places(motion.places(then_s))
    moving = (motion.places(then_s + 0.01) - motion.places(then_s - 0.01)) / 0.02
    speeds = np.full_like(moving, np.nan) if velocities is None else velocities(turned, moving)
    for one_s, angle, quat, (x, y, z), speed in zip(
        time_s.tolist(), said.tolist(), turned.tolist(), path.tolist(), speeds.tolist(), strict=True
    ):
        stamp = round((BOOT_S + one_s) * 1e6)
        message: Message
        if kind == "ODOMETRY":
            unknown = float("nan")
            vx, vy, vz = speed
            message = ODOMETRY(
                *(stamp, 20, 12, x, y, z, tuple(quat), vx, vy, vz, unknown, unknown, unknown),
                pose_covariance=(0.0,) * 21,
                velocity_covariance=(0.0,) * 21,
            )
        elif kind == "ATT_POS_MOCAP":
            message = ATT_POS_MOCAP(stamp, tuple(quat), x, y, z)
        else:
            message = VISION_POSITION_ESTIMATE(stamp, x, y, z, *angle)
        sent.append((one_s, companion.encode(message)))
    sent.sort(key=lambda one: one[0])
    return Stream("made", tuple(StreamMessage(round((BOOT_S + one_s) * 1e6), frame) for one_s, frame in sent))


def judged(stream: Stream) -> Evidence:
    """Return evidence of a recording, without a filter."""
    return gather(stream, is_tried=False)
