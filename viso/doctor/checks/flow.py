# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XNF: optical flow, and whether the filter can navigate by it."""

import math
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import SourceXY
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.ground_set_up import (
    FLOW_BIT,
    in_records,
    is_in_flight,
    is_never_armed,
    is_recorded,
    known_param,
    not_heard,
    range_finders,
)
from viso.doctor.checks.phrases import at, how_often, listed, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.flow_fit import FlowFit
from viso.doctor.evidence.ground_sensors import FLOW, RANGE, FlowSeries, rates_by_driver
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import Bools
from viso.doctor.evidence.vehicle_position import SOURCE_SETS
from viso.estimators.series import stretches_of

_MAVLINK: Final = 5
_TO_NAVIGATE: Final = 1
_TERRAIN_ONLY: Final = 2
_LARGEST_DELAY_MS: Final = 127
_LARGEST_SCALER: Final = 800

_LATER: Final = "since 22 July 2025 (in 4.7)"
_BY_PERIOD: Final = (
    "Send flow_x and flow_y as the rate in rad/s divided by the period of the messages in s, with FLOW_FXSCALER and "
    "FLOW_FYSCALER 0. Send them often and evenly: a step of one is as many rad/s as the period has seconds."
)
_BY_RATE: Final = (
    "Send flow_rate_x and flow_rate_y in rad/s, with FLOW_FXSCALER and FLOW_FYSCALER 0: this release takes them as "
    "they are once one is not zero."
)

_MAV_DRIVER: Final = "AP_OpticalFlow_MAV.cpp, AP_OpticalFlow_MAV::update"
_WRITE: Final = "AP_NavEKF3_Measurements.cpp, NavEKF3_core::writeOptFlowMeas"
_FUSE: Final = "AP_NavEKF3_OptFlowFusion.cpp, NavEKF3_core::FuseOptFlow"
_TERRAIN: Final = "AP_NavEKF3_OptFlowFusion.cpp, NavEKF3_core::EstimateTerrainOffset"
_AIDING: Final = "AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode"


def _flow_sets(evidence: Evidence) -> list[int]:
    """Return the source sets that take their velocity from flow."""
    return [number for number in SOURCE_SETS if evidence.source("VELXY", number) == SourceXY.OPTFLOW]


@check(
    code="XNF-01",
    severity=Severity.ERROR,
    title="A source asks for optical flow that is not there",
    firmware=(
        "The filter waits for flow, and does not start to navigate by it; with FLOW_TYPE 0 arming is refused, EK3 "
        "sources require OpticalFlow."
    ),
    source=_AIDING,
    fix=(
        "Set FLOW_TYPE to the sensor that there is (5 for OPTICAL_FLOW over MAVLink) and EK3_FLOW_USE 1, reboot, and "
        "find out why it sends nothing; or set EK3_SRCn_VELXY to a sensor that the vehicle has."
    ),
    witness=Witness.LOG,
)
def flow_missing(evidence: Evidence) -> Iterator[Sighting]:
    sets = _flow_sets(evidence)
    if not sets:
        return
    names = listed([f"EK3_SRC{number}_VELXY" for number in sets])
    severity = None if sets[0] == 1 else Severity.WARNING
    kind, use = known_param(evidence, "FLOW_TYPE"), evidence.set_up.known.get("EK3_FLOW_USE")
    if kind == 0:
        yield Sighting(f"{names} 5 (OptFlow), and FLOW_TYPE is 0", severity=severity)
    elif use is not None and use != _TO_NAVIGATE:
        yield Sighting(f"{names} 5 (OptFlow), and EK3_FLOW_USE is {use:g}: it is not to navigate by", severity=severity)
    elif evidence.vehicle.ground.flows or evidence.vehicle.ground.unread:  # the latter has a check of its own
        return
    elif (found := not_heard(evidence, FLOW, severity)) is not None:
        of = "" if kind is None else f" (FLOW_TYPE {kind:g})"
        yield Sighting(f"{names} 5 (OptFlow), and no flow was heard{of}{found[0]}", severity=found[1])


