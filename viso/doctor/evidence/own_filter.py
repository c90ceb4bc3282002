# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the recorded vehicle's own filter reported, in a log or in telemetry."""

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
"""The tested measurements, in the order of SV, SP, SH and SM."""

VELOCITY, POSITION, HEIGHT, YAW = range(4)
POSITION_LOST: Final = 1 << 0  # of XKF4.TS
VELOCITY_LOST: Final = 1 << 1
HEIGHT_LOST: Final = 1 << 2
NOT_KNOWN: Final = -1
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
    {int(member): _PLAIN.get(member.name, member.name.lower()) for member in kind}
    for kind in (SourceXY, SourceXY, SourceZ, SourceYaw)
)
_OF_A_CORE: Final = re.compile(r"EKF[23] IMU(\d) (.*)")
_ORIGIN: Final = re.compile(r"origin set|Field Elevation Set")
_BY_EXTNAV: Final = ("is using external nav", "fusing odometry")
_BY_OTHERS: Final = ("is using ", "stopped aiding", "started relative aiding", "fusing optical flow", "initialised")

Span = tuple[float, float]


class Witness(StrEnum):
    """What a finding rests on.

    LOG: the log of the vehicle that really flew. TELEMETRY: what it sent meanwhile. STREAM: what the companion sent,
    and what port and endpoint, which are exact, do with it. MODEL: what a model of the filter does with it.
    """

    LOG = "log"
    TELEMETRY = "vehicle telemetry"
    STREAM = "stream"
    MODEL = "model"


@dataclass(frozen=True, slots=True)
class OtherCore:
    """A core that was not the primary one, while one of its test ratios was above 1 and none of the primary's was."""

    core: int
    over_s: float
    worst: float
    first_us: int


@dataclass(frozen=True, slots=True, eq=False)
class VisionSensor:
    """The vision sensor in N messages of SYS_STATUS, at times since boot."""

    time_us: Ints
    present: Bools
    enabled: Bools
    healthy: Bools


@dataclass(frozen=True, slots=True)
class OverOne:
    """How long a test ratio was above 1 while a source was in use.

    Attributes:
        channel: index in ``CHANNELS``.
        used_s: for how long the filter could use the source.
        over_s, longest_s: of that time above 1, in all and without a break.
        armed_s: of the time above 1.
        worst, worst_us: the largest ratio, and when.
        first_us, last_us: when it was above 1.
        source: the source of the channel, by name.
        innovation: the largest of external navigation meanwhile in m/s, m or deg; None if it is not known.
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
    """What the recorded vehicle's own filter reported, and what the vehicle reported about it.

    Attributes:
        witness: a log or telemetry.
        record: of test ratios and flags, such as XKF4; "" if there is none.
        time_us: N, us since boot.
        ratios: N x 4, square roots of test ratios by channel, 1 at the gate; NaN where they are not known.
        flags: N, bits of ``FilterFlag``.
        timeouts: N, bits of XKF4.TS; 0 where they are not known.
        sources: N x 5, by ``ROWS``, the active source set's; NOT_KNOWN where that is not known.
        innovation_us, innovations: M and M x 4, their sizes by channel, in m/s, m, m and deg.
        armed: spans in s since boot; None if they are not known.
        texts: the autopilot's, with their times in us since boot.
        failsafes: time and text of each time that the EKF check or failsafe acted.
        lanes: time and core of each change of the primary core.
        others: other cores with a ratio above 1.
        vision: the sensor in SYS_STATUS; None without any, as in logs.
        has_origin: whether the EKF got an origin; None if that is not known.
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
    has_origin: bool | None = None

    @property
    def has_ratios(self) -> bool:
        """Whether any test ratio is known."""
        return bool(np.isfinite(self.ratios).any())

    @property
    def step_s(self) -> Floats:
        """N, for how long each record holds: until the next one, but not over gaps of the recording."""
        if len(self.time_us) < 2:
            return np.zeros(len(self.time_us))
        steps = np.diff(self.time_us)
        longest = max(_LONGEST_STEP_US, 3 * float(np.median(steps)))
        return np.append(np.where(steps > longest, 0, steps), 0) * 1e-6

    @property
    def running(self) -> Bools:
        """N, whether the filter has an attitude; always if no flags are known."""
        return self._has(int(FilterFlag.ATTITUDE)) if self.flags.any() else np.ones(len(self.flags), np.bool_)

    @property
    def positioned(self) -> Bools:
        """N, whether it has a horizontal position, other than one that it holds (constant position mode)."""
        return self._has(_POSITION_FLAGS) & ~self._has(int(FilterFlag.CONST_POS_MODE))

    @property
    def moving(self) -> Bools:
        """N, whether it has a horizontal velocity, with or without a position."""
        return self._has(int(FilterFlag.HORIZ_VEL)) & ~self._has(int(FilterFlag.CONST_POS_MODE))

    def _has(self, flags: int) -> Bools:
        return np.asarray(self.flags & flags != 0, dtype=np.bool_)

    def fed_by_extnav(self, channel: int) -> Bools:
        """N, whether external navigation is the source of a channel."""
        fed = self.sources[:, _ROW_OF[channel]] == EXTNAV
        return np.asarray(fed | (self.sources[:, _VELZ] == EXTNAV) if channel == VELOCITY else fed, dtype=np.bool_)

    def is_source_known(self, channel: int) -> Bools:
        """N, whether the source of a channel is known."""
        return np.asarray(self.sources[:, _ROW_OF[channel]] != NOT_KNOWN, dtype=np.bool_)

    @property
    def wants_extnav(self) -> Bools:
        """N, whether external navigation is the source of horizontal position or velocity."""
        return np.asarray((self.sources[:, [_ROW_OF[VELOCITY], _ROW_OF[POSITION]]] == EXTNAV).any(axis=1), np.bool_)

    @property
    def uses_extnav(self) -> Bools:
        """N, whether it has what external navigation is the source of: a position, or else a velocity."""
        has = np.where(self.fed_by_extnav(POSITION), self.positioned, self.positioned | self.moving)
        return np.asarray(self.wants_extnav & has, dtype=np.bool_)

    @property
    def positioned_by_extnav(self) -> Bools:
        """N, whether it has an absolute position that no other source than external navigation can have given."""
        velocity = self.sources[:, _ROW_OF[VELOCITY]]
        alone = self.fed_by_extnav(POSITION) & ((velocity == EXTNAV) | (velocity == SourceXY.NONE))
        return np.asarray(alone & self.positioned & self._has(int(FilterFlag.HORIZ_POS_ABS)), dtype=np.bool_)

    @property
    def usable(self) -> Bools:
        """N x 4, whether the filter could use a measurement of a channel; not in constant position mode."""
        free = self.running & ~self._has(int(FilterFlag.CONST_POS_MODE))
        return np.column_stack((free, free, self.running, self.running))

    def source(self, channel: int) -> int:
        """Return the last known source of a channel."""
        return int(self.sources[-1, _ROW_OF[channel]]) if len(self.sources) else NOT_KNOWN

    def over_one(self, channel: int, mask: Bools) -> OverOne | None:
        """Return how long a ratio was above 1 in the masked records with a usable source; None if it never was."""
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
        """Return at which times a channel is known to have another source than external navigation."""
        return self._at(time_us, self.is_source_known(channel) & ~self.fed_by_extnav(channel))

    def was_armed(self, time_us: int) -> bool:
        """Return whether the vehicle is known to have been armed at a time."""
        return any(start_s <= time_us * 1e-6 <= end_s for start_s, end_s in self.armed or ())

    def lost_itself(self, time_us: Ints) -> Bools:
        """Return at which times it rejected a height of another source: its attitude is no measure then."""
        return self._at(time_us, np.asarray((self.ratios[:, HEIGHT] > 1.0) & ~self.fed_by_extnav(HEIGHT), np.bool_))

    def _at(self, time_us: Ints, mask: Bools) -> Bools:
        """Return a mask's value in the latest record up to each time; False before the first."""
        latest = np.searchsorted(self.time_us, time_us, side="right") - 1
        return np.asarray((latest >= 0) & np.append(mask, False)[latest], dtype=np.bool_)

    def lost_spans(self, mask: Bools) -> list[Span]:
        """Return the spans of a mask over the records, in s."""
        time_s = self.time_us * 1e-6
        return [(float(time_s[a]), float(time_s[min(b, len(time_s) - 1)])) for a, b in stretches_of(mask)]


