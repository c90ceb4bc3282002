# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run of the filter, repeated from the log that it left, gives the same estimates to the last bit."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import pytest

from ap_core.clock import VirtualClock
from ap_core.location import Location
from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.imus import Imus
from ekf_stub.core.inputs import Compasses, CompassReading
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.params import EkfSources, Params
from ekf_stub.inputs.measurements import Array, InertialDelta, numbers_of
from ekf_stub.inputs.sensors import Sensors
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import RESET_HEIGHT_DATUM, ReplayLog, VehicleFrame
from ekf_stub.log.reporting import report_of
from ekf_stub.reports import words_of
from tests.ekf_replay import replay_ekf
from viso.firmware.releases import JULY_2025
from viso.logs.logger import STRUCTURES, Logger, MemoryLog
from viso.parameters.ekf3 import FLOW_LIMIT_LATER
from viso.parameters.table import make_groups
from viso.replay.ekf.run import EkfReplay

pytestmark = pytest.mark.slow

LAYOUTS: Final = {structure.name: structure for structure in STRUCTURES}
PARAMETERS: Final = {
    **{f"EK3_SRC1_{name}": 6 for name in ("POSXY", "VELXY", "VELZ")},
    "VISO_TYPE": 1,
    "VISO_POS_X": 0.25,
    "VISO_DELAY_MS": 20,
    "LOG_REPLAY": 1,
}
DELAY_MS: Final = 20
LEVER_ARM: Final = (0.25, 0.0, 0.0)
START_US: Final = 3_454_451
FRAME_US: Final = 2499
FRAMES: Final = 4000
POSE_EVERY: Final = 13
SLOW_EVERY: Final = 40
XKF_EVERY: Final = 3 * POSE_EVERY
FIRST_POSE: Final = 900
HEIGHT_RESET: Final = 1500
ORIGIN: Final = 1600
ARMED: Final = 2000
FLYING: Final = 2400
CLIMB_M_S: Final = 0.8
DECLINATION: Final = float(np.float32(0.2233572))
HOME: Final = Location(-353_632_610, 1_491_652_300, 58_400)
LABELS: Final = (
    *("VN", "VE", "VD", "PN", "PE", "PD", "IVN", "IVE", "IVD", "IPN", "IPE", "IPD"),
    *("SV", "SP", "SH", "TS", "SS"),
)


def single(values: Array) -> Array:
    return values.astype(np.float32).astype(np.float64)


