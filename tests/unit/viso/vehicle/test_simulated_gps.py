# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The GPS of the firmware's simulator; times and numbers are those of a recorded flight of the reference."""

import math
from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from ekf_stub.inputs.measurements import GpsSample
from mav_handlers.senders.gps import gps_raw_int
from viso.firmware.releases import PROFILES
from viso.testing import Autopilot, AutopilotOptions
from viso.testing.golden import GoldenFiles
from viso.vehicle.config import VehicleConfig, by_ekf3
from viso.vehicle.sensors.airframe import Demand
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import HOME, ImuOptions
from viso.vehicle.vehicle import Vehicle

if TYPE_CHECKING:
    from pathlib import Path

START_MS = 9_775
PERIOD_MS = 200
BOOT_UTC_US = 1_795_000_000_000_000
BY_GPS = {
    "GPS1_TYPE": 1,
    "VISO_TYPE": 0,
    "COMPASS_ENABLE": 1,
    "EK3_SRC1_POSXY": 3,
    "EK3_SRC1_VELXY": 3,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 3,
    "EK3_SRC1_YAW": 1,
}


class Receiver:
    """A vehicle that flies, whose GPS task alone runs."""

    def __init__(self, *, firmware: str = "2025-07", boot_utc_us: int = 0, **params: float) -> None:
        config = VehicleConfig(
            by_ekf3(FlyingSource, ImuOptions()),
            firmware=PROFILES[firmware],
            boot_utc_us=boot_utc_us,
            overrides=params,
        )
        self.vehicle = Vehicle(config)
        self.texts: list[tuple[int, str]] = []
        self.vehicle.texts.on_text.append(lambda _, text: self.texts.append((self.now_ms, text)))
        self.now_ms = 2_455
        self.step()

    def step(self) -> None:
        self.vehicle.clock.set_us(1000 * self.now_ms)
        self.vehicle.gps.update()

    def run(self, until_ms: int) -> GpsSample | None:
        while self.now_ms < until_ms:
            self.now_ms += 20
            self.step()
        return self.vehicle.gps.sample()

    def fix(self, until_ms: int = 11_000) -> GpsSample:
        sample = self.run(until_ms)
        assert sample is not None
        return sample


def receiver_with(name: str, value: float) -> Receiver:
    receiver = Receiver()
    receiver.vehicle.params.set(name, value)
    return receiver


def test_receiver_is_found_after_the_firmware_has_tried_other_speeds() -> None:
    receiver = Receiver()
    assert receiver.run(START_MS - 20) is None
    assert receiver.vehicle.gps.lag_s() == pytest.approx(0.1)
    receiver.run(START_MS + 40)
    assert receiver.texts == [
        (START_MS, "GPS 1: probing for u-blox at 230400 baud"),
        (START_MS + 40, "GPS 1: detected u-blox"),
    ]


def test_first_solution_has_no_fix_as_what_is_old_is_nothing_yet() -> None:
    receiver = Receiver()
    first, second = receiver.fix(START_MS + 40), receiver.fix(START_MS + 240)
    assert (first.fix_type, first.num_sats, first.last_fix_ms) == (1, 3, 0)
    assert (second.fix_type, second.num_sats, second.time_ms) == (6, 10, START_MS + 204)
    assert second.location == HOME


def test_solution_is_that_of_the_recorded_receiver() -> None:
    sample = Receiver().fix()
    assert (sample.hdop, sample.vdop, sample.lag_s) == (121, 200, 0.12)
    assert (sample.horizontal_accuracy, sample.vertical_accuracy) == pytest.approx((0.3, 0.3))
    assert sample.speed_accuracy == 0.0
    assert sample.has_vertical_velocity
    assert sample.is_healthy


def test_solutions_come_five_times_per_second_or_as_often_as_asked() -> None:
    receiver = Receiver()
    before = receiver.fix().time_ms
    assert receiver.fix(receiver.now_ms + PERIOD_MS).time_ms == before + PERIOD_MS
    receiver.vehicle.params.set("SIM_GPS1_HZ", 10)
    before = receiver.fix(receiver.now_ms + 400).time_ms
    assert receiver.fix(receiver.now_ms + 100).time_ms == before + 100
    receiver.vehicle.params.set("SIM_GPS1_HZ", 0)
    assert receiver.fix(receiver.now_ms + 2000).time_ms <= before + 200


def test_solution_is_late() -> None:
    receiver = Receiver(SIM_GPS1_LAG_MS=150)
    receiver.fix()
    airframe = receiver.vehicle.source.airframe
    assert airframe is not None
    receiver.run(12_000)
    airframe.demand(Demand(thrust_m_s2=15.0))
    for now_ms in range(12_000, 15_000, 20):
        airframe.go_to(1000 * now_ms)
        receiver.run(now_ms)
    sample, truth = receiver.fix(receiver.now_ms), airframe.truth()
    late_m = -truth.pos_ned[2] - 0.01 * (sample.location.alt_cm - HOME.alt_cm)
    assert 0.15 * 10 < late_m < 0.4 * 12


def test_disabled_receiver_has_three_satellites_and_no_fix() -> None:
    receiver = Receiver()
    receiver.fix()
    receiver.vehicle.params.set("SIM_GPS1_ENABLE", 0)
    sample = receiver.fix(receiver.now_ms + 1000)
    assert (sample.fix_type, sample.num_sats) == (1, 3)
    receiver.vehicle.params.set("SIM_GPS1_ENABLE", 1)
    assert receiver.fix(receiver.now_ms + 1000).fix_type == 6


