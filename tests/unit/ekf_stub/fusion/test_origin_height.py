# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How GPS tells the height of the origin, and what becomes of it."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.fusion.measurements import BaroSample
from ekf_stub.fusion.origin_height import OriginHeight
from ekf_stub.inputs.gps_reading import CENTI, GpsFix

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

NOW_MS = 50_000
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)


def corrected(*, is_good: bool = True, innovation_m: float = 2.0) -> OriginHeight:
    height = OriginHeight()
    height.put(58_400)
    height.variance = 1.0
    height.correct(NOW_MS, innovation_m, 3.0, drift_m_s=0.0, is_good=is_good)
    return height


def test_height_follows_gps_by_what_both_are_worth() -> None:
    height = corrected()
    assert height.reference_m == pytest.approx(CENTI * 58_400 - 0.25 * 2.0)
    assert height.variance == pytest.approx(0.75)
    assert height.excess_m == pytest.approx(-0.5, abs=1e-6)


def test_height_drifts_for_no_more_than_a_second() -> None:
    height = OriginHeight()
    height.correct(NOW_MS, 0.0, 3.0, drift_m_s=0.5, is_good=False)
    assert height.variance == pytest.approx(0.25)
    height.correct(NOW_MS + 100, 0.0, 3.0, drift_m_s=0.5, is_good=False)
    assert height.variance == pytest.approx(0.25 + 0.05**2)


@pytest.mark.parametrize(("is_good", "innovation_m"), [(False, 2.0), (True, 10.1)])
def test_gps_that_is_bad_or_far_off_is_not_believed(is_good: bool, innovation_m: float) -> None:
    assert corrected(is_good=is_good, innovation_m=innovation_m).excess_m == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("mask", "excess_m", "down"), [(0, 0.0, -7.0), (1, -1.0, -7.0), (2, 0.0, -7.0), (5, -1.0, -6.0)]
)
def test_gps_corrects_the_origin_or_the_heights_of_the_barometer(
    make_parts: MakeParts, mask: int, excess_m: float, down: float
) -> None:
    parts = make_parts("33131", OGN_HGT_MASK=mask)
    parts.ingest.horizon_ms = NOW_MS
    parts.origin_height.variance = 1e6
    parts.gps.delayed, parts.gps.is_due, parts.gps.accuracy_good = (
        GpsFix(NOW_MS, np.array([0.0, 0.0, 1.0]), np.zeros(3), False, None),
        True,
        True,
    )
    parts.height.baro.push(BaroSample(NOW_MS, 7.0))
    parts.height.select(NOW_MS, FLYING)
    assert parts.origin_height.excess_m == pytest.approx(excess_m, abs=1e-4)
    assert parts.height.down == pytest.approx(down, abs=1e-4)
