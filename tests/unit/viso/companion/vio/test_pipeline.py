# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked, told and counted for each frame, and that nothing stops it."""

import logging
from collections.abc import Callable
from typing import Any, NoReturn

import pytest

from tests.unit.viso.companion.vio.strategy_rig import (
    FEW,
    GOOD,
    INITIAL,
    LOST,
    PERIOD_NS,
    WaxRig,
    make_frame,
    make_output,
    make_warm_start,
    output_of,
    still_window,
)
from viso.companion.vio import runtime
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import VioPipeline
from viso.companion.vio.result import Degraded, Initializing, Result, Tracking
from viso.companion.vio.runtime import DropOldestQueue, VioWorker
from viso.companion.vio.types import ImuWindow, NavCameraFrame, VioState


class Imu(ImuBuffer):
    """Stands still, and remembers which windows it was asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[int, int]] = []

    def window(self, t0_ns: int, t1_ns: int, wait_s: float = 0.0) -> ImuWindow:
        self.asked.append((t0_ns, t1_ns))
        return still_window(t0_ns, t1_ns)


class Rig(WaxRig):
    """A worker around a strategy of wax."""

    def __init__(self, *listeners: Callable[[Result], None], time_offset_s: float = 0.0, **config: Any) -> None:
        super().__init__({"time_offset_s": time_offset_s}, **config)
        self.imu = Imu()
        self.queue = DropOldestQueue(3)
        self.results: list[Result] = []
        self.pipeline = VioPipeline(self.strategy, self.imu, [*listeners, self.results.append])
        self.worker = VioWorker(self.pipeline, self.queue, self.logger)

    def run(self, *sequences: int) -> Result | None:
        """Process the frames of some numbers; return the last one's result."""
        result = None
        for sequence in sequences:
            result = self.pipeline.process(make_frame(sequence))
        return result

    def states(self) -> list[VioState]:
        return [result.state for result in self.results]


def fail(*_: object) -> NoReturn:
    raise RuntimeError("broken")


def halted() -> Rig:
    rig = Rig(lost_frames_fatal=1)
    rig.run(0)
    rig.strategy.finds(LOST)
    rig.run(1)
    rig.strategy.finds(INITIAL)
    return rig


def test_result_has_frame_output_and_state() -> None:
    rig = Rig()
    rig.run(4)
    (result,) = rig.results
    frame = make_frame(4)
    assert (result.frame_id, result.sequence, result.t_ns) == (frame.frame_id, 4, frame.capture_timestamp)
    assert output_of(result).frame_id == frame.frame_id
    assert isinstance(result, Tracking)


def test_window_reaches_from_the_last_processed_frame() -> None:
    rig = Rig()
    rig.run(1, 2, 5)
    assert rig.imu.asked == [(t * PERIOD_NS, u * PERIOD_NS) for t, u in ((1, 1), (1, 2), (2, 5))]


def test_stamps_are_brought_to_the_imus_time() -> None:
    rig = Rig(time_offset_s=-0.002)
    rig.run(1, 2)
    assert rig.imu.asked[1] == (PERIOD_NS - 2_000_000, 2 * PERIOD_NS - 2_000_000)
    assert rig.results[1].t_ns == 2 * PERIOD_NS - 2_000_000


def test_degraded_output_is_handed_on() -> None:
    rig = Rig()
    rig.run(1)
    rig.strategy.finds(FEW)
    assert isinstance(rig.run(2), Degraded)


def test_initializing_has_no_output() -> None:
    rig = Rig()
    rig.strategy.step = lambda frame: (GOOD, None)
    assert isinstance(rig.run(1), Initializing)


def test_result_has_the_stages_and_their_total() -> None:
    def slow(frame: NavCameraFrame) -> Any:
        rig.clock.now_ns += 4_000_000
        return INITIAL, make_output(frame)

    rig = Rig()
    rig.strategy.step = slow
    rig.run(1)
    (result,) = rig.results
    assert result.stage_ms == {"step": pytest.approx(4.0), "total": pytest.approx(4.0)}


def test_drops_are_told() -> None:
    rig = Rig()
    for sequence in range(5):
        rig.queue.put(make_frame(sequence))
    assert rig.worker._take_one()
    assert rig.results[0].dropped == 4


def test_listener_that_raises_is_logged_and_keeps_nobody_from_listening() -> None:
    rig = Rig(fail)
    rig.run(1, 2)
    assert len(rig.results) == 2
    assert rig.states() == [VioState.TRACKING] * 2
    assert [record.levelno for record in rig.log.events("listener_failed")] == [logging.ERROR] * 2


@pytest.mark.parametrize("sequence", [3, 4])
def test_frame_that_is_not_later_is_not_processed(sequence: int) -> None:
    rig = Rig()
    rig.run(4)
    assert rig.run(sequence) is None
    assert (rig.states(), len(rig.imu.asked)) == ([VioState.TRACKING], 1)
    rig.run(5)
    assert rig.imu.asked[-1] == (4 * PERIOD_NS, 5 * PERIOD_NS)


def test_stamps_that_stay_behind_are_lost() -> None:
    rig = Rig(lost_frames_fatal=3)
    rig.run(100, 1, 2)
    assert rig.states() == [VioState.TRACKING]
    rig.run(3, 4)
    assert rig.states() == [VioState.TRACKING, VioState.LOST]
    assert rig.results[1].output is None


