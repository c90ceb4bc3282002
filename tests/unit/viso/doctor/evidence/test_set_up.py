# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a stream is tried with where the release that flew had not what there is now."""

import pytest

from viso.doctor.evidence.set_up import SetUp, choose_set_up
from viso.doctor.evidence.vehicle_data import VehicleData
from viso.firmware.flown import profile_for, version_in
from viso.streams.stream import Stream

POSES = {"VISION_POSITION_ESTIMATE"}


def set_up(banner: str, recorded: dict[str, float], given: dict[str, float] | None = None) -> SetUp:
    stream = Stream("made", (), recorded)
    return choose_set_up(stream, VehicleData(), given or {}, POSES, profile_for(version_in(banner), ()))


def test_before_4_1_positions_go_to_the_filter_that_there_is() -> None:
    recorded = {"AHRS_EKF_TYPE": 2.0, "EK2_ENABLE": 1.0, "EK3_ENABLE": 0.0, "VISO_TYPE": 0.0, "EK2_ALT_SOURCE": 0.0}
    params = set_up("ArduCopter V4.0.7", recorded).params
    assert (params["VISO_TYPE"], params["AHRS_EKF_TYPE"], params["EK3_ENABLE"]) == (1, 3, 1)
    sources = [params[f"EK3_SRC1_{name}"] for name in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")]
    assert sources == [6, 0, 1, 0, 1]


@pytest.mark.parametrize(("recorded", "name", "value"), [
    ({"EK2_ALT_SOURCE": 4.0}, "EK3_SRC1_POSZ", 6),
    ({"EK2_ALT_SOURCE": 1.0}, "EK3_SRC1_POSZ", 2),
    ({"COMPASS_USE": 0.0}, "EK3_SRC1_YAW", 6),
])  # fmt: skip
def test_height_and_heading_of_before_4_1(recorded: dict[str, float], name: str, value: float) -> None:
    assert set_up("APM:Copter V3.6.2", recorded).params[name] == value


def test_before_4_6_no_quality_withholds_a_sample() -> None:
    found = set_up("ArduCopter V4.5.7", {"VISO_TYPE": 1.0, "EK3_SRC1_POSXY": 6.0})
    assert [one.name for one in found.assumed] == ["VISO_QUAL_MIN"]
    assert found.params["VISO_QUAL_MIN"] == -1
    assert set_up("ArduCopter V4.6.3", {"VISO_TYPE": 1.0}).assumed == ()


def test_what_is_given_wins_over_what_an_older_release_had() -> None:
    found = set_up("ArduCopter V4.0.7", {"VISO_TYPE": 0.0}, {"VISO_TYPE": 2.0, "VISO_QUAL_MIN": 5.0})
    assert (found.params["VISO_TYPE"], found.params["VISO_QUAL_MIN"]) == (2, 5)


def test_estimator_that_took_nothing_before_4_1_stays_told() -> None:
    assert set_up("ArduCopter V4.0.7", {"AHRS_EKF_TYPE": 3.0}).known["AHRS_EKF_TYPE"] == 3