@check(
    code="XNF-02",
    severity=Severity.WARNING,
    title="Optical flow that nothing uses",
    firmware=(
        "OPTICAL_FLOW reaches a driver only with FLOW_TYPE 5. The filter then fuses it if a source asks for it, or "
        "uses it for the height of the ground with EK3_FLOW_USE 2."
    ),
    source="AP_OpticalFlow.cpp, AP_OpticalFlow::handle_msg",
    fix="Set FLOW_TYPE 5 for flow over MAVLink and reboot, and EK3_SRCn_VELXY 5 to navigate by it.",
    witness=Witness.LOG,
)
def flow_unused(evidence: Evidence) -> Iterator[Sighting]:
    kind, use = known_param(evidence, "FLOW_TYPE"), known_param(evidence, "EK3_FLOW_USE")
    for flow in evidence.vehicle.ground.flows:
        everything = np.ones(len(flow), np.bool_)
        if flow.units is not None and kind is not None and kind != _MAVLINK:
            yield in_records(f"{len(flow)} messages, and FLOW_TYPE is {kind:g}", flow, everything)
        elif (
            not _flow_sets(evidence)
            and use is not None
            and use != _TERRAIN_ONLY
            and "EK3_SRC1_VELXY" in evidence.set_up.known
        ):
            text = f"no EK3_SRCn_VELXY is 5 (OptFlow), and EK3_FLOW_USE is {use:g}"
            yield in_records(text, flow, everything, Severity.NOTE)


@check(
    code="XNF-03",
    severity=Severity.ERROR,
    title="The flow sensor sees nothing",
    firmware="Flow of quality 0 is dropped before the filter; any other quality counts the same.",
    source=_WRITE,
    fix=(
        "Look at light, focus and texture of the ground, and at the height: a camera out of focus, or above a surface "
        "without texture, tracks nothing."
    ),
    witness=Witness.LOG,
)
def flow_quality(evidence: Evidence) -> Iterator[Sighting]:
    for flow in evidence.vehicle.ground.flows:
        flying = is_in_flight(evidence, flow.time_us)
        bad = flying & (flow.quality == 0)
        if bad.sum() > limits.FLOW_BAD_SHARE * flying.sum() and bad.sum() >= limits.FEWEST_FLOW:
            much = bad.sum() > limits.FLOW_VERY_BAD_SHARE * flying.sum()
            text = f"quality is 0 in {share(int(bad.sum()), int(flying.sum()))} measurements"
            yield in_records(text, flow, bad, None if much else Severity.WARNING)


@check(
    code="XNF-04",
    severity=Severity.ERROR,
    title="Optical flow has gaps",
    firmware=(
        "After half a second without flow the sensor is unhealthy, and with FLOW_TYPE 5 the first flow after that "
        "counts as zero; after 5 s the filter stops navigating, if nothing else gives it a velocity. It begins only "
        "while the last flow is younger than 200 ms."
    ),
    source=_AIDING,
    fix="Find out what stops the sensor or its link; send ten measurements per second at least.",
    witness=Witness.LOG,
)
def flow_gaps(evidence: Evidence) -> Iterator[Sighting]:
    for flow in evidence.vehicle.ground.flows:
        if len(flow) < 2:
            continue
        period_us = np.diff(flow.time_us)
        if np.median(period_us) > limits.FLOW_SLOW_US and flow.has_all:
            rate = 1e6 / float(np.median(period_us))
            yield in_records(f"{rate:.1f} measurements per second", flow, np.ones(len(flow), np.bool_))
            continue
        least_us = max(limits.FLOW_UNHEALTHY_US, 3 * float(np.median(period_us)))
        gap = np.append(False, period_us > least_us) & is_in_flight(evidence, flow.time_us)
        if gap.any():
            longest = int(np.argmax(np.where(gap[1:], period_us, 0)))
            took_s, since_us = period_us[longest] * 1e-6, flow.time_us[longest]
            text = (
                f"no flow for more than {1e-6 * least_us:.1f} s, {how_often(int(gap.sum()))}; the longest gap of "
                f"{took_s:.1f} s from {at(since_us)} on"
            )
            stops = (
                period_us[longest] >= limits.FLOW_STOPS_US
                and bool(_flow_sets(evidence))
                and not evidence.source("POSXY")
            )
            severity = None if stops else Severity.WARNING
            yield in_records(text, flow, gap, severity)


