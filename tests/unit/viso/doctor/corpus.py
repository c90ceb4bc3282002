# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams with exactly known defects: what was done to a clean piece, and the codes that have to name it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Final

import numpy as np

from tests.unit.viso.doctor.evidences import seen_in
from tests.unit.viso.doctor.streams import faulty, piece, shifted
from viso.doctor import VehicleData
from viso.doctor.evidence.tracks import pose_tracks
from viso.doctor.evidence.vehicle_position import LevelSeries, PositionSeries
from viso.streams.stream_kinds import Stream

ODOMETRY: Final = "odometry"
SPEED: Final = "speed"
POSE: Final = "pose"
CLIMB: Final = "climb"
LONG: Final = "long"

_PIECES: Final[Mapping[str, tuple[str, float, float]]] = {
    ODOMETRY: ("flight_t265", 40.0, 12.0),
    SPEED: ("flight_mav_extyaw", 40.0, 12.0),
    POSE: ("flight_mav_extyaw", 40.0, 12.0),
    CLIMB: ("flight_mav_extyaw", 26.5, 12.0),
    LONG: ("flight_mav_extyaw", 30.0, 30.0),
}
_NO_SPEED: Final = {"EK3_SRC1_VELXY": 0.0, "EK3_SRC1_VELZ": 0.0}


@cache
def _sound(base: str, every: int) -> Stream:
    stream = piece(*_PIECES[base], every)
    return faulty(stream, "{kind: fail, messages: VISION_SPEED_ESTIMATE}") if base == POSE else stream


@dataclass(frozen=True, slots=True)
class Case:
    """A stream of the corpus.

    Attributes:
        name: of the defect.
        base: the piece that it is made of.
        faults: of the timeline, in YAML; empty for none.
        expected: codes that must be found.
        params: in place of those that fit.
        knows_attitude: whether the vehicle's own attitude is there.
        delay_s: by how much the stream is older than its stamps say.
        every: of so many messages one is kept.
        place: what a simulator knows of the vehicle's place: "" for nothing, "flown" if it is that of the clean piece,
            "stands" if it never moved.
        first: the code of the worst finding, if that is asked for.
    """

    name: str
    base: str
    faults: str
    expected: frozenset[str]
    params: Mapping[str, float] = field(default_factory=dict)
    knows_attitude: bool = False
    delay_s: float = 0.0
    every: int = 1
    place: str = ""
    first: str = ""

    def stream(self) -> Stream:
        """Return the stream with its defect."""
        stream = _sound(self.base, self.every)
        params = {**stream.params, **(_NO_SPEED if self.base == POSE else {}), **self.params}
        stream = replace(stream, params=params)
        return faulty(stream, self.faults) if self.faults else stream

    def vehicle(self) -> VehicleData:
        """Return what else is known of the vehicle."""
        name, start_s, length_s = _PIECES[self.base]
        known = shifted(name, start_s, delay_s=self.delay_s) if self.knows_attitude else VehicleData()
        if not self.place:
            return known
        (poses,) = pose_tracks(seen_in(piece(name, start_s, length_s)))
        time_us, ned_m = poses.track.arrival_us, poses.pos_m * (self.place == "flown") + np.array([5.0, -3.0, 2.0])
        position = PositionSeries("SIM", time_us, ned_m, 0.05)
        return replace(known, position=position, level=LevelSeries("SIM", time_us, ned_m[:, 2], 0.05))


def _case(name: str, base: str, faults: str, *expected: str, **params: float) -> Case:
    return Case(name, base, faults, frozenset(expected), params)


def _seen(name: str, base: str, faults: str, *expected: str, delay_s: float = 0.0, **params: float) -> Case:
    return Case(name, base, faults, frozenset(expected), params, knows_attitude=True, delay_s=delay_s)


def _placed(name: str, base: str, faults: str, **params: float) -> Case:
    return Case(name, base, faults, frozenset(), params, knows_attitude=True, place="flown")


def _first(name: str, base: str, faults: str, first: str, place: str = "", **params: float) -> Case:
    return Case(name, base, faults, frozenset({first}), params, bool(place), place=place, first=first)


def _turning(*rates_deg_s: float) -> str:
    """Return faults that turn the yaw at some rates, each for 1.5 s."""
    changes = np.diff(rates_deg_s, prepend=0.0).tolist()
    return ", ".join(f"{{kind: drift, yaw_deg_s: {by}, at_s: {1 + 1.5 * n}}}" for n, by in enumerate(changes))


