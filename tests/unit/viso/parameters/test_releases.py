# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of each release, against those that recorded logs and the releases' simulators list."""

import lzma
import math
from functools import cache
from typing import Final

import pytest

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from tests.places import DATA, PARITY, RECORDED
from tests.unit.viso.log_records import records
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, STABLE_4_7, Firmware
from viso.parameters import flying
from viso.parameters.releases import ALL_RENAMES
from viso.parameters.table import make_groups

LOGS: Final = {
    JULY_2025.name: RECORDED / "logs" / "t265.BIN.xz",
    FEBRUARY_2026.name: PARITY / "2026-02" / "logs" / "t265.BIN.xz",
    APRIL_2026.name: PARITY / "2026-04" / "logs" / "voxl.BIN.xz",
}
LINKS = 3  # in the recordings
SINCE_FEBRUARY: Final = {
    "AHRS_ORIGIN_LAT",
    "AHRS_ORIGIN_LON",
    "AHRS_ORIGIN_ALT",
    "ARMING_SKIPCHK",
    "EK3_FLOW_MAX",
    "STAT_FLTCNT",
    "STAT_DISTFLWN",
    "SIM_VICON_QUAL",
    "MAV_GCS_SYSID_HI",
}
RECORDED_SET_UP: Final = {
    *("GPS1_TYPE", "EK3_SRC1_POSXY", "EK3_SRC1_VELXY", "EK3_SRC1_POSZ", "EK3_SRC1_VELZ", "LOG_REPLAY"),
    *("VISO_TYPE", "VISO_QUAL_MIN", "SIM_GPS1_ENABLE"),
}
"""Set for the recording, whose defaults are those of the simulator."""
SIMULATED: Final = ("FLTMODE", "FRAME_TYPE", "COMPASS_OFS", "COMPASS_DEV_ID", "INS_ACC", "BATT_MONITOR", "RC")
"""Of the simulated vehicle alone: flight modes, offsets and ranges of its sensors and sticks."""
LISTED: Final = {
    STABLE_4_6.name: DATA / "parameters" / "4.6.3.txt",
    STABLE_4_7.name: DATA / "parameters" / "4.7.1.txt",
}
OURS: Final = {"FRAME_CLASS", "LOG_DISARMED", "SIM_BARO_RND", "STAT_BOOTCNT", "VISO_TYPE"}
"""Defaults that are ours, or of the simulator's start."""
listed_firmware = pytest.mark.parametrize("firmware", [STABLE_4_6, STABLE_4_7], ids=lambda one: one.name)
recorded_firmware = pytest.mark.parametrize(
    "firmware", [JULY_2025, FEBRUARY_2026, APRIL_2026], ids=lambda one: one.name
)


@cache
def recorded(name: str) -> dict[str, float]:
    """Return the parameters with their defaults that a log begins with, in their order."""
    found: dict[str, float] = {}
    for kind, values, _ in records(lzma.decompress(LOGS[name].read_bytes())):
        if kind == "VER":
            break
        if kind == "PARM":
            found.setdefault(values[1], values[3] if math.isfinite(values[3]) else values[2])
    return found


def table(firmware: Firmware) -> ParamTable:
    params = ParamTable(make_groups(LINKS, make_params(), firmware.params))
    params.set("VISO_TYPE", 2)
    return params


def recorded_table(firmware: Firmware) -> ParamTable:
    params = table(firmware)
    params.set("SIM_GPS1_ENABLE", 0)
    return params


@recorded_firmware
def test_every_parameter_is_one_of_the_recorded_release_in_its_place(firmware: Firmware) -> None:
    ours, theirs = [param.name for param in recorded_table(firmware)], recorded(firmware.name)
    assert len(theirs) > 1300
    assert ours == [name for name in theirs if name in set(ours)]


@recorded_firmware
def test_defaults_are_those_of_the_recorded_release(firmware: Firmware) -> None:
    theirs = recorded(firmware.name)
    different = {
        param.name
        for param in recorded_table(firmware)
        if param.name not in RECORDED_SET_UP
        and not param.name.startswith(SIMULATED)
        and param.default != pytest.approx(theirs[param.name])
    }
    assert different == set()


