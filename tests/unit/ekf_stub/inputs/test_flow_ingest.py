# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which measurements of optical flow are taken, and as what."""

import math
from typing import Any

import numpy as np
import pytest

from ekf_stub.filter.inertial import InertialDelta
from ekf_stub.inputs.flow_ingest import FlowIngest, FlowMeasurement, FlowSample

DELTA = InertialDelta(np.zeros(3), np.array([0.0, 0.0, 0.005]), 0.0025, 0.0025)
GOOD = FlowMeasurement(80, (0.3, -0.2), (0.1, 0.05), (0.1, 0.0, 0.05))


def write(ingest: FlowIngest, now_ms: int, horizon_ms: int = 0, **changes: Any) -> bool:
    return ingest.write(GOOD._replace(**changes), DELTA, now_ms, horizon_ms, 10)


def test_measurement_waits_until_the_horizon_has_its_middle() -> None:
    ingest = FlowIngest(3)
    assert ingest.received_ms is None
    assert write(ingest, 1000)
    assert ingest.received_ms is not None
    assert ingest.recall(933) is None
    sample = ingest.recall(934)
    assert sample is not None
    assert (sample.flow, sample.offset) == ((-0.3, 0.2), (0.1, 0.0, 0.05))
    assert sample.flow_comp == pytest.approx((-0.2, 0.25))
    assert sample.body_rate == pytest.approx((0.1, 0.05, 2.0))


def test_time_is_not_before_the_horizon() -> None:
    ingest = FlowIngest(3)
    write(ingest, 1000, horizon_ms=960)
    assert ingest.recall(959) is None
    assert ingest.recall(960) is not None


def test_one_that_comes_too_soon_is_not_taken() -> None:
    ingest = FlowIngest(3)
    write(ingest, 1000)
    assert not write(ingest, 1049)
    assert write(ingest, 1050)


@pytest.mark.parametrize("change", [
    {"quality": 0},
    {"flow": (4.2, 0.0)},
    {"gyro": (0.0, -4.2)},
    {"flow": (math.nan, 0.0)},
    {"gyro": (0.0, math.inf)},
    {"offset": (0.0, math.nan, 0.0)},
])  # fmt: skip
def test_bad_one_comes_in_but_is_not_kept(change: dict[str, Any]) -> None:
    ingest = FlowIngest(3)
    ingest.note_turn(np.zeros(3), 0.1)
    assert write(ingest, 1000, **change)
    assert ingest.received_ms == 1000
    assert ingest.valid_ms == 0
    assert ingest.recall(2000) is None
    write(ingest, 1050)
    sample = ingest.recall(1000)
    assert sample is not None
    assert all(map(math.isfinite, (*sample.flow_comp, *sample.body_rate)))


def sample_of(ingest: FlowIngest, now_ms: int) -> FlowSample:
    write(ingest, now_ms)
    sample = ingest.recall(now_ms)
    assert sample is not None
    return sample


def test_bias_of_its_gyro_is_learned_slowly() -> None:
    ingest = FlowIngest(3)
    ingest.note_turn(np.array([0.002, 0.5, 0.0]), 0.1)
    sample = sample_of(ingest, 1000)
    # a hundredth of the difference to the vehicle's own rate, up to 0.1 rad/s
    assert sample.body_rate[:2] == pytest.approx((0.1 - 0.01 * 0.08, 0.05 + 0.01 * 0.1))
    assert sample.flow_comp == pytest.approx((-0.3 + 0.1 - 0.0008, 0.2 + 0.05 + 0.001))


def test_after_a_short_step_the_vehicle_s_own_turn_gives_the_third_rate() -> None:
    ingest = FlowIngest(3)
    ingest.note_turn(np.array([0.0, 0.0, 0.005]), 0.005)
    assert sample_of(ingest, 1000).body_rate == pytest.approx((0.1, 0.05, 1.0))


def test_it_begins_anew_without_what_it_had() -> None:
    ingest = FlowIngest(3)
    write(ingest, 1000)
    ingest.reset(5000)
    assert ingest.received_ms is None
    assert ingest.valid_ms == 5000
    assert ingest.recall(5000) is None


def test_without_a_sensor_at_the_start_nothing_waits() -> None:
    ingest = FlowIngest(0)
    assert write(ingest, 1000)
    assert ingest.valid_ms == 1000
    assert ingest.recall(1000) is None
