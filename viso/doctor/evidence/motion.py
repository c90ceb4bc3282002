# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sender's path and its velocities side by side: they have to be one motion."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from viso.doctor.evidence.sender_clock import sender_clock, time_base_us
from viso.doctor.evidence.tracks import (
    Bools,
    Floats,
    Ints,
    Poses,
    Sender,
    Velocities,
    down_in_body,
    reordered,
)
from viso.geometry.rotation import euler_from_quats, rotate

WINDOW_S: Final = 0.25
FEWEST_WINDOWS: Final = 30
"""Fewer windows of motion show nothing."""
LEAST_SPEED: Final = 0.25
"""In m/s; below it directions are noise."""

_LONGEST_WINDOW: Final = 2.4  # times its length
_LEAST_RESIDUAL: Final = 0.3  # m/s, below which nothing is an outlier
_MOST_FOR_AXES: Final = 5000  # windows; more are thinned out
_CLEARLY_BETTER: Final = 0.02  # of a correlation
_FAILED: Final = -1  # of a quality
_INVERSE: Final = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Mean velocities over M windows, by default of a quarter of a second, in m/s, each M x 3.

    Attributes:
        pose_sender, velocity_sender: whose messages.
        numbers: M, of the first pose of each window.
        arrival_us: M, likewise.
        path: from the positions.
        used: from the velocities as the autopilot understands them.
        sent: from the velocities as sent.
        turned: from the velocities as sent, turned by the attitude.
        used_turned: from the velocities as the autopilot understands them, turned by the attitude.
        path_body: from the positions, in the axes of the body.
        reordered: from the velocities as sent, turned by the attitude read as x, y, z, w.
        is_level_reordered: whether that attitude is more or less level, as those of vehicles are.
    """

    pose_sender: Sender
    velocity_sender: Sender
    numbers: Ints
    arrival_us: Ints
    path: Floats
    used: Floats
    sent: Floats
    turned: Floats
    used_turned: Floats
    path_body: Floats
    reordered: Floats
    is_level_reordered: bool

    @property
    def is_enough(self) -> bool:
        """Whether there is enough motion to compare directions."""
        return len(self.numbers) >= FEWEST_WINDOWS and typical_speed(self.path) >= LEAST_SPEED


class Agreement(NamedTuple):
    """How well velocities fit a path: path = scale * velocity; the correlation is -1 to 1."""

    scale: float
    correlation: float


def typical_speed(velocities: Floats) -> float:
    """Return the root mean square speed in m/s, without the fastest twentieth."""
    lengths = np.linalg.norm(velocities, axis=1)
    if not len(lengths):
        return 0.0
    kept = lengths[lengths <= np.quantile(lengths, 0.95)]
    return math.sqrt(float(np.mean(kept**2)))


def _inliers(path: Floats, velocities: Floats) -> Bools:
    residual = np.linalg.norm(path - velocities, axis=1)
    return np.asarray(residual <= max(3 * float(np.median(residual)), _LEAST_RESIDUAL), dtype=np.bool_)


def agreement(path: Floats, velocities: Floats) -> Agreement:
    """Return how well N x 3 velocities fit a path's."""
    chosen = _inliers(path, velocities)
    one, other = path[chosen], velocities[chosen]
    product, energy = float(np.sum(one * other)), float(np.sum(other**2))
    both = math.sqrt(energy * float(np.sum(one**2)))
    return Agreement(product / energy if energy > 0 else 0.0, product / both if both > 0 else 0.0)


class Axes(NamedTuple):
    """A mix-up of axes: a signed permutation, and its text."""

    matrix: Floats
    text: str

    @property
    def is_identity(self) -> bool:
        """Whether nothing is mixed up."""
        return bool(np.array_equal(self.matrix, np.eye(3)))


def _all_axes() -> Iterator[Axes]:
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            names = (("-" if sign < 0 else "") + "xyz"[column] for column, sign in zip(order, signs, strict=True))
            yield Axes(np.diag(signs) @ np.eye(3)[list(order)], f"({', '.join(names)})")


AXES: Final[Sequence[Axes]] = tuple(sorted(_all_axes(), key=lambda axes: -float(np.trace(axes.matrix))))
"""All 48, mirrored ones included; the less is mixed up, the earlier."""