def test_stamps_that_fall_behind_now_and_then_are_not_lost() -> None:
    rig = Rig(lost_frames_fatal=2)
    rig.run(10, 9, 11, 10, 12)
    assert rig.states() == [VioState.TRACKING] * 3


def test_warm_start_takes_the_stamps_as_they_now_are() -> None:
    rig = Rig(lost_frames_fatal=3)
    rig.run(100, 1, 2, 3)
    rig.pipeline.request_warm_start(make_warm_start())
    assert isinstance(rig.run(4), Tracking)


class TestFatal:
    """What comes after a frame in LOST."""

    def test_it_is_told_once(self) -> None:
        rig = halted()
        rig.run(2, 3)
        assert rig.states() == [VioState.TRACKING, VioState.LOST]
        assert rig.results[1].output is None
        assert len(rig.log.events("vio_lost")) == 1

    def test_frames_are_not_processed(self) -> None:
        rig = halted()
        assert rig.run(2, 3) is None
        assert (len(rig.results), len(rig.imu.asked)) == (2, 2)

    def test_warm_start_goes_on_from_the_next_frame(self) -> None:
        rig = halted()
        rig.pipeline.request_warm_start(make_warm_start())
        rig.run(7)
        assert rig.imu.asked[-1] == (7 * PERIOD_NS, 7 * PERIOD_NS)
        assert rig.states()[-1] is VioState.TRACKING
        assert len(rig.strategy.calls) == 1

    def test_last_warm_start_asked_for_counts(self) -> None:
        rig = halted()
        poses = [make_warm_start(), make_warm_start()]
        for pose in poses:
            rig.pipeline.request_warm_start(pose)
        rig.run(7, 8)
        assert len(rig.strategy.calls) == 1

    def test_warm_start_that_is_refused_changes_nothing(self) -> None:
        rig = halted()
        pose = make_warm_start()
        object.__setattr__(pose, "velocity_b", None)
        rig.pipeline.request_warm_start(pose)
        assert rig.run(7) is None
        assert (rig.strategy.calls, rig.states()[-1]) == ([], VioState.LOST)
        assert len(rig.log.events("warm_start_refused")) == 1

    def test_auto_reinit_is_left_to_the_strategy(self) -> None:
        rig = Rig(lost_frames_fatal=1, auto_reinit_s=1.0)
        rig.run(0)
        rig.strategy.finds(LOST)
        rig.run(1)
        rig.strategy.finds(INITIAL)
        rig.run(10, 11)
        assert rig.states() == [VioState.TRACKING, VioState.LOST, VioState.LOST, VioState.TRACKING]

    def test_another_camera_is_lost(self) -> None:
        rig = Rig()
        rig.run(0)
        rig.pipeline.process(make_frame(1, camera_id="other"))
        assert rig.states() == [VioState.TRACKING, VioState.LOST]
        assert rig.run(2) is None


class TestThread:
    """What the thread does; run in the test's own."""

    def test_frames_are_taken_until_the_source_ends(self) -> None:
        rig = Rig()
        rig.queue.put(make_frame(1))
        rig.queue.close()
        rig.worker.run()
        assert rig.states() == [VioState.TRACKING]

    def test_thread_runs_and_ends(self) -> None:
        rig = Rig()
        rig.queue.put(make_frame(1))
        rig.queue.close()
        rig.worker.start()
        assert rig.worker.join(10)
        assert rig.states() == [VioState.TRACKING]

    def test_camera_that_fails_before_any_frame_is_lost(self) -> None:
        rig = Rig()
        rig.queue.close("camera failed: gone")
        rig.worker.run()
        assert len(rig.log.events("vio_lost")) == 1
        assert rig.results == []

    def test_failed_camera_is_lost(self) -> None:
        rig = Rig()
        rig.queue.put(make_frame(1))
        rig.queue.close("camera failed: gone")
        rig.worker.run()
        assert rig.states() == [VioState.TRACKING, VioState.LOST]
        assert rig.results[-1].reason == "camera failed: gone"
        (record,) = rig.log.events("vio_lost")
        assert record.getMessage() == "VIO LOST: camera failed: gone; strategy=wax"

    def test_camera_that_shows_nothing_is_lost_until_it_does(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(runtime, "STALL_S", 0.0)
        rig = Rig()
        rig.run(1)
        for _ in range(3):
            assert rig.worker._take_one()
        assert rig.states() == [VioState.TRACKING, VioState.LOST]
        assert rig.results[-1].reason == "no frame for 0 s"
        rig.run(2)
        assert rig.states()[-1] is VioState.TRACKING

    def test_stop_does_not_drain_the_queue(self) -> None:
        rig = Rig()
        rig.queue.put(make_frame(1))
        rig.worker.stop()
        rig.worker.run()
        assert rig.results == []

    def test_stop_ends_a_wait(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(runtime, "STALL_S", 1000.0)
        rig = Rig()
        rig.worker.start()
        rig.worker.stop()
        assert rig.worker.join(10)

    def test_whatever_else_fails_is_logged_and_lost(self, monkeypatch: pytest.MonkeyPatch) -> None:
        rig = Rig()
        rig.run(1)
        monkeypatch.setattr(rig.imu, "window", fail)
        rig.queue.put(make_frame(2))
        rig.queue.close()
        rig.worker.run()
        assert len(rig.log.events("worker_failed")) == 1
        assert rig.states() == [VioState.TRACKING, VioState.LOST]
        assert rig.results[-1].reason == "RuntimeError: broken"
