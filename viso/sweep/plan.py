# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sweep is: streams, axes and how to replay, and the points that follow from them."""

import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from viso.errors import InputError, file_errors
from viso.extras import pip_install
from viso.streams.stream_kinds import TrajectoryOptions
from viso.sweep.dimensions import Axis
from viso.vehicle.sensors.flight import Basis

FOLLOW: Final = "follow"
RANDOM: Final = "random"
LATIN: Final = "latin"
SAMPLINGS: Final = (RANDOM, LATIN)
MOST_POINTS: Final = 10_000_000
DELAY: Final = "VISO_DELAY_MS"
LATEST_MS: Final = 100
"""Corrected stamps are before the arrival by less than that."""

FORMAT: Final = 2
"""Of the definition and of what is worked out of a point; one more whenever either changes."""


@dataclass(frozen=True, slots=True)
class InputFile:
    """A file, also on the machines of a cluster, and the hash of what it holds, in hex; of a folder, of its files."""

    path: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Recorded:
    """A recorded stream and what belongs to it.

    Attributes:
        imu: the source of its inertial data, as of ``--imu``.
        others: files that the replay reads as well: of sensors, attitude, reference.
        ahrs: the log whose attitude is followed in place of a filter, if any.
        reference: where the vehicle truly was, if that is known.
        basis: what its motion is made of, where a log is flown again.
    """

    name: str
    file: InputFile
    imu: str
    others: tuple[InputFile, ...] = ()
    ahrs: str | None = None
    reference: str | None = None
    basis: Basis | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return what counts: what files hold, not where they are."""
        files = {Path(file.path).name: file.sha256 for file in (self.file, *self.others)}
        used = {name: path and Path(path).name for name, path in (("ahrs", self.ahrs), ("reference", self.reference))}
        kind, _, argument = self.imu.partition(":")
        return {"files": files, "imu": f"{kind}:{Path(argument).name}" if argument else kind, **used}


@dataclass(frozen=True, slots=True)
class Faults:
    """A timeline of faults: its name, and its YAML; empty for none."""

    name: str = "none"
    text: str = ""


@dataclass(frozen=True, slots=True)
class Sampling:
    """How points are drawn: ``random`` or ``latin``, how many, and the seed."""

    method: str
    points: int
    seed: int = 0


@dataclass(frozen=True, slots=True)
class SweepPlan:
    """A sweep, whole: the same plan has the same points, and each point comes to the same figures, anywhere.

    Attributes:
        settings: parameters over those of the recording, by the name of each firmware.
        firmware: the names of profiles.
        faults: the timelines; one that is empty stands for none.
        seeds: of faults and sensor noise; None for the timeline's own, and 0.
        sampling: None for a grid.
        baud: rate of the modelled UART, 0 for none; None for the recording's.
        imu_errors: what is wrong with the sensors, each NAME=VALUE.
        lead_s: from boot to the first message where a recording does not have it.
        until_s: where replays end, since boot; infinite for the end of the stream.
        code: the version of the programs that work it out.
    """

    recordings: tuple[Recorded, ...]
    axes: tuple[Axis, ...]
    settings: Mapping[str, Mapping[str, float]]
    firmware: tuple[str, ...]
    faults: tuple[Faults, ...] = (Faults(),)
    seeds: tuple[int | None, ...] = (None,)
    sampling: Sampling | None = None
    baud: int | None = None
    imu_errors: tuple[str, ...] = ()
    heading_deg: float = 0.0
    lead_s: float = 30.0
    until_s: float = math.inf
    trajectory: TrajectoryOptions = field(default_factory=TrajectoryOptions)
    code: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return what defines the sweep, for JSON; an error about two that differ names it."""
        return {
            "format": FORMAT,
            "code": self.code,
            "streams": {recorded.name: recorded.as_dict() for recorded in self.recordings},
            "set": {axis.name: axis.as_dict() for axis in self.axes},
            "settings": {name: dict(values) for name, values in self.settings.items()},
            "faults": {faults.name: faults.text for faults in self.faults},
            "seeds": list(self.seeds),
            "sample": None if self.sampling is None else asdict(self.sampling),
            "baud": self.baud,
            "imu_errors": list(self.imu_errors),
            "heading_deg": self.heading_deg,
            "lead_s": self.lead_s,
            "until_s": None if math.isinf(self.until_s) else self.until_s,
            "trajectory": {name: value and str(value) for name, value in asdict(self.trajectory).items()},
        }

    @property
    def buffer_ms(self) -> float:
        """How far the filter's buffers reach back at all points where VISO_DELAY_MS is swept, else 0.

        The filter works as far in the past as its buffers reach, which changes innovations too; and what arrives later
        than that is dated later than it was observed.
        """
        tried = [value for axis in self.axes if axis.name == DELAY for value in axis.span or axis.values]
        return max(tried) + LATEST_MS if tried else 0.0

    @property
    def size(self) -> int:
        """How many points there are."""
        each = math.prod(len(axis.values) for axis in self.axes) if self.sampling is None else self.sampling.points
        return each * len(self.recordings) * len(self.firmware) * len(self.faults) * len(self.seeds)

    def points(self) -> Iterator["Point"]:
        """Yield the points, numbered from 0."""
        outer = itertools.product(range(len(self.recordings)), self.firmware, range(len(self.faults)), self.seeds)
        drawn = self._combinations()
        numbers = itertools.count()
        for (recording, firmware, faults, seed), values in itertools.product(outer, drawn):
            yield Point(next(numbers), recording, firmware, faults, seed, values)

    def _combinations(self) -> list[tuple[float, ...]]:
        if self.sampling is None:
            return list(itertools.product(*(axis.values for axis in self.axes)))
        shares = _drawn(self.sampling, len(self.axes))
        return [tuple(axis.at(share) for axis, share in zip(self.axes, row, strict=True)) for row in shares.tolist()]


