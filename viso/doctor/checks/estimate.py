# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""XN7 and XN9: the vehicle's own estimate: its origin, where it moved at once and why, and what it takes of deltas."""

import math
import re
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from ekf_stub.ahrs.sources import EXTNAV, ROWS, SourceXY
from mav_handlers.wire.messages import SET_GPS_GLOBAL_ORIGIN, VISION_POSITION_DELTA
from viso.doctor.checks import limits
from viso.doctor.checks.alignment import alignment_advice
from viso.doctor.checks.check import Severity, Sighting, check
from viso.doctor.checks.phrases import at, how_often, share
from viso.doctor.evidence.estimate import MOVED_M, TURNED_DEG, Move
from viso.doctor.evidence.evidence import Evidence
from viso.doctor.evidence.own_filter import NOT_KNOWN, POSITION, VELOCITY, OwnFilter, Witness, aiding_texts, source_name
from viso.doctor.evidence.tracks import Floats, Ints
from viso.doctor.evidence.vehicle_position import SOURCE_SETS

_DATUM: Final = (
    "AP_Baro.cpp, AP_Baro::update_field_elevation; AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::resetHeightDatum"
)
_ORIGIN_SET: Final = " origin set"
_GPS_SOURCES: Final = {"POSXY": (3,), "VELXY": (3,), "POSZ": (3,), "VELZ": (3,), "YAW": (2, 3, 8)}
_YAW_TEXTS: Final = re.compile(r".*(yaw reset|yaw aligned.*|yaw alignment complete|yaw re-aligned)$")
_MOST_MOVES: Final = 6


def _texts(evidence: Evidence) -> list[tuple[int, str]]:
    """Return what the recorded vehicle said, or else the one of the trial."""
    own = evidence.vehicle.own_filter
    if own is not None and own.texts:
        return list(own.texts)
    return [(time_us, text) for time_us, _, text in evidence.vehicle.texts or evidence.trial.texts]


def _origin_set_us(evidence: Evidence) -> int | None:
    said = [time_us for time_us, text in _texts(evidence) if text.endswith(_ORIGIN_SET)]
    origin = evidence.vehicle.origin
    return min(said) if said else None if origin is None else origin.time_us


def _source_at(own: OwnFilter | None, name: str, time_us: int) -> int:
    """Return the source of POSXY, VELXY, POSZ or others that the vehicle's filter used at a time, or NOT_KNOWN."""
    if own is None or not len(own.time_us):
        return NOT_KNOWN
    nearest = min(int(np.searchsorted(own.time_us, time_us)), len(own.time_us) - 1)
    return int(own.sources[nearest, ROWS.index(name)])


@check(
    code="XN7-31",
    severity=Severity.ERROR,
    title="An origin is set while the height from external navigation is not zero",
    firmware=(
        "While it is disarmed on the ground, the first origin makes the autopilot set its height to 0 and raise the "
        "origin by the height that it had (Field Elevation Set). The next sample brings that height again: it counts "
        "twice. All releases do so."
    ),
    source=_DATUM,
    fix=(
        "Set the origin before the first pose arrives, or let z begin at 0 on the ground: start the odometry there, or "
        "take its first z off in the sender. Restart the autopilot to be rid of the wrong origin."
    ),
    witness=Witness.LOG,
)
def origin_at_height(evidence: Evidence) -> Iterator[Sighting]:
    set_us, own = _origin_set_us(evidence), evidence.vehicle.own_filter
    if (
        set_us is None
        or evidence.viso_type == 0
        or not _takes_height(evidence, set_us)
        or (own is not None and own.was_armed(set_us))
    ):
        return
    for poses in evidence.stream.poses:
        before = (poses.track.arrival_us < set_us) & (poses.track.arrival_us > set_us - limits.ORIGIN_NEAR_US)
        down_m = poses.pos_m[before, 2]
        down_m = down_m[np.isfinite(down_m)]
        height_m = -float(np.median(down_m)) if len(down_m) else 0.0
        if abs(height_m) > limits.ORIGIN_HEIGHT_M:
            yield Sighting(
                f"{poses.track.sender}: the origin was set at {at(set_us)}, while z was {-height_m:.1f} m and "
                f"EK3_SRC1_POSZ is 6: the height goes from {height_m:.1f} to {2 * height_m:.1f} m above the altitude "
                f"given for the origin, which is raised by {height_m:.1f} m itself",
                start_us=set_us,
                severity=None if abs(height_m) > limits.ORIGIN_FAR_M else Severity.WARNING,
            )
            return


