# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XNR: range finders that look down, for height and for the scale of flow."""

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from ekf_stub.ahrs.sources import SourceZ
from ekf_stub.inputs.measurements import DOWNWARD, RangeStatus
from viso.doctor.checks import limits
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.ground_set_up import (
    CTUN_BIT,
    above_start_m,
    in_records,
    is_flight_known,
    is_in_flight,
    is_never_armed,
    is_recorded,
    known_param,
    named,
    not_heard,
    range_finders,
)
from viso.doctor.checks.phrases import at, how_often, listed, share
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.ground_sensors import RANGE, RangeSeries
from viso.doctor.evidence.own_filter import Witness
from viso.doctor.evidence.tracks import Bools
from viso.doctor.evidence.vehicle_position import SOURCE_SETS
from viso.estimators.series import stretches_of

_LATE_US: Final = tuple(range(0, 1_000_001, 50_000))
_READ: Final = "AP_NavEKF3_Measurements.cpp, NavEKF3_core::readRangeFinder"
_HEIGHT: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::selectHeightForFusion"
_STATUS: Final = "AP_RangeFinder_Backend.cpp, AP_RangeFinder_Backend::update_status"
_WHY: Final = {
    RangeStatus.NOT_CONNECTED: "not connected",
    RangeStatus.NO_DATA: "without data",
    RangeStatus.TOO_NEAR: "below the minimum",
    RangeStatus.TOO_FAR: "beyond the maximum",
}


def _range_requests(evidence: Evidence) -> list[str]:
    """Return the parameters that ask for ranges, the first source set first."""
    sets = [f"EK3_SRC{n}_POSZ 2" for n in SOURCE_SETS if evidence.source("POSZ", n) == SourceZ.RANGEFINDER]
    use = evidence.set_up.known.get("EK3_RNG_USE_HGT", -1.0)
    return [*sets, *([f"EK3_RNG_USE_HGT {use:g}"] if use > 0 else [])]


def _looking_down(evidence: Evidence) -> Iterator[RangeSeries]:
    """Yield the range finders that the filter may use: those that look down."""
    for finder in evidence.vehicle.ground.ranges:
        if finder.looks_down and len(finder):
            yield finder


@check(
    code="XNR-01",
    severity=Severity.ERROR,
    title="A source asks for ranges that are not there",
    firmware=(
        "Without a fresh range the filter takes its height from the barometer, without a text; with no range finder "
        "set up arming is refused, EK3 sources require RangeFinder."
    ),
    source=_HEIGHT,
    fix=(
        "Set RNGFND1_TYPE to the sensor that there is (10 for DISTANCE_SENSOR over MAVLink) and RNGFND1_ORIENT 25, and "
        "reboot; or set EK3_SRCn_POSZ to 1 (barometer)."
    ),
    witness=Witness.LOG,
)
def range_missing(evidence: Evidence) -> Iterator[Sighting]:
    asking = _range_requests(evidence)
    if not asking:
        return
    severity = None if asking[0].startswith("EK3_SRC1") else Severity.WARNING
    if range_finders(evidence) == []:
        yield Sighting(f"{listed(asking)}, and no RNGFNDn_TYPE is set", severity=severity)
    elif not evidence.vehicle.ground.ranges and (found := not_heard(evidence, RANGE, severity)) is not None:
        yield Sighting(f"{listed(asking)}, and no range was heard{found[0]}", severity=found[1])


@check(
    code="XNR-02",
    severity=Severity.WARNING,
    title="Ranges that nothing uses",
    firmware=(
        "DISTANCE_SENSOR reaches a range finder with RNGFNDn_TYPE 10 whose RNGFNDn_ORIENT is the message's orientation."
    ),
    source="AP_RangeFinder_MAVLink.cpp, AP_RangeFinder_MAVLink::handle_msg",
    fix="Set RNGFND1_TYPE 10 and RNGFND1_ORIENT 25, reboot, and send orientation 25 (down).",
    witness=Witness.LOG,
)
def range_unused(evidence: Evidence) -> Iterator[Sighting]:
    finders = range_finders(evidence)
    for series in evidence.vehicle.ground.ranges:
        if not series.is_sent or finders is None:
            continue
        everything, orient = np.ones(len(series), np.bool_), int(series.orient[-1])
        ours = [f"RNGFND{finder.number}_ORIENT {finder.orient}" for finder in finders if finder.is_mavlink]
        if not ours:
            yield in_records(f"{len(series)} messages, and no RNGFNDn_TYPE is 10 (MAVLink)", series, everything)
        elif not any(finder.is_mavlink and finder.orient == orient for finder in finders):
            yield in_records(f"they are of orientation {orient}, and there is {listed(ours)}", series, everything)


