# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN9: what the filter, a model of EKF3, does with the stream; the vehicle's own filter, if recorded, wins."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from ap_core.verdict import VerdictKind
from ekf_stub.ahrs.sources import EXTNAV
from ekf_stub.inputs.ingest_rules import OVERWRITTEN, SUPERSEDED
from ekf_stub.reports import AidingMode
from viso.doctor.checks import limits
from viso.doctor.checks.causes import CONTENT
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, how_often, share
from viso.doctor.checks.resets import jumps_in
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import CHANNELS, HEIGHT, POSITION, VELOCITY, YAW, OwnFilter, Witness
from viso.doctor.evidence.sender_clock import time_base_us
from viso.doctor.evidence.tracks import Floats, HandledMessage
from viso.explain.texts import all_texts, texts_like
from viso.vehicle.outcomes import UNITS, AidingSpan, OutcomeKind, outcome_kind

_CONTROL: Final = "AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode"
_FUSE: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED"
_WARNING: Final = 4  # MAV_SEVERITY
_MOST_TEXTS: Final = 10
_CHANNEL_OF: Final = {"pose": POSITION, "height": HEIGHT, "velocity": VELOCITY, "yaw": YAW}
_REFUSAL: Final = re.compile(r"(Pre)?Arm: |Internal")
_CONCERNS: Final = ("VisOdom", "EKF", "AHRS", "Position", "aiding", "Internal")


def _first_aiding(evidence: Evidence) -> AidingSpan | None:
    return next((span for span in evidence.trial.aiding if span.mode is not AidingMode.NONE), None)


def _own_filter(evidence: Evidence) -> OwnFilter | None:
    """Return the reports of the vehicle's own filter, if the trial has the parameters that it flew with."""
    own = evidence.vehicle.own_filter
    return own if own is not None and evidence.set_up.is_as_flown and own.flags.any() else None


def _never_navigated(evidence: Evidence) -> bool:
    """Return whether the vehicle's own filter waited for external navigation all the time, and never had a position."""
    own = _own_filter(evidence)
    return own is not None and bool((own.wants_extnav & own.running).any()) and not own.uses_extnav.any()


def _went_on_text(evidence: Evidence, stops: list[int]) -> str:
    """Return a text if the vehicle's own filter went on where the model would stop; "" if not, or if that is not known.

    Some time around each stop counts, because the model may stop earlier or later.
    """
    own = _own_filter(evidence)
    if own is None or not own.uses_extnav.any():
        return ""
    since_us = own.time_us[own.uses_extnav][0]
    for stop_us in stops:
        near = (own.time_us > max(stop_us - limits.EPISODE_US, since_us)) & (
            own.time_us < stop_us + limits.MODEL_STOP_NEAR_US
        )
        if not near.any() or not own.uses_extnav[near].all():
            return ""
    return f"; but the vehicle's own filter ({own.witness.value}) went on"


def _passed_text(evidence: Evidence, kind: str) -> str:
    """Return a text if the vehicle's own filter rejected nothing of a kind; "" if it did, or if that is not known."""
    own, channel = _own_filter(evidence), _CHANNEL_OF.get(kind)
    if own is None or channel is None:
        return ""
    used = own.ratios[own.fed_by_extnav(channel) & own.running, channel]
    used = used[np.isfinite(used)]
    if not len(used) or used.max() > 1.0:
        return ""
    ratio = f"its {CHANNELS[channel]} test ratio was {used.max():.2f} at most"
    return f"; but the vehicle's own filter ({own.witness.value}) passed all: {ratio}"


def _accepted(evidence: Evidence) -> list[HandledMessage]:
    return [message for message in evidence.stream.vision if message.verdict.kind is VerdictKind.ACCEPTED]


@check(
    code="XN9-01",
    severity=Severity.NOTE,
    title="Navigation by external navigation begins",
    firmware="The EKF says that it is using external nav data, and flags its position as good.",
    source=_CONTROL,
    fix="Nothing.",
    witness=Witness.MODEL,
)
def would_aid(evidence: Evidence) -> Iterator[Sighting]:
    first = _first_aiding(evidence)
    if first is not None and not _never_navigated(evidence):
        text = f"it would navigate by {first.mode.value} aiding from {at(first.start_us)} on"
        yield Sighting(text, start_us=first.start_us)