def _takes_height(evidence: Evidence, time_us: int) -> bool:
    source = _source_at(evidence.vehicle.own_filter, "POSZ", time_us)
    return (evidence.source("POSZ") if source == NOT_KNOWN else source) == EXTNAV


@check(
    code="XN7-32",
    severity=Severity.WARNING,
    title="The GPS sets the origin, though no source is GPS",
    firmware=(
        "A GPS with a good fix sets the EKF's origin whatever the sources are. An origin that a client sets afterwards "
        "is refused, by SET_GPS_GLOBAL_ORIGIN without any answer."
    ),
    source="AP_NavEKF3_Measurements.cpp, NavEKF3_core::readGpsData; AP_NavEKF3.cpp, NavEKF3::setOriginLLH",
    fix=(
        "To have an origin of your own, set GPS1_TYPE 0 (and SERIALn_PROTOCOL of the GPS to something else), or send "
        "SET_GPS_GLOBAL_ORIGIN before the first fix; look at GPS_GLOBAL_ORIGIN for the one that counts."
    ),
    witness=Witness.LOG,
)
def origin_of_gps(evidence: Evidence) -> Iterator[Sighting]:
    origin, set_us = evidence.vehicle.origin, _origin_set_us(evidence)
    if not evidence.is_concerned or origin is None or set_us is None or _names_gps(evidence):
        return
    asked = [one.arrival_us for one in evidence.stream.messages if isinstance(one.message, SET_GPS_GLOBAL_ORIGIN)]
    earlier, later = ([time for time in asked if (time <= set_us) is is_before] for is_before in (True, False))
    if not origin.is_of_gps or earlier:
        return
    ignored = f"; SET_GPS_GLOBAL_ORIGIN at {at(later[0])} came too late and changed nothing" if later else ""
    yield Sighting(
        f"the EKF's origin was set at {at(set_us)} to where the GPS was ({origin.lat_deg:.5f}, {origin.lng_deg:.5f}), "
        f"and no source set names the GPS{ignored}",
        start_us=set_us,
        severity=None if later else Severity.NOTE,
    )


def _names_gps(evidence: Evidence) -> bool:
    return any(evidence.source(name, n) in gps for n in SOURCE_SETS for name, gps in _GPS_SOURCES.items())


@check(
    code="XN7-33",
    severity=Severity.WARNING,
    title="A GPS gives external navigation its accuracies",
    firmware=(
        "4.6 weighs and gates positions and velocities of external navigation by the accuracies that a GPS reports, as "
        "long as it reports some, also where no source is GPS. 4.7 takes those of the messages and VISO_ parameters."
    ),
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseVelPosNED",
    fix="Indoors set GPS1_TYPE 0; or fly 4.7, which keeps the two apart.",
    witness=Witness.LOG,
)
def accuracies_of_gps(evidence: Evidence) -> Iterator[Sighting]:
    fixes = evidence.vehicle.fixes
    uses = EXTNAV in (evidence.source("POSXY"), evidence.source("VELXY"))
    if not (evidence.set_up.firmware.ekf.weighs_as_gps and uses and evidence.stream.vision and len(fixes)):
        return
    begin_us, end_us = evidence.stream.vision[0].arrival_us, evidence.stream.end_us
    beside = (fixes.time_us >= begin_us) & (fixes.time_us <= end_us)
    if np.count_nonzero(beside) >= limits.FEWEST_FIXES:
        accuracy = fixes.accuracy_m[beside]
        accuracy = accuracy[np.isfinite(accuracy)]
        how = f", and reports {np.median(accuracy):.1f} m in the middle" if len(accuracy) else ""
        yield Sighting(
            f"a GPS has a 3D fix while external navigation comes, from {at(fixes.time_us[beside][0])} on{how}: "
            "external navigation is weighed by that",
            start_us=int(fixes.time_us[beside][0]),
            severity=None if not len(accuracy) or float(np.median(accuracy)) > limits.GPS_COARSE_M else Severity.NOTE,
        )


