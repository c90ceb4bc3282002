# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN9 from 10 on: what the recorded vehicle's own filter reported; no model has a say."""

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from viso.doctor.checks import limits
from viso.doctor.checks.causes import CONTENT
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, how_often, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import (
    CHANNELS,
    HEIGHT,
    HEIGHT_LOST,
    POSITION,
    VELOCITY,
    VELOCITY_LOST,
    OverOne,
    OwnFilter,
    Witness,
    aiding_texts,
)
from viso.doctor.evidence.tracks import Bools
from viso.estimators.series import overlap_s, total_s

RATIO_CODES: Final = frozenset({"XN9-10", "XN9-11", "XN9-14"})
"""Of test ratios above 1."""

POSITION_CODES: Final = frozenset({"XN9-15", "XN9-16"})
"""Of a position that the filter did not have."""

OWN_CODES: Final = RATIO_CODES | POSITION_CODES | {"XN9-12", "XN9-13"}
"""Of what the vehicle's own filter and status reported."""

_FUSE: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED; AP_NavEKF3_MagFusion.cpp, fuseEulerYaw"
_CONTROL: Final = "AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode"
_CHECK: Final = "ArduCopter/ekf_check.cpp, Copter::ekf_check"
_OF_LOG: Final = ("SV", "SP", "SH", "SM")
_OF_TELEMETRY: Final = ("velocity_variance", "pos_horiz_variance", "pos_vert_variance", "compass_variance")
_UNITS: Final = ("m/s", "m", "m", "deg")
_NEARLY: Final = 0.97
_TELLING: Final = 0.01


def _severity_of(found: OverOne) -> Severity:
    """Return ERROR for a ratio that is above 1 for long or much of the time, NOTE for a single short excursion."""
    is_much = found.share >= limits.RATIO_MUCH_SHARE and found.over_s >= limits.RATIO_LASTING_S
    if found.longest_s >= limits.RATIO_LONG_S or is_much:
        return Severity.ERROR
    is_some = found.over_s >= limits.RATIO_SHORT_S or found.share >= limits.RATIO_SOME_SHARE
    return Severity.WARNING if is_some else Severity.NOTE


def _ratio_text(own: OwnFilter, found: OverOne, fused_too: bool) -> str:
    """Return how long a ratio was above 1, in words; ``fused_too`` tells that ExtNav's velocity is fused as well."""
    labels = _OF_TELEMETRY if own.record == "EKF_STATUS_REPORT" else _OF_LOG
    name, field = CHANNELS[found.channel], f"{own.record}.{labels[found.channel]}"
    source = f"{found.source} and ExtNav, by EK3_SRC_OPTIONS" if fused_too else found.source
    part = f"{100 * found.share:.0f} %" if found.share >= _TELLING else f"{found.over_s:.1f} s"
    long = f"{part} of {found.used_s:.0f} s{_armed_text(found.armed_s, found.over_s)}"
    off = "" if found.innovation is None else f"; {name} was up to {found.innovation:.3g} {_UNITS[found.channel]} off"
    return (
        f"the autopilot's own {name} test ratio ({field}, {name} from {source}) was above 1 for {long}, from "
        f"{at(found.first_us)} on, worst {found.worst:.1f} at {at(found.worst_us)}{off}"
    )


def _armed_text(armed_s: float, total_s: float) -> str:
    """Return how much of a time the vehicle was armed, in words."""
    if armed_s <= 0:
        return ""
    return ", armed" if armed_s > _NEARLY * total_s else f", {armed_s:.1f} s of that armed"


def _over_one(evidence: Evidence, by_extnav: bool) -> Iterator[tuple[OverOne, str]]:
    """Yield the channels whose ratio was above 1, with a text, worst first: those of external navigation, or others."""
    own = evidence.vehicle.own_filter
    if own is None:
        return
    found = []
    for channel in range(len(CHANNELS)):
        fed = own.fed_by_extnav(channel)
        ratio = own.over_one(channel, fed if by_extnav else ~fed)
        if ratio is not None:
            found.append(ratio)
    for ratio in sorted(found, key=lambda ratio: -ratio.share):
        yield ratio, _ratio_text(own, ratio, ratio.channel == VELOCITY and bool(evidence.velocities_of_other_sets))


