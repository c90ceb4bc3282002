# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When GPS is good enough to start with, and what is said until then."""

from typing import Any

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.gps_checks import GpsChecks, GpsSurroundings
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
BAD: dict[str, Any] = {"num_sats": 5}


UNKNOWN = GpsSurroundings()
PARAMS = {"GPS_CHECK": 31, "CHECK_SCALE": 100}


def gps_checks(**params: float) -> GpsChecks:
    return GpsChecks({**PARAMS, **params}.__getitem__)


def run(checks: GpsChecks, from_ms: int, to_ms: int, around: GpsSurroundings = UNKNOWN, **fields: Any) -> None:
    for time_ms in range(from_ms, to_ms + 1, 200):
        sample = GpsSample(time_ms=time_ms, **{**GOOD, **fields})
        if checks.update(sample) is not None:
            checks.judge(sample, time_ms, around._replace(speed_accuracy=sample.speed_accuracy or 0.0))


def test_nothing_is_known_against_a_gps_that_is_not_there() -> None:
    checks = gps_checks()
    assert (checks.good, checks.reason) == (False, None)


def test_fix_is_waited_for() -> None:
    checks = gps_checks()
    run(checks, 1000, 1000, fix_type=2)
    assert (checks.reason, checks.newest) == ("Waiting for 3D fix", None)


@pytest.mark.parametrize(("end_ms", "good"), [(11_000, False), (11_200, True)])
def test_gps_is_good_more_than_10_s_after_its_first_fix(end_ms: int, good: bool) -> None:
    checks = gps_checks()
    run(checks, 1000, end_ms)
    assert checks.good is good


def test_checks_are_announced_with_the_first_fix() -> None:
    checks = gps_checks()
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
def test_failing_check_is_told_and_starts_the_10_s_anew(fields: dict[str, Any], reason: str) -> None:
    checks = gps_checks()
    run(checks, 1000, 20_000, **fields)
    assert (checks.good, checks.reason) == (False, reason)
    run(checks, 20_200, 29_800)
    assert not checks.good
    run(checks, 30_000, 30_400)
    assert checks.good


def test_accuracies_that_the_receiver_does_not_give_are_not_checked() -> None:
    checks = gps_checks()
    run(checks, 1000, 12_000, horizontal_accuracy=None, vertical_accuracy=None, speed_accuracy=None)
    assert checks.good


@pytest.mark.parametrize(("bad_ms", "good"), [(4800, True), (5400, False)])
def test_gps_is_bad_when_it_fails_for_5_s(bad_ms: int, good: bool) -> None:
    checks = gps_checks()
    run(checks, 1000, 12_000)
    run(checks, 12_200, 12_000 + bad_ms, **BAD)
    assert checks.good is good


def test_limits_are_wider_once_it_is_good() -> None:
    checks = gps_checks()
    run(checks, 1000, 12_000)
    run(checks, 12_200, 20_000, horizontal_accuracy=6.4)
    assert checks.good
    run(checks, 20_200, 28_000, horizontal_accuracy=6.6)
    assert not checks.good


@pytest.mark.parametrize(("after_ms", "is_new"), [(0, False), (50, False), (51, True)])
def test_solutions_within_50_ms_are_passed_over(after_ms: int, is_new: bool) -> None:
    checks = gps_checks()
    run(checks, 1000, 1000)
    assert (checks.update(GpsSample(time_ms=1000 + after_ms, **GOOD)) is not None) is is_new


@pytest.mark.parametrize(("around", "reason"), [
    (GpsSurroundings(mag_x=1.2, mag_y=0.5), "Mag yaw error x=1.2 y=0.5"),
    (GpsSurroundings(mag_y=1.1), "Mag yaw error x=0.0 y=1.1"),
    (GpsSurroundings(yaw=1.1, on_ground=False), "Mag yaw error x=0.0 y=0.0"),
])  # fmt: skip
def test_yaw_that_cannot_be_believed_ends_the_use_of_gps_in_flight_too(around: GpsSurroundings, reason: str) -> None:
    checks = gps_checks()
    run(checks, 1000, 12_000)
    run(checks, 12_200, 18_000, around)
    assert (checks.good, checks.reason) == (False, reason)


@pytest.mark.parametrize(("check", "around", "fields", "reason"), [
    (1 << 6, GpsSurroundings(), {"has_vertical_velocity": True, "vel_ned": Vector3f(0, 0, -1)}, "GPS vertical speed 1"),
    (1 << 7, GpsSurroundings(horizontal_speed=1.0), {}, "GPS horizontal speed "),
])  # fmt: skip
def test_gps_that_moves_on_the_ground_is_bad_where_that_is_checked(
    check: int, around: GpsSurroundings, fields: dict[str, Any], reason: str
) -> None:
    for checked, on_ground in ((check, True), (0, True), (check, False)):
        checks = gps_checks(GPS_CHECK=checked)
        run(checks, 1000, 12_000, around._replace(on_ground=on_ground), **fields)
        assert checks.good is not (checked and on_ground)
        assert checks.reason is not None
        assert checks.reason.startswith(reason) is bool(checked and on_ground)


def test_place_that_drifts_on_the_ground_is_bad_where_that_is_checked() -> None:
    checks = gps_checks(GPS_CHECK=1 << 5)
    for turn in range(120):
        run(checks, 1000 + 200 * turn, 1000 + 200 * turn, location=Location(100 * (turn % 2), 2, 3))
    assert not checks.good
    assert checks.reason is not None
    assert checks.reason.startswith("GPS drift ")


def test_limits_are_scaled() -> None:
    checks = gps_checks(CHECK_SCALE=150)
    run(checks, 1000, 12_000, horizontal_accuracy=7.4)
    assert checks.good
