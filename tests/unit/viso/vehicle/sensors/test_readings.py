# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow sensors are read ten times per second, as in recordings, and an ideal compass knows where north is."""

import math

import numpy as np
import pytest

from ap_core.declination import get_declination_rad
from ekf_stub.core.vectors import quat_of_euler
from viso.vehicle.sensors.source import HOME, ideal_field, last_reading_us


@pytest.mark.parametrize(("now_us", "reading_us"), [
    (0, None),
    (50_000, None),
    (50_001, 50_000),
    (150_000, 50_000),
    (150_001, 150_000),
    (3_551_912, 3_550_000),
    (1 << 42, 4_398_046_450_000),
])  # fmt: skip
def test_reading_is_seen_in_the_pass_after_it(now_us: int, reading_us: int | None) -> None:
    assert last_reading_us(now_us) == reading_us


def test_field_is_that_of_recordings() -> None:
    recorded = [232.17318726, 52.73749542, -528.91168213]
    assert ideal_field(HOME, quat_of_euler(0, 0, 0)) == pytest.approx(recorded, rel=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_field_tells_the_heading(yaw: float) -> None:
    ahead, right, _ = ideal_field(HOME, quat_of_euler(0, 0, yaw))
    assert math.atan2(-right, ahead) + get_declination_rad(HOME) == pytest.approx(yaw, abs=1e-6)


def test_field_is_exact_in_single_precision() -> None:
    field = ideal_field(HOME, quat_of_euler(0.1, 0.2, 0.3))
    assert np.array_equal(field, field.astype(np.float32))
