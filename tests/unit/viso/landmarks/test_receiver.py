# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The middle of the aircraft: weights, gate, confidence, and the filter behind it."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from viso.landmarks.local_frame import FrameMode, to_enu, to_geodetic
from viso.landmarks.receiver import (
    FilteredPosition,
    ReceiverEstimate,
    ReceiverFilter,
    estimate_receiver,
    receiver_record,
)
from viso.landmarks.types import AircraftReport, GeodeticPoint

MIDDLE = GeodeticPoint(47.0, 8.0)
CROSS = ((10_000.0, 0.0), (-10_000.0, 0.0), (0.0, 5000.0), (0.0, -5000.0))
MODE = FrameMode.SPHERICAL


def heard(
    places: Sequence[tuple[float, float]], middle: GeodeticPoint = MIDDLE, altitude_ft: float | None = 30_000.0
) -> list[AircraftReport]:
    """Return a report for each place, given by its east and north of the middle."""
    points = (to_geodetic(MODE, middle, east, north, 0.0) for east, north in places)
    return [
        AircraftReport(0.0, f"{index:06X}", point.latitude_deg, point.longitude_deg, altitude_ft)
        for index, point in enumerate(points)
    ]


def estimated(reports: Sequence[AircraftReport], now_s: float = 0.0) -> ReceiverEstimate:
    estimate = estimate_receiver(reports, now_s, MODE)
    assert estimate is not None
    return estimate


def off_m(estimate: ReceiverEstimate | FilteredPosition, middle: GeodeticPoint = MIDDLE) -> list[float]:
    """Return east and north of the middle."""
    point = estimate.point
    east_m, north_m, _ = to_enu(MODE, middle, point.latitude_deg, point.longitude_deg, 0.0).tolist()
    return [east_m, north_m]


def at(t_s: float, east_m: float, sigma_major_m: float = 1000.0) -> ReceiverEstimate:
    point = to_geodetic(MODE, MIDDLE, east_m, 0.0, 0.0)
    return ReceiverEstimate(t_s, point, sigma_major_m, 500.0, 0.5, ("000000",), 0)


def test_a_cross_of_aircraft_has_its_middle_and_its_spread() -> None:
    estimate = estimated(heard(CROSS))
    assert off_m(estimate) == pytest.approx([0, 0], abs=0.1)
    assert estimate.sigma_major_m == pytest.approx(math.sqrt(50e6), rel=1e-6)
    assert estimate.sigma_minor_m == pytest.approx(math.sqrt(12.5e6), rel=1e-6)
    assert estimate.used_icaos == ("000000", "000001", "000002", "000003")
    assert estimate.rejected_outliers == 0


def test_the_confidence_is_its_formula() -> None:
    high, low = estimated(heard(CROSS)), estimated(heard(CROSS, altitude_ft=14_999.0))
    major_m = math.sqrt(50e6)
    expected = 0.30 * 4 / 20 + 0.25 * math.exp(-major_m / 40e3) + 0.15
    assert high.confidence == pytest.approx(expected, rel=1e-6)
    assert low.confidence == pytest.approx(expected + 0.30 * 4 / 6, rel=1e-6)


def test_low_and_fresh_aircraft_count_more() -> None:
    reports = heard(CROSS)
    pulled = estimated([replace(reports[0], altitude_ft=1000.0), *reports[1:]])
    weights = np.array([1 / math.sqrt(1500), *[1 / math.sqrt(30_500)] * 3])
    assert off_m(pulled) == pytest.approx(weights.dot(CROSS) / weights.sum(), abs=0.1)
    aged = estimated([replace(reports[0], t_s=-15.0), *reports[1:]])
    weights = np.array([math.exp(-0.5), 1, 1, 1])
    assert off_m(aged) == pytest.approx(weights.dot(CROSS) / weights.sum(), abs=0.1)


def test_an_unknown_altitude_counts_as_35000_ft_and_not_as_low() -> None:
    known = [*heard(CROSS)[:3], replace(heard(CROSS)[3], altitude_ft=35_000.0)]
    unknown = [*known[:3], replace(known[3], altitude_ft=None)]
    assert estimated(unknown) == estimated(known)


def test_an_aircraft_below_the_seas_level_has_a_weight() -> None:
    assert math.isfinite(sum(off_m(estimated(heard(CROSS, altitude_ft=-900.0)))))


def test_an_aircraft_far_from_the_others_is_left_out() -> None:
    places = [(1000.0 * math.cos(angle), 1000.0 * math.sin(angle)) for angle in range(8)]
    estimate = estimated(heard([*places, (300_000.0, 0.0)]))
    assert estimate.rejected_outliers == 1
    assert "000008" not in estimate.used_icaos
    assert math.hypot(*off_m(estimate)) < 1000
    others = estimated(heard(places))
    assert others.confidence - estimate.confidence == pytest.approx(0.15 * (1 - 8 / 9), abs=1e-4)


