# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the autopilot tells on topics of ROS 2, worked out by hand from the firmware's conversions."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AhrsBase
from viso.dds import messages as ros
from viso.dds.autopilot import SERVICES
from viso.dds.topics import TOPICS, static_transforms
from viso.firmware.releases import PROFILES
from viso.vehicle.vehicle import Vehicle, VehicleConfig

HALF = math.sqrt(0.5)
ORIGIN = Location(-353632610, 1491652300, 58400)


class KnownAhrs(AhrsBase):
    """An AHRS that knows where it is, and how it moves."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle.clock, vehicle.sources, vehicle.replay_log)

    def get_quaternion(self) -> Quaternion | None:
        return Quaternion.from_euler(f32(0), f32(0), f32(math.pi / 2))  # the nose looks east

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        return Vector3f(10, 20, -30)

    def get_gyro(self) -> Vector3f:
        return Vector3f(0.1, 0.2, 0.3)

    def get_velocity_NED(self) -> Vector3f | None:
        return Vector3f(1, 2, 3)

    def get_imu(self) -> tuple[Vector3f, Vector3f] | None:
        return Vector3f(0, 1, -10), Vector3f(4, 5, 6)


def vehicle_of(firmware: str = "2025-07", **params: float) -> Vehicle:
    vehicle = Vehicle(VehicleConfig(KnownAhrs, defaults=params, firmware=PROFILES[firmware]))
    vehicle.clock.set_us(7_000_008)
    return vehicle


def told(vehicle: Vehicle, name: str, message: Any = None) -> Any:
    """Return what is told on a topic, or None for nothing."""
    [topic] = [topic for topic in TOPICS if topic.name == name]
    message = topic.message() if message is None else message
    return message if topic.update(vehicle, message) else None


@pytest.fixture
def vehicle() -> Vehicle:
    return vehicle_of()


def placed(vehicle: Vehicle) -> Vehicle:
    vehicle.set_origin(ORIGIN)
    vehicle.copter.home.set(ORIGIN, lock=True)
    return vehicle


def test_time_is_that_since_boot_until_the_time_of_day_is_known() -> None:
    vehicle = vehicle_of(BRD_RTC_TYPES=3)
    assert told(vehicle, "/ap/time") == ros.Time(7, 8000)
    vehicle.rtc.take_system_time(1_760_000_000_000_000)
    assert told(vehicle, "/ap/clock") == ros.Clock(ros.Time(1_760_000_000, 0))


def test_pose_is_from_home_with_x_east_y_north_z_up(vehicle: Vehicle) -> None:
    pose = told(placed(vehicle), "/ap/pose/filtered")
    assert pose.header == ros.Header(ros.Time(7, 8000), "base_link")
    place = pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((20, 10, 30), abs=0.02)
    turn = pose.pose.orientation
    assert (turn.w, turn.x, turn.y, turn.z) == pytest.approx((1, 0, 0, 0), abs=1e-6)


def test_pose_has_no_place_without_home(vehicle: Vehicle) -> None:
    assert told(vehicle, "/ap/pose/filtered").pose.position == ros.Point()


def test_twist_has_its_velocity_on_the_map_and_its_turn_in_the_body(vehicle: Vehicle) -> None:
    twist = told(vehicle, "/ap/twist/filtered").twist
    assert twist.linear == ros.Vector3(2.0, 1.0, -3.0)
    assert twist.angular == ros.Vector3(float(f32(0.1)), -float(f32(0.2)), -float(f32(0.3)))


def test_imu_is_in_the_firmwares_axes_with_the_scalar_first(vehicle: Vehicle) -> None:
    imu = told(vehicle, "/ap/imu/experimental/data")
    assert imu.header.frame_id == "base_link_ned"
    turn = imu.orientation
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((HALF, 0, 0, HALF))
    assert (imu.linear_acceleration, imu.angular_velocity) == (ros.Vector3(0.0, 1.0, -10.0), ros.Vector3(4.0, 5.0, 6.0))


@pytest.mark.parametrize(("firmware", "first"), [("4.6", -1), ("2025-07", -1), ("2026-02", 0), ("2026-04", 0)])
def test_covariances_are_unknown_or_0_by_release(firmware: str, first: float) -> None:
    imu = told(vehicle_of(firmware), "/ap/imu/experimental/data")
    assert imu.orientation_covariance == imu.linear_acceleration_covariance == [first, *[0.0] * 8]


def test_places_on_earth_are_told_in_float32(vehicle: Vehicle) -> None:
    place = told(placed(vehicle), "/ap/gps_global_origin/filtered").position
    assert place.latitude == float(f32(ORIGIN.lat) * f32(1e-7))
    assert place.longitude == float(f32(ORIGIN.lng) * f32(1e-7))
    assert place.altitude == 584
    assert told(vehicle, "/ap/geopose/filtered").pose.position.altitude == pytest.approx(614)


def test_status_is_told_when_it_changes(vehicle: Vehicle) -> None:
    status = told(vehicle, "/ap/status")
    assert (status.vehicle_type, status.armed, status.flying, status.external_control) == (2, False, False, True)
    assert told(vehicle, "/ap/status", status) is None
    vehicle.copter.set_mode(2)
    assert told(vehicle, "/ap/status", status).mode == 2


def test_status_is_told_twice_a_second_in_2026() -> None:
    vehicle = vehicle_of("2026-04")
    status = told(vehicle, "/ap/status")
    vehicle.clock.set_us(7_500_008)
    assert told(vehicle, "/ap/status", status) is None
    vehicle.clock.set_us(7_501_008)
    assert told(vehicle, "/ap/status", status) is status


def test_antenna_stands_in_the_imu() -> None:
    [transform] = static_transforms(vehicle_of()).transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_link", "GPS_0")
    assert static_transforms(vehicle_of(GPS1_TYPE=0)).transforms == []


def answer(vehicle: Vehicle, service: str, request: Any) -> Any:
    call: Callable[[Vehicle, Any], Any] = {each.name: each.answer for each in SERVICES}[service]
    return call(vehicle, request)


def test_arming_by_a_service_is_told_and_makes_all_checks(vehicle: Vehicle) -> None:
    texts: list[str] = []
    vehicle.texts.on_text.append(lambda _severity, text: texts.append(text))
    vehicle.copter.arming.pre_arm_checks = lambda display: False  # type: ignore[method-assign]
    asked = ros.RequestId(1, 2)
    assert answer(vehicle, "/ap/arm_motors", ros.ArmMotorsRequest(asked, True)) == ros.ArmMotorsResponse(asked, False)
    assert (texts[0], texts[-1]) == ("DDS: Request for arming received", "DDS: Request for Arming/Disarming : FAIL")
    checked = answer(vehicle, "/ap/prearm_check", ros.TriggerRequest(asked))
    assert checked == ros.TriggerResponse(asked, False, "Vehicle is Not Armable")


def test_mode_is_switched_by_a_service(vehicle: Vehicle) -> None:
    switched = answer(vehicle, "/ap/mode_switch", ros.ModeSwitchRequest(ros.RequestId(), 2))
    assert (switched.status, switched.curr_mode) == (True, 2)
    refused = answer(vehicle, "/ap/mode_switch", ros.ModeSwitchRequest(ros.RequestId(), 200))
    assert (refused.status, refused.curr_mode) == (False, 2)
