# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The queue that drops the oldest, and the thread that reads a camera."""

import logging
import threading
from collections.abc import Iterator

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from tests.unit.viso.companion.vio.strategy_rig import EventHandler, make_frame, make_logger
from viso.companion.vio.runtime import CameraIngest, DropOldestQueue
from viso.companion.vio.types import NavCameraFrame


def sequence_of(frame: NavCameraFrame | None) -> int | None:
    return None if frame is None else frame.sequence


class Film:
    """A source that shows frames, then ends or fails; closing it is remembered."""

    def __init__(self, frames: int, failure: Exception | None = None) -> None:
        self._frames = iter([make_frame(i) for i in range(frames)])
        self._failure = failure
        self.closed = 0

    def read(self) -> NavCameraFrame | None:
        frame = next(self._frames, None)
        if frame is None and self._failure is not None:
            raise self._failure
        return frame

    def close(self) -> None:
        self.closed += 1


class FrozenCamera:
    """A source that shows nothing until it is closed, and then fails."""

    def __init__(self) -> None:
        self.asked = threading.Event()
        self._closed = threading.Event()

    def read(self) -> NavCameraFrame | None:
        self.asked.set()
        self._closed.wait()
        raise OSError("device is gone")

    def close(self) -> None:
        self._closed.set()


class TestQueue:
    def test_frame_comes_out(self) -> None:
        queue = DropOldestQueue()
        queue.put(make_frame(1))
        assert sequence_of(queue.get()) == 1

    def test_put_on_a_full_queue_drops_the_oldest(self) -> None:
        queue = DropOldestQueue(1)
        for sequence in (1, 2, 3):
            queue.put(make_frame(sequence))
        assert (queue.dropped, sequence_of(queue.get()), sequence_of(queue.get(0))) == (2, 3, None)

    def test_newest_comes_out_and_those_before_it_are_dropped(self) -> None:
        queue = DropOldestQueue(3)
        for sequence in (1, 2, 3):
            queue.put(make_frame(sequence))
        assert queue.dropped == 0
        assert (sequence_of(queue.get()), queue.dropped, queue.get(0)) == (3, 2, None)

    def test_get_gives_up_in_time(self) -> None:
        assert DropOldestQueue().get(0) is None

    def test_closed_queue_gives_what_it_has(self) -> None:
        queue = DropOldestQueue()
        queue.put(make_frame(1))
        queue.close()
        assert (sequence_of(queue.get()), queue.get()) == (1, None)

    def test_closing_ends_a_wait(self) -> None:
        queue = DropOldestQueue()
        got: list[object] = []
        waiting = threading.Thread(target=lambda: got.append(queue.get()))
        waiting.start()
        queue.close()
        waiting.join(10)
        assert got == [None]

    def test_frame_ends_a_wait(self) -> None:
        queue = DropOldestQueue()
        got: list[object] = []
        waiting = threading.Thread(target=lambda: got.append(sequence_of(queue.get())))
        waiting.start()
        queue.put(make_frame(1))
        waiting.join(10)
        assert got == [1]

    def test_first_failure_is_kept(self) -> None:
        queue = DropOldestQueue()
        queue.close("broken")
        queue.close()
        assert (queue.closed, queue.failure) == (True, "broken")

    def test_depth_is_at_least_1(self) -> None:
        with pytest.raises(ValueError, match="depth"):
            DropOldestQueue(0)


class AnyTraffic(RuleBasedStateMachine):
    """No frame is lost without being counted, and none comes out before an older one."""

    def __init__(self) -> None:
        super().__init__()
        self.queue = DropOldestQueue(2)
        self.put_count = self.got_count = 0
        self.last = -1
        self.waiting = 0

    @rule(count=st.integers(1, 4))
    def put(self, count: int) -> None:
        for _ in range(count):
            self.queue.put(make_frame(self.put_count))
            self.put_count += 1
        self.waiting = min(self.waiting + count, 2)

    @rule()
    def get(self) -> None:
        frame = self.queue.get(0)
        assert (frame is not None) == (self.waiting > 0)
        if frame is not None:
            assert frame.sequence == self.put_count - 1 > self.last
            self.last = frame.sequence
            self.got_count += 1
        self.waiting = 0
        assert self.got_count + self.queue.dropped == self.put_count


