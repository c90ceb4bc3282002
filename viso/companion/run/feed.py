# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands a recording over as if it happened now."""

import dataclasses
import queue
from collections.abc import Callable

from viso.companion.sources.base import Recording
from viso.companion.vio.types import HeightMeasurement, ImuSample, NavCameraFrame, SensorEvent


class HandedFrames:
    """Frames that somebody else hands over (FrameSource)."""

    def __init__(self) -> None:
        self._frames: queue.SimpleQueue[NavCameraFrame | None] = queue.SimpleQueue()

    def hand(self, frame: NavCameraFrame | None) -> None:
        """Let ``read`` return a frame, or None for the end."""
        self._frames.put(frame)

    def read(self) -> NavCameraFrame | None:
        """Wait for the next frame; None at the end."""
        return self._frames.get()

    def close(self) -> None:
        """Let a ``read`` under way return."""
        self._frames.put(None)


class RecordingFeed:
    """Hands over what a recording has, each at its time.

    An inertial sample is due at its stamp, and what follows it in the recording with it.
    """

    def __init__(
        self,
        recording: Recording,
        take_imu: Callable[[ImuSample], object],
        take_height: Callable[[HeightMeasurement], object],
        frames: HandedFrames,
    ) -> None:
        self._events = recording.events()
        self._take_imu, self._take_height, self._frames = take_imu, take_height, frames
        self._next = next(self._events, None)
        self._due_ns: int | None = None  # it has not begun
        self._shift_ns = 0

    def begin(self, start_ns: int) -> int:
        """Let the recording begin at a time; return what that adds to its stamps, in ns."""
        if self._next is not None:
            self._shift_ns = start_ns - self._next.t_ns
        self._due_ns = start_ns
        return self._shift_ns

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self._next is None

    def next_due_ns(self) -> int | None:
        """Return when there is something to hand over next, None before the beginning and at the end."""
        if self._due_ns is None or self._next is None:
            return None
        if isinstance(self._next, ImuSample):
            self._due_ns = max(self._due_ns, self._next.t_ns + self._shift_ns)
        return self._due_ns

    def hand_over(self, now_ns: int) -> None:
        """Hand over what is due. Raises SourceError if the recording cannot be read on."""
        while self._next is not None and (due_ns := self.next_due_ns()) is not None and due_ns <= now_ns:
            self._hand(self._next)
            self._next = next(self._events, None)

    def _hand(self, event: SensorEvent) -> None:
        t_ns = event.t_ns + self._shift_ns
        if isinstance(event, ImuSample):
            self._take_imu(dataclasses.replace(event, t_ns=t_ns))
        elif isinstance(event, NavCameraFrame):
            self._frames.hand(dataclasses.replace(event, capture_timestamp=t_ns))
        else:
            self._take_height(dataclasses.replace(event, t_ns=t_ns))
