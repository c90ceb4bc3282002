# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Motions with known answers, seeded."""

from dataclasses import dataclass
from itertools import accumulate
from operator import mul
from typing import Any

import numpy as np
import quaternion

from viso.estimators.turning import Attitudes, attitudes_of
from viso.geometry.rotation import Array

VEHICLE_HZ = 100
MARGIN_S = 1.0


def smooth(rng: np.random.Generator, count: int, step_s: float, highest_hz: float) -> Array:
    """Return three channels [N, 3] of noise without higher frequencies."""
    frequencies = np.fft.rfftfreq(count, step_s)
    kept = np.exp(-((frequencies / highest_hz) ** 2))[:, None]
    return np.fft.irfft(np.fft.rfft(rng.standard_normal((count, 3)), axis=0) * kept, count, axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A vehicle that turns at random: times in us [M], body rates [M, 3] and its attitudes."""

    time_us: Array
    rates_rad: Array
    attitudes: Attitudes

    @property
    def quat_wxyz(self) -> Array:
        return self.attitudes.quats

    def seen(
        self,
        rng: np.random.Generator,
        *,
        delay_ms: float = 0.0,
        hz: float = 30.0,
        noise_rad: float = 0.003,
        world: Any = quaternion.one,
        body: Any = quaternion.one,
    ) -> tuple[Array, Array]:
        """Return stamps in us and quaternions of a camera: ``world`` * attitude * ``body``, late, noisy, uneven."""
        span_s = self.time_us[-1] * 1e-6 - 2 * MARGIN_S
        stamps_s = MARGIN_S + np.arange(int(span_s * hz)) / hz + rng.uniform(0, 0.3 / hz, int(span_s * hz))
        quats = quaternion.as_quat_array(self.attitudes.at(stamps_s - delay_ms * 1e-3)[0])
        noise = quaternion.from_rotation_vector(rng.normal(0.0, noise_rad, (len(quats), 3)))
        return stamps_s * 1e6, quaternion.as_float_array(world * quats * noise * body)


def integrated(time_us: Array, rates_rad: Array) -> Array:
    """Return the attitudes [M, 4] of a body that starts level and turns at such rates [M, 3]."""
    steps = 0.5 * (rates_rad[1:] + rates_rad[:-1]) * np.diff(time_us * 1e-6)[:, None]
    turns = quaternion.from_rotation_vector(steps)
    quats: Array = quaternion.as_float_array(list(accumulate(turns, mul, initial=quaternion.one)))
    return quats


def motion(
    rng: np.random.Generator,
    *,
    span_s: float = 20.0,
    rate_rad: float = 0.3,
    axes: tuple[float, float, float] = (1.0, 1.0, 1.0),
    highest_hz: float = 0.7,
) -> Motion:
    """Return a vehicle that turns about its axes, each at a share of the rate."""
    count = int((span_s + 2 * MARGIN_S) * VEHICLE_HZ)
    rates = smooth(rng, count, 1 / VEHICLE_HZ, highest_hz)
    rates *= rate_rad / rates.std() * np.array(axes)
    time_us = np.arange(count) * 1e6 / VEHICLE_HZ
    return Motion(time_us, rates, attitudes_of(time_us, integrated(time_us, rates)))
