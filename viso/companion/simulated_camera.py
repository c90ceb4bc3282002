# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A scripted flight, and a camera that sees it and reports it as a tracking camera would, faults included."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mav_handlers.wire.messages import ODOMETRY
from viso.companion.odometry.message import MAV_ESTIMATOR_TYPE_VIO, MAV_FRAME_BODY_FRD, MAV_FRAME_LOCAL_FRD
from viso.companion.sender import OffsetClock
from viso.geometry.rotation import inverse, product, quats_from_euler, rotate

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Flight:
    """Take-off, one figure of eight, landing; at rest before and after. Position and velocity are continuous.

    Attributes:
        start_s: take-off.
        climb_s: duration of take-off, and of landing.
        loop_s: duration of the figure of eight.
        height_m: height of the figure above the ground.
        size_m: its half width, north and east.
        heading_rad: yaw, kept all the time.
    """

    start_s: float
    climb_s: float = 4.0
    loop_s: float = 24.0
    height_m: float = 3.0
    size_m: tuple[float, float] = (4.0, 2.5)
    heading_rad: float = 0.0

    @property
    def end_s(self) -> float:
        """When the vehicle is on the ground again."""
        return self.start_s + 2 * self.climb_s + self.loop_s

    def position_ned(self, time_s: float) -> Vector:
        """Return the position in metres NED from the place of take-off."""
        phase = _smooth_step((time_s - self.start_s - self.climb_s) / self.loop_s) * 2 * math.pi
        up = _smooth_step((time_s - self.start_s) / self.climb_s)
        down = _smooth_step((time_s - self.end_s + self.climb_s) / self.climb_s)
        north, east = self.size_m
        return np.array([north * math.sin(phase), east * math.sin(2 * phase), -self.height_m * (up - down)])

    def velocity_ned(self, time_s: float) -> Vector:
        """Return the velocity in m/s NED, by central difference."""
        step_s = 1e-4
        ahead, behind = self.position_ned(time_s + step_s), self.position_ned(time_s - step_s)
        return (ahead - behind) / (2 * step_s)

    def attitude_rpy_rad(self, time_s: float) -> Vector:
        """Return roll, pitch and yaw in rad: the vehicle leans into its acceleration, as a multicopter does."""
        step_s = 1e-2
        ahead, behind = self.velocity_ned(time_s + step_s), self.velocity_ned(time_s - step_s)
        acceleration = (ahead - behind) / (2 * step_s)
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        forward = cos * acceleration[0] + sin * acceleration[1]
        right = -sin * acceleration[0] + cos * acceleration[1]
        gravity = 9.80665
        return np.array([math.atan2(right, gravity), math.atan2(-forward, gravity), self.heading_rad])


def _smooth_step(x: float) -> float:
    """Return 0 below 0, 1 above 1 and between them a rise whose first two derivatives vanish at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (x * (6 * x - 15) + 10)


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of time in seconds since the autopilot's boot."""

    start_s: float
    end_s: float

    def __contains__(self, time_s: float) -> bool:
        return self.start_s <= time_s < self.end_s


@dataclass(frozen=True)
class CameraFaults:
    """The faults of a simulated camera.

    Attributes:
        reset_s: when the camera loses its map and starts another; None for never.
        reset_jump_m: jump of its position then, in its own frame.
        low_quality: when it reports a quality of ``low_quality_percent``.
        dropout: when it reports nothing.
        mismatch: when it reports a wrong position as if it were right.
        mismatch_m: offset of that position, in its own frame.
    """

    reset_s: float | None = None
    reset_jump_m: tuple[float, float, float] = (1.5, -1.0, 0.3)
    low_quality: Span | None = None
    low_quality_percent: int = 5
    dropout: Span | None = None
    mismatch: Span | None = None
    mismatch_m: tuple[float, float, float] = (3.0, 0.0, 0.0)


