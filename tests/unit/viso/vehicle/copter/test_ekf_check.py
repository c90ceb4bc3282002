# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle warns when its estimator fails, and when it is well again."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ap_core.log_field import LogValue
from ekf_stub.reports import FilterFlag, FilterStatus
from mav_handlers.wire.messages import HEARTBEAT, SET_GPS_GLOBAL_ORIGIN
from tests.unit.viso.conftest import NAVIGATES
from viso.firmware.releases import JULY_2025, STABLE_4_6, Firmware
from viso.vehicle.copter.ekf_check import is_over_threshold

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench, CopterRig

    MakeBench = Callable[..., Bench]

ORIGIN = Location(-353632610, 1491652300, 58400)
LOST = [(16, 2), (17, 1)]
RESOLVED = [(16, 0), (17, 0)]

SILENT_S = 12.0
WELL = FilterStatus(NAVIGATES)
ILL = FilterStatus(NAVIGATES, velocity_variance=1.0, compass_variance=1.0)


def status(compass: float = 0, velocity: float = 0, position: float = 0) -> FilterStatus:
    return FilterStatus(
        FilterFlag(0), velocity_variance=velocity, pos_horiz_variance=position, compass_variance=compass
    )


@pytest.mark.parametrize(("variances", "over"), [
    ((0, 0, 0), False),
    ((0.8, 0, 0), False),
    ((0, 0.8, 0), False),
    ((0, 0, 9), False),
    ((0.8, 0.8, 0), True),
    ((0.8, 0, 0.8), True),
    ((0, 0.8, 0.8), True),
    ((0, 1.6, 0), True),
    ((0, 1.5, 0), False),
])  # fmt: skip
def test_two_variances_over_the_threshold_are_too_many(variances: tuple[float, float, float], over: bool) -> None:
    assert is_over_threshold(status(*variances), 0.8) is over


def test_velocity_far_off_is_one_variance_while_a_flow_sensor_works() -> None:
    assert not is_over_threshold(status(0, 9, 0), 0.8, has_flow=True)
    assert is_over_threshold(status(0, 9, 0.8), 0.8, has_flow=True)


def watch(rig: "CopterRig", duration_s: float, found: FilterStatus) -> None:
    """Let the copter look at an estimator in such a state for a while, ten times per second."""
    rig.ahrs.status = found
    for _ in range(round(duration_s * 10)):
        rig.clock.set_us(rig.clock.micros64() + 100_000)
        rig.copter.check_estimator()


def told(rig: "CopterRig") -> tuple[list[tuple[LogValue, ...]], list[str]]:
    """Return the errors that were logged and the texts that were sent since the last call."""
    return [values for _, values in rig.written("ERR")], rig.take_texts()


@pytest.fixture
def watched(rig: "CopterRig") -> "CopterRig":
    """Return a copter with an origin, whose estimator has been well, when texts are due again."""
    rig.ahrs.ekf_origin = ORIGIN
    rig.clock.set_us(40_000_000)
    watch(rig, 0.5, WELL)
    return rig


def test_second_of_failures_is_told_and_a_second_without_resolves_it(watched: "CopterRig") -> None:
    watch(watched, 0.9, ILL)
    assert told(watched) == ([], [])
    watch(watched, 0.1, ILL)
    assert told(watched) == (LOST, ["EKF variance"])
    assert watched.copter.is_in_failsafe()
    watch(watched, 0.9, WELL)
    assert told(watched) == ([], [])
    watch(watched, 0.1, WELL)
    assert told(watched) == (RESOLVED, [])
    assert not watched.copter.is_in_failsafe()


def test_estimator_is_asked_for_help_before_it_counts_as_failed(watched: "CopterRig") -> None:
    found = []
    for _ in range(10):
        watch(watched, 0.1, ILL)
        found.append(len(watched.ahrs.asked))
    assert found == [0] * 7 + [1, 2, 2]
    assert watched.ahrs.asked == ["yaw reset", "lane switch"]


def test_lost_position_asks_for_no_yaw_reset(watched: "CopterRig") -> None:
    watch(watched, 1.0, FilterStatus(FilterFlag(0)))
    assert watched.ahrs.asked == ["lane switch"]


def test_second_warning_waits_for_30_s(watched: "CopterRig") -> None:
    for _ in range(2):
        watch(watched, 1.0, ILL)
        watch(watched, 1.0, WELL)
    assert told(watched) == ([*LOST, *RESOLVED, *LOST, *RESOLVED], ["EKF variance"])
    watch(watched, 27.1, WELL)
    watch(watched, 1.0, ILL)
    assert told(watched) == (LOST, ["EKF variance"])


