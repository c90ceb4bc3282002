# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that moves as it is told, whose sensors tell its filter so until a test lets them lie."""

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from ap_core.location import Location
from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.ahrs.sources import ROWS
from ekf_stub.core.aiding import ABSOLUTE
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.core import Core
from ekf_stub.core.covariance import ACCEL, GYRO
from ekf_stub.core.imus import Imus
from ekf_stub.core.inputs import Compasses, CompassReading
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.params import EkfSources, Params
from ekf_stub.core.vectors import Vec3, euler_of, matrix, quat_of_euler, to_body, to_earth, wrap_pi
from ekf_stub.inputs.ingest_rules import KINDS, RULES
from ekf_stub.inputs.measurements import DOWNWARD, FinderState, GpsSample, RangeState, RangeStatus
from ekf_stub.log.reporting import report_of
from ekf_stub.release import JULY_2025, FilterRelease
from ekf_stub.reports import CoreReport, words_of
from viso.parameters.table import make_groups

HOME: Final = Location(-353632610, 1491652300, 58400)
FIELD_NED: Final = (238.0, 0.0, -529.0)
GRAVITY_MSS: Final = 9.80665
LOOP_US: Final = 2500
SLOW_LOOP_US: Final = 20_000
"""Passes of which each is a step of the filter, for what lasts long."""

START_US: Final = 10_000_000
DELAY_MS: Final = 10
"""VISO_DELAY_MS."""

WRAP_US: Final = (1 << 32) * 1000
PERIODS_US: Final = {
    "camera": 35_000,
    "velocity": 35_000,
    "odometry": 60_000,
    "flow": 60_000,
    "baro": 100_000,
    "compass": 100_000,
    "gps": 200_000,
    "ranges": 60_000,
}
"""Feeds, and how often each comes."""

NO_AIDING, MODE_ABSOLUTE, RELATIVE = 0, 1, 2
PARKED, NAVIGATING, MOVING = 0x100A7, 0x1233F, 0x1012F
"""Bits of XKF4.SS as they were recorded: at rest, by absolute position, and by relative motion."""

USING_POSITION, GLITCHING, QUALITY_GOOD, INITIALISED = 1 << 13, 1 << 14, 1 << 15, 1 << 16