def _fits(evidence: Evidence, of: str) -> Iterator[FlowFit]:
    for fit in evidence.flow_fits:
        if fit.of == of and fit.is_judged:
            yield fit


def _over_all_records(fit: FlowFit, text: str, fix: str | None = None, severity: Severity | None = None) -> Sighting:
    """Return a sighting over all records of a sensor."""
    start_us, end_us = (int(time_us) for time_us in fit.flow.time_us[[0, -1]])
    return Sighting(f"{fit.flow.origin}: {text}", (), start_us, end_us, fix, severity)


def _reference_text(fit: FlowFit) -> str:
    """Return the reference of a fit in words."""
    return f"the {'turning' if fit.by_turning else 'velocity over the distance to the ground'} of {fit.by}"


def _has_good_range(evidence: Evidence) -> bool:
    """Return whether a good range is known; without one, the height above the start replaces it."""
    return any(one.looks_down and one.is_good.any() for one in evidence.vehicle.ground.ranges)


def _period_s(flow: FlowSeries) -> float:
    """Return the usual time from one message to the next."""
    return float(np.median(np.diff(flow.time_us))) * 1e-6


def _scaler_text(evidence: Evidence, fit: FlowFit) -> str:
    """Return the scalers that correct a sensor's scale, in words; "" if they do not go so far."""
    factors = fit.factors
    if round((known_param(evidence, "FLOW_ORIENT_YAW") or 0.0) / 9000) % 2:
        factors = factors[::-1]  # the scalers are those of the sensor's own axes
    found = []
    for axis, factor in zip("XY", factors, strict=True):
        now = known_param(evidence, f"FLOW_F{axis}SCALER") or 0.0
        wanted = 1000 * ((1 + 0.001 * now) / factor - 1) if factor else math.inf
        if abs(wanted) > _LARGEST_SCALER:
            return ""
        found.append(f"FLOW_F{axis}SCALER {wanted:.0f}")
    return " and ".join(found)


def _scale_advice(evidence: Evidence, fit: FlowFit) -> str:
    """Return how to correct a sensor's scale, by what the release computes of what is sent, in words."""
    flow, firmware = fit.flow, evidence.set_up.firmware
    if fit.by_turning and max(map(abs, fit.factors)) < limits.FLOW_SCALE_OFF:
        right = "set FLOW_OPTIONS 1"
        if not firmware.reads_flow_rates or flow.units is None:
            right = f"fix it to the frame (FLOW_OPTIONS 1 is for gimbals, {_LATER}, with FLOW_TYPE 5)"
        return (
            "The flow shows the velocity over the ground without the vehicle's turning. If a gimbal holds the sensor, "
            f"{right}; else the sender must not take the turning out."
        )
    scalers = _scaler_text(evidence, fit)
    by_scaler = f", or set {scalers}" if scalers else ": no scaler goes so far"
    if flow.units is None:
        what = "what the sensor says"
        if known_param(evidence, "FLOW_TYPE") == _MAVLINK:
            what = "flow_x of OPTICAL_FLOW times the time between messages"
            if firmware.reads_flow_rates:
                what = f"flow_rate_x of OPTICAL_FLOW (while all rates were 0, {what})"
        return f"Put the sensor right{by_scaler}. {firmware.name} takes {what}, times (1 + FLOW_FXSCALER / 1000)."
    if flow.takes_sent_rate.any():
        return (
            f"{firmware.name} takes flow_rate_x times (1 + FLOW_FXSCALER / 1000) as rad/s, whatever flow_x is: send "
            f"flow_rate_x and flow_rate_y in rad/s, with both scalers 0{by_scaler}."
        )
    right = (
        f"{firmware.name} takes flow_x times the time between messages ({_period_s(flow):.3g} s) times (1 + "
        f"FLOW_FXSCALER / 1000) as rad/s: with both scalers 0 send flow_x and flow_y as rad/s divided by that time"
    )
    if flow.sent_rate is None or not flow.sent_rate.any():
        by_rate = ", or rad/s as flow_rate_x and flow_rate_y" if firmware.reads_flow_rates else ""
        return f"{right}{by_rate}{by_scaler}."
    return f"{right}. Scalers are no cure: {_LATER} they would scale flow_rate_x and flow_rate_y, which count."


