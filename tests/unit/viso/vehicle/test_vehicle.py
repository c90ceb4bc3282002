# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The vehicle as a whole: booting, arming, origin and home, time of day, what it logs."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from ap_core.internal_error import InternalError
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.wire.messages import ATTITUDE, COMMAND_LONG, HEARTBEAT, SET_GPS_GLOBAL_ORIGIN, SYSTEM_TIME, TIMESYNC
from viso.firmware.releases import JULY_2025, OFFICIAL
from viso.parameters.releases import CHECKS_TO_SKIP
from viso.vehicle.rtc import OLDEST_VALID_UTC_US
from viso.vehicle.vehicle import Vehicle, VehicleConfig
from viso.vehicle.vehicle import bench as bench_ahrs

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench

MakeBench = Callable[..., "Bench"]
PLACE = Location(-353632610, 1491652300, 58400)
NOON_US = 1_760_000_000_000_000


def texts(bench: "Bench") -> list[str]:
    return [text for _, _, text in bench.texts]


def gps_bench(vehicle: Vehicle) -> AhrsBase:
    """Make an AHRS whose GPS says all the time that it stands at a place."""
    ahrs = bench_ahrs()(vehicle)
    ahrs.source.gps = lambda: GpsSample(  # type: ignore[method-assign]
        vehicle.clock.millis(), 3, PLACE, Vector3f(), num_sats=10, hdop=100
    )
    return ahrs


def navigating(make_bench: MakeBench, **params: float) -> "Bench":
    """Return a vehicle whose estimator navigates by its camera, and has said so."""
    bench = make_bench(VISO_TYPE=1, EK3_SRC1_POSXY=6, EK3_SRC1_POSZ=6, **params)
    bench.see(0.2)
    bench.texts.clear()
    return bench


def origin_message(place: Location = PLACE) -> SET_GPS_GLOBAL_ORIGIN:
    return SET_GPS_GLOBAL_ORIGIN(1, place.lat, place.lng, place.alt_cm * 10)


# Booting


@pytest.mark.slow
def test_boot_is_announced(make_bench: MakeBench) -> None:
    bench = make_bench(boot=False)
    bench.run_to(10)
    assert bench.texts[:2] == [(2_455_000, 6, "ArduPilot Ready"), (2_455_000, 6, "AHRS: DCM active")]
    assert texts(bench)[2:] == [
        "EKF3 IMU0 initialised",
        "EKF3 IMU1 initialised",
        "AHRS: EKF3 active",
        "EKF3 IMU0 tilt alignment complete",
        "EKF3 IMU1 tilt alignment complete",
        "EKF3 IMU0 MAG0 initial yaw alignment complete",
        "EKF3 IMU1 MAG0 initial yaw alignment complete",
    ]
    assert {"Id": 62} in bench.written("EV")


def test_vehicle_is_initialised_once_booted(make_bench: MakeBench) -> None:
    bench = make_bench(boot=False)
    bench.run_to(2.45)
    assert not bench.vehicle.copter.has_booted
    bench.run_to(2.46)
    assert bench.vehicle.copter.has_booted


@pytest.mark.parametrize(("time_s", "said"), [
    (1.0, ["PreArm: System not initialised"]),
    (4.0, ["PreArm: EKF attitude is bad", "PreArm: AHRS: not using configured AHRS type"]),
    (5.0, ["PreArm: EKF attitude is bad", "PreArm: AHRS: EKF3 still initialising"]),
    (6.0, []),
])  # fmt: skip
def test_checks_fail_while_booting(make_bench: MakeBench, time_s: float, said: list[str]) -> None:
    bench = make_bench(boot=False)
    bench.run_to(time_s)
    bench.vehicle.copter.arming.pre_arm_checks(display=True)
    assert [text for text in texts(bench) if text.startswith("PreArm")] == said


def test_boot_does_not_wait_for_a_client() -> None:
    vehicle = Vehicle(VehicleConfig(links=0))
    for time_us in range(0, 3_000_000, 2500):
        vehicle.advance(range(time_us, time_us + 1))
    assert vehicle.copter.has_booted