@cache
def listed(name: str) -> dict[str, tuple[int, float]]:
    """Return type on the wire and default of what a release's simulator lists, in its order."""
    rows = [line.split() for line in LISTED[name].read_text(encoding="ascii").splitlines()]
    return {parameter: (int(kind), float(default)) for parameter, kind, default in rows}


@listed_firmware
def test_every_parameter_is_one_that_the_release_lists_in_its_place(firmware: Firmware) -> None:
    names = list(listed(firmware.name))
    ours = [param.name for param in table(firmware) if not param.name.startswith(("MAV2", "MAV3"))]
    assert ours == names


@listed_firmware
def test_types_and_defaults_are_those_that_the_release_lists(firmware: Firmware) -> None:
    theirs = listed(firmware.name)
    params = [param for param in table(firmware) if param.name in theirs]
    assert [param.name for param in params if param.type.wire_type != theirs[param.name][0]] == []
    ordinary = [param for param in params if not param.name.startswith(SIMULATED) and param.name not in OURS]
    assert len(ordinary) > 220
    assert {one.name for one in ordinary if one.default != pytest.approx(theirs[one.name][1])} == set()


def test_action_of_ekf_failsafe_0_came_after_4_6() -> None:
    rows = {name: [slot for group in table(one).groups for slot in group.slots] for name, one in PROFILES.items()}
    values = {
        name: next(one.row.values for one in slots if one.name == "FS_EKF_ACTION") for name, slots in rows.items()
    }
    assert [name for name, choices in values.items() if 0 not in choices] == [STABLE_4_6.name]


def test_parameters_that_came_and_went() -> None:
    names = {name: {param.name for param in table(one)} for name, one in PROFILES.items()}
    later = {name: rename.new for name, rename in flying.RENAMES.items()}
    moved = {name: new for name, new in later.items() if new in names[FEBRUARY_2026.name]}
    assert names[FEBRUARY_2026.name] - names[JULY_2025.name] == SINCE_FEBRUARY | {*moved.values()}
    assert names[JULY_2025.name] - names[FEBRUARY_2026.name] == {"ARMING_CHECK", "EK3_MAX_FLOW", *moved}
    gone = {name for name in names[STABLE_4_6.name] - names[JULY_2025.name] if not name.startswith(("SR", "SIM_GPS"))}
    assert gone == {"SYSID_THISMAV", "SYSID_MYGCS", "SYSID_ENFORCE", "TELEM_DELAY"}


@pytest.mark.parametrize(
    ("first", "last", "accepted"), [(255, 0, {255}), (250, 252, {250, 251, 252}), (250, 250, {250}), (250, 9, {250})]
)
def test_ground_stations_in_charge_are_a_range_of_ids(first: int, last: int, accepted: set[int]) -> None:
    params, names = table(FEBRUARY_2026), FEBRUARY_2026.endpoint.params
    params.set("MAV_GCS_SYSID", first)
    params.set("MAV_GCS_SYSID_HI", last)
    assert {number for number in range(256) if names.is_ground_station(params, number)} == accepted


@pytest.mark.parametrize("firmware", [STABLE_4_6, JULY_2025], ids=lambda one: one.name)
def test_one_ground_station_was_in_charge_before(firmware: Firmware) -> None:
    params, names = table(firmware), firmware.endpoint.params
    params.set(names.ground_station_id, 250)
    assert {number for number in range(256) if names.is_ground_station(params, number)} == {250}


@pytest.mark.parametrize(("firmware", "options"), [(STABLE_4_6, 1), (JULY_2025, 0), (APRIL_2026, 0)])
def test_all_velocities_are_fused_by_default_up_to_4_6(firmware: Firmware, options: int) -> None:
    assert table(firmware).get_int("EK3_SRC_OPTIONS") == options


def test_range_on_the_ground_is_carried_over_from_4_6() -> None:
    rename = ALL_RENAMES["RNGFND1_GNDCLEAR"]
    assert (rename.new, rename.convert(25)) == ("RNGFND1_GNDCLR", 0.25)
