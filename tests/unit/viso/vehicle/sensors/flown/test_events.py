# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log tells of arming, flying, source sets, the origin and the GPS."""

import math
from typing import Any

import numpy as np
import pytest

from ap_core.location import Location
from tests.unit.viso.vehicle.sensors.flown.made import log_of
from viso.logs.recorded import ahrs_start_us
from viso.vehicle.sensors.flight import Event, Happening
from viso.vehicle.sensors.flown.events import events_of, gps_of

BEGUN = {"ATT": [[7_000_000, 0, 0, 0]]}
PLACE = Location(-353632610, 1491652300, 58400)


def test_events_come_in_order() -> None:
    log = log_of(
        ARM=[[30e6, 1], [80e6, 0]],
        EV=[[30e6, 10], [33e6, 28], [40e6, 86], [50e6, 85], [78e6, 18], [80e6, 11], [80e6, 56]],
        ORGN=[[6e6, 0, PLACE.lat, PLACE.lng, PLACE.alt_cm], [6e6, 1, PLACE.lat, PLACE.lng, 0]],
    )
    assert events_of(log) == (
        Event(6_000_000, Happening.ORIGIN, PLACE),
        Event(30_000_000, Happening.ARMED),
        Event(33_000_000, Happening.LIFTED_OFF),
        Event(40_000_000, Happening.SOURCE_SET, 1),
        Event(50_000_000, Happening.SOURCE_SET, 0),
        Event(78_000_000, Happening.LANDED),
        Event(80_000_000, Happening.DISARMED),
    )


def test_log_that_opens_armed_and_in_flight_begins_so() -> None:
    log = log_of(**BEGUN, ARM=[[80e6, 0]], EV=[[78e6, 18]])
    assert [(event.time_us, event.what) for event in events_of(log)][:2] == [
        (7_000_000, Happening.ARMED),
        (7_000_000, Happening.LIFTED_OFF),
    ]


def test_without_arm_records_events_tell() -> None:
    assert [event.what for event in events_of(log_of(EV=[[30e6, 10], [80e6, 11]]))] == [
        Happening.ARMED,
        Happening.DISARMED,
    ]
    assert events_of(log_of()) == ()


@pytest.mark.parametrize(("set_by_somebody", "events"), [([], 0), ([[PLACE.lat, PLACE.lng, PLACE.alt_cm]], 1)])
def test_origin_of_replay_records_is_one_that_somebody_set(set_by_somebody: list[Any], events: int) -> None:
    log = log_of(RFRH=[[3e6]], ORGN=[[6e6, 0, PLACE.lat, PLACE.lng, PLACE.alt_cm]], RSO3=set_by_somebody)
    assert len(events_of(log)) == events


def test_origin_that_is_nowhere_is_none() -> None:
    assert events_of(log_of(ORGN=[[6e6, 0, 2_000_000_000, 0, 0]])) == ()


GPS = [20e6, 0, 6, 10, 121, PLACE.lat, PLACE.lng, PLACE.alt_cm, 2.0, 90.0, -0.5]
PASSES_US = np.array([19e6, 20e6, 20.0025e6, 30e6])


def test_solution_is_there_from_the_next_pass_on() -> None:
    gps = gps_of(log_of(GPS=[GPS], GPA=[[20e6, 0, 200, 30, 40, 50, 1, 19_950]]), PASSES_US)
    assert [gps.at(number) is None for number in range(4)] == [True, True, False, False]
    sample = gps.at(3)
    assert sample is not None
    assert (sample.time_ms, sample.fix_type, sample.num_sats, sample.location) == (19_950, 6, 10, PLACE)
    assert [float(part) for part in sample.vel_ned.to_tuple()] == pytest.approx([0.0, 2.0, -0.5], abs=1e-6)
    assert (sample.hdop, sample.vdop, sample.last_fix_ms) == (121, 200, 19_950)
    accuracies = sample.horizontal_accuracy, sample.vertical_accuracy, sample.speed_accuracy
    assert accuracies == pytest.approx((0.3, 0.4, 0.5))
    assert sample.has_vertical_velocity


def test_accuracies_that_nobody_tells_are_unknown() -> None:
    for log in (log_of(GPS=[GPS]), log_of(GPS=[GPS], GPA=[[20e6, 0, 200, 65535, 65535, 65535, 1, 19_950]])):
        sample = gps_of(log, PASSES_US).at(3)
        assert sample is not None
        assert (sample.horizontal_accuracy, sample.vertical_accuracy, sample.speed_accuracy) == (None, None, None)
    without = gps_of(log_of(GPS=[GPS]), PASSES_US).at(3)
    assert without is not None
    assert without.time_ms == 20_000


@pytest.mark.parametrize(("params", "records", "lag_s"), [
    ({}, {}, 0.2),
    ({}, {"MSG": [[5e6, "GPS 1: detected u-blox"]]}, 0.12),
    ({"GPS1_DELAY_MS": 80}, {"MSG": [[5e6, "GPS 1: detected u-blox"]]}, 0.08),
    ({"GPS_DELAY_MS": 90}, {}, 0.09),
    ({"GPS1_DELAY_MS": 80}, {"RGPI": [[0.22, 0], [0.5, 1]]}, 0.22),
])  # fmt: skip
def test_solution_is_as_late_as_the_log_tells_of_the_receiver(
    params: dict[str, float], records: dict[str, Any], lag_s: float
) -> None:
    sample = gps_of(log_of(params, **records, GPS=[GPS]), PASSES_US).at(3)
    assert sample is not None
    assert sample.lag_s == pytest.approx(lag_s, rel=1e-6)


def test_first_receiver_counts() -> None:
    second = [20e6, 1, 3, 4, 121, 0, 0, 0, math.pi, 0, 0]
    sample = gps_of(log_of(GPS=[GPS, second]), PASSES_US).at(3)
    assert sample is not None
    assert sample.num_sats == 10


@pytest.mark.parametrize(("texts", "start_us"), [
    ([], 2_455_000),
    ([[1e6, "ArduPilot Ready"]], 2_455_000),
    ([[3_930_094, "EKF3 IMU0 initialised"], [90e6, "EKF3 IMU0 initialised"]], 1_928_000),
    ([[5, "EKF3 IMU0 initialised"]], 2_455_000),
])  # fmt: skip
def test_ahrs_starts_before_its_filter_is_initialised(texts: list[list[Any]], start_us: int) -> None:
    assert ahrs_start_us(log_of(MSG=texts)) == start_us
