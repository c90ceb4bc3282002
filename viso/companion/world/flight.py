# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight over synthetic ground: the companion's sensor data in order, and the ground truth."""

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.types import (
    CameraCalibration,
    DistortionModel,
    HeightMeasurement,
    ImuBias,
    ImuSample,
    SensorEvent,
    WarmStartPose,
)
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import FlightPath, nadir_survey
from viso.companion.world.texture import DEFAULT_NOISE_SIGMA, GroundTexture
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

if TYPE_CHECKING:
    from viso.companion.world.renderer import Renderer

DEFAULT_FRAME_RATE_HZ: Final = 10 / 3
DEFAULT_RATE_HZ: Final = 200
CAMERA_ID: Final = "synthetic"
_NS: Final = 1_000_000_000
_CAMERA_PLACE_B: Final = (0.1, 0.0, -0.05)

# The sigmas of a warm start: the position is exact by definition, the height and the biases are nearly unknown.
_PLACE_SIGMA_M: Final = 1e-3
_HEIGHT_SIGMA_M: Final = 0.3
_GYRO_SIGMA: Final = 0.02
_ACCEL_SIGMA: Final = 0.15
_LEAST_SIGMA: Final = 1e-4


def nadir_calibration(width: int = 640, height: int = 480, focal_px: float = 500.0) -> CameraCalibration:
    """Return the calibration of a camera without distortion that looks down, a little ahead of the IMU and below it."""
    return CameraCalibration(
        camera_id=CAMERA_ID,
        unit="0",
        width=width,
        height=height,
        fx=focal_px,
        fy=focal_px,
        cx=0.5 * (width - 1),
        cy=0.5 * (height - 1),
        distortion_model=DistortionModel.NONE,
        distortion=np.zeros(0),
        B_T_C=SE3(MOUNTINGS["nadir"], np.array(_CAMERA_PLACE_B)),
    )


def default_bias() -> ImuBias:
    """Return the biases of an autopilot's IMU without calibration of its own."""
    return ImuBias(accel=np.array([0.06, -0.04, 0.08]), gyro=np.array([0.004, -0.006, 0.003]))


class Place(Protocol):
    """A scenery: the camera's view, and the height of the ground."""

    def renderer(
        self, texture: GroundTexture, calibration: CameraCalibration, seed: int, noise_sigma: float
    ) -> "Renderer":
        """Return its renderer; needs OpenCV."""

    def ground_m(self, east_m: Array, north_m: Array) -> Array:
        """Return the height of the ground, z of the world in m, at places of any shape."""


