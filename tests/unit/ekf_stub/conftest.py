# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A parked vehicle with the filter in virtual time, with settable surroundings."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import quaternion

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ap_core.param_cache import Numbers
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub import ingest_rules as rules
from ekf_stub.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.aiding import Aiding
from ekf_stub.body_odometry import BodyOdometry
from ekf_stub.core_report import CoreReport
from ekf_stub.core_texts import CoreTexts
from ekf_stub.ekf3_core import Ekf3Core, Frame
from ekf_stub.error_state import GYRO, ErrorState, quat_of_euler
from ekf_stub.ext_nav_ingest import ExtNavIngest, FilterOutcome
from ekf_stub.ext_nav_log import VisualOdomFrame
from ekf_stub.gps_checks import GpsChecks
from ekf_stub.gps_reading import GpsReading
from ekf_stub.gps_sample import GpsSample
from ekf_stub.height_source import HeightSource
from ekf_stub.inertial import GRAVITY_MSS, Array, InertialDelta
from ekf_stub.measurements import Delayed, Pose, Velocity
from ekf_stub.obs_ring import RingSizes
from ekf_stub.output_predictor import OutputPredictor
from ekf_stub.replay_log import ReplayLog
from ekf_stub.resets import Resets
from ekf_stub.source_check import SENSORS
from ekf_stub.sources import EkfSources
from ekf_stub.surroundings import Surroundings
from ekf_stub.vel_pos_fusion import VelPosFusion
from ekf_stub.yaw_fusion import YawFusion
from emulator.imu.bench import BenchSource
from emulator.imu.errors import NO_ERRORS, SensorErrors
from emulator.imu.options import ImuOptions
from emulator.parameters import make_groups

LOOP_US = 2500
HOME = Location(-353632610, 1491652300, 58400)
SOURCES = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


