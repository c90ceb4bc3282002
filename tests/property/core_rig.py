# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A core of the filter on a vehicle that moves, whose sensors agree with that until a test lets them lie."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any, ClassVar, Final

import numpy as np

from ap_core.cint import u32
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.param import ParamTable
from ap_core.param_cache import Numbers
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.core.reporting import report_of
from ekf_stub.filter import covariance
from ekf_stub.filter.inertial import GRAVITY_MSS, InertialDelta
from ekf_stub.filter.inertial_pass import PLAIN, Kernel
from ekf_stub.filter.states import GYRO
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.sources import ROWS, EkfSources
from ekf_stub.reports.core_report import CoreReport
from ekf_stub.reports.core_texts import CoreTexts
from viso.parameters.table import make_groups

HOME: Final = Location(-353632610, 1491652300, 58400)
FIELD_MGAUSS: Final = np.array([238.0, 0.0, -529.0])
DELAY_MS: Final = 10
LOOP_US: Final = 2500
FEEDS: Final = {"pose": 33_000, "velocity": 33_000, "odometry": 66_000, "gps": 200_000, "baro": 100_000, "mag": 100_000}
"""What may come in, and how often, us."""
ROUNDING: Final = 1e-9  # of a mix of errors in units of their sigmas

_KNOWN_FLAGS: Final = (1 << 17) - 1
_KNOWN_TIMEOUTS: Final = (1 << 6) - 1


def numbers_of(report: CoreReport) -> Iterator[float]:
    """Yield all numbers of a report, one after the other."""
    waiting: list[Any] = [report]
    while waiting:
        value = waiting.pop()
        if isinstance(value, tuple):
            waiting += value
        elif hasattr(value, "__dataclass_fields__"):
            waiting += [getattr(value, name) for name in value.__dataclass_fields__]
        elif value is not None:
            yield value


