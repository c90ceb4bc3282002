# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle navigates by flow and ranges that come over MAVLink, as vehicles of the reference did."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

from ekf_stub.log.replay_log import TERRAIN_STABLE
from mav_handlers.senders.attitude import ekf_status_report
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    COMMAND_LONG,
    DISTANCE_SENSOR,
    OPTICAL_FLOW,
    SET_GPS_GLOBAL_ORIGIN,
    SET_MODE,
    VISION_POSITION_ESTIMATE,
    Message,
)
from tests.unit.viso.conftest import read_log
from viso.firmware.releases import JULY_2025, PROFILES, Firmware
from viso.logs.logger import MemoryLog
from viso.replay.ekf.run import EkfRun
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.stream.follow import FollowSource
from viso.vehicle.vehicle import Vehicle, VehicleConfig

FLOW: Final = {
    "GPS1_TYPE": 0,
    "FLOW_TYPE": 5,
    "FLOW_FXSCALER": -800,
    "FLOW_FYSCALER": -800,
    "FLOW_POS_X": 0.1,
    "RNGFND1_TYPE": 10,
    "RNGFND1_MIN": 0.05,
    "RNGFND1_MAX": 30,
    "RNGFND1_POS_Z": 0.05,
    "INS_POS1_X": 0.03,
    "INS_POS2_X": 0.03,
    "EK3_SRC1_POSXY": 0,
    "EK3_SRC1_VELXY": 5,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 0,
    "EK3_SRC1_YAW": 1,
    "LOG_DISARMED": 1,
    "LOG_REPLAY": 1,
}
FLOW_AND_POSES: Final = {**FLOW, "VISO_TYPE": 1, "VISO_DELAY_MS": 30, "EK3_SRC1_POSXY": 6}

SAID_WITH_FLOW: Final = [
    *("EKF3 IMU0 initialised", "AHRS: EKF3 active", "EKF3 IMU0 fusing optical flow"),
    *("EKF3 IMU0 tilt alignment complete", "EKF3 IMU0 started relative aiding"),
    "EKF3 IMU0 MAG0 initial yaw alignment complete",
]
"""As recorded, 4.45 s to 4.77 s after boot."""
SAID_WITH_POSES_AS_WELL: Final = [
    *SAID_WITH_FLOW[:-1],
    *("EKF3 IMU0 is using external nav data", "EKF3 IMU0 initial pos NED = 0.0,0.0,-0.1 (m)"),
    SAID_WITH_FLOW[-1],
]
RELATIVE_FLAGS, ABSOLUTE_FLAGS = 367, 895  # of EKF_STATUS_REPORT, from XKF4.SS of the recordings
GUIDED, ARM, TAKE_OFF = 4, 400, 22


