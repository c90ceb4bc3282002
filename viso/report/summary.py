# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flight in one sentence, and what stands out of it."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.check import Finding, Severity
from viso.doctor.checks.recorded import OWN_CODES, POSITION_CODES, RATIO_CODES
from viso.doctor.evidence.own_filter import POSITION
from viso.estimators.series import overlap_s, total_s
from viso.report.facts import STALE_S, Facts, KindFacts
from viso.report.flight_data import Material

_REFUSED: Final = re.compile(r"(PreArm|Arm): VisOdom")
_SAID_HERE: Final = {"XN1-01", "XN4-05"}  # in other words
_FEW: Final = 4  # times that are named one by one


class Level(IntEnum):
    """How much something matters; UNJUDGED is a flight of which nothing in the log can say whether it went well."""

    GOOD = 0
    UNJUDGED = 1
    WARNING = 2
    BAD = 3

    @property
    def badge(self) -> str:
        """The verdict in a word."""
        return ("fine", "no verdict", "look", "trouble")[self]


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that stands out, and how much it matters."""

    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Summary:
    """What to read first: the flight in a sentence, the level of the worst remark, remarks, and what the log lacks."""

    level: Level
    sentence: str
    remarks: tuple[Remark, ...]
    absent: tuple[str, ...]


def summarise(material: Material, facts: Facts) -> Summary:
    """Return what to read first."""
    remarks = sorted(_remarks(material, facts), key=lambda remark: -remark.level)
    level = max((remark.level for remark in remarks), default=Level.GOOD)
    return Summary(level, _sentence(material, facts, remarks), tuple(remarks), tuple(_absences(material, facts)))


def _sentence(material: Material, facts: Facts, remarks: list[Remark]) -> str:
    if not facts.measurements:
        return "The log holds no external navigation: no VISP, VISV or VISO record."
    came = " and ".join(_count(kind) for kind in facts.kinds if kind.records)
    outstanding = sum(remark.level > Level.UNJUDGED for remark in remarks)
    ends = "nothing stands out" if not remarks else "nothing in the log can judge it"
    if outstanding:
        ends = f"{outstanding} thing{'s' * (outstanding > 1)} stand{'s' * (outstanding == 1)} out"
    return f"External navigation brought {came}; {_outcome(material, facts)}; {ends}."


def _count(kind: KindFacts) -> str:
    names = {"VISP": "poses", "VISV": "velocities", "VISO": "changes of pose"}
    return f"{kind.records} {names[kind.record]} at {kind.rate_hz:.0f} Hz"


def _outcome(material: Material, facts: Facts) -> str:
    if not len(material.xkf4):
        return "the log does not show what the EKF made of it"
    if not facts.positioned:
        velocity = f", but a velocity for {total_s(facts.moving):.1f} s" if facts.moving else ""
        return f"the EKF never had a horizontal position{velocity}"
    if facts.armed:
        armed_s = total_s(facts.armed)
        return f"the EKF had a position for {overlap_s(facts.armed, facts.positioned):.1f} of {armed_s:.1f} s armed"
    since_s, lasting_s = facts.positioned[0][0], total_s(facts.positioned)
    return f"the EKF had a position for {lasting_s:.1f} s, from {since_s:.1f} s on, disarmed"


def _remarks(material: Material, facts: Facts) -> Iterator[Remark]:
    if not facts.measurements:
        yield _without_measurements(material, facts)
    yield from _of_filter(material, facts)
    yield from _of_arming(material)
    yield from _of_stream(facts)
    yield from _of_resets(facts)


def _without_measurements(material: Material, facts: Facts) -> Remark:
    for finding in facts.findings:
        if finding.code == "XN1-01" and finding.severity is Severity.NOTE:
            return Remark(Level.UNJUDGED, _as_remark(finding))
    kind = material.parameter("VISO_TYPE")
    off = "" if kind is None else f" VISO_TYPE is {kind:g}" + (", which is off." if kind == 0 else ".")
    wanted = bool(kind) or bool(facts.own.wants_extnav.any())
    level = Level.BAD if wanted else Level.UNJUDGED
    return Remark(level, f"No external navigation reached the autopilot's driver.{off}")


def _of_filter(material: Material, facts: Facts) -> Iterator[Remark]:
    """Yield what the vehicle's own filter reported, and errors that the doctor finds, in the doctor's words."""
    own_findings = [finding for finding in facts.findings if finding.code in OWN_CODES]
    for own_finding in own_findings:
        yield Remark(Level.BAD if own_finding.severity is Severity.ERROR else Level.WARNING, _as_remark(own_finding))
    for finding in facts.findings:
        if finding.severity is Severity.ERROR and finding.code not in OWN_CODES | _SAID_HERE:
            yield Remark(Level.BAD, _as_remark(finding))
    codes = {own_finding.code for own_finding in own_findings}
    if facts.over_gate and codes.isdisjoint(RATIO_CODES):
        yield Remark(
            Level.WARNING,
            f"A test ratio was over 1 for {total_s(facts.over_gate):.1f} s, of up to {facts.worst_ratio:.1f}, first at "
            f"{facts.over_gate[0][0]:.1f} s, while the filter could not use what it tested.",
        )
    # The flags come at 10 Hz, so that the ends of a stretch are as exact as that.
    without_s = total_s(facts.armed) - overlap_s(facts.armed, facts.positioned)
    if facts.measurements and len(material.xkf4) and without_s > STALE_S and codes.isdisjoint(POSITION_CODES):
        yield Remark(Level.BAD, f"The EKF was without a horizontal position for {without_s:.1f} s while armed.")
    if facts.measurements and "XN9-15" not in codes and (reason := _unjudged(facts)):
        yield Remark(Level.UNJUDGED, reason)


def _as_remark(finding: Finding) -> str:
    evidence = finding.evidence[:1].upper() + finding.evidence[1:]
    return f"{evidence} ({finding.code}, witness: {finding.witness.value})."


def _unjudged(facts: Facts) -> str:
    """Return why nothing in the log can say whether the filter agreed with vision; nothing if something can."""
    own = facts.own
    if not own.record:
        return "The log has no XKF4: what the EKF made of it is not known. That is no sign that it went well."
    if not own.has_ratios:
        return "The log has no test ratios: whether the EKF agreed is not known."
    if not own.uses_extnav.any():
        if not own.is_source_known(POSITION).any():
            return "The log does not show what the EKF navigated by: its test ratios may be of other sensors."
        return "The EKF did not navigate by external navigation, so its test ratios say nothing about it."
    return ""


def _of_arming(material: Material) -> Iterator[Remark]:
    refused = [
        happening.text
        for happening in material.happenings
        if happening.kind == "text" and _REFUSED.match(happening.text)
    ]
    if refused:
        yield Remark(Level.WARNING, f'Arming was refused for vision {_times(len(refused))}, at last "{refused[-1]}".')


def _of_stream(facts: Facts) -> Iterator[Remark]:
    ending = [gap for gap in facts.gaps if gap[1] == facts.end_s]
    between = [gap for gap in facts.gaps if gap not in ending]
    if between:
        longest = max(between, key=lambda gap: gap[1] - gap[0])
        length_s = longest[1] - longest[0]
        armed = overlap_s(facts.armed, between) > 0
        yield Remark(
            Level.BAD if armed and length_s > STALE_S else Level.WARNING,
            f"Nothing came for more than 300 ms {_times(len(between))}, "
            f"for {length_s:.1f} s at worst, from {longest[0]:.1f} s on.",
        )
    for start, end in ending:
        armed_s = overlap_s(facts.armed, ending)
        state = (
            f", armed for {armed_s:.1f} s of that" if armed_s > 0 else "" if facts.own.armed is None else ", disarmed"
        )
        level = Level.BAD if armed_s * 1e6 > limits.END_TOGETHER_US else Level.WARNING
        yield Remark(level, f"Nothing came in the last {end - start:.1f} s of the log{state}.")
    for kind in facts.kinds:
        if kind.withheld:
            why = ", ".join(f"{count} for {reason}" for reason, count in kind.withheld_for.items() if count)
            text = f"{kind.withheld} of {kind.records} {kind.record} were withheld from the EKF: {why}."
            yield Remark(Level.WARNING, text)
    lag = facts.lag_ms[np.isfinite(facts.lag_ms)]
    if len(lag) and np.median(lag) > 200.0:
        text = f"Measurements counted as {np.median(lag):.0f} ms old on arrival, by the middle one."
        yield Remark(Level.WARNING, text)


def _of_resets(facts: Facts) -> Iterator[Remark]:
    of_vision = [reset.time_s for reset in facts.resets if reset.by == "vision"]
    if of_vision:
        yield Remark(Level.WARNING, f"The reset counter of vision changed {_times(len(of_vision))}{_at(of_vision)}.")
    moved = [reset for reset in facts.resets if reset.by == "EKF" and reset.what.startswith("position")]
    late = [reset.time_s for reset in moved if any(start <= reset.time_s <= end for start, end in facts.armed)]
    if late:
        yield Remark(Level.WARNING, f"The EKF moved its position {_times(len(late))} while armed{_at(late)}.")


def _times(number: int) -> str:
    return {1: "once", 2: "twice"}.get(number, f"{number} times")


def _at(times_s: list[float]) -> str:
    named = ", ".join(f"{time_s:.1f} s" for time_s in times_s[:_FEW])
    return f": at {named}" + (" ..." if len(times_s) > _FEW else "")


def _absences(material: Material, facts: Facts) -> Iterator[str]:
    yield (
        "What never came into the log is not here: messages that the autopilot dropped (wrong frames, damaged, not "
        "meant for it) leave no record, and the EKF does not log which samples it fused."
    )
    for series, record, content in (
        (material.visp, "VISP", "position and attitude of vision"),
        (material.visv, "VISV", "velocity of vision"),
        (material.xkf1, "XKF1", "the EKF's estimates"),
        (material.xkf3, "XKF3", "its innovations"),
        (material.xkf4, "XKF4", "its test ratios and status"),
    ):
        if not len(series):
            yield f"No {record}: {content}."
    if len(material.visp) and not material.visp.has("Q"):
        yield "VISP without Q, as older firmware writes it: no quality."
    if len(material.visp) and not material.visp.has("Ign"):
        yield "VISP without Ign, as older firmware writes it: what was withheld is unknown."
    if not material.parameters:
        yield "No PARM: parameters are unknown; VISO_DELAY_MS is taken to be 10."
    if not any(happening.kind == "text" for happening in material.happenings):
        yield "No MSG: what the autopilot said."
    if len(material.cores_shown) and material.unseen_primary_s > 0:
        core = material.cores_shown[0]
        yield (
            f"For {material.unseen_primary_s:.1f} s the autopilot flew with a core whose records the log does not "
            f"have; core {core} is shown."
        )
    for note in material.lost:
        yield f"{note[:1].upper()}{note[1:]}."
    if material.left_out:
        yield f"{material.left_out} records have a time that cannot be, and were left out: the log is damaged."
    if facts.parameters.without_default:
        yield f"{facts.parameters.without_default} of {facts.parameters.known} parameters have no known default."
    if math.isnan(facts.worst_ratio) and len(material.xkf4):
        yield "XKF4 holds no test ratios."
