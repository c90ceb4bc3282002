# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the estimator begins and ends to navigate, and what counts as lost meanwhile."""

import pytest

from ekf_stub.fusion.aiding import Aiding, AidingMode, Ready

NOTHING = Ready(gps=False, ext_nav=False, odometry=False)
EXT_NAV = Ready(gps=False, ext_nav=True, odometry=False)
GPS = Ready(gps=True, ext_nav=False, odometry=False)
ODOMETRY = Ready(gps=False, ext_nav=False, odometry=True)
FLOW = Ready(gps=False, ext_nav=False, odometry=False, flow=True)
START_MS = 30_000


def update(aiding: Aiding, now_ms: int, ready: Ready = NOTHING, *, no_yaw: bool = False) -> bool:
    return aiding.update(now_ms, lambda: ready, no_yaw_on_ground=no_yaw)


def aiding_by(ready: Ready) -> Aiding:
    aiding = Aiding()
    assert update(aiding, START_MS, ready)
    return aiding


def test_nothing_changes_without_measurements() -> None:
    aiding = Aiding()
    assert not update(aiding, START_MS)
    assert (aiding.mode, aiding.pos_timeout, aiding.vel_timeout) == (AidingMode.NONE, False, True)


@pytest.mark.parametrize(("ready", "mode"), [
    (EXT_NAV, AidingMode.ABSOLUTE),
    (GPS, AidingMode.ABSOLUTE),
    (ODOMETRY, AidingMode.RELATIVE),
    (FLOW, AidingMode.RELATIVE),
    (Ready(gps=False, ext_nav=True, odometry=True), AidingMode.ABSOLUTE),
])  # fmt: skip
def test_aiding_starts_with_what_is_ready(ready: Ready, mode: AidingMode) -> None:
    assert aiding_by(ready).mode is mode


@pytest.mark.parametrize(("ready", "vel_timeout"), [(EXT_NAV, False), (ODOMETRY, True)])
def test_position_is_not_lost_as_aiding_starts(ready: Ready, vel_timeout: bool) -> None:
    aiding = aiding_by(ready)
    assert (aiding.pos_timeout, aiding.vel_timeout) == (False, vel_timeout)


def test_absolute_position_ends_relative_aiding() -> None:
    aiding = aiding_by(ODOMETRY)
    assert update(aiding, START_MS + 100, EXT_NAV)
    assert aiding.mode is AidingMode.ABSOLUTE


@pytest.mark.parametrize(("after_ms", "ended"), [(5000, False), (5001, True)])
@pytest.mark.parametrize("ready", [ODOMETRY, FLOW])
def test_relative_aiding_ends_5_s_after_the_last_odometry_or_flow(ready: Ready, after_ms: int, ended: bool) -> None:
    aiding = aiding_by(ready)
    assert update(aiding, START_MS + after_ms) is ended


@pytest.mark.parametrize(("after_ms", "lost"), [(7000, False), (7001, True)])
def test_everything_is_lost_after_7_s_of_silence(after_ms: int, lost: bool) -> None:
    aiding = aiding_by(EXT_NAV)
    assert not update(aiding, START_MS + after_ms)
    assert (aiding.pos_timeout, aiding.vel_timeout) == (lost, lost)


@pytest.mark.parametrize(("after_ms", "lost"), [(10_000, False), (10_001, True)])
@pytest.mark.parametrize("what", ["vel", "odometry", "flow"])
def test_position_is_lost_after_10_s_while_velocity_goes_on(what: str, after_ms: int, lost: bool) -> None:
    aiding = aiding_by(EXT_NAV)
    setattr(aiding.times, what, START_MS + after_ms)
    update(aiding, START_MS + after_ms)
    assert (aiding.pos_timeout, aiding.vel_timeout) == (lost, False)


def test_position_stays_lost_when_samples_pass_again() -> None:
    aiding = aiding_by(EXT_NAV)
    update(aiding, START_MS + 8000)
    aiding.times.pos = START_MS + 8010
    update(aiding, START_MS + 8020)
    assert aiding.pos_timeout


@pytest.mark.parametrize(("after_ms", "mode"), [(15_000, AidingMode.ABSOLUTE), (15_001, AidingMode.NONE)])
def test_aiding_ends_after_15_s_of_silence(after_ms: int, mode: AidingMode) -> None:
    aiding = aiding_by(EXT_NAV)
    update(aiding, START_MS + 8000)
    update(aiding, START_MS + after_ms)
    assert aiding.mode is mode


def test_only_velocity_counts_as_lost_once_aiding_has_ended() -> None:
    aiding = aiding_by(EXT_NAV)
    update(aiding, START_MS + 15_001)
    assert (aiding.pos_timeout, aiding.vel_timeout) == (False, True)


def test_position_alone_keeps_aiding_going() -> None:
    aiding = aiding_by(EXT_NAV)
    aiding.times.pos = START_MS + 20_000
    assert not update(aiding, START_MS + 20_000)
    assert not aiding.pos_timeout


def test_disarmed_vehicle_without_a_yaw_source_stops_in_the_next_frame_without_a_sample() -> None:
    aiding = aiding_by(EXT_NAV)
    assert not update(aiding, START_MS + 2, EXT_NAV, no_yaw=True)
    assert update(aiding, START_MS + 12, NOTHING, no_yaw=True)
    assert aiding.mode is AidingMode.NONE


def test_odometry_counts_as_used_just_after_boot_as_its_time_is_0() -> None:
    aiding = Aiding()
    update(aiding, 10, EXT_NAV)
    aiding.times.pos = aiding.times.vel = -20_000
    update(aiding, 6999)
    assert (aiding.pos_timeout, aiding.vel_timeout) == (True, False)
    update(aiding, 7001)
    assert aiding.vel_timeout


def test_nothing_is_forgotten_or_remembered_as_milliseconds_pass_2_to_the_32() -> None:
    aiding = Aiding()
    update(aiding, (1 << 32) - 1000, EXT_NAV)
    update(aiding, (1 << 32) + 5999)
    assert not aiding.pos_timeout
    update(aiding, (1 << 32) + 6001)
    assert (aiding.pos_timeout, aiding.vel_timeout) == (True, True)


def test_what_could_start_aiding_is_not_asked_while_navigating_by_position() -> None:
    aiding, asked = aiding_by(EXT_NAV), []

    def ready() -> Ready:
        asked.append(1)
        return NOTHING

    aiding.update(START_MS + 100, ready, no_yaw_on_ground=False)
    assert asked == []
    aiding.update(START_MS + 102, ready, no_yaw_on_ground=True)
    assert asked == [1]
