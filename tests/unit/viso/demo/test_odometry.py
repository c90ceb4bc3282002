# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration with a real odometry: what happens when, how well it navigates, and that it can be stopped."""

import os
import signal
from dataclasses import dataclass
from functools import cache

import pytest

from ekf_stub.reports import AidingMode
from tests.unit.viso.companion.engine.compiled import inertial_engine
from viso.companion.strategies.engine import EngineStrategy
from viso.companion.vio.types import VioState
from viso.demo.figures import LoopFigures, figures_of
from viso.demo.odometry import ARM_S, COMPANION_S, COVERED_S, DISARM_S, END_S, RESTART_S, VioDemo, demo_setup
from viso.demo.record import AUTOPILOT, COMPANION, LoopText
from viso.logs.logger import MemoryLog
from viso.terminal.engine import with_engine

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Ran:
    """A run, its figures and how far it got when."""

    demo: VioDemo
    figures: LoopFigures
    progress: list[float]

    def said(self, who: str) -> list[LoopText]:
        """Return what one of the two has said."""
        return [said for said in self.demo.loop.record.all_texts if said.who == who]


@cache
def ran() -> Ran:
    progress: list[float] = []
    demo = VioDemo(1, MemoryLog)
    demo.run(progress.append)
    return Ran(demo, figures_of(demo.loop), progress)


def test_autopilot_says_what_is_expected_in_order() -> None:
    told = [said.text for said in ran().said(AUTOPILOT)]
    assert [text for text in told if "yaw" not in text and "initial " not in text and "IMU1" not in text] == [
        "ArduPilot Ready",
        "AHRS: DCM active",
        "EKF3 IMU0 initialised",
        "AHRS: EKF3 active",
        "EKF3 IMU0 tilt alignment complete",
        "PreArm: VisOdom: not healthy",
        "EKF3 IMU0 is using external nav data",
        "EKF3 IMU0 origin set",
        "Field Elevation Set: 584m",
        "Arming motors",
        "Disarming motors",
    ]


def test_odometry_is_degraded_lost_and_begun_anew_when_the_lens_is_covered() -> None:
    (short_s, _), (long_s, _) = COVERED_S
    changes = [(said.time_us * 1e-6, said.text.split(":")[0]) for said in ran().said(COMPANION) if "->" in said.text]
    in_air = [change for change in changes if short_s < change[0] < 40.0]
    assert [text for _, text in in_air] == [
        *("TRACKING -> DEGRADED", "DEGRADED -> TRACKING"),
        *("TRACKING -> DEGRADED", "DEGRADED -> LOST", "LOST -> INIT", "INIT -> TRACKING"),
    ]
    times_s = [time_s for time_s, _ in in_air]
    assert times_s[0] == pytest.approx(short_s + 0.2, abs=0.2)
    assert times_s[3] == pytest.approx(long_s + 2.6, abs=0.3)
    assert times_s[4] == pytest.approx(RESTART_S + 0.2, abs=0.2)


def test_odometry_is_good() -> None:
    odometry, path_m = ran().figures.odometry, ran().figures.path_m
    assert path_m > 140
    assert odometry is not None
    assert odometry.horizontal_max_m < 0.012 * path_m
    assert odometry.tilt_rms_deg < 1.0
    assert odometry.within_2_sigma > 0.9


def test_autopilot_navigates_by_it() -> None:
    estimate = ran().figures.estimate
    assert estimate is not None
    assert estimate.horizontal_max_m < 0.012 * ran().figures.path_m
    assert estimate.height_max_m < 1.0


def test_autopilot_navigates_from_the_first_pose_to_the_end() -> None:
    aiding = ran().figures.aiding
    assert set(aiding) == {"none", "absolute"}
    assert aiding["none"] == pytest.approx(COMPANION_S + 0.75, abs=0.1)


def test_every_state_is_shown() -> None:
    assert set(ran().figures.states) == {state.value for state in VioState}


def test_reset_is_counted_once() -> None:
    assert ran().figures.reset_counter == 1


def test_vehicle_is_armed_for_the_flight() -> None:
    armed_s = [estimate.time_us * 1e-6 for estimate in ran().demo.loop.record.estimates if estimate.is_armed]
    assert [armed_s[0], armed_s[-1]] == pytest.approx([ARM_S, DISARM_S], abs=0.06)


def test_progress_goes_to_the_end() -> None:
    assert ran().progress == [float(second) for second in range(int(END_S) + 1)]


def test_log_is_closed_at_the_end() -> None:
    assert not ran().demo.loop.vehicle.logger.is_open


def test_run_can_be_stopped() -> None:
    demo = VioDemo(1, MemoryLog)
    seconds: list[float] = []
    demo.run(seconds.append, lambda: len(seconds) == 4)
    assert seconds == [0.0, 1.0, 2.0, 3.0]
    assert demo.loop.now_us == pytest.approx(3_000_000, abs=2500)
    assert not demo.loop.vehicle.logger.is_open


def test_log_is_closed_when_something_goes_wrong() -> None:
    demo = VioDemo(1, MemoryLog)

    def fail(_time_s: float) -> None:
        raise RuntimeError

    with pytest.raises(RuntimeError):
        demo.run(fail)
    assert not demo.loop.vehicle.logger.is_open


def test_autopilot_goes_on_while_an_engine_is_started_anew() -> None:
    demo = VioDemo(1, MemoryLog, choose=lambda config: with_engine(config, None, inertial_engine()))
    loop, strategy = demo.loop, demo.loop.companion.pipeline.strategy
    assert isinstance(strategy, EngineStrategy)
    loop.run_until(12_000_000)
    assert strategy.session is not None
    os.kill(strategy.session.pid, signal.SIGKILL)
    loop.run_until(15_000_000)
    loop.close()
    (begun,) = (span for span in loop.watch.aiding() if span.mode is AidingMode.ABSOLUTE)
    assert begun.end_us >= 15_000_000
    assert strategy.health.state in (VioState.TRACKING, VioState.DEGRADED)
    assert strategy.counters()["restarts"] == 1


def test_seed_is_that_of_both_ends() -> None:
    assert (demo_setup(7).seed, demo_setup(7).flight.seed) == (7, 7)