@check(
    code="XNF-05",
    severity=Severity.ERROR,
    title="Optical flow of another scale",
    firmware=(
        "The filter reads flow as rad/s. Velocities from it are wrong by the same factor, and what rotation leaves in "
        "the flow looks like motion."
    ),
    source=_FUSE,
    fix=(
        "Send what the release reads as rad/s: flow_rate_x and flow_rate_y, or else flow_x and flow_y times the time "
        "between messages; FLOW_FXSCALER and FLOW_FYSCALER correct the rest, in thousandths."
    ),
    witness=Witness.LOG,
)
def flow_scale(evidence: Evidence) -> Iterator[Sighting]:
    for fit in _fits(evidence, "flow"):
        x, y = fit.factors
        off = max(abs(x - 1), abs(y - 1))
        limit = limits.FLOW_SCALE_FAR_OFF if fit.is_whole and not _has_good_range(evidence) else limits.FLOW_SCALE_OFF
        if off > limit and (fit.by_turning or _has_good_range(evidence)):
            text = f"flow about x is {x:.2f} times, about y {y:.2f} times what {_reference_text(fit)} makes"
            severity = None if off > limits.FLOW_SCALE_FAR_OFF else Severity.WARNING
            yield _over_all_records(fit, f"{text}, in {fit.count} measurements", _scale_advice(evidence, fit), severity)


@check(
    code="XNF-06",
    severity=Severity.ERROR,
    title="Axes of the flow sensor mixed up",
    firmware=(
        "The flow is rotated by FLOW_ORIENT_YAW, and nothing mirrors it. With wrong axes the vehicle's own rotation "
        "counts as motion, and it runs away."
    ),
    source="AP_OpticalFlow_Backend.cpp, OpticalFlow_backend::_applyYaw",
    fix="Set FLOW_ORIENT_YAW to how the sensor is mounted; correct mirrored axes in the sender.",
    witness=Witness.LOG,
)
def flow_axes(evidence: Evidence) -> Iterator[Sighting]:
    for fit in _fits(evidence, "flow"):
        turned = fit.turned_deg
        if fit.is_mirrored:
            fix = "No FLOW_ORIENT_YAW mends that: change the sign, or swap the axes, where the flow is made."
            what = f"its axes are mirrored ({fit.axes})"
        elif abs(turned) > limits.FLOW_TURNED_DEG:
            now = known_param(evidence, "FLOW_ORIENT_YAW") or 0.0
            wanted = 100 * -round((180 - (0.01 * now + turned)) % 360 - 180)
            fix = f"Set FLOW_ORIENT_YAW to about {wanted} (0.01 degrees) if that is how it is mounted."
            what = f"it is turned by {turned % 360:.0f} degrees (clockwise from above)"
        else:
            continue
        yield _over_all_records(fit, f"{what}, as {_reference_text(fit)} shows in {fit.count} measurements", fix)


@check(
    code="XNF-07",
    severity=Severity.WARNING,
    title="EK3_FLOW_DELAY does not fit",
    firmware=(
        "The filter dates flow EK3_FLOW_DELAY and 50 ms before its arrival, as an average over 100 ms. Later flow is "
        "compared with the motion of another moment: rotation looks like velocity."
    ),
    source=_WRITE,
    fix="Set EK3_FLOW_DELAY, at most 127 ms, and reboot.",
    witness=Witness.LOG,
)
def flow_delay(evidence: Evidence) -> Iterator[Sighting]:
    delay_ms = known_param(evidence, "EK3_FLOW_DELAY")
    for fit in _fits(evidence, "flow"):
        if not fit.is_timed or delay_ms is None:
            continue
        late_ms = fit.lag_ms - delay_ms
        if late_ms > limits.FLOW_AVERAGE_MS + limits.FLOW_LATE_MS or late_ms < -limits.FLOW_LATE_MS:
            wanted = min(max(fit.lag_ms - limits.FLOW_AVERAGE_MS, 0.0), float(_LARGEST_DELAY_MS))
            yield _over_all_records(
                fit,
                f"flow comes {fit.lag_ms:.0f} ms after the turning that it shows; EK3_FLOW_DELAY is {delay_ms:.0f}",
                f"Set EK3_FLOW_DELAY to about {wanted:.0f}, at most {_LARGEST_DELAY_MS}, and reboot.",
                Severity.ERROR if late_ms > limits.FLOW_AVERAGE_MS + limits.FLOW_VERY_LATE_MS else None,
            )