@dataclass
class SimulatedCamera:
    """Reports a flight in the camera's own frame, with noise and slow drift.

    Attributes:
        seed: for the noise; the same seed gives the same reports.
        frame_yaw_rad: how far the vehicle's north is turned in the camera's frame.
        position_noise_m, velocity_noise_m_s, angle_noise_rad: standard deviations of one report.
        drift_m_per_sqrt_s: growth of the position error.
    """

    flight: Flight
    seed: int
    frame_yaw_rad: float = 0.0
    clock: OffsetClock = field(default_factory=OffsetClock)
    faults: CameraFaults = field(default_factory=CameraFaults)
    position_noise_m: float = 0.01
    velocity_noise_m_s: float = 0.03
    angle_noise_rad: float = 0.003
    drift_m_per_sqrt_s: float = 0.01

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)
        self._drift: Vector = np.zeros(3)
        self._last_s: float | None = None

    def _noise(self, deviation: float) -> Vector:
        return self._random.normal(0.0, deviation, 3)

    def _step_drift(self, time_s: float) -> None:
        elapsed_s = 0.0 if self._last_s is None else time_s - self._last_s
        self._last_s = time_s
        self._drift = self._drift + self._noise(self.drift_m_per_sqrt_s * math.sqrt(max(elapsed_s, 0.0)))

    def _has_reset(self, time_s: float) -> bool:
        return self.faults.reset_s is not None and time_s >= self.faults.reset_s

    def _quality(self, time_s: float) -> int:
        faults = self.faults
        return faults.low_quality_percent if faults.low_quality and time_s in faults.low_quality else 90

    def report(self, true_us: int) -> ODOMETRY | None:
        """Return the report of the frame taken ``true_us`` after the autopilot's boot, or None while there is none.

        Position and attitude are in the camera's local frame (FRD), velocity in the body frame (FRD).
        """
        time_s = true_us * 1e-6
        self._step_drift(time_s)
        noise = [self._noise(s) for s in (self.position_noise_m, self.velocity_noise_m_s, self.angle_noise_rad)]
        if self.faults.dropout and time_s in self.faults.dropout:
            return None
        turn = quats_from_euler((0.0, 0.0, self.frame_yaw_rad))
        body_to_ned = quats_from_euler(self.flight.attitude_rpy_rad(time_s) + noise[2])
        position = rotate(turn, self.flight.position_ned(time_s)) + self._drift + noise[0]
        if self._has_reset(time_s):
            position = position + np.array(self.faults.reset_jump_m)
        if self.faults.mismatch and time_s in self.faults.mismatch:
            position = position + np.array(self.faults.mismatch_m)
        velocity = rotate(inverse(body_to_ned), self.flight.velocity_ned(time_s)) + noise[1]
        return ODOMETRY(
            time_usec=self.clock.time_us(true_us),
            frame_id=MAV_FRAME_LOCAL_FRD,
            child_frame_id=MAV_FRAME_BODY_FRD,
            x=float(position[0]),
            y=float(position[1]),
            z=float(position[2]),
            q=tuple(product(turn, body_to_ned).tolist()),
            vx=float(velocity[0]),
            vy=float(velocity[1]),
            vz=float(velocity[2]),
            rollspeed=0.0,
            pitchspeed=0.0,
            yawspeed=0.0,
            pose_covariance=_covariance(self.position_noise_m, self.angle_noise_rad),
            velocity_covariance=_covariance(self.velocity_noise_m_s, self.angle_noise_rad),
            reset_counter=int(self._has_reset(time_s)),
            estimator_type=MAV_ESTIMATOR_TYPE_VIO,
            quality=self._quality(time_s),
        )


def _covariance(first_deviation: float, second_deviation: float) -> tuple[float, ...]:
    """Return the upper triangle of a diagonal 6x6 covariance."""
    matrix = np.diag([first_deviation**2] * 3 + [second_deviation**2] * 3)
    return tuple(float(value) for value in matrix[np.triu_indices(6)])
