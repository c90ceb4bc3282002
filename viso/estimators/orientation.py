# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The directions of a camera's axes in the vehicle, and of a stream's world axes on the earth.

A stream's attitude is the vehicle's, with two possible mistakes or mountings at its ends: the world's axes on the left
(ENU for NED, z up) and the body's on the right (FLU for FRD, a camera turned in its mount). Body rates depend on the
right one alone; it is found first, and the remainder is the world.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.axis_rotations import BODY_WORDS, EARTH_WORDS, PROPER, AxisMap
from viso.estimators.least_squares import FEWEST_BLOCKS, blocks_of, mean_and_sigma
from viso.estimators.turning import attitudes_of, centred, correlation_of, turn_pair
from viso.geometry.rotation import Array, best_rotation, rotations_from_quats

LEAST_CORRELATION: Final = 0.6
LEAST_MARGIN_SIGMAS: Final = 4.0
LEAST_RATE_RAD: Final = 0.01  # a second
LARGEST_WORLD_SIGMA_DEG: Final = 5.0
LARGEST_SPREAD_DEG: Final = 10.0
NEAR_DEG: Final = 15.0  # largest angle at which a direction counts as along an axis

_CAMERA: Final = ("camera {} is vehicle", BODY_WORDS)
_FEWEST_SAMPLES: Final = 30
_SHORTEST_BLOCK_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class Choice:
    """The best of several axis maps: correlations, -1 to 1, under it and the next best, and its lead."""

    best: AxisMap
    correlation: float
    second_correlation: float
    margin_sigmas: float

    @property
    def is_clear(self) -> bool:
        """Whether the choice is not due to noise or too little motion."""
        return self.correlation >= LEAST_CORRELATION and self.margin_sigmas >= LEAST_MARGIN_SIGMAS


