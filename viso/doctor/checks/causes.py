# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which finding explains others: one cause shows in many ways."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from viso.doctor.checks.check import Finding, Severity

CONTENT: Final = ("XN2", "XN3", "XN5", "XN6", "XN7-3", "XN8")
"""The beginnings of the codes about what a stream says, which explain that a filter rejects it."""
_LOST: Final = tuple(f"XN9-{number:02d}" for number in (2, 3, 4, 10, 13, 15, 16, 31))
"""The filter rejects or loses the stream, and jumps when it takes it up again."""
_OLD: Final = ("XN9-07", *_LOST)
"""So it does with samples that are old or missing; meanwhile the barometer gives the height."""
_CAUSES: Final[Mapping[str, tuple[str, ...]]] = {
    "XN1-01": ("XN9-12", *_OLD),
    "XN3-12": ("XN3", "XN5-12", "XN6-01", *_OLD),
    "XN3-13": ("XN3", "XN8", *_OLD),
    "XN3-01": ("XN3", *_OLD),
    "XN3-02": ("XN3", *_OLD),
    "XN3-09": ("XN3", *_OLD),
    "XN3-05": ("XN3", *_OLD),
    "XN7-01": ("XN7", "XN9-12", *_LOST),
    "XN7-02": ("XN7", "XN9-12", *_LOST),
    "XN7-12": ("XN7", *_LOST),
    "XN2-01": ("XN7-03", "XN9-12", *_LOST),
    "XN5-07": ("XN2", "XN5", "XN6-01", "XN8", *_LOST),
    "XN5-18": ("XN5", "XN6-01", "XN8", *_LOST),
    "XN5-06": ("XN2", "XN8", *_LOST),
    "XN2-12": ("XN2", "XN5-12", "XN8", *_LOST),
    "XN2-10": ("XN2", "XN8", *_LOST),
    "XN2-13": ("XN2", "XN8", *_LOST),
    "XN2-02": ("XN2", "XN8", *_LOST),
    "XN2-07": ("XN2", "XN8", *_LOST),
    "XN2-06": ("XN2", "XN8", *_LOST),
    "XN2-09": ("XN2", "XN8", *_LOST),
    "XN2-08": ("XN2", "XN8", *_LOST),
    "XN7-31": ("XN8-13", *_LOST),
    "XN7-08": ("XN8", *_LOST),
    "XN7-04": _LOST,
    "XN4-05": ("XN4", "XN9-12", *_OLD),
    "XN6-11": ("XN1-05", "XN3-11", "XN4-06", "XN4-07", *_LOST),
    "XN3-11": _OLD,
    "XN6-01": _LOST,
    "XN9-12": _OLD,
    "XN7-19": ("XN9-11", *_LOST),
    "XN9-32": _LOST,
    "XN8-07": ("XN9-31",),
    "XN9-07": ("XN9-31",),
}
"""What may explain others, the most basic first, and the beginnings of the codes that may follow from it.

That arming does not wait for the sensor (XN7-18), and that the failsafe never acts (XN9-18), explain nothing else.
"""


@dataclass(frozen=True, slots=True)
class ProbableCause:
    """The finding that probably explains others, and their codes."""

    finding: Finding
    explains: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.finding.code} {self.finding.title}; probably from it: {', '.join(self.explains)}"

    def as_dict(self) -> dict[str, object]:
        """Return it for machine-readable output."""
        return {"code": self.finding.code, "explains": list(self.explains)}


def probable_cause(findings: Sequence[Finding]) -> ProbableCause | None:
    """Return the finding that explains others, which are no notes; None if none does."""
    serious = [finding for finding in findings if finding.severity.at_least(Severity.WARNING)]
    for code, consequences in _CAUSES.items():
        cause = next((finding for finding in serious if finding.code == code), None)
        if cause is None:
            continue
        others = [one.code for one in serious if one.code != code and one.code.startswith(consequences)]
        if others:
            return ProbableCause(cause, tuple(dict.fromkeys(others)))
    return None