class CoreRig:
    """A core, and a level vehicle that moves as it is told.

    Args:
        sources: rows of the first source set, such as ``66666``.
        has_compass: whether there is one.
        start_us: when it boots.
        loop_us: how often a frame comes.
        params: parameters that matter from the start.

    Attributes:
        kernel: what its arithmetic runs on.
        feeds: which of ``FEEDS`` come in.
        accel_ned, yaw_rate: how the vehicle moves: m/s/s, which ends as it lands, and rad/s.
        armed, near_ground: what the vehicle says of itself.
        flying_s: for how long it has been flying.
        texts: what the core has said.
        modes: how it has navigated.
        fused_field: whether all axes of the compass were fused.
    """

    kernel: ClassVar[Kernel] = PLAIN

    def __init__(
        self, sources: str, *, has_compass: bool = False, start_us: int = 0, loop_us: int = LOOP_US, **params: float
    ) -> None:
        self.params = ParamTable(make_groups(1, make_params()))
        for row, value in zip(ROWS, sources, strict=True):
            self.set_param(f"EK3_SRC1_{row}", float(value))
        for name, number in params.items():
            self.set_param(name, number)
        self._numbers = Numbers(self.params)
        self.sources = EkfSources(self._get_int, self.params.on_change.append)
        self.has_compass = has_compass
        self.texts: list[str] = []
        self.core = Ekf3Core(
            self.sources,
            self._get_number,
            buffer_sizes(self.params.get_int, self.sources, has_camera=True),
            CoreTexts(self, (0,)),
            Counter(),
            self._has_compass,
            self.kernel,
        )
        self.now_us, self.loop_us = start_us, loop_us
        self.feeds: set[str] = {"baro"} | ({"mag"} if has_compass else set())
        self._due_us = dict.fromkeys(FEEDS, start_us)
        self.pos, self.vel, self.yaw = np.zeros(3), np.zeros(3), 0.3
        self.accel_ned, self.yaw_rate = np.zeros(3), 0.0
        self.armed = self.near_ground = False
        self.flying_s = 0.0
        self.baro: tuple[int, float] | None = None
        self.mag: tuple[int, Any] | None = None
        self.gps: GpsSample | None = None
        self.modes: set[AidingMode] = set()
        self.fused_field = False

    # Not functions within the constructor, so that a copy asks the copy.

    def _get_int(self, name: str) -> int:
        return self.params.get_int(f"EK3_{name}")

    def _get_number(self, name: str) -> float:
        return self._numbers[f"EK3_{name}"]

    def _has_compass(self) -> bool:
        return self.has_compass

    def set_param(self, name: str, value: float) -> None:
        """Set a parameter, as a ground station does."""
        self.params.set_from_mavlink(name, value)

    def send_text(self, severity: int, text: str) -> None:
        """Remember a text (TextSink)."""
        assert severity in range(8)
        self.texts.append(text)

    @property
    def now_ms(self) -> int:
        """Time since boot as stamps have it."""
        return u32(self.now_us // 1000)

    # What the vehicle does

    def run(self, duration_s: float, **fields: Any) -> None:
        """Let time pass, while some fields of frames may be given."""
        for _ in range(max(1, round(1e6 * duration_s / self.loop_us))):
            self.frame(**fields)

    def frame(self, **fields: Any) -> None:
        """Run the next frame, of which some fields may be given, and check what the core says."""
        self.now_us += self.loop_us
        fields = {"delta": self._move(1e-6 * self.loop_us), **fields}
        for feed, period_us in FEEDS.items():
            if feed in self.feeds and self.now_us >= self._due_us[feed]:
                self._due_us[feed] = self.now_us + period_us
                getattr(self, f"_feed_{feed}")()
        given = {
            "armed": self.armed,
            "flying_ms": round(1000 * self.flying_s),
            "takeoff_expected": self.near_ground,
            "touchdown_expected": self.near_ground,
            "baro": self.baro,
            "mag": self.mag,
            "gps": self.gps,
        }
        self.core.run(Frame(self.now_us, **{**given, **fields}))
        self.check()

    def _move(self, dt: float) -> InertialDelta:
        self.flying_s = self.flying_s + dt if self.armed and self.pos[2] < 0 else 0.0
        turn = self.yaw_rate * dt
        cosine, sine = math.cos(self.yaw + 0.5 * turn), math.sin(self.yaw + 0.5 * turn)
        north, east, down = (self.accel_ned - (0.0, 0.0, GRAVITY_MSS)) * dt
        self.yaw = math.remainder(self.yaw + turn, 2 * math.pi)
        self.vel = self.vel + self.accel_ned * dt
        self.pos = self.pos + (self.vel - 0.5 * dt * self.accel_ned) * dt
        del_vel = np.array([cosine * north + sine * east, cosine * east - sine * north, down])
        return InertialDelta(del_vel, np.array([0.0, 0.0, turn]), dt, dt)

    def _feed_pose(self) -> None:
        self.give_pose(Vector3f(*self.pos), Quaternion.from_euler(f32(0), f32(0), f32(self.yaw)), (0.2, 0.2))

    def _feed_velocity(self) -> None:
        self.give_velocity(Vector3f(*self.vel), 0.1)

    def _feed_odometry(self) -> None:
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        north, east, down = 0.066 * self.vel
        way = Vector3f(cosine * north + sine * east, cosine * east - sine * north, down)
        self.give_odometry(100.0, (way, Vector3f(0, 0, 0.066 * self.yaw_rate), 0.066))

    def _feed_gps(self) -> None:
        place, velocity = HOME.offset(Vector3f(*self.pos)), Vector3f(*self.vel)
        self.gps = GpsSample(self.now_ms, 3, place, velocity, 12, 80, has_vertical_velocity=True)

    def _feed_baro(self) -> None:
        self.baro = self.now_ms, float(np.float32(-self.pos[2]))

    def _feed_mag(self) -> None:
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        north, east, down = FIELD_MGAUSS
        self.mag = self.now_us, np.array([cosine * north + sine * east, cosine * east - sine * north, down])

    # What external navigation says

    def give_pose(
        self,
        pos: Vector3f,
        quat: Quaternion,
        errors: tuple[float, float],
        stamp_ms: int | None = None,
        delay_ms: int = DELAY_MS,
        reset_ms: int = 0,
    ) -> None:
        """Hand in a pose, stamped as of now unless told otherwise."""
        stamp_ms = self.now_ms if stamp_ms is None else stamp_ms
        self.core.ingest.write_pose(pos, quat, (f32(errors[0]), f32(errors[1])), stamp_ms, delay_ms, reset_ms)

    def give_velocity(self, vel: Vector3f, err: float, stamp_ms: int | None = None, delay_ms: int = DELAY_MS) -> None:
        """Hand in a velocity."""
        self.core.ingest.write_velocity(vel, f32(err), self.now_ms if stamp_ms is None else stamp_ms, delay_ms)

    def give_odometry(
        self,
        quality: float,
        deltas: tuple[Vector3f, Vector3f, float],
        stamp_ms: int | None = None,
        delay_ms: int = DELAY_MS,
        pos_offset: Vector3f | None = None,
    ) -> None:
        """Hand in body odometry."""
        stamp_ms = self.now_ms if stamp_ms is None else stamp_ms
        sample = (*deltas[:2], f32(deltas[2]))
        self.core.ingest.write_odometry(f32(quality), sample, stamp_ms, delay_ms, pos_offset or Vector3f())

    # What must hold

    def check(self) -> None:
        """Check that what the core says makes sense."""
        core = self.core
        if not core.initialised:
            return
        report = report_of(core, self.now_us // 1000)
        assert all(map(math.isfinite, numbers_of(report))), report
        assert abs(math.hypot(*report.quat_wxyz) - 1.0) < 1e-9
        assert 0 <= report.flags <= _KNOWN_FLAGS
        assert 0 <= report.timeouts <= _KNOWN_TIMEOUTS
        assert report.faults == 0
        assert min(report.vel_ratio, report.pos_ratio, report.height_ratio, report.mag_ratio, report.yaw_ratio) >= 0
        self._check_covariance()
        self.modes.add(core.aiding.mode)
        self.fused_field |= core.yaw.field_was_fused

    def _check_covariance(self) -> None:
        state = self.core.state
        assert (state.cov == state.cov.T).all()
        variances = covariance.diagonal(state.cov)
        assert variances.min() >= 0  # 0 only from a reset to what has no error until the next step
        assert variances[GYRO].min() > 0 or not state.learns_biases

    def check_mixes(self) -> None:
        """Check that no mix of errors has a negative variance."""
        if not self.core.initialised:
            return
        cov = self.core.state.cov
        known = covariance.diagonal(cov) == 0
        assert not cov[known].any()
        sigma = np.sqrt(covariance.diagonal(cov)[~known])
        assert np.linalg.eigvalsh(cov[~known][:, ~known] / np.outer(sigma, sigma))[0] > -ROUNDING

    def fingerprint(self) -> bytes:
        """Return all that the core has said and says, to the bit."""
        core = self.core
        said = "\n".join(self.texts).encode()
        if not core.initialised:
            return said
        numbers = np.array(list(numbers_of(report_of(core, self.now_us // 1000))), dtype=np.float64)
        return said + numbers.tobytes() + core.state.cov.tobytes() + repr(sorted(core.refused.items())).encode()