@check(
    code="XN9-10",
    severity=Severity.ERROR,
    title="The autopilot's own filter rejected external navigation",
    firmware=(
        "A measurement whose test ratio is above 1 is not fused: while that lasts the filter uses what is left, in the "
        "end only its inertial sensors, and above FS_EKF_THRESH the EKF check acts."
    ),
    source=_FUSE,
    fix=(
        "Trust this more than any model: the stream contradicts the vehicle's other sensors. See the findings about "
        "frames, axes, yaw, scale, delay and jumps."
    ),
    witness=Witness.LOG,
    leads_to=(*CONTENT, "XN4"),
    alone=(
        "Compare XKF3 (innovations) with VISP at that time: the stream contradicts the vehicle's other sensors. One "
        "that is right in itself may come late (VISO_DELAY_MS), or be rotated against the compass."
    ),
)
def rejected_extnav(evidence: Evidence) -> Iterator[Sighting]:
    for ratio, text in _over_one(evidence, by_extnav=True):
        yield Sighting(text, start_us=ratio.first_us, end_us=ratio.last_us, severity=_severity_of(ratio))


@check(
    code="XN9-11",
    severity=Severity.WARNING,
    title="The autopilot's own filter rejected another sensor",
    firmware=(
        "A measurement whose test ratio is above 1 is not fused. A sensor that disagrees with external navigation "
        "shows in this way as well."
    ),
    source=_FUSE,
    fix=(
        "Find out which of the two is right: a compass near motors or iron, a GPS indoors, or a camera whose frame is "
        "turned."
    ),
    witness=Witness.LOG,
)
def rejected_other_sensor(evidence: Evidence) -> Iterator[Sighting]:
    for ratio, text in _over_one(evidence, by_extnav=False):
        severity = Severity.NOTE if _severity_of(ratio) is Severity.NOTE else Severity.WARNING
        yield Sighting(text, start_us=ratio.first_us, end_us=ratio.last_us, severity=severity)


@check(
    code="XN9-12",
    severity=Severity.ERROR,
    title="The autopilot calls its vision sensor unhealthy",
    firmware=(
        "With VISO_TYPE set the sensor is present and enabled; if no message reaches the driver for 300 ms it is "
        "unhealthy. With the vision check on, arming is then refused: VisOdom: not healthy."
    ),
    source="AP_VisualOdom_Backend.cpp, AP_VisualOdom_Backend::healthy; GCS_Common.cpp, GCS::update_sensor_status_flags",
    fix="Look for messages that the autopilot drops (frames, ids, link, rate) or that are never sent.",
    witness=Witness.LOG,
)
def sensor_unhealthy(evidence: Evidence) -> Iterator[Sighting]:
    own, vision = evidence.vehicle.own_filter, evidence.vision_sensor
    if own is None or vision is None:
        return
    enabled = vision.present & vision.enabled
    ill = enabled & ~vision.healthy
    if not ill.any():
        return
    count, times = int(enabled.sum()), vision.time_us[ill]
    if not (enabled & vision.healthy).any():
        text = f"SYS_STATUS: the vision sensor is enabled, and healthy in none of {count} messages"
        severity = None if count >= limits.FEWEST_STATUSES else Severity.NOTE
        yield Sighting(text, start_us=int(times[0]), end_us=int(times[-1]), severity=severity)
        return
    first_well_us = int(vision.time_us[enabled & vision.healthy][0])
    later = times[times > first_well_us]
    if not len(later):
        text = f"SYS_STATUS: the vision sensor is unhealthy until {at(first_well_us)}, and healthy from then on"
        yield Sighting(text, start_us=int(times[0]), end_us=first_well_us, severity=Severity.NOTE)
        return
    armed = sum(map(own.was_armed, later.tolist()))
    while_armed = f", {armed} of them armed" if armed else ""
    since = int((enabled & (vision.time_us >= first_well_us)).sum())
    much = len(later) > limits.UNHEALTHY_SHARE * since or armed > limits.RATIO_MUCH_SHARE * since
    yield Sighting(
        f"SYS_STATUS: once healthy, the vision sensor is unhealthy in {share(len(later), since)} messages"
        f"{while_armed}, first at {at(later[0])}",
        start_us=int(later[0]),
        end_us=int(later[-1]),
        severity=Severity.ERROR if much else Severity.WARNING,
    )