class CoreRig:
    """A filter core that is given frames of constant inertial data; its clock begins at 10 s.

    Attributes:
        frame: fields of the frames, but time and inertial data.
        accel, rate: what the IMU feels, m/s/s and rad/s, body (FRD).
        height: of the barometer, read ten times a second; None without one.
        field: what the compass feels as often, mGauss, body; None without one.
        said: time in ms and text of all that was said, without the core.
    """

    def __init__(self, sources: str, has_compass: bool, params: dict[str, float]) -> None:
        self.params = ParamTable(make_groups(0, make_params()))
        for what, value in zip(SOURCES, sources, strict=True):
            self.params.set(f"EK3_SRC1_{what}", int(value))
        for name, number in params.items():
            self.params.set(f"EK3_{name}", number)
        self.said: list[tuple[int, str]] = []
        self.counts: Counter[tuple[str, str]] = Counter()
        numbers = Numbers(self.params)
        self.core = Ekf3Core(
            EkfSources(lambda name: self.params.get_int(f"EK3_{name}"), lambda: self.params.generation),
            lambda name: numbers(f"EK3_{name}"),
            RingSizes(6, 5, 2),
            CoreTexts(self, (0,)),
            self.counts,
            lambda: has_compass,
        )
        self.now_us = 10_000_000
        self.frame: dict[str, Any] = {}
        self.accel: Array | Sequence[float] = (0.0, 0.0, -GRAVITY_MSS)
        self.rate: Array | Sequence[float] = (0.0, 0.0, 0.0)
        self.height: float | None = 0.0
        self.field: Array | None = np.array([238.0, 0.0, -529.0]) if has_compass else None

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.said.append((self.now_ms, text.removeprefix("EKF3 IMU0 ")))

    @property
    def now_ms(self) -> int:
        """Time since boot."""
        return self.now_us // 1000

    def told(self) -> list[str]:
        """Return what was said since the last call."""
        texts = [text for _, text in self.said]
        self.said.clear()
        return texts

    def run_for(self, duration_s: float) -> None:
        """Run the main loop."""
        dt = 1e-6 * LOOP_US
        delta = InertialDelta(np.array(self.accel) * dt, np.array(self.rate) * dt, dt, dt)
        for _ in range(round(duration_s / dt)):
            self.now_us += LOOP_US
            read_ms = self.now_ms // 100 * 100
            self.frame["baro"] = None if self.height is None else (read_ms, self.height)
            self.frame["mag"] = None if self.field is None else (1000 * read_ms, self.field)
            self.core.run(Frame(self.now_us, delta, **self.frame))

    def stream(self, duration_s: float, *senders: Callable[[], object], period_s: float = 0.035) -> None:
        """Call senders again and again."""
        for _ in range(round(duration_s / period_s)):
            for send in senders:
                send()
            self.run_for(period_s)

    def pose(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, *, yaw: float = 0.0) -> None:
        """Hand in a pose with a stamp of now."""
        quat = Quaternion.from_euler(f32(0), f32(0), f32(yaw))
        self.core.ingest.write_pose(Vector3f(x, y, z), quat, (f32(0.2), f32(0.2)), self.now_ms, 10, 0)

    def speed(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """Hand in a velocity with a stamp of now."""
        self.core.ingest.write_velocity(Vector3f(x, y, z), f32(0.1), self.now_ms, 10)

    @property
    def flags(self) -> int:
        """The bits of nav_filter_status."""
        return self.core.control.flags


@pytest.fixture(scope="session")
def make_core() -> Callable[..., CoreRig]:
    """Return a function that makes a core from its sources and parameters without ``EK3_``; it has run for 4 s."""

    def make(sources: str = "66666", *, has_compass: bool = False, run_s: float = 4.0, **params: float) -> CoreRig:
        rig = CoreRig(sources, has_compass, params)
        rig.run_for(run_s)
        return rig

    return make


class BenchRig:
    """A vehicle that stands still, whose sources are given as ``66666`` and whose parameters by keyword.

    Attributes:
        ahrs: the AHRS.
        params: all parameters.
        texts: time in ms, severity and text of all that was said.
        statuses: time in ms and flags, whenever they changed.
        yaw_resets: the times in ms at which yaw was aligned.
        records: name and values of what was logged for a replay, while ``is_logged``.
        place: where it stands.
        gps: the GPS's newest solution.
        armed, flying_ms, home: what they say.
        fitted: the sensors that there are.
        camera_pos: the place of the camera on the vehicle, m, body.
    """

    def __init__(self, sources: str, *, has_compass: bool, options: ImuOptions, params: dict[str, float]) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(0, make_params()))
        for name, value in params.items():
            self.params.set(name, value)
        self.use_sources(sources)
        self.texts: list[tuple[int, int, str]] = []
        self.statuses: list[tuple[int, int | None]] = []
        self.yaw_resets: list[int] = []
        self.records: list[tuple[str, tuple[LogValue, ...]]] = []
        self.is_logged = False
        self.place = HOME
        self.gps: GpsSample | None = None
        self.armed = False
        self.flying_ms = 0
        self.home: Location | None = None
        self.fitted = set(SENSORS)
        self.camera_pos = Vector3f()
        self.imu_pos = Vector3f()
        self.sources = EkfSources(lambda name: self.params.get_int(f"EK3_{name}"), lambda: self.params.generation)
        source = BenchSource(replace(options, has_compass=lambda: has_compass))
        self.ahrs = Ekf3Ahrs(
            self.clock,
            self.sources,
            ReplayLog(self, lambda: self.is_logged),
            source,
            has_compass=lambda: has_compass,
            around=Surroundings(
                self,
                self.params.get_int,
                Numbers(self.params),
                lambda: self.gps,
                lambda: self.armed,
                lambda sensor: sensor in self.fitted,
                lambda: self.yaw_resets.append(self.now_ms),
                lambda: self.flying_ms,
                lambda: self.home,
                lambda: self.imu_pos,
            ),
        )
        self._next_us = 0

    def use_sources(self, sources: str, number: int = 1) -> None:
        """Set the rows of a source set."""
        for what, value in zip(SOURCES, sources, strict=True):
            self.params.set(f"EK3_SRC{number}_{what}", int(value))

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Remember a record (RecordSink)."""
        self.records.append((structure.name, tuple(values)))

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.texts.append((self.now_ms, severity, text))

    @property
    def now_ms(self) -> int:
        """Time since boot."""
        return self.clock.millis()

    def run_to(self, time_s: float) -> None:
        """Run the main loop."""
        while self._next_us <= round(time_s * 1e6):
            self.clock.set_us(self._next_us)
            self.ahrs.update(VisualOdomFrame(self.camera_pos, 10, True, True))
            self._next_us += LOOP_US
            if not self.statuses or self.statuses[-1][1] != self.flags:
                self.statuses.append((self.now_ms, self.flags))
        self.clock.set_us(round(time_s * 1e6))

    def run_for(self, duration_s: float) -> None:
        """Run the main loop on."""
        self.run_to(self.clock.micros64() * 1e-6 + duration_s)

    def know_gyros(self) -> None:
        """Let the gyros' biases be known as well as they are long after boot."""
        self.core.state.clear(GYRO, 1e-10)

    @property
    def core(self) -> Ekf3Core:
        """The filter, once it has been set up."""
        assert self.ahrs.core is not None
        return self.ahrs.core

    @property
    def report(self) -> CoreReport:
        """What the filter says of itself, once it has a state."""
        report = self.ahrs.report()
        assert report is not None
        return report

    @property
    def flags(self) -> int | None:
        """The flags of EKF_STATUS_REPORT."""
        status = self.ahrs.get_filter_status()
        return None if status is None else int(status.flags)

    @property
    def position(self) -> tuple[float, ...] | None:
        """The position that the AHRS tells, m NED from the origin."""
        position = self.ahrs.get_relative_position_NED_origin_float()
        return None if position is None else tuple(float(value) for value in position.to_tuple())

    @property
    def velocity(self) -> tuple[float, ...] | None:
        """The velocity that the AHRS tells, m/s NED."""
        velocity = self.ahrs.get_velocity_NED()
        return None if velocity is None else tuple(float(value) for value in velocity.to_tuple())

    def said(self, *, since_s: float = 0) -> list[str]:
        """Return what was said, from a time on."""
        return [text for time_ms, _, text in self.texts if time_ms >= since_s * 1000]

    def when(self, text: str, *, since_s: float = 0) -> int:
        """Return the time in ms at which the first core said something for the first time, from a time on."""
        times = (time_ms for time_ms, _, said in self.texts if said == f"EKF3 IMU0 {text}" and time_ms >= since_s * 1e3)
        return next(times)

    def pose(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, *, yaw: float = 0.0, **times: int) -> None:
        """Hand in a pose with a stamp of now."""
        quat = Quaternion.from_euler(f32(0), f32(0), f32(yaw))
        stamp_ms, reset_ms = times.get("stamp_ms", self.now_ms), times.get("reset_ms", 0)
        self.ahrs.writeExtNavData(Vector3f(x, y, z), quat, f32(0.2), f32(0.2), stamp_ms, 10, reset_ms)

    def speed(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """Hand in a velocity with a stamp of now."""
        self.ahrs.writeExtNavVelData(Vector3f(x, y, z), f32(0.1), self.now_ms, 10)

    def odometry(self, x: float = 0.0, *, quality: float = 100.0, duration_s: float = 0.05) -> None:
        """Hand in a change of position along the nose with a stamp of now."""
        way, turn, none = Vector3f(x, 0, 0), Vector3f(), Vector3f()
        self.ahrs.writeBodyFrameOdom(f32(quality), way, turn, f32(duration_s), self.now_ms, 10, none)

    def stream(self, until_s: float, *senders: Callable[[], None], period_s: float = 1 / 30) -> None:
        """Call senders again and again."""
        while self.clock.micros64() < until_s * 1e6:
            for send in senders:
                send()
            self.run_for(period_s)

    def fix(self, place: Location | None = None, **fields: Any) -> None:
        """Let the GPS have a solution of now, of the place where it stands unless told another."""
        values: dict[str, Any] = {"fix_type": 3, "vel_ned": Vector3f(), "num_sats": 10, "hdop": 120, **fields}
        self.gps = GpsSample(time_ms=self.now_ms, location=place or self.place, **values)

    def stream_gps(self, until_s: float, place: Location | None = None, **fields: Any) -> None:
        """Let the GPS have a solution five times a second."""
        self.stream(until_s, lambda: self.fix(place, **fields), period_s=0.2)


class FilterParts:
    """The parts of a filter without what runs them: level and at rest, with sources and parameters as given.

    Attributes:
        said: severity and text of all that was said, flushed or not.
        outcomes: kind, code and ratio of all that became of samples once they were taken.
    """

    def __init__(self, sources: str, params: dict[str, float]) -> None:
        table = ParamTable(make_groups(0, make_params()))
        for what, value in zip(SOURCES, sources, strict=True):
            table.set(f"EK3_SRC1_{what}", int(value))
        for name, number in params.items():
            table.set(f"EK3_{name}", number)
        self.params = table
        self.get = get = lambda name: table.get_number(f"EK3_{name}")
        self.said: list[tuple[int, str]] = []
        self.counts: Counter[tuple[str, str]] = Counter()
        self.outcomes: list[tuple[str, str, Any]] = []
        self.has_compass = True
        self.texts = CoreTexts(self, (0,))
        self.sources = EkfSources(lambda name: table.get_int(f"EK3_{name}"))
        self.ingest = ExtNavIngest(self.counts, lambda name: f32(table.get_number(name)))
        self.ingest.set_up(RingSizes(6, 5, 2))
        self.ingest.initialised = True
        self.ingest.on_outcome = self._take_outcome
        self.gps = GpsReading(GpsChecks(), get, 3)
        self.state = ErrorState(quaternion.one, np.array([0.3, 0.3, 0.5, 0.5, 0.5, 2.0]) ** 2)
        self.output = OutputPredictor(self.state, 6)
        self.aiding = Aiding()
        self.delayed = Delayed(self.ingest)
        shared = self.aiding, self.sources, self.delayed, self.ingest, self.gps
        self.resets = Resets(self.state, self.output, *shared, get)
        self.height = HeightSource(self.state, *shared, get, 3)
        self.fusion = VelPosFusion(self.state, self.resets, *shared, self.height, get)
        self.yaw = YawFusion(
            self.state, self.output, self.sources, self.ingest, self.gps, self.texts, get, lambda: self.has_compass, 3
        )
        self.odometry = BodyOdometry(self.state, self.aiding, self.sources, self.ingest, self.texts)

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        self.said.append((severity, text))

    def _take_outcome(self, outcome: FilterOutcome) -> None:
        if outcome.rule is not rules.TAKEN:
            self.outcomes.append((outcome.kind, outcome.rule.code, outcome.ratio))

    def told(self) -> list[str]:
        """Return what was said since the last call, without the core."""
        self.texts.flush()
        texts = [text.removeprefix("EKF3 IMU0 ") for _, text in self.said]
        self.said.clear()
        return texts

    def set_pose(self, *pos: float, err: float = 0.2, is_reset: bool = False, time_ms: int = 0) -> None:
        """Let a pose have come due in this step."""
        self.delayed.pose = Pose(time_ms, np.array(pos), err, is_reset)
        self.delayed.has_pose = True

    def set_velocity(self, *vel: float, err: float = 0.1, time_ms: int = 0) -> None:
        """Let a velocity have come due in this step, and with it the first of all."""
        self.delayed.velocity = Velocity(time_ms, np.array(vel), err)
        self.delayed.has_velocity = self.ingest.have_velocity = True

    def end_step(self) -> None:
        """Let nothing have come due in the next step."""
        self.delayed.has_pose = self.delayed.has_velocity = False

    def turn_to(self, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> None:
        """Let the filter hold an attitude to be true, rad."""
        self.state.quat = quat_of_euler(roll, pitch, yaw)
        self.state.rotation = self.state.rotation_now()


@pytest.fixture(scope="session")
def make_parts() -> Callable[..., FilterParts]:
    """Return a function that makes the parts of a filter from its sources, and parameters without ``EK3_``."""

    def make(sources: str = "66666", **params: float) -> FilterParts:
        return FilterParts(sources, params)

    return make


@pytest.fixture(scope="session")
def make_bench() -> Callable[..., BenchRig]:
    """Return a function that makes a vehicle from its sources and parameters, on sensors without errors by default."""

    def make(
        sources: str = "66666",
        *,
        has_compass: bool = False,
        heading_deg: float = 0.0,
        errors: SensorErrors = NO_ERRORS,
        **params: float,
    ) -> BenchRig:
        options = ImuOptions(heading_rad=math.radians(heading_deg), errors=errors)
        return BenchRig(sources, has_compass=has_compass, options=options, params=params)

    return make
