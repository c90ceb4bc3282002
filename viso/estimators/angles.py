# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the three numbers that a sender calls roll, pitch and yaw follows which angle of the vehicle.

Changes of angles over half a second are compared, so that neither an offset nor a drift matters. Each angle is judged
by itself: a vehicle that only turns shows where its yaw goes and with which sign, and nothing of roll and pitch.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.turning import windows
from viso.geometry.rotation import Array

ANGLES: Final = ("roll", "pitch", "yaw")
YAW: Final = 2
WINDOW_S: Final = 0.5
LEAST_RANGE_RAD: Final = (math.radians(3), math.radians(3), math.radians(6))
"""The vehicle's roll, pitch and yaw cover as much before they show anything."""
LEAST_CORRELATION: Final = 0.8
LEAST_LEAD: Final = 0.15
"""Of a correlation: the right number may follow too, late or in periodic motion, and then nothing is exchanged."""
LEAST_SIGMAS: Final = 4.0
LEAST_STEPS: Final = 2.0
"""Of half a second each, that the motion is spread over: one alone may be a jump."""
SIZE_WITHIN: Final = (0.6, 1.7)
"""What is sent is as large as what the vehicle turns."""

_DELAYS_S: Final = np.arange(-0.1, 0.65, 0.05)
_FEWEST: Final = 30
_LONGEST_GAP_S: Final = 1.0
_LARGEST_STEP_RAD: Final = 1.5
_STEEPEST_RAD: Final = math.radians(60)


@dataclass(frozen=True, slots=True)
class Carrier:
    """The number that an angle of the vehicle is sent in.

    Attributes:
        angle: of the vehicle, 0 to 2 for roll, pitch and yaw.
        sent: the number that follows it, likewise.
        sign: 1, or -1 if it turns the other way.
        correlation: of the two, 0 to 1.
        own_correlation: of the number that ought to follow it, -1 to 1; 0 if that one does not move.
    """

    angle: int
    sent: int
    sign: int
    correlation: float
    own_correlation: float

    @property
    def is_right(self) -> bool:
        """Whether the angle is where it belongs."""
        return self.sent == self.angle and self.sign > 0


@dataclass(frozen=True, slots=True)
class _Fit:
    """How one number follows one angle, at the delay at which it does so best with its sign.

    Attributes:
        correlation: -1 to 1.
        sigmas: by how many standard deviations it is not 0.
        steps: of half a second, that the common motion is spread over.
        size: of what is sent, over that of the angle.
    """

    correlation: float
    sigmas: float
    steps: float
    size: float

    @property
    def is_clear(self) -> bool:
        """Whether it follows, and neither noise nor a single jump makes it seem so."""
        is_sure = self.sigmas >= LEAST_SIGMAS and self.steps >= LEAST_STEPS
        return is_sure and abs(self.correlation) >= LEAST_CORRELATION and SIZE_WITHIN[0] < self.size < SIZE_WITHIN[1]


def unfolded(euler_rad: Array) -> Array:
    """Return roll, pitch and yaw [N, 3] without the fold at 90 deg of pitch, and without jumps by a full turn.

    The angles of a quaternion have a pitch of at most 90 deg; beyond it roll and yaw jump by 180 deg and pitch comes
    back.
    """
    step = np.abs(np.angle(np.exp(1j * np.diff(euler_rad, axis=0))))
    is_fold = (step[:, 0] > math.pi / 2) & (step[:, 2] > math.pi / 2)
    folded = np.concatenate([[0], np.cumsum(is_fold)]) % 2 == 1
    other = np.column_stack((euler_rad[:, 0] + math.pi, math.pi - euler_rad[:, 1], euler_rad[:, 2] + math.pi))
    return np.unwrap(np.where(folded[:, None], other, euler_rad), axis=0)


