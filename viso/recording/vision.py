# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages of a scenario's streams: where the camera is, by its pattern of motion, and what is sent when."""

import heapq
import math
import random
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, NamedTuple

from ekf_stub.core.vectors import Vec3, conjugate, quat_of_euler, rotated
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    GLOBAL_VISION_POSITION_ESTIMATE,
    ODOMETRY,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_DELTA,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.recording.scenario import Jump, Stream

_WOBBLE_S: Final = 4.0


class Pose(NamedTuple):
    """Where a camera is: NED position in m, velocity in m/s, roll, pitch and yaw in rad."""

    position_m: Vec3
    velocity_m_s: Vec3
    angles_rad: Vec3


def pose_at(stream: Stream, time_s: float) -> Pose:
    """Return where the camera of a stream is, a time after it began; not of one that follows the truth."""
    north, east, down = stream.position_m
    velocity: Vec3 = (0.0, 0.0, 0.0)
    if stream.motion == "line":
        velocity = (stream.velocity_m_s[0], stream.velocity_m_s[1], stream.velocity_m_s[2])
        north, east, down = (place + speed * time_s for place, speed in zip((north, east, down), velocity, strict=True))
    elif stream.motion == "circle":
        rate = 2 * math.pi / stream.period_s
        sine, cosine = math.sin(rate * time_s), math.cos(rate * time_s)
        north, east = north + stream.radius_m * cosine, east + stream.radius_m * sine
        velocity = (-stream.radius_m * rate * sine, stream.radius_m * rate * cosine, 0.0)
    wobble = math.radians(stream.wobble_deg) * math.sin(2 * math.pi * time_s / _WOBBLE_S)
    yaw = math.remainder(math.radians(stream.heading_deg), 2 * math.pi)
    return Pose((north, east, down), velocity, (wobble, -0.5 * wobble, yaw))


def _to_body(angles_rad: Vec3, vector: Vec3) -> Vec3:
    return rotated(conjugate(quat_of_euler(*angles_rad)), vector)


