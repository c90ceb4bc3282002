# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter of the vehicle that really flew said of itself, whatever the recording."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import EXTNAV, ROWS, SourceXY, SourceYaw, SourceZ
from ekf_stub.reports import FilterFlag
from viso.doctor.evidence.tracks import Bools, Floats, Ints
from viso.estimators.series import overlap_s, stretches_of

CHANNELS: Final = ("velocity", "position", "height", "yaw")
"""What is tested, in the order of SV, SP, SH and SM."""

VELOCITY, POSITION, HEIGHT, YAW = range(4)
POSITION_LOST: Final = 1 << 0  # of XKF4.TS
VELOCITY_LOST: Final = 1 << 1
HEIGHT_LOST: Final = 1 << 2
NOT_TOLD: Final = -1
_POSITION_FLAGS: Final = int(FilterFlag.HORIZ_POS_REL | FilterFlag.HORIZ_POS_ABS)
_LARGEST_SOURCE: Final = 127
_LONGEST_STEP_US: Final = 1_000_000
_ROW_OF: Final = (ROWS.index("VELXY"), ROWS.index("POSXY"), ROWS.index("POSZ"), ROWS.index("YAW"))
_VELZ: Final = ROWS.index("VELZ")
_PLAIN: Final = {
    "EXTNAV": "ExtNav",
    "GPS": "GPS",
    "GSF": "GSF",
    "BARO": "barometer",
    "OPTFLOW": "optical flow",
    "RANGEFINDER": "range finder",
    "WHEEL_ENCODER": "wheels",
    "GPS_COMPASS_FALLBACK": "GPS or compass",
}
_NAMES: Final[tuple[Mapping[int, str], ...]] = tuple(
    {int(one): _PLAIN.get(one.name, one.name.lower()) for one in kind}
    for kind in (SourceXY, SourceXY, SourceZ, SourceYaw)
)
_SAID: Final = re.compile(r"EKF[23] IMU(\d) (.*)")
_BY_EXTNAV: Final = ("is using external nav", "fusing odometry")
_BY_OTHERS: Final = ("is using ", "stopped aiding", "started relative aiding", "fusing optical flow", "initialised")

Span = tuple[float, float]


class Witness(StrEnum):
    """What a finding rests on.

    LOG: what the vehicle that really flew wrote down itself. TELEMETRY: what it sent meanwhile. STREAM: what the
    companion sent, and what the port and the endpoint, which are exact, do with it. MODEL: what a model of the filter
    makes of it.
    """

    LOG = "log"
    TELEMETRY = "vehicle telemetry"
    STREAM = "stream"
    MODEL = "model"


@dataclass(frozen=True, slots=True)
class OtherCore:
    """A core that the autopilot did not fly with, while a test ratio of its own was above 1."""

    core: int
    over_s: float
    worst: float
    first_us: int


@dataclass(frozen=True, slots=True, eq=False)
class VisionSensor:
    """What N messages of SYS_STATUS say about the vision sensor, at times since boot."""

    time_us: Ints
    present: Bools
    enabled: Bools
    healthy: Bools


@dataclass(frozen=True, slots=True)
class OverOne:
    """How long a test ratio was above 1 while a source fed its channel.

    Attributes:
        channel: index in ``CHANNELS``.
        used_s: for how long the filter could use the source.
        over_s, longest_s: of that time above 1, in all and without a break.
        armed_s: of the time above 1.
        worst, worst_us: the largest ratio, and when.
        first_us, last_us: when it was above 1.
        source: what feeds it, by name.
        innovation: the largest of external navigation meanwhile in m/s, m or deg; None where nothing tells it.
    """

    channel: int
    used_s: float
    over_s: float
    longest_s: float
    armed_s: float
    worst: float
    worst_us: int
    first_us: int
    last_us: int
    source: str
    innovation: float | None

    @property
    def share(self) -> float:
        """The part of the time in use, 0 to 1."""
        return self.over_s / self.used_s if self.used_s > 0 else 1.0


