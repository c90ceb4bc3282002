# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of the main loop that are run in blocks: the same comes of them, however long the blocks are.

The same happens to three vehicles. One makes each pass by itself, one makes blocks of random sizes, and one makes them
as large as possible. They send and log the same bytes, and say the same of all messages and samples, whatever their
sensors' data come from.
"""

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pytest

from ap_core.location import Location
from mav_handlers.wire.messages import (
    GPS_INPUT,
    HIL_SENSOR,
    OPTICAL_FLOW,
    PARAM_SET,
    SET_GPS_GLOBAL_ORIGIN,
    SET_POSITION_TARGET_LOCAL_NED,
)
from tests.property import test_ekf3_ahrs_machine as machine
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.flight import PASS_US, Basis, Event, Flight, Happening, readings
from viso.vehicle.sensors.flown.source import RecordedSource
from viso.vehicle.sensors.hil import HilSource
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import BenchSource

pytestmark = pytest.mark.slow

PLACE: Final = Location(-353632610, 1491652300, 58400)
NOISY: Final = ImuOptions(errors=SensorErrors(gyro_noise_deg_s_rthz=0.02, baro_noise_m=0.1, compass_noise_mgauss=2.0))
PARAMETERS: Final = (
    *("LOG_REPLAY", "LOG_DISARMED", "EK3_SRC1_YAW", "EK3_SRC1_POSXY", "GPS1_TYPE", "COMPASS_USE"),
    *("LOG_BITMASK", "EK3_MAG_CAL", "VISO_DELAY_MS", "EK3_OGNM_TEST_SF"),
)


def flown() -> Flight:
    """Return a flight whose log has noise, readings and things that happen."""
    draw = np.random.default_rng(1)
    times_us = np.arange(2_450_000, 20_000_000, PASS_US)
    deltas = np.tile([0.0, 0.0, -9.80665 * 1e-6 * PASS_US, 0.0, 0.0, 0.0, 1e-6 * PASS_US, 1e-6 * PASS_US], (7020, 1))
    deltas[:, :6] += 1e-4 * draw.standard_normal((len(deltas), 6)).astype(np.float32)
    happens = (
        Event(7_000_000, Happening.ARMED),
        Event(7_501_000, Happening.LIFTED_OFF),
        Event(13_000_000, Happening.LANDED),
        Event(13_800_000, Happening.DISARMED),
    )
    read_us = np.arange(2_500_000, 20_000_000, 100_000)
    near_ground = [(False, False), (True, False), (False, False), (False, True), (False, False)]
    near_ground_us = [2_500_000, 7_003_000, 8_504_000, 12_011_000, 13_801_000]
    return Flight(
        Basis.IMU,
        times_us,
        deltas.astype(np.float32).astype(np.float64),
        baro=readings([(int(time_us) // 1000, 0.0) for time_us in read_us], read_us, times_us),
        mag=readings([(int(time_us), np.array([238.0, 0.0, -529.0])) for time_us in read_us], read_us, times_us),
        declination=readings([0.2], [2_500_000], times_us),
        yaw_rad=readings([], [], times_us),
        gps=readings([], [], times_us),
        events=happens,
        track=np.zeros((0, 4)),
        expected=readings(near_ground, near_ground_us, times_us),
    )


MAKERS: Final = {
    **machine.MAKERS,
    "fly": by_ekf3(FlyingSource, ImuOptions(with_each_imu=True)),
    "noisy": by_ekf3(BenchSource, NOISY),
    "two": by_ekf3(BenchSource, replace(NOISY, errors=replace(NOISY.errors, imus=2.0))),
    "hil": by_ekf3(HilSource, ImuOptions()),
    "log": by_ekf3(lambda options: RecordedSource(options, flown()), ImuOptions()),
}


class Trip(machine.Trip):
    """A vehicle and its camera; ``most`` says how many passes the next block may have."""

    makers = MAKERS

    def __init__(self, kind: str, most: Callable[[], int], **defaults: float) -> None:
        super().__init__(kind, 0, LOG_REPLAY=0, **defaults)
        self._kind = kind
        self._scheduler = Scheduler(self.vehicle)
        self._next_hil_us = 0
        self.records: list[Any] = []
        self.stable: list[tuple[int, bool]] = []
        set_stable = self.vehicle.ahrs.set_terrain_stable

        def noted(*, is_stable: bool) -> None:
            self.stable.append((self.vehicle.clock.micros64(), is_stable))
            set_stable(is_stable=is_stable)

        self.vehicle.ahrs.set_terrain_stable = noted  # type: ignore[method-assign]
        self.verdicts: Counter[Any] = Counter()
        self.vehicle.logger.on_write = lambda structure, values: self.records.append((structure.name, str(values)))
        self.vehicle.endpoint.on_event = lambda event: self.verdicts.update([(event.now_us, event.verdict.rule.code)])
        advance = self.vehicle.advance
        self.vehicle.advance = lambda times_us: advance(times_us[: most()])  # type: ignore[method-assign]

    def run(self, seconds: float) -> None:
        """Let time pass, up to each message from without."""
        end_us = self.now_us + round(1e6 * seconds)
        while self.now_us < end_us:
            is_seen = self.is_seen and self._kind != "fly"  # which has a camera of its own
            due = [end_us, *([self._next_us] if is_seen else []), *([self._next_hil_us] * (self._kind == "hil"))]
            self.now_us = max(min(due), self.now_us)
            self._scheduler.run_until(self.now_us)
            if is_seen and self.now_us >= self._next_us:
                self._next_us = self.now_us + machine.PERIOD_US
                self.send(self.seen())
            if self._kind == "hil" and self.now_us >= self._next_hil_us:
                self._next_hil_us = self.now_us + 4_100
                fields = (0.0, 0.0, -9.80665, 0.0, 0.0, 0.0, 0.238, 0.0, -0.529, 1013.25, 0.0, 0.0, 20.0)
                self.send(HIL_SENSOR(self.now_us, *fields, 0, 0))
            self._read()

    def outcome(self) -> tuple[Any, ...]:
        """Return what the vehicle has sent, logged and said."""
        return (
            self.fingerprint(),
            self.texts,
            self.verdicts,
            self.vehicle.ahrs.ext_nav_counts,
            self.vehicle.endpoint.verdict_counts(),
        )


def happen(trip: Trip, draw: random.Random) -> None:
    """Do something to a vehicle, and let some time pass."""
    kinds = ["param", "arm", "takeoff", "mode", "source", "origin", "gps", "flow", "blind", "sense", "odd"]
    kind = draw.choice([*kinds, *(["up", "guide", "guide"] if trip.vehicle.source.airframe is not None else [])])
    if kind == "param":
        trip.send(PARAM_SET(1, 1, draw.choice(PARAMETERS), float(draw.randint(0, 6)), 9))
    elif kind == "arm":
        trip.command(machine.ARM_DISARM, float(draw.randint(0, 1)), machine.BY_FORCE)
    elif kind == "takeoff":
        trip.command(machine.TAKEOFF, *[0.0] * 6, 5.0)
    elif kind == "mode":
        trip.command(176, 1.0, float(draw.choice((0, 2, 4, 9))))
    elif kind == "source":
        trip.command(machine.SOURCE_SET, float(draw.randint(1, 3)))
    elif kind == "origin":
        trip.send(SET_GPS_GLOBAL_ORIGIN(1, PLACE.lat, PLACE.lng, draw.choice((0, 584_000))))
    elif kind == "gps":
        gps = replace(
            machine.any_message(draw, GPS_INPUT), gps_id=0, fix_type=3, lat=PLACE.lat, lon=PLACE.lng, alt=584.0
        )
        trip.send(gps)
    elif kind == "flow":
        trip.send(machine.any_message(draw, OPTICAL_FLOW))
    elif kind == "up":
        trip.command(machine.ARM_DISARM, 1.0, machine.BY_FORCE)
        trip.command(176, 1.0, 20.0)
        trip.command(machine.TAKEOFF, *[0.0] * 6, 5.0)
    elif kind == "guide":
        trip.command(176, 1.0, 4.0)
        mask = draw.choice((0b110111111000, 0b110111000111, 0b111111000000))
        place = draw.uniform(-5.0, 5.0), draw.uniform(-5.0, 5.0), draw.uniform(-8.0, 0.0)
        trip.send(SET_POSITION_TARGET_LOCAL_NED(0, 1, 1, draw.choice((1, 8)), mask, *place, 1.0, -0.5, *(0.0,) * 6))
    elif kind == "sense":
        machine.tell_sense(trip, draw)
    elif kind == "odd":
        trip.send(machine.any_vision(draw, trip.now_us))
    trip.is_seen = kind != "blind"
    trip.run(draw.uniform(0.0, 2.0 if kind != "blind" else 9.0))


def check_alike(kind: str, seed: int, times: int, **defaults: float) -> None:
    sizes = random.Random(seed + 100)
    each, *others = (Trip(kind, most, **defaults) for most in (lambda: 1, lambda: sizes.randint(1, 40), lambda: 1000))
    for trip in (each, *others):
        draw = random.Random(seed)
        trip.run(5.5)
        for _ in range(times):
            happen(trip, draw)
    for trip in others:
        differing = [pair for pair in zip(trip.records, each.records, strict=False) if pair[0] != pair[1]]
        assert (differing[:4], len(trip.records)) == ([], len(each.records))
        assert trip.outcome() == each.outcome()


@pytest.mark.parametrize("kind", sorted(MAKERS))
def test_same_comes_of_passes_in_blocks_of_any_size(kind: str) -> None:
    for seed in (0, 1, 5):
        check_alike(
            kind, seed, 9, GPS1_TYPE=14.0 * (seed % 2), FLOW_TYPE=5.0 * (seed == 5), COMPASS_USE=float(seed % 3)
        )


def unstable_at_us(most: int) -> int:
    """Return when heights count from the ground no longer, of a vehicle in LAND whose camera falls silent."""
    trip = Trip("bench", lambda: most, GPS1_TYPE=0.0)
    trip.run(9.0)
    trip.command(176, 1.0, 9.0)
    trip.run(2.03)
    assert trip.stable[-1][1]
    trip.is_seen, silent_us = False, trip.now_us
    trip.run(20.0)
    return next(us for us, is_stable in trip.stable if us > silent_us and not is_stable)


def test_end_of_a_position_is_seen_in_the_same_pass() -> None:
    assert unstable_at_us(1) == unstable_at_us(1000)