@check(
    code="XNF-08",
    severity=Severity.ERROR,
    title="The flow sensor's own gyro disagrees",
    firmware=(
        "The filter subtracts the sensor's body rates from its flow, and learns their bias against its own gyro. Rates "
        "in other axes leave the rotation in the flow."
    ),
    source=_WRITE,
    fix="Look at how the sensor is mounted, and at the driver's axes.",
    witness=Witness.LOG,
)
def flow_gyro(evidence: Evidence) -> Iterator[Sighting]:
    for fit in evidence.flow_fits:
        if fit.of != "gyro" or fit.matrix is None:
            continue
        x, y = fit.factors
        is_off = (
            fit.is_mirrored
            or abs(fit.turned_deg) > limits.FLOW_TURNED_DEG
            or max(abs(x - 1), abs(y - 1)) > limits.FLOW_SCALE_OFF
        )
        if not np.ptp(np.nan_to_num(fit.flow.body), axis=0).any():
            yield _over_all_records(fit, "the sensor's body rates are always the same while the vehicle turns")
        elif fit.is_judged and is_off:
            how = fit.axes if fit.is_mirrored else f"turned by {fit.turned_deg % 360:.0f} degrees"
            size = f"{x:.2f} times as large about x and {y:.2f} times about y"
            yield _over_all_records(fit, f"against the vehicle's gyro the sensor's is {how}, {size}")


@check(
    code="XNF-09",
    severity=Severity.WARNING,
    title="FLOW_TYPE 5 multiplies flow by its period",
    firmware=(
        "It reads flow_x and flow_y of OPTICAL_FLOW, which are integers, and multiplies their mean by the time since "
        "the last flow. So it expects rad/s divided by the period, not tenths of a pixel. flow_rate_x and flow_rate_y "
        f"are read {_LATER}: from the first one on that is not zero they alone count, as they are."
    ),
    source=_MAV_DRIVER,
    fix=_BY_PERIOD,
)
def flow_period(evidence: Evidence) -> Iterator[Sighting]:
    for flow in evidence.vehicle.ground.flows:
        if flow.units is None or len(flow) < limits.FEWEST_FLOW or flow.takes_sent_rate.any():
            continue
        everything = np.ones(len(flow), np.bool_)
        period_s = _period_s(flow)
        if _is_misread(evidence, flow):
            known, factor = _times_sent(flow, _scalers(evidence))
            text = (
                f"of what flow_rate_x and flow_rate_y say {evidence.set_up.firmware.name} takes {factor:.3g} times as "
                f"much; {_LATER} they are taken as they are"
            )
            yield in_records(text, flow, known, Severity.ERROR)
        elif period_s >= limits.FLOW_COARSE_S and flow.units.any():
            text = f"a message every {1e3 * period_s:.0f} ms: flow comes in steps of {period_s:.2f} rad/s"
            severity = None if period_s >= limits.FLOW_VERY_COARSE_S else Severity.NOTE
            fix = _BY_RATE if evidence.set_up.firmware.reads_flow_rates else None
            yield in_records(text, flow, everything, severity, fix)


def _scalers(evidence: Evidence) -> Mapping[str, float]:
    return {name: known_param(evidence, name) or 0.0 for name in ("FLOW_FXSCALER", "FLOW_FYSCALER")}