class _Reason(NamedTuple):
    """Why an estimate moved, in words, and what to do."""

    text: str
    fix: str
    severity: Severity | None = None


def _reason(evidence: Evidence, move: Move) -> _Reason:
    """Return why an estimate moved: what the vehicle or the stream did just before."""
    own = evidence.vehicle.own_filter
    near = [
        (time_us, text)
        for time_us, text in _texts(evidence)
        if move.before_us - limits.MOVE_AFTER_US <= time_us <= move.after_us + limits.MOVE_SAID_US
    ]
    if (switched := _switch(own, move)) is not None:
        return _Reason(f"as the source set was switched, from {switched[0]} to {switched[1]}", _switch_fix(evidence))
    for _, text in near:
        if text.startswith("Using EKF Source Set"):
            return _Reason(f'as the source set was switched ("{text}")', _switch_fix(evidence))
    if any(_YAW_TEXTS.match(text) for _, text in near) and abs(move.yaw_deg) > TURNED_DEG:
        said = next(text for _, text in near if _YAW_TEXTS.match(text))
        return _Reason(f'by a reset of the yaw ("{said}")', _YAW_FIX)
    began = [text for _, _, text in aiding_texts(near) if text != "initialised"]
    if began and began[0] == "stopped aiding":
        return _Reason('as it stopped aiding ("stopped aiding")', "Keep the stream alive: see the findings about gaps.")
    if began:
        return _Reason(f'as aiding started ("{began[0]}")', _start_fix(evidence, move))
    if any(text.startswith("Field Elevation") or text.endswith(_ORIGIN_SET) for _, text in near):
        return _Reason("as the origin was set", "See XN7-31: set the origin before the first pose, or where z is 0.")
    if any("lane switch" in text for _, text in near):
        return _Reason("as the filter changed its core", "Compare the cores: see XN9-14.")
    if _counter_changed(evidence, move):
        return _Reason("as the stream's reset counter changed, which the filter follows", _RESET_FIX, Severity.WARNING)
    source = _source_at(own, "POSXY", move.after_us)
    if source == int(SourceXY.GPS):
        return _Reason("by a reset to the GPS, which it had rejected or missed for 7 s", _GPS_FIX)
    return _Reason(
        f"by a reset to {source_name(POSITION, source)}, after a time without samples or with samples beyond the gate",
        "Look at the test ratios (XKF4) and at gaps in the 10 s before: a stream that jumps, comes late or stops is "
        "taken up again with a jump. Increment reset_counter when it jumps.",
    )


_GPS_FIX: Final = (
    "Find out which of the two was right. Where a GPS may lie or fail, fly on the source set of external navigation "
    "(auxiliary function 90), and set EK3_GPS_CHECK and EK3_GLITCH_RAD; indoors GPS1_TYPE 0."
)
_YAW_FIX: Final = "Look which yaw was right: by compass do without motors' and iron's fields, or take EK3_SRC1_YAW 6."
_RESET_FIX: Final = "Nothing, if the map was re-localised; else keep the frame over a loss of tracking."


def _start_fix(evidence: Evidence, move: Move) -> str:
    own_height = evidence.source("POSZ") != EXTNAV
    if own_height and abs(move.down_m) > move.level_m:
        return (
            "Let z begin at 0 on the ground. Up to 4.7 the start of aiding takes the stream's z as the height even if "
            "EK3_SRC1_POSZ is another source; 2026-04 asks POSZ."
        )
    return "Let the stream begin before take-off, near 0 and where the vehicle is; do not start it in flight."


def _switch(own: OwnFilter | None, move: Move) -> tuple[str, str] | None:
    """Return the sources of position or velocity before and after, if they are known and changed about a move."""
    first, second = (
        (_source_at(own, "POSXY", time_us), _source_at(own, "VELXY", time_us))
        for time_us in (move.before_us - limits.MOVE_AFTER_US, move.after_us + limits.MOVE_SAID_US)
    )
    if first == second or NOT_KNOWN in (*first, *second):
        return None
    return _sources_text(*first), _sources_text(*second)


def _sources_text(position: int, velocity: int) -> str:
    if position == SourceXY.NONE:
        return f"velocity by {source_name(VELOCITY, velocity)}"
    return f"position by {source_name(POSITION, position)}"


