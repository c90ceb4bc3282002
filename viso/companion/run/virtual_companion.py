# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion computer's program in virtual time: from the sensors of a synthetic flight to ODOMETRY on a link."""

import logging
from collections.abc import Callable, Iterable, Iterator
from types import MappingProxyType
from typing import Final

import numpy as np

from mav_handlers.links.base import Link
from mav_handlers.wire.messages import LOCAL_POSITION_NED, Message
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.odometry.inbound import FcInbound, stream_requests
from viso.companion.odometry.sender import OdometrySender
from viso.companion.odometry.source import OdometrySource
from viso.companion.vio.config import VioConfig
from viso.companion.vio.frames import ENU_TO_NED
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import Listener, VioPipeline
from viso.companion.vio.registry import build_vio_strategy
from viso.companion.vio.types import (
    HeightMeasurement,
    ImuBias,
    ImuSample,
    NavCameraFrame,
    SensorEvent,
    WarmStartPose,
)
from viso.companion.world.flight import SyntheticFlight
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array

AUTOPILOT_STREAMS_HZ: Final = MappingProxyType({"ATTITUDE_QUATERNION": 20.0, "LOCAL_POSITION_NED": 20.0})
MAX_POSITION_AGE_NS: Final = 200_000_000
AUTOPILOT_COVARIANCE: Final = np.diag(np.repeat([0.02, 0.02, 0.03, 1e-3, 0.2, 0.02, 0.2], (1, 1, 1, 3, 3, 3, 3)) ** 2)
"""The covariance of a warm start from the autopilot's state; the position is exact, as odometry starts there."""

_NS_PER_US: Final = 1000

Start = Callable[[int], WarmStartPose | None]
"""Returns the state at a time, or None while it is not known."""


class AutopilotState(FcInbound):
    """The autopilot's state, for a warm start.

    Args:
        origin_w: the autopilot's origin in the strategy's world, m, ENU.
    """

    def __init__(self, clock: ClockSync, origin_w: Array) -> None:
        super().__init__(clock, on_imu=lambda _sample: None)
        self._origin_w = origin_w
        self._place: tuple[int, LOCAL_POSITION_NED] | None = None

    def take(self, message: Message, arrival_ns: int) -> None:
        """Handle a message with its time of arrival."""
        if isinstance(message, LOCAL_POSITION_NED):
            self._place = arrival_ns, message
        super().take(message, arrival_ns)

    def start_at(self, t_ns: int) -> WarmStartPose | None:
        """Return the state at a time, None while it is not known; at rest in the origin before there is a position."""
        attitude, motion = self.attitude_at(t_ns), self._motion_at(t_ns)
        if attitude is None or motion is None:
            return None
        position, velocity = motion
        return WarmStartPose(
            SE3(attitude.R, position).inverse(), attitude.R.T.dot(velocity), ImuBias.zero(), AUTOPILOT_COVARIANCE
        )

    def _motion_at(self, t_ns: int) -> tuple[Array, Array] | None:
        if self._place is None:
            return self._origin_w, np.zeros(3)
        position_ns, at = self._place
        if abs(t_ns - position_ns) > MAX_POSITION_AGE_NS:
            return None
        velocity = ENU_TO_NED.T.dot([at.vx, at.vy, at.vz])
        since_s = (t_ns - position_ns) * 1e-9
        return self._origin_w + ENU_TO_NED.T.dot([at.x, at.y, at.z]) + velocity * since_s, velocity


class VirtualCompanion:
    """A companion computer that flies along: camera, inertial sensor and range finder, strategy, odometry, sender.

    It starts from the autopilot's attitude and position, in a world whose north is the autopilot's. Nothing in
    it waits or reads a clock: ``run`` gets the time.

    Args:
        flight: the data of the sensors; its clock is the companion's.

    Attributes:
        alter_frame: optional function that changes each frame before it is used.
    """

    def __init__(
        self,
        flight: SyntheticFlight,
        config: VioConfig,
        link: Link,
        logger: logging.Logger,
        listeners: Iterable[Listener] = (),
    ) -> None:
        clock = ClockSync()
        self._now_ns = flight.start_ns
        self._imu = ImuBuffer(wait=lambda _changed, _is_there, _wait_s: None)  # data not yet here will not come
        self._strategy = build_vio_strategy(config, flight.calibration, lambda: self._now_ns, logger)
        self.autopilot = AutopilotState(clock, flight.truth(flight.start_ns).t)
        self.source = OdometrySource(config, local_alignment=config.odometry.local_alignment, world_is_north=True)
        self.pipeline = VioPipeline(self._strategy, self._imu, (self.source.take_result, *listeners))
        self.sender = OdometrySender(
            link,
            self.source.message,
            clock,
            self.autopilot,
            config.odometry,
            start_us=flight.start_ns // _NS_PER_US,
        )
        self._requests = list(stream_requests(AUTOPILOT_STREAMS_HZ))
        self._arrivals = _arrivals(flight)
        self._next = next(self._arrivals, None)
        self._start: Start | None = self.autopilot.start_at
        self._has_world = False
        self.alter_frame: Callable[[NavCameraFrame], NavCameraFrame] = lambda frame: frame

    def start_from(self, start: Start | None = None) -> None:
        """Restart with the next frame at whose time a state is known.

        Args:
            start: knows the state; the autopilot unless given.
        """
        self._start = start or self.autopilot.start_at

    def run(self, now_us: int) -> None:
        """Handle what is due by a time of the companion's clock."""
        now_ns = now_us * _NS_PER_US
        while self._next is not None and self._next[0] <= now_ns:
            self._now_ns, event = self._next
            self._take(event)
            self._next = next(self._arrivals, None)
        self._now_ns = now_ns
        while self._requests:
            self.sender.send(self._requests.pop(0))
        self.sender.run(now_us)

    def close(self) -> None:
        """Release the strategy's system resources."""
        self._strategy.close()

    def _take(self, event: SensorEvent) -> None:
        if isinstance(event, ImuSample):
            self._imu.add(event)
            self.source.take_imu(event)
        elif isinstance(event, HeightMeasurement):
            self._strategy.add_height(event.t_ns, event.height_m, event.sigma_m)
        else:
            self._take_frame(self.alter_frame(event))

    def _take_frame(self, frame: NavCameraFrame) -> None:
        pose = None if self._start is None else self._start(frame.capture_timestamp)
        if pose is not None:
            self._start, self._has_world = None, True
            self.pipeline.request_warm_start(pose)
        if self._has_world:  # otherwise its world would have no north
            self.pipeline.process(frame)


def _arrivals(flight: SyntheticFlight) -> Iterator[tuple[int, SensorEvent]]:
    """Yield the times of arrival and the data at the companion, in order."""
    latency_ns = round(flight.latency_s * 1e9)
    for event in flight.events():
        if isinstance(event, NavCameraFrame):
            yield event.capture_timestamp + latency_ns, event
        else:
            yield event.t_ns, event
