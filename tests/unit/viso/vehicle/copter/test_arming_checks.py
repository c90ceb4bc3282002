# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each check looks at, its bit, and its text."""

from typing import TYPE_CHECKING

import pytest

from ap_core.fmath import f32
from ap_core.internal_error import InternalError
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.core.params import EkfSources
from ekf_stub.inputs.measurements import GpsSample
from ekf_stub.reports import FilterFlag, FilterStatus
from viso.firmware.releases import JULY_2025, STABLE_4_7, Firmware
from viso.logs.files import LogStoreError
from viso.logs.logger import LogSink
from viso.vehicle.copter.modes import ModeNumber

if TYPE_CHECKING:
    from tests.unit.viso.conftest import CopterRig

PLACE = Location(-353_632_610, 1_491_652_300, 58_400)
INS, GPS, LOGGING, SWITCH, MISSION, SYSTEM, VISION = (1 << bit for bit in (4, 3, 10, 11, 14, 13, 18))


def failures(rig: "CopterRig") -> list[str]:
    """Return what fails before arming."""
    rig.take_texts()
    rig.copter.arming.pre_arm_checks(display=True)
    return [text.removeprefix("PreArm: ") for text in rig.take_texts()]


def attempt(rig: "CopterRig", *, forced: bool = False) -> list[str]:
    """Try to arm and return what fails."""
    rig.take_texts()
    rig.copter.arm(do_checks=not forced)
    return [text.removeprefix("Arm: ") for text in rig.take_texts() if text.startswith("Arm: ")]


def lean(rig: "CopterRig", roll_deg: float, pitch_deg: float) -> None:
    to_rad = 0.017453292
    rig.ahrs.quat = Quaternion.from_euler(f32(roll_deg * to_rad), f32(pitch_deg * to_rad), f32(0))


def fix(fix_type: int = 3, *, place: Location = PLACE, hdop: int = 140, is_healthy: bool = True) -> GpsSample:
    return GpsSample(0, fix_type, place, Vector3f(), 10, hdop=hdop, is_healthy=is_healthy)


def test_vehicle_with_nothing_wrong_arms(rig: "CopterRig") -> None:
    assert failures(rig) == []
    assert attempt(rig) == []
    assert rig.copter.is_armed()


def test_booting_vehicle_is_asked_for_nothing_else(rig: "CopterRig") -> None:
    rig.copter.has_booted = False
    rig.ahrs.failure = "EKF3 not started"
    assert failures(rig) == ["System not initialised"]


def everything_wrong(rig: "CopterRig") -> None:
    rig.copter.set_mode(ModeNumber.AUTO)
    rig.ahrs.status = FilterStatus(FilterFlag.UNINITIALISED)
    rig.ahrs.failure = "EKF3 still initialising"
    rig.copter.safety_on = True
    rig.is_active = True
    rig.errors(InternalError.CONSTRAINING_NAN, 17)
    rig.visual_odom.failure = "not healthy"


def test_all_failures_are_told_in_the_firmware_s_order(rig: "CopterRig") -> None:
    rig.params.set("ARMING_CHECK", -1 & ~(1 | GPS))
    everything_wrong(rig)
    [internal_errors] = [text for text in failures(rig) if text.startswith("Internal errors 0x400 l:17 ")]
    assert failures(rig) == [
        "Need Alt Estimate",
        "Hardware safety switch",
        "EKF attitude is bad",
        "AHRS: EKF3 still initialising",
        "Downloading logs",
        "Mode requires mission",
        internal_errors,
        "VisOdom: not healthy",
    ]