@check(
    code="XN9-02",
    severity=Severity.ERROR,
    title="The filter would never use it",
    firmware="It stays in constant position mode: no position, no modes that need one, no arming in them.",
    source=_CONTROL,
    fix="See the other findings; the filter needs poses with EK3_SRC1_POSXY 6, and a source of yaw.",
    witness=Witness.MODEL,
    leads_to=("XN1", "XN2", "XN3", "XN5", "XN7", "XN8"),
    alone="Give the filter poses with EK3_SRC1_POSXY 6, a source of yaw, and 15 s after boot.",
)
def would_never_aid(evidence: Evidence) -> Iterator[Sighting]:
    accepted = _accepted(evidence)
    wants = EXTNAV in (evidence.source("POSXY"), evidence.source("VELXY"))
    if accepted and wants and _first_aiding(evidence) is None:
        own = _own_filter(evidence)
        but = ""
        if own is not None and own.uses_extnav.any():
            since_us = own.time_us[own.uses_extnav][0]
            but = f"; but the vehicle's own filter ({own.witness.value}) did, from {at(since_us)} on"
        is_weak = evidence.stream.end_us < limits.FILTER_READY_US or bool(but)
        yield Sighting(
            f"{len(accepted)} messages are accepted, and to the end, {at(evidence.stream.end_us)}, the filter does not "
            f"use them to navigate{but}",
            start_us=accepted[0].arrival_us,
            end_us=evidence.stream.end_us,
            severity=Severity.NOTE if is_weak else None,
        )


@check(
    code="XN9-03",
    severity=Severity.ERROR,
    title="The filter would stop using it",
    firmware="It says stopped aiding, and holds a position that it no longer knows; in flight the EKF failsafe acts.",
    source=_CONTROL,
    fix="See the findings about gaps, jumps and sources.",
    witness=Witness.MODEL,
    leads_to=("XN4", *CONTENT, "XN7"),
    alone="Record the same with LOG_DISARMED 1, and look at XKF4 before that time.",
)
def would_stop_aiding(evidence: Evidence) -> Iterator[Sighting]:
    stops = [
        after.start_us
        for before, after in zip(evidence.trial.aiding, evidence.trial.aiding[1:], strict=False)
        if before.mode is not AidingMode.NONE and after.mode is AidingMode.NONE
    ]
    if stops:
        but = _went_on_text(evidence, stops)
        text = f"it would stop aiding {how_often(len(stops))}, first at {at(stops[0])}{but}"
        yield Sighting(text, start_us=stops[0], end_us=stops[-1], severity=Severity.NOTE if but else None)


def _rejected_by_kind(evidence: Evidence) -> Iterator[tuple[str, int, list[HandledMessage]]]:
    """Yield each kind of sample of which some were rejected, how many were tested, and the rejected ones' messages."""
    tested: Counter[str] = Counter()
    rejected: dict[str, list[HandledMessage]] = {}
    for message in evidence.stream.vision:
        for sample in message.samples:
            for test in sample.outcomes:
                kind, what = test.outcome.kind, outcome_kind(test.outcome.rule)
                tested[kind] += what in (OutcomeKind.FUSED, OutcomeKind.REJECTED, OutcomeKind.RESET)
                if what is OutcomeKind.REJECTED:
                    rejected.setdefault(kind, []).append(message)
    for kind, messages in sorted(rejected.items()):
        yield kind, tested[kind], messages


