# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of an earlier release: their new names and values, in files, in storage and in the vehicle."""

import logging
import math
from pathlib import Path

import pytest

from ap_core.param import ParamTable
from viso.errors import InputError
from viso.firmware.releases import FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6, STABLE_4_7, Firmware
from viso.parameters.conversion import (
    CarriedOver,
    carry_over_from_any,
    check_instead_of_skip,
    name_here,
    skip_instead_of_check,
)
from viso.parameters.releases import ALL_RENAMES, MAX_LINKS, SR_LINKS, checks_not_skipped
from viso.parameters.store import MemoryParamStore, ParamStore
from viso.parameters.table import make_groups
from viso.terminal.settings import load_settings
from viso.vehicle.vehicle import Vehicle, VehicleConfig

OF_4_6 = """\
SYSID_THISMAV 7
SYSID_MYGCS,254
SYSID_ENFORCE=1
TELEM_DELAY 3
SR0_POSITION 5
SR0_EXTRA1 10
ARMING_CHECK 1024
SERIAL1_OPTIONS 1025
"""
SKIPPED_BUT_LOGGING = (1 << 21) - 2 & ~1024
every_firmware = pytest.mark.parametrize("firmware", PROFILES.values(), ids=lambda one: one.name)


def table(firmware: Firmware, links: int = 2) -> ParamTable:
    return ParamTable(make_groups(links, None, firmware.params))


def carried(values: dict[str, float], firmware: Firmware = JULY_2025, links: int = 2) -> CarriedOver:
    return carry_over_from_any(values, table(firmware, links), ALL_RENAMES)


@pytest.mark.parametrize(
    ("check", "skip"),
    [(1, 0), (1025, 0), (0, -1), (1024, SKIPPED_BUT_LOGGING), (262144, (1 << 21) - 2 & ~262144), (-1, 0)],
)
def test_mask_of_checks_becomes_a_mask_of_what_is_skipped(check: float, skip: float) -> None:
    assert skip_instead_of_check(check) == skip


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_mask_that_is_no_number_is_refused(value: float) -> None:
    for convert in (skip_instead_of_check, check_instead_of_skip):
        with pytest.raises(ValueError, match="cannot be stored as an integer"):
            convert(value)


@pytest.mark.parametrize("check", [2, 1024, 1024 | 262144])
def test_what_was_checked_is_checked_after_the_conversion(check: int) -> None:
    assert checks_not_skipped(int(skip_instead_of_check(check))) == check


@pytest.mark.parametrize("check", [0, 1, 2, 1024, 1024 | 262144])
def test_what_is_skipped_is_not_checked_before(check: int) -> None:
    assert check_instead_of_skip(skip_instead_of_check(check)) == check


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            {"SYSID_THISMAV": 7, "SYSID_MYGCS": 254, "SYSID_ENFORCE": 1},
            {"MAV_SYSID": 7, "MAV_GCS_SYSID": 254, "MAV_OPTIONS": 1},
        ),
        (
            {"SR0_EXTRA1": 4, "SR1_POSITION": 5, "TELEM_DELAY": 3},
            {"MAV1_EXTRA1": 4, "MAV2_POSITION": 5, "MAV_TELEM_DELAY": 3},
        ),
        ({"RTL_ALT": 1500, "ANGLE_MAX": 3000}, {"RTL_ALT_M": 15, "ATC_ANGLE_MAX": 30}),
        ({"WPNAV_SPEED": 500, "ATC_SLEW_YAW": 6000}, {"WP_SPD": 5, "ATC_RATE_WPY_MAX": 60}),
        ({"RNGFND1_MAX_CM": 700, "EK3_MAX_FLOW": 2}, {"RNGFND1_MAX": 7, "EK3_FLOW_MAX": 2}),
        ({"ARMING_CHECK": 1024}, {"ARMING_SKIPCHK": SKIPPED_BUT_LOGGING}),
    ],
)
def test_names_are_carried_over_both_ways(old: dict[str, float], new: dict[str, float]) -> None:
    there, back = carried(old, STABLE_4_7), carried(new, STABLE_4_6)
    assert there.values == pytest.approx(new)
    assert back.values == pytest.approx(old)
    assert (there.lost, back.lost) == ((), ())
    assert [len(one.conversions) for one in (there, back)] == [len(old)] * 2


@pytest.mark.parametrize(("options", "port"), [(2, 1024), (4, 4096), (6, 5120)])
def test_options_of_a_link_move_to_its_port(options: int, port: int) -> None:
    assert carried({"MAV2_OPTIONS": options}, STABLE_4_6).values == {"SERIAL1_OPTIONS": port}


def test_every_name_of_a_release_is_known_in_every_other() -> None:
    tables = {name: table(release) for name, release in PROFILES.items()}
    for one in PROFILES.values():
        values = {param.name: float(param.default) for param in tables[one.name] if not param.name.startswith("MAV")}
        for other in PROFILES.values():
            unknown = {name for name in carried(values, other).values if tables[other.name].find(name) is None}
            gone = {name for name in unknown if not name.startswith(("AHRS_ORIGIN", "STAT_", "SIM_"))}
            assert gone == set(), (one.name, other.name)


