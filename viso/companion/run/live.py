# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Visual-inertial odometry in real time, from a recording or a camera, and on a link if there is an autopilot."""

import dataclasses
import logging
import queue
import time
from collections.abc import Callable, Mapping
from typing import Final

from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link
from mav_handlers.wire.messages import STATUSTEXT
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.odometry.inbound import FcInbound, stream_requests
from viso.companion.odometry.sender import OdometrySender
from viso.companion.odometry.source import OdometrySource
from viso.companion.run.log import VioLog
from viso.companion.sources.base import Recording
from viso.companion.sources.camera import LiveCamera
from viso.companion.vio.config import LocalAlignment, VioConfig
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.runtime import FrameSource, VioRuntime
from viso.companion.vio.types import HeightMeasurement, ImuSample, NavCameraFrame, SensorEvent


class FrameMailbox:
    """A source of frames that another thread supplies (FrameSource)."""

    def __init__(self) -> None:
        self._frames: queue.SimpleQueue[NavCameraFrame | None] = queue.SimpleQueue()

    def put(self, frame: NavCameraFrame | None) -> None:
        """Make ``read`` return a frame, or None for the end."""
        self._frames.put(frame)

    def read(self) -> NavCameraFrame | None:
        """Wait for the next frame; None at the end."""
        return self._frames.get()

    def close(self) -> None:
        """Make a waiting ``read`` return."""
        self._frames.put(None)


class RecordingFeed:
    """Delivers the data of a recording, each at its time.

    An inertial sample is due at its stamp, and what follows it in the recording with it.
    """

    def __init__(
        self,
        recording: Recording,
        take_imu: Callable[[ImuSample], object],
        take_height: Callable[[HeightMeasurement], object],
        frames: FrameMailbox,
    ) -> None:
        self._events = recording.events()
        self._take_imu, self._take_height, self._frames = take_imu, take_height, frames
        self._next = next(self._events, None)
        self._due_ns: int | None = None  # it has not begun
        self._shift_ns = 0

    def begin(self, start_ns: int) -> int:
        """Start the recording at a time; return the offset that is added to its stamps, in ns."""
        if self._next is not None:
            self._shift_ns = start_ns - self._next.t_ns
        self._due_ns = start_ns
        return self._shift_ns

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self._next is None

    def next_due_ns(self) -> int | None:
        """Return when the next data are due, None before the beginning and at the end."""
        if self._due_ns is None or self._next is None:
            return None
        if isinstance(self._next, ImuSample):
            self._due_ns = max(self._due_ns, self._next.t_ns + self._shift_ns)
        return self._due_ns

    def deliver(self, now_ns: int) -> None:
        """Deliver the due data. Raises SourceError if the recording cannot be read further."""
        while self._next is not None and (due_ns := self.next_due_ns()) is not None and due_ns <= now_ns:
            self._put(self._next)
            self._next = next(self._events, None)

    def _put(self, event: SensorEvent) -> None:
        t_ns = event.t_ns + self._shift_ns
        if isinstance(event, ImuSample):
            self._take_imu(dataclasses.replace(event, t_ns=t_ns))
        elif isinstance(event, NavCameraFrame):
            self._frames.put(dataclasses.replace(event, capture_timestamp=t_ns))
        else:
            self._take_height(dataclasses.replace(event, t_ns=t_ns))


NOW_NS: Final = time.monotonic_ns
LONGEST_WAIT_S: Final = 0.1
"""The longest single wait, so that a signal is handled soon."""
LAST_FRAME_S: Final = 2.0
_NORTH_STREAMS: Final[Mapping[str, float]] = {"ATTITUDE": 20.0}
_CAMERA_STREAMS: Final[Mapping[str, float]] = {
    **_NORTH_STREAMS,
    "RAW_IMU": 200.0,
    "HIGHRES_IMU": 200.0,
    "DISTANCE_SENSOR": 10.0,
}


