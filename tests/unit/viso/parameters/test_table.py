# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle's parameter tables."""

import lzma
import math
import re
from pathlib import Path

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.param import Param, ParamGroup, ParamInfo, ParamTable, ParamType
from ap_visualodom.ap_visualodom import make_params
from tests.places import RECORDED
from viso.parameters.releases import JULY_2025, MAX_LINKS, STREAM_NAMES
from viso.parameters.store import MemoryParamStore, ParamStore, StoredParams
from viso.parameters.table import make_groups
from viso.vehicle.vehicle import Vehicle, VehicleConfig

LOG = RECORDED / "logs" / "flight_t265.BIN.xz"
LINKS_OF_THE_LOG = 3
VISO = (ParamInfo("_TYPE", ParamType.INT8, 0, "backend"),)

SET_BY_FILES = r"""(?x)
    FLTMODE[1-5] | FRAME_TYPE | COMPASS_OFS[23]?_[XYZ] | INS_ACC2?(OFFS|SCAL)_[XYZ] | BATT_MONITOR | RC\d+_(MIN|MAX)
    | RC7_OPTION | GPS1_TYPE | EK3_SRC1_(POSXY|VELXY|VELZ) | VISO_(TYPE|DELAY_MS) | LOG_REPLAY | SIM_GPS1_ENABLE
"""
"""What the simulator's file of defaults, and that of the recording, set otherwise than the firmware."""


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


TYPES_AND_DEFAULTS = [
    ("MAV_SYSID", ParamType.INT16, 1),
    ("MAV_GCS_SYSID", ParamType.INT16, 255),
    ("MAV_OPTIONS", ParamType.INT16, 0),
    ("MAV_TELEM_DELAY", ParamType.INT8, 0),
    ("SERIAL0_BAUD", ParamType.INT32, 115),
    ("SERIAL0_PROTOCOL", ParamType.INT8, 2),
    ("LOG_BITMASK", ParamType.INT32, 180222),
    ("LOG_DISARMED", ParamType.INT8, 1),
    ("LOG_FILE_MB_FREE", ParamType.INT16, 500),
    ("ARMING_SKIPCHK", ParamType.INT32, 0),
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
    ("FS_GCS_ENABLE", ParamType.INT8, 0),
    ("FS_THR_ENABLE", ParamType.INT8, 1),
    ("FS_THR_VALUE", ParamType.INT16, 975),
    ("FS_OPTIONS", ParamType.INT32, 16),
    ("FS_GCS_TIMEOUT", ParamType.FLOAT, 5),
    ("FS_DR_ENABLE", ParamType.INT8, 2),
    ("FS_DR_TIMEOUT", ParamType.INT16, 30),
    ("FS_EKF_FILT", ParamType.FLOAT, 5),
    ("FLTMODE1", ParamType.INT8, 0),
    ("FLTMODE6", ParamType.INT8, 0),
    ("FLTMODE_CH", ParamType.INT8, 5),
    ("INITIAL_MODE", ParamType.INT8, 0),
    ("ARMING_ACCTHRESH", ParamType.FLOAT, 0.75),
    ("ARMING_MIS_ITEMS", ParamType.INT32, 0),
    ("ARMING_MAGTHRESH", ParamType.INT16, 100),
    ("ARMING_NEED_LOC", ParamType.INT8, 0),
    ("COMPASS_OFS_X", ParamType.FLOAT, 0),
    ("COMPASS_DEV_ID3", ParamType.INT32, 0),
    ("COMPASS_USE2", ParamType.INT8, 1),
    ("INS_ACCOFFS_Y", ParamType.FLOAT, 0),
    ("INS_ACC_ID", ParamType.INT32, 0),
    ("AHRS_GPS_USE", ParamType.INT8, 1),
    ("AHRS_WIND_MAX", ParamType.INT8, 0),
    ("AHRS_OPTIONS", ParamType.INT16, 0),
    ("BATT_MONITOR", ParamType.INT8, 0),
    ("BRD_RTC_TZ_MIN", ParamType.INT16, 0),
    ("SCHED_LOOP_RATE", ParamType.INT16, 400),
    ("RCMAP_THROTTLE", ParamType.INT8, 3),
    ("RC3_MIN", ParamType.INT16, 1100),
    ("RC4_MAX", ParamType.INT16, 1900),
    ("STAT_BOOTCNT", ParamType.INT16, 0),
    ("STAT_RUNTIME", ParamType.INT32, 0),
    ("STAT_RESET", ParamType.INT32, 1),
    ("LOG_MAV_BUFSIZE", ParamType.INT8, 8),
    ("LOG_FILE_TIMEOUT", ParamType.INT16, 5),
    ("LOG_DARM_RATEMAX", ParamType.FLOAT, 0),
    ("SERIAL1_BAUD", ParamType.INT32, 57),
    ("SERIAL2_PROTOCOL", ParamType.INT8, 2),
    ("SERIAL2_OPTIONS", ParamType.INT32, 0),
]