@dataclass(frozen=True, slots=True)
class Point:
    """One replay, numbered from 0: indices of stream and timeline in the plan, and the axes' values in its order."""

    number: int
    recording: int
    firmware: str
    faults: int
    seed: int | None
    values: tuple[float, ...]


def _drawn(sampling: Sampling, axes: int) -> Any:
    """Return shares 0 to less than 1, [points, axes]."""
    if not axes:
        return np.zeros((sampling.points, 0))
    if sampling.method == RANDOM:
        return np.random.default_rng(sampling.seed).random((sampling.points, axes))
    # Imported here: it takes half a second, and most sweeps are grids.
    try:
        from scipy.stats import qmc
    except ModuleNotFoundError as error:
        raise InputError(f"a Latin hypercube is drawn with scipy; install it with: {pip_install('sweep')}") from error

    return qmc.LatinHypercube(axes, rng=sampling.seed).random(sampling.points)


def check_plan(plan: SweepPlan) -> None:
    """Check that points follow from a plan. Raises InputError naming what is wrong."""
    for axis in plan.axes:
        if plan.sampling is None and axis.span is not None:
            low, high = axis.span
            raise InputError(f"--set {axis.name}={low:g}:{high:g}: a grid needs a step; a span is for --sample")
    if plan.sampling is None and not plan.axes and plan.size == 1:
        raise InputError("nothing is changed: --set NAME=START:STOP:STEP, --faults, --seeds or several streams")
    if plan.size > MOST_POINTS:
        raise InputError(f"{plan.size} points; {MOST_POINTS} are the most")


def input_file(path: Path) -> InputFile:
    """Return a file, or the folder of a bag, with the hash of what it holds. Raises InputError if it cannot be read."""
    with file_errors(path):
        return InputFile(str(path.absolute()), _hash_of(path))


def _hash_of(path: Path) -> str:
    digest = hashlib.sha256()
    files = sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]
    for file in files:
        if path.is_dir():
            digest.update(str(file.relative_to(path)).encode() + b"\0")
        with file.open("rb") as content:
            while block := content.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()