def _wandering(*speeds_m_s: tuple[float, float]) -> str:
    """Return faults that let positions be at the origin, and then go at some speeds, north and east, each for 2 s."""
    changes = np.diff(np.array(speeds_m_s), axis=0, prepend=0.0).tolist()
    moves = [
        f"{{kind: drift, x_m_s: {x}, y_m_s: {y}, at_s: {2 * n}, {_POSE_ONLY}}}" for n, (x, y) in enumerate(changes)
    ]
    return ", ".join([f"{{kind: scale, factor: 0, {_POSE_ONLY}}}", *moves])


def _clock(*factors: float) -> str:
    """Return faults that let the sender's clock run so fast, each for as long as the others."""
    changes = np.diff(factors, prepend=1.0).tolist()
    length_s = 12.0 / len(factors)
    return ", ".join(
        f"{{kind: clock_drift, drift_ppm: {1e6 * by:.0f}, at_s: {length_s * n}}}" for n, by in enumerate(changes)
    )


_POSE_ONLY: Final = "messages: VISION_POSITION_ESTIMATE"
_SPEED_ONLY: Final = "messages: VISION_SPEED_ESTIMATE"

CLEAN: Final = (
    _case("odometry", ODOMETRY, ""),
    _case("pose and speed", SPEED, ""),
    _case("pose alone", POSE, ""),
    _seen("odometry against the vehicle", ODOMETRY, ""),
    _seen("pose and speed against the vehicle", SPEED, ""),
    _case("reset with its counter", ODOMETRY, "{kind: reset, x_m: 3, y_m: -2, yaw_deg: 0, at_s: 6}"),
    _case("a little jitter", ODOMETRY, "{kind: jitter, jitter_ms: 8}"),
    _case("constant delay", SPEED, "{kind: delay, delay_ms: 60}"),
    _case("a lost message now and then", SPEED, "{kind: loss, probability: 0.004}"),
    _case("clock good to 50 ppm", ODOMETRY, "{kind: clock_drift, drift_ppm: 50}"),
    _case("noise of a centimetre", SPEED, "{kind: p_sd, sd_m: 0.01}"),
    _case("frame turned, yaw with it", ODOMETRY, "{kind: yaw, yaw_deg: 70}"),
    _placed("odometry against the vehicle's place", ODOMETRY, ""),
    _placed("pose and speed against the vehicle's place", SPEED, ""),
    _placed("frame turned against the vehicle's place, yaw with it", SPEED, "{kind: yaw, yaw_deg: -120}"),
    _placed("noise of a decimetre against the vehicle's place", SPEED, f"{{kind: p_sd, sd_m: 0.1, {_POSE_ONLY}}}"),
    _placed("climb against the vehicle's place", CLIMB, ""),
)

_BOTH_STAND: Final = frozenset({"XN8-12", "XN8-14"})
_FROZEN: Final = frozenset({"XN8-10", "XN8-11"})

