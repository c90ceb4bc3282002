# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listening to a link."""

from mav_handlers.links import make_pair
from mav_handlers.wire.codec import Codec
from tests.unit.viso.conftest import odometry
from viso.doctor.live import LinkRecorder


def test_frames_get_the_times_at_which_they_were_read() -> None:
    ours, theirs = make_pair(("ours", "theirs"))
    codec, now = Codec(1, 197), [100.0]
    recorder = LinkRecorder(ours, 30_000_000, lambda: now[0])
    frames = [codec.encode(odometry(stamp)) for stamp in (1, 2, 3)]
    theirs.send(frames[0] + frames[1])
    recorder.read()
    now[0] += 0.25
    theirs.send(b"junk" + frames[2])
    recorder.read()
    stream = recorder.stream()
    assert [(message.arrival_us, message.frame) for message in stream.messages] == [
        (30_000_000, frames[0]),
        (30_000_000, frames[1]),
        (30_250_000, frames[2]),
    ]
    assert stream.notes == ("ours: 4 bytes that were no frames",)


def test_it_ends_in_time_or_when_asked_to() -> None:
    ours, _ = make_pair(("ours", "theirs"))
    times = iter(range(100))
    passed: list[float] = []
    LinkRecorder(ours, 0, lambda: next(times) * 1e-3).run(0.003, lambda: False, passed.append)
    assert passed == [0.001, 0.002]
    LinkRecorder(ours, 0, lambda: 0.0).run(9.0, lambda: True, passed.append)
    assert len(passed) == 2