def best_axes(path: Floats, velocities: Floats) -> tuple[Axes, Agreement]:
    """Return the axes with which velocities fit a path best; of those that fit equally, the least mixed up.

    Long paths are thinned out evenly.
    """
    path, velocities = (values[:: len(path) // _MOST_FOR_AXES + 1] for values in (path, velocities))
    best = AXES[0], agreement(path, velocities)
    for axes in AXES[1:]:
        fit = agreement(path, velocities @ axes.matrix.T)
        if fit.correlation > best[1].correlation + _CLEARLY_BETTER:
            best = axes, fit
    return best


def heading_between(path: Floats, velocities: Floats) -> tuple[float, float]:
    """Return the angle in rad by which horizontal velocities must be turned to fit a path, and the correlation then."""
    chosen = np.linalg.norm(path, axis=1) <= 3 * max(typical_speed(path), LEAST_SPEED)
    one, other = path[chosen, :2], velocities[chosen, :2]
    along = float(np.sum(one * other))
    across = float(np.sum(other[:, 0] * one[:, 1] - other[:, 1] * one[:, 0]))
    both = math.sqrt(float(np.sum(one**2)) * float(np.sum(other**2)))
    return math.atan2(across, along), math.hypot(along, across) / both if both > 0 else 0.0


def _integral(time_s: Floats, values: Floats) -> Floats:
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time_s)[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _on_times(velocities: Velocities, poses: Poses, time_us: Ints) -> Floats | None:
    """Return velocities as sent, interpolated at the times of poses; None if the two share no clock."""
    if velocities.track.sender == poses.track.sender:
        return velocities.sent
    if len(velocities.track) < 2:
        return None
    times = velocities.track.arrival_us
    if time_us is poses.track.stamp_us:
        offset = velocities.track.first_stamp - poses.track.first_stamp
        times = velocities.track.stamp_us + offset
        if abs(offset) > 10_000_000 or bool(np.any(np.diff(times) < 0)):
            return None
    elif sender_clock(poses.track) is None:
        return None
    else:
        time_us = poses.track.arrival_us
    return np.column_stack([np.interp(time_us, times, velocities.sent[:, axis]) for axis in range(3)])


def _is_level(quat_wxyz: Floats) -> bool:
    """Return whether most attitudes are tilted by less than 45 deg."""
    upright = down_in_body(euler_from_quats(quat_wxyz))[:, 2]
    return float(np.nanmedian(upright)) > math.cos(math.radians(45))


def _motion(poses: Poses, velocities: Velocities, window_s: float) -> Motion | None:
    time_us = time_base_us(poses.track)
    sent = _on_times(velocities, poses, time_us)
    if sent is None or len(poses.track) < FEWEST_WINDOWS:
        return None
    time_s: Floats = np.asarray(time_us * 1e-6, dtype=np.float64)
    turned = rotate(poses.quat_wxyz, sent)
    finite = np.isfinite(np.column_stack((poses.pos_m, sent, turned))).all(axis=1)
    fine: Bools = np.asarray(finite & (poses.quality != _FAILED), dtype=np.bool_)
    first = np.arange(len(time_s))
    last = np.searchsorted(time_s, time_s + window_s)
    first, last = first[last < len(time_s)], last[last < len(time_s)]
    bad = np.concatenate([[0], np.cumsum(~fine)])
    changes = np.concatenate([[0], np.cumsum(np.diff(poses.reset_counter) != 0)])
    dt = time_s[last] - time_s[first]
    usable = (bad[last + 1] == bad[first]) & (changes[last] == changes[first]) & (dt <= _LONGEST_WINDOW * window_s)
    first, last, dt = first[usable], last[usable], dt[usable, None]
    if not len(first):
        return None

    def mean_of(values: Floats) -> Floats:
        total = _integral(time_s, np.where(fine[:, None], values, 0.0))
        return np.asarray((total[last] - total[first]) / dt)

    with np.errstate(all="ignore"):
        path = (poses.pos_m[last] - poses.pos_m[first]) / dt
        mean_turned, mean_sent = mean_of(turned), mean_of(sent)
        mean_twice = mean_of(rotate(poses.quat_wxyz, turned))
        mean_reordered = mean_of(rotate(reordered(poses.quat_wxyz), sent))
    is_body = velocities.track.sender.name == "ODOMETRY"
    return Motion(
        poses.track.sender,
        velocities.track.sender,
        poses.track.numbers[first],
        poses.track.arrival_us[first],
        path,
        mean_turned if is_body else mean_sent,
        mean_sent,
        mean_turned,
        mean_twice if is_body else mean_turned,
        rotate(poses.quat_wxyz[(first + last) // 2] * _INVERSE, path),
        mean_reordered,
        _is_level(reordered(poses.quat_wxyz[first])),
    )


def motions_of(
    poses: Sequence[Poses], velocities: Sequence[Velocities], window_s: float = WINDOW_S
) -> tuple[Motion, ...]:
    """Return the motions of all senders that send poses and velocities; ODOMETRY holds both."""
    found = []
    for pose in poses:
        sender = pose.track.sender
        for other in velocities:
            of = other.track.sender
            both = (of.system_id, of.component_id) == (sender.system_id, sender.component_id)
            if both and (of == sender or "ODOMETRY" not in (of.name, sender.name)):
                motion = _motion(pose, other, window_s)
                if motion is not None:
                    found.append(motion)
    return tuple(found)