class FilterRig:
    """A vehicle with its filter; it boots at ``START_US`` facing north, at rest and disarmed.

    Args:
        sources: rows of the first source set, such as ``66666``.
        has_compass: whether there is one.
        cores: how many there are, each with an IMU of its own; one IMU for all by default.
        release: of the filter.
        start_us, loop_us: when it boots, and how often a pass comes.
        params: by their names without ``EK3_``.

    Attributes:
        lanes: the filter under test.
        feeds: which sensors tell of the motion, each as often as ``PERIODS_US`` says.
        pos, vel, accel_ned, yaw, yaw_rate: the true motion: m, m/s, m/s/s, rad and rad/s.
        roll, pitch: the true tilt, rad.
        gyro_bias, accel_bias: of each IMU, rad/s and m/s/s, body.
        camera_shift, reset_ms: where the camera's origin is, m NED, and when its frame has jumped last.
        camera_yaw: by how much the camera's yaw is off, rad.
        camera_err, velocity_err: the errors that it tells, m and m/s.
        baro_shift: by how much the barometer reads too high, m.
        field_ned, iron: what the compass feels, mGauss: of the earth, and of the vehicle, body.
        compass_count: how many compasses there are.
        compasses: what is special in what each says, by its number.
        compasses_said: what is said of all of them.
        gps: what is special in a solution of the GPS.
        gps_shift: by how much its place is off, m NED.
        ground: how far below the origin the ground is, m.
        flying_ms, is_late: what passes say of the vehicle.
        said: time in ms and text of all that was said, the first core's without a name.
        outcomes, outcome_times_ms: kind and code of all that became of samples, and when those were observed.
        tested: kind, code, ratio and innovation of those that were tested.
    """

    def __init__(
        self,
        sources: str = "66666",
        *,
        has_compass: bool = False,
        cores: int = 1,
        release: FilterRelease = JULY_2025,
        start_us: int = START_US,
        loop_us: int = LOOP_US,
        longest_delay_ms: int = 0,
        **params: float,
    ) -> None:
        self.table = ParamTable(make_groups(0, make_params()))
        for row, number in zip(ROWS, sources, strict=True):
            self.table.set(f"EK3_SRC1_{row}", int(number))
        for name, value in params.items():
            self.table.set(f"EK3_{name}", value)
        self._params = Params()
        self.sources = EkfSources(self._get_int)
        self._read_params()
        sizes = buffer_sizes(
            self.table.get_int, self.sources, has_camera=True, has_flow=True, least_ms=longest_delay_ms
        )
        self.imus = Imus(cores)
        for imu in self.imus.imus:
            imu.has_data = True
        self.imus.loop_dt = 1e-6 * loop_us
        numbers = list(range(cores))
        self.lanes = Lanes(self._params, self.sources, [sizes] * cores, release, self.imus, numbers, numbers, cores)
        for core in self.lanes.cores:
            core.inputs.has_compass = has_compass
        self.now_us, self.loop_us = start_us, loop_us
        self.feeds = {"baro", "compass"} if has_compass else {"baro"}
        self._due_us = dict.fromkeys(PERIODS_US, 0)
        self.pos: Vec3 = (0.0, 0.0, 0.0)
        self.vel: Vec3 = (0.0, 0.0, 0.0)
        self.accel_ned: Vec3 = (0.0, 0.0, 0.0)
        self.yaw = self.yaw_rate = self.roll = self.pitch = 0.0
        self.gyro_bias: list[Vec3] = [(0.0, 0.0, 0.0)] * cores
        self.accel_bias: list[Vec3] = [(0.0, 0.0, 0.0)] * cores
        self.camera_shift: Vec3 = (0.0, 0.0, 0.0)
        self.reset_ms = 0
        self.camera_yaw = 0.0
        self.camera_err, self.velocity_err = 0.2, 0.1
        self.baro_shift = 0.0
        self.field_ned: Vec3 = FIELD_NED
        self.iron: Vec3 = (0.0, 0.0, 0.0)
        self.compass_count = 1
        self.compasses: dict[int, dict[str, Any]] = {}
        self.compasses_said: dict[str, Any] = {}
        self.gps: dict[str, Any] = {}
        self.gps_shift: Vec3 = (0.0, 0.0, 0.0)
        self.ground = 0.1
        self.flying_ms, self.is_late = 0, False
        self.said: list[tuple[int, str]] = []
        self.outcomes: list[tuple[str, str]] = []
        self.outcome_times_ms: list[int] = []
        self.tested: list[tuple[str, str, float, float]] = []

    # Parameters

    def _get_int(self, name: str) -> int:
        return self.table.get_int(f"EK3_{name}")

    def _read_params(self) -> None:
        self._params.read(lambda name: self.table.get_number(f"EK3_{name}"))

    def set_param(self, name: str, value: float) -> None:
        """Set a parameter by its name without ``EK3_``."""
        self.table.set(f"EK3_{name}", value)
        self.sources.forget()
        self._read_params()

    def use(self, sources: str, number: int = 1) -> None:
        """Change a source set."""
        for row, value in zip(ROWS, sources, strict=True):
            self.set_param(f"SRC{number}_{row}", int(value))

    # The main loop

    @property
    def core(self) -> Core:
        """The first core."""
        return self.lanes.cores[0]

    @property
    def now_ms(self) -> int:
        """Time since boot."""
        return self.now_us // 1000

    def run(self, seconds: float) -> None:
        """Let time pass, with passes of the main loop."""
        for _ in range(round(1e6 * seconds / self.loop_us)):
            self.one_pass()

    def one_pass(self) -> None:
        """Run the next pass of the main loop."""
        self.now_us += self.loop_us
        row = self.next_row()
        self.feed()
        self.lanes.advance(row, 0, 1)
        self.listen()

    def run_row(self, *numbers: float) -> None:
        """Run a pass whose inertial data are given: change of velocity (3), rotation (3), and the seconds of either."""
        self.now_us += self.loop_us
        self.lanes.advance([float(self.now_us), float(self.flying_ms), 0.0, *numbers], 0, 1)
        self.listen()

    def run_until(self, is_reached: Callable[[], object], within_s: float = 2.0) -> None:
        """Let time pass until something has come about, which it must."""
        for _ in range(round(1e6 * within_s / self.loop_us)):
            if is_reached():
                return
            self.one_pass()
        raise AssertionError(f"not within {within_s} s; said: {self.said}")

    def step(self) -> None:
        """Let time pass until the filter has made another step."""
        self.one_pass()
        while not self.core.stepped:
            self.one_pass()

    def skip(self, seconds: float) -> None:
        """Let time pass without passes, as on a vehicle whose main loop hangs."""
        self.now_us += round(1e6 * seconds)

    def lose(self, *feeds: str) -> None:
        """Let sensors say no more, and wait until what they have said has come due."""
        self.feeds.difference_update(feeds)
        self.run(0.16)

    def next_row(self) -> list[float]:
        """Move on by a pass, and return what the IMUs measure meanwhile."""
        dt = 1e-6 * self.loop_us
        turn = self.yaw_rate * dt
        rotation = matrix(quat_of_euler(self.roll, self.pitch, self.yaw + 0.5 * turn))
        north, east, down = self.accel_ned
        force = to_body(rotation, (north, east, down - GRAVITY_MSS))
        rates = to_body(rotation, (0.0, 0.0, self.yaw_rate))
        self.yaw = wrap_pi(self.yaw + turn)
        n, e, d = self.vel
        self.pos = (
            self.pos[0] + (n + 0.5 * dt * north) * dt,
            self.pos[1] + (e + 0.5 * dt * east) * dt,
            self.pos[2] + (d + 0.5 * dt * down) * dt,
        )
        self.vel = n + north * dt, e + east * dt, d + down * dt
        row = [float(self.now_us), float(self.flying_ms), 255.0 if self.is_late else 0.0]
        for gyro, accel in zip(self.gyro_bias, self.accel_bias, strict=True):
            row += [(force[0] + accel[0]) * dt, (force[1] + accel[1]) * dt, (force[2] + accel[2]) * dt]
            row += [(rates[0] + gyro[0]) * dt, (rates[1] + gyro[1]) * dt, (rates[2] + gyro[2]) * dt, dt, dt]
        return row

    def listen(self) -> None:
        """Take what the filter has said."""
        for text in self.lanes.texts:
            _, words = words_of(text.code, text.values)
            name = "" if text.core <= 0 else f"core {text.core}: "
            self.said.append((self.now_ms, name + words))
        self.lanes.texts.clear()
        for core in self.lanes.cores:
            if core.number == 0:
                for outcome in core.events.outcomes:
                    kind, code = KINDS[outcome.kind], RULES[outcome.rule].code
                    self.outcomes.append((kind, code))
                    self.outcome_times_ms.append(outcome.time_ms)
                    if outcome.ratio >= 0.0:
                        self.tested.append((kind, code, outcome.ratio, outcome.innovation))
            core.events.outcomes.clear()

    # What sensors say

    def feed(self) -> None:
        """Let sensors say what is due."""
        for feed, period_us in PERIODS_US.items():
            if feed in self.feeds and self.now_us >= self._due_us[feed]:
                self._due_us[feed] = self.now_us - self.now_us % (period_us if feed == "baro" else 1) + period_us
                getattr(self, f"_feed_{feed}")()

    def _feed_camera(self) -> None:
        x, y, z = self.camera_shift
        self.camera(self.pos[0] + x, self.pos[1] + y, self.pos[2] + z, yaw=wrap_pi(self.yaw + self.camera_yaw))

    def camera(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, **fields: Any) -> None:
        """Let the camera see a pose, with a stamp of now unless told otherwise."""
        given: dict[str, Any] = {
            "yaw": 0.0,
            "err": self.camera_err,
            "yaw_err": 0.2,
            "stamp_ms": self.now_ms,
            "delay_ms": DELAY_MS,
        }
        given.update(fields)
        stamp_ms = given["stamp_ms"] & 0xFFFFFFFF
        for core in self.lanes.cores:
            core.ext_nav.write_pose(
                (x, y, z),
                given["err"],
                given["yaw"],
                given["yaw_err"],
                int(stamp_ms),
                int(given["delay_ms"]),
                self.reset_ms,
            )
        self.listen()

    def _feed_velocity(self) -> None:
        self.velocity(*self.vel)

    def velocity(
        self,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
        *,
        err: float | None = None,
        stamp_ms: int | None = None,
        delay_ms: int = DELAY_MS,
    ) -> None:
        """Let the camera see a velocity."""
        stamp_ms = (self.now_ms if stamp_ms is None else stamp_ms) & 0xFFFFFFFF
        for core in self.lanes.cores:
            core.ext_nav.write_velocity((x, y, z), self.velocity_err if err is None else err, stamp_ms, delay_ms)
        self.listen()

    def _feed_odometry(self) -> None:
        self.odometry(*to_body(matrix(quat_of_euler(self.roll, self.pitch, self.yaw)), self.vel))

    def odometry(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, **fields: Any) -> None:
        """Let the camera see a velocity of the body."""
        given: dict[str, Any] = {
            "err": 0.1,
            "del_time": 0.05,
            "stamp_ms": self.now_ms,
            "delay_ms": DELAY_MS,
            "has_nan": False,
        }
        given.update(offset=(0.0, 0.0, 0.0))
        given.update(fields)
        for core in self.lanes.cores:
            core.ext_nav.write_odometry(
                (x, y, z),
                given["err"],
                given["del_time"],
                bool(given["has_nan"]),
                int(given["stamp_ms"]) & 0xFFFFFFFF,
                int(given["delay_ms"]),
                given["offset"],
            )
        self.listen()

    def _feed_flow(self) -> None:
        ahead, right, _ = to_body(matrix(quat_of_euler(self.roll, self.pitch, self.yaw)), self.vel)
        distance = max(self.ground - self.pos[2], 0.1)
        # The ground seems to move to the other side: about x to the left, about y ahead.
        self.flow(-right / distance, ahead / distance)

    def flow(self, x: float = 0.0, y: float = 0.0, **fields: Any) -> None:
        """Let a flow sensor measure rates without turning, rad/s."""
        given = {"quality": 80, "gyro": (0.0, 0.0), "offset": (0.0, 0.0, 0.0), **fields}
        for core in self.lanes.cores:
            core.write_flow(given["quality"], (x, y), given["gyro"], given["offset"])
        self.listen()

    def _feed_baro(self) -> None:
        time_ms = self.now_us // 100_000 * 100 & 0xFFFFFFFF
        for core in self.lanes.cores:
            core.inputs.set_baro(time_ms, self.baro_shift - self.pos[2])

    def compass_feels(self) -> Vec3:
        """Return what a compass feels, mGauss, body."""
        x, y, z = to_body(matrix(quat_of_euler(self.roll, self.pitch, self.yaw)), self.field_ned)
        return x + self.iron[0], y + self.iron[1], z + self.iron[2]

    def _feed_compass(self) -> None:
        self.see_compasses()

    def see_compasses(self) -> None:
        """Let all compasses feel the field."""
        readings = []
        for number in range(self.compass_count):
            special = {"time_us": self.now_us, "field": self.compass_feels(), **self.compasses.get(number, {})}
            readings.append(CompassReading(**special))
        for core in self.lanes.cores:
            core.inputs.set_compasses(Compasses(readings, **{"finds_declination": False} | self.compasses_said))

    def _feed_gps(self) -> None:
        x, y, z = self.gps_shift
        place = HOME.offset(Vector3f(self.pos[0] + x, self.pos[1] + y, self.pos[2] + z))
        values: dict[str, Any] = {
            "fix_type": 3,
            "vel_ned": Vector3f(*self.vel),
            "num_sats": 10,
            "hdop": 100,
            "location": place,
            "time_ms": self.now_ms & 0xFFFFFFFF,
        }
        for core in self.lanes.cores:
            core.inputs.set_gps(GpsSample(**{**values, **self.gps}))

    def _feed_ranges(self) -> None:
        upright = math.cos(self.roll) * math.cos(self.pitch)
        self.see_range((self.ground - self.pos[2]) / upright)

    def see_range(self, distance: float, **fields: Any) -> None:
        """Let a range finder measure; it stands 0.1 m above the ground and sees 40 m."""
        given = {"place": (0.0, 0.0, 0.0), "status": RangeStatus.GOOD, "clearance": 0.1, "max_distance": 40.0, **fields}
        finder = FinderState(given["place"], distance, DOWNWARD, given["status"])
        for core in self.lanes.cores:
            core.inputs.set_ranges(RangeState((finder,), given["clearance"], given["max_distance"]))

    # What the vehicle does

    def arm(self, is_armed: bool = True, *, takeoff: bool = False, touchdown: bool = False) -> None:
        """Arm or disarm, and expect the ground or not."""
        for core in self.lanes.cores:
            core.inputs.armed = is_armed
            core.inputs.takeoff_expected, core.inputs.touchdown_expected = takeoff, touchdown

    def move(self, north: float, east: float, down: float, seconds: float) -> None:
        """Accelerate for a while, and go on."""
        self.accel_ned = north, east, down
        self.run(seconds)
        self.accel_ned = 0.0, 0.0, 0.0

    def climb(self, height_m: float, seconds: float = 2.0) -> None:
        """Climb from rest to rest."""
        accel = 4.0 * height_m / seconds**2
        self.move(0.0, 0.0, -accel, 0.5 * seconds)
        self.move(0.0, 0.0, accel, 0.5 * seconds)

    def know_gyros(self) -> None:
        """Let the biases of gyros be known as well as they are long after boot."""
        for core in self.lanes.cores:
            core.state.clear(GYRO, ACCEL, 1e-10)

    # What the filter says

    @property
    def texts(self) -> list[str]:
        """All that was said."""
        return [text for _, text in self.said]

    def told(self) -> list[str]:
        """Return what was said since the last call."""
        texts = self.texts
        self.said.clear()
        return texts

    def became(self) -> list[tuple[str, str]]:
        """Return what became of samples in the filter since the last call."""
        outcomes = [outcome for outcome in self.outcomes if outcome[1].startswith("model_")]
        self.outcomes.clear()
        self.outcome_times_ms.clear()
        self.tested.clear()
        return outcomes

    def forget(self) -> None:
        """Forget all that was said and that became of samples."""
        self.said.clear()
        self.outcomes.clear()
        self.outcome_times_ms.clear()
        self.tested.clear()

    def last_test(self, kind: str) -> tuple[str, Any, Any]:
        """Return code, ratio to the gate and innovation of the last sample of a kind that was tested."""
        return next(test[1:] for test in reversed(self.tested) if test[0] == kind)

    @property
    def mode(self) -> int:
        """How the first core navigates."""
        return self.core.aiding.mode

    @property
    def report(self) -> CoreReport:
        """What the first core says of itself."""
        return report_of(self.lanes, 0)

    @property
    def heading(self) -> float:
        """The yaw of the first core's state, rad."""
        return euler_of(self.core.state.quat)[2]

    def miss_m(self) -> float:
        """Return how far the position that is told is from the true one."""
        return math.dist(self.core.output.now.pos, self.pos)

    def covariance(self) -> "np.ndarray[Any, np.dtype[np.float64]]":
        """Return the covariance of the first core."""
        cov = self.core.state.cov
        return np.array([[cov.at(i, j) for j in range(22)] for i in range(22)])

    def body_velocity(self) -> Vec3:
        """Return the velocity of the first core's state as the body sees it."""
        return to_body(matrix(self.core.state.quat), self.core.state.vel)

    def in_earth(self, vector: Vec3) -> Vec3:
        """Return a vector of the body as the earth sees it, by the true attitude."""
        return to_earth(matrix(quat_of_euler(self.roll, self.pitch, self.yaw)), vector)


