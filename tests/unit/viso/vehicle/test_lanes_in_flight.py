# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that flies with two cores, of which one is led astray; as ArduPilot's own tests of lanes do it."""

from typing import Any

import pytest

from viso.firmware.releases import JULY_2025
from viso.logs.logger import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import VehicleConfig, by_ekf3
from viso.vehicle.copter.modes import ModeNumber, ModeReason
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.vehicle import Vehicle

pytestmark = pytest.mark.slow

SETTLED_S = 46.0
"""GPS is in use by then."""


class Flyer:
    """A vehicle with two IMUs that flies by GPS."""

    def __init__(self, *, vicon: bool = False, **params: float) -> None:
        log = MemoryLog()
        config = VehicleConfig(
            by_ekf3(FlyingSource, ImuOptions(with_each_imu=True)),
            defaults={"VISO_TYPE": 0, **params},
            firmware=JULY_2025,
            vicon=vicon,
            open_log=lambda: log,
        )
        self.vehicle = Vehicle(config)
        self._scheduler = Scheduler(self.vehicle)
        self.texts: list[str] = []
        self.vehicle.texts.on_text.append(lambda _, text: self.texts.append(text))
        self.records: list[tuple[str, dict[str, Any]]] = []
        self.vehicle.logger.on_write = lambda structure, values: self.records.append(
            (structure.name, dict(zip(structure.fields, values, strict=True)))
        )

    def run(self, seconds: float) -> None:
        self._scheduler.run_until(self._scheduler.now_us + round(1e6 * seconds))

    def set(self, **params: float) -> None:
        for name, value in params.items():
            self.vehicle.params.set(name, value)

    def take_off(self, height_m: float) -> None:
        copter = self.vehicle.copter
        assert copter.modes.set_mode(ModeNumber.GUIDED, ModeReason.GCS_COMMAND)
        self.run(0.1)
        assert copter.arm(do_checks=True), self.texts[-1]
        self.run(2.2)
        assert copter.take_off(100 * height_m, must_navigate=True)
        self.run(5.0 + height_m / 2)
        assert self.height_m == pytest.approx(height_m, abs=0.3)

    @property
    def height_m(self) -> float:
        airframe = self.vehicle.source.airframe
        assert airframe is not None
        return -airframe.truth().pos_ned[2]

    def heights_by_core(self) -> list[float]:
        cores = self.vehicle.ahrs.cores  # type: ignore[attr-defined]
        return [-core.position()[2] for core in cores.lanes.cores]

    def worst(self, label: str, core: int) -> float:
        """Return the largest value of a field of XKF4 so far."""
        return max(float(fields[label]) for name, fields in self.records if name == "XKF4" and fields["C"] == core)


def test_core_of_an_accelerometer_with_an_offset_is_left() -> None:
    flyer = Flyer(INS_ACCOFFS_X=0.001, INS_ACCSCAL_X=1.001)
    flyer.run(SETTLED_S)
    flyer.take_off(10)
    assert not [text for text in flyer.texts if "lane" in text]
    flyer.set(INS_ACCOFFS_X=5)
    flyer.run(10.0)
    assert [text for text in flyer.texts if "lane" in text] == ["EKF3 lane switch 1"]
    assert flyer.height_m == pytest.approx(10, abs=0.3)


def test_lanes_may_have_gps_that_disagree_at_first() -> None:
    flyer = Flyer(EK3_SRC1_POSZ=3, EK3_AFFINITY=1, GPS2_TYPE=1, SIM_GPS2_ENABLE=1, SIM_GPS2_GLTCH_Z=-30)
    flyer.run(SETTLED_S)
    assert flyer.heights_by_core() == pytest.approx([0, -30], abs=0.5)
    flyer.set(SIM_GPS2_GLTCH_Z=0)
    flyer.run(20.0)
    assert flyer.heights_by_core() == pytest.approx([0, 0], abs=0.5)
    flyer.take_off(20)
    flyer.set(INS_ACCOFFS_X=5)
    for _ in range(10):
        flyer.run(1.0)
        assert flyer.height_m == pytest.approx(20, abs=2)
    assert "EKF3 lane switch 1" in flyer.texts
    used = {fields["C"]: fields["GI"] for name, fields in flyer.records if name == "XKFS"}
    assert used == {0: 0, 1: 1}


def test_fault_of_one_core_s_source_leaves_the_other_alone() -> None:
    external = dict.fromkeys((f"EK3_SRC2_{row}" for row in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")), 6.0)
    flyer = Flyer(vicon=True, EK3_SRC_OPTIONS=8, **{"VISO_TYPE": 2, **external})
    flyer.run(SETTLED_S)
    flyer.take_off(3)
    flyer.run(5.0)
    flyer.set(SIM_VICON_GLIT_X=100, SIM_VICON_GLIT_Y=100)
    flyer.run(5.0)
    flyer.set(SIM_VICON_GLIT_X=0, SIM_VICON_GLIT_Y=0)
    flyer.set(SIM_BARO_GLITCH=10)
    flyer.run(5.0)
    flyer.set(SIM_BARO_GLITCH=0)
    assert flyer.worst("SP", 0) < 0.1
    assert flyer.worst("SP", 1) > 0.9
    assert flyer.worst("SH", 0) > 0.9
    assert flyer.worst("SH", 1) < 0.5