@dataclass(frozen=True, slots=True)
class SimulatedImu:
    """An IMU; iterating gives the same samples each time.

    Attributes:
        bias: at the first sample.
        seed: of the noise and the walks.
        start_ns: stamp of the trajectory's time 0, and of the first sample.
    """

    trajectory: FlightPath
    noise: ImuNoise = field(default_factory=ImuNoise)
    bias: ImuBias = field(default_factory=default_bias)
    rate_hz: int = DEFAULT_RATE_HZ
    seed: int = 0
    start_ns: int = 0

    def readings(self) -> Iterator[tuple[ImuSample, ImuBias]]:
        """Yield each sample and the biases in it, without end."""
        rng = np.random.default_rng([self.seed, 3])
        noise, rate = self.noise, self.rate_hz
        bias = np.concatenate([self.bias.gyro, self.bias.accel])
        white = np.repeat([noise.gyro, noise.accel], 3) * math.sqrt(rate)
        walk = np.repeat([noise.gyro_walk, noise.accel_walk], 3) / math.sqrt(rate)
        first = 0
        while True:
            ticks = range(first, first + rate)
            motion = self.trajectory.motion(np.array(ticks) / rate)
            biases = bias + np.cumsum(walk * rng.standard_normal((rate, 6)), axis=0)
            truth = np.concatenate([motion.rates_b, motion.specific_force_b], axis=1)
            shown = truth + biases + white * rng.standard_normal((rate, 6))
            for tick, six, of_it in zip(ticks, shown, biases, strict=True):
                sample = ImuSample(t_ns=self.start_ns + tick * _NS // rate, accel=six[3:], gyro=six[:3])
                yield sample, ImuBias(accel=of_it[3:], gyro=of_it[:3])
            bias, first = biases[-1], first + rate


@dataclass(frozen=True, slots=True, kw_only=True)
class SyntheticFlight:
    """A flight; iterating gives the same events each time.

    Events come in the order in which a companion has them: IMU samples and heights at once, a frame ``latency_s`` after
    the middle of its exposure. The shutter is not in step with the IMU: it is ``shutter_phase_s`` behind.

    Attributes:
        seed: of all noise and errors; the trajectory and the texture have their own.
        trajectory: its time 0 is the flight's start.
        place: the scenery; None for flat ground.
        duration_s: from the start; no frame is taken after it.
        start_ns: stamp of the start.
        frame_rate_hz: of the camera, and of the height measurements.
        shutter_phase_s: from the start to the first frame.
        latency_s: from the middle of an exposure to the frame's arrival.
        covered_s: spans of time, from and to, in which the lens is covered.
        pixel_sigma: noise of a pixel in grey levels.
        height_sigma_m: noise of the height; None for no measurements.
        height_scale: factor of the height: 1.03 for an error of 3 %.
        imu_bias: at the start.
    """

    seed: int = 0
    trajectory: FlightPath = field(default_factory=nadir_survey)
    texture: GroundTexture = field(default_factory=generate_texture)
    place: Place | None = None
    calibration: CameraCalibration = field(default_factory=nadir_calibration)
    duration_s: float = 60.0
    start_ns: int = 0
    frame_rate_hz: float = DEFAULT_FRAME_RATE_HZ
    shutter_phase_s: float = 0.0017
    latency_s: float = 0.03
    covered_s: tuple[tuple[float, float], ...] = ()
    pixel_sigma: float = DEFAULT_NOISE_SIGMA
    height_sigma_m: float | None = 0.3
    height_scale: float = 1.0
    imu_noise: ImuNoise = field(default_factory=ImuNoise)
    imu_bias: ImuBias = field(default_factory=default_bias)
    imu_rate_hz: int = DEFAULT_RATE_HZ

    def events(self) -> Iterator[SensorEvent]:
        """Yield the sensor data in order of arrival; the IMU a little longer than the rest."""
        sources = (self._imu_events(), self._height_events(), self._frame_events())
        for _, event in heapq.merge(*sources, key=lambda arrival: arrival[0]):
            yield event

    def truth(self, t_ns: int) -> SE3:
        """Return world_T_body at a time of the IMU's clock."""
        return self.trajectory.pose(self._seconds(t_ns))

    def truth_velocity_w(self, t_ns: int) -> Array:
        """Return the velocity [3] in m/s, ENU, at a time of the IMU's clock."""
        return self.trajectory.velocity_w(self._seconds(t_ns))

    def warm_start(
        self, t_ns: int | None = None, *, angle_sigma_rad: float = 0.01, velocity_sigma_m_s: float = 0.2
    ) -> WarmStartPose:
        """Return the true state with errors, and a covariance that admits them; the biases are not known.

        Args:
            t_ns: when, by the IMU's clock; the first frame unless given.
            angle_sigma_rad: of each of the attitude's three errors.
            velocity_sigma_m_s: of each of the velocity's three errors.
        """
        t_ns = self._frame_ns(0) if t_ns is None else t_ns
        rng = np.random.default_rng([self.seed, 7])
        truth = self.truth(t_ns)
        rotation = truth.R @ so3_exp(rng.normal(0, angle_sigma_rad, 3))
        velocity_w = self.truth_velocity_w(t_ns) + rng.normal(0, velocity_sigma_m_s, 3)
        sigmas = np.repeat([angle_sigma_rad, _PLACE_SIGMA_M, velocity_sigma_m_s, _GYRO_SIGMA, _ACCEL_SIGMA], 3)
        sigmas[5] = _HEIGHT_SIGMA_M
        covariance = np.diag(np.maximum(sigmas, _LEAST_SIGMA) ** 2)
        return WarmStartPose(SE3(rotation, truth.t).inverse(), rotation.T @ velocity_w, ImuBias.zero(), covariance)

    def _seconds(self, t_ns: int) -> float:
        return (t_ns - self.start_ns) / _NS

    def _frame_ns(self, sequence: int) -> int:
        """Return when a frame is taken, by the IMU's clock."""
        return self.start_ns + round((self.shutter_phase_s + sequence / self.frame_rate_hz) * _NS)

    def _frame_times(self) -> Iterator[int]:
        sequence = 0
        while self._seconds(t_ns := self._frame_ns(sequence)) <= self.duration_s:
            yield t_ns
            sequence += 1

    def _imu_events(self) -> Iterator[tuple[int, SensorEvent]]:
        imu = SimulatedImu(
            self.trajectory, self.imu_noise, self.imu_bias, self.imu_rate_hz, self.seed, start_ns=self.start_ns
        )
        end_ns = self.start_ns + round((self.duration_s + self.latency_s) * _NS)
        for sample, _ in imu.readings():
            if sample.t_ns > end_ns:
                return
            yield sample.t_ns, sample

    def _height_events(self) -> Iterator[tuple[int, SensorEvent]]:
        if self.height_sigma_m is None:
            return
        rng = np.random.default_rng([self.seed, 6])
        for t_ns in self._frame_times():
            east_m, north_m, up_m = self.truth(t_ns).t
            if self.place is not None:
                up_m -= float(self.place.ground_m(east_m, north_m))
            height_m = float(up_m) * self.height_scale + rng.normal(0, self.height_sigma_m)
            yield t_ns, HeightMeasurement(t_ns, height_m, self.height_sigma_m)

    def _frame_events(self) -> Iterator[tuple[int, SensorEvent]]:
        from viso.companion.world.renderer import PlaneRenderer  # wants OpenCV, which a flight without frames does not

        make = PlaneRenderer if self.place is None else self.place.renderer
        renderer = make(self.texture, self.calibration, self.seed, self.pixel_sigma)
        offset_ns = round(self.calibration.time_offset_s * _NS)
        for sequence, t_ns in enumerate(self._frame_times()):
            stamp_ns, t_s = t_ns - offset_ns, self._seconds(t_ns)
            if any(start <= t_s < end for start, end in self.covered_s):
                frame = renderer.covered(sequence, stamp_ns)
            else:
                frame = renderer.render(self.trajectory.pose(t_s), sequence, stamp_ns)
            yield t_ns + round(self.latency_s * _NS), frame