class Flight:
    """Stands, then climbs, with noise: the filter's run, and its log.

    What the filter gives is noted where estimates are logged: after a pose has ended the frame.
    """

    def __init__(self) -> None:
        self.clock = VirtualClock()
        params = ParamTable(make_groups(1, make_params(), JULY_2025.params))
        for name, value in PARAMETERS.items():
            params.set(name, value)
        self.file = MemoryLog()
        logger = self._logger = Logger(self.clock, lambda: self.file)
        self.clock.set_us(START_US - 1_000_000)
        logger.update(True, params)
        for axis in "XYZ":
            logger.write_parameter(f"INS_POS1_{axis}", np.float32(0))
        self.log = ReplayLog(logger, lambda: logger.is_open and params.get_int("LOG_REPLAY") != 0)
        self.texts: list[tuple[float, str]] = []
        core_params, sources = Params(), EkfSources(lambda name: params.get_int(f"EK3_{name}"))
        renamed = {FLOW_LIMIT_LATER: JULY_2025.ekf.flow_limit}
        core_params.read(lambda name: params.get_number(f"EK3_{renamed.get(name, name)}"))
        imus = Imus()
        imus.imus[0].has_data = True
        sizes = buffer_sizes(params.get_int, sources, has_camera=True)
        self.lanes = Lanes(core_params, sources, [sizes], JULY_2025.ekf, imus, [0], [0], 1)
        (self.core,) = self.lanes.cores
        self.core.inputs.has_compass = True
        self.core.inputs.set_lever_arm(LEVER_ARM)
        self.rows: list[tuple[float, ...]] = []
        self._random = np.random.default_rng(3)
        self._baro = 3449, 0.0
        self._mag = 3_449_453, np.zeros(3)

    def run(self) -> None:
        for number in range(FRAMES):
            now_us = START_US + FRAME_US * number
            self.clock.set_us(now_us)
            self._run_frame(number, now_us)
            self._listen()
            if number >= FIRST_POSE and number % POSE_EVERY == 0:
                self._give_pose(number, now_us // 1000)
                if number % XKF_EVERY == 0:
                    self._note_estimates(now_us)
            if number == HEIGHT_RESET:
                self.log.event(RESET_HEIGHT_DATUM)
                assert self.lanes.reset_height_datum()
            if number == ORIGIN:
                self.log.origin(HOME)
                assert self.lanes.set_origin(HOME)
                self._listen()

    def _listen(self) -> None:
        """Note what the filter has said."""
        for text in self.lanes.texts:
            _, words = words_of(text.code, text.values)
            self.texts.append((self.clock.micros64() / 1e6, words))
        self.lanes.texts.clear()
        self.core.events.outcomes.clear()

    def _height(self, number: int) -> float:
        return CLIMB_M_S * 1e-6 * FRAME_US * max(number - FLYING, 0)

    def _sense(self, number: int, now_us: int) -> Sensors:
        if number % SLOW_EVERY == 0:
            noise = single(self._random.normal(0.0, [0.05, 2.0, 2.0, 2.0]))
            self._baro = now_us // 1000, float(np.float32(self._height(number) + noise[0]))
            self._mag = now_us, single(np.array([230.0, 52.0, -528.0]) + noise[1:])
        specific_force = np.array([0.02, -0.01, -9.80665]) + self._random.normal(0.0, 0.05, 3)
        turn_rate = self._random.normal(0.0, 0.002, 3)
        dt = float(np.float32(1e-6 * FRAME_US))
        delta = InertialDelta(single(specific_force * dt), single(turn_rate * dt), dt, dt)
        return Sensors(delta, self._baro, self._mag, DECLINATION)

    def _run_frame(self, number: int, now_us: int) -> None:
        sensors = self._sense(number, now_us)
        armed, flying_ms = number >= ARMED, max(0, 5 * (number - FLYING) // 2)
        takeoff_expected = ARMED <= number < FLYING
        home = HOME if number > ORIGIN else None
        was_initialised = self.core.initialised
        assert self.log.start_frame(now_us, flying_ms)
        self.log.vehicle(VehicleFrame(armed, takeoff_expected, home=home))
        self.log.sensors(sensors)
        self.log.frame(VisualOdomFrame(Vector3f(*LEVER_ARM), DELAY_MS, number >= FIRST_POSE, True))
        inputs = self.core.inputs
        inputs.armed, inputs.takeoff_expected = armed, takeoff_expected
        inputs.home_lat = 0 if home is None else home.lat
        inputs.set_baro(*self._baro)
        time_us, field = self._mag
        x, y, z = field.tolist()
        inputs.set_compasses(Compasses([CompassReading(time_us, (x, y, z))]))
        inputs.set_declination(sensors.declination)
        self.lanes.advance([float(now_us), float(flying_ms), 0.0, *numbers_of(sensors.delta)], 0, 1)
        self.log.note_run(was_initialised=was_initialised)

    def _give_pose(self, number: int, now_ms: int) -> None:
        noise = self._random.normal(0.0, 0.02, 6)
        pos = Vector3f(1.0 + noise[0], 2.0 + noise[1], noise[2] - self._height(number))
        vel = Vector3f(noise[3], noise[4], noise[5] - CLIMB_M_S * (number > FLYING))
        x, y, z = map(float, pos.to_tuple())
        err = np.float32(0.2)
        self.log.pose(pos, Quaternion(), (err, err), now_ms, DELAY_MS, 0)
        self.core.ext_nav.write_pose((x, y, z), float(err), 0.0, float(err), now_ms, DELAY_MS, 0)
        x, y, z = map(float, vel.to_tuple())
        err = np.float32(0.1)
        self.log.velocity(vel, err, now_ms, DELAY_MS)
        self.core.ext_nav.write_velocity((x, y, z), float(err), now_ms, DELAY_MS)

    def _note_estimates(self, now_us: int) -> None:
        for name in ("XKF4", "XKF1", "XKF3"):
            layout = LAYOUTS[name]
            self._logger.write(layout, (now_us, *[0] * (len(layout.fields) - 1)))
        self.log.note_logged()
        report = report_of(self.lanes, 0)
        pos_ned = (float(np.float32(coordinate)) for coordinate in report.pos_ned)  # as a log has them
        estimates = (*report.vel_ned, *pos_ned, *report.vel_innovation, *report.pos_innovation)
        ratios = map(math.sqrt, (report.vel_ratio, report.pos_ratio, report.height_ratio))
        self.rows.append((*estimates, *ratios, report.timeouts, report.flags))


@dataclass(frozen=True)
class Both:
    """The filter's own run, and its repetition from the log."""

    flight: Flight
    replay: EkfReplay


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Both]:
    @cache
    def run() -> Both:
        flight = Flight()
        flight.run()
        path = tmp_path_factory.mktemp("round_trip") / "flight.BIN"
        path.write_bytes(flight.file.data)
        return Both(flight, replay_ekf(path))

    return run


@pytest.mark.slow
def test_filter_navigates_in_this_flight(both: Callable[[], Both]) -> None:
    texts = [text for _, text in both().flight.texts]
    assert "is using external nav data" in texts
    north, east, down = both().flight.rows[-1][3:6]
    assert (north, east) == pytest.approx((1.0, 2.0), abs=0.5)
    assert down < -2.0


@pytest.mark.parametrize("label", LABELS)
def test_estimates_are_the_same_to_the_last_bit(both: Callable[[], Both], label: str) -> None:
    run = both()
    ours = [row[LABELS.index(label)] for row in run.flight.rows]
    assert len(ours) > 70
    assert run.replay.ours[label].tolist() == ours


def test_texts_are_the_same_in_the_same_frames(both: Callable[[], Both]) -> None:
    run = both()
    assert run.replay.our_texts == run.flight.texts