@dataclass(frozen=True, slots=True, eq=False)
class OwnFilter:
    """What the filter of the recorded vehicle said, and the vehicle about it.

    Attributes:
        witness: a log or telemetry.
        record: what tells test ratios and flags, such as XKF4; "" if nothing does.
        time_us: N, us since boot.
        ratios: N x 4, square roots of test ratios by channel, 1 at the gate; NaN where not told.
        flags: N, bits of ``FilterFlag``.
        timeouts: N, bits of XKF4.TS; 0 where not told.
        sources: N x 5, by ``ROWS``, what the active source set names; NOT_TOLD where nobody tells.
        innovation_us, innovations: M and M x 4, their sizes by channel, in m/s, m, m and deg.
        armed: spans in s since boot; None if nobody tells.
        texts: time and text of what the autopilot said.
        failsafes: time and text of each time that the EKF check or failsafe acted.
        lanes: time and core of each change of the primary core.
        others: other cores with a ratio above 1.
        vision: what SYS_STATUS says; None without any, as in logs.
    """

    witness: Witness
    record: str
    time_us: Ints
    ratios: Floats
    flags: Ints
    timeouts: Ints
    sources: Ints
    innovation_us: Ints
    innovations: Floats
    armed: tuple[Span, ...] | None
    texts: tuple[tuple[int, str], ...]
    failsafes: tuple[tuple[int, str], ...]
    lanes: tuple[tuple[int, int], ...] = ()
    others: tuple[OtherCore, ...] = ()
    vision: VisionSensor | None = None

    @property
    def has_ratios(self) -> bool:
        """Whether it tells any test ratio."""
        return bool(np.isfinite(self.ratios).any())

    @property
    def step_s(self) -> Floats:
        """N, for how long each record speaks: until the next, but not over gaps of the recording."""
        if len(self.time_us) < 2:
            return np.zeros(len(self.time_us))
        steps = np.diff(self.time_us)
        longest = max(_LONGEST_STEP_US, 3 * float(np.median(steps)))
        return np.append(np.where(steps > longest, 0, steps), 0) * 1e-6

    @property
    def running(self) -> Bools:
        """N, whether the filter has an attitude; always where no flags are told."""
        return self._has(int(FilterFlag.ATTITUDE)) if self.flags.any() else np.ones(len(self.flags), np.bool_)

    @property
    def positioned(self) -> Bools:
        """N, whether it has a horizontal position of its own, rather than one that it holds."""
        return self._has(_POSITION_FLAGS) & ~self._has(int(FilterFlag.CONST_POS_MODE))

    @property
    def moving(self) -> Bools:
        """N, whether it has a horizontal velocity, with or without a position."""
        return self._has(int(FilterFlag.HORIZ_VEL)) & ~self._has(int(FilterFlag.CONST_POS_MODE))

    def _has(self, flags: int) -> Bools:
        return np.asarray(self.flags & flags != 0, dtype=np.bool_)

    def fed_by_extnav(self, channel: int) -> Bools:
        """N, whether external navigation is to feed a channel."""
        fed = self.sources[:, _ROW_OF[channel]] == EXTNAV
        return np.asarray(fed | (self.sources[:, _VELZ] == EXTNAV) if channel == VELOCITY else fed, dtype=np.bool_)

    def is_told(self, channel: int) -> Bools:
        """N, whether the source of a channel is known."""
        return np.asarray(self.sources[:, _ROW_OF[channel]] != NOT_TOLD, dtype=np.bool_)

    @property
    def wants_extnav(self) -> Bools:
        """N, whether horizontal position or velocity are to come from external navigation."""
        return np.asarray((self.sources[:, [_ROW_OF[VELOCITY], _ROW_OF[POSITION]]] == EXTNAV).any(axis=1), np.bool_)

    @property
    def uses_extnav(self) -> Bools:
        """N, whether it has what external navigation is to give: a position, or a velocity where no more is asked."""
        has = np.where(self.fed_by_extnav(POSITION), self.positioned, self.positioned | self.moving)
        return np.asarray(self.wants_extnav & has, dtype=np.bool_)

    @property
    def usable(self) -> Bools:
        """N x 4, whether the filter could use a measurement of a channel: not while it only holds its position."""
        free = self.running & ~self._has(int(FilterFlag.CONST_POS_MODE))
        return np.column_stack((free, free, self.running, self.running))

    def source(self, channel: int) -> int:
        """Return what feeds a channel at last."""
        return int(self.sources[-1, _ROW_OF[channel]]) if len(self.sources) else NOT_TOLD

    def over_one(self, channel: int, mask: Bools) -> OverOne | None:
        """Return how long a ratio was above 1 in some records in which the filter could use its source."""
        usable = mask & self.usable[:, channel]
        ratio = self.ratios[:, channel]
        over = usable & (ratio > 1.0)
        if not over.any():
            return None
        chosen, step_s = np.flatnonzero(over), self.step_s
        worst = chosen[int(np.argmax(ratio[chosen]))]
        spans = [(self.time_us[i] * 1e-6, self.time_us[i] * 1e-6 + step_s[i]) for i in chosen.tolist()]
        values, counts = np.unique(self.sources[chosen, _ROW_OF[channel]], return_counts=True)
        return OverOne(
            channel,
            float(step_s[usable].sum()),
            float(step_s[over].sum()),
            max(float(step_s[start:end].sum()) for start, end in stretches_of(over)),
            overlap_s(self.armed or (), spans),
            float(ratio[worst]),
            int(self.time_us[worst]),
            int(self.time_us[chosen[0]]),
            int(self.time_us[chosen[-1]]),
            source_name(channel, int(values[np.argmax(counts)])),
            self._innovation(channel, over),
        )

    def _innovation(self, channel: int, over: Bools) -> float | None:
        if not len(self.innovation_us):
            return None
        near = np.maximum(np.searchsorted(self.time_us, self.innovation_us, side="right") - 1, 0)
        sizes = self.innovations[(over & self.fed_by_extnav(channel))[near], channel]
        sizes = sizes[np.isfinite(sizes) & (sizes > 0)]  # none is kept of what is not fused
        return float(sizes.max()) if len(sizes) else None

    def is_fed_by_others(self, channel: int, time_us: Ints) -> Bools:
        """Return at which times a channel is known to be fed by something else than external navigation."""
        return self._at(time_us, self.is_told(channel) & ~self.fed_by_extnav(channel))

    def lost_itself(self, time_us: Ints) -> Bools:
        """Return when it rejected a height of another source: its attitude is no measure then."""
        return self._at(time_us, np.asarray((self.ratios[:, HEIGHT] > 1.0) & ~self.fed_by_extnav(HEIGHT), np.bool_))

    def _at(self, time_us: Ints, mask: Bools) -> Bools:
        """Return what held in the latest record up to each time; nothing before the first."""
        latest = np.searchsorted(self.time_us, time_us, side="right") - 1
        return np.asarray((latest >= 0) & np.append(mask, False)[latest], dtype=np.bool_)

    def lost_spans(self, mask: Bools) -> list[Span]:
        """Return from when to when something held, in s, at records that are told."""
        time_s = self.time_us * 1e-6
        return [(float(time_s[a]), float(time_s[min(b, len(time_s) - 1)])) for a, b in stretches_of(mask)]


