# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A strategy whose engine is a program: what becomes of it when the program ends, hangs or lies."""

import contextlib
import logging
import os
import shlex
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.unit.viso.companion.engine.compiled import descriptors, has_ended, inertial_engine
from tests.unit.viso.companion.vio.strategy_rig import (
    GRAVITY,
    IMU_PERIOD_NS,
    PERIOD_NS,
    Ticks,
    make_calibration,
    make_frame,
    make_logger,
)
from viso.companion.engine.child import MOST_LINES, EngineChild
from viso.companion.engine.protocol import FROM_ENGINE, Decoder, Estimate, frame_of
from viso.companion.strategies.engine import BACKOFF_S, LONGEST_COAST_S, MOST_FAILURES, EngineStrategy
from viso.companion.vio.config import EngineConfig, VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError, VioFatalError
from viso.companion.vio.registry import build_vio_strategy
from viso.companion.vio.result import Initializing, Lost, Result
from viso.companion.vio.types import ImuBias, ImuSample, ImuWindow, VioOutput, VioState, WarmStartPose
from viso.geometry.pose import SE3

WIDTH, HEIGHT = 64, 48
NOISE = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)
LEAN = GRAVITY + np.array([0.4, 0.0, 0.0])  # it gains 0.4 m/s a second, ahead


class Flight:
    """A strategy that an engine carries ahead, faster and faster: a frame each tenth of a second."""

    def __init__(self, command: str, **engine: Any) -> None:
        logger, self.log = make_logger()
        self.clock = Ticks()
        self.calibration = make_calibration(WIDTH, HEIGHT)
        fields: dict[str, Any] = {"command": command, "start_timeout_s": 60.0, "frame_timeout_s": 60.0}
        self.config = VioConfig(strategy="engine", engine=EngineConfig(**(fields | engine)))
        strategy = build_vio_strategy(self.config, self.calibration, self.clock, logger)
        assert isinstance(strategy, EngineStrategy)
        self.strategy, self.next = strategy, 10
        self.result: Result  # of the last frame

    def start(self) -> None:
        start = SE3(np.eye(3), np.array([1.0, 2.0, 3.0]))
        self.strategy.reset(WarmStartPose(start.inverse(), np.array([1.0, 0, 0]), ImuBias.zero()))

    def process(self) -> Result:
        frame = make_frame(self.next, pixels=NOISE)
        t1_ns = frame.capture_timestamp
        t0_ns = t1_ns - PERIOD_NS
        times = range(t0_ns, t1_ns + IMU_PERIOD_NS, IMU_PERIOD_NS)
        window = ImuWindow(t0_ns, t1_ns, tuple(ImuSample(t_ns, LEAN, np.zeros(3)) for t_ns in times))
        self.next += 1
        self.result = self.strategy.process(frame, window)
        return self.result

    def see(self, frames: int = 1) -> VioOutput | None:
        """Process frames; return the last one's output, or None."""
        for _ in range(frames):
            self.process()
        return self.result.output

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)

    @property
    def pid(self) -> int:
        assert self.strategy.session is not None
        return self.strategy.session.pid

    @property
    def counters(self) -> dict[str, int]:
        return {name: count for name, count in self.strategy.counters().items() if count}

    @property
    def state(self) -> VioState:
        return self.strategy.health.state


Fly = Callable[..., Flight]


@pytest.fixture
def fly() -> Iterator[Fly]:
    """Yield what makes a flight, and end them all."""
    with contextlib.ExitStack() as stack:

        def make(command: str | None = None, **engine: Any) -> Flight:
            flight = Flight(inertial_engine() if command is None else command, **engine)
            stack.callback(flight.strategy.close)
            return flight

        yield make


def once(folder: Path, then: str) -> str:
    """Return the command of an engine that is sound in its first run, and does something else in all others."""
    mark = shlex.quote(str(folder / "mark"))
    script = f"if [ -e {mark} ]; then {then}; fi; : >{mark}; exec {shlex.quote(inertial_engine())}"
    return f"sh -c {shlex.quote(script)}"