def carriers(
    stream_time_us: npt.ArrayLike,
    sent_rad: npt.ArrayLike,
    vehicle_time_us: npt.ArrayLike,
    vehicle_rad: npt.ArrayLike,
    vehicle_turned_rad: npt.ArrayLike,
) -> tuple[Carrier, ...]:
    """Return the carriers of those angles of the vehicle that move enough to show theirs.

    Args:
        stream_time_us: [N], on the vehicle's clock.
        sent_rad: [N, 3], the numbers sent as roll, pitch and yaw.
        vehicle_time_us: [M].
        vehicle_rad: [M, 3], the vehicle's roll, pitch and yaw.
        vehicle_turned_rad: [M, 3], the same or what else counts the vehicle's turns, such as sums of a gyro's rates.
    """
    sent_us, sent = _clean(stream_time_us, sent_rad)
    vehicle_us, columns = _clean(vehicle_time_us, np.column_stack((vehicle_rad, vehicle_turned_rad)))
    if len(sent_us) < _FEWEST or len(vehicle_us) < _FEWEST:
        return ()
    sent_s, vehicle_s, sent = sent_us * 1e-6, vehicle_us * 1e-6, np.unwrap(sent, axis=0)
    start, end = windows(sent_s, WINDOW_S)
    moved = sent[end] - sent[start]
    fits: dict[tuple[int, int, int], _Fit] = {}
    ranges = [0.0, 0.0, 0.0]
    for delay_s in _DELAYS_S.tolist():
        first, known = _at(vehicle_s, columns, sent_s[start] - delay_s)
        last, known_too = _at(vehicle_s, columns, sent_s[end] - delay_s)
        turned = last[:, 3:] - first[:, 3:]
        fine = known & known_too & (np.abs(first[:, 1]) < _STEEPEST_RAD)
        fine &= (np.abs(moved) < _LARGEST_STEP_RAD).all(axis=1) & (np.abs(turned) < _LARGEST_STEP_RAD).all(axis=1)
        if np.count_nonzero(fine) < _FEWEST:
            continue
        ranges = np.maximum(ranges, np.ptp(first[fine, 3:], axis=0)).tolist()
        blocks = ((sent_s[start][fine] - sent_s[0]) / WINDOW_S).astype(np.intp)
        for angle in range(3):
            for number in range(3):
                fit = _fit(moved[fine, number], turned[fine, angle], blocks)
                key = angle, number, 1 if fit.correlation > 0 else -1
                if key not in fits or abs(fit.correlation) > abs(fits[key].correlation):
                    fits[key] = fit
    return tuple(_chosen(fits, ranges))


def _chosen(fits: dict[tuple[int, int, int], _Fit], ranges: list[float]) -> list[Carrier]:
    """Return the carriers, the clearest first; each number carries one angle.

    Where one is wrong, half of the motion is enough for others.
    """
    found: list[Carrier] = []
    for share in (1.0, 0.5):
        if share < 1 and all(carrier.is_right for carrier in found):
            break
        for (angle, number, sign), fit in sorted(fits.items(), key=lambda item: -abs(item[1].correlation)):
            is_taken = any(angle == other.angle or number == other.sent for other in found)
            if is_taken or not fit.is_clear or ranges[angle] < share * LEAST_RANGE_RAD[angle]:
                continue
            own = fits.get((angle, angle, 1))
            carrier = Carrier(angle, number, sign, abs(fit.correlation), 0.0 if own is None else own.correlation)
            if carrier.is_right or carrier.own_correlation < carrier.correlation - LEAST_LEAD:
                found.append(carrier)
    return found


def _fit(sent: Array, turned: Array, blocks: npt.NDArray[np.intp]) -> _Fit:
    own, other = math.sqrt(float(np.mean(sent**2))), math.sqrt(float(np.mean(turned**2)))
    if own <= 0 or other <= 0:
        return _Fit(0.0, 0.0, 0.0, 0.0)
    parts = np.bincount(blocks, sent * turned)
    total = float(np.sum(parts))
    noise = math.sqrt(float(np.sum(np.bincount(blocks, sent * (turned - total / np.sum(sent**2) * sent)) ** 2)))
    sigmas = abs(total) / noise if noise > 0 else math.inf
    return _Fit(total / (len(sent) * own * other), sigmas, total**2 / max(float(np.sum(parts**2)), 1e-30), own / other)


def _clean(time_us: npt.ArrayLike, values: npt.ArrayLike) -> tuple[Array, Array]:
    """Return times in us and rows that are finite, each later than all before."""
    times, rows = np.asarray(time_us, np.float64), np.asarray(values, np.float64)
    usable = np.isfinite(times) & np.isfinite(rows).all(axis=1) & (np.abs(rows) < 1e6).all(axis=1)
    times, rows = times[usable], rows[usable]
    newer = np.diff(np.maximum.accumulate(times), prepend=-np.inf) > 0
    return times[newer], rows[newer]


def _at(time_s: Array, columns: Array, at_s: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    after = np.clip(np.searchsorted(time_s, at_s, side="right"), 1, len(time_s) - 1)
    known = (at_s >= time_s[0]) & (at_s <= time_s[-1]) & (time_s[after] - time_s[after - 1] <= _LONGEST_GAP_S)
    return np.column_stack([np.interp(at_s, time_s, column) for column in columns.T]), known
