# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's parameter tables."""

import pytest

from ap_core.param import Param, ParamGroup, ParamInfo, ParamTable, ParamType
from emulator.parameters import MAX_LINKS, STREAM_NAMES, make_groups

VISO = (ParamInfo("_TYPE", ParamType.INT8, 0, "backend"),)


def found(table: ParamTable, name: str) -> Param:
    param = table.find(name)
    assert param is not None
    return param


@pytest.fixture
def table() -> ParamTable:
    return ParamTable(make_groups(2))


def test_format_version_comes_first(table: ParamTable) -> None:
    first = table.by_index(0)
    assert first is not None
    assert (first.name, float(first.value), first.type) == ("FORMAT_VERSION", 120.0, ParamType.INT16)


@pytest.mark.parametrize(
    ("name", "kind", "value"),
    [
        ("MAV_SYSID", ParamType.INT16, 1),
        ("MAV_GCS_SYSID", ParamType.INT16, 255),
        ("MAV_OPTIONS", ParamType.INT16, 0),
        ("MAV_TELEM_DELAY", ParamType.INT8, 0),
        ("SERIAL0_BAUD", ParamType.INT32, 115),
        ("SERIAL0_PROTOCOL", ParamType.INT8, 2),
        ("LOG_BITMASK", ParamType.INT32, 180222),
        ("LOG_DISARMED", ParamType.INT8, 1),
        ("LOG_FILE_MB_FREE", ParamType.INT16, 500),
        ("ARMING_CHECK", ParamType.INT32, 1),
        ("AHRS_EKF_TYPE", ParamType.INT8, 3),
        ("AHRS_TRIM_Z", ParamType.FLOAT, 0),
        ("BRD_RTC_TYPES", ParamType.INT8, 1),
        ("DISARM_DELAY", ParamType.INT8, 10),
        ("FRAME_CLASS", ParamType.INT8, 1),
        ("GPS1_TYPE", ParamType.INT8, 1),
        ("EK3_GLITCH_RAD", ParamType.INT8, 25),
        ("EK3_HGT_DELAY", ParamType.INT16, 60),
        ("EK3_OPTIONS", ParamType.INT32, 0),
        ("EK3_SRC1_POSXY", ParamType.INT8, 3),
        ("EK3_SRC1_YAW", ParamType.INT8, 1),
        ("EK3_SRC2_POSXY", ParamType.INT8, 0),
        ("EK3_SRC3_POSZ", ParamType.INT8, 1),
        ("EK3_SRC_OPTIONS", ParamType.INT16, 0),
        ("EK3_MAG_CAL", ParamType.INT8, 3),
    ],
)
def test_type_and_default(table: ParamTable, name: str, kind: ParamType, value: float) -> None:
    param = found(table, name)
    assert param.type is kind
    assert [float(param.value), float(param.default)] == [value, value]


def test_groups_are_in_the_order_of_a_copter(table: ParamTable) -> None:
    names = [param.name for param in table]
    landmarks = ["LOG_BITMASK", "ARMING_CHECK", "COMPASS_USE", "AHRS_TRIM_X", "GPS1_TYPE", "EK3_ENABLE", "FLOW_TYPE"]
    landmarks += ["FRAME_CLASS", "LOG_BACKEND_TYPE", "SERIAL0_BAUD", "MAV_SYSID", "MAV1_RAW_SENS", "MAV2_OPTIONS"]
    assert sorted(landmarks, key=names.index) == landmarks


def test_visual_odom_is_listed_before_the_log_parameters() -> None:
    table = ParamTable(make_groups(0, ParamGroup("VISO", VISO)))
    names = [param.name for param in table]
    assert names[names.index("LOG_BACKEND_TYPE") - 1] == "VISO_TYPE"


def test_each_link_adds_its_rates_and_options() -> None:
    one, two = ParamTable(make_groups(1)), ParamTable(make_groups(2))
    assert [param.name for param in two][one.count :] == [f"MAV2{name}" for name in (*STREAM_NAMES, "_OPTIONS")]


def test_converted_options_flag_is_readable_but_not_listed(table: ParamTable) -> None:
    assert found(table, "MAV1_OPTIONSCNV").type is ParamType.INT8
    assert "MAV1_OPTIONSCNV" not in [param.name for param in table]


def test_disabled_ekf3_hides_its_other_parameters(table: ParamTable) -> None:
    table.set_from_mavlink("EK3_ENABLE", 0)
    assert [param.name for param in table if param.name.startswith("EK3_")] == ["EK3_ENABLE"]


@pytest.mark.parametrize("name", ["mav_SYSID", "ek3_ENABLE", "ahrs_TRIM_X", "brd_RTC_TYPES", "gps1_TYPE"])
def test_top_level_prefix_is_case_sensitive(table: ParamTable, name: str) -> None:
    assert table.find(name) is None


@pytest.mark.parametrize("name", ["MAV1_extra1", "EK3_src1_posxy", "log_disarmed", "serial0_baud", "BRD_rtc_types"])
def test_the_rest_of_a_name_is_not(table: ParamTable, name: str) -> None:
    assert found(table, name).canonical_name == name.upper()


def test_top_level_parameter_keeps_its_type_in_the_echo_of_a_default(table: ParamTable) -> None:
    assert [echo.wire_type for echo in table.set_from_mavlink("DISARM_DELAY", 10).echoes] == [2]
    assert [echo.wire_type for echo in table.set_from_mavlink("FRAME_CLASS", 1).echoes] == [9]


def test_groups_are_fresh_each_time() -> None:
    ParamTable(make_groups(1)).set("MAV_SYSID", 7)
    assert ParamTable(make_groups(1)).get_int("MAV_SYSID") == 1


def test_every_row_says_what_it_is(table: ParamTable) -> None:
    assert all(row.description for group in table.groups for row in group.var_info)


def test_more_links_than_the_firmware_has_is_an_error() -> None:
    with pytest.raises(ValueError, match="link 9"):
        make_groups(MAX_LINKS + 1)
