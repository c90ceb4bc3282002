# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Yaw that steps: behaviours 9 and 20 to 22."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from tests.parity.behaviours.logs import Log, Recordings
from tests.parity.behaviours.parked import Parked
from tests.parity.behaviours.status import (
    AIDED_SS,
    AIDED_TS,
    EV_YAW_RESET,
    FUSED_AFTER_S,
    LOG_S,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked, MakeScripted

pytestmark = pytest.mark.slow

YAW_GATE = 3.0
STEP_RAD = math.pi / 2
CLIMB = """
start = "armed"
delay_s = 1
[[leg]]
shape = "point"
to_ned_m = [0, 0, -3]
duration_s = 4
"""
ARM, FORCED, ACCEPTED = 400, 21196, 0


def slews(log: Log, step_s: float, until_s: float) -> bool:
    """Return whether yaw turns little by little, always to the same side."""
    turns = [b - a for a, b in pairwise(log.values("XKF1", "Yaw", step_s + FUSED_AFTER_S, until_s))]
    return all(0.0 < turn < 5.0 for turn in turns)


def test_09_reset_counter_does_not_reset_yaw(make_parked: "MakeParked") -> None:
    parked = make_parked()
    parked.run_to(6.0)
    parked.stream(9.0, parked.pose, parked.velocity)
    parked.stream(10.5, lambda: parked.pose(4.0, yaw_deg=90.0, counter=1), parked.velocity)
    log = parked.log()
    assert log.value("XKF1", "PN", 9.0 + FUSED_AFTER_S) == pytest.approx(4.0, abs=0.01)
    assert log.value("XKF1", "Yaw", 9.0 + FUSED_AFTER_S) < 5.0
    assert log.value("XKF3", "IYAW", 9.0 + FUSED_AFTER_S) == pytest.approx(-90.0, abs=2.0)
    assert slews(log, 9.0, 10.5)
    assert [event.t < 9.0 for event in log.rows("EV") if event.Id == EV_YAW_RESET] == [True]
    assert log.said(9.0) == []


def test_20_yaw_step_on_the_ground_slews_the_yaw(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_steps")
    step_s = recording.input("REPH", lambda sample: sample.Q4 > 0.5)
    first_s = recording.when(lambda log: log.first("XKF4", lambda row: row.SM > 1.0, step_s))
    assert first_s - step_s < FUSED_AFTER_S + LOG_S
    turned_s = recording.when(lambda log: log.first("XKF1", lambda row: row.Yaw > 60.0, step_s))
    for log in recording.both:
        assert log.value("XKF3", "IYAW", first_s) == pytest.approx(-90.0, abs=0.2)
        assert log.value("XKF4", "SM", first_s) == pytest.approx(2.6, abs=0.05)
        assert log.value("XKF1", "Yaw", first_s) < 1.0
        assert slews(log, step_s, turned_s)
        assert log.value("XKF1", "Yaw", step_s + 2.0) - log.value("XKF1", "Yaw", step_s + 1.0) == pytest.approx(
            8.0, abs=1.0
        )
        assert log.said(step_s) == []


def test_21_yaw_step_in_flight_is_rejected_for_ever(make_scripted: "MakeScripted") -> None:
    flight = make_scripted(CLIMB, DISARM_DELAY=0)
    flight.run_to(6.0)
    flight.stream_truth(8.0)
    assert flight.command(ARM, 1, FORCED) == ACCEPTED
    flight.stream_truth(14.0)
    flight.stream_truth(26.0, yaw_deg=90.0)
    log = flight.log()
    assert log.value("XKF1", "PD", 13.5) == pytest.approx(-3.0, abs=0.05)
    after = log.between("XKF4", 14.0 + FUSED_AFTER_S)
    assert after[-1].t - after[0].t > 11.5
    assert min(row.SM for row in after) > 2.0
    assert {(row.TS, row.SS) for row in after} == {(AIDED_TS, AIDED_SS)}
    innovations = log.values("XKF3", "IYAW", 14.0 + FUSED_AFTER_S)
    assert innovations == [pytest.approx(-90.0, abs=0.1)] * len(innovations)
    assert max(abs(math.remainder(yaw, 360.0)) for yaw in log.values("XKF1", "Yaw", 8.0)) < 0.1
    assert log.said(8.0) == []


def handed_directly(parked: Parked) -> Callable[[float], None]:
    """Return what hands the filter a pose whose yaw is claimed to be exact, past the driver."""

    def pose(yaw_deg: float) -> None:
        quat = Quaternion.from_euler(f32(0), f32(0), f32(math.radians(yaw_deg)))
        stamp_ms, exact = parked.now_us // 1000, np.float32(0)
        parked.vehicle.ahrs.writeExtNavData(Vector3f(), quat, np.float32(0.2), exact, stamp_ms, 10, 0)

    return pose


def sent(parked: Parked) -> Callable[[float], None]:
    """Return what sends a pose with a covariance of zero."""
    return lambda yaw_deg: parked.pose(yaw_deg=yaw_deg, variance=0.0)


@pytest.mark.parametrize(("way", "logged_rad", "used_rad"), [
    (sent, 0.2, 0.2),
    (handed_directly, 0.0, math.radians(5.0)),
])  # fmt: skip
def test_22_angle_error_of_zero_is_02_rad_by_message_and_5_deg_by_call(
    make_parked: "MakeParked",
    way: Callable[[Parked], Callable[[float], None]],
    logged_rad: float,
    used_rad: float,
) -> None:
    parked = make_parked("60606")
    pose = way(parked)
    parked.run_to(6.0)
    parked.stream(9.0, lambda: pose(0.0))
    parked.stream(9.2, lambda: pose(90.0))
    log = parked.log()
    assert {np.float32(sample.AEr) for sample in log.rows("REPH")} == {np.float32(logged_rad)}
    # By then the filter's own uncertainty is small beside the sample's.
    assert log.value("XKF4", "SM", 9.0 + FUSED_AFTER_S) == pytest.approx(STEP_RAD / (YAW_GATE * used_rad), rel=0.03)
