# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listens to a link or a live topic for a while, and returns the messages as a stream."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Final

from mav_handlers.links import Link, wait_readable
from mav_handlers.wire.codec import Codec, Received
from viso.dds.poses import SCHEME, Heard, PoseTopic
from viso.errors import InputError, as_input_errors
from viso.geometry.trajectory_files import TrajectoryError
from viso.streams.bag_formats import collect
from viso.streams.heard import version_heard
from viso.streams.recorded_poses import as_recorded
from viso.streams.stream_kinds import Stream, StreamMessage

LONGEST_WAIT_S: Final = 0.1
"""How long to wait at once, so that a signal is heeded soon."""
_MAX_READS: Final = 64


def _waits(
    seconds: float, now_s: Callable[[], float], stop: Callable[[], bool], on_progress: Callable[[float], None]
) -> Iterator[float]:
    """Yield how long to wait next, until time is up or ``stop`` says so; progress is in seconds."""
    start_s = now_s()
    while (passed_s := now_s() - start_s) < seconds and not stop():
        on_progress(passed_s)
        yield min(LONGEST_WAIT_S, seconds - passed_s)


def heard_on_link(
    link: Link,
    lead_us: int,
    seconds: float,
    now_s: Callable[[], float],
    stop: Callable[[], bool],
    on_progress: Callable[[float], None],
) -> Stream:
    """Return the frames that an open link receives, with the times at which they were read; nothing is sent.

    The first gets ``lead_us`` as its time since the autopilot's boot. ``now_s`` is a monotonic clock.
    """
    codec, messages, damaged = Codec(0, 0), list[StreamMessage](), 0
    start_s: float | None = None
    for wait_s in _waits(seconds, now_s, stop, on_progress):
        wait_readable([link], wait_s)
        for data in islice(iter(link.receive, b""), _MAX_READS):
            time_s = now_s()
            start_s = time_s if start_s is None else start_s
            codec.feed(data)
            while (received := codec.next_received()) is not None:
                if isinstance(received, Received):
                    messages.append(StreamMessage(lead_us + int((time_s - start_s) * 1e6), received.header.frame))
                else:
                    damaged += received.length
    notes = (f"{link.name}: {damaged} bytes that were no frames",) if damaged else ()
    stream = Stream(link.name, tuple(messages), notes=notes)
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
    for wait_s in _waits(seconds, lambda: now_ns() * 1e-9, stop, on_progress):
        topic.find()
        wait_readable([topic], wait_s)
        heard += topic.take(now_ns())
    if not heard:
        raise InputError(f"{SCHEME}{topic.name}: nothing heard within {seconds:g} s: {topic.silence()}")
    return heard


def stream_of_topic(topic: PoseTopic, heard: list[Heard], lead_us: int, axes: str, form: str | None) -> Stream:
    """Return the poses of a topic as a stream of messages; arguments and errors are those of ``as_recorded``."""
    name = SCHEME + topic.name
    with as_input_errors(TrajectoryError):
        records = collect(name, [pose.message for pose in heard])
    stream = as_recorded(records, lead_us, axes, form)
    notes = []
    writers = len({pose.writer for pose in heard})
    if writers > 1:
        notes.append(f"{name}: {writers} senders; viso play listens to one of them at a time")
    if topic.damaged:
        notes.append(f"{name}: {topic.damaged} messages that could not be read")
    return replace(stream, notes=(*notes, *stream.notes))
