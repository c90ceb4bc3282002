# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle whose flight is flown again is armed, flies, and changes its sources when the vehicle of the log did."""

from typing import Any

import numpy as np
import pytest

from ap_core.dataflash_columns import LogColumns
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from viso.firmware.releases import DEFAULT, JULY_2025, Firmware
from viso.logs.logger import MemoryLog
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.copter.modes import ModeNumber
from viso.vehicle.sensors.flight import PASS_US, Basis, Event, Flight, Happening, Readings, readings
from viso.vehicle.sensors.flown.source import RecordedSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.vehicle import Vehicle, VehicleConfig

PLACE = Location(-353632610, 1491652300, 58400)
END_US = 3_000_000
TIMES_US = np.arange(2_450_000, 3_600_000, PASS_US)
DELTA = [0.0, 0.0, -9.80665 * 1e-6 * PASS_US, 0.0, 0.0, 0.0, 1e-6 * PASS_US, 1e-6 * PASS_US]
FIX = GpsSample(2_600, 3, PLACE, Vector3f(), num_sats=10, hdop=100)


def flown(
    *events: Event,
    until_us: int = END_US,
    expected: tuple[bool, bool] | None = None,
    log: MemoryLog | None = None,
    firmware: Firmware = DEFAULT,
    **params: float,
) -> Vehicle:
    """Return a vehicle that stands still, while this happens to it."""
    nothing: Readings[Any] = readings([], [], TIMES_US)
    flight = Flight(
        Basis.IMU,
        TIMES_US,
        np.tile(DELTA, (len(TIMES_US), 1)),
        baro=nothing,
        mag=nothing,
        declination=nothing,
        yaw_rad=nothing,
        gps=readings([FIX], [2_600_000], TIMES_US),
        events=events,
        track=np.zeros((0, 4)),
        expected=expected and readings([expected], [0], TIMES_US),
    )
    make_ahrs = by_ekf3(lambda options: RecordedSource(options, flight), ImuOptions())
    open_log = None if log is None else lambda: log
    vehicle = Vehicle(VehicleConfig(make_ahrs, defaults=params, open_log=open_log, firmware=firmware))
    Scheduler(vehicle).run_until(until_us)
    return vehicle


ARMED, LIFTED_OFF = Event(2_500_000, Happening.ARMED), Event(2_600_000, Happening.LIFTED_OFF)


def test_it_is_armed_whatever_checks_say_and_flies() -> None:
    vehicle = flown(ARMED, LIFTED_OFF)
    assert vehicle.copter.is_armed()
    assert vehicle.copter.landing.flying_since_us() == 2_600_000


def test_it_lands_and_is_disarmed() -> None:
    vehicle = flown(ARMED, LIFTED_OFF, Event(2_700_000, Happening.LANDED), Event(2_800_000, Happening.DISARMED))
    assert not vehicle.copter.is_armed()
    assert vehicle.copter.is_landed()


def test_it_neither_lands_nor_is_disarmed_by_itself() -> None:
    landing = Event(2_700_000, Happening.LANDED)
    assert flown(ARMED, LIFTED_OFF, INITIAL_MODE=ModeNumber.LAND).copter.landing.flying_since_us() == 2_600_000
    assert flown(ARMED, LIFTED_OFF, landing, INITIAL_MODE=ModeNumber.LAND).copter.is_armed()


def test_a_log_that_does_not_tell_of_flying_leaves_that_to_the_vehicle() -> None:
    assert not flown(ARMED, until_us=4_600_000, INITIAL_MODE=ModeNumber.LAND).copter.is_armed()


@pytest.mark.parametrize(("expected", "bits"), [((False, True), 128), ((False, False), 0), (None, 64)])
def test_filter_expects_take_off_and_touchdown_as_told_or_else_by_itself(
    expected: tuple[bool, bool] | None, bits: int
) -> None:
    log = MemoryLog()
    flown(ARMED, until_us=3_500_000, expected=expected, log=log, LOG_REPLAY=1)
    assert LogColumns(log.data).columns("RFRN")["Flags"][-1] == 1 + bits


def test_source_set_and_origin_are_those_of_the_log() -> None:
    # An origin waits for the filter's state in this release; later ones refuse it until then.
    vehicle = flown(
        Event(2_500_000, Happening.SOURCE_SET, 1),
        Event(3_550_000, Happening.ORIGIN, PLACE),
        until_us=3_600_000,
        firmware=JULY_2025,
    )
    assert vehicle.sources.active_set == 1
    assert vehicle.ahrs.origin() == PLACE


def test_gps_is_that_of_the_log() -> None:
    vehicle = flown()
    assert vehicle.source.gps() is FIX