def _is_misread(evidence: Evidence, flow: FlowSeries) -> bool:
    """Return whether flow_x and flow_y, as they are taken, contradict flow_rate_x and flow_rate_y.

    They do not if they are what the vehicle's motion makes.
    """
    _, factor = _times_sent(flow, _scalers(evidence))
    fits = (fit for fit in _fits(evidence, "flow") if fit.flow is flow)
    is_right = any(max(abs(one - 1) for one in fit.factors) <= limits.FLOW_SCALE_OFF for fit in fits)
    return abs(factor - 1) > limits.FLOW_SCALE_OFF and not is_right


def _times_sent(flow: FlowSeries, scalers: Mapping[str, float]) -> tuple[Bools, float]:
    """Return which messages have flow_rate_x and flow_rate_y, and how many times these are taken by flow_x and flow_y.

    ``scalers`` are FLOW_FXSCALER and FLOW_FYSCALER. The factor is 1 if too few messages have such rates.
    """
    none = np.zeros(len(flow), np.bool_)
    if flow.units is None or flow.sent_rate is None:
        return none, 1.0
    sent, taken = flow.sent_rate, rates_by_driver(flow.units, flow.sent_rate, none, flow.time_us, scalers)
    known = np.asarray(np.isfinite(sent).all(axis=1) & (np.abs(sent).max(axis=1) > 0), dtype=np.bool_)
    size = float((sent[known] ** 2).sum())
    enough = known.sum() >= limits.FEWEST_FLOW
    return known, float((sent[known] * taken[known]).sum()) / size if enough else 1.0


@check(
    code="XNF-10",
    severity=Severity.WARNING,
    title="Flow faster than the filter accepts",
    firmware=(
        "Flow of 4.2 rad/s and more is dropped, and flow above EK3_FLOW_MAX is not fused. Copter's controllers keep "
        "the speed below that for the height that they know."
    ),
    source=_FUSE,
    fix="Fly slower or higher, or set EK3_FLOW_MAX (up to 4.6 EK3_MAX_FLOW) to what the sensor can.",
    witness=Witness.LOG,
)
def flow_too_fast(evidence: Evidence) -> Iterator[Sighting]:
    names = ("EK3_MAX_FLOW", "EK3_FLOW_MAX")
    set_limit = next((value for name in names if (value := evidence.set_up.known.get(name))), limits.FLOW_FUSED_RAD_S)
    limit = min(set_limit, limits.FLOW_DROPPED_RAD_S)
    for flow in evidence.vehicle.ground.flows:
        size = np.nan_to_num(np.abs(flow.rate)).max(axis=1)
        fast = (size > limit) & (flow.quality > 0)
        if fast.sum() > limits.FLOW_BAD_SHARE * len(flow) and fast.sum() >= limits.FEWEST_FLOW:
            text = f"{share(int(fast.sum()), len(flow))} measurements are above {limit:g} rad/s"
            yield in_records(f"{text}, up to {size.max():.1f}", flow, fast)


@check(
    code="XNF-11",
    severity=Severity.ERROR,
    title="Flow stands still while the vehicle moves",
    firmware="Nothing detects repeated values: the filter fuses them as a velocity.",
    source=_FUSE,
    fix="Restart the sensor, and look at its program and link.",
    witness=Witness.LOG,
)
def flow_frozen(evidence: Evidence) -> Iterator[Sighting]:
    turning = evidence.vehicle.ground.turning
    for flow in evidence.vehicle.ground.flows:
        # What a companion sends may be multiplied by a period that varies.
        values = flow.rate if flow.units is None or flow.takes_sent_rate.any() else flow.units
        same = np.append(False, (np.diff(values, axis=0) == 0).all(axis=1))
        same &= np.append(False, np.diff(flow.time_us) < limits.FLOW_UNHEALTHY_US)
        for start, end in stretches_of(same):
            since, until = int(flow.time_us[start - 1]), int(flow.time_us[end - 1])
            inside = (turning[:, 0] >= since) & (turning[:, 0] <= until - limits.FLOW_UNHEALTHY_US)  # flow may be late
            step = 2 * _period_s(flow) if values is flow.units else 0.0
            if (
                until - since < limits.FLOW_FROZEN_US
                or end - start < limits.FEWEST_FLOW
                or inside.sum() < limits.FEWEST_FLOW
            ):
                continue
            if turning[inside, 1:3].std(axis=0).max() > max(limits.FLOW_MOVES_RAD_S, step):
                text = f"the same flow for {1e-6 * (until - since):.1f} s from {at(since)} on, while the vehicle turns"
                yield in_records(text, flow, (flow.time_us >= since) & (flow.time_us <= until))
                break