def source_name(channel: int, value: int) -> str:
    """Return what feeds a channel by the value of its parameter."""
    return "an unknown source" if value == NOT_TOLD else _NAMES[channel].get(value, f"source {value}")


def innovation_sizes(table: Floats) -> Floats:
    """Return N x 4 sizes by channel, of velocities and positions north, east and down, and yaw in deg."""
    return np.column_stack(
        (
            np.linalg.norm(table[:, :3], axis=1),
            np.linalg.norm(table[:, 3:5], axis=1),
            np.abs(table[:, 5]),
            np.abs(table[:, 6]),
        )
    )


def spans_between(states: Sequence[tuple[int, bool]], start_us: int, end_us: int) -> tuple[Span, ...]:
    """Return from when to when something was on, in s, by what switched it.

    What is switched off first was on when the recording began, as in a log that is written while armed only.
    """
    spans: list[Span] = []
    since = start_us if states and not states[0][1] else None
    for time_us, is_on in states:
        if is_on and since is None:
            since = time_us
        elif not is_on and since is not None:
            spans.append((since * 1e-6, time_us * 1e-6))
            since = None
    return tuple(spans if since is None else [*spans, (since * 1e-6, max(since, end_us) * 1e-6)])


def sources_over(
    time_us: Ints,
    params: Mapping[str, float],
    changes: Iterable[tuple[int, str, float]],
    switches: Iterable[tuple[int, int]],
    said: Sequence[tuple[int, bool]],
) -> Ints:
    """Return N x 5, by ``ROWS``, what the active source set of EKF3 names at some times.

    Args:
        time_us: when.
        params: at boot.
        changes: time, name and value of parameters.
        switches: time and source set, from 0.
        said: time, and whether the filter then began to navigate by external navigation, or by something else: it
            tells the source of the position where no parameter does.
    """
    events: list[tuple[int, str, float]] = [*changes, *((at, "set", float(number)) for at, number in switches)]
    events += [(at, "said", EXTNAV if by_extnav else NOT_TOLD) for at, by_extnav in said]
    now = {**params, "set": 0.0, "said": float(NOT_TOLD)}
    found, start = np.full((len(time_us), len(ROWS)), NOT_TOLD, dtype=np.int64), 0
    for at, name, value in [*sorted(events), (np.iinfo(np.int64).max, "", 0.0)]:
        end = int(np.searchsorted(time_us, at, side="left"))
        row = [now.get(f"EK3_SRC{int(now['set']) + 1}_{what}", float(NOT_TOLD)) for what in ROWS]
        if row[0] == NOT_TOLD:
            row[0] = now["said"]
        found[start:end] = [value if 0 <= value <= _LARGEST_SOURCE else NOT_TOLD for value in row]
        start = max(start, end)
        now[name] = value
    return found


def said_by_filter(texts: Iterable[tuple[int, str]]) -> Iterator[tuple[int, bool, str]]:
    """Yield when the filter said that it navigates by external navigation, or by something else, and the sentence.

    Of several cores that say the same, one is heard.
    """
    heard: str | None = None
    for time_us, text in texts:
        match = _SAID.match(text)
        if match is None or heard not in (None, match[1]):
            continue
        by_extnav = match[2].startswith(_BY_EXTNAV)
        if by_extnav or match[2].startswith(_BY_OTHERS):
            heard = match[1]
            yield time_us, by_extnav, match[2]