def says_origin(texts: Iterable[tuple[int, str]]) -> bool:
    """Return whether a text reports that an origin was set."""
    return any(_ORIGIN.search(text) is not None for _, text in texts)


def source_name(channel: int, value: int) -> str:
    """Return the name of a channel's source, from the value of its parameter."""
    return "an unknown source" if value == NOT_KNOWN else _NAMES[channel].get(value, f"source {value}")


def innovation_sizes(table: Floats) -> Floats:
    """Return N x 4 sizes by channel, from innovations of velocity and position north, east and down, and yaw in deg."""
    return np.column_stack(
        (
            np.linalg.norm(table[:, :3], axis=1),
            np.linalg.norm(table[:, 3:5], axis=1),
            np.abs(table[:, 5]),
            np.abs(table[:, 6]),
        )
    )


def spans_between(states: Sequence[tuple[int, bool]], start_us: int, end_us: int) -> tuple[Span, ...]:
    """Return the spans in s in which something was on, from its switching.

    If it is switched off first, it was on when the recording began, as in a log that is written while armed only.
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
    reported: Sequence[tuple[int, bool]],
) -> Ints:
    """Return N x 5, by ``ROWS``, the sources of EKF3's active source set at some times.

    Args:
        time_us: when.
        params: at boot.
        changes: time, name and value of parameters.
        switches: time and source set, from 0.
        reported: time, and whether the filter then began to navigate by external navigation, or by another source:
            the source of the position if no parameter names it.
    """
    events: list[tuple[int, str, float]] = [*changes, *((at, "set", float(number)) for at, number in switches)]
    events += [(at, "reported", EXTNAV if by_extnav else NOT_KNOWN) for at, by_extnav in reported]
    now = {**params, "set": 0.0, "reported": float(NOT_KNOWN)}
    found, start = np.full((len(time_us), len(ROWS)), NOT_KNOWN, dtype=np.int64), 0
    for at, name, value in [*sorted(events), (np.iinfo(np.int64).max, "", 0.0)]:
        end = int(np.searchsorted(time_us, at, side="left"))
        row = [now.get(f"EK3_SRC{int(now['set']) + 1}_{what}", float(NOT_KNOWN)) for what in ROWS]
        if row[0] == NOT_KNOWN:
            row[0] = now["reported"]
        found[start:end] = [value if 0 <= value <= _LARGEST_SOURCE else NOT_KNOWN for value in row]
        start = max(start, end)
        now[name] = value
    return found


def aiding_texts(texts: Iterable[tuple[int, str]]) -> Iterator[tuple[int, bool, str]]:
    """Yield when the filter reported navigation by external navigation, or by another source, and the text.

    Of several cores the first one counts.
    """
    heard: str | None = None
    for time_us, text in texts:
        match = _OF_A_CORE.match(text)
        if match is None or heard not in (None, match[1]):
            continue
        by_extnav = match[2].startswith(_BY_EXTNAV)
        if by_extnav or match[2].startswith(_BY_OTHERS):
            heard = match[1]
            yield time_us, by_extnav, match[2]
