# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log says about the magnetic field at its origin."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from viso.replay.ekf.inputs import declination_of, field_of

DECLINATION = 0.2234


Record = tuple[str, dict[str, Any]]


def log(*records: Record) -> list[Any]:
    return [SimpleNamespace(get_type=lambda kind=kind: kind, **fields) for kind, fields in records]


def estimate(time_us: int, north: int, east: int, down: int) -> Record:
    return "XKF2", {"TimeUS": time_us, "MN": north, "ME": east, "MD": down}


def say(time_us: int, message: str) -> Record:
    return "MSG", {"TimeUS": time_us, "Message": message}


def test_declination_is_the_first_that_the_compasses_are_given() -> None:
    records = log(("RMGH", {"Dec": 0.0}), ("RMGH", {"Dec": DECLINATION}), ("RMGH", {"Dec": 0.3}))
    assert declination_of(records) == DECLINATION
    assert declination_of(log()) is None


def test_field_is_that_of_the_first_estimates_with_an_origin() -> None:
    records = log(
        estimate(1_000_000, 230, 0, -532),
        say(2_000_000, "EKF3 IMU0 origin set"),
        estimate(2_100_000, 230, 0, -532),  # of a core that has none yet
        say(2_200_000, "EKF3 IMU1 origin set"),
        estimate(2_600_000, 232, 52, -528),
        estimate(2_700_000, 240, 60, -500),
    )
    field = field_of(records, DECLINATION)
    assert field is not None
    assert math.hypot(*field[:2]) == pytest.approx(math.hypot(0.2325, 0.0525))
    assert math.atan2(field[1], field[0]) == pytest.approx(DECLINATION)
    assert field[2] == pytest.approx(-0.5285)


@pytest.mark.parametrize(
    ("declination", "message"), [(None, "EKF3 IMU0 origin set"), (DECLINATION, "EKF3 IMU0 initialised")]
)
def test_field_is_not_known_without_declination_or_origin(declination: float | None, message: str) -> None:
    records = log(say(1_000_000, message), estimate(9_000_000, 232, 52, -528))
    assert field_of(records, declination) is None
