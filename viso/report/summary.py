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

from viso.estimators.series import overlap_s, total_s
from viso.report.facts import STALE_S, Facts, KindFacts, navigates_by_vision
from viso.report.flight_data import Material

_REFUSED: Final = re.compile(r"(PreArm|Arm): VisOdom")
_FEW: Final = 4  # times that are named one by one


class Level(IntEnum):
    """How much something matters."""

    GOOD = 0
    WARNING = 1
    BAD = 2


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that stands out, and how much it matters."""

    level: Level
    text: str


@dataclass(frozen=True, slots=True)
class Summary:
    """What to read first.

    Attributes:
        level: of the worst remark.
        sentence: the flight in one sentence.
        remarks: what stands out, the worst first.
        absent: what the log does not hold, so that the report cannot tell it.
    """

    level: Level
    sentence: str
    remarks: tuple[Remark, ...]
    absent: tuple[str, ...]


def summarise(material: Material, facts: Facts) -> Summary:
    """Return what to read first."""
    remarks = sorted(_remarks(material, facts), key=lambda remark: -remark.level)
    level = max((remark.level for remark in remarks), default=Level.GOOD)
    return Summary(level, _sentence(material, facts, len(remarks)), tuple(remarks), tuple(_absences(material, facts)))


def _sentence(material: Material, facts: Facts, remarks: int) -> str:
    if not facts.measurements:
        return "The log holds no external navigation: no VISP, VISV or VISO record."
    came = " and ".join(_count(kind) for kind in facts.kinds if kind.records)
    ends = (
        "nothing stands out" if not remarks else f"{remarks} thing{'s' * (remarks > 1)} stand{'s' * (remarks == 1)} out"
    )
    return f"External navigation brought {came}; {_outcome(material, facts)}; {ends}."


def _count(kind: KindFacts) -> str:
    names = {"VISP": "poses", "VISV": "velocities", "VISO": "changes of pose"}
    return f"{kind.records} {names[kind.record]} at {kind.rate_hz:.0f} Hz"


def _outcome(material: Material, facts: Facts) -> str:
    if not len(material.xkf4):
        return "what the EKF made of it the log does not tell"
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
        kind = material.parameter("VISO_TYPE")
        off = "" if kind is None else f" VISO_TYPE is {kind:g}" + (", which is off." if kind == 0 else ".")
        yield Remark(Level.WARNING, f"No external navigation reached the autopilot's driver.{off}")
    yield from _of_filter(material, facts)
    yield from _of_arming(material)
    yield from _of_stream(facts)
    yield from _of_resets(facts)


def _of_filter(material: Material, facts: Facts) -> Iterator[Remark]:
    for time_s in facts.failsafes_s:
        yield Remark(Level.BAD, f"EKF failsafe at {time_s:.1f} s.")
    # The flags come at 10 Hz, so that the ends of a stretch are as exact as that.
    without_s = total_s(facts.armed) - overlap_s(facts.armed, facts.positioned)
    if len(material.xkf4) and without_s > STALE_S:
        yield Remark(Level.BAD, f"The EKF was without a horizontal position for {without_s:.1f} s while armed.")
    if facts.measurements and len(material.xkf4) and not facts.positioned and navigates_by_vision(material):
        yield Remark(Level.BAD, "A source set names external navigation, but the EKF never had a position from it.")
    if facts.over_gate:
        armed_s = facts.armed_over_gate_s
        level = Level.BAD if armed_s > 0 else Level.WARNING
        while_armed = f", {armed_s:.1f} s of them armed" if facts.armed else ""
        yield Remark(
            level,
            f"Measurements failed the EKF's gates for {total_s(facts.over_gate):.1f} s{while_armed}: "
            f"a test ratio of up to {facts.worst_ratio:.1f}, first at {facts.over_gate[0][0]:.1f} s.",
        )
    if facts.core_changes:
        yield Remark(Level.WARNING, f"The EKF changed its primary core {_times(facts.core_changes)}.")


def _of_arming(material: Material) -> Iterator[Remark]:
    refused = [one.text for one in material.happenings if one.kind == "text" and _REFUSED.match(one.text)]
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
        armed_too = ", armed" if overlap_s(facts.armed, ending) > 0 else ""
        yield Remark(Level.WARNING, f"Nothing came in the last {end - start:.1f} s of the log{armed_too}.")
    for kind in facts.kinds:
        if kind.withheld:
            yield Remark(
                Level.WARNING,
                f"{kind.withheld} of {kind.records} {kind.record} were withheld from the EKF{_why(kind)}.",
            )
    lag = facts.lag_ms[np.isfinite(facts.lag_ms)]
    if len(lag) and np.median(lag) > 200.0:
        yield Remark(Level.WARNING, f"Measurements were {np.median(lag):.0f} ms old on arrival, by the middle one.")


def _why(kind: KindFacts) -> str:
    reasons = {
        "low quality": kind.low_quality,
        "the second after a reset": kind.after_reset,
        "a reason that the log does not tell": kind.withheld_otherwise,
    }
    return ": " + ", ".join(f"{count} for {reason}" for reason, count in reasons.items() if count)


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
    if not any(one.kind == "text" for one in material.happenings):
        yield "No MSG: what the autopilot said."
    if len(material.cores_shown) and material.unseen_primary_s > 0:
        core = material.cores_shown[0]
        yield (
            f"For {material.unseen_primary_s:.1f} s the autopilot flew with a core whose records the log does not "
            f"have; core {core} is shown."
        )
    if material.left_out:
        yield f"{material.left_out} records have a time that cannot be, and were left out: the log is damaged."
    if facts.parameters.without_default:
        yield f"{facts.parameters.without_default} of {facts.parameters.known} parameters have no known default."
    if math.isnan(facts.worst_ratio) and len(material.xkf4):
        yield "XKF4 holds no test ratios."
