# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The composition root, with its threads: nothing hangs, nothing piles up."""

import logging
import threading
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.vio.strategy_rig import (
    INITIAL,
    Ticks,
    WaxStrategy,
    make_calibration,
    make_frame,
    make_logger,
    make_output,
    make_warm_start,
    still_window,
)
from viso.companion.vio import registry
from viso.companion.vio.config import QueueConfig, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.health import FrameFacts
from viso.companion.vio.imu import ImuBuffer
from viso.companion.vio.pipeline import StrategyContext
from viso.companion.vio.registry import StrategyEntry
from viso.companion.vio.result import Result
from viso.companion.vio.runtime import JOIN_S, VioRuntime
from viso.companion.vio.types import ImuWindow, NavCameraFrame, VioOutput, VioState

LIMIT_S = 10


class Still(ImuBuffer):
    """Inertial data of standing still."""

    def window(self, t0_ns: int, t1_ns: int, wait_s: float = 0.0) -> ImuWindow:
        return still_window(t0_ns, t1_ns)


class Camera:
    """A source of frames that knows how many of them there are at a time.

    Args:
        frames: how many it shows before it ends.
        before: called, with their number so far, before each of them and before the end.
    """

    def __init__(self, frames: int, before: Callable[[int], object] = lambda shown: None) -> None:
        self._frames, self._before = frames, before
        self._shown: list[weakref.ref[Any]] = []
        self.most_alive = 0
        self.closed = False

    def read(self) -> NavCameraFrame | None:
        self._before(len(self._shown))
        if len(self._shown) == self._frames:
            return None
        pixels = np.zeros((48, 64), np.uint8)
        self._shown.append(weakref.ref(pixels))
        self.most_alive = max(self.most_alive, sum(shown() is not None for shown in self._shown))
        return make_frame(len(self._shown), pixels=pixels)

    def close(self) -> None:
        self.closed = True


class Rig:
    """A runtime with a strategy of wax."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, camera: Camera, **config: Any) -> None:
        self.strategies: list[WaxStrategy] = []
        entry = StrategyEntry(self._load, "wax")
        monkeypatch.setitem(registry._STRATEGY_REGISTRY, "wax", entry)
        self.logger, self.log = make_logger()
        self.results: list[Result] = []
        self.config = VioConfig(strategy="wax", **config)
        self.runtime = VioRuntime(
            self.config,
            make_calibration(),
            camera,
            Still(),
            clock_ns=Ticks(),
            logger=self.logger,
            listeners=[self.results.append],
        )

    def _load(self, context: StrategyContext) -> WaxStrategy:
        self.strategies.append(WaxStrategy(context))
        return self.strategies[-1]


def test_runs_until_the_source_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, Camera(20))
    with rig.runtime as runtime:
        assert runtime.wait(LIMIT_S)
    assert len(rig.results) + rig.results[-1].dropped == 20
    assert rig.results[-1].sequence == 20
    assert rig.results[-1].state is VioState.TRACKING


@pytest.mark.parametrize("depth", [1, 3])
def test_at_most_depth_plus_two_frames_are_alive(monkeypatch: pytest.MonkeyPatch, depth: int) -> None:
    busy, go_on = threading.Semaphore(0), threading.Semaphore(0)

    def block(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        busy.release()
        go_on.acquire(timeout=LIMIT_S)
        return INITIAL, make_output(frame)

    def pace(shown: int) -> None:
        """Let ten frames come while the worker is at one."""
        if shown % 10 == 1:
            busy.acquire(timeout=LIMIT_S)
        elif shown % 10 == 0 and shown > 0:
            go_on.release(10 if shown == 50 else 1)

    camera = Camera(50, pace)
    rig = Rig(monkeypatch, camera, queue=QueueConfig(depth))
    rig.strategies[0].step = block
    with rig.runtime as runtime:
        assert runtime.wait(LIMIT_S)
    assert camera.most_alive == depth + 2


def test_stop_ends_both_threads_and_does_not_drain(monkeypatch: pytest.MonkeyPatch) -> None:
    busy, go_on = threading.Event(), threading.Event()

    def block(frame: NavCameraFrame) -> tuple[FrameFacts, VioOutput]:
        busy.set()
        go_on.wait(LIMIT_S)
        return INITIAL, make_output(frame)

    camera = Camera(50)
    rig = Rig(monkeypatch, camera)
    rig.strategies[0].step = block
    rig.runtime.start()
    assert busy.wait(LIMIT_S)
    assert rig.runtime.stop(join_s=0) is False
    go_on.set()
    assert rig.runtime.stop()
    assert camera.closed
    assert len(rig.results) == 1


def test_threads_that_hang_are_told_and_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()
    rig = Rig(monkeypatch, Camera(1, lambda shown: go_on.wait(LIMIT_S)))
    rig.runtime.start()
    assert rig.runtime.stop(join_s=0) is False
    texts = [record.getMessage() for record in rig.log.events("thread_hangs")]
    assert "the camera's thread does not end" in texts
    go_on.set()
    assert rig.runtime.stop(LIMIT_S)


def test_joins_take_at_most_two_seconds() -> None:
    assert 2 * JOIN_S <= 2.0


def test_stop_before_start(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Rig(monkeypatch, Camera(1)).runtime.stop()


def test_failing_camera_ends_in_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(shown: int) -> None:
        if shown == 1:
            raise OSError("gone")

    rig = Rig(monkeypatch, Camera(5, fail))
    with rig.runtime as runtime:
        assert runtime.wait(LIMIT_S)
    assert rig.results[-1].state is VioState.LOST


def test_warm_start_reaches_the_strategy(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, Camera(1))
    rig.runtime.pipeline.request_warm_start(make_warm_start())
    with rig.runtime as runtime:
        assert runtime.wait(LIMIT_S)
    assert len(rig.strategies[0].calls) == 1


def test_configuration_is_logged_once_with_its_digest(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig(monkeypatch, Camera(1), seed=5)
    (record,) = rig.log.events("configuration")
    assert record.levelno == logging.INFO
    assert rig.log.fields("configuration") == [{"config": rig.config.effective(), "digest": rig.config.digest()}]


def test_strategy_that_is_not_there_is_not_replaced() -> None:
    logger, _ = make_logger()
    with pytest.raises(StrategyNotAvailableError, match="has to name its program"):
        VioRuntime(
            VioConfig(strategy="okvis2"),
            make_calibration(),
            Camera(1),
            Still(),
            clock_ns=Ticks(),
            logger=logger,
        )