@check(
    code="XNR-03",
    severity=Severity.ERROR,
    title="The range finder does not look down",
    firmware="The filter uses only ranges of orientation 25 (down), of the first two range finders.",
    source=_READ,
    fix="Set RNGFNDn_ORIENT to 25, and send DISTANCE_SENSOR with orientation 25, if the sensor looks down.",
    witness=Witness.LOG,
)
def range_not_down(evidence: Evidence) -> Iterator[Sighting]:
    ranges = [finder for finder in evidence.vehicle.ground.ranges if len(finder)]
    if not ranges or any(finder.looks_down for finder in ranges):
        return
    wants = bool(_range_requests(evidence)) or any(evidence.source("VELXY", n) == 5 for n in SOURCE_SETS)
    for finder in ranges:
        text = f"orientation {int(finder.orient[-1])}, and none is of orientation {DOWNWARD}"
        yield in_records(text, finder, np.ones(len(finder), np.bool_), None if wants else Severity.NOTE)


def _status_text(series: RangeSeries, mask: Bools) -> str:
    """Return why some ranges were not good, in words, the most frequent reason first."""
    counts = Counter(series.status[mask].tolist())
    return " and ".join(
        f"{share(count, int(mask.sum()))} {_WHY[RangeStatus(status)]}"
        for status, count in counts.most_common()
        if status in _WHY
    )


