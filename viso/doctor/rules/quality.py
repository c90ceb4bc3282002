# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN6: quality."""

from collections.abc import Iterator
from typing import Final

from ap_visualodom.verdicts import QUALITY_BELOW_MIN
from mav_handlers.wire.messages import ODOMETRY
from viso.doctor.evidence import Evidence
from viso.doctor.findings import Severity, Sighting, error, note, warning
from viso.doctor.measures.sender_clock import FEWEST
from viso.doctor.measures.tracks import SeenMessage
from viso.doctor.outputs.phrases import by_type, seen_in, share
from viso.streams.stream_kinds import Aspect

_GATE: Final = "AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate"


def _odometry(evidence: Evidence) -> list[tuple[SeenMessage, int]]:
    return [(one, one.message.quality) for one in evidence.vision if isinstance(one.message, ODOMETRY)]


@warning(
    "XN6-06",
    "Quality outside its range",
    "The field is a signed byte: a value above 127 arrives as a negative number, below every VISO_QUAL_MIN.",
    _GATE,
    "Send -1 for failed, 0 for unknown, else 1 to 100.",
    needs=frozenset({Aspect.QUALITY}),
)
def _quality_wraps(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    found = [(one, quality) for one, quality in odometry if quality < -1 or quality > 100]
    if found:
        worst = min(quality for _, quality in found)
        meant = f" ({worst + 256} before it was cut to a byte?)" if worst < 0 else ""
        yield seen_in(
            f"{share(len(found), len(odometry))} ODOMETRY have a quality outside -1..100, such as {worst}{meant}",
            [one for one, _ in found],
        )


@error(
    "XN6-07",
    "Quality gate against messages without a quality",
    "Only ODOMETRY carries a quality; every other message counts as 0, and with VISO_QUAL_MIN above 0 none of them "
    "reaches the filter.",
    _GATE,
    "Set VISO_QUAL_MIN to 0, or send ODOMETRY.",
)
def _gate_against_none(evidence: Evidence) -> Iterator[Sighting]:
    found = [one for one in evidence.vision if one.verdict is QUALITY_BELOW_MIN and one.name != "ODOMETRY"]
    why = f"their quality counts as 0, VISO_QUAL_MIN is {evidence.param('VISO_QUAL_MIN'):.0f}"
    for name, of_name in by_type(found):
        yield seen_in(f"{len(of_name)} {name} withheld: {why}", of_name)


@warning(
    "XN6-08",
    "Samples withheld for their quality",
    "Samples below VISO_QUAL_MIN do not reach the filter; they still count for health.",
    _GATE,
    "Improve the light and texture that the camera sees; or lower VISO_QUAL_MIN if the source's figures are lower by "
    "nature.",
    needs=frozenset({Aspect.QUALITY}),
)
def _gate_closed(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    found = [one for one, quality in odometry if one.verdict is QUALITY_BELOW_MIN and quality != -1]
    if found:
        minimum = evidence.param("VISO_QUAL_MIN")
        yield seen_in(
            f"{share(len(found), len(odometry))} ODOMETRY withheld: quality below VISO_QUAL_MIN {minimum:.0f}", found
        )


@warning(
    "XN6-09",
    "Tracking failed",
    "Quality -1 means failed; with VISO_QUAL_MIN at 0 or above such samples are withheld, at -1 they are fused.",
    _GATE,
    "Keep VISO_QUAL_MIN at 0 or above.",
    needs=frozenset({Aspect.QUALITY}),
)
def _failed(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    found = [one for one, quality in odometry if quality == -1]
    text = f"{share(len(found), len(odometry))} ODOMETRY say that tracking failed (quality -1)"
    if found and not any(one.verdict is QUALITY_BELOW_MIN for one in found):
        yield seen_in(f"{text}, and none is withheld", found)
    elif found:
        severity = Severity.WARNING if len(found) > 0.1 * len(odometry) else Severity.NOTE
        yield seen_in(f"{text} and are withheld", found, severity=severity)


@note(
    "XN6-10",
    "Quality is never sent",
    "0 passes a VISO_QUAL_MIN of 0; the gate has no effect.",
    _GATE,
    "Fill in quality, 1 to 100, and -1 while tracking is lost; MAVROS leaves it at 0.",
    needs=frozenset({Aspect.QUALITY}),
)
def _quality_never_set(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    if len(odometry) >= FEWEST and all(quality == 0 for _, quality in odometry):
        yield seen_in("every ODOMETRY has quality 0, which stands for unknown", [one for one, _ in odometry])