def test_ids_and_rates_have_new_names_in_4_7() -> None:
    found = carried({"SYSID_THISMAV": 7.0, "SR1_EXTRA1": 4.0, "VISO_TYPE": 1.0, "NO_SUCH": 2.0})
    assert found.values == {"MAV_SYSID": 7.0, "MAV2_EXTRA1": 4.0, "VISO_TYPE": 1.0, "NO_SUCH": 2.0}
    assert [str(one) for one in found.conversions] == ["SYSID_THISMAV -> MAV_SYSID", "SR1_EXTRA1 -> MAV2_EXTRA1"]
    assert found.lost == ()


def test_rate_of_a_link_that_is_not_there_is_lost() -> None:
    found = carried({"SR1_EXTRA1": 4.0}, links=1)
    assert (found.values, found.lost) == ({}, ("SR1_EXTRA1",))


def test_value_under_the_new_name_wins() -> None:
    assert carried({"MAV_SYSID": 3.0, "SYSID_THISMAV": 7.0}).values == {"MAV_SYSID": 3.0}


def test_nothing_of_its_own_is_converted_for_the_earliest_release() -> None:
    given = {"SYSID_THISMAV": 7.0, "SERIAL1_OPTIONS": 1024.0, "ARMING_CHECK": 0.0}
    assert carried(given, STABLE_4_6).values == given


@pytest.mark.parametrize(("options", "left", "link"), [(1024, 0, 2), (4096 + 1, 1, 4), (5120, 0, 6)])
def test_options_of_a_port_move_to_its_link(options: int, left: int, link: int) -> None:
    found = carried({"SERIAL1_OPTIONS": options})
    assert found.values == {"SERIAL1_OPTIONS": left, "MAV2_OPTIONS": link, "MAV2_OPTIONSCNV": 1}
    assert [one.new for one in found.conversions] == ["MAV2_OPTIONS"]


def test_options_are_added_to_those_that_the_link_has() -> None:
    assert carried({"SERIAL1_OPTIONS": 1024, "MAV2_OPTIONS": 1}).values["MAV2_OPTIONS"] == 3


def test_ports_count_that_speak_mavlink() -> None:
    found = carried({"SERIAL1_PROTOCOL": 5, "SERIAL2_OPTIONS": 1024})
    assert found.values["MAV2_OPTIONS"] == 2


@pytest.mark.parametrize("given", [{"SERIAL1_OPTIONS": 7}, {"SERIAL1_OPTIONS": 1024, "MAV2_OPTIONSCNV": 1}])
def test_options_that_need_not_move_stay(given: dict[str, float]) -> None:
    assert carried(given).values == given


def test_name_of_another_release_is_known() -> None:
    assert name_here("MAV_SYSID", table(STABLE_4_6), ALL_RENAMES) == "SYSID_THISMAV"
    assert name_here("ARMING_CHECK", table(FEBRUARY_2026), ALL_RENAMES) == "ARMING_SKIPCHK"
    assert name_here("NO_SUCH", table(JULY_2025), ALL_RENAMES) is None


# Files


