# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Source sets that make no sense, or lack a sensor, keep the vehicle from arming."""

import pytest

from ekf_stub.ahrs.sources import ROWS, SENSORS, source_failure
from ekf_stub.core.params import EkfSources

LEGAL = {
    "POSXY": {0, 3, 4, 6},
    "VELXY": {0, 3, 5, 6, 7},
    "POSZ": {0, 1, 2, 3, 4, 6},
    "VELZ": {0, 3, 6},
    "YAW": {0, 1, 2, 3, 6, 8},
}
POSITION_ROWS = ROWS[:-1]


def failure(*absent: str, **params: int) -> str | None:
    sources = EkfSources(lambda name: params.get(name, 0))
    return source_failure(sources, lambda sensor: sensor not in absent, requires_position=True)


def failure_without_position(**params: int) -> str | None:
    sources = EkfSources(lambda name: params.get(name, 0))
    return source_failure(sources, lambda _sensor: True, requires_position=False)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("what", ROWS)
def test_illegal_values_are_refused_in_every_set(number: int, what: str) -> None:
    values = range(-1, 10)
    failures = {value: failure(**{f"SRC{number}_{what}": value}) for value in values}
    refused = f"Check EK3_SRC{number}_{what}"
    assert failures == {value: None if value in LEGAL[what] else refused for value in values}


@pytest.mark.parametrize("what", POSITION_ROWS)
def test_only_yaw_is_looked_at_when_no_position_is_required(what: str) -> None:
    assert failure_without_position(**{f"SRC1_{what}": 9}) is None
    assert failure_without_position(SRC1_YAW=9) == "Check EK3_SRC1_YAW"


@pytest.mark.parametrize(("what", "value", "sensor"), [
    ("POSXY", 3, "GPS"),
    ("POSXY", 4, "Beacon"),
    ("POSXY", 6, "VisualOdom"),
    ("VELXY", 3, "GPS"),
    ("VELXY", 5, "OpticalFlow"),
    ("VELXY", 6, "VisualOdom"),
    ("VELXY", 7, "WheelEncoder"),
    ("POSZ", 1, "Baro"),
    ("POSZ", 2, "RangeFinder"),
    ("POSZ", 3, "GPS"),
    ("POSZ", 4, "Beacon"),
    ("POSZ", 6, "VisualOdom"),
    ("VELZ", 3, "GPS"),
    ("VELZ", 6, "VisualOdom"),
    ("YAW", 3, "Compass"),
    ("YAW", 6, "VisualOdom"),
    ("YAW", 8, "GPS"),
])  # fmt: skip
def test_source_takes_its_sensor(what: str, value: int, sensor: str) -> None:
    params = {f"SRC3_{what}": value}
    assert failure(sensor, **params) == f"EK3 sources require {sensor}"
    assert failure(*(other for other in SENSORS if other != sensor), **params) is None


@pytest.mark.parametrize("yaw", [1, 2])
def test_compass_and_gps_yaw_take_no_sensor(yaw: int) -> None:
    assert failure(*SENSORS, SRC1_YAW=yaw) is None


def test_illegal_value_of_a_later_set_goes_before_an_absent_sensor() -> None:
    assert failure("GPS", SRC1_POSXY=3, SRC3_YAW=9) == "Check EK3_SRC3_YAW"


def test_first_row_of_a_set_goes_before_the_others() -> None:
    assert failure(SRC1_VELZ=9, SRC1_VELXY=4, SRC1_YAW=9) == "Check EK3_SRC1_VELXY"


def test_sensors_are_looked_for_in_the_firmwares_order() -> None:
    assert failure(*SENSORS, SRC1_POSXY=6, SRC2_POSXY=3, SRC1_POSZ=2) == "EK3 sources require GPS"