@check(
    code="XNR-04",
    severity=Severity.ERROR,
    title="No good range at all",
    firmware=(
        "The filter uses only good ranges: between RNGFNDn_MIN and RNGFNDn_MAX, and not older than half a second. A "
        "sensor whose minimum is above its height on the ground gives no range before take-off."
    ),
    source=_STATUS,
    fix=(
        "Set RNGFNDn_MIN below the sensor's height on the ground and RNGFNDn_MAX above the height flown, as far as it "
        "can measure; look at its wires and its scale (RNGFNDn_SCALING, DISTANCE_SENSOR in cm)."
    ),
    witness=Witness.LOG,
)
def range_never_good(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        if not finder.is_good.any():
            everything = np.ones(len(finder), np.bool_)
            wants = bool(_range_requests(evidence)) or evidence.source("VELXY") == 5
            severity = None if wants and len(finder) >= limits.FEWEST_RANGES else Severity.WARNING
            distances = f"{finder.dist_m.min():.2f} to {finder.dist_m.max():.2f} m{_limits_text(evidence, finder)}"
            text = f"no range is good: {_status_text(finder, everything)}, distances {distances}"
            yield in_records(text, finder, everything, severity)


def _limits_text(evidence: Evidence, series: RangeSeries) -> str:
    """Return the limits of a sensor in words; "" if they are not known."""
    if np.isfinite(series.low_m).all() and np.isfinite(series.high_m).all():
        return f", limits {series.low_m[-1]:.2f} and {series.high_m[-1]:.2f} m"
    names = [f"RNGFND{series.instance + 1}_{name}" for name in ("MIN", "MAX")]
    known = [f"{name} {evidence.set_up.known[name]:.2f}" for name in names if name in evidence.set_up.known]
    return "".join(f", {text}" for text in known)


@check(
    code="XNR-05",
    severity=Severity.WARNING,
    title="Ranges are missing in flight",
    firmware=(
        "After half a second without a good range a height by the range finder becomes one by the barometer, with a "
        "jump, and after 5 s the filter no longer knows where the ground is. Copter's surface tracking stops."
    ),
    source=_HEIGHT,
    fix="Look at the sensor's range, at dark, wet or tilted ground, and at its link.",
    witness=Witness.LOG,
)
def range_gaps(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        if not finder.is_good.any():
            continue
        good_us = finder.time_us[finder.is_good]
        bad = ~finder.is_good & is_in_flight(evidence, finder.time_us)
        spans = [(int(finder.time_us[a]), int(finder.time_us[b - 1])) for a, b in stretches_of(bad)]
        period_us = np.diff(finder.time_us)  # telemetry is slower than the sensor
        gaps = np.flatnonzero(
            period_us > max(limits.RANGE_STALE_US, 3 * float(np.median(period_us)) if len(period_us) else 0)
        )
        gaps = gaps[is_in_flight(evidence, finder.time_us[gaps])]
        spans = sorted([*spans, *((int(finder.time_us[i]), int(finder.time_us[i + 1])) for i in gaps)])
        spans = [span for span in spans if span[1] - span[0] >= limits.RANGE_STALE_US and good_us[0] < span[0]]
        if spans:
            longest = max(spans, key=lambda span: span[1] - span[0])
            shown = bad & (finder.time_us >= spans[0][0]) & (finder.time_us <= spans[-1][1])
            how = f" ({_status_text(finder, shown)})" if shown.any() else ""
            in_flight = " in flight" if is_flight_known(evidence) else " (whether in flight is not recorded)"
            only_high = shown.any() and bool((finder.status[shown] == RangeStatus.TOO_FAR).all()) and not len(gaps)
            yield Sighting(
                f"{named(finder)}: no good range for more than 0.5 s{in_flight}, {how_often(len(spans))}; the longest "
                f"time of {1e-6 * (longest[1] - longest[0]):.1f} s from {at(longest[0])} on{how}",
                start_us=spans[0][0],
                end_us=spans[-1][1],
                severity=Severity.NOTE if only_high and not _range_requests(evidence) else None,
            )


@check(
    code="XNR-06",
    severity=Severity.ERROR,
    title="The range stands still while the vehicle climbs",
    firmware="Nothing detects repeated ranges: height, or the scale of flow, is then that of another moment.",
    source=_READ,
    fix="Restart the sensor, and look at its program and link; a sensor measures whatever hangs beneath it.",
    witness=Witness.LOG,
)
def range_stuck(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        height_m = above_start_m(evidence, finder.time_us)
        same = np.append(False, np.diff(finder.dist_m) == 0) & finder.is_good
        for start, end in stretches_of(same):
            known = height_m[start - 1 : end]
            known = known[np.isfinite(known)]
            took_us = int(finder.time_us[end - 1] - finder.time_us[start - 1])
            if took_us >= limits.RANGE_STUCK_US and len(known) and np.ptp(known) > limits.RANGE_STUCK_CLIMB_M:
                shown = np.zeros(len(finder), np.bool_)
                shown[start - 1 : end] = True
                text = (
                    f"{finder.dist_m[start]:.2f} m for {1e-6 * took_us:.1f} s, while the vehicle's height changed by "
                    f"{np.ptp(known):.1f} m"
                )
                yield in_records(text, finder, shown)
                break


@check(
    code="XNR-07",
    severity=Severity.WARNING,
    title="Ranges with outliers",
    firmware=(
        "The filter takes the median of three ranges: a single outlier is lost, two in a row get through, as far as "
        "the gate (EK3_RNG_I_GATE) lets them."
    ),
    source=_READ,
    fix="Look at what the sensor sees: landing gear, propellers, sunlight, dust, or an echo.",
    witness=Witness.LOG,
)
def range_outliers(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        if finder.is_good.sum() < limits.FEWEST_RANGES:
            continue
        chosen = np.flatnonzero(finder.is_good)
        dist_m = finder.dist_m[chosen]
        around = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(dist_m, 4, mode="edge"), 9), axis=1)
        off_m = np.abs(dist_m - around)
        outlier = off_m > np.maximum(limits.OUTLIER_M, limits.OUTLIER_SHARE * around)
        if outlier.sum() >= limits.FEWEST_OUTLIERS and outlier.sum() > limits.OUTLIERS_SHARE * len(dist_m):
            shown = np.zeros(len(finder), np.bool_)
            shown[chosen[outlier]] = True
            text = f"{share(int(outlier.sum()), len(dist_m))} good ranges are off by up to {off_m.max():.1f} m"
            yield in_records(f"{text} from those around them", finder, shown)


@check(
    code="XNR-08",
    severity=Severity.ERROR,
    title="Ranges of another scale than the height",
    firmware="Height by the range finder, and velocity by flow, are wrong by the same factor.",
    source=_HEIGHT,
    fix="Set RNGFNDn_SCALING, or send DISTANCE_SENSOR in cm; uneven ground looks the same.",
    witness=Witness.LOG,
)
def range_scale(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        found = _against_height(evidence, finder)
        if found is None:
            continue
        factor, alike = found
        if alike > limits.RANGE_ALIKE_CORRELATION and abs(factor - 1) > limits.RANGE_SCALE_OFF:
            text = f"ranges grow {factor:.2f} times as much as the vehicle's height (correlation {alike:.2f})"
            yield in_records(text, finder, finder.is_good)


def _against_height(evidence: Evidence, series: RangeSeries, late_us: int = 0) -> tuple[float, float] | None:
    """Return how much ranges grow with the height of ``late_us`` before, and the correlation; None without a climb."""
    height_m = above_start_m(evidence, series.time_us - late_us)
    known = series.is_good & np.isfinite(height_m) & np.isfinite(series.dist_m)
    if (
        known.sum() < limits.FEWEST_RANGES
        or np.ptp(height_m[known]) < limits.RANGE_CLIMB_M
        or np.ptp(series.dist_m[known]) == 0
    ):
        return None
    alike = float(np.corrcoef(series.dist_m[known], height_m[known])[0, 1])
    return float(np.polyfit(height_m[known], series.dist_m[known], 1)[0]), alike


@check(
    code="XNR-10",
    severity=Severity.WARNING,
    title="Ranges come late",
    firmware=(
        "The filter dates a range 25 ms before its arrival. A later one gives the height of another moment while the "
        "vehicle climbs or sinks."
    ),
    source=_READ,
    fix="Send each range at once; look for a filter in the sensor, or a slow link.",
    witness=Witness.LOG,
)
def range_late(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        tried = {late_us: _against_height(evidence, finder, late_us) for late_us in _LATE_US}
        alike = {late_us: found[1] for late_us, found in tried.items() if found is not None}
        if 0 not in alike:
            continue
        late_us = max(alike, key=lambda at_us: alike[at_us])
        # Of what the height does not explain, another time explains most.
        left, left_at_once = 1 - alike[late_us] ** 2, 1 - alike[0] ** 2
        is_clear = alike[late_us] > limits.RANGE_ALIKE_CORRELATION
        is_clear = is_clear and left < limits.RANGE_LATE_UNEXPLAINED * left_at_once
        if late_us >= limits.RANGE_LATE_US and is_clear:
            text = f"ranges follow the vehicle's height about {1e-3 * late_us:.0f} ms later"
            yield in_records(text, finder, finder.is_good)


@check(
    code="XNR-09",
    severity=Severity.NOTE,
    title="Ranges that cannot be judged",
    firmware="No finding here does not mean that the sensor is good.",
    source=_READ,
    fix=(
        "Record a climb of 2 m over even ground, with the vehicle's height in the recording; bit 4 of LOG_BITMASK logs "
        "ranges."
    ),
    witness=Witness.LOG,
)
def range_not_judged(evidence: Evidence) -> Iterator[Sighting]:
    for finder in _looking_down(evidence):
        if is_never_armed(evidence):
            yield Sighting(f"{named(finder)}: gaps: the vehicle is disarmed in the whole recording")
        found = _against_height(evidence, finder)
        if found is None:
            yield Sighting(
                f"{named(finder)}: scale: nothing shows a climb of {limits.RANGE_CLIMB_M:g} m with good ranges"
            )
        elif found[1] <= limits.RANGE_ALIKE_CORRELATION:
            yield Sighting(
                f"{named(finder)}: scale: ranges and height are too little alike (correlation {found[1]:.2f})"
            )
    asks = _range_requests(evidence)
    if asks and not evidence.vehicle.ground.ranges:
        if not is_recorded(evidence, CTUN_BIT) and known_param(evidence, "RNGFND1_TYPE"):
            yield Sighting(f"{listed(asks)}, and LOG_BITMASK does not say that ranges are logged (RFND)")
        elif evidence.vehicle.ground.health.get(RANGE):
            yield Sighting("SYS_STATUS calls the range finder healthy, and its ranges are not in the recording")