@pytest.mark.parametrize(("mask", "told"), [
    (0, ["AHRS: EKF3 still initialising", "Need Alt Estimate"]),
    (SYSTEM, ["Need Alt Estimate", "AHRS: EKF3 still initialising", "Internal"]),
    (GPS, ["Need Alt Estimate", "AHRS: waiting for home", "Internal"]),
    (SWITCH, ["Need Alt Estimate", "Hardware safety switch", "AHRS: EKF3 still initialising", "Internal"]),
    (INS, ["Need Alt Estimate", "EKF attitude is bad", "AHRS: EKF3 still initialising", "Internal"]),
    (LOGGING, ["Need Alt Estimate", "AHRS: EKF3 still initialising", "Downloading logs", "Internal"]),
    (MISSION, ["Need Alt Estimate", "AHRS: EKF3 still initialising", "Mode requires mission", "Internal"]),
    (VISION, ["Need Alt Estimate", "AHRS: EKF3 still initialising", "Internal", "VisOdom: not healthy"]),
])  # fmt: skip
def test_each_check_has_the_firmware_s_bit(rig: "CopterRig", mask: int, told: list[str]) -> None:
    rig.params.set("ARMING_CHECK", mask)
    everything_wrong(rig)
    assert ["Internal" if text.startswith("Internal") else text for text in failures(rig)] == told


# Height and position


@pytest.mark.parametrize(("mode", "fails"), [
    (ModeNumber.STABILIZE, []), (ModeNumber.ACRO, []), (ModeNumber.ALT_HOLD, ["Need Alt Estimate"]),
])  # fmt: skip
def test_height_is_needed_where_the_pilot_does_not_have_the_throttle(
    rig: "CopterRig", mode: ModeNumber, fails: list[str]
) -> None:
    rig.copter.set_mode(mode)
    rig.ahrs.navigate(FilterFlag.ATTITUDE)
    assert failures(rig) == fails


@pytest.mark.parametrize(("mode", "required"), [(ModeNumber.STABILIZE, False), (ModeNumber.GUIDED, True)])
def test_ahrs_is_told_whether_the_mode_needs_a_position(rig: "CopterRig", mode: ModeNumber, required: bool) -> None:
    rig.copter.set_mode(mode)
    rig.ahrs.failure = "Check EK3_SRC1_POSXY"
    rig.params.set("ARMING_CHECK", VISION)
    assert failures(rig) == ["AHRS: Check EK3_SRC1_POSXY"]
    assert rig.ahrs.position_required is required


def test_mode_with_a_position_waits_for_home(rig: "CopterRig") -> None:
    rig.copter.set_mode(ModeNumber.GUIDED)
    assert failures(rig) == ["AHRS: waiting for home"]
    rig.ahrs.ekf_origin = PLACE
    rig.copter.home.set(PLACE, lock=True)
    assert failures(rig) == []


@pytest.mark.parametrize(("fix_type", "fails"), [(0, ["GPS 1: Bad fix"]), (2, ["GPS 1: Bad fix"]), (3, [])])
def test_mode_with_a_position_asks_a_gps_for_its_fix(rig: "CopterRig", fix_type: int, fails: list[str]) -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.copter.home.set(PLACE, lock=True)
    rig.gps = fix(fix_type)
    assert failures(rig) == []
    rig.copter.set_mode(ModeNumber.LOITER)
    assert failures(rig) == fails


@pytest.mark.parametrize(("solution", "fails"), [
    (fix(), []),
    (fix(is_healthy=False), ["GPS 1: not healthy"]),
    (fix(2, is_healthy=False), ["GPS 1: Bad fix"]),
    (fix(place=Location(PLACE.lat + 890, PLACE.lng, 0)), []),
    (fix(place=Location(PLACE.lat + 1000, PLACE.lng, PLACE.alt_cm), hdop=999), ["GPS and AHRS differ by 11.1m"]),
    (fix(hdop=141), ["High GPS HDOP"]),
    (fix(hdop=65535), ["High GPS HDOP"]),
])  # fmt: skip
def test_mode_with_a_position_asks_how_good_a_gps_is(rig: "CopterRig", solution: GpsSample, fails: list[str]) -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.ahrs.stand_at(PLACE)
    rig.copter.home.set(PLACE, lock=True)
    rig.gps = solution
    assert failures(rig) == []
    rig.copter.set_mode(ModeNumber.LOITER)
    assert failures(rig) == fails
    rig.params.set("ARMING_CHECK", VISION)
    assert failures(rig) == []