def test_release_4_6_has_other_names() -> None:
    receiver = Receiver(firmware="4.6", SIM_GPS_GLITCH_Z=3.0, SIM_GPS_LOCKTIME=12)
    assert receiver.fix(11_900).fix_type == 1
    assert receiver.fix(13_000).location == Location(HOME.lat, HOME.lng, HOME.alt_cm + 300)
    receiver.vehicle.params.set("SIM_GPS_DISABLE", 1)
    assert receiver.fix(14_000).fix_type == 1


@pytest.mark.parametrize(
    ("name", "value", "lat", "lng", "alt_cm"),
    [("GLTCH_X", 0.001, 10_000, 0, 0), ("GLTCH_Y", -0.001, 0, -10_000, 0), ("ALT_OFS", 5, 0, 0, 500)],
)
def test_position_is_wrong_as_asked(name: str, value: float, lat: int, lng: int, alt_cm: int) -> None:
    location = receiver_with(f"SIM_GPS1_{name}", value).fix().location
    assert (location.lat - HOME.lat, location.lng - HOME.lng) == pytest.approx((lat, lng), abs=1)
    assert location.alt_cm - HOME.alt_cm == pytest.approx(alt_cm, abs=1)


def test_height_sways_and_drifts() -> None:
    swaying, drifting = Receiver(SIM_GPS1_NOISE=10.0, SIM_GPS1_LAG_MS=0), Receiver(SIM_GPS1_DRFTALT=10.0)
    sample = swaying.fix()
    sent_s = 0.001 * (sample.time_ms + 16)
    assert sample.location.alt_cm - HOME.alt_cm == pytest.approx(1000 * math.sin(0.5 * sent_s), abs=2)
    assert drifting.fix().location.alt_cm - HOME.alt_cm == pytest.approx(1000 * math.sin(0.02 * 10.675), abs=5)


def test_velocity_has_random_errors_and_an_accuracy_of_a_tenth_of_them() -> None:
    receiver = Receiver(SIM_GPS1_VERR_X=3.0, SIM_GPS1_VERR_Y=4.0)
    samples = [receiver.fix(now_ms) for now_ms in range(11_000, 21_000, PERIOD_MS)]
    north = [float(sample.vel_ned.x) for sample in samples]
    assert 1.0 < max(north) <= 3.0
    assert -3.0 <= min(north) < -1.0
    assert samples[0].speed_accuracy == pytest.approx(0.5)


def test_time_of_day_comes_from_the_receiver_if_it_knows_it() -> None:
    knowing, unknowing = Receiver(boot_utc_us=BOOT_UTC_US, BRD_RTC_TYPES=1), Receiver()
    knowing.fix()
    unknowing.fix()
    assert knowing.vehicle.rtc.utc_us() == pytest.approx(BOOT_UTC_US + 1000 * knowing.now_ms, abs=250_000)
    assert unknowing.vehicle.rtc.utc_us() == 0


@pytest.mark.parametrize(("firmware", "off"), [("4.6", {"SIM_GPS2_DISABLE": 1}), ("2025-07", {"SIM_GPS2_ENABLE": 0})])
def test_second_receiver_is_silent_unless_it_is_there(firmware: str, off: dict[str, float]) -> None:
    receiver = Receiver(firmware=firmware, GPS2_TYPE=1)
    second = receiver.vehicle.gps.all[1]
    receiver.run(12_000)
    assert second.sample() is None
    [(name, is_off)] = off.items()
    receiver.vehicle.params.set(name, 1 - is_off)
    receiver.vehicle.params.set("SIM_GPS2_GLTCH_Z", -30)
    receiver.run(22_000)
    found = second.sample()
    assert found is not None
    assert (found.fix_type, found.location.alt_cm) == (6, HOME.alt_cm - 3000)
    assert receiver.fix(receiver.now_ms).location == HOME
    receiver.vehicle.params.set(name, is_off)
    receiver.run(27_000)
    assert second.sample() is None


def test_vehicle_that_nobody_flies_has_no_receiver() -> None:
    vehicle = Vehicle(VehicleConfig(overrides={"GPS1_TYPE": 1}))
    for now_ms in range(2_455, 13_000, 20):
        vehicle.clock.set_us(1000 * now_ms)
        vehicle.gps.update()
    assert vehicle.gps.sample() is None


def test_flight_by_gps_alone(tmp_path: "Path") -> None:
    golden = GoldenFiles(tmp_path, update=False)
    autopilot = Autopilot(AutopilotOptions(imu="fly", firmware="2025-07", params=BY_GPS), golden)
    vehicle = autopilot.vehicle
    assert not vehicle.source.knows_declination
    autopilot.advance(s=11.0 - 1e-6 * autopilot.now_us)
    assert vehicle.source.knows_declination  # by the first fix, as the recorded compass
    assert vehicle.ahrs.origin() is None
    autopilot.advance(s=10)
    assert vehicle.ahrs.origin() == vehicle.copter.home.place == HOME
    autopilot.takeoff(5)
    autopilot.goto(8, -6, 5)
    north, east, down = autopilot.truth.pos_ned
    assert (north, east, down) == pytest.approx((8, -6, -5), abs=0.5)
    raw = gps_raw_int(vehicle, vehicle.endpoint.channels[0], autopilot.now_us)
    assert raw is not None
    assert (raw.fix_type, raw.satellites_visible, raw.eph, raw.epv) == (6, 10, 121, 200)
    autopilot.land()
    for text in ("EKF3 IMU0 origin set", "Field Elevation Set: 584m", "EKF3 IMU0 is using GPS"):
        autopilot.assert_text(text)
    autopilot.close()