def test_killed_engine_goes_on_where_the_imu_has_come_to(fly: Fly) -> None:
    killed, other = fly(), fly()
    for flight in (killed, other):
        flight.start()
        assert flight.see(4) is not None
    killed.kill()
    states = []
    for _ in range(4):
        output, expected = killed.see(), other.see()
        states.append(killed.state)
    assert states == [VioState.INIT, VioState.INIT, VioState.TRACKING, VioState.TRACKING]
    assert output is not None
    assert expected is not None
    assert output.world_T_body.t == pytest.approx(expected.world_T_body.t, abs=1e-3)
    assert output.velocity_b == pytest.approx(expected.velocity_b, abs=1e-3)
    assert killed.counters == {"exits": 1, "restarts": 1}
    assert killed.result.resets == 1


def test_restarts_leave_nothing(fly: Fly) -> None:
    flight = fly()
    flight.start()
    flight.see(3)
    before, pids = descriptors(), list[int]()
    for _ in range(8):
        pids.append(flight.pid)
        flight.kill()
        flight.see(4)
    assert flight.counters == {"exits": 8, "restarts": 8}
    assert descriptors() == before
    assert all(has_ended(pid) for pid in pids)


def test_lines_that_are_not_logged_are_counted(fly: Fly) -> None:
    flight = fly(f"sh -c {shlex.quote(f'seq {MOST_LINES + 7} >&2; exec {inertial_engine()}')}")
    assert flight.counters == {"lines_dropped": 7}
    flight.strategy.close()
    assert flight.counters == {"lines_dropped": 7}
    assert len(flight.log.events("engine_stderr")) == MOST_LINES


def test_failure_is_logged_with_its_counters(fly: Fly) -> None:
    flight = fly()
    flight.start()
    flight.see(3)
    flight.kill()
    result = flight.process()
    assert isinstance(result, Initializing)
    assert (result.reason, result.is_warm) == ("engine: ended by signal 9 (Killed)", True)
    (record,) = flight.log.events("engine_failed")
    assert (record.levelno, record.getMessage()) == (logging.WARNING, "ended by signal 9 (Killed)")
    (fields,) = flight.log.fields("engine_failed")
    assert (fields["kind"], fields["in_a_row"], fields["counters"]["exits"]) == ("exits", 1, 1)


def test_hanging_engine_is_started_anew(fly: Fly) -> None:
    flight = fly(frame_timeout_s=0.05)
    flight.start()
    flight.see(3)
    os.kill(flight.pid, signal.SIGSTOP)
    assert flight.see() is None
    assert flight.counters["hangs"] == 1
    assert flight.state is VioState.INIT


def test_starts_become_rarer_and_end_in_lost(fly: Fly, tmp_path: Path) -> None:
    flight = fly(once(tmp_path, "exit 5"))
    flight.start()
    flight.see(3)
    flight.kill()
    restarts = []
    while flight.state is not VioState.LOST:
        flight.see()
        restarts.append(flight.counters.get("restarts", 0))
    assert flight.result.reason == "engine failed 6 times in a row: ended with exit code 5"
    assert flight.counters == {"exits": MOST_FAILURES + 1, "restarts": MOST_FAILURES}
    starts = [number for number in range(1, len(restarts)) if restarts[number] > restarts[number - 1]]
    gaps_s = np.diff([0, *starts]) * PERIOD_NS * 1e-9
    assert gaps_s.tolist() == pytest.approx([max(wait_s, PERIOD_NS * 1e-9) for wait_s in BACKOFF_S])
    assert len(restarts) == starts[-1] + 1