UNDECIDED: Final = Choice(AxisMap((1, 2, 3)), 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ChosenAxes:
    """The directions of a stream's axes: of its body in the vehicle, or of its positions on the earth.

    The motion may be insufficient; motion about or along one axis alone always is. Subject and words are as for
    ``AxisMap.describe``.
    """

    choice: Choice
    sufficient: bool
    subject: str
    words: Sequence[str]

    @property
    def axes(self) -> AxisMap:
        """The best of the maps."""
        return self.choice.best

    @property
    def name(self) -> str:
        """The axes in letters: FRD for a vehicle's own, NED for the earth's."""
        return self.axes.letters(self.words)

    @property
    def text(self) -> str:
        """The same in words."""
        return self.axes.describe(self.subject, self.words)


@dataclass(frozen=True, slots=True)
class WorldAxes:
    """The directions of the stream's world axes on the earth.

    Attributes:
        axes: the nearest map of right angles; its horizontal axes are meaningful only if ``has_compass_axes``.
        heading_deg: compass direction of the first horizontal axis, x unless x is vertical; 0 to 360.
        sigma_deg: one standard deviation of heading and vertical, the larger; infinite if unknown.
        sufficient: whether attitudes agree on one world; not so if the body axes are wrong.
    """

    axes: AxisMap
    heading_deg: float
    sigma_deg: float
    sufficient: bool

    @property
    def is_up(self) -> bool:
        """Whether the stream's z points up."""
        return self.axes.signed_axes[2] == -3

    @property
    def has_compass_axes(self) -> bool:
        """Whether the horizontal axes point along north and east or their opposites, rather than anywhere."""
        return abs((self.heading_deg + 45) % 90 - 45) <= NEAR_DEG

    @property
    def name(self) -> str:
        """NED, ENU and so on, or which axis is vertical and where the first horizontal one points."""
        if self.has_compass_axes:
            return self.axes.letters(EARTH_WORDS)
        vertical = next(k for k, axis in enumerate(self.axes.signed_axes) if abs(axis) == 3)
        word = "down" if self.axes.signed_axes[vertical] > 0 else "up"
        return f"{'xyz'[vertical]} {word}, {'x' if vertical else 'y'} towards {self.heading_deg:.0f} deg"


def choose_axes(source: Array, target: Array, candidates: Sequence[Array], blocks: npt.NDArray[np.intp]) -> Choice:
    """Return which of at least two matrices [3, 3] maps vectors [N, 3] nearest to others.

    Blocks, a number for each vector, are for the margin's standard deviation.
    """
    correlations = np.array([correlation_of(source @ matrix.T, target) for matrix in candidates])
    second, best = np.argsort(correlations)[-2:]
    return Choice(
        AxisMap.of(candidates[best]),
        float(correlations[best]),
        float(correlations[second]),
        _margin_sigmas(source @ candidates[best].T, source @ candidates[second].T, target, blocks),
    )


def _margin_sigmas(best: Array, second: Array, target: Array, blocks: npt.NDArray[np.intp]) -> float:
    """Return the lead of vectors [N, 3] over others in closeness to the target, in standard deviations.

    With d the difference of the two and e the residual of the best, the squares differ by 2 target d, of which 2 e d is
    noise; sums over blocks give the size of that part.
    """
    energy = float(np.sum(best**2))
    if energy == 0:
        return 0.0
    scale = float(np.sum(best * target)) / energy
    apart = scale * (best - second)
    advantage = float(np.sum(target * apart))
    parts = np.bincount(blocks, np.sum((target - scale * best) * apart, axis=1))
    noise = math.sqrt(float(np.sum(parts**2)))
    return advantage / noise if noise > 0 else math.copysign(math.inf, advantage)


def estimate_orientation(
    stream_time_us: npt.ArrayLike,
    stream_quat_wxyz: npt.ArrayLike,
    vehicle_time_us: npt.ArrayLike,
    vehicle_quat_wxyz: npt.ArrayLike,
    *,
    delay_ms: float = 0.0,
) -> ChosenAxes:
    """Find the body axes of a stream from its rotations; arguments as of ``estimate_delay``, which finds the delay."""
    pair = turn_pair(stream_time_us, stream_quat_wxyz, vehicle_time_us, vehicle_quat_wxyz).spread()
    delay_s = delay_ms * 1e-3
    pair = pair.chosen(pair.vehicle_rad(delay_s)[1])
    if len(pair) < _FEWEST_SAMPLES:
        return ChosenAxes(UNDECIDED, False, *_CAMERA)
    pair = pair.without_outliers(
        delay_s, best_rotation(centred(pair.stream_rad), centred(pair.vehicle_rad(delay_s)[0]))
    )
    stream, vehicle = centred(pair.stream_rad), centred(pair.vehicle_rad(delay_s)[0])
    blocks = blocks_of(pair.start_s, _SHORTEST_BLOCK_S)
    choice = choose_axes(stream, vehicle, PROPER, blocks)
    return ChosenAxes(choice, choice.is_clear and pair.rate_rad(delay_s) >= LEAST_RATE_RAD, *_CAMERA)


def estimate_world_axes(
    stream_time_us: npt.ArrayLike,
    stream_quat_wxyz: npt.ArrayLike,
    vehicle_time_us: npt.ArrayLike,
    vehicle_quat_wxyz: npt.ArrayLike,
    *,
    body_axes: AxisMap,
    delay_ms: float = 0.0,
) -> WorldAxes:
    """Find the axes of the stream's world on the earth, once those of its body are known.

    Arguments are as of ``estimate_orientation``, which finds the axes of the body.
    """
    stream, vehicle = attitudes_of(stream_time_us, stream_quat_wxyz), attitudes_of(vehicle_time_us, vehicle_quat_wxyz)
    attitudes, known = vehicle.at(stream.time_s - delay_ms * 1e-3)
    blocks = blocks_of(stream.time_s[known], _SHORTEST_BLOCK_S)
    if known.sum() < _FEWEST_SAMPLES or int(blocks.max()) + 1 < FEWEST_BLOCKS:
        return WorldAxes(AxisMap((1, 2, 3)), math.nan, math.inf, False)
    to_vehicle = body_axes.matrix
    to_earth = rotations_from_quats(attitudes[known]) @ to_vehicle
    to_earth = to_earth @ rotations_from_quats(stream.quats[known]).transpose(0, 2, 1)
    return _world_of(to_earth, blocks)


def _world_of(to_earth: Array, blocks: npt.NDArray[np.intp]) -> WorldAxes:
    """Return the common world axes of matrices [N, 3, 3] from the stream's world to the earth."""
    down = to_earth[:, 2, :]  # in the stream's axes
    mean_down = down.mean(axis=0)
    mean_down /= max(float(np.linalg.norm(mean_down)), 1e-9)
    vertical = int(np.abs(mean_down).argmax())
    horizontal = 1 if vertical == 0 else 0
    directions = to_earth[:, :2, horizontal] @ np.array([1.0, 1j])
    heading = float(np.angle(directions.mean()))
    off = np.angle(directions * np.exp(-1j * heading))
    spread = np.arccos(np.clip(down @ mean_down, -1, 1))
    sigmas = [mean_and_sigma(values, blocks)[1] for values in (off, *np.cross(down, mean_down).T)]
    sigma_deg = math.degrees(max(sigmas))
    spread_deg = math.degrees(math.sqrt(float(np.mean(spread**2))))
    return WorldAxes(
        _nearest_axes(mean_down, heading),
        math.degrees(heading) % 360.0,
        sigma_deg,
        sigma_deg <= LARGEST_WORLD_SIGMA_DEG and spread_deg <= LARGEST_SPREAD_DEG,
    )


def _nearest_axes(down: Array, heading_rad: float) -> AxisMap:
    vertical = int(np.abs(down).argmax())
    horizontal = 1 if vertical == 0 else 0
    matrix = np.zeros((3, 3))
    matrix[2, vertical] = np.sign(down[vertical])
    quarter = round(heading_rad / (math.pi / 2)) % 4
    matrix[:2, horizontal] = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarter]
    other = 3 - vertical - horizontal
    # The third axis is the product of the other two, in the order x, y, z.
    matrix[:, other] = np.cross(matrix[:, (other + 1) % 3], matrix[:, (other + 2) % 3])
    return AxisMap.of(matrix)
