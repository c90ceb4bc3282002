# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the doctor can check, what a check has found, and the run of checks on the evidence."""

from collections.abc import Callable, Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from viso.doctor.evidence.own_filter import Witness
from viso.streams.stream_kinds import Aspect

if TYPE_CHECKING:
    from viso.doctor.evidence.evidence import Evidence
    from viso.doctor.evidence.motion import Motion
    from viso.doctor.evidence.tracks import HandledMessage, Track

NUMBERS_SHOWN: Final = 5
_MOST_NAMED: Final = 3
_BEFORE_SOURCES: Final = (
    " This release has no EK3_SRC parameters: there EK2_GPS_TYPE 3 keeps GPS out, so that positions come from external "
    "navigation, EK2_ALT_SOURCE 4 takes its height, and COMPASS_USE 0 its yaw; or fly 4.1 or later."
)
_WITHOUT_VISUAL_ODOMETRY: Final = (
    " This build has no visual odometry, and so no VISO_ parameters: flash one that has it first."
)

Find = Callable[["Evidence"], Iterable["Sighting"]]


class Severity(StrEnum):
    """How bad a finding is.

    ERROR: external navigation cannot work, or its data are wrong. WARNING: it works worse than it could, or only at
    times. NOTE: good to know.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"

    @property
    def rank(self) -> int:
        """0 is the worst."""
        return list(Severity).index(self)

    def at_least(self, other: "Severity") -> bool:
        """Return whether it is as bad as another, or worse."""
        return self.rank <= other.rank


@dataclass(frozen=True, slots=True)
class Sighting:
    """What a check has found in the evidence.

    Attributes:
        text: what it is, in a sentence without its full stop.
        numbers: of all messages that show it, from 1.
        start_us, end_us: the time that it covers, us since the autopilot's boot; None where time says nothing.
        fix: what to do in this very case, in place of the check's general advice.
        severity: if it is less than the check's.
    """

    text: str
    numbers: Sequence[int] = ()
    start_us: int | None = None
    end_us: int | None = None
    fix: str | None = None
    severity: Severity | None = None

    @classmethod
    def in_messages(
        cls, text: str, messages: Sequence["HandledMessage"], fix: str | None = None, severity: Severity | None = None
    ) -> "Sighting":
        """Return what some messages show, one at least, in the order of their arrival."""
        numbers = [message.number for message in messages]
        return cls(text, numbers, messages[0].arrival_us, messages[-1].arrival_us, fix, severity)

    @classmethod
    def in_track(
        cls,
        text: str,
        track: "Track | Motion",
        chosen: Any = slice(None),
        fix: str | None = None,
        severity: Severity | None = None,
    ) -> "Sighting":
        """Return what messages of a track show, one at least; they are chosen by a mask, a slice or indices."""
        arrivals = track.arrival_us[chosen]
        return cls(text, track.numbers[chosen].tolist(), int(arrivals[0]), int(arrivals[-1]), fix, severity)


@dataclass(frozen=True, slots=True)
class Check:
    """Something that can be wrong, and the function that finds it.

    Attributes:
        find: yields a sighting for each case; must not raise whatever the stream.
        code: stable, such as XN3-02: the family, then a number.
        severity: at its worst.
        title: what is wrong, in a few words.
        firmware: what the autopilot does about it, in a sentence or two.
        source: where in the firmware that is decided: file and function.
        fix: what to change.
        leads_to: beginnings of the codes that may explain it, if it is only a symptom; they are named in its advice.
        alone: the advice if none of them is found.
        witness: what it rests on; LOG stands for telemetry as well, where that is what the vehicle left.
        needs: what a recording must hold; if it lacks any of it, the check does not run.
    """

    find: Find
    code: str
    severity: Severity
    title: str
    firmware: str
    source: str
    fix: str
    witness: Witness = Witness.STREAM
    needs: AbstractSet[Aspect] = frozenset()
    leads_to: tuple[str, ...] = ()
    alone: str = ""

    @property
    def family(self) -> str:
        """The code without its number."""
        return self.code.partition("-")[0]


def check(
    *,
    code: str,
    severity: Severity,
    title: str,
    firmware: str,
    source: str,
    fix: str,
    witness: Witness = Witness.STREAM,
    needs: AbstractSet[Aspect] = frozenset(),
    leads_to: tuple[str, ...] = (),
    alone: str = "",
) -> Callable[[Find], Check]:
    """Make a check of the function below it; the arguments are those of ``Check``."""
    return partial(
        Check,
        code=code,
        severity=severity,
        title=title,
        firmware=firmware,
        source=source,
        fix=fix,
        witness=witness,
        needs=frozenset(needs),
        leads_to=leads_to,
        alone=alone,
    )


@dataclass(frozen=True, slots=True)
class Finding:
    """What a check has found; fields as those of ``Check`` and ``Sighting``, whose text is ``evidence``."""

    code: str
    severity: Severity
    title: str
    evidence: str
    firmware: str
    source: str
    fix: str
    witness: Witness
    message_numbers: tuple[int, ...]
    start_us: int | None
    end_us: int | None

    @property
    def messages_text(self) -> str:
        """The numbers of the messages in words: the first few, and how many there are; "" without any."""
        numbers = self.message_numbers
        if not numbers:
            return ""
        shown = ", ".join(str(number) for number in numbers[:NUMBERS_SHOWN])
        noun = "message" if len(numbers) == 1 else "messages"
        more = f", … ({len(numbers)} in all)" if len(numbers) > NUMBERS_SHOWN else ""
        return f"{noun} {shown}{more}"

    def as_dict(self) -> dict[str, object]:
        """Return the finding for machine-readable output."""
        fields = asdict(self)
        numbers = list(fields.pop("message_numbers"))
        is_model = self.witness is Witness.MODEL
        plain = {"severity": self.severity.value, "witness": self.witness.value}
        return {**fields, **plain, "model": is_model, "messages": numbers}


def diagnose(evidence: "Evidence", checks: Iterable[Check]) -> list[Finding]:
    """Return what checks find, worst first, then by code, with advice that fits the vehicle and the other findings.

    A check does not run if the recording lacks what it needs.
    """
    with np.errstate(all="ignore"):  # streams hold NaN and infinity
        pairs = [
            (check, _finding(check, sighting, evidence.vehicle_witness))
            for check in checks
            if check.needs.isdisjoint(evidence.stream.lacks)
            for sighting in check.find(evidence)
        ]
    pairs.sort(key=lambda pair: (pair[1].severity.rank, pair[1].code))
    findings = [finding for _, finding in pairs]
    obstacle = _obstacle(evidence)
    return [replace(finding, fix=_advice(check, finding, findings) + obstacle(finding)) for check, finding in pairs]


def _advice(check: Check, finding: Finding, findings: Sequence[Finding]) -> str:
    """Return what to do, which names the findings that explain a symptom."""
    if not check.leads_to or finding.fix != check.fix:
        return finding.fix
    others = {
        one.code: one.title
        for one in findings
        if one.code != finding.code and one.severity.at_least(Severity.WARNING) and one.code.startswith(check.leads_to)
    }
    named = [f"{code} ({title})" for code, title in others.items()]
    return f"Look first at {' and '.join(named[:_MOST_NAMED])}." if named else check.alone


def _obstacle(evidence: "Evidence") -> Callable[[Finding], str]:
    """Return what tells why advice cannot be followed as it is on the release or build of the vehicle, and what can."""
    set_up, name, instead = evidence.set_up, "", ""
    flown = set_up.judged_by.stands_for
    if flown is not None and not flown.has_sources:
        name, instead = "EK3_SRC", _BEFORE_SOURCES
    elif set_up.lacks_visual_odometry:
        name, instead = "VISO_", _WITHOUT_VISUAL_ODOMETRY
    return lambda finding: instead if name and name in finding.fix else ""


def _finding(check: Check, sighting: Sighting, vehicle: Witness) -> Finding:
    """Return what a check has found; ``vehicle`` is what the vehicle left: its log, or telemetry."""
    return Finding(
        code=check.code,
        severity=sighting.severity or check.severity,
        title=check.title,
        evidence=sighting.text,
        firmware=check.firmware,
        source=check.source,
        fix=sighting.fix or check.fix,
        witness=vehicle if check.witness is Witness.LOG else check.witness,
        message_numbers=tuple(int(number) for number in sighting.numbers),
        start_us=None if sighting.start_us is None else int(sighting.start_us),
        end_us=None if sighting.end_us is None else int(sighting.end_us),
    )