def _switch_fix(evidence: Evidence) -> str:
    return (
        "Let both sources count from one place: start the camera where the vehicle's origin is, or shift the stream in "
        f"the sender to LOCAL_POSITION_NED before the switch. {alignment_advice(evidence)}"
    )


def _counter_changed(evidence: Evidence, move: Move) -> bool:
    for poses in evidence.stream.poses:
        near = np.abs(poses.track.arrival_us[1:] - move.after_us) < limits.MOVE_AFTER_US
        if (np.diff(poses.reset_counter)[near] != 0).any():
            return True
    return False


def _move_text(move: Move) -> str:
    """Return how far a move went in each way that counts, with the places before and after; "" if in none."""
    parts = []
    (north, east, down, yaw), (north_after, east_after, down_after, yaw_after) = move.before, move.after
    if move.level_m > MOVED_M:
        places = f"from ({_m(north)}, {_m(east)}) to ({_m(north_after)}, {_m(east_after)}) m north and east"
        parts.append(f"{move.level_m:.1f} m horizontally, {places}")
    if abs(move.down_m) > MOVED_M:
        parts.append(f"{abs(move.down_m):.1f} m in height, from {_m(-down)} to {_m(-down_after)} m")
    if math.isfinite(move.yaw_deg) and abs(move.yaw_deg) > TURNED_DEG:
        parts.append(f"{abs(move.yaw_deg):.0f} deg in yaw, from {yaw:.0f} to {yaw_after:.0f} deg")
    return " and ".join(parts)


def _m(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}"


@check(
    code="XN9-31",
    severity=Severity.ERROR,
    title="The vehicle's own estimate jumped",
    firmware=(
        "The estimate moves at once when a source set is switched, aiding starts or stops, the yaw or the position is "
        "reset. The controllers follow it; in position modes the vehicle flies to where it now thinks its target is."
    ),
    source=(
        "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::ResetPosition; AP_NavEKF3_Control.cpp, NavEKF3_core::setAidingMode"
    ),
    fix="Let all sources count from one place and one north, and let the stream begin before take-off.",
    witness=Witness.LOG,
)
def estimate_jumped(evidence: Evidence) -> Iterator[Sighting]:
    own = evidence.vehicle.own_filter
    if own is None or not evidence.is_concerned:
        return
    described = [(move, _move_text(move)) for move in evidence.vehicle.moves]
    moves = sorted((one for one in described if one[1]), key=lambda one: -_size(one[0]))
    for move, text in sorted(moves[:_MOST_MOVES], key=lambda one: one[0].after_us):
        reason, armed = _reason(evidence, move), own.was_armed(move.after_us)
        is_large = move.level_m > limits.MOVE_FAR_M or abs(move.down_m) > limits.MOVE_FAR_M
        severity = Severity.NOTE if not armed else reason.severity if is_large else Severity.WARNING
        yield Sighting(
            f"at {at(move.after_us)}, {'armed' if armed else 'disarmed'}, the estimate moved by {text}, {reason.text}",
            start_us=move.before_us,
            end_us=move.after_us,
            fix=reason.fix,
            severity=severity,
        )
    if len(moves) > _MOST_MOVES:
        yield Sighting(
            f"the estimate moved {how_often(len(moves))} in all; the largest {_MOST_MOVES} are named",
            severity=Severity.NOTE,
        )


def _size(move: Move) -> float:
    yaw_deg = abs(move.yaw_deg) if math.isfinite(move.yaw_deg) else 0.0
    return max(move.level_m, abs(move.down_m), yaw_deg / limits.MOVE_DEG_OF_M)