# Vehicles to begin with


def standing(sources: str = "66666", *, run_s: float = 2.6, **options: Any) -> FilterRig:
    """Return a vehicle that has been at rest for a while; by default its filter knows tilt by then."""
    rig = FilterRig(sources, **options)
    rig.run(run_s)
    return rig


def navigating(sources: str = "66666", *feeds: str, **options: Any) -> FilterRig:
    """Return a vehicle at rest that has been navigating by its camera for most of a second; all is told and taken."""
    rig = standing(sources, **options)
    rig.feeds |= {"camera", *feeds}
    rig.run(1.0)
    assert rig.mode == ABSOLUTE, rig.said
    rig.forget()
    return rig


Start = Callable[[], FilterRig]


def compared(
    start: Start, measure: Callable[[FilterRig], object], is_due: Callable[[Core], object]
) -> tuple[FilterRig, FilterRig]:
    """Return two vehicles after the step that fuses a measurement, which only the first one gets.

    Args:
        start: makes a vehicle.
        measure: hands the measurement to a vehicle.
        is_due: whether the filter has taken the measurement from its buffer in the last step.
    """
    rig, other = start(), start()
    measure(rig)
    run_until_due(rig, other, is_due)
    return rig, other


def run_until_due(rig: FilterRig, other: FilterRig, is_due: Callable[[Core], object]) -> None:
    """Run two vehicles to the step in which the first one's measurement is due.

    Their states then differ by the correction alone. The second one's covariance is that before the fusion.
    """
    end_us = rig.now_us + 1_000_000
    while rig.now_us < end_us:
        rig.one_pass()
        other.one_pass()
        if rig.core.stepped and is_due(rig.core):
            return
    raise AssertionError("no step has taken the measurement")