class Parked:
    """A vehicle from boot on, above which nothing moves; its sensors are heard 25 times per second."""

    def __init__(self, params: Mapping[str, float], firmware: Firmware = JULY_2025) -> None:
        self.log = MemoryLog()
        moved = by_ekf3(FollowSource, ImuOptions())  # by nobody, as no pose comes in
        self.vehicle = Vehicle(VehicleConfig(moved, defaults=params, open_log=lambda: self.log, firmware=firmware))
        self.texts: list[str] = []
        self.vehicle.texts.on_text.append(lambda _severity, text: self.texts.append(text))
        self._has_camera = "VISO_TYPE" in params
        self._scheduler = Scheduler(self.vehicle)
        self.channel = self.vehicle.endpoint.open_channel("sensors")
        self._codec = Codec(1, 197)
        self._random = np.random.default_rng(3)
        self._next_us = 27_000

    def tell(self, message: Message) -> None:
        self.vehicle.receive_bytes(self.channel, self._codec.encode(message))

    def command(self, number: int, *values: float) -> None:
        self.tell(COMMAND_LONG(1, 1, number, 0, *map(float, (*values, *[0] * (7 - len(values))))))

    def run_to(self, time_s: float) -> None:
        while self._next_us < time_s * 1e6:
            time_us, self._next_us = self._next_us, self._next_us + 40_000
            self._scheduler.run_until(time_us)
            flow_x, flow_y = map(int, self._random.integers(-2, 3, 2))
            self.tell(OPTICAL_FLOW(time_us, 0, flow_x, flow_y, 0.0, 0.0, 180, 0.0))
            self.tell(DISTANCE_SENSOR(time_us // 1000, 5, 3000, int(self._random.integers(17, 20)), 0, 0, 25, 0))
            if self._has_camera:
                self.tell(VISION_POSITION_ESTIMATE(time_us, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0))

    def said(self) -> list[str]:
        """Return what the first core and the vehicle said since it was ready."""
        said = self.texts[self.texts.index("AHRS: DCM active") + 1 :]
        return [text for text in said if "IMU1" not in text]


@pytest.fixture(scope="module")
def by_flow() -> Parked:
    """Return a vehicle that has just begun to navigate by flow alone."""
    parked = Parked(FLOW)
    parked.run_to(5.6)
    return parked


def test_flow_starts_relative_aiding_as_recorded(by_flow: Parked) -> None:
    assert by_flow.said() == SAID_WITH_FLOW


def test_flow_and_ranges_give_the_recorded_flags(by_flow: Parked) -> None:
    report = ekf_status_report(by_flow.vehicle, by_flow.channel, 5_600_000)
    assert report is not None
    assert report.flags == RELATIVE_FLAGS
    assert 0 < report.terrain_alt_variance < 0.1
    assert by_flow.vehicle.ahrs.height_above_ground() == pytest.approx(0.18 - 0.03, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("firmware", [*PROFILES.values()], ids=[*PROFILES])
def test_every_release_navigates_by_flow(firmware: Firmware) -> None:
    limits = {name: value for name, value in FLOW.items() if not name.startswith("RNGFND1_M")}
    parked = Parked(limits, firmware)
    unit = firmware.params.range_unit
    parked.vehicle.params.set(f"RNGFND1_{unit.least}", 0.05 / float(unit.metres))
    parked.run_to(5.6)
    assert "EKF3 IMU0 started relative aiding" in parked.said()
    flags = parked.vehicle.ahrs.get_filter_status().flags  # type: ignore[union-attr]
    assert int(flags) == RELATIVE_FLAGS


@pytest.fixture(scope="module")
def flights() -> Any:
    """Return how to make a vehicle that has navigated, armed and taken off; each is made once."""

    @cache
    def fly(*, with_camera: bool) -> Parked:
        parked = Parked(FLOW_AND_POSES if with_camera else FLOW)
        parked.run_to(6.5)
        parked.tell(SET_GPS_GLOBAL_ORIGIN(1, -353_632_621, 1_491_652_374, 584_090))
        parked.run_to(23.0)
        parked.tell(SET_MODE(1, 1, GUIDED))
        parked.command(ARM, 1)
        parked.run_to(23.5)
        parked.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 3)
        parked.run_to(27.0)
        parked.vehicle.close()
        return parked

    return fly


@pytest.mark.slow
@pytest.mark.parametrize("with_camera", [False, True])
def test_vehicle_arms_and_takes_off_by_flow(flights: Any, with_camera: bool) -> None:
    parked = flights(with_camera=with_camera)
    started = SAID_WITH_POSES_AS_WELL if with_camera else SAID_WITH_FLOW
    assert parked.said() == [
        *started,
        *("EKF3 IMU0 origin set", "Field Elevation Set: 584m", "Arming motors"),
    ]
    flags = parked.vehicle.ahrs.get_filter_status().flags
    assert int(flags) == (ABSOLUTE_FLAGS if with_camera else RELATIVE_FLAGS)
    assert not parked.vehicle.copter.is_landed()


@pytest.mark.slow
@pytest.mark.parametrize("with_camera", [False, True])
def test_filter_says_the_same_of_the_log_that_it_left(flights: Any, with_camera: bool, tmp_path: Path) -> None:
    flown, again = tmp_path / "flown.BIN", tmp_path / "again.BIN"
    flown.write_bytes(flights(with_camera=with_camera).log.data)
    run = EkfRun(flown)
    run.run()
    run.output.save(again)
    logged, ours = read_log(flown), read_log(again)
    assert [record["Event"] for record in logged if record["name"] == "REV3"][-1] == TERRAIN_STABLE
    estimates = estimates_of(logged)
    assert len(estimates) > 3000
    assert estimates_of(ours) == estimates


def estimates_of(log: list[dict[str, Any]]) -> list[str]:
    """Return what a filter said; not a number is the same as itself."""
    return [repr(record) for record in log if record["name"].startswith("XK")]