@check(
    code="XN9-32",
    severity=Severity.ERROR,
    title="Deltas of zero with confidence while the vehicle moves",
    firmware=(
        "VISION_POSITION_DELTA becomes a velocity in three axes, weighed by its confidence alone. Zeros are fused as "
        "standing still, and the vertical part is fused whatever EK3_SRC1_VELZ is."
    ),
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::SelectBodyOdomFusion and FuseBodyVel",
    fix=(
        "Send no delta while the sensor has no lock, or give it the confidence 0; fill in all three axes, also z, as "
        "the vehicle's own forward, right and down."
    ),
    witness=Witness.LOG,
)
def zero_deltas(evidence: Evidence) -> Iterator[Sighting]:
    deltas = [one for one in evidence.stream.vision if isinstance(one.message, VISION_POSITION_DELTA)]
    sure = [one for one in deltas if _is_sure_zero(one.message)]
    if len(sure) < limits.FEWEST_DELTAS:
        return
    times_us = np.array([one.arrival_us for one in sure], dtype=np.int64)
    speed = _speed_of_others(evidence, times_us)
    moving = speed > limits.DELTA_MOVES_M_S
    if np.count_nonzero(moving) >= limits.FEWEST_DELTAS:
        chosen = [one for one, moves in zip(sure, moving.tolist(), strict=True) if moves]
        yield Sighting.in_messages(
            f"{share(len(sure), len(deltas))} deltas are exactly zero, with a confidence above 0, and in {len(chosen)} "
            f"of them the vehicle moves, at {float(np.median(speed[moving])):.1f} m/s in the middle",
            chosen,
        )
    elif len(sure) > limits.ZERO_DELTAS_SHARE * len(deltas):
        yield Sighting.in_messages(
            f"{share(len(sure), len(deltas))} deltas are exactly zero, with a confidence above 0: a sensor that "
            "measures has noise",
            sure,
            severity=Severity.WARNING,
        )


def _is_sure_zero(message: object) -> bool:
    if not isinstance(message, VISION_POSITION_DELTA):
        return False
    return message.confidence > 0 and not any(message.position_delta)


def _speed_of_others(evidence: Evidence, times_us: Ints) -> Floats:
    """Return how fast the vehicle moves by other sources, vertically, or by its filter (XKFD); 0 if none shows it."""
    speed = np.zeros(len(times_us))
    position, level, height = evidence.vehicle.position, evidence.vehicle.level, evidence.vehicle.height
    if position is not None and len(position.time_us) > 1:
        ned = np.nan_to_num(position.ned_m)
        speed = np.maximum(speed, _rate(position.time_us, ned, times_us))
    for series in (level, height):
        if series is not None and len(series.time_us) > 1:
            speed = np.maximum(speed, _rate(series.time_us, series.down_m[:, None], times_us))
    odometry = evidence.vehicle.odometry
    if len(odometry):  # a delta of zero is off by the speed that the filter has
        latest = np.searchsorted(odometry[:, 0], times_us + limits.MOVE_SAID_US, side="right") - 1
        near = (latest >= 0) & (np.abs(odometry[latest, 0] - times_us) < limits.DELTA_OVER_US)
        speed = np.maximum(speed, np.where(near, odometry[latest, 1], 0.0))
    return speed


def _rate(time_us: Ints, places: Floats, at_us: Ints) -> Floats:
    half_us = limits.DELTA_OVER_US // 2
    moved = [
        np.interp(at_us + half_us, time_us, column) - np.interp(at_us - half_us, time_us, column) for column in places.T
    ]
    return np.asarray(np.linalg.norm(np.column_stack(moved), axis=1) / (2e-6 * half_us), dtype=np.float64)


@check(
    code="XN9-33",
    severity=Severity.NOTE,
    title="Vertical parts of deltas are fused",
    firmware="The three axes of VISION_POSITION_DELTA are fused together, whatever EK3_SRC1_VELZ is.",
    source="AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::FuseBodyVel",
    fix="Fill in z as measured; a sensor that cannot measure it (a wheel, a flat map) pulls the height to rest.",
    witness=Witness.LOG,
)
def vertical_deltas(evidence: Evidence) -> Iterator[Sighting]:
    deltas = [one.message for one in evidence.stream.vision if isinstance(one.message, VISION_POSITION_DELTA)]
    if len(deltas) >= limits.FEWEST_DELTAS and evidence.source("VELXY") == EXTNAV and evidence.source("VELZ") != EXTNAV:
        flat = sum(delta.position_delta[2] == 0 for delta in deltas)
        zero = f"; z is exactly 0 in {share(flat, len(deltas))}" if flat else ""
        yield Sighting(f"{len(deltas)} deltas, EK3_SRC1_VELXY is 6 and VELZ {evidence.source('VELZ')}{zero}")