def test_all_are_kept_if_fewer_than_four_would_remain() -> None:
    estimate = estimated(heard([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (300_000.0, 0.0)]))
    assert estimate.rejected_outliers == 0
    assert len(estimate.used_icaos) == 4


def test_three_aircraft_are_too_few() -> None:
    assert estimate_receiver(heard(CROSS)[:3], 0.0, MODE) is None
    assert estimate_receiver([], 0.0, MODE) is None


@pytest.mark.parametrize(("age_s", "enough"), [(15.0, True), (15.1, False), (-15.1, False)])
def test_stale_aircraft_do_not_count(age_s: float, enough: bool) -> None:
    reports = heard(CROSS)
    estimate = estimate_receiver([replace(reports[0], t_s=-age_s), *reports[1:]], 0.0, MODE)
    assert (estimate is not None) is enough


def test_the_date_line_is_no_border() -> None:
    middle = GeodeticPoint(10.0, 179.99)
    assert off_m(estimated(heard(CROSS, middle)), middle) == pytest.approx([0, 0], abs=0.1)


def test_the_ellipsoid_gives_nearly_the_same() -> None:
    exact = estimate_receiver(heard(CROSS), 0.0)
    assert exact is not None
    assert off_m(exact) == pytest.approx([0, 0], abs=10)
    assert exact.sigma_major_m == pytest.approx(estimated(heard(CROSS)).sigma_major_m, rel=0.01)


def test_the_first_estimate_is_taken_as_it_is() -> None:
    first = ReceiverFilter(MODE).update(at(0.0, 3000.0, sigma_major_m=4000.0))
    assert off_m(first) == pytest.approx([3000, 0])
    assert first.radius_m == pytest.approx(8000)
    assert first.nis is None
    assert first.accepted


@pytest.mark.parametrize(("dt_s", "step_s"), [(5.0, 5.0), (0.0, 0.1), (-7.0, 0.1), (1000.0, 30.0)])
def test_the_second_estimate_follows_the_equations(dt_s: float, step_s: float) -> None:
    tracker, shift_m = ReceiverFilter(MODE), 400.0
    tracker.update(at(0.0, 0.0))
    second = tracker.update(at(dt_s, shift_m, sigma_major_m=2000.0))
    noise = 2000.0**2
    spread = 1000.0**2 + step_s**2 * 2500 + 1.5**2 * step_s**4 / 4
    gain = spread / (spread + noise)
    assert off_m(second) == pytest.approx([gain * shift_m, 0], abs=1e-6)
    assert second.nis == pytest.approx(shift_m**2 / (spread + noise), rel=1e-6)
    assert second.radius_m == pytest.approx(max(1000.0, 2 * math.sqrt((1 - gain) * spread)), rel=1e-9)


def test_the_noise_and_the_radius_have_floors() -> None:
    tracker = ReceiverFilter(MODE)
    assert tracker.update(at(0.0, 0.0, sigma_major_m=1.0)).radius_m == 1000.0
    # Four sigma of a floor of 100 m are within the gate; of 1 m they would be far outside.
    assert tracker.update(at(0.1, 400.0, sigma_major_m=1.0)).accepted


def test_a_jump_is_refused_until_the_filter_is_unsure_enough() -> None:
    tracker = ReceiverFilter(MODE)
    for index in range(6):
        tracker.update(at(5.0 * index, 0.0))
    refused = tracker.update(at(30.0, 50_000.0))
    assert refused.nis is not None
    assert refused.nis > 9.21
    assert not refused.accepted
    assert abs(off_m(refused)[0]) < 500
    assert any(tracker.update(at(30.0 + 30 * index, 50_000.0)).accepted for index in range(1, 20))


def test_a_receiver_that_moves_is_followed() -> None:
    tracker = ReceiverFilter(MODE)
    for index in range(60):
        last = tracker.update(at(5.0 * index, 20.0 * 5 * index, sigma_major_m=100.0))
    assert last.accepted
    assert off_m(last)[0] == pytest.approx(20.0 * 5 * 59, abs=5)


def test_the_record_has_its_keys() -> None:
    raw, tracker = estimated(heard(CROSS)), ReceiverFilter(MODE)
    first = receiver_record(raw, tracker.update(raw))
    assert first["kf_nis"] is None
    record = receiver_record(raw, tracker.update(replace(raw, t_s=5.0)))
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert list(record) == [
        "raw_lat",
        "raw_lon",
        "kf_lat",
        "kf_lon",
        "lat",
        "lon",
        "kf_radius_km",
        "kf_nis",
        "kf_update_accepted",
        "sigma_major_km",
        "sigma_minor_km",
        "confidence",
        "used_icaos",
        "aircraft_used",
        "rejected_outliers",
    ]
    assert (record["lat"], record["lon"]) == (record["kf_lat"], record["kf_lon"])
    assert record["kf_update_accepted"] is True
    assert record["sigma_major_km"] == pytest.approx(math.sqrt(50), rel=1e-6)
    assert record["aircraft_used"] == 4
