# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listens to a link or a live topic for a while, and returns what came as a stream."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from mav_handlers.links import Link, wait_readable
from mav_handlers.wire.codec import Codec, Received
from viso.companion.recorded.bag_formats import collect
from viso.companion.recorded.records import TrajectoryError
from viso.errors import InputError, told_errors
from viso.ros2.poses import SCHEME, Heard, PoseTopic
from viso.streams.heard import version_heard
from viso.streams.recorded_poses import as_recorded
from viso.streams.stream_kinds import Stream, StreamMessage

LONGEST_WAIT_S: Final = 0.1
"""How long to wait at once, so that a signal is heeded soon."""
_MAX_READS: Final = 64


class LinkRecorder:
    """Keeps the frames that a link carries, with the times at which they were read; nothing is sent on it.

    Args:
        link: open.
        lead_us: the time since the autopilot's boot that the first frame gets.
        now_s: a monotonic clock in seconds.
    """

    def __init__(self, link: Link, lead_us: int, now_s: Callable[[], float]) -> None:
        self._link = link
        self._lead_us = lead_us
        self._now_s = now_s
        self._codec = Codec(0, 0)
        self._messages: list[StreamMessage] = []
        self._start_s: float | None = None
        self._damaged = 0

    def run(self, seconds: float, stop: Callable[[], bool], on_progress: Callable[[float], None]) -> None:
        """Listen until time is up or ``stop`` says so; ``on_progress`` is told the seconds that have passed."""
        start_s = self._now_s()
        while (passed_s := self._now_s() - start_s) < seconds and not stop():
            on_progress(passed_s)
            wait_readable([self._link], min(LONGEST_WAIT_S, seconds - passed_s))
            self.read()

    def read(self) -> None:
        """Take what has come."""
        for _ in range(_MAX_READS):
            data = self._link.receive()
            if not data:
                return
            now_s = self._now_s()
            if self._start_s is None:
                self._start_s = now_s
            self._codec.feed(data)
            self._keep(self._lead_us + int((now_s - self._start_s) * 1e6))

    def _keep(self, arrival_us: int) -> None:
        while (received := self._codec.next_received()) is not None:
            if isinstance(received, Received):
                self._messages.append(StreamMessage(arrival_us, received.header.frame))
            else:
                self._damaged += received.length

    def stream(self) -> Stream:
        """Return what has come so far."""
        notes = (f"{self._link.name}: {self._damaged} bytes that were no frames",) if self._damaged else ()
        stream = Stream(self._link.name, tuple(self._messages), notes=notes)
        return replace(stream, flown=version_heard(stream))


def heard_on_topic(
    topic: PoseTopic,
    seconds: float,
    now_ns: Callable[[], int],
    stop: Callable[[], bool],
    on_progress: Callable[[float], None],
) -> list[Heard]:
    """Return the poses that come on a topic, until time is up or ``stop`` says so; progress is in seconds.

    Raises:
        InputError: if none came; says why.
    """
    heard: list[Heard] = []
    start_ns = now_ns()
    while (passed_s := (now_ns() - start_ns) * 1e-9) < seconds and not stop():
        on_progress(passed_s)
        topic.find()
        wait_readable([topic], min(LONGEST_WAIT_S, seconds - passed_s))
        heard += topic.take(now_ns())
    if not heard:
        raise InputError(f"{SCHEME}{topic.name}: nothing heard within {seconds:g} s: {topic.silence()}")
    return heard


def stream_of_topic(topic: PoseTopic, heard: list[Heard], lead_us: int, axes: str, form: str | None) -> Stream:
    """Return what was heard on a topic as messages that hold it as it is; arguments and errors of ``as_recorded``."""
    name = SCHEME + topic.name
    with told_errors(TrajectoryError):
        records = collect(name, [one.message for one in heard])
    stream = as_recorded(records, lead_us, axes, form)
    notes = []
    writers = len({one.writer for one in heard})
    if writers > 1:
        notes.append(f"{name}: {writers} senders; viso play listens to one of them at a time")
    if topic.damaged:
        notes.append(f"{name}: {topic.damaged} messages that could not be read")
    return replace(stream, notes=(*notes, *stream.notes))
