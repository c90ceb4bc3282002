# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle warns when its estimator fails, and when it is well again."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ekf_stub.reports.filter_status import FilterFlag, FilterStatus
from mav_handlers.ports import Location
from mav_handlers.wire.messages import HEARTBEAT, SET_GPS_GLOBAL_ORIGIN
from tests.copies import Copies
from viso.vehicle.copter.ekf_check import is_over_threshold

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench

MakeBench = Callable[..., "Bench"]
ORIGIN = Location(-353632610, 1491652300, 58400)
LOST = [(16, 2), (17, 1)]
RESOLVED = [(16, 0), (17, 0)]

WARNS_S, SOON_S = 24.0, 8.0
"""In the first 30 s since boot there is no text, though all else."""

KNOWN: dict[tuple[object, ...], Copies["Bench"]] = {}


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


def navigating(make_bench: MakeBench, *, origin: bool = True, from_s: float = WARNS_S, **params: float) -> "Bench":
    """Return a vehicle that navigates; the way there is gone once for each set of parameters."""
    key = (origin, from_s, *sorted(params.items()))
    if key not in KNOWN:
        KNOWN[key] = Copies(start_navigating(make_bench, origin, from_s, **params))
    return KNOWN[key].make()


def lost(make_bench: MakeBench, *, armed: bool = False) -> "Bench":
    """Return one that has navigated, and has had no sample for 12 s; the way there is gone once."""
    key = ("lost", armed)
    if key not in KNOWN:
        bench = navigating(make_bench)
        if armed:
            bench.command(400, 1, 2989)
        bench.run_for(12)
        KNOWN[key] = Copies(bench)
    return KNOWN[key].make()


def start_navigating(make_bench: MakeBench, origin: bool, from_s: float, **params: float) -> "Bench":
    sources = {"EK3_SRC1_POSXY": 6, "EK3_SRC1_VELXY": 6, "EK3_SRC1_VELZ": 0}
    bench = make_bench(VISO_TYPE=1, GPS1_TYPE=0, DISARM_DELAY=0, **sources, **params)
    bench.run_to(from_s)
    bench.see(1)
    if origin:
        bench.send(SET_GPS_GLOBAL_ORIGIN(1, ORIGIN.lat, ORIGIN.lng, ORIGIN.alt_cm * 10))
    bench.see(1)
    bench.texts.clear()
    bench.records.clear()
    return bench


def said(bench: "Bench") -> list[tuple[int, str]]:
    return [(severity, text) for _, severity, text in bench.texts if text.startswith("EKF ")]


def errors(bench: "Bench") -> list[tuple[int, int]]:
    return [(record["Subsys"], record["ECode"]) for record in bench.written("ERR")]


def test_vehicle_warns_8_s_after_the_last_sample(make_bench: MakeBench) -> None:
    bench = navigating(make_bench)
    silent_us = bench.scheduler.now_us
    bench.run_for(12)
    assert said(bench) == [(2, "EKF variance")]
    [told_us] = [time_us for time_us, _, text in bench.texts if text == "EKF variance"]
    assert told_us - silent_us == pytest.approx(8_000_000, abs=200_000)
    assert errors(bench) == LOST


def test_samples_that_come_back_resolve_it_after_a_second(make_bench: MakeBench) -> None:
    bench = lost(make_bench)
    bench.see(0.8)
    assert errors(bench) == LOST
    bench.see(0.7)
    assert errors(bench) == LOST + RESOLVED
    assert said(bench) == [(2, "EKF variance")]


def system_status(bench: "Bench") -> int:
    bench.received()
    bench.run_for(1)
    [beat] = [message for message in bench.received() if isinstance(message, HEARTBEAT)]
    return beat.system_status


@pytest.mark.parametrize("armed", [False, True])
def test_heartbeat_is_critical_until_it_is_resolved(make_bench: MakeBench, armed: bool) -> None:
    bench = lost(make_bench, armed=armed)
    assert system_status(bench) == 5
    bench.see(2)
    assert system_status(bench) == 3


def test_armed_vehicle_in_failsafe_is_refused_modes_that_require_a_position(make_bench: MakeBench) -> None:
    bench = lost(make_bench, armed=True)
    bench.see(0.5)
    assert bench.command(176, 1, 5) == 4
    assert (4, "Mode change to LOITER failed: requires position") in [(level, text) for _, level, text in bench.texts]
    bench.see(2)
    assert bench.command(176, 1, 5) == 0


def test_armed_vehicle_tells_of_its_failsafe(make_bench: MakeBench) -> None:
    bench = lost(make_bench, armed=True)
    bench.see(2)
    assert said(bench) == [(2, "EKF variance"), (2, "EKF Failsafe"), (2, "EKF Failsafe Cleared")]


@pytest.mark.slow
def test_second_warning_waits_for_30_s(make_bench: MakeBench) -> None:
    bench = lost(make_bench)
    bench.see(2)
    bench.run_for(12)
    assert errors(bench) == LOST + RESOLVED + LOST
    assert said(bench) == [(2, "EKF variance")]


def test_nothing_is_checked_without_an_origin(make_bench: MakeBench) -> None:
    bench = navigating(make_bench, origin=False, from_s=SOON_S)
    bench.run_for(12)
    assert (said(bench), errors(bench)) == ([], [])


def test_nothing_is_checked_when_it_is_switched_off(make_bench: MakeBench) -> None:
    bench = navigating(make_bench, FS_EKF_THRESH=0, from_s=SOON_S)
    bench.run_for(12)
    assert (said(bench), errors(bench)) == ([], [])


def test_failsafe_ends_when_the_check_is_switched_off(make_bench: MakeBench) -> None:
    bench = lost(make_bench)
    bench.set("FS_EKF_THRESH", 0)
    bench.run_for(1)
    assert errors(bench) == [*LOST, (17, 0)]


@pytest.mark.slow
def test_vehicle_that_never_had_a_position_does_not_warn(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1, EK3_SRC1_POSXY=6)
    bench.vehicle.set_origin(ORIGIN)
    bench.run_for(12)
    assert (said(bench), errors(bench)) == ([], [])