def test_it_is_what_it_claims_to_be(make_bench: MakeBench) -> None:
    vehicle = make_bench(boot=False).vehicle
    assert vehicle.firmware.sw_version == 4 << 24 | 7 << 16 | 1 << 8 | OFFICIAL
    system = "00017669736f" + 20 * "0"
    assert vehicle.banner() == ("ArduCopter V4.7.1 (dbe79216)", system, "Frame: QUAD/PLUS")
    assert vehicle.copter.custom_mode() == 0


@pytest.mark.parametrize(
    ("kind", "text"), [(1, "Frame: QUAD/X"), (14, "Frame: QUAD/CW_X"), (19, "Frame: QUAD/Y4"), (99, "Frame: QUAD")]
)
def test_frame_type_is_in_the_banner(make_bench: MakeBench, kind: int, text: str) -> None:
    assert make_bench(boot=False, FRAME_TYPE=kind).vehicle.banner()[-1] == text


def test_banner_names_the_system(make_bench: MakeBench) -> None:
    first, second = (make_bench(boot=False, MAV_SYSID=number).vehicle.banner()[1] for number in (1, 2))
    assert len(first) == len(second) == 32
    assert first != second


def test_default_of_an_unknown_parameter_is_noted() -> None:
    vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": 2, "NO_SUCH": 1}))
    assert vehicle.unknown_defaults == ("NO_SUCH",)
    assert vehicle.params.get_int("VISO_TYPE") == 2


def test_default_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="VISO_TYPE"):
        Vehicle(VehicleConfig(defaults={"VISO_TYPE": math.nan}))


# Checks and arming


def test_checks_pass_without_visual_odometry(make_bench: MakeBench) -> None:
    bench = make_bench()
    assert bench.command(401) == 0
    assert bench.vehicle.copter.arming.passed


def test_visual_odometry_without_data_fails_the_check(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1)
    bench.command(401)
    assert texts(bench) == ["PreArm: VisOdom: not healthy"]
    assert not bench.vehicle.copter.arming.passed


def test_visual_odometry_with_data_passes_the_check(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1)
    bench.see(0.2)
    bench.command(401)
    assert bench.vehicle.copter.arming.passed


def test_wrong_heading_fails_the_check(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=3, heading_deg=30)
    bench.see(0.2)
    bench.command(401)
    assert texts(bench) == ["PreArm: VisOdom: yaw diff 30.0 deg (>10)"]


@pytest.mark.slow
def test_yaw_is_aligned_once_the_estimator_has_settled(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=2, heading_deg=30.5)
    bench.run_to(22.4)
    bench.see(0.2)
    assert texts(bench) == ["VisOdom: yaw shifted 30 to 30 deg"]
    assert bench.command(400, 1) == 0


@pytest.mark.slow
def test_yaw_is_not_aligned_without_a_compass(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=2, COMPASS_USE=0, heading_deg=30)
    bench.run_to(22.4)
    bench.see(0.5)
    assert texts(bench) == []