def test_nothing_is_checked_without_an_origin(watched: "CopterRig") -> None:
    watched.ahrs.ekf_origin = None
    watch(watched, 3.0, ILL)
    assert told(watched) == ([], [])


def test_nothing_is_checked_when_it_is_switched_off(watched: "CopterRig") -> None:
    watched.params.set("FS_EKF_THRESH", 0)
    watch(watched, 3.0, ILL)
    assert told(watched) == ([], [])


def test_failsafe_ends_when_the_check_is_switched_off(watched: "CopterRig") -> None:
    watch(watched, 1.0, ILL)
    watched.params.set("FS_EKF_THRESH", 0)
    watch(watched, 0.1, ILL)
    assert told(watched) == ([*LOST, (17, 0)], ["EKF variance"])


def test_vehicle_that_never_had_a_position_does_not_warn(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = ORIGIN
    watch(rig, 3.0, FilterStatus(FilterFlag(0)))
    assert told(rig) == ([], [])


@pytest.mark.parametrize(("firmware", "failsafe"), [(JULY_2025, ["EKF Failsafe"]), (STABLE_4_6, [])])
def test_failsafe_that_leaves_the_mode_is_told_since_4_7(
    watched: "CopterRig", firmware: Firmware, failsafe: list[str]
) -> None:
    watched.use_firmware(firmware)
    watched.copter.arm(do_checks=False)
    told(watched)
    watch(watched, 1.0, ILL)
    assert told(watched) == (LOST, ["EKF variance", *failsafe])
    watch(watched, 1.0, WELL)
    assert told(watched) == (RESOLVED, ["EKF Failsafe Cleared"] if failsafe else [])


def flown(make_bench: "MakeBench", *, armed: bool) -> "Bench":
    """Return a vehicle that has navigated, and has had no sample for 12 s."""
    sources = {"EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 6, "EK3_SRC1_VELZ": 0}
    bench = make_bench(VISO_TYPE=1, GPS1_TYPE=0, DISARM_DELAY=0, **sources)
    bench.run_to(24)  # in the first 30 s since boot there is no text
    bench.see(1)
    bench.send(SET_GPS_GLOBAL_ORIGIN(1, ORIGIN.lat, ORIGIN.lng, ORIGIN.alt_cm * 10))
    bench.see(1)
    bench.texts.clear()
    bench.records.clear()
    if armed:
        bench.command(400, 1, 2989)
    bench.run_for(SILENT_S)
    return bench


@pytest.fixture
def lost(make_bench: "MakeBench") -> "Bench":
    """Return one that is armed."""
    return flown(make_bench, armed=True)


def said(bench: "Bench") -> list[tuple[int, str]]:
    return [(severity, text) for _, severity, text in bench.texts if text.startswith("EKF ")]


def errors(bench: "Bench") -> list[tuple[int, int]]:
    return [(record["Subsys"], record["ECode"]) for record in bench.written("ERR")]


@pytest.mark.slow
def test_vehicle_warns_8_s_after_the_last_sample(lost: "Bench") -> None:
    silent_us = lost.scheduler.now_us - round(SILENT_S * 1e6)
    assert said(lost) == [(2, "EKF variance"), (2, "EKF Failsafe")]
    [told_us] = [time_us for time_us, _, text in lost.texts if text == "EKF variance"]
    assert told_us - silent_us == pytest.approx(8_000_000, abs=200_000)
    assert errors(lost) == LOST


@pytest.mark.slow
def test_samples_that_come_back_resolve_it_after_a_second(lost: "Bench") -> None:
    lost.see(0.8)
    assert errors(lost) == LOST
    lost.see(0.7)
    assert errors(lost) == LOST + RESOLVED
    assert said(lost) == [(2, "EKF variance"), (2, "EKF Failsafe"), (2, "EKF Failsafe Cleared")]


def system_status(bench: "Bench") -> int:
    bench.received()
    bench.run_for(1)
    [beat] = [message for message in bench.received() if isinstance(message, HEARTBEAT)]
    return beat.system_status


@pytest.mark.slow
@pytest.mark.parametrize("armed", [pytest.param(False, marks=pytest.mark.slow), True])
def test_heartbeat_is_critical_until_it_is_resolved(make_bench: "MakeBench", armed: bool) -> None:
    bench = flown(make_bench, armed=armed)
    assert system_status(bench) == 5
    bench.see(2)
    assert system_status(bench) == 3


@pytest.mark.slow
def test_armed_vehicle_in_failsafe_is_refused_modes_that_require_a_position(lost: "Bench") -> None:
    lost.see(0.5)
    assert lost.command(176, 1, 5) == 4
    assert (4, "Mode change to Loiter failed: requires position") in [(level, text) for _, level, text in lost.texts]
    lost.see(2)
    assert lost.command(176, 1, 5) == 0
