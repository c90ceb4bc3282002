# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Source sets: which yaw is in use, and when a camera that is not in use is aligned to the AHRS."""

from collections.abc import Callable

import pytest

from ekf_stub.ahrs.sources import ROWS, SourceXY, SourceYaw, SourceZ
from ekf_stub.core.params import EkfSources
from ekf_stub.release import JULY_2025, STABLE_4_6

# A second set with external navigation for everything.
SECOND = {"SRC2_POSXY": SourceXY.EXTNAV, "SRC2_POSZ": SourceZ.EXTNAV}


def sources(**params: int) -> EkfSources:
    return EkfSources(lambda name: params.get(name, 0))


@pytest.mark.parametrize("what", ROWS)
def test_row_of_a_set_is_told_by_its_name(what: str) -> None:
    assert sources(**{f"SRC3_{what}": 6}).value(2, what) == 6
    assert sources(**{f"SRC3_{what}": 6}).value(1, what) == 0


def test_first_set_is_active_at_first() -> None:
    assert sources(SRC1_YAW=1, SRC2_YAW=6).yaw() == SourceYaw.COMPASS


def test_yaw_is_that_of_the_active_set() -> None:
    choice = sources(SRC1_YAW=1, SRC2_YAW=6)
    choice.active_set = 1
    assert choice.yaw() == SourceYaw.EXTNAV


def test_parameters_are_read_as_they_are_first_asked_for_and_when_they_may_have_changed() -> None:
    params = {"SRC1_YAW": 1}
    choice = EkfSources(lambda name: params.get(name, 0))
    params["SRC1_YAW"] = 6
    assert choice.yaw() == SourceYaw.EXTNAV
    params["SRC1_YAW"] = 2
    assert choice.yaw() == SourceYaw.EXTNAV
    choice.forget()
    assert choice.yaw() == SourceYaw.GPS


class Counted:
    """Parameters that are counted when they are asked for, and that tell of changes."""

    def __init__(self, **params: int) -> None:
        self.params = params
        self.listeners: list[Callable[[], None]] = []
        self.asked = 0

    def get(self, name: str) -> int:
        self.asked += 1
        return self.params.get(name, 0)

    def set(self, name: str, value: int) -> None:
        self.params[name] = value
        for listener in self.listeners:
            listener()

    def sources(self) -> EkfSources:
        sources = EkfSources(self.get)
        self.listeners.append(sources.forget)
        return sources


def test_known_parameters_are_not_asked_for_again() -> None:
    params = Counted(SRC1_YAW=1, SRC1_POSXY=SourceXY.GPS, **SECOND)
    choice = params.sources()
    first = choice.yaw(), choice.uses_vel_xy(SourceXY.GPS), choice.position_alignment(JULY_2025)
    asked = params.asked
    assert (choice.yaw(), choice.uses_vel_xy(SourceXY.GPS), choice.position_alignment(JULY_2025)) == first
    assert params.asked == asked


def test_changed_parameters_count_at_once() -> None:
    params = Counted(SRC1_YAW=1, SRC1_POSXY=SourceXY.GPS, **SECOND)
    choice = params.sources()
    assert (choice.yaw(), choice.position_alignment(JULY_2025)) == (SourceYaw.COMPASS, (True, False))
    params.set("SRC1_YAW", SourceYaw.EXTNAV)
    params.set("SRC1_POSXY", SourceXY.EXTNAV)
    assert (choice.yaw(), choice.position_alignment(JULY_2025)) == (SourceYaw.EXTNAV, (False, False))


def test_another_set_counts_at_once_though_no_parameter_changed() -> None:
    choice = Counted(SRC1_POSXY=SourceXY.GPS, **SECOND).sources()
    assert choice.position_alignment(JULY_2025) == (True, False)
    choice.active_set = 1
    assert choice.position_alignment(JULY_2025) == (False, False)