@check(
    code="XNF-12",
    severity=Severity.ERROR,
    title="Flow without a distance to the ground",
    firmware=(
        "Flow is an angle: velocity is flow times height above the ground. Without a good range the filter does not "
        "know where the ground is; with flow alone it then has no horizontal position, and arming for a mode that "
        "needs one is refused."
    ),
    source=_TERRAIN,
    fix=(
        "Fit a range finder that looks down (RNGFND1_TYPE, RNGFND1_ORIENT 25), whose minimum is below its height on "
        "the ground."
    ),
    witness=Witness.LOG,
)
def flow_without_range(evidence: Evidence) -> Iterator[Sighting]:
    if 1 not in _flow_sets(evidence) or known_param(evidence, "EK3_FLOW_USE") == 0:
        return
    down = [one for one in evidence.vehicle.ground.ranges if one.looks_down]
    if any(one.is_good.any() for one in down):
        return
    alone = None if not evidence.source("POSXY") else Severity.WARNING
    if down:
        yield Sighting(f"EK3_SRC1_VELXY is 5 (OptFlow), and {down[0].origin} told no good range", severity=alone)
    elif range_finders(evidence) == []:
        yield Sighting("EK3_SRC1_VELXY is 5 (OptFlow), and no RNGFNDn_TYPE is set", severity=alone)
    elif (found := not_heard(evidence, RANGE, alone)) is not None:
        text = f"EK3_SRC1_VELXY is 5 (OptFlow), and no range of what looks down was heard{found[0]}"
        yield Sighting(text, severity=found[1])


@check(
    code="XNF-13",
    severity=Severity.ERROR,
    title="The autopilot's own filter rejected flow",
    firmware=(
        "Flow whose test ratio is above 1 is not fused. While that lasts the velocity drifts with the accelerometers."
    ),
    source=_FUSE,
    fix="See the findings about scale, axes, delay and ranges; a shiny or moving ground is rejected as well.",
    leads_to=("XNF", "XNR"),
    alone="Look at the ground: a shiny or moving one is rejected as well. Else record FLOW_RATE and IMU beside it.",
    witness=Witness.LOG,
)
def flow_rejected(evidence: Evidence) -> Iterator[Sighting]:
    check = evidence.vehicle.ground.check
    if not evidence.vehicle.ground.flows or not _flow_sets(evidence) or not len(check):
        return
    flying = is_in_flight(evidence, check[:, 0].astype(np.int64)) & (check[:, 2] > limits.FLYING_M)
    over = flying & (check[:, 1] > 1)
    if over.sum() > limits.FLOW_BAD_SHARE * flying.sum() and over.sum() >= limits.FEWEST_FLOW:
        part = share(int(over.sum()), int(flying.sum()))
        first, last = check[np.flatnonzero(over)[[0, -1]], 0]
        yield Sighting(
            f"the autopilot's own test ratio of flow (XKF5.NI) was above 1 in {part} records in flight",
            start_us=int(first),
            end_us=int(last),
            severity=None if over.sum() > limits.FLOW_VERY_BAD_SHARE * flying.sum() else Severity.WARNING,
        )