def test_types_and_defaults(table: ParamTable) -> None:
    params = [found(table, name) for name, _, _ in TYPES_AND_DEFAULTS]
    assert [(param.name, param.type, float(param.value)) for param in params] == TYPES_AND_DEFAULTS
    assert [param.name for param in params if param.default != param.value] == []


def test_groups_are_in_the_order_of_a_copter(table: ParamTable) -> None:
    names = [param.name for param in table]
    landmarks = ["LOG_BITMASK", "ARMING_SKIPCHK", "COMPASS_USE", "AHRS_TRIM_X", "GPS1_TYPE", "EK3_ENABLE", "FLOW_TYPE"]
    landmarks += ["FRAME_CLASS", "LOG_BACKEND_TYPE", "SERIAL0_BAUD", "MAV_SYSID", "MAV1_RAW_SENS", "MAV2_OPTIONS"]
    assert sorted(landmarks, key=names.index) == landmarks


def test_visual_odom_is_listed_before_the_fence_and_the_statistics() -> None:
    table = ParamTable(make_groups(0, ParamGroup("VISO", VISO)))
    names = [param.name for param in table]
    end = names.index("STAT_BOOTCNT")
    assert names[end - 2 : end] == ["VISO_TYPE", "FENCE_ENABLE"]


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


# Against a log of the firmware


BEGINNING = 400_000  # bytes, with all parameters


@pytest.fixture(scope="module")
def recorded_defaults(tmp_path_factory: pytest.TempPathFactory) -> dict[str, float]:
    """Return the defaults that a recorded log tells, in its order; NaN is none of ours."""
    path = tmp_path_factory.mktemp("log") / "flight.BIN"
    with lzma.open(LOG) as packed:
        path.write_bytes(packed.read(BEGINNING))
    defaults: dict[str, float] = {}
    with DFReader_binary(str(path)) as log:
        while (record := log.recv_match(type="PARM")) is not None:
            defaults.setdefault(record.Name, record.Default)
    return defaults


@pytest.fixture
def recorded_table() -> ParamTable:
    """Return the parameters of a vehicle with a camera and as many links as the recorded one had."""
    table = ParamTable(make_groups(LINKS_OF_THE_LOG, make_params(), JULY_2025))
    table.set("VISO_TYPE", 2)
    table.set("SIM_GPS1_ENABLE", 0)
    return table


def test_firmware_has_every_parameter(recorded_defaults: dict[str, float], recorded_table: ParamTable) -> None:
    assert [param.name for param in recorded_table if param.name not in recorded_defaults] == []


def test_order_is_the_firmwares(recorded_defaults: dict[str, float], recorded_table: ParamTable) -> None:
    ours = {param.name for param in recorded_table}
    assert [param.name for param in recorded_table] == [name for name in recorded_defaults if name in ours]


def test_defaults_are_the_firmwares(recorded_defaults: dict[str, float], recorded_table: ParamTable) -> None:
    differing = [p.name for p in recorded_table if float(p.default) != recorded_defaults[p.name]]
    assert [name for name in differing if not re.fullmatch(SET_BY_FILES, name)] == []


# Counting starts


def starts(store: StoredParams) -> int:
    """Start a vehicle and return the count that it has then."""
    vehicle = Vehicle(VehicleConfig(param_store=store))
    vehicle.close()
    return vehicle.params.get_int("STAT_BOOTCNT")


def test_every_start_is_counted() -> None:
    store = MemoryParamStore()
    assert [starts(store) for _ in range(3)] == [1, 2, 3]


def test_count_of_starts_outlives_the_process(tmp_path: Path) -> None:
    path = tmp_path / "storage.parm"
    assert [starts(ParamStore(path)) for _ in range(2)] == [1, 2]


def test_count_of_starts_wraps_as_an_int16_does() -> None:
    store = MemoryParamStore()
    store.save_if_changed({"STAT_BOOTCNT": 32767})
    assert starts(store) == -32768


# What the rows say of themselves

ROWS = [(group.prefix + row.name, row) for group in make_groups(1, make_params()) for row in group.var_info]


def is_documented(row: ParamInfo, value: float) -> bool:
    return (row.range is None or row.range[0] <= value <= row.range[1]) and (not row.values or value in row.values)


def test_defaults_are_within_what_is_documented() -> None:
    defaults = [(name, row, np.atleast_1d(row.default).tolist()) for name, row in ROWS]
    assert [name for name, row, values in defaults if not all(is_documented(row, value) for value in values)] == []


def test_documented_values_fit_the_type() -> None:
    # Ranges need not: the firmware documents delays of an INT8 up to 250.
    limits = [(name, row, 1 << (row.type.bits - 1) if row.type.bits else math.inf) for name, row in ROWS]
    assert [name for name, row, limit in limits if not all(-limit <= value < limit for value in row.values)] == []
    assert [name for name, row in ROWS if row.range is not None and row.range[0] >= row.range[1]] == []