@check(
    code="XN9-04",
    severity=Severity.WARNING,
    title="The filter would reject samples",
    firmware="A sample beyond its gate is not used. After 7 s of that without velocities, position is reset.",
    source=_FUSE,
    fix=(
        "See the findings about jumps, frames, scale and time; gates are EK3_POS_I_GATE, VEL_I_GATE, HGT_I_GATE and "
        "YAW_I_GATE."
    ),
    witness=Witness.MODEL,
    leads_to=CONTENT,
    alone=(
        "Nothing in the stream explains it, so the model may be wrong about the vehicle's motion: give the vehicle's "
        "log of the same flight (--attitude LOG.BIN). Gates are EK3_POS_I_GATE, VEL_I_GATE, HGT_I_GATE and YAW_I_GATE."
    ),
)
def would_reject(evidence: Evidence) -> Iterator[Sighting]:
    if not evidence.stream.poses:
        return  # the model's vehicle moves by poses: without any it stands still, which contradicts what moves
    for kind, tested, messages in _rejected_by_kind(evidence):
        blind = _after_silence(evidence, messages)
        known = [message for message in messages if message.number not in blind]
        counted = known if _is_much(known, tested) else messages
        if not _is_much(counted, tested):
            continue
        why = ""
        if counted is not known:
            why = ", after a time without samples, over which nobody can tell how the vehicle moved"
        elif _accelerates(evidence, counted):
            why = ", where the path accelerates harder than the model's vehicle can follow"
        elif evidence.trial.model_jumps > jumps_in(evidence):
            why = ", and the model's vehicle took motion for jumps: it lost the stream, which a real one does not"
        but = _passed_text(evidence, kind)
        # The size counts where the model's vehicle keeps to the stream: elsewhere it shows where the model went.
        worst = evidence.trial.innovations[kind].worst if kind in evidence.trial.innovations else 0.0
        how_much = "" if why else f"; the worst is {worst:.2f} {UNITS.get(kind, '')} off"
        yield Sighting.in_messages(
            f"{share(len(counted), tested)} {kind} samples would be rejected, from "
            f"{at(counted[0].arrival_us)} on{why}{how_much}{but}",
            counted,
            severity=Severity.NOTE if why or but else None,
        )


def _is_much(messages: list[HandledMessage], tested: int) -> bool:
    return len(messages) >= limits.FEWEST_REJECTED and len(messages) > limits.REJECTED_SHARE * tested


def _after_silence(evidence: Evidence, messages: list[HandledMessage]) -> set[int]:
    """Return the numbers of messages whose rejection began after a gap without accepted ones.

    Over a gap the motion of the model's vehicle is a guess; a real vehicle has its own inertial data.
    """
    accepted_us = np.array([message.arrival_us for message in _accepted(evidence)], dtype=np.int64)
    found: set[int] = set()
    latest_us, is_blind = -limits.EPISODE_US, False
    for message in messages if len(accepted_us) else ():
        if message.arrival_us - latest_us > limits.EPISODE_US:
            start_us = max(message.arrival_us - limits.EPISODE_US, int(accepted_us[0]))
            near = (accepted_us >= start_us) & (accepted_us <= message.arrival_us)
            is_blind = bool((np.diff(accepted_us[near], prepend=start_us) > limits.BLIND_GAP_US).any())
        if is_blind:
            found.add(message.number)
        latest_us = message.arrival_us
    return found


def _accelerates(evidence: Evidence, messages: list[HandledMessage]) -> bool:
    """Return whether a path without jumps accelerates harder than the model's vehicle can, before some messages."""
    start_us, end_us = messages[0].arrival_us - limits.HARD_BEFORE_US, messages[0].arrival_us + limits.HARD_AFTER_US
    for poses in evidence.stream.poses:
        time_s: Floats = np.asarray(time_base_us(poses.track) * 1e-6, dtype=np.float64)
        every = max(1, int(np.searchsorted(time_s, time_s[0] + limits.ACCELERATION_OVER_S)))
        if len(time_s) <= 2 * every:
            continue
        size = _accelerations(time_s, poses.pos_m, every)
        arrival_us = poses.track.arrival_us[every:-every]
        near = size[(arrival_us > start_us) & (arrival_us < end_us)]
        near = near[np.isfinite(near)]
        if len(near) and limits.HARD_M_S2 < near.max() < limits.IMPOSSIBLE_M_S2:
            return True
    return False