@check(
    code="XNF-14",
    severity=Severity.NOTE,
    title="Flow that cannot be judged",
    firmware="No finding here does not mean that the sensor is good.",
    source=_FUSE,
    fix=(
        "Record a flight, or turn the vehicle by hand about roll and pitch over textured ground, with ATTITUDE or IMU "
        "records in the recording; bit 11 of LOG_BITMASK logs flow, bit 4 ranges."
    ),
    witness=Witness.LOG,
)
def flow_not_judged(evidence: Evidence) -> Iterator[Sighting]:
    if is_never_armed(evidence):
        for flow in evidence.vehicle.ground.flows:
            yield Sighting(f"{flow.origin}: quality and gaps: the vehicle is disarmed in the whole recording")
    for fit in evidence.flow_fits:
        if fit.of != "flow":
            continue
        why = fit.why_not
        if not why and not fit.is_judged:
            why = f"the vehicle's motion explains {100 * max(min(fit.explained), 0):.0f} % of the flow, or less"
        if why:
            yield Sighting(f"{fit.flow.origin}: scale, axes and delay: {why}")
            continue
        if not fit.is_timed:
            yield Sighting(f"{fit.flow.origin}: delay: the vehicle turned too smoothly to tell")
        if fit.is_whole and not _has_good_range(evidence):
            yield Sighting(f"{fit.flow.origin}: scale: no range was good, so only one that is far off is told")
    if _flow_sets(evidence) and not evidence.vehicle.ground.flows:
        if not is_recorded(evidence, FLOW_BIT):
            yield Sighting("EK3_SRCn_VELXY is 5 (OptFlow), and LOG_BITMASK does not say that flow is logged (OF)")
        elif evidence.vehicle.ground.health.get(FLOW):
            yield Sighting("SYS_STATUS calls the flow sensor healthy, and its flow is not in the recording")


@check(
    code="XNF-15",
    severity=Severity.ERROR,
    title="Flow in messages that ArduPilot does not read",
    firmware="OPTICAL_FLOW_RAD and HIL_OPTICAL_FLOW have no handler, in any release: they are ignored without a word.",
    source="GCS_Common.cpp, GCS_MAVLINK::handle_message",
    fix=(
        "Send OPTICAL_FLOW instead, with FLOW_TYPE 5: as flow_rate_x and flow_rate_y integrated_x and integrated_y "
        "divided by integration_time_us * 1e-6 (rad/s, of the same signs), as flow_x and flow_y these rates divided by "
        "the period of the messages in s, which earlier releases read, and the quality. Leave FLOW_FXSCALER and "
        "FLOW_FYSCALER at 0. Send the distance as DISTANCE_SENSOR."
    ),
)
def flow_not_read(evidence: Evidence) -> Iterator[Sighting]:
    ground = evidence.vehicle.ground
    has_other = bool(ground.flows or ground.health.get(FLOW)) or known_param(evidence, "FLOW_TYPE") not in (
        None,
        _MAVLINK,
    )
    for one in ground.unread:
        text = f"{len(one)} messages, all ignored" + ("" if has_other else "; no other flow was heard")
        yield in_records(text, one, np.ones(len(one), np.bool_), Severity.NOTE if has_other else None)


@check(
    code="XNF-16",
    severity=Severity.NOTE,
    title="Flow depends on the release",
    firmware=(
        f"OPTICAL_FLOW is read by flow_rate_x and flow_rate_y {_LATER}, once one is not zero, and by flow_x and flow_y "
        "times the period before."
    ),
    source="AP_OpticalFlow_MAV.cpp, AP_OpticalFlow_MAV::handle_msg",
    fix=(
        "Send both, so that every release takes the same: flow_rate_x and flow_rate_y in rad/s, and flow_x and flow_y "
        "as these rates divided by the period of the messages in s, with FLOW_FXSCALER and FLOW_FYSCALER 0. replay "
        "--versus shows what two releases take."
    ),
)
def flow_of_releases(evidence: Evidence) -> Iterator[Sighting]:
    for flow in evidence.vehicle.ground.flows:
        known, factor = _times_sent(flow, {})  # the scalers are the same in all
        if abs(factor - 1) <= limits.FLOW_SCALE_OFF:
            continue
        if flow.takes_sent_rate.any():
            text = f"releases that read flow_x and flow_y, such as 4.6, would take {factor:.3g} times as much"
            yield in_records(text, flow, known)
        elif not _is_misread(evidence, flow):
            times = f"{1 / factor:.3g} times as much" if factor else "other flow"
            yield in_records(
                f"releases that read flow_rate_x and flow_rate_y, such as 4.7, would take {times}", flow, known
            )