@pytest.mark.parametrize(("second", "fails"), [
    (fix(place=Location(PLACE.lat + 4400, PLACE.lng, PLACE.alt_cm)), []),
    (fix(place=Location(PLACE.lat, PLACE.lng, PLACE.alt_cm + 5000)), ["GPS positions differ by 50.0m"]),
    (fix(2), ["GPS 2: Bad fix"]),
    (fix(is_healthy=False), ["GPS 2: not healthy"]),
])  # fmt: skip
def test_second_gps_is_to_be_good_too_and_near_the_first(rig: "CopterRig", second: GpsSample, fails: list[str]) -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.ahrs.stand_at(PLACE)
    rig.copter.home.set(PLACE, lock=True)
    rig.gps, rig.second_gps = fix(place=PLACE), second
    rig.copter.set_mode(ModeNumber.LOITER)
    assert failures(rig) == fails


@pytest.mark.parametrize(
    ("firmware", "source", "fails"),
    [(JULY_2025, 6, ["GPS 1: Bad fix"]), (STABLE_4_7, 6, []), (STABLE_4_7, 3, ["GPS 1: Bad fix"])],
)
def test_gps_that_is_not_used_matters_in_some_releases(
    rig: "CopterRig", firmware: Firmware, source: int, fails: list[str]
) -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.copter.home.set(PLACE, lock=True)
    rig.vehicle.firmware = firmware
    rig.ahrs.has_gps_as_source = EkfSources(lambda name: source if name == "SRC1_POSXY" else 0).uses_gps()
    rig.gps = fix(0)
    rig.copter.set_mode(ModeNumber.LOITER)
    assert failures(rig) == fails


def test_dilution_is_looked_at_after_what_is_mandatory(rig: "CopterRig") -> None:
    rig.ahrs.ekf_origin = PLACE
    rig.copter.home.set(PLACE, lock=True)
    rig.copter.set_mode(ModeNumber.LOITER)
    rig.gps = fix(hdop=300)
    rig.ahrs.failure = "Check EK3_SRC1_POSXY"
    assert failures(rig) == ["AHRS: Check EK3_SRC1_POSXY"]
    rig.ahrs.failure = None
    rig.params.set("GPS_HDOP_GOOD", 300)
    assert failures(rig) == []


def test_mode_with_a_position_needs_one(rig: "CopterRig") -> None:
    rig.params.set("ARMING_CHECK", VISION)
    rig.copter.set_mode(ModeNumber.GUIDED)
    rig.ahrs.navigate(FilterFlag.ATTITUDE, FilterFlag.VERT_POS, FilterFlag.VERT_VEL)
    assert failures(rig) == ["Need Position Estimate"]


def test_optical_flow_aids_a_relative_position_as_visual_odometry_does(rig: "CopterRig") -> None:
    rig.params.set("ARMING_CHECK", VISION)
    rig.copter.set_mode(ModeNumber.GUIDED)
    rig.ahrs.navigate(FilterFlag.VERT_POS, FilterFlag.VERT_VEL, FilterFlag.PRED_HORIZ_POS_REL)
    assert failures(rig) == []
    rig.visual_odom.is_enabled = False
    assert failures(rig) == ["Need Position Estimate"]
    rig.params.set("FLOW_TYPE", 5)
    assert failures(rig) == []


@pytest.mark.parametrize(("status", "text"), [
    (FilterStatus(FilterFlag(0xFFFF)), "GPS glitching"),
    (FilterStatus(FilterFlag(0x3FF), pos_horiz_variance=0.9), "EKF position variance"),
    (FilterStatus(FilterFlag(0x3FF), velocity_variance=0.9), "EKF velocity variance"),
])  # fmt: skip
def test_mode_with_a_position_wants_a_good_one(rig: "CopterRig", status: FilterStatus, text: str) -> None:
    rig.params.set("ARMING_CHECK", VISION)
    rig.ahrs.status = status
    assert failures(rig) == []
    rig.copter.set_mode(ModeNumber.GUIDED)
    assert failures(rig) == [text]
    rig.params.set("FS_EKF_THRESH", 0)
    assert failures(rig) == ([text] if text == "GPS glitching" else [])


