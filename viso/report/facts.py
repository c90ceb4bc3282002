# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of a report: what came, how regularly, what was withheld, and what the EKF did with it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from viso.doctor.checks import all_checks
from viso.doctor.checks.check import Finding, diagnose
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.gathering import gather
from viso.doctor.evidence.own_filter import POSITION, OwnFilter, Witness
from viso.estimators.series import Array, Mask, Series, spans_of
from viso.firmware.flown import JudgedBy, profile_for
from viso.firmware.releases import Firmware
from viso.logs.event_names import EV_ALT_RESET, EV_YAW_RESET
from viso.report.agreement import VisionLessEkf, lag_ms, vision_less_ekf
from viso.report.flight_data import Material, position_moves
from viso.report.parameters import ParameterFacts, parameter_facts

UNHEALTHY_S: Final = 0.3
"""Without a message for longer, the driver is not healthy (AP_VisualOdom_Backend.cpp, healthy)."""

STALE_S: Final = 0.5
"""Without a position for longer, the EKF does not take its height from vision (AP_NavEKF3_PosVelFusion.cpp)."""

RESET_IGNORE_S: Final = 1.0
"""After a reset, T265 and VOXL withhold for so long (AP_VisualOdom_IntelT265.cpp, should_consume_sensor_data)."""

_KINDS: Final = (
    ("VISP", "position and attitude", "REPH"),
    ("VISV", "velocity", "REVH"),
    ("VISO", "change of position and attitude", "RBOH"),
)


@dataclass(frozen=True, slots=True)
class KindFacts:
    """Outcome of one kind of measurement, as far as the log shows.

    Attributes:
        withheld_for: how many were withheld from the EKF, by each reason of ``withheld_why``.
        given: how many went to the EKF by the replay records; None if the log has no such records.
        rate_hz: how many a second, counted over time; 0 for fewer than two.
    """

    record: str
    content: str
    records: int
    withheld_for: Mapping[str, int]
    given: int | None
    rate_hz: float

    @property
    def withheld(self) -> int:
        """How many were withheld."""
        return sum(self.withheld_for.values())


@dataclass(frozen=True, slots=True)
class Reset:
    """Something restarted, by "vision" or "EKF", where the log first shows it."""

    time_s: float
    what: str
    by: str


@dataclass(frozen=True, slots=True)
class Facts:
    """The contents of a report.

    Attributes:
        start_s, end_s: the time over which the log has vision, the EKF or texts.
        kinds: the outcome of each kind of measurement.
        arrivals_s: the times at which measurements of any kind were logged, each once.
        gaps: from when to when nothing came for longer than UNHEALTHY_S.
        lag_ms: the lags behind CTimeMS, of poses, or of velocities without any.
        resets: of vision and of the EKF.
        armed: from when to when.
        positioned: from when to when the EKF had a horizontal position.
        moving: from when to when it had a horizontal velocity, with or without a position.
        over_gate: from when to when a test ratio of velocity, position, height or yaw was over 1.
        worst_ratio: the largest of these square roots of test ratios; NaN if the log has none.
        differences: vision less EKF.
        own: what the vehicle's own filter reported.
        findings: what the doctor finds without a trial, so that no model has a say.
        parameters: that differ from defaults.
        judged_by: the release whose defaults those are.
    """

    start_s: float
    end_s: float
    kinds: tuple[KindFacts, ...]
    arrivals_s: Array
    gaps: tuple[tuple[float, float], ...]
    lag_ms: Array
    resets: tuple[Reset, ...]
    armed: tuple[tuple[float, float], ...]
    positioned: tuple[tuple[float, float], ...]
    moving: tuple[tuple[float, float], ...]
    over_gate: tuple[tuple[float, float], ...]
    worst_ratio: float
    differences: VisionLessEkf
    own: OwnFilter
    findings: tuple[Finding, ...]
    parameters: ParameterFacts
    judged_by: JudgedBy

    @property
    def measurements(self) -> int:
        """How many records of external navigation there are."""
        return sum(kind.records for kind in self.kinds)

    @property
    def withheld(self) -> int:
        """How many of them were withheld from the EKF."""
        return sum(kind.withheld for kind in self.kinds)