class LiveVio:
    """A running odometry.

    The companion's clock is the machine's; a recording is moved there, as if it happened now.

    Args:
        source: of the data; with a camera, the IMU is that of the autopilot.
        link: to the autopilot; None for none.
        alignment: of the local frame; None for north if the autopilot knows it at the first pose.
        on_text: called with each text of the autopilot.
        now_ns: a monotonic clock.

    Raises:
        ValueError, StrategyNotAvailableError: if there is no such strategy.
        SourceError: if the camera cannot be opened, or the recording not be read.
    """

    def __init__(
        self,
        source: Recording | LiveCamera,
        config: VioConfig,
        log: VioLog,
        logger: logging.Logger,
        link: Link | None,
        *,
        alignment: LocalAlignment | None = None,
        on_text: Callable[[STATUSTEXT], None] = lambda _text: None,
        now_ns: Callable[[], int] = NOW_NS,
    ) -> None:
        self._config, self._log, self._link, self._on_text, self._now_ns = config, log, link, on_text, now_ns
        self._sync, self._buffer, self._mailbox = ClockSync(), ImuBuffer(), FrameMailbox()
        self._feed: RecordingFeed | None = None
        frames: FrameSource = self._mailbox
        on_imu: Callable[[ImuSample], object] = self.take_imu
        if isinstance(source, LiveCamera):
            frames, streams, is_north = source.open(now_ns), _CAMERA_STREAMS, False
        else:
            self._feed = RecordingFeed(source, self.take_imu, self.take_height, self._mailbox)
            # A recording has an IMU of its own.
            on_imu, is_north = (lambda _sample: None), source.world_is_north
            streams = {} if is_north else _NORTH_STREAMS
        inbound = FcInbound(
            self._sync,
            on_imu,
            lambda t_ns, agl_m: self.take_height(HeightMeasurement(t_ns, agl_m, config.agl_sigma_m)),
        )
        self._odometry = OdometrySource(
            config, local_alignment=alignment, world_is_north=is_north, yaw_at=inbound.yaw_at
        )
        self._runtime = VioRuntime(
            config,
            source.calibration,
            frames,
            self._buffer,
            clock_ns=now_ns,
            logger=logger,
            listeners=(self._odometry.take_result, log.take),
        )
        if isinstance(source, Recording) and source.start is not None:
            self._runtime.pipeline.request_warm_start(source.start)
        self._sender = None if link is None else self._made_sender(link, inbound, streams)

    def _made_sender(self, link: Link, inbound: FcInbound, streams: Mapping[str, float]) -> OdometrySender:
        odometry = self._config.odometry
        return OdometrySender(
            link,
            self._odometry.message,
            self._sync,
            inbound,
            odometry,
            stream_requests=stream_requests(streams, odometry.system_id),
            start_us=self._now_ns() // 1000,
        )

    def wait_for_vehicle(self, patience_s: float, stop: Callable[[], bool]) -> bool:
        """Send heartbeats until bytes come from the vehicle; return whether some came in time."""
        end_ns = self._now_ns() + round(patience_s * 1e9)
        while self._link is not None and not self._link.stats.bytes_in and not stop() and self._now_ns() < end_ns:
            self._step()
        return self._link is not None and self._link.stats.bytes_in > 0

    def run(self, stop: Callable[[], bool], *, delay_s: float = 0.0, until_s: float | None = None) -> None:
        """Run until the source ends or a time limit is reached.

        Args:
            delay_s: how long to wait before the first frame.
            until_s: when to end with a camera, since the start; a recording ends by itself.

        Raises:
            SourceError: if the recording cannot be read on.
        """
        start_ns = self._now_ns() + round(delay_s * 1e9)
        end_ns = None if until_s is None else start_ns + round(until_s * 1e9)
        if self._feed is not None:
            self._log.shift_ns = self._feed.begin(start_ns)
        with self._runtime:
            while not stop() and not self._is_over(end_ns):
                self._step()
            self._mailbox.put(None)
            last_ns = self._now_ns() + round(LAST_FRAME_S * 1e9)
            while self._feed is not None and not stop() and not self._runtime.wait(0.0) and self._now_ns() < last_ns:
                self._step()

    def close(self) -> None:
        """Close an odometry that has not run: its strategy may have started a program."""
        self._runtime.stop()

    def sent(self) -> dict[str, int]:
        """Return how many messages of which kind were sent."""
        counters = {} if self._sender is None else self._sender.counters
        return {name: count for name, count in sorted(counters.items()) if not name.startswith("received")}

    def take_imu(self, sample: ImuSample) -> None:
        """Add an IMU sample."""
        self._buffer.add(sample)
        self._odometry.take_imu(sample)

    def take_height(self, height: HeightMeasurement) -> None:
        """Add a height above ground."""
        self._runtime.pipeline.strategy.add_height(height.t_ns, height.height_m, height.sigma_m)

    def _is_over(self, end_ns: int | None) -> bool:
        if self._feed is not None:
            return self._feed.is_over
        return self._runtime.wait(0.0) or (end_ns is not None and self._now_ns() >= end_ns)

    def _step(self) -> None:
        """Handle what is due, then wait for the next event."""
        now_ns = self._now_ns()
        due_ns = [now_ns + round(LONGEST_WAIT_S * 1e9)]
        if self._feed is not None:
            self._feed.deliver(now_ns)
            due_ns.append(self._feed.next_due_ns() or due_ns[0])
        if self._sender is not None:
            self._sender.run(now_ns // 1000)
            due_ns.append(self._sender.next_due_us() * 1000)
            while self._sender.texts:
                self._on_text(self._sender.texts.popleft())
        wait_readable([] if self._link is None else [self._link], max(0.0, (min(due_ns) - self._now_ns()) * 1e-9))