def test_lost_engine_is_started_by_a_warm_start(fly: Fly, tmp_path: Path) -> None:
    flight = fly(once(tmp_path, f"if [ -e {tmp_path}/good ]; then exec {inertial_engine()}; fi; exit 5"))
    flight.kill()
    flight.see(200)
    assert isinstance(flight.result, Lost)
    with pytest.raises(VioFatalError, match=r"^engine: ended with exit code 5$"):
        flight.start()
    (tmp_path / "good").touch()
    flight.start()
    assert flight.see(3) is not None
    assert flight.state is VioState.TRACKING


def test_old_state_is_not_gone_on_from(fly: Fly, tmp_path: Path) -> None:
    flight = fly(once(tmp_path, f"if [ -e {tmp_path}/good ]; then exec {inertial_engine()}; fi; exit 5"))
    flight.start()
    flight.see(3)
    flight.kill()
    flight.see(round((LONGEST_COAST_S + 0.3) * 1e9 / PERIOD_NS))
    (tmp_path / "good").touch()
    output = next(output for _ in range(100) if (output := flight.see()) is not None)
    assert np.abs(output.world_T_body.t).max() < 0.5
    assert flight.result.reason == "static initialisation"


def test_answers_that_take_longer_than_the_images_are_counted(fly: Fly, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = fly()
    exchange = EngineChild.exchange

    def slow(self: EngineChild, *args: Any) -> Any:
        flight.clock.now_ns += 3 * PERIOD_NS // 2
        return exchange(self, *args)

    flight.see(2)
    monkeypatch.setattr(EngineChild, "exchange", slow)
    flight.see(2)
    assert flight.counters == {"late_answers": 2}


def test_engine_that_refuses_its_options_is_not_available() -> None:
    config = VioConfig(strategy="engine", engine=EngineConfig(command=inertial_engine()), native={"loops": 1})
    with pytest.raises(StrategyNotAvailableError, match=r": vio\.native\.loops: unknown$"):
        build_vio_strategy(config, make_calibration(WIDTH, HEIGHT), Ticks(), make_logger()[0])


def test_engine_without_a_program_is_not_available() -> None:
    with pytest.raises(StrategyNotAvailableError, match="has to name its program"):
        build_vio_strategy(VioConfig(strategy="engine"), make_calibration(), Ticks(), make_logger()[0])


def test_slow_imu_is_told() -> None:
    logger, log = make_logger()
    config = VioConfig(strategy="engine", engine=EngineConfig(command=inertial_engine()))
    with contextlib.closing(
        build_vio_strategy(config, make_calibration(WIDTH, HEIGHT, imu_rate_hz=20.0), Ticks(), logger)
    ):
        (record,) = log.events("engine_log")
    assert record.getMessage() == "wants an IMU of 50 Hz or more"


def spoilt(data: bytes, rng: np.random.Generator) -> Estimate:
    """Return an estimate with some bytes changed beyond its identifier."""
    frame = bytearray(data)
    for at in rng.integers(28, len(frame), rng.integers(1, 4)):
        frame[at] = rng.integers(256)
    (estimate,) = Decoder(FROM_ENGINE).feed(bytes(frame))
    assert isinstance(estimate, Estimate)
    return estimate


@pytest.mark.parametrize("frames", [100, pytest.param(2_000, marks=pytest.mark.slow)])
def test_whatever_an_engine_says_ends_in_a_state(fly: Fly, monkeypatch: pytest.MonkeyPatch, frames: int) -> None:
    flight = fly()
    flight.start()
    flight.see(3)
    exchange, rng = EngineChild.exchange, np.random.default_rng(1)

    def lie(self: EngineChild, *args: Any) -> Any:
        before, answer = exchange(self, *args)
        return before, spoilt(frame_of(answer), rng) if isinstance(answer, Estimate) else answer

    monkeypatch.setattr(EngineChild, "exchange", lie)
    states = set[VioState]()
    for _ in range(frames):
        result = flight.process()
        if result.output is not None:
            assert np.abs(result.output.world_T_body.matrix()).max() < 1e7
        if isinstance(result, Lost):
            flight.start()
        states.add(flight.state)
    assert {VioState.INIT, VioState.TRACKING} <= states