@pytest.mark.parametrize(("source", "aligned"), [
    (SourceXY.NONE, False),
    (SourceXY.GPS, True),
    (SourceXY.BEACON, True),
    (SourceXY.OPTFLOW, False),
    (SourceXY.EXTNAV, False),
    (SourceXY.WHEEL_ENCODER, False),
])  # fmt: skip
def test_horizontal_alignment_by_the_active_position_source(source: SourceXY, aligned: bool) -> None:
    assert sources(SRC1_POSXY=source, **SECOND).position_alignment(JULY_2025)[0] is aligned


@pytest.mark.parametrize(("source", "aligned"), [
    (SourceZ.NONE, False),
    (SourceZ.BARO, True),
    (SourceZ.RANGEFINDER, True),
    (SourceZ.GPS, True),
    (SourceZ.BEACON, True),
    (SourceZ.EXTNAV, False),
])  # fmt: skip
def test_vertical_alignment_by_the_active_height_source(source: SourceZ, aligned: bool) -> None:
    assert sources(SRC1_POSZ=source, **SECOND).position_alignment(JULY_2025)[1] is aligned


def test_nothing_is_aligned_when_no_set_has_external_navigation() -> None:
    assert sources(SRC1_POSXY=3, SRC1_POSZ=1).position_alignment(JULY_2025) == (False, False)


@pytest.mark.parametrize("index", [2, 3])
def test_any_set_with_external_navigation_counts(index: int) -> None:
    params = {"SRC1_POSXY": 3, "SRC1_POSZ": 1, f"SRC{index}_POSXY": 6, f"SRC{index}_POSZ": 6}
    assert sources(**params).position_alignment(JULY_2025) == (True, True)


def test_set_in_use_decides() -> None:
    choice = sources(SRC1_POSXY=3, SRC1_POSZ=1, **SECOND)
    choice.active_set = 1
    assert choice.position_alignment(JULY_2025) == (False, False)


@pytest.mark.parametrize(("options", "position", "aligned"), [
    (2, SourceXY.NONE, True),
    (2, SourceXY.OPTFLOW, True),
    (0, SourceXY.NONE, False),
    (1, SourceXY.NONE, False),
    (3, SourceXY.NONE, True),
    (2, SourceXY.EXTNAV, False),
])  # fmt: skip
def test_flying_by_optical_flow_aligns_when_asked_to(options: int, position: SourceXY, aligned: bool) -> None:
    params = {"SRC1_POSXY": position, "SRC1_VELXY": SourceXY.OPTFLOW, "SRC_OPTIONS": options, **SECOND}
    assert sources(**params).position_alignment(JULY_2025)[0] is aligned


def test_option_for_optical_flow_takes_optical_flow() -> None:
    assert not sources(SRC1_VELXY=SourceXY.GPS, SRC_OPTIONS=2, **SECOND).position_alignment(JULY_2025)[0]


# What a source is used for


@pytest.mark.parametrize(("options", "used"), [(0, False), (1, True), (2, False)])
def test_velocity_of_another_set_is_used_when_all_are_to_be_fused(options: int, used: bool) -> None:
    choice = sources(SRC2_VELXY=SourceXY.EXTNAV, SRC3_VELZ=SourceZ.EXTNAV, SRC_OPTIONS=options)
    assert choice.uses_vel_xy(SourceXY.EXTNAV) is used
    assert choice.uses_vel_z(SourceZ.EXTNAV) is used


def test_velocity_is_that_of_the_active_set() -> None:
    choice = sources(SRC1_VELXY=SourceXY.EXTNAV, SRC2_VELXY=SourceXY.GPS, SRC1_VELZ=SourceZ.GPS)
    assert choice.uses_vel_xy(SourceXY.EXTNAV)
    assert choice.uses_vel_z(SourceZ.GPS)
    choice.active_set = 1
    assert not choice.uses_vel_xy(SourceXY.EXTNAV)
    assert not choice.uses_vel_z(SourceZ.GPS)