def _accelerations(time_s: Floats, pos_m: Floats, every: int) -> Floats:
    """Return the size of the acceleration in m/s^2 over three of N poses that are ``every`` indices apart."""
    before = np.maximum(time_s[every:-every] - time_s[: -2 * every], 1e-3)[:, None]
    after = np.maximum(time_s[2 * every :] - time_s[every:-every], 1e-3)[:, None]
    behind = (pos_m[every:-every] - pos_m[: -2 * every]) / before
    ahead = (pos_m[2 * every :] - pos_m[every:-every]) / after
    return np.asarray(np.linalg.norm(2 * (ahead - behind) / (before + after), axis=1), dtype=np.float64)


@check(
    code="XN9-05",
    severity=Severity.NOTE,
    title="The filter would lose samples",
    firmware="Of samples that fall due in one step only the last is used, and a full buffer loses its oldest.",
    source="EKF_Buffer.cpp, ekf_ring_buffer::recall and push",
    fix="Send evenly, not in bursts, and less than 50 per second.",
    witness=Witness.MODEL,
)
def would_lose_samples(evidence: Evidence) -> Iterator[Sighting]:
    offered: Counter[str] = Counter()
    lost: dict[str, list[HandledMessage]] = {}
    for message in evidence.stream.vision:
        for sample in message.samples:
            offered[sample.kind] += 1
            if any(test.outcome.rule in (OVERWRITTEN, SUPERSEDED) for test in sample.outcomes):
                lost.setdefault(sample.kind, []).append(message)
    for kind, messages in sorted(lost.items()):
        if len(messages) >= limits.FEWEST_REJECTED and len(messages) > limits.LOST_SAMPLES_SHARE * offered[kind]:
            lost_share = share(len(messages), offered[kind])
            yield Sighting.in_messages(
                f"{lost_share} {kind} samples would be lost unused in the filter's buffer", messages
            )


@check(
    code="XN9-06",
    severity=Severity.NOTE,
    title="Your autopilot said so itself",
    firmware="A text of the autopilot in the stream, not of the model.",
    source="GCS_MAVLink/GCS.cpp, GCS::send_textv",
    fix="See the index of texts: viso explain and the text.",
    witness=Witness.LOG,
)
def autopilot_texts(evidence: Evidence) -> Iterator[Sighting]:
    texts = [
        (time_us, text)
        for time_us, severity, text in evidence.vehicle.texts
        if severity <= _WARNING and any(word in text for word in _CONCERNS)
    ]
    own = evidence.vehicle.own_filter
    if own is not None and own.witness is Witness.LOG:  # it has no severities; other checks look at the other texts
        texts += [
            (time_us, text)
            for time_us, text in own.texts
            if _REFUSAL.match(text) and any(word in text for word in _CONCERNS)
        ]
    for text, count in Counter(text for _, text in texts).most_common(_MOST_TEXTS):
        time_us = next(when for when, what in texts if what == text)
        more = "" if count == 1 else f", {count} times"
        known = [one.fix for _, one in texts_like(text)] if any(one.fits(text) for _, one in all_texts()) else []
        fix = f"{known[0][0].upper()}{known[0][1:]}." if known else None
        yield Sighting(f'at {at(time_us)} your autopilot said "{text}"{more}', start_us=time_us, fix=fix)


@check(
    code="XN9-07",
    severity=Severity.WARNING,
    title="The height does not come from external navigation",
    firmware=(
        "With EK3_SRC1_POSZ 6 a height counts only while the last sample, by its corrected stamp, is younger than 500 "
        "ms. Else the barometer gives the height, without a text, and the next sample that is young enough sets it."
    ),
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion",
    fix=(
        "Mend what makes samples old or rare: see the findings about stamps, delay and gaps. If the barometer is to "
        "give the height, set EK3_SRC1_POSZ 1."
    ),
    witness=Witness.MODEL,
)
def height_by_others(evidence: Evidence) -> Iterator[Sighting]:
    used = evidence.height_by_extnav
    if used is not None and used.is_rare:
        yield Sighting(
            f"EK3_SRC1_POSZ is 6 (ExtNav), and of {used.positions} positions that were fused {used.heights} gave the "
            "height: it came from the barometer"
        )