class VisionStream:
    """One stream that runs since ``start_us`` of the recorder's time: when its next message is due, what is in it."""

    def __init__(self, stream: Stream, start_us: int) -> None:
        self._stream = stream
        self._start_us = start_us
        self._frames = 0
        self._resets = 0
        self._silent_until_us = start_us
        self._waiting: list[tuple[int, int, Message]] = []
        self._random = random.Random(stream.seed)
        self._truth: Pose | None = None
        self._before: Pose | None = None
        self._jumped: tuple[Vec3, float] = (0.0, 0.0, 0.0), 0.0

    def next_due_us(self) -> int:
        """Return when there is something to do: a frame is taken, or a message is sent."""
        frame_us = self._frame_us()
        return min(frame_us, self._waiting[0][0]) if self._waiting else frame_us

    def _frame_us(self) -> int:
        return self._start_us + round(self._frames * 1e6 / self._stream.rate_hz)

    def due_messages(self, now_us: int) -> list[Message]:
        """Return what is to be sent by now, in order."""
        while (frame_us := self._frame_us()) <= now_us:
            self._take_frame(frame_us)
            self._frames += 1
        found = []
        while self._waiting and self._waiting[0][0] <= now_us:
            found.append(heapq.heappop(self._waiting)[2])
        return found

    def _take_frame(self, frame_us: int) -> None:
        stream = self._stream
        elapsed_us = frame_us - self._start_us
        every_us, for_us = (round(one * 1e6) for one in (stream.silent_every_s, stream.silent_for_s))
        silent = every_us > 0 and elapsed_us >= every_us and elapsed_us % every_us < for_us
        pose = self._pose(elapsed_us * 1e-6)
        if silent or pose is None or frame_us < self._silent_until_us:
            return
        delays = stream.delays_ms
        delay_ms = delays[self._frames % len(delays)] + self._random.uniform(0, stream.random_delay_ms)
        stamp_us = round(stream.stamp_offset_s * 1e6) + elapsed_us + round(elapsed_us * stream.drift_ppm * 1e-6)
        message = self._message(int(stamp_us / stream.stamp_unit_us), pose)
        heapq.heappush(self._waiting, (frame_us + round(delay_ms * 1e3), self._frames, message))

    def _pose(self, elapsed_s: float) -> Pose | None:
        if self._stream.motion == "truth":
            if self._truth is None:
                return None
            pose = self._truth
        else:
            pose = pose_at(self._stream, elapsed_s)
        offset, yaw_rad = self._jumped
        roll, pitch, yaw = (self._noisy(angle, math.radians(self._stream.noise_deg)) for angle in pose.angles_rad)
        north, east, down = (
            self._noisy(place + by, self._stream.noise_m) for place, by in zip(pose.position_m, offset, strict=True)
        )
        return Pose((north, east, down), pose.velocity_m_s, (roll, pitch, math.remainder(yaw + yaw_rad, 2 * math.pi)))

    def _noisy(self, value: float, sigma: float) -> float:
        return value + self._random.gauss(0, sigma) if sigma else value

    def _message(self, stamp: int, pose: Pose) -> Message:
        stream, name = self._stream, self._stream.message
        (x, y, z), (vx, vy, vz), angles = pose
        covariance = _filled(stream.covariance, 21)
        if name == "ODOMETRY":
            frame, child = map(int, stream.frames)
            quat, body = quat_of_euler(*angles), _to_body(angles, pose.velocity_m_s)
            of_velocity = _filled(stream.velocity_covariance, 21)
            ends = self._resets, 0, stream.quality
            return ODOMETRY(stamp, frame, child, x, y, z, quat, *body, 0.0, 0.0, 0.0, covariance, of_velocity, *ends)
        if name == "VISION_SPEED_ESTIMATE":
            return VISION_SPEED_ESTIMATE(stamp, vx, vy, vz, _filled(stream.velocity_covariance, 9), self._resets)
        if name == "ATT_POS_MOCAP":
            return ATT_POS_MOCAP(stamp, quat_of_euler(*angles), x, y, z, covariance)
        if name == "VISION_POSITION_DELTA":
            return self._delta(stamp, pose)
        if name == "VICON_POSITION_ESTIMATE":
            return VICON_POSITION_ESTIMATE(stamp, x, y, z, *angles, covariance)
        kind = VISION_POSITION_ESTIMATE if name == "VISION_POSITION_ESTIMATE" else GLOBAL_VISION_POSITION_ESTIMATE
        return kind(stamp, x, y, z, *angles, covariance, self._resets)

    def _delta(self, stamp: int, pose: Pose) -> Message:
        before, self._before = self._before or pose, pose
        moved = tuple(new - old for new, old in zip(pose.position_m, before.position_m, strict=True))
        turned = tuple(
            math.remainder(new - old, 2 * math.pi) for new, old in zip(pose.angles_rad, before.angles_rad, strict=True)
        )
        body = _to_body(pose.angles_rad, (moved[0], moved[1], moved[2]))
        return VISION_POSITION_DELTA(
            stamp, round(1e6 / self._stream.rate_hz), turned, body, float(self._stream.quality)
        )

    # What a scenario does to it

    def take_truth(self, truth: Pose) -> None:
        """Have a stream that follows the truth be where the vehicle is."""
        self._truth = truth

    def change(self, values: Mapping[str, Any]) -> None:
        """Change some fields from now on; frames and stamps go on in step."""
        if values.get("rate_hz", self._stream.rate_hz) != self._stream.rate_hz:
            elapsed_us = self._frame_us() - self._start_us
            self._frames = math.ceil(elapsed_us * 1e-6 * values["rate_hz"])
        self._stream = replace(self._stream, **values)

    def jump(self, jump: Jump) -> None:
        """Go on elsewhere."""
        (north, east, down), yaw_rad = self._jumped
        by = jump.position_m
        self._jumped = (north + by[0], east + by[1], down + by[2]), yaw_rad + math.radians(jump.yaw_deg)
        self._resets = (self._resets + jump.counted) % 256

    def be_silent(self, until_us: int) -> None:
        """Send nothing that is taken before a time."""
        self._silent_until_us = until_us


def _filled(values: tuple[float, ...], count: int) -> tuple[float, ...]:
    return (*values, *(0.0,) * count)[:count]
