# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A parameter that asks for what the filter does not do is told of, others not."""

import pytest

from tests.places import ROOT
from viso.parameters.left_out import LEFT_OUT, left_out
from viso.vehicle.vehicle import Vehicle, VehicleConfig


@pytest.mark.parametrize(("name", "value", "line"), [
    ("EK3_SRC1_POSXY", 4, "EK3_SRC1_POSXY is 4: range beacons are not fused here"),
    ("EK3_SRC3_VELZ", 4, "EK3_SRC3_VELZ is 4: range beacons are not fused here"),
    ("BCN_TYPE", 1, "BCN_TYPE is 1: range beacons are not fused here"),
    ("EK3_DRAG_MCOEF", 0.25, "EK3_DRAG_MCOEF is 0.25: drag is not fused, and wind not estimated here"),
    ("ARSPD_TYPE", 2, "ARSPD_TYPE is 2: airspeed is not fused here"),
    ("EK3_SRC2_VELXY", 7, "EK3_SRC2_VELXY is 7: wheel encoders are not fused here"),
    ("EAHRS_TYPE", 1, "EAHRS_TYPE is 1: there is no External AHRS here"),
    ("AHRS_EKF_TYPE", 11, "AHRS_EKF_TYPE is 11: there is no External AHRS here"),
    ("EK3_SRC2_YAW", 3, "EK3_SRC2_YAW is 3: a compass does not take over from a GPS that has lost its yaw"),
    ("EK3_MAG_MASK", 1, "EK3_MAG_MASK is 1: EK3_MAG_CAL alone says when three axes of a compass are fused here"),
    ("EK2_ENABLE", 1, "EK2_ENABLE is 1: there is no EKF2 here"),
    ("SIM_WIND_SPD", 5, "SIM_WIND_SPD is 5: there is no wind here"),
    ("FENCE_ENABLE", 1, "FENCE_ENABLE is 1: the vehicle does not keep to fences here"),
])  # fmt: skip
def test_what_asks_in_vain_is_told(name: str, value: float, line: str) -> None:
    assert left_out({"VISO_TYPE": 1.0, name: value}) == (line,)


def test_nothing_is_told_of_what_asks_for_nothing() -> None:
    assert left_out({"EK3_SRC1_POSXY": 6.0, "BCN_TYPE": 0.0, "EK3_DRAG_BCOEF_X": 0.0, "ARSPD_TYPE": 0.0}) == ()


def test_readme_names_all_of_it() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [row.what for row in LEFT_OUT if row.what not in readme.replace("\n", " ")] == []


def test_doctor_asks_for_what_the_estimator_lacks() -> None:
    params = {"FENCE_ENABLE": 1.0, "BCN_TYPE": 1.0}
    assert left_out(params, of_estimator=True) == ("BCN_TYPE is 1: range beacons are not fused here",)


def test_vehicle_says_so_as_it_boots() -> None:
    vehicle = Vehicle(VehicleConfig(defaults={"EK3_SRC2_POSZ": 4, "ARSPD_TYPE": 1}))
    said: list[tuple[int, str]] = []
    vehicle.texts.on_text.append(lambda severity, text: said.append((severity, text)))
    vehicle.advance(range(2_455_000, 2_455_001))
    assert [text for severity, text in said if severity == 4] == [
        "EK3_SRC2_POSZ is 4: range beacons are not fused here",
        "ARSPD_TYPE is 1: airspeed is not fused here",
    ]