@check(
    code="XN9-13",
    severity=Severity.ERROR,
    title="The autopilot's EKF check acted",
    firmware=(
        "After a second with two test ratios above FS_EKF_THRESH, or without a position, it says EKF variance; in "
        "flight FS_EKF_ACTION follows, by default a landing."
    ),
    source=_CHECK,
    fix="See what the filter rejected or lost just before.",
    witness=Witness.LOG,
    leads_to=("XN9-10", "XN9-11", "XN9-16", "XN4", *CONTENT, "XN7"),
    alone="Look at the test ratios (XKF4, EKF_STATUS_REPORT) in the second before: which rose first?",
)
def ekf_check_acted(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is not None and own.failsafes:
        first = own.failsafes[0]
        counts = Counter(text for _, text in own.failsafes)
        names = " and ".join(f'"{text}" {how_often(count)}' for text, count in counts.items())
        yield Sighting(
            f"the autopilot itself recorded {names}, first at {at(first[0])}",
            start_us=first[0],
            end_us=own.failsafes[-1][0],
            severity=None if _may_rely_on_extnav(own) else Severity.WARNING,
        )


def _may_rely_on_extnav(own: OwnFilter) -> bool:
    """Return whether external navigation was a source, or no source is known."""
    if own.wants_extnav.any() or any(by_extnav for _, by_extnav, _ in aiding_texts(own.texts)):
        return True
    return not own.is_source_known(POSITION).any()


@check(
    code="XN9-14",
    severity=Severity.WARNING,
    title="The autopilot's cores disagree",
    firmware=(
        "EKF3 runs a core for each IMU, and flies with another when that has had the smaller errors for long enough."
    ),
    source="AP_NavEKF3.cpp, NavEKF3::UpdateFilter",
    fix="Compare the cores: one that leaves the others has a bad IMU; if all of them reject, the stream is wrong.",
    witness=Witness.LOG,
)
def cores_disagree(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is None:
        return
    lanes = [(time_us, core) for time_us, core in own.lanes if own.armed is None or own.was_armed(time_us)]
    if lanes:
        first_us, core = lanes[0]
        text = f"the autopilot changed its primary core {how_often(len(lanes))}, at {at(first_us)} to core {core}"
        yield Sighting(text, start_us=first_us, end_us=lanes[-1][0])
    for ratio in own.others:
        if ratio.over_s < limits.RATIO_SHORT_S:
            continue
        yield Sighting(
            f"core {ratio.core}, while it was not the primary one, had a test ratio above 1 for {ratio.over_s:.1f} s, "
            f"from {at(ratio.first_us)} on, worst {ratio.worst:.1f}",
            start_us=ratio.first_us,
            severity=Severity.NOTE,
        )


@check(
    code="XN9-15",
    severity=Severity.ERROR,
    title="The autopilot's own filter never navigated by external navigation",
    firmware=(
        "With EK3_SRC1_POSXY 6 the filter waits for poses, and stays in constant position mode until then: no "
        "position, no modes that need one."
    ),
    source=_CONTROL,
    fix="Look first whether messages reach the driver (VISP in the log, SYS_STATUS), then for a yaw source.",
    witness=Witness.LOG,
)
def never_navigated(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is None or not own.flags.any():
        return
    wants = own.wants_extnav & own.running
    waited_s, stops = float(own.step_s[wants].sum()), _stop_times(own)
    if wants.any() and not own.uses_extnav.any():
        yield Sighting(
            "external navigation is the EKF's source of horizontal position or velocity, and in "
            f"{waited_s:.0f} s it never had either ({own.record}){_stops_text(stops)}",
            start_us=int(own.time_us[wants][0]),
            end_us=int(own.time_us[wants][-1]),
            severity=None if waited_s >= limits.WAITED_S or len(stops) >= limits.FEWEST_STOPS else Severity.NOTE,
        )


def _stop_times(own: OwnFilter) -> list[int]:
    return [time_us for time_us, _, text in aiding_texts(own.texts) if text == "stopped aiding"]


def _stops_text(stops: list[int]) -> str:
    return f', and said "stopped aiding" {how_often(len(stops))}' if stops else ""


@check(
    code="XN9-16",
    severity=Severity.ERROR,
    title="The autopilot's own filter lost external navigation",
    firmware=(
        "If no position passes for 7 s, or none comes for long enough, the filter times out. It resets to the "
        "positions that it gets, or stops aiding and holds a position that it no longer knows."
    ),
    source=_CONTROL,
    fix="See the findings about gaps, rejected samples and sources.",
    witness=Witness.LOG,
    leads_to=("XN4", "XN9-10", *CONTENT, "XN7"),
    alone="Look whether messages still came then (VISP in the log), and were rejected (XKF4), or stopped.",
)
def lost_extnav(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is None or not own.uses_extnav.any():
        return
    began = np.arange(len(own.time_us)) >= int(np.argmax(own.uses_extnav))
    stops = _stop_times(own)
    lost = began & own.wants_extnav & ~own.uses_extnav
    what = "horizontal position" if own.fed_by_extnav(POSITION)[lost].any() else "horizontal velocity"
    yield from _lost_spans(own, lost, what, stops)
    for name, bit, channel in (("velocity", VELOCITY_LOST, VELOCITY), ("height", HEIGHT_LOST, HEIGHT)):
        fed = own.fed_by_extnav(channel) & own.uses_extnav
        passed = np.logical_or.accumulate(fed & (own.timeouts & bit == 0))
        timed_out = passed & fed & ~lost & (own.timeouts & bit != 0)
        yield from _lost_spans(own, timed_out, f"{name} (a timeout in TS)", [])


def _lost_spans(own: OwnFilter, lost: Bools, what: str, stops: list[int]) -> Iterator[Sighting]:
    spans = [span for span in own.lost_spans(lost) if span[1] - span[0] >= limits.LOST_POSITION_S]
    if not spans and len(stops) < limits.FEWEST_STOPS:
        return
    armed_s = overlap_s(own.armed or (), spans)
    first_us = int(1e6 * spans[0][0]) if spans else stops[0]
    is_bad = armed_s > 0 or len(stops) >= limits.FEWEST_STOPS
    yield Sighting(
        f"once it navigated by external navigation, the EKF was without {what} for {total_s(spans):.1f} s"
        f"{_armed_text(armed_s, total_s(spans))}, first at {at(first_us)}{_stops_text(stops)}",
        start_us=first_us,
        end_us=int(1e6 * spans[-1][1]) if spans else stops[-1],
        severity=None if is_bad else Severity.WARNING,
    )


@check(
    code="XN9-17",
    severity=Severity.NOTE,
    title="The filter's own reports were not recorded",
    firmware="Missing records prove nothing: the filter may have rejected everything.",
    source="AP_NavEKF3_Logging.cpp, NavEKF3::Log_Write; GCS_Common.cpp, GCS_MAVLINK::send_ekf_status_report",
    fix="Record it: XKF records come with bit 0 or 1 of LOG_BITMASK, EKF_STATUS_REPORT with the stream EXTRA3.",
    witness=Witness.LOG,
)
def reports_not_recorded(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is None or not evidence.is_concerned:
        return
    missing = []
    if own.witness is Witness.LOG and not own.record:
        missing.append("XKF4")
    elif own.witness is Witness.TELEMETRY:
        missing += ["EKF_STATUS_REPORT"] * (not own.record) + ["SYS_STATUS"] * (own.vision is None)
    if own.record and not own.has_ratios:
        missing.append(f"test ratios in {own.record}")
    if missing:
        yield Sighting(f"the recording holds no {' and no '.join(missing)}")


@check(
    code="XN9-18",
    severity=Severity.WARNING,
    title="The EKF has no origin, so its failsafe never acts",
    firmware=(
        "Copter's EKF check returns at once while the EKF has no origin: no EKF variance, no failsafe and no landing, "
        "whatever happens to external navigation. Modes that need no global position arm without one."
    ),
    source=_CHECK,
    fix=(
        "Send SET_GPS_GLOBAL_ORIGIN (any place will do) before arming, before the first pose if EK3_SRC1_POSZ is 6; or "
        "set the EKF origin in the ground station. Look for the text origin set."
    ),
    witness=Witness.LOG,
)
def no_origin(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is None or own.has_origin is not False or not own.armed or not own.wants_extnav.any():
        return
    shown = "no ORGN record" if own.witness is Witness.LOG else "GLOBAL_POSITION_INT is always 0, 0"
    armed_s = total_s(own.armed)
    yield Sighting(
        f"armed for {armed_s:.1f} s, from {at(1e6 * own.armed[0][0])} on, with external navigation as a source and "
        f"without an origin ({shown})",
        start_us=int(1e6 * own.armed[0][0]),
        end_us=int(1e6 * own.armed[-1][1]),
    )
