# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A parked vehicle with the filter in virtual time, with settable surroundings."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.core.core import Core
from ekf_stub.core.covariance import ACCEL, GYRO
from ekf_stub.core.params import EkfSources
from ekf_stub.inputs.measurements import USUAL_LAG_S, AllGps, GpsSample
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import ReplayLog
from ekf_stub.reports import CoreReport
from viso.firmware.releases import DEFAULT, Firmware
from viso.parameters.table import make_groups
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import BenchSource

LOOP_US = 2500
QUIET_UNTIL_US = 3_400_000  # after boot, when the estimator soon starts
HOME = Location(-353632610, 1491652300, 58400)
SOURCES = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


class SilentLog:
    """A log that keeps nothing."""

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Take a record (RecordSink)."""


class BenchRig:
    """A vehicle that stands still, whose sources are given as ``66666`` and whose parameters by keyword.

    Attributes:
        ahrs: the AHRS.
        params: all parameters.
        texts: time in ms, severity and text of all that was said.
        statuses: time in ms and flags, whenever they changed.
        yaw_resets: the times in ms at which yaw was aligned.
        primaries: the primary cores, one after the other.
        records: name and values of what was logged for a replay, while ``is_logged``.
        place: where it stands.
        state: what the AHRS is told of the vehicle.
        has_camera: whether there is visual odometry.
        camera_pos: the place of the camera on the vehicle, m, body.
    """

    def __init__(
        self,
        sources: str,
        *,
        has_compass: bool,
        options: ImuOptions,
        params: dict[str, float],
        firmware: Firmware = DEFAULT,
    ) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(0, make_params(), firmware.params))
        for name, value in params.items():
            self.params.set(name, value)
        self.params.set("COMPASS_ENABLE", int(has_compass))
        self.params.set("GPS1_TYPE", 1)
        self.use_sources(sources)
        self.texts: list[tuple[int, int, str]] = []
        self.statuses: list[tuple[int, int | None]] = []
        self.yaw_resets: list[int] = []
        self.primaries: list[int] = []
        self.records: list[tuple[str, tuple[LogValue, ...]]] = []
        self.is_logged = False
        self.place = HOME
        self.has_camera = True
        self.camera_pos = Vector3f()
        self.sources = EkfSources(lambda name: self.params.get_int(f"EK3_{name}"))
        self.params.on_change.append(self.sources.forget)
        source = BenchSource(replace(options, has_compass=lambda: has_compass))
        self.ahrs = Ekf3Ahrs(
            source,
            self.clock,
            self.sources,
            ReplayLog(self, lambda: self.is_logged),
            SilentLog(),
            self.params,
            self,
            release=firmware.ekf,
        )
        self.state = self.ahrs.state
        self.state.gps_lag_s = USUAL_LAG_S
        self._next_us = self._yaw_reset_ms = 0

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
        camera = VisualOdomFrame(self.camera_pos, 10, True, self.has_camera)
        if self._next_us == 0 and time_s * 1e6 > QUIET_UNTIL_US:
            self.run_to(0.0)
            self._next_us = QUIET_UNTIL_US
        while self._next_us <= round(time_s * 1e6):
            self.clock.set_us(self._next_us)
            self.state.camera = camera
            self.ahrs.update()
            self.hear_of_changes()
            self._next_us += LOOP_US
            flags = self.flags
            if not self.statuses or self.statuses[-1][1] != flags:
                self.statuses.append((self.now_ms, flags))
        self.clock.set_us(round(time_s * 1e6))

    def hear_of_changes(self) -> None:
        """Note jumps of the yaw, and which core is primary, if either has changed."""
        if self.ahrs.yaw_reset_ms != self._yaw_reset_ms:
            self._yaw_reset_ms = self.ahrs.yaw_reset_ms
            self.yaw_resets.append(self.now_ms)
        if self.ahrs.primary != (self.primaries[-1] if self.primaries else 0):
            self.primaries.append(self.ahrs.primary)

    def run_for(self, duration_s: float) -> None:
        """Run the main loop on."""
        self.run_to(self.clock.micros64() * 1e-6 + duration_s)

    def know_gyros(self) -> None:
        """Let the gyros' biases be known as well as they are long after boot."""
        self.core.state.clear(GYRO, ACCEL, 1e-10)

    @property
    def core(self) -> Core:
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
        self.state.gps = AllGps((GpsSample(time_ms=self.now_ms, location=place or self.place, **values),))

    def stream_gps(self, until_s: float, place: Location | None = None, **fields: Any) -> None:
        """Let the GPS have a solution five times per second."""
        self.stream(until_s, lambda: self.fix(place, **fields), period_s=0.2)
