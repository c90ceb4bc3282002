# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages, and what a fault makes of them."""

from typing import Any

from mav_handlers.wire.codec import Codec, Header, Received
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    DISTANCE_SENSOR,
    GLOBAL_VISION_POSITION_ESTIMATE,
    HEARTBEAT,
    ODOMETRY,
    OPTICAL_FLOW,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.faults import Injector, inject, parse_timeline, run_through

BEAT = HEARTBEAT(18, 8, 0, 0, 4, 3)
STAMP_US = 5_000_000
# A quarter turn to the right: forward is east. All numbers are exact in binary32.
EAST = (0.70710677, 0.0, 0.0, 0.70710677)


def odometry(stamp_us: int = STAMP_US, **fields: Any) -> ODOMETRY:
    """Return an ODOMETRY at 1, 2, -4 with nose to the north and 1 m/s ahead, unless told otherwise."""
    values: dict[str, Any] = {
        "time_usec": stamp_us,
        "frame_id": 20,
        "child_frame_id": 12,
        **dict.fromkeys(("vy", "vz", "rollspeed", "pitchspeed", "yawspeed"), 0.0),
        "x": 1.0,
        "y": 2.0,
        "z": -4.0,
        "q": (1.0, 0.0, 0.0, 0.0),
        "vx": 1.0,
        "pose_covariance": (0.5,) * 21,
        "velocity_covariance": (0.5,) * 21,
        "quality": 90,
    }
    return ODOMETRY(**{**values, **fields})


def flow(**fields: Any) -> OPTICAL_FLOW:
    """Return flow of 4 about x and -2 about y, unless told otherwise."""
    values = {"time_usec": STAMP_US, "sensor_id": 0, "flow_x": 4, "flow_y": -2, "quality": 180, "ground_distance": 2.0}
    more = {"flow_comp_m_x": 0.5, "flow_comp_m_y": -0.25, "flow_rate_x": 1.0, "flow_rate_y": -0.5}
    return OPTICAL_FLOW(**{**values, **more, **fields})


def distance(**fields: Any) -> DISTANCE_SENSOR:
    """Return 1.5 m down, unless told otherwise."""
    values = {"time_boot_ms": 5000, "min_distance": 10, "max_distance": 3000, "current_distance": 150, "type": 0}
    return DISTANCE_SENSOR(**{**values, "id": 1, "orientation": 25, "covariance": 0, **fields})


def position(**fields: Any) -> VISION_POSITION_ESTIMATE:
    """Return a VISION_POSITION_ESTIMATE at 1, 2, -4, level, nose to the north, unless told otherwise."""
    values = {"usec": STAMP_US, "x": 1.0, "y": 2.0, "z": -4.0, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}
    return VISION_POSITION_ESTIMATE(**{**values, **fields})


def speed(**fields: Any) -> VISION_SPEED_ESTIMATE:
    """Return a VISION_SPEED_ESTIMATE of 1 m/s to the north, unless told otherwise."""
    return VISION_SPEED_ESTIMATE(**{"usec": STAMP_US, "x": 1.0, "y": 0.0, "z": 0.0, **fields})


def delta(**fields: Any) -> VISION_POSITION_DELTA:
    """Return a VISION_POSITION_DELTA of 1, 2, 4 m and a little turn, unless told otherwise."""
    values = {"time_usec": STAMP_US, "time_delta_usec": 20_000, "confidence": 70.0}
    return VISION_POSITION_DELTA(
        **{**values, "angle_delta": (0.25, 0.0, -0.5), "position_delta": (1.0, 2.0, 4.0), **fields}
    )


def mocap(**fields: Any) -> ATT_POS_MOCAP:
    """Return an ATT_POS_MOCAP at 1, 2, -4, unless told otherwise."""
    return ATT_POS_MOCAP(**{"time_usec": STAMP_US, "q": (1.0, 0.0, 0.0, 0.0), "x": 1.0, "y": 2.0, "z": -4.0, **fields})


def every_kind() -> tuple[Message, ...]:
    """Return a message of each type of external navigation."""
    vicon = VICON_POSITION_ESTIMATE(STAMP_US, 1.0, 2.0, -4.0, 0.0, 0.0, 0.0)
    return (
        odometry(),
        position(),
        speed(),
        delta(),
        mocap(),
        vicon,
        GLOBAL_VISION_POSITION_ESTIMATE(STAMP_US, 1.0, 2.0, -4.0, 0.0, 0.0, 0.0),
    )


def encoded(*messages: Message, component_id: int = 197, version: int = 2) -> list[bytes]:
    """Return the frames of a sender that counts from 0."""
    codec = Codec(1, component_id, version)
    return [codec.encode(message) for message in messages]


def decoded(frame: bytes) -> tuple[Header, Any]:
    """Return header and message of a frame that is whole and undamaged."""
    codec = Codec(0, 0)
    codec.feed(frame)
    received = codec.next_received()
    assert isinstance(received, Received)
    assert received.header.frame == frame
    return received.header, received.message


def after(fault: str, *messages: Message, period_us: int = 100_000) -> list[Any]:
    """Return what messages, one after the other, say after a fault, given as on the command line."""
    stream = [(number * period_us, frame) for number, frame in enumerate(encoded(*messages))]
    return [decoded(frame)[1] for _, frame in inject(stream, parse_timeline(f"faults: [{{{fault}}}]"))]


def after_one(fault: str, message: Message) -> Any:
    """Return what one message says after a fault."""
    (changed,) = after(fault, message)
    return changed


def passed_over(fault: str, frame: bytes) -> dict[str, int]:
    """Return why a fault has left a frame alone, after checking that it did."""
    injector = Injector(parse_timeline(f"faults: [{{{fault}, messages: all}}]"))
    assert list(run_through([(0, frame)], injector)) == [(0, frame)]
    return dict(injector.tally().entries[0].passed_over)
