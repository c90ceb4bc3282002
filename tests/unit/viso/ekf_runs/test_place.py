# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log says about the magnetic field at its origin."""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from viso.ekf_runs.place import declination_of, field_of

DECLINATION = 0.2234


class Log:
    """Records that are read as those of a log are."""

    def __init__(self, *records: tuple[str, dict[str, Any]]) -> None:
        self._records = [SimpleNamespace(get_type=lambda kind=kind: kind, **fields) for kind, fields in records]
        self.rewind()

    def rewind(self) -> None:
        self._left = iter(self._records)

    def recv_match(self, type: str | Sequence[str]) -> Any:
        kinds = (type,) if isinstance(type, str) else type
        return next((record for record in self._left if record.get_type() in kinds), None)


def estimate(time_us: int, north: int, east: int, down: int) -> tuple[str, dict[str, Any]]:
    return "XKF2", {"TimeUS": time_us, "MN": north, "ME": east, "MD": down}


def say(time_us: int, message: str) -> tuple[str, dict[str, Any]]:
    return "MSG", {"TimeUS": time_us, "Message": message}


def test_declination_is_the_first_that_the_compasses_are_given() -> None:
    log = Log(("RMGH", {"Dec": 0.0}), ("RMGH", {"Dec": DECLINATION}), ("RMGH", {"Dec": 0.3}))
    assert declination_of(log) == DECLINATION
    assert declination_of(log) == DECLINATION  # the log stands at its beginning again
    assert declination_of(Log()) is None


def test_field_is_that_of_the_first_estimates_with_an_origin() -> None:
    log = Log(
        estimate(1_000_000, 230, 0, -532),
        say(2_000_000, "EKF3 IMU0 origin set"),
        estimate(2_100_000, 230, 0, -532),  # of a core that has none yet
        say(2_200_000, "EKF3 IMU1 origin set"),
        estimate(2_600_000, 232, 52, -528),
        estimate(2_700_000, 240, 60, -500),
    )
    field = field_of(log, DECLINATION)
    assert field is not None
    assert math.hypot(*field[:2]) == pytest.approx(math.hypot(0.2325, 0.0525))
    assert math.atan2(field[1], field[0]) == pytest.approx(DECLINATION)
    assert field[2] == pytest.approx(-0.5285)


@pytest.mark.parametrize(
    ("declination", "message"), [(None, "EKF3 IMU0 origin set"), (DECLINATION, "EKF3 IMU0 initialised")]
)
def test_field_is_not_known_without_declination_or_origin(declination: float | None, message: str) -> None:
    log = Log(say(1_000_000, message), estimate(9_000_000, 232, 52, -528))
    assert field_of(log, declination) is None
