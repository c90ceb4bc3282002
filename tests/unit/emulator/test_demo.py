# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration: what is said when, what becomes of the samples, and that it can be repeated."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ap_core.verdict import Outcome
from emulator.demo import COMPANION_START_S, END_S, FAULTS, FLIGHT, Demo, DemoResult
from emulator.demo_plot import save_plot
from emulator.log_sink import MemoryLog


@dataclass(frozen=True)
class Ran:
    """A run, its log and how far it got when."""

    demo: Demo
    result: DemoResult
    log: bytes
    progress: list[float]


def run(seed: int) -> Ran:
    log, progress = MemoryLog(), list[float]()
    demo = Demo(seed, lambda: log)
    return Ran(demo, demo.run(progress.append), bytes(log.data), progress)


@pytest.fixture(scope="module")
def ran() -> Callable[[int], Ran]:
    """Return a function that runs the demonstration with a seed, once."""
    return cache(run)


def test_same_seed_gives_the_same_log(ran: Callable[[int], Ran]) -> None:
    assert run(1).log == ran(1).log


def test_another_seed_gives_another_log(ran: Callable[[int], Ran]) -> None:
    assert ran(2).log != ran(1).log


def test_autopilot_says_what_is_expected_in_order(ran: Callable[[int], Ran]) -> None:
    texts = [text for _, _, text in ran(1).result.texts]
    assert [text for text in texts if "yaw" not in text and "initial " not in text] == [
        "ArduPilot Ready",
        "AHRS: DCM active",
        "EKF3 IMU0 initialised",
        "EKF3 IMU1 initialised",
        "AHRS: EKF3 active",
        "EKF3 IMU0 tilt alignment complete",
        "EKF3 IMU1 tilt alignment complete",
        "PreArm: VisOdom: not healthy",
        "EKF3 IMU0 is using external nav data",
        "EKF3 IMU1 is using external nav data",
        "EKF3 IMU0 origin set",
        "EKF3 IMU1 origin set",
        "Field Elevation Set: 584m",
        "Arming motors",
        "Disarming motors",
    ]


def test_yaw_differs_until_it_is_aligned(ran: Callable[[int], Ran]) -> None:
    said = [(time_s, text) for time_s, _, text in ran(1).result.texts if "VisOdom: yaw" in text]
    assert [text.split(":")[0] for _, text in said] == ["PreArm", "VisOdom"]
    assert said[0][1].startswith("PreArm: VisOdom: yaw diff 7")
    assert said[1][1].startswith("VisOdom: yaw shifted 74 to ")
    assert said[1][0] == pytest.approx(22.47, abs=0.05)


@pytest.mark.parametrize(("code", "least", "most"), [("quality_below_min", 89, 91), ("reset_settling", 29, 32)])
def test_samples_are_withheld(ran: Callable[[int], Ran], code: str, least: int, most: int) -> None:
    counts = ran(1).demo.vehicle.endpoint.verdict_counts()
    assert least <= counts["ODOMETRY", Outcome.IGNORED, code] <= most


def test_samples_are_accepted_at_30_hz_but_for_the_faults(ran: Callable[[int], Ran]) -> None:
    counts = ran(1).demo.vehicle.endpoint.verdict_counts()
    flown = (END_S - COMPANION_START_S) * 30 - 60 - 90 - 30
    assert counts["ODOMETRY", Outcome.ACCEPTED, "consumed"] == pytest.approx(flown, abs=5)


def test_nothing_is_dropped(ran: Callable[[int], Ran]) -> None:
    assert all(outcome is not Outcome.DROPPED for _, outcome, _ in ran(1).demo.vehicle.endpoint.verdict_counts())


def test_withheld_samples_are_those_of_the_faults(ran: Callable[[int], Ran]) -> None:
    assert FAULTS.low_quality is not None
    assert FAULTS.reset_s is not None
    low, reset_s, slack_s = FAULTS.low_quality, FAULTS.reset_s, 0.005
    withheld_s = [pose.time_s - 0.04 for pose in ran(1).result.poses if pose.ignored]
    assert all(
        low.start_s - slack_s < time_s < low.end_s + slack_s or -slack_s < time_s - reset_s < 1.04
        for time_s in withheld_s
    )


def test_aligned_positions_follow_the_flight(ran: Callable[[int], Ran]) -> None:
    poses = [pose for pose in ran(1).result.poses if 30 < pose.time_s < FAULTS.reset_s]  # type: ignore[operator]
    errors = [np.array(pose.pos_ned) - FLIGHT.position_ned(pose.time_s - 0.04) for pose in poses]
    assert np.linalg.norm(errors, axis=1).max() < 0.5


def test_raw_positions_are_those_of_every_odometry_message(ran: Callable[[int], Ran]) -> None:
    result = ran(1).result
    assert len(result.raw) == len(result.poses)


def test_progress_goes_to_the_end(ran: Callable[[int], Ran]) -> None:
    assert ran(1).progress == [float(second) for second in range(int(END_S) + 1)]


def test_log_is_closed_at_the_end(ran: Callable[[int], Ran]) -> None:
    assert not ran(1).demo.vehicle.logger.is_open


def test_log_is_closed_when_the_run_is_interrupted() -> None:
    demo = Demo(1, MemoryLog)

    def interrupt(time_s: float) -> None:
        if time_s >= 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        demo.run(interrupt)
    assert not demo.vehicle.logger.is_open


def test_companion_hears_the_autopilot(ran: Callable[[int], Ran]) -> None:
    kinds = {type(message).__name__ for message in ran(1).demo.companion.received}
    assert {"HEARTBEAT", "STATUSTEXT", "COMMAND_ACK"} <= kinds


def test_plot_is_a_picture(ran: Callable[[int], Ran], tmp_path: Path) -> None:
    save_plot(ran(1).result, tmp_path / "demo.png")
    assert (tmp_path / "demo.png").read_bytes().startswith(b"\x89PNG")
