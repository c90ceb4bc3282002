# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN6: quality."""

from collections.abc import Iterator
from typing import Final

from ap_visualodom.verdicts import QUALITY_BELOW_MIN
from mav_handlers.wire.messages import ODOMETRY
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import by_type, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.tracks import HandledMessage
from viso.streams.stream_kinds import Aspect

_GATE: Final = "AP_VisualOdom_MAV.cpp, AP_VisualOdom_MAV::handle_pose_estimate"


def _odometry(evidence: Evidence) -> list[tuple[HandledMessage, int]]:
    return [
        (message, message.message.quality)
        for message in evidence.stream.vision
        if isinstance(message.message, ODOMETRY)
    ]


@check(
    code="XN6-06",
    severity=Severity.WARNING,
    title="Quality outside its range",
    firmware="The field is a signed byte: a value above 127 arrives as a negative number, below every VISO_QUAL_MIN.",
    source=_GATE,
    fix="Send -1 for failed, 0 for unknown, else 1 to 100.",
    needs={Aspect.QUALITY},
)
def quality_out_of_range(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    found = [(message, quality) for message, quality in odometry if quality < -1 or quality > 100]
    if found:
        worst = min(quality for _, quality in found)
        meant = f" ({worst + 256} before it was cut to a byte?)" if worst < 0 else ""
        yield Sighting.in_messages(
            f"{share(len(found), len(odometry))} ODOMETRY have a quality outside -1..100, such as {worst}{meant}",
            [message for message, _ in found],
        )


@check(
    code="XN6-07",
    severity=Severity.ERROR,
    title="Quality gate against messages without a quality",
    firmware=(
        "Only ODOMETRY carries a quality; every other message counts as 0, and with VISO_QUAL_MIN above 0 none of them "
        "reaches the filter."
    ),
    source=_GATE,
    fix="Set VISO_QUAL_MIN to 0, or send ODOMETRY.",
)
def gate_without_quality(evidence: Evidence) -> Iterator[Sighting]:
    found = [
        message
        for message in evidence.stream.vision
        if message.verdict is QUALITY_BELOW_MIN and message.name != "ODOMETRY"
    ]
    why = f"their quality counts as 0, VISO_QUAL_MIN is {evidence.param('VISO_QUAL_MIN'):.0f}"
    for name, of_name in by_type(found):
        yield Sighting.in_messages(f"{len(of_name)} {name} withheld: {why}", of_name)


@check(
    code="XN6-08",
    severity=Severity.WARNING,
    title="Samples withheld for their quality",
    firmware="Samples below VISO_QUAL_MIN do not reach the filter; they still count for health.",
    source=_GATE,
    fix=(
        "Improve the light and texture that the camera sees; or lower VISO_QUAL_MIN if the source's figures are lower "
        "by nature."
    ),
    needs={Aspect.QUALITY},
)
def quality_below_minimum(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    found = [message for message, quality in odometry if message.verdict is QUALITY_BELOW_MIN and quality != -1]
    if found:
        minimum = evidence.param("VISO_QUAL_MIN")
        yield Sighting.in_messages(
            f"{share(len(found), len(odometry))} ODOMETRY withheld: quality below VISO_QUAL_MIN {minimum:.0f}", found
        )


@check(
    code="XN6-09",
    severity=Severity.WARNING,
    title="Tracking failed",
    firmware=(
        "Quality -1 means failed; with VISO_QUAL_MIN at 0 or above such samples are withheld, at -1 they are fused."
    ),
    source=_GATE,
    fix="Keep VISO_QUAL_MIN at 0 or above.",
    needs={Aspect.QUALITY},
)
def tracking_failed(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    found = [message for message, quality in odometry if quality == -1]
    text = f"{share(len(found), len(odometry))} ODOMETRY say that tracking failed (quality -1)"
    if found and not any(message.verdict is QUALITY_BELOW_MIN for message in found):
        yield Sighting.in_messages(f"{text}, and none is withheld", found)
    elif found:
        severity = Severity.WARNING if len(found) > limits.FAILED_SHARE * len(odometry) else Severity.NOTE
        yield Sighting.in_messages(f"{text} and are withheld", found, severity=severity)


@check(
    code="XN6-10",
    severity=Severity.NOTE,
    title="Quality is never sent",
    firmware="0 passes a VISO_QUAL_MIN of 0; the gate has no effect.",
    source=_GATE,
    fix="Fill in quality, 1 to 100, and -1 while tracking is lost; MAVROS leaves it at 0.",
    needs={Aspect.QUALITY, Aspect.LINK},  # a log does not name the message, and others carry no quality
)
def quality_never_sent(evidence: Evidence) -> Iterator[Sighting]:
    odometry = _odometry(evidence)
    if len(odometry) >= FEWEST_MESSAGES and all(quality == 0 for _, quality in odometry):
        yield Sighting.in_messages(
            "every ODOMETRY has quality 0, which stands for unknown", [message for message, _ in odometry]
        )