def facts_of(material: Material, given: Firmware | None = None) -> Facts:
    """Return what a report says about a log; ``given`` is the release to judge it by, if the user asks for one."""
    judged_by = profile_for(material.flown, {parameter.name for parameter in material.parameters}, given)
    times = [series.time_s for series in (*material.vision, material.xkf1, material.xkf4) if len(series)]
    spoken = np.array([happening.time_s for happening in material.happenings])
    every_s = np.concatenate([*times, spoken]) if times or len(spoken) else np.zeros(1)
    start_s, end_s = float(every_s.min()), float(every_s.max())
    arrivals_s = np.unique(np.concatenate([series.time_s for series in material.vision]))
    steps_s = np.diff(arrivals_s)
    gaps = [(float(arrivals_s[i]), float(arrivals_s[i + 1])) for i in np.flatnonzero(steps_s > UNHEALTHY_S)]
    if len(arrivals_s) and end_s - arrivals_s[-1] > UNHEALTHY_S:
        gaps.append((float(arrivals_s[-1]), end_s))
    status_s = material.xkf4.time_s
    evidence = gather(material.stream, vehicle=material.vehicle, firmware=judged_by.firmware, is_tried=False)
    own = evidence.vehicle.own_filter
    assert own is not None
    return Facts(
        start_s=start_s,
        end_s=end_s,
        kinds=tuple(
            _kind_facts(material, series, *names) for series, names in zip(material.vision, _KINDS, strict=True)
        ),
        arrivals_s=arrivals_s,
        gaps=tuple(gaps),
        lag_ms=lag_ms(material.stamped),
        resets=tuple(sorted(_resets(material, own), key=lambda reset: reset.time_s)),
        armed=own.armed or (),
        positioned=tuple(spans_of(status_s, own.positioned)),
        moving=tuple(spans_of(status_s, own.moving)),
        over_gate=tuple(spans_of(status_s, np.asarray((own.ratios > 1.0).any(axis=1)))),
        worst_ratio=float(np.nanmax(own.ratios)) if own.has_ratios else float("nan"),
        differences=vision_less_ekf(material),
        own=own,
        findings=tuple(_findings(evidence)),
        parameters=parameter_facts(material, judged_by.firmware),
        judged_by=judged_by,
    )


def _findings(evidence: Evidence) -> list[Finding]:
    """Return what the doctor finds, but nothing of a model, and nothing of parameters that the log does not have."""
    checks = [check for check in all_checks() if check.witness is not Witness.MODEL]
    return diagnose(evidence, [check for check in checks if not (evidence.set_up.assumed and check.family == "XN7")])


def positioned_at(own: OwnFilter, at_s: Array) -> Mask:
    """Return at which times the EKF said that it has a position; at all of them if the log does not show it."""
    if not len(own.time_us):
        return np.ones(len(at_s), dtype=np.bool_)
    latest = np.maximum(np.searchsorted(own.time_us * 1e-6, at_s, side="right") - 1, 0)
    return np.asarray(own.positioned[latest], dtype=np.bool_)


def withheld_why(material: Material, series: Series) -> dict[str, Mask]:
    """Return which records of vision were withheld from the EKF: for their quality, after a reset, or otherwise."""
    withheld = series["Ign"] > 0
    least = material.parameter("VISO_QUAL_MIN") or 0.0
    low = withheld & (series["Q"] < least)
    changed_s = _counter_changes(series)[0]
    latest = np.searchsorted(changed_s, series.time_s, side="right") - 1
    since_s = series.time_s - np.where(latest >= 0, np.append(changed_s, 0.0)[latest], -np.inf)
    after_reset = withheld & ~low & (since_s <= RESET_IGNORE_S)
    return {
        "low quality": low,
        "the second after a reset": after_reset,
        "a reason that the log does not show": withheld & ~low & ~after_reset,
    }


def _kind_facts(material: Material, series: Series, record: str, content: str, replay: str) -> KindFacts:
    lasts_s = float(np.ptp(series.time_s)) if len(series) else 0.0
    return KindFacts(
        record,
        content,
        records=len(series),
        withheld_for={why: int(mask.sum()) for why, mask in withheld_why(material, series).items()},
        given=material.counts.get(replay),
        rate_hz=(len(series) - 1) / lasts_s if lasts_s > 0 else 0.0,
    )


def _counter_changes(series: Series) -> tuple[Array, Array, Array]:
    """Return when the reset counter changed, from what and to what."""
    counter = series["Rst"]
    at = np.flatnonzero(np.diff(counter, prepend=counter[:1]) != 0) if series.has("Rst") else np.zeros(0, np.intp)
    return series.time_s[at], counter[at - 1], counter[at]


def _concerns_extnav(own: OwnFilter, time_s: float) -> bool:
    """Return whether the EKF used external navigation just before or after a time, or might have."""
    at = int(np.searchsorted(own.time_us, round(time_s * 1e6)))
    near = slice(max(at - 1, 0), at + 2)
    return bool(own.uses_extnav[near].any() or not own.is_source_known(POSITION)[near].all())


def _resets(material: Material, own: OwnFilter) -> Sequence[Reset]:
    found = [
        Reset(float(time_s), f"reset counter {before:.0f} to {after:.0f}", "vision")
        for time_s, before, after in zip(*_counter_changes(material.stamped), strict=True)
    ]
    for time_s, (north_m, east_m) in zip(*position_moves(material.xkf4), strict=True):
        if not _concerns_extnav(own, float(time_s)):
            continue
        found.append(Reset(float(time_s), f"position moved by {north_m:+.2f} m north, {east_m:+.2f} m east", "EKF"))
    events = {EV_YAW_RESET: "yaw", EV_ALT_RESET: "height"}
    found += [
        Reset(happening.time_s, f"{events[happening.number]} reset", "EKF")
        for happening in material.happenings
        if happening.kind == "event" and happening.number in events
    ]
    return found