TestAnyTraffic = AnyTraffic.TestCase
TestAnyTraffic.settings = settings(stateful_step_count=20)


class Rig:
    """An ingest on a source."""

    def __init__(self, source: Film | FrozenCamera, depth: int = 10) -> None:
        logger, self.log = make_logger()
        self.queue = DropOldestQueue(depth)
        self.ingest = CameraIngest(source, self.queue, logger)


@pytest.fixture
def frozen() -> Iterator[tuple[Rig, EventHandler]]:
    """Yield an ingest, and its log, whose camera shows nothing."""
    camera = FrozenCamera()
    rig = Rig(camera)
    rig.ingest.start()
    assert camera.asked.wait(10)
    yield rig, rig.log
    camera.close()
    assert rig.ingest.join(10)


def test_frames_reach_the_queue_and_the_end_closes_it() -> None:
    rig = Rig(Film(3))
    rig.ingest.run()
    assert rig.ingest.counters == {"frames": 3, "failed": 0, "ended": 1}
    assert (sequence_of(rig.queue.get()), rig.queue.closed, rig.queue.failure) == (2, True, None)


def test_end_is_logged() -> None:
    rig = Rig(Film(1))
    rig.ingest.run()
    assert [record.levelno for record in rig.log.events("camera_ended")] == [logging.INFO]


def test_failure_is_counted_and_logged_and_closes_the_queue() -> None:
    rig = Rig(Film(2, OSError("no such device")))
    rig.ingest.run()
    assert rig.ingest.counters == {"frames": 2, "failed": 1, "ended": 0}
    (record,) = rig.log.events("camera_failed")
    assert (record.levelno, record.getMessage()) == (logging.ERROR, "camera failed: OSError: no such device")
    assert rig.queue.failure == "camera failed: OSError: no such device"


def test_thread_reads() -> None:
    rig = Rig(Film(3))
    rig.ingest.start()
    assert rig.ingest.join(10)
    assert rig.ingest.counters["frames"] == 3


def test_stop_closes_the_source_and_ends_a_read(frozen: tuple[Rig, EventHandler]) -> None:
    rig, _ = frozen
    rig.ingest.stop()
    assert rig.ingest.join(10)
    assert rig.queue.closed


def test_what_a_read_says_once_closed_is_no_failure(frozen: tuple[Rig, EventHandler]) -> None:
    rig, log = frozen
    rig.ingest.stop()
    rig.ingest.join(10)
    assert rig.ingest.counters == {"frames": 0, "failed": 0, "ended": 0}
    assert log.records == []


def test_thread_that_does_not_end_is_told(frozen: tuple[Rig, EventHandler]) -> None:
    rig, _ = frozen
    assert rig.ingest.join(0) is False


def test_end_once_stopped_is_no_end() -> None:
    class Closing(Film):
        def read(self) -> NavCameraFrame | None:
            rig.ingest.stop()
            return None

    rig = Rig(Closing(0))
    rig.ingest.run()
    assert rig.ingest.counters["ended"] == 0


def test_source_that_cannot_be_closed_is_logged() -> None:
    class Stubborn(Film):
        def close(self) -> None:
            raise OSError("busy")

    rig = Rig(Stubborn(0))
    rig.ingest.stop()
    (record,) = rig.log.events("camera_close_failed")
    assert record.getMessage() == "the camera could not be closed: OSError: busy"


def test_nothing_is_read_once_stopped() -> None:
    rig = Rig(Film(3))
    rig.ingest.stop()
    rig.ingest.run()
    assert rig.ingest.counters["frames"] == 0