@every_firmware
def test_file_of_4_6_loads(tmp_path: Path, firmware: Firmware, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "old.parm"
    path.write_text(OF_4_6)
    with caplog.at_level(logging.WARNING):
        settings = load_settings([path], [], links=2, firmware=firmware)
    vehicle = Vehicle(VehicleConfig(links=2, defaults=settings, firmware=firmware))
    params, names = vehicle.params, firmware.endpoint.params
    assert vehicle.unknown_defaults == ()
    assert [params.get_int(name) for name in (names.system_id, names.ground_station_id)] == [7, 254]
    assert [params.get_int(name) for name in (names.only_ground_station, names.telem_delay)] == [1, 3]
    assert [params.get_int(names.stream_rate(0, row)) for row in ("_POSITION", "_EXTRA1")] == [5, 10]
    assert names.link_options(params, 1) == 2
    assert vehicle.copter.arming.enabled_checks() == 1024
    assert len(caplog.messages) == (0 if firmware is STABLE_4_6 else 1)
    assert all("SYSID_THISMAV -> MAV_SYSID" in message for message in caplog.messages)


def test_rates_of_links_that_are_not_there_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "old.parm"
    path.write_text("SR6_EXTRA1 4\n")
    assert load_settings([path], [], links=1) == {}
    assert caplog.messages == [f"{path}: for links that are not there: SR6_EXTRA1"]


def test_name_of_another_release_on_the_command_line_is_refused_with_the_one_here() -> None:
    with pytest.raises(InputError, match="parameter MAV_SYSID, which this firmware calls SYSID_THISMAV"):
        load_settings([], ["MAV_SYSID=7"], links=1, firmware=STABLE_4_6)
    with pytest.raises(InputError, match="parameter ARMING_CHECK, which this firmware calls ARMING_SKIPCHK"):
        load_settings([], ["ARMING_CHECK=0"], links=1, firmware=FEBRUARY_2026)


OF_4_7_1 = """\
VISO_TYPE 1
ARMING_SKIPCHK 0
EK3_FLOW_MAX 2.5
WP_SPD 5
NOT_HERE_YET 0
"""


@every_firmware
def test_file_of_4_7_1_loads(tmp_path: Path, firmware: Firmware, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "471.parm"
    path.write_text(OF_4_7_1)
    settings = load_settings([path], [], links=1, firmware=firmware)
    vehicle = Vehicle(VehicleConfig(defaults=settings, firmware=firmware))
    speed = vehicle.params.find("WP_SPD") or vehicle.params.find("WPNAV_SPEED")
    assert vehicle.unknown_defaults == ()
    assert vehicle.copter.arming.is_enabled(1 << 18)
    assert speed is not None
    assert float(speed.value) == (5 if speed.name == "WP_SPD" else 500)
    assert caplog.messages[-1] == f"{path}:5: unknown parameter, passed over: NOT_HERE_YET"
    converted = [name for name in ("ARMING_SKIPCHK", "EK3_FLOW_MAX", "WP_SPD") if vehicle.params.find(name) is None]
    assert len(caplog.messages) == (2 if converted else 1)
    assert all(name in caplog.messages[0] for name in converted)


# What is stored


@pytest.mark.parametrize("on_disk", [True, False])
def test_storage_of_4_6_is_carried_over_and_kept(tmp_path: Path, on_disk: bool) -> None:
    store = ParamStore(tmp_path / "storage.parm") if on_disk else MemoryParamStore()

    def boot(firmware: Firmware) -> Vehicle:
        return Vehicle(VehicleConfig(firmware=firmware, param_store=store))

    first = boot(STABLE_4_6)
    first.params.set_from_mavlink("SYSID_THISMAV", 7)
    first.params.set_from_mavlink("ARMING_CHECK", 1024)
    first.close()
    later = boot(FEBRUARY_2026)
    assert later.params.get_int("MAV_SYSID") == 7
    assert later.params.get_int("ARMING_SKIPCHK") == SKIPPED_BUT_LOGGING
    later.params.set_from_mavlink("MAV_SYSID", 8)
    later.close()
    assert boot(FEBRUARY_2026).params.get_int("MAV_SYSID") == 8
    if on_disk:
        assert boot(STABLE_4_6).params.get_int("SYSID_THISMAV") == 7


def test_carried_over_names_are_not_told_as_unknown(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "storage.parm"
    path.write_text("# mine\nSYSID_THISMAV 7\nNO_SUCH 1\n")
    store = ParamStore(path)
    store.restore(table(JULY_2025), ALL_RENAMES)
    assert caplog.messages == [f"{path}: unknown parameters, kept in the file: NO_SUCH"]
    assert store.unknown == {"SYSID_THISMAV": 7, "NO_SUCH": 1}


# The vehicle's own


@every_firmware
def test_recorded_parameters_of_the_reference_hold_in_every_release(firmware: Firmware) -> None:
    vehicle = Vehicle(VehicleConfig(defaults={"ARMING_CHECK": 0.0}, firmware=firmware))
    assert vehicle.copter.arming.enabled_checks() == 0
    assert vehicle.unknown_defaults == ()


def test_later_vehicle_skips_what_it_is_told_to() -> None:
    vehicle = Vehicle(VehicleConfig(firmware=FEBRUARY_2026))
    arming = vehicle.copter.arming
    assert arming.enabled_checks() == (1 << 21) - 2
    vehicle.params.set("ARMING_SKIPCHK", 1 << 18)
    assert [arming.is_enabled(1 << bit) for bit in (10, 18)] == [True, False]
    vehicle.params.set("ARMING_SKIPCHK", -1)
    assert vehicle.copter.arming.enabled_checks() == 0


@pytest.mark.parametrize("firmware", [JULY_2025, STABLE_4_6], ids=lambda one: one.name)
def test_links_have_parameters_up_to_a_number(firmware: Firmware) -> None:
    with pytest.raises(ValueError, match="link 9: there are parameters for links 1 to 8"):
        table(firmware, MAX_LINKS + 1)


def test_4_6_has_rates_for_links_that_are_not_open() -> None:
    names = [param.name for param in table(STABLE_4_6, 1) if param.name.endswith("_EXTRA1")]
    assert names == [f"SR{index}_EXTRA1" for index in range(SR_LINKS)]
    assert table(STABLE_4_6, 8).find("SR7_EXTRA1") is not None


@every_firmware
def test_ids_are_16_bit_and_options_of_ports_as_wide_as_the_release_has_them(firmware: Firmware) -> None:
    params = table(firmware)
    options = params.find("SERIAL1_OPTIONS")
    assert options is not None
    assert options.type.bits == (16 if firmware is STABLE_4_6 else 32)
