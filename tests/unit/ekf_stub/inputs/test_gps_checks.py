# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When GPS is good enough to start with, and what is said until then."""

from typing import Any

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.gps_checks import GpsChecks
from ekf_stub.inputs.gps_sample import GpsSample

GOOD: dict[str, Any] = {
    "fix_type": 3,
    "location": Location(1, 2, 3),
    "vel_ned": Vector3f(),
    "num_sats": 6,
    "hdop": 250,
    "horizontal_accuracy": 5.0,
    "vertical_accuracy": 7.5,
    "speed_accuracy": 1.0,
}
BAD = {"num_sats": 5}


def run(checks: GpsChecks, from_ms: int, to_ms: int, **fields: Any) -> None:
    for time_ms in range(from_ms, to_ms + 1, 200):
        checks.update(GpsSample(time_ms=time_ms, **{**GOOD, **fields}), time_ms)


def test_nothing_is_known_against_a_gps_that_is_not_there() -> None:
    checks = GpsChecks()
    assert (checks.good, checks.reason) == (False, None)


def test_fix_is_waited_for() -> None:
    checks = GpsChecks()
    run(checks, 1000, 1000, fix_type=2)
    assert (checks.reason, checks.newest) == ("Waiting for 3D fix", None)


@pytest.mark.parametrize(("end_ms", "good"), [(11_000, False), (11_200, True)])
def test_gps_is_good_more_than_10_s_after_its_first_fix(end_ms: int, good: bool) -> None:
    checks = GpsChecks()
    run(checks, 1000, end_ms)
    assert checks.good is good


def test_checks_are_announced_with_the_first_fix() -> None:
    checks = GpsChecks()
    run(checks, 1000, 1000)
    assert checks.reason == "EKF starting GPS checks"


@pytest.mark.parametrize(("fields", "reason"), [
    ({"num_sats": 5}, "GPS numsats 5 (needs 6)"),
    ({"hdop": 251}, "GPS HDOP 2.5 (needs 2.5)"),
    ({"hdop": 65535}, "GPS HDOP 655.4 (needs 2.5)"),
    ({"horizontal_accuracy": 5.1}, "GPS horiz error 5.1m (needs 5.0)"),
    ({"vertical_accuracy": 7.6}, "GPS vert error 7.6m (needs < 7.5)"),
    ({"speed_accuracy": 1.1}, "GPS speed error 1.1 (needs < 1.0)"),
    ({"num_sats": 0, "hdop": 900, "speed_accuracy": 9.0}, "GPS numsats 0 (needs 6)"),
])  # fmt: skip
def test_failing_check_is_told_and_starts_the_10_s_anew(fields: dict[str, float], reason: str) -> None:
    checks = GpsChecks()
    run(checks, 1000, 20_000, **fields)
    assert (checks.good, checks.reason) == (False, reason)
    run(checks, 20_200, 29_800)
    assert not checks.good
    run(checks, 30_000, 30_400)
    assert checks.good


def test_accuracies_that_the_receiver_does_not_give_are_not_checked() -> None:
    checks = GpsChecks()
    run(checks, 1000, 12_000, horizontal_accuracy=None, vertical_accuracy=None, speed_accuracy=None)
    assert checks.good


@pytest.mark.parametrize(("bad_ms", "good"), [(4800, True), (5400, False)])
def test_gps_is_bad_when_it_fails_for_5_s(bad_ms: int, good: bool) -> None:
    checks = GpsChecks()
    run(checks, 1000, 12_000)
    run(checks, 12_200, 12_000 + bad_ms, **BAD)
    assert checks.good is good


def test_limits_are_wider_once_it_is_good() -> None:
    checks = GpsChecks()
    run(checks, 1000, 12_000)
    run(checks, 12_200, 20_000, horizontal_accuracy=6.4)
    assert checks.good
    run(checks, 20_200, 28_000, horizontal_accuracy=6.6)
    assert not checks.good


@pytest.mark.parametrize(("after_ms", "is_new"), [(0, False), (50, False), (51, True)])
def test_solutions_within_50_ms_are_passed_over(after_ms: int, is_new: bool) -> None:
    checks = GpsChecks()
    run(checks, 1000, 1000)
    assert (checks.update(GpsSample(time_ms=1000 + after_ms, **GOOD), 1100) is not None) is is_new