def test_internal_error_fails_the_check_and_is_told_once(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.vehicle.internal_errors(InternalError.BAD_ROTATION)
    bench.run_for(0.1)
    assert [text for text in texts(bench) if text.startswith("Internal Errors")] == ["Internal Errors 0x400000"]
    bench.command(401)
    assert texts(bench)[-1].startswith("PreArm: Internal errors 0x400000 ")


def test_checks_are_enabled_by_any_bit(make_bench: MakeBench) -> None:
    assert make_bench(boot=False, ARMING_CHECK=2).vehicle.copter.arming.enabled_checks() != 0
    assert make_bench(boot=False, ARMING_CHECK=0).vehicle.copter.arming.enabled_checks() == 0


def test_arming_and_disarming_are_logged(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.command(400, 1)
    bench.command(400, 0, 21196)
    assert [record["Id"] for record in bench.written("EV") if record["Id"] in (10, 11)] == [10, 11]
    assert bench.written("ARM") == [
        {"ArmState": 1, "ArmChecks": CHECKS_TO_SKIP, "Forced": 0, "Method": 1},
        {"ArmState": 0, "ArmChecks": 0, "Forced": 1, "Method": 1},
    ]


@pytest.mark.slow
def test_arming_with_all_bits_of_arming_check_is_logged(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = make_bench(firmware=JULY_2025, ARMING_CHECK=-1)
    bench.command(400, 1)
    (row,) = (record for record in bench.log_records(tmp_path) if record["name"] == "ARM")
    assert row["ArmChecks"] == 0xFFFFFFFF


def test_disarming_twice_changes_nothing(make_bench: MakeBench) -> None:
    vehicle = make_bench().vehicle
    assert not vehicle.copter.disarm(force=False)


@pytest.mark.slow
def test_no_checks_are_made_while_armed(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1, DISARM_DELAY=0)
    bench.see(0.2)
    bench.command(400, 1)
    bench.run_for(40)
    assert not any(text.startswith("PreArm") for text in texts(bench))


# Sources


def test_choice_of_a_source_set_is_an_event(make_bench: MakeBench) -> None:
    bench = make_bench()
    for number in (2, 2, 3, 1):
        bench.command(42007, number)
    assert bench.written("EV")[1:] == [{"Id": 86}, {"Id": 87}, {"Id": 85}]


@pytest.mark.slow
def test_yaw_source_of_the_chosen_set_counts(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1, EK3_SRC1_YAW=1, EK3_SRC2_YAW=6)
    bench.see(0.2)
    assert not bench.vehicle.ahrs.using_extnav_for_yaw()
    bench.command(42007, 2)
    bench.see(0.2)
    assert bench.vehicle.ahrs.using_extnav_for_yaw()


@pytest.mark.slow
def test_camera_not_in_use_is_aligned_to_the_estimate(make_bench: MakeBench) -> None:
    bench = make_bench(make_ahrs=gps_bench, firmware=JULY_2025, VISO_TYPE=3, EK3_SRC1_POSXY=3, EK3_SRC2_POSXY=6)
    bench.run_to(47)
    bench.see(0.5, x=5.0, y=-2.0)
    last = bench.written("VISP")[-1]
    assert (float(last["PX"]), float(last["PY"])) == pytest.approx((0, 0), abs=0.01)


@pytest.mark.slow
def test_camera_keeps_to_itself_while_there_is_no_estimate_to_align_it_to(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=3, EK3_SRC1_POSXY=3, EK3_SRC2_POSXY=6)
    bench.run_to(47)
    bench.see(0.5, x=5.0)
    assert float(bench.written("VISP")[-1]["PX"]) == 5.0


@pytest.mark.slow
def test_camera_in_use_is_not_aligned(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=3, EK3_SRC1_POSXY=6)
    bench.run_to(22.5)
    bench.see(0.5, x=5.0)
    assert float(bench.written("VISP")[-1]["PX"]) == 5.0


# Origin and home


def test_origin_makes_home_of_where_the_vehicle_is(make_bench: MakeBench) -> None:
    bench = navigating(make_bench)
    bench.send(origin_message())
    bench.run_for(0.1)
    assert bench.vehicle.ahrs.origin() == bench.vehicle.copter.home.place == PLACE
    assert texts(bench) == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set", "Field Elevation Set: 584m"]


def test_origin_alone_makes_no_home(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.send(origin_message())
    bench.run_for(0.1)
    assert bench.vehicle.copter.home.place is None


def test_origin_and_home_are_logged(make_bench: MakeBench) -> None:
    bench = navigating(make_bench)
    bench.send(origin_message())
    bench.run_for(0.1)
    place = {"Lat": PLACE.lat, "Lng": PLACE.lng, "Alt": PLACE.alt_cm}
    assert bench.written("ORGN") == [{"Type": kind, **place} for kind in (0, 0, 1)]
    assert {"Id": 25} in bench.written("EV")


@pytest.mark.slow
def test_origin_that_gps_sets_is_told_as_well(make_bench: MakeBench) -> None:
    bench = make_bench(make_ahrs=gps_bench)
    bench.run_to(20)
    assert bench.vehicle.ahrs.origin() == bench.vehicle.copter.home.place == PLACE
    assert [text for text in texts(bench) if "origin" in text] == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set"]


def test_home_is_set_once(make_bench: MakeBench) -> None:
    bench = navigating(make_bench)
    bench.send(origin_message())
    bench.run_for(0.1)
    assert not bench.vehicle.set_origin(Location(0, 0, 0))
    bench.run_for(0.1)
    assert bench.vehicle.copter.home.place == PLACE
    assert len(bench.written("ORGN")) == 3


def test_elevation_below_the_sea_is_rounded(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.send(origin_message(Location(0, 0, -1250)))
    bench.run_for(0.1)
    assert texts(bench)[-1] == "Field Elevation Set: -13m"


def test_only_the_cores_there_are_tell_of_the_origin(make_bench: MakeBench) -> None:
    bench = make_bench(EK3_IMU_MASK=1)
    bench.send(origin_message())
    assert texts(bench) == ["EKF3 IMU0 origin set"]


@pytest.mark.slow
def test_log_that_comes_later_begins_with_origin_and_home(make_bench: MakeBench, tmp_path: Path) -> None:
    bench = navigating(make_bench, LOG_DISARMED=0)
    bench.send(origin_message())
    bench.run_for(0.1)
    bench.command(400, 1)
    places = [record["Type"] for record in bench.log_records(tmp_path) if record["name"] == "ORGN"]
    assert places[:2] == [0, 1]


def test_pre_arm_checks_count_as_passed_once_a_second_while_armed(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1)
    arming = bench.vehicle.copter.arming
    bench.command(400, 1, 21196)
    assert (arming.armed, arming.passed) == (True, False)
    bench.run_for(1)
    assert arming.passed


# Attitude


def test_no_attitude_is_logged_before_the_start(make_bench: MakeBench) -> None:
    bench = make_bench(boot=False)
    bench.run_to(2)
    assert bench.written("ATT") == []


@pytest.mark.parametrize(("heading_deg", "logged"), [(0, 0), (-100, 260), (1e4, 280)])
def test_logged_yaw_is_0_to_360(make_bench: MakeBench, heading_deg: float, logged: float) -> None:
    bench = make_bench(heading_deg=heading_deg)
    yaw = float(bench.written("ATT")[-1]["Yaw"])
    assert 0 <= yaw < 360
    assert math.remainder(yaw - logged, 360) == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(("heading_deg", "yaw_deg"), [(-100, -100), (200, -160), (1e4, -80)])
def test_yaw_is_told_within_half_a_turn(make_bench: MakeBench, heading_deg: float, yaw_deg: float) -> None:
    bench = make_bench(heading_deg=heading_deg)
    bench.send(COMMAND_LONG(1, 1, 512, 0, 30, 0, 0, 0, 0, 0, 0))
    bench.run_for(0.01)
    [told] = [message.yaw for message in bench.received() if isinstance(message, ATTITUDE)]
    assert math.degrees(told) == pytest.approx(yaw_deg, abs=0.05)


def test_attitude_is_logged_at_10_hz(make_bench: MakeBench) -> None:
    bench = make_bench()
    before = len(bench.written("ATT"))
    bench.run_for(1.0)
    assert len(bench.written("ATT")) - before == 10


# Statistics and other records


def test_statistics_are_logged_once_a_second(make_bench: MakeBench) -> None:
    bench = make_bench()
    before = len(bench.written("DSF"))
    bench.run_for(3.0)
    rows = bench.written("DSF")[before:]
    assert len(rows) == 3
    assert all(row["Dp"] == 0 and row["Bytes"] > 0 for row in rows)


def test_counters_of_active_links_are_logged(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_for(1.0)
    assert bench.written("MAV") == []
    bench.send(HEARTBEAT(18, 8, 0, 0, 4, 3))
    bench.run_for(1.0)
    assert [(row["chan"], row["rxp"], row["rxdp"]) for row in bench.written("MAV")] == [(0, 1, 0)]


def test_texts_are_logged_up_to_50_characters(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.vehicle.texts.send_text(6, "x" * 60)
    assert bench.written("MSG")[-1]["Message"] == "x" * 50


def test_commands_are_logged(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.command(400, 1)
    row = bench.written("MAVC")[-1]
    assert (row["Cmd"], float(row["P1"]), row["Res"], row["WL"]) == (400, 1.0, 0, 1)


def test_aux_functions_are_logged(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=2)
    bench.command(218, 80, 2)
    (row,) = bench.written("AUXF")
    assert (row["function"], row["pos"], row["source"], row["result"]) == (80, 2, 3, 1)


@pytest.mark.slow
def test_timesync_is_logged(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.run_for(11)
    sent = [message for message in bench.received() if isinstance(message, TIMESYNC)]
    bench.send(TIMESYNC(5_000_000, sent[-1].ts1))
    assert [row["SysID"] for row in bench.written("TSYN")] == [255]


@pytest.mark.slow
def test_samples_are_logged_for_a_replay_when_wanted(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1, LOG_REPLAY=1)
    bench.see(0.1)
    kinds = [name for name, _ in bench.records if name in ("RVOH", "REPH", "VISP", "REVH", "VISV")]
    assert kinds == ["RVOH", "REPH", "VISP", "REVH", "VISV", "RVOH", "REPH", "VISP", "REVH", "VISV"]


def test_samples_are_not_logged_for_a_replay_by_default(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1)
    bench.see(0.1)
    assert {name for name, _ in bench.records} & {"RVOH", "REPH", "REVH"} == set()


def test_lost_records_are_told(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.vehicle.logger.losses["1.BIN: No space left on device"] = 7
    assert bench.vehicle.log.dropped() == 7


def test_closing_closes_the_log(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.vehicle.close()
    assert not bench.vehicle.logger.is_open


# Time of day


def test_time_of_day_is_unknown_at_first(make_bench: MakeBench) -> None:
    assert make_bench().vehicle.rtc.utc_us() == 0


def test_time_of_day_may_be_known_at_boot() -> None:
    vehicle = Vehicle(VehicleConfig(boot_utc_us=NOON_US))
    vehicle.clock.set_us(5)
    assert vehicle.rtc.utc_us() == NOON_US + 5


@pytest.mark.parametrize(("types", "time_us", "taken"), [
    (2, NOON_US, True),
    (3, NOON_US, True),
    (1, NOON_US, False),
    (2, OLDEST_VALID_UTC_US - 1, False),
    (2, OLDEST_VALID_UTC_US, True),
])  # fmt: skip
def test_time_of_day_from_a_client(make_bench: MakeBench, types: int, time_us: int, taken: bool) -> None:
    bench = make_bench(BRD_RTC_TYPES=types)
    bench.send(SYSTEM_TIME(time_us, 0))
    assert bench.vehicle.rtc.utc_us() == (time_us if taken else 0)


def test_time_of_day_is_put_forward_but_never_back(make_bench: MakeBench) -> None:
    bench = make_bench(BRD_RTC_TYPES=2)
    bench.send(SYSTEM_TIME(NOON_US, 0))
    bench.send(SYSTEM_TIME(NOON_US + 9_000_000, 0))
    bench.send(SYSTEM_TIME(NOON_US, 0))
    bench.run_for(1)
    assert bench.vehicle.rtc.utc_us() == NOON_US + 10_000_000


# The AHRS is the caller's


def test_maker_of_the_ahrs_gets_the_vehicle() -> None:
    given: list[Vehicle] = []

    def make(vehicle: Vehicle) -> AhrsBase:
        given.append(vehicle)
        return bench_ahrs()(vehicle)

    vehicle = Vehicle(VehicleConfig(make))
    assert isinstance(vehicle.ahrs, AhrsBase)
    assert given == [vehicle]


def test_float_values_of_records_are_single_precision(make_bench: MakeBench) -> None:
    bench = make_bench(VISO_TYPE=1)
    bench.see(0.05, x=1 / 3)
    assert isinstance(bench.written("VISP")[0]["PX"], np.float32)
