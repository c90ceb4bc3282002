# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listening to a link."""

from mav_handlers.links import make_pair
from mav_handlers.wire.codec import Codec
from tests.unit.viso.conftest import odometry
from viso.doctor.evidence.live import heard_on_link


def test_frames_get_the_times_at_which_they_were_read() -> None:
    ours, theirs = make_pair(("ours", "theirs"))
    codec, now = Codec(1, 197), [100.0]
    frames = [codec.encode(odometry(stamp)) for stamp in (1, 2, 3)]
    sent = [frames[0] + frames[1], b"junk" + frames[2]]

    def send_next(passed_s: float) -> None:
        now[0] = 100.0 + (0.25 if passed_s or len(sent) < 2 else 0.0)
        theirs.send(sent.pop(0))

    stream = heard_on_link(ours, 30_000_000, 9.0, lambda: now[0], lambda: not sent, send_next)
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
    heard_on_link(ours, 0, 0.003, lambda: next(times) * 1e-3, lambda: False, passed.append)
    assert passed == [0.001, 0.002]
    heard_on_link(ours, 0, 9.0, lambda: 0.0, lambda: True, passed.append)
    assert len(passed) == 2