def has_pose(core: Core) -> bool:
    """Return whether the last step took a pose from the buffer."""
    return core.ext_nav.has_pose


def weight(variance: float, noise: float) -> float:
    """Return which part of an innovation is believed."""
    return variance / (variance + noise**2)


Fused = tuple[int, float, float]
"""A measurement of a state: its number, what was measured, and the variance."""


def reckoned(rig: FilterRig, *fused: Fused) -> "np.ndarray[Any, np.dtype[np.float64]]":
    """Return the states behind the attitude as Kalman's formulae have them, after measurements one after the other."""
    state, cov = rig.core.state, rig.covariance()
    states = np.array([0.0] * 4 + [*state.vel, *state.pos, *state.gyro_bias, *state.accel_bias] + [0.0] * 6)
    for index, measured, variance in fused:
        gain = cov[:, index] / (cov[index, index] + variance)
        states = states + gain * (measured - states[index])
        cov = cov - np.outer(gain, cov[index])
    return states


def by_gps(sources: str = "33131", **options: Any) -> FilterRig:
    """Return a vehicle at rest with a compass that has just begun to navigate by GPS; its texts are read."""
    rig = standing(sources, has_compass=True, loop_us=SLOW_LOOP_US, **options)
    rig.lanes.set_origin(HOME)
    rig.feeds.add("gps")
    rig.run(0.1)
    rig.know_gyros()
    rig.run(11.0)
    assert rig.mode == ABSOLUTE, rig.said
    rig.run(1.0)
    rig.forget()
    return rig
