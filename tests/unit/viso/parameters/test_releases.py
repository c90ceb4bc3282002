# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of each release, against those that recorded logs list."""

import lzma
import math
from functools import cache
from typing import Final

import pytest

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from tests.places import PARITY, RECORDED
from tests.unit.viso.log_records import records
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, Firmware
from viso.parameters import flying
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
    *("VISO_TYPE", "VISO_QUAL_MIN"),
}
"""Set for the recording, whose defaults are those of the simulator."""
SIMULATED: Final = ("FLTMODE", "FRAME_TYPE", "COMPASS_OFS", "INS_ACCOFFS", "BATT_MONITOR", "RC")
"""Of the simulated vehicle alone: flight modes, offsets and ranges of its sensors and sticks."""
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


@recorded_firmware
def test_every_parameter_is_one_of_the_recorded_release_in_its_place(firmware: Firmware) -> None:
    ours, theirs = [param.name for param in table(firmware)], recorded(firmware.name)
    assert len(theirs) > 1300
    assert ours == [name for name in theirs if name in set(ours)]


@recorded_firmware
def test_defaults_are_those_of_the_recorded_release(firmware: Firmware) -> None:
    theirs = recorded(firmware.name)
    different = {
        param.name
        for param in table(firmware)
        if param.name not in RECORDED_SET_UP
        and not param.name.startswith(SIMULATED)
        and param.default != pytest.approx(theirs[param.name])
    }
    assert different == set()


def test_parameters_that_came_and_went() -> None:
    names = {name: {param.name for param in table(one)} for name, one in PROFILES.items()}
    moved = {name: rename.new for name, rename in flying.RENAMES.items()}
    assert names[FEBRUARY_2026.name] - names[JULY_2025.name] == SINCE_FEBRUARY | {*moved.values()}
    assert names[JULY_2025.name] - names[FEBRUARY_2026.name] == {"ARMING_CHECK", "EK3_MAX_FLOW", *moved}
    gone = {name for name in names[STABLE_4_6.name] - names[JULY_2025.name] if not name.startswith("SR")}
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
