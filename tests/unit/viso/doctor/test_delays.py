# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""VISO_DELAY_MS is recovered from a recorded flight, and from delays made of it."""

import re

import pytest

from tests.unit.viso.doctor.evidences import changed
from tests.unit.viso.doctor.streams import piece, shifted
from viso.doctor import CHECKS, Evidence, diagnose, gather
from viso.doctor.evidence.compare import compare
from viso.doctor.evidence.vehicle_data import AttitudeSeries

SET_MS = 30
"""VISO_DELAY_MS of the recorded flight, whose camera is that late."""
TOLERANCE_MS = 5
START_S = 40.0


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((None, False), id="network"),
        pytest.param((None, True), id="network, tried", marks=pytest.mark.slow),
        pytest.param((115200, True), id="wire", marks=pytest.mark.slow),
    ],
)
def flight(request: pytest.FixtureRequest) -> Evidence:
    """Return what becomes of a piece of the flight, over a link that takes no time or by the simulator's baud rate.

    The usual run only listens, and has no vehicle that tries it.
    """
    baud, is_tried = request.param
    vehicle = shifted("flight_t265", START_S)
    return gather(piece("flight_t265", START_S, 12.0), vehicle=vehicle, baud=baud, is_tried=is_tried)


def advised_ms(flight: Evidence, delay_ms: int, setting_ms: float) -> list[int]:
    """Return the values in the advice, if the vehicle had moved so much earlier, and VISO_DELAY_MS were set so."""
    assert flight.vehicle.attitude is not None
    earlier_us = flight.vehicle.attitude.time_us - (delay_ms - SET_MS) * 1000
    attitude = AttitudeSeries(earlier_us, flight.vehicle.attitude.euler_rad)
    params = {**flight.trial.params, "VISO_DELAY_MS": setting_ms}
    compared = compare(flight.stream.poses, flight.stream.vision, attitude, params)
    evidence = changed(flight, attitude=attitude, params=params, comparisons=compared)
    fixes = [one.fix for one in diagnose(evidence, CHECKS) if one.code == "XN3-11"]
    return [int(value) for fix in fixes for value in re.findall(r"\bto (\d+)\b", fix)]


@pytest.mark.parametrize(
    "delay_ms", [10, 100, *(pytest.param(delay_ms, marks=pytest.mark.slow) for delay_ms in (30, 50, 150, 200))]
)
def test_delay_made_of_the_flight_is_recovered(flight: Evidence, delay_ms: int) -> None:
    wrong_ms = 250 if delay_ms < 100 else 0
    first, *_ = advised_ms(flight, delay_ms, wrong_ms)
    assert first == pytest.approx(delay_ms, abs=TOLERANCE_MS)


@pytest.mark.parametrize("delay_ms", [30, *(pytest.param(delay_ms, marks=pytest.mark.slow) for delay_ms in (100, 200))])
def test_delay_that_is_set_as_it_is_needs_no_advice(flight: Evidence, delay_ms: int) -> None:
    assert advised_ms(flight, delay_ms, delay_ms) == []


def test_wire_that_may_be_quicker_than_its_rate_gets_both_values(flight: Evidence) -> None:
    values = advised_ms(flight, 100, 0)
    transport_ms = 244 * 86e-3  # an ODOMETRY at 115200 baud
    is_wire = len(values) == 2
    assert values[-1] == pytest.approx(100 - is_wire * transport_ms, abs=2 * TOLERANCE_MS)