def test_position_and_height_are_those_of_the_active_set() -> None:
    choice = sources(SRC1_POSXY=3, SRC1_POSZ=1, **SECOND)
    assert (choice.pos_xy(), choice.pos_z()) == (SourceXY.GPS, SourceZ.BARO)
    choice.active_set = 1
    assert (choice.pos_xy(), choice.pos_z()) == (SourceXY.EXTNAV, SourceZ.EXTNAV)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("what", ["POSXY", "VELXY", "POSZ", "VELZ", "YAW"])
def test_external_navigation_may_be_named_anywhere(number: int, what: str) -> None:
    assert sources(**{f"SRC{number}_{what}": 6}).ext_nav_enabled()
    assert not sources(**{f"SRC{number}_{what}": 3}).ext_nav_enabled()


@pytest.mark.parametrize(("params", "used"), [
    ({"SRC1_POSXY": 3}, True),
    ({"SRC1_VELZ": 3}, True),
    ({"SRC1_YAW": SourceYaw.GSF}, True),
    ({"SRC1_YAW": SourceYaw.GPS}, False),
    ({"SRC1_YAW": SourceYaw.GPS_COMPASS_FALLBACK}, False),
    ({"SRC2_POSXY": 3}, False),
])  # fmt: skip
def test_gps_is_used_by_the_active_set(params: dict[str, int], used: bool) -> None:
    assert sources(**params).uses_gps() is used


EACH = {"SRC_OPTIONS": 8, "SRC1_POSXY": 3, "SRC1_YAW": 1, **SECOND, "SRC2_YAW": 6}


def test_each_core_has_the_set_of_its_number_from_2025_07_on() -> None:
    choice = sources(**EACH)
    choice.active_set = 1
    cores = [choice.of_core(core, JULY_2025) for core in range(4)]
    assert [core.yaw() for core in cores] == [SourceYaw.COMPASS, SourceYaw.EXTNAV, SourceYaw.NONE, SourceYaw.EXTNAV]
    assert [core.pos_xy() for core in cores[:2]] == [SourceXY.GPS, SourceXY.EXTNAV]
    assert [core.active_set for core in cores] == [1] * 4
    assert [choice.of_core(core, STABLE_4_6).yaw() for core in range(3)] == [SourceYaw.EXTNAV] * 3


def test_camera_that_any_core_uses_is_not_aligned() -> None:
    assert sources(**EACH).position_alignment(JULY_2025) == (False, False)
    both = {f"SRC{index}_{row}": value for index in (1, 2) for row, value in (("POSXY", 3), ("POSZ", 1))}
    third = {"SRC3_POSXY": 6, "SRC3_POSZ": 6}
    assert sources(**both, **third).position_alignment(JULY_2025) == (True, True)
    assert sources(**both, **third, SRC_OPTIONS=8).position_alignment(JULY_2025) == (False, False)
    assert sources(**both, **third, SRC_OPTIONS=8).position_alignment(STABLE_4_6) == (True, True)


@pytest.mark.parametrize(("aligns_source_in_use", "is_aligned"), [(False, False), (True, True)])
def test_camera_that_is_in_use_is_aligned_to_flow_up_to_4_6(aligns_source_in_use: bool, is_aligned: bool) -> None:
    choice = sources(SRC1_POSXY=SourceXY.EXTNAV, SRC1_VELXY=SourceXY.OPTFLOW, SRC_OPTIONS=2)
    assert choice.position_alignment(STABLE_4_6 if aligns_source_in_use else JULY_2025)[0] is is_aligned


@pytest.mark.parametrize(
    ("params", "has_one"),
    [
        ({"SRC1_VELZ": 3}, True),
        ({"SRC2_VELZ": 3}, False),
        ({"SRC2_VELZ": 3, "SRC_OPTIONS": 1}, True),
        ({"SRC_OPTIONS": 1}, False),
    ],
)
def test_source_of_vertical_velocity_may_be_of_any_set_if_the_option_says_so(
    params: dict[str, int], has_one: bool
) -> None:
    assert sources(**params).has_vel_z() is has_one
