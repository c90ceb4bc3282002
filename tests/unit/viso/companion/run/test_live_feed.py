# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handing a recording over as if it happened now."""

from collections.abc import Iterator

import numpy as np

from tests.unit.viso.companion.vio.strategy_rig import make_calibration
from viso.companion.run.live import FrameMailbox, RecordingFeed
from viso.companion.sources.base import Recording, make_frame
from viso.companion.vio.types import HeightMeasurement, ImuSample, NavCameraFrame, SensorEvent

MS = 1_000_000


def sample(t_ms: int) -> ImuSample:
    return ImuSample(t_ms * MS, np.zeros(3), np.zeros(3))


def frame(t_ms: int) -> NavCameraFrame:
    return make_frame(0, t_ms * MS, np.zeros((48, 64), np.uint8), "cam")


class Taken:
    """Remembers what was handed over, and its stamp in ms."""

    def __init__(self) -> None:
        self.all: list[tuple[str, int]] = []

    def take_imu(self, sample: ImuSample) -> None:
        self.all.append(("imu", sample.t_ns // MS))

    def take_height(self, height: HeightMeasurement) -> None:
        self.all.append(("height", height.t_ns // MS))


class Frames(FrameMailbox):
    """Remembers frames as well."""

    def __init__(self, taken: Taken) -> None:
        super().__init__()
        self._taken = taken

    def put(self, frame: NavCameraFrame | None) -> None:
        if frame is not None:
            self._taken.all.append(("frame", frame.capture_timestamp // MS))


def feed_of(*events: SensorEvent) -> tuple[RecordingFeed, Taken]:
    def data() -> Iterator[SensorEvent]:
        yield from events

    taken = Taken()
    return RecordingFeed(Recording(make_calibration(), data), taken.take_imu, taken.take_height, Frames(taken)), taken


def test_nothing_is_handed_over_before_the_beginning() -> None:
    feed, taken = feed_of(sample(5), frame(5))
    feed.deliver(10**12)
    assert (taken.all, feed.next_due_ns(), feed.is_over) == ([], None, False)


def test_stamps_move_to_now() -> None:
    feed, taken = feed_of(sample(5), HeightMeasurement(6 * MS, 40.0, 0.3), frame(4), sample(10))
    assert feed.begin(1000 * MS) == 995 * MS
    feed.deliver(2000 * MS)
    assert taken.all == [("imu", 1000), ("height", 1001), ("frame", 999), ("imu", 1005)]
    assert feed.is_over


def test_each_comes_when_it_is_due() -> None:
    feed, taken = feed_of(sample(0), frame(0), sample(5), frame(3), sample(10))
    feed.begin(0)
    due = []
    while (due_ns := feed.next_due_ns()) is not None:
        due.append(due_ns // MS)
        feed.deliver(due_ns)
    assert due == [0, 5, 10]
    assert [name for name, _ in taken.all] == ["imu", "frame", "imu", "frame", "imu"]


def test_empty_recording_is_over() -> None:
    feed, _ = feed_of()
    assert (feed.begin(5), feed.next_due_ns(), feed.is_over) == (0, None, True)


def test_frames_are_read_as_they_are_handed_and_end_with_the_source() -> None:
    frames, one = FrameMailbox(), frame(1)
    frames.put(one)
    frames.close()
    assert frames.read() is one
    assert frames.read() is None


def test_time_of_a_frame_is_its_capture() -> None:
    assert (frame(7).t_ns, sample(8).t_ns) == (7 * MS, 8 * MS)
