# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file holds becomes a trajectory: what cannot be used is left out, and counted with a reason."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from viso.geometry.pose import sound_covariance
from viso.geometry.rotation import Array
from viso.geometry.trajectory import RecordedTrajectory

LARGEST: Final = 1e6
"""No position in m and no velocity in m/s is larger; what is, came from a damaged file, or counts from far away."""
DAY_NS: Final = 86_400 * 10**9
_UNIT_LENGTH: Final = 0.05

NOT_FINITE: Final = "a number that is not finite"
OUT_OF_RANGE: Final = "a position or velocity out of range"
NO_ROTATION: Final = "an attitude that is no rotation"
FAR_OFF: Final = "a time more than a day from most others"
NOT_LATER: Final = "a time not after the one before"
CUT_SHORT: Final = "a line that was cut short"
BAD_COVARIANCE: Final = "a covariance that is none (the pose is kept)"


class TrajectoryError(Exception):
    """A file that cannot be read as a trajectory, in one line: which file, which line or record, and why."""

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.split()))


class TooFewRecords(TrajectoryError):
    """Too few records can be used; ``left_out`` counts the others by reason."""

    def __init__(self, text: str, left_out: Mapping[str, int]) -> None:
        super().__init__(text)
        self.left_out = left_out


@dataclass(frozen=True, slots=True, eq=False)
class Records:
    """What a file holds, as it stands there, whether it can be used or not.

    Attributes:
        source: the file's name.
        times_ns: [N], in the order of the file, each from 0 to ``TIME_END_NS``.
        positions: [N, 3] in m.
        quats_wxyz: [N, 4], of whatever norm.
        velocities: [N, 3] in m/s, in the world; None if the file has none.
        covariances: [N, 6, 6], NaN where there is none; None if the file has none.
        arrivals_ns: [N], when who wrote the file got each record; None if the file does not tell.
        left_out: what was left out already, by reason.
    """

    source: str
    times_ns: Sequence[int]
    positions: Any
    quats_wxyz: Any
    velocities: Any = None
    covariances: Any = None
    arrivals_ns: Sequence[int] | None = None
    left_out: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))


def usable(records: Records, *, from_anywhere: bool = False, fewest: int = 2) -> RecordedTrajectory:
    """Return the trajectory of what can be used; a record without a time has that of its arrival.

    Records that cannot be used are left out, and counted. Velocities that are all 0 or NaN count as unknown, as do
    covariances whose numbers are all 0: programs that do not know them write that. ``from_anywhere`` lets positions lie
    far from the origin, as those of UTM do, if near to each other. Raises TooFewRecords for less than ``fewest``.
    """
    times_ns = records.times_ns
    if records.arrivals_ns is not None:
        times_ns = [time or arrival for time, arrival in zip(times_ns, records.arrivals_ns, strict=True)]
    times = np.array(times_ns, dtype=np.int64)
    count = len(times)
    position = np.array(records.positions, dtype=np.float64).reshape(count, 3)
    quats = np.array(records.quats_wxyz, dtype=np.float64).reshape(count, 4)
    velocities, covariances = records.velocities, records.covariances
    velocity = None if velocities is None else np.array(velocities, dtype=np.float64).reshape(count, 3)
    if velocity is not None and not np.nan_to_num(velocity).any():
        velocity = None
    counts = dict(records.left_out)
    kept = np.arange(count)

    def drop(bad: Any, reason: str) -> None:
        nonlocal kept
        if bad.any():
            counts[reason] = int(bad.sum())
            kept = kept[~bad]

    moving = np.hstack([position] if velocity is None else [position, velocity])
    drop(~np.isfinite(np.hstack([moving, quats])).all(axis=1), NOT_FINITE)
    moving[:, :3] -= np.median(position[kept], axis=0) if from_anywhere and len(kept) else 0.0
    drop((np.abs(moving[kept]) > LARGEST).any(axis=1), OUT_OF_RANGE)
    with np.errstate(over="ignore"):
        drop(np.abs(np.linalg.norm(quats[kept], axis=1) - 1) > _UNIT_LENGTH, NO_ROTATION)
    if len(kept):  # a stamp of 0 before a clock is set, or a damaged one, would make years of silence
        drop(np.abs(times[kept] - int(np.median(times[kept]))) > DAY_NS, FAR_OFF)
    drop(times[kept] <= np.maximum.accumulate(np.concatenate([[-1], times[kept]]))[:-1], NOT_LATER)
    if len(kept) < fewest:
        reasons = "".join(f"; {number} with {reason}" for reason, number in counts.items())
        text = f"{records.source}: {len(kept)} usable records, and a trajectory needs {fewest}{reasons}"
        raise TooFewRecords(text, counts)
    covariance = None if covariances is None else _sound(np.array(covariances, dtype=np.float64)[kept], counts)
    return RecordedTrajectory(
        times[kept],
        position[kept],
        quats[kept],
        None if velocity is None else velocity[kept],
        covariance,
        left_out=counts,
    )


def _sound(covariances: Array, counts: dict[str, int]) -> Array | None:
    """Return the covariances, NaN where they are none; None if there is none at all."""
    bad = 0
    for covariance in covariances:
        if np.isnan(covariance).any() or not covariance.any():
            covariance[:] = np.nan
            continue
        sound = sound_covariance(covariance) if np.abs(covariance).max() <= LARGEST**2 else None
        bad += sound is None
        covariance[:] = np.nan if sound is None else sound
    if bad:
        counts[BAD_COVARIANCE] = bad
    return None if np.isnan(covariances).all() else covariances