def test_range_finder_that_says_nothing_fails(rig: "CopterRig") -> None:
    rig.params.set("RNGFND1_TYPE", 10)
    assert failures(rig) == ["Rangefinder 1: Not Detected"]
    rig.params.set("ARMING_CHECK", VISION)
    assert failures(rig) == []


# Logging


def test_log_that_cannot_be_written_fails(rig: "CopterRig") -> None:
    rig.logger.failure = "disk full"
    rig.is_active = True
    assert failures(rig) == ["Logging failed"]


# At the attempt


def test_unhealthy_ahrs_is_noticed_at_the_attempt(rig: "CopterRig") -> None:
    rig.ahrs.is_healthy = False
    assert failures(rig) == []
    assert attempt(rig) == ["AHRS not healthy"]


def test_mode_that_cannot_be_armed_in_is_named(rig: "CopterRig") -> None:
    rig.copter.set_mode(ModeNumber.LAND)
    assert failures(rig) == []
    assert attempt(rig) == ["LAND mode not armable"]
    rig.params.set("ARMING_CHECK", 0)
    assert attempt(rig) == ["LAND mode not armable"]
    assert attempt(rig, forced=True) == []


@pytest.mark.parametrize(("roll_deg", "pitch_deg", "fails"), [
    (29.9, 0, []), (30.1, 0, ["Leaning"]), (0, -30.1, ["Leaning"]), (22, 22, ["Leaning"]), (21, -20, []),
])  # fmt: skip
def test_leaning_vehicle_does_not_arm(rig: "CopterRig", roll_deg: float, pitch_deg: float, fails: list[str]) -> None:
    lean(rig, roll_deg, pitch_deg)
    assert attempt(rig) == fails


def test_lean_is_not_looked_at_without_the_bit_of_inertial_sensors(rig: "CopterRig") -> None:
    rig.params.set("ARMING_CHECK", VISION)
    lean(rig, 45, 0)
    assert attempt(rig) == []


def test_safety_switch_is_checked_twice(rig: "CopterRig") -> None:
    rig.copter.safety_on = True
    assert failures(rig) == ["Hardware safety switch"]
    rig.params.set("ARMING_CHECK", VISION)
    assert failures(rig) == []
    assert attempt(rig) == ["Safety Switch"]
    rig.params.set("ARMING_CHECK", 0)
    assert attempt(rig) == []


def refuse() -> LogSink:
    raise LogStoreError("no room")


@pytest.fixture
def rig_without_room(rig: "CopterRig") -> "CopterRig":
    return type(rig)(open_log=refuse)


def test_log_that_cannot_be_opened_is_noticed_last(rig_without_room: "CopterRig") -> None:
    assert attempt(rig_without_room) == ["Logging not started"]
    assert attempt(rig_without_room) == ["Logging failed"]


def test_log_may_be_missing_without_the_bit_of_logging(rig_without_room: "CopterRig") -> None:
    rig_without_room.params.set("ARMING_CHECK", VISION)
    assert attempt(rig_without_room) == []
    assert rig_without_room.copter.is_armed()


def test_vehicle_without_a_place_for_logs_is_not_asked_for_one(rig: "CopterRig") -> None:
    assert attempt(type(rig)(open_log=None)) == []


def test_log_is_open_before_arming_is_logged(rig: "CopterRig") -> None:
    assert not rig.logger.is_open
    assert attempt(rig) == []
    assert rig.logger.is_open


# Forced


def test_force_leaves_height_and_position(rig: "CopterRig") -> None:
    everything_wrong(rig)
    assert attempt(rig, forced=True)[:2] == ["AHRS: EKF3 still initialising", "Need Alt Estimate"]
    assert not rig.copter.is_armed()


def test_force_overrides_the_rest(rig: "CopterRig") -> None:
    rig.copter.safety_on = True
    rig.is_active = True
    rig.visual_odom.failure = "not healthy"
    assert attempt(rig, forced=True) == []
    assert rig.copter.is_armed()
