# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An IMU on a trajectory: what it should show, white noise, and biases that walk."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from viso.companion.vio.config import ImuNoise
from viso.companion.vio.types import ImuBias, ImuSample
from viso.companion.world.motion import Trajectory

DEFAULT_RATE_HZ: Final = 200
_NS: Final = 1_000_000_000


def default_bias() -> ImuBias:
    """Return the biases of an autopilot's IMU without calibration of its own."""
    return ImuBias(accel=np.array([0.06, -0.04, 0.08]), gyro=np.array([0.004, -0.006, 0.003]))


@dataclass(frozen=True, slots=True)
class SimulatedImu:
    """An IMU; iterating gives the same samples each time.

    Attributes:
        bias: at the first sample.
        seed: of the noise and the walks.
        start_ns: stamp of the trajectory's time 0, and of the first sample.
    """

    trajectory: Trajectory
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