CORPUS: Final = (
    # Transport
    _case("nothing", ODOMETRY, "{kind: fail}", "XN1-01"),
    _case("MAVLink 1", SPEED, "{kind: mavlink1}", "XN1-02"),
    _case("loss of one in ten", ODOMETRY, "{kind: loss, probability: 0.1}", "XN1-03"),
    _case("loss in rows", SPEED, "{kind: loss, probability: 0.02, burst_messages: 4}", "XN1-03"),
    _case("damaged frames", ODOMETRY, "{kind: corrupt, probability: 0.1, bits: 2}", "XN1-04"),
    _case("two senders", SPEED, "{kind: second_sender}", "XN4-06", "XN4-07", "XN1-05"),
    _case("two senders, two clocks", ODOMETRY, "{kind: second_sender, clock_offset_s: 30}", "XN1-05", "XN3-09"),
    _case("own ids", ODOMETRY, "{kind: sender_id, system_id: 1, component_id: 1}", "XN1-06"),
    _case("ground station only", ODOMETRY, "{kind: sender_id, system_id: 7}", "XN1-08", MAV_OPTIONS=1),
    _case("twice", SPEED, "{kind: duplicate, probability: 0.2}", "XN4-06", "XN1-09"),
    _case("out of order", ODOMETRY, "{kind: reorder, delay_ms: 90, probability: 0.1}", "XN1-10"),
    # Frames
    _case("LOCAL_NED and BODY_NED", ODOMETRY, "{kind: frame_ids, frame_id: 1, child_frame_id: 8}", "XN2-01"),
    _case("LOCAL_NED and BODY_FRD", ODOMETRY, "{kind: frame_ids, frame_id: 1, child_frame_id: 12}", "XN2-01"),
    _case("LOCAL_FRD twice", ODOMETRY, "{kind: frame_ids, frame_id: 20, child_frame_id: 20}", "XN2-01"),
    _case("wrong frames now and then", ODOMETRY, "{kind: frame_ids, probability: 0.05}", "XN2-01"),
    _case("vectors in ENU", SPEED, f"{{kind: axes, world_axes: ENU, of: vectors, {_POSE_ONLY}}}", "XN2-04"),
    _case("positions z up", CLIMB, f"{{kind: axes, world_axes: NEU, of: vectors, {_POSE_ONLY}}}", "XN2-04"),
    _case("everything z up", CLIMB, "{kind: axes, world_axes: NWU, body_axes: FLU, of: both}", "XN2-11"),
    _case("velocity in FLU", ODOMETRY, "{kind: axes, body_axes: FLU, of: vectors}", "XN2-04"),
    _seen("attitude in ROS axes", SPEED, "{kind: axes, world_axes: ENU, body_axes: FLU, of: attitude}", "XN2-02"),
    _seen("everything in ROS axes", ODOMETRY, "{kind: axes, world_axes: NWU, body_axes: FLU, of: both}", "XN2-02"),
    _seen("camera looks left", SPEED, "{kind: axes, body_axes: LFD, of: attitude}", "XN2-06"),
    _seen("camera looks down", ODOMETRY, "{kind: axes, body_axes: DRB, of: attitude}", "XN2-06"),
    _case("yaw off by 25 deg", ODOMETRY, "{kind: yawerr, yaw_deg: 25}", "XN2-05"),
    _case("yaw off by -40 deg", ODOMETRY, "{kind: yawerr, yaw_deg: -40}", "XN2-05"),
    _case("quaternion x, y, z, w", ODOMETRY, "{kind: quat_xyzw}", "XN2-10"),
    _seen("quaternion x, y, z, w, against the vehicle", ODOMETRY, "{kind: quat_xyzw}", "XN2-10"),
    # Time
    _case("stamps of zero", ODOMETRY, "{kind: stamp_constant}", "XN3-01"),
    _case("stamps constant", SPEED, "{kind: stamp_constant, stamp_us: 12345678}", "XN3-01"),
    _case("stamps in ms", ODOMETRY, "{kind: stamp_unit, unit: ms}", "XN3-02"),
    _case("stamps in ns", SPEED, "{kind: stamp_unit, unit: ns}", "XN3-02"),
    _case("stamps in s", ODOMETRY, "{kind: stamp_unit, unit: s}", "XN3-02"),
    _case("clock back by 0.4 s", SPEED, "{kind: clock_step, step_ms: -400, at_s: 6}", "XN3-03"),
    _case("clock back by half a minute", ODOMETRY, "{kind: clock_step, step_ms: -30000, at_s: 6}", "XN3-03"),
    _case("clock ahead by 2 s", SPEED, "{kind: clock_step, step_ms: 2000, at_s: 6}", "XN3-04"),
    _case("slow clock", ODOMETRY, "{kind: clock_drift, drift_ppm: -6000}", "XN3-05"),
    _case("fast clock", SPEED, "{kind: clock_drift, drift_ppm: 8000}", "XN3-05"),
    _case("jitter of 150 ms", ODOMETRY, "{kind: jitter, jitter_ms: 150}", "XN3-06"),
    _case("some messages late", SPEED, "{kind: delay, delay_ms: 120, probability: 0.1}", "XN3-06"),
    _case("some messages 0.8 s late", ODOMETRY, "{kind: delay, delay_ms: 800, at_s: 5}", "XN3-07"),
    _case("bunches", ODOMETRY, "{kind: bunch, period_ms: 250}", "XN3-08"),
    _case("delay grows by 80 ms", ODOMETRY, "{kind: delay, delay_ms: 80, start_s: 6}", "XN3-10"),
    _seen("80 ms old", SPEED, "", "XN3-11", delay_s=-0.08),
    _seen("delay set too large", SPEED, "", "XN3-11", VISO_DELAY_MS=150),
    _first("clock 5 % fast", ODOMETRY, _clock(1.05), "XN3-12"),
    _first("clock 10 % fast", SPEED, _clock(1.1), "XN3-12"),
    _first("clock twice as fast", ODOMETRY, _clock(2), "XN3-12"),
    _first("clock thirty times as fast", SPEED, _clock(30), "XN3-12"),
    _first("clock 10 % slow", ODOMETRY, _clock(0.9), "XN3-12"),
    _first("clock of a wall beside a simulation", SPEED, _clock(1.2, 3, 1.6, 5), "XN3-12"),
    _first("clock fast, then slow", ODOMETRY, _clock(1.4, 0.6), "XN3-12"),
    _first(
        "clock set ahead again and again",
        SPEED,
        ", ".join(f"{{kind: clock_step, step_ms: 500, at_s: {1 + 1.7 * number}}}" for number in range(6)),
        "XN3-12",
    ),
    _first("two clocks in turn", ODOMETRY, "{kind: clock_step, step_ms: 3000, probability: 0.4}", "XN3-12"),
    # Rate
    _case("three a second", ODOMETRY, "{kind: rate, rate_hz: 3}", "XN4-01"),
    _case("gap of 0.4 s", SPEED, "{kind: fail, start_s: 5, end_s: 5.4}", "XN4-03"),
    _case("gap of 2 s", ODOMETRY, "{kind: blackout, start_s: 5, end_s: 7}", "XN4-04"),
    _case("gap of 8 s", SPEED, "{kind: fail, start_s: 2, end_s: 10}", "XN4-05"),
    _case("eight a second", ODOMETRY, "{kind: rate, rate_hz: 8}", "XN4-08"),
    # Numbers
    _case("NaN in the position", ODOMETRY, "{kind: nan, fields: [x], start_s: 5, end_s: 6}", "XN5-01"),
    _case("NaN in the attitude", ODOMETRY, "{kind: nan, fields: [q], start_s: 5, end_s: 6}", "XN5-02"),
    _case("NaN in the velocity", SPEED, "{kind: nan, messages: VISION_SPEED_ESTIMATE, probability: 0.1}", "XN5-03"),
    _case("quaternion of length 0.8", ODOMETRY, "{kind: quat_norm, norm: 0.8}", "XN5-05"),
    _case("quaternion of zeros", ODOMETRY, "{kind: quat_norm, norm: 0, start_s: 6}", "XN5-05"),
    _case("degrees", SPEED, "{kind: degrees}", "XN5-06"),
    _case("millimetres", SPEED, f"{{kind: scale, factor: 1000, {_POSE_ONLY}}}", "XN5-07"),
    _case("centimetres", SPEED, f"{{kind: scale, factor: 100, {_POSE_ONLY}}}", "XN5-07"),
    _case("everything in millimetres", ODOMETRY, "{kind: scale, factor: 1000}", "XN5-07"),
    _case("noise floor hides", ODOMETRY, "{kind: covariance, variance: 0.01}", "XN5-09"),
    _case("huge covariance", ODOMETRY, "{kind: covariance, variance: 900}", "XN5-11"),
    _case("scale of 1.3", SPEED, f"{{kind: scale, factor: 1.3, {_POSE_ONLY}}}", "XN5-12"),
    _case("scale of 0.8", SPEED, f"{{kind: scale, factor: 0.8, {_POSE_ONLY}}}", "XN5-12"),
    _case("frozen pose", ODOMETRY, "{kind: frozen, start_s: 4, end_s: 6}", "XN5-13"),
    _case("velocity of zero", SPEED, "{kind: scale, factor: 0, messages: VISION_SPEED_ESTIMATE}", "XN5-14"),
    _case("velocity spikes", SPEED, "{kind: vgli, x_m_s: 6, probability: 0.02}", "XN5-15"),
    _case("velocity off for a second", ODOMETRY, "{kind: vgli, x_m_s: 5, start_s: 5, end_s: 6}", "XN5-16"),
    _case("position drifts", SPEED, "{kind: drift, x_m_s: 0.4}", "XN5-17"),
    # Resets and quality
    _case("jump of 4 m", ODOMETRY, "{kind: reset, x_m: 4, count: 0, at_s: 6}", "XN6-01"),
    _case("glitches of 3 m", SPEED, "{kind: glit, y_m: 3, probability: 0.01}", "XN6-01"),
    _case("yaw jumps", SPEED, "{kind: yawerr, yaw_deg: 40, start_s: 6}", "XN6-02"),
    _case("counter without a jump", ODOMETRY, "{kind: reset, count: 1, at_s: 6}", "XN6-03"),
    _case("counter counts messages", ODOMETRY, "{kind: reset, count: 1, probability: 0.5}, ", "XN6-04"),
    _case("first counter 3, VOXL", ODOMETRY, "{kind: reset, count: 3}", "XN6-05", VISO_TYPE=3),
    _case("quality wraps", ODOMETRY, "{kind: quality, values: [-56]}", "XN6-06"),
    _case("gate against messages without quality", SPEED, "", "XN6-07", VISO_QUAL_MIN=30),
    _case("quality below the gate", ODOMETRY, "{kind: quality, values: [20, 80]}", "XN6-08", VISO_QUAL_MIN=50),
    _case("tracking fails", ODOMETRY, "{kind: quality, values: [-1], start_s: 5, end_s: 8}", "XN6-09"),
    _case("failed samples are fused", ODOMETRY, "{kind: quality, values: [-1, 90]}", "XN6-09", VISO_QUAL_MIN=-1),
    # Parameters
    _case("visual odometry off", ODOMETRY, "", "XN7-01", VISO_TYPE=0),
    _case("no such type", ODOMETRY, "", "XN7-02", VISO_TYPE=7),
    _case("velocity source without velocities", POSE, "", "XN7-03", EK3_SRC1_VELXY=6),
    _case("no source", ODOMETRY, "", "XN7-04", EK3_SRC1_POSXY=3, EK3_SRC1_VELXY=3, EK3_SRC1_VELZ=3, EK3_SRC1_YAW=1),
    _case("illegal source", ODOMETRY, "", "XN7-07", EK3_SRC1_POSZ=5),
    _case("no yaw", SPEED, "", "XN9-03", "XN7-08", EK3_SRC1_YAW=0),
    _case("compass off", ODOMETRY, "", "XN7-08", EK3_SRC1_YAW=1, COMPASS_USE=0),
    _case("vertical velocity alone", SPEED, "", "XN7-09", EK3_SRC1_VELXY=0),
    _case("velocity without a position", SPEED, "", "XN9-02", "XN7-10", EK3_SRC1_POSXY=0),
    _case("EKF2", ODOMETRY, "", "XN7-12", AHRS_EKF_TYPE=2),
    # Alignment, and what comes of it
    _case("T265 without a compass", ODOMETRY, "", "XN8-03", VISO_TYPE=2, EK3_SRC1_YAW=1, COMPASS_USE=0),
    _seen("frame turned by 28 deg", ODOMETRY, "", "XN8-04", EK3_SRC1_YAW=1),
    _first("yaw drifts", ODOMETRY, _turning(8, 8, 8), "XN8-10", "flown"),
    _first("yaw swings", SPEED, _turning(40, -40, -40, 40, 40, -40), "XN8-10", "flown"),
    _first("yaw wanders, with a compass", SPEED, _turning(25, 10, -45, 30, 60, -20), "XN8-10", "flown", EK3_SRC1_YAW=1),
    _first(
        "yaw jumps back and forth",
        SPEED,
        "{kind: yawerr, yaw_deg: 50, start_s: 3, end_s: 5}, {kind: yawerr, yaw_deg: -60, start_s: 7, end_s: 10}",
        "XN8-10",
        "flown",
    ),
    _first("positions that stand", SPEED, f"{{kind: scale, factor: 0.003, {_POSE_ONLY}}}", "XN8-11", "flown"),
    _first(
        "positions that stand in noise",
        SPEED,
        f"{{kind: scale, factor: 0, {_POSE_ONLY}}}, {{kind: p_sd, sd_m: 0.05, {_POSE_ONLY}}}",
        "XN8-11",
        "flown",
    ),
    replace(_first("pose frozen from the start", POSE, "{kind: frozen}", "XN8-10", "flown"), expected=_FROZEN),
    _first(
        "positions that wander by themselves",
        LONG,
        _wandering((1, 0), (0, -1.5), (-0.5, 1), (1, 1), (-1.5, 0), (0, -1), (1.5, 0.5), (-1, 1), (0, 1), (0.5, -2)),
        "XN8-11",
        "flown",
    ),
    _first("positions that sink", POSE, "{kind: drift, z_m_s: 0.5}", "XN8-13", "flown", EK3_SRC1_POSZ=6),
    _first(
        "positions that sink and stand", POSE, f"{_wandering((0, 0))}, {{kind: drift, z_m_s: 2}}", "XN8-11", "flown"
    ),
    replace(_first("everything of a vehicle that stands", ODOMETRY, "", "XN8-12", "stands"), expected=_BOTH_STAND),
    _first("positions of a vehicle that stands", POSE, "", "XN8-12", "stands"),
    _first(
        "velocity always the same",
        LONG,
        f"{{kind: scale, factor: 0, {_SPEED_ONLY}}}, {{kind: vgli, x_m_s: 1.2, {_SPEED_ONLY}}}",
        "XN8-14",
        "flown",
    ),
    _first(
        "velocity of noise",
        LONG,
        f"{{kind: scale, factor: 0, {_SPEED_ONLY}}}, {{kind: v_sd, sd_m_s: 1.5, {_SPEED_ONLY}}}",
        "XN8-15",
    ),
    _case("position glitch rejected", SPEED, "{kind: reset, x_m: 10, count: 0, at_s: 5}", "XN6-01", "XN9-04"),
)
