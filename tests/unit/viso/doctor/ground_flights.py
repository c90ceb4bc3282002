# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight with a flow sensor and a range finder, as a companion sends them, beside the vehicle's own telemetry."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Final, NamedTuple

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    ATTITUDE,
    DISTANCE_SENSOR,
    GLOBAL_POSITION_INT,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    OPTICAL_FLOW,
    PARAM_VALUE,
    VISION_POSITION_ESTIMATE,
    Message,
)
from viso.doctor import CHECKS, Evidence, Finding, diagnose, gather
from viso.faults import inject, parse_timeline
from viso.firmware.releases import Firmware
from viso.streams.stream import Stream, StreamMessage

SET_UP: Final[Mapping[str, float]] = {
    "AHRS_EKF_TYPE": 3,
    "EK3_ENABLE": 1,
    "FLOW_TYPE": 5,
    "FLOW_ORIENT_YAW": 0,
    "EK3_FLOW_DELAY": 10,
    "EK3_FLOW_USE": 1,
    "EK3_SRC1_POSXY": 0,
    "EK3_SRC1_VELXY": 5,
    "EK3_SRC1_POSZ": 1,
    "EK3_SRC1_VELZ": 0,
    "EK3_SRC1_YAW": 1,
    "RNGFND1_TYPE": 10,
    "RNGFND1_ORIENT": 25,
    "RNGFND1_MIN": 0.05,
    "RNGFND1_MAX": 30,
}
START_US: Final = 30_000_000
LENGTH_S: Final = 24.0
FLOW_S: Final = 0.04
_STEP_S: Final = 0.02
_ARMED: Final = 128

Timed = tuple[int, bytes]


class State(NamedTuple):
    """Height in m, roll, pitch and their rates, velocity north and east in m/s, place in m; the nose points north."""

    height_m: float
    roll: float
    pitch: float
    rates: tuple[float, float]
    ahead: float
    right: float
    place: tuple[float, float] = (0.0, 0.0)


def state_at(time_s: float) -> State:
    """Return how the vehicle stands for 3 s, climbs to 3 m, and then wanders about."""
    flown = max(time_s - 3.0, 0.0)
    height = min(0.1 + 1.0 * flown, 3.0)
    if not flown:
        return State(height, 0.0, 0.0, (0.0, 0.0), 0.0, 0.0)
    roll, pitch = 0.15 * math.sin(2.1 * flown), 0.12 * math.sin(3.1 * flown) + 0.05 * math.sin(1.3 * flown)
    rates = 0.315 * math.cos(2.1 * flown), 0.372 * math.cos(3.1 * flown) + 0.065 * math.cos(1.3 * flown)
    place = 0.8 / 0.9 * (1 - math.cos(0.9 * flown)), 0.6 / 0.7 * (math.cos(1) - math.cos(0.7 * flown + 1))
    return State(height, roll, pitch, rates, 0.8 * math.sin(0.9 * flown), 0.6 * math.sin(0.7 * flown + 1), place)


def flow_at(time_s: float) -> OPTICAL_FLOW:
    """Return what a flow sensor sends that knows what AP_OpticalFlow_MAV takes."""
    state, stamp_us = state_at(time_s), round(1e6 * time_s)
    range_m = state.height_m / (math.cos(state.roll) * math.cos(state.pitch))
    x, y = state.rates[0] - state.right / range_m, state.rates[1] + state.ahead / range_m
    return OPTICAL_FLOW(stamp_us, 0, round(x / FLOW_S), round(y / FLOW_S), 0.0, 0.0, 180, state.height_m)


def range_at(time_s: float) -> DISTANCE_SENSOR:
    """Return what a range finder sends."""
    state = state_at(time_s)
    range_m = state.height_m / (math.cos(state.roll) * math.cos(state.pitch))
    noise_cm = round(50 * time_s) % 3 - 1
    return DISTANCE_SENSOR(round(1e3 * time_s), 5, 3000, round(100 * range_m) + noise_cm, 0, 1, 25, 0)


def _said(time_s: float, tick: int) -> Iterable[tuple[int, Message]]:
    """Yield what is said at a time, and by which component."""
    state, boot_ms = state_at(time_s), round(1e3 * time_s)
    if tick % 50 == 0:
        yield 1, HEARTBEAT(2, 3, _ARMED * (time_s > 2), 0, 4, 3)
    if tick % 2 == 0:
        yield 1, ATTITUDE(boot_ms, state.roll, state.pitch, 0.0, *state.rates, 0.0)
        yield 197, flow_at(time_s)
        north, east = state.place
        angles = state.roll, state.pitch, 0.0
        yield 197, VISION_POSITION_ESTIMATE(round(1e6 * time_s), north, east, -state.height_m, *angles)
    if tick % 5 == 0:
        yield 198, range_at(time_s)
        yield 1, LOCAL_POSITION_NED(boot_ms, 0.0, 0.0, 0.1 - state.height_m, state.ahead, state.right, 0.0)
        above_mm = round(1e3 * (state.height_m - 0.1))
        yield 1, GLOBAL_POSITION_INT(boot_ms, 0, 0, above_mm, above_mm, 0, 0, 0, 0)


@cache
def _flown() -> list[tuple[str, Timed]]:
    """Return the names of the flight's messages, with their frames and times in us."""
    codecs = {component: Codec(1, component) for component in (1, 197, 198)}
    return [
        (type(message).__name__, (START_US + round(1e6 * tick * _STEP_S), codecs[component].encode(message)))
        for tick in range(round(LENGTH_S / _STEP_S))
        for component, message in _said(tick * _STEP_S, tick)
    ]


def flight(
    params: Mapping[str, float] | None = None, *, without: Sequence[str] = ("VISION_POSITION_ESTIMATE",)
) -> list[Timed]:
    """Return the frames of the flight, with their times in us; parameters come first, all of them."""
    codec = Codec(1, 1)
    told = {**SET_UP, **(params or {})}
    frames = [(START_US, codec.encode(HEARTBEAT(2, 3, 0, 0, 4, 3)))]
    for index, (name, value) in enumerate(told.items()):
        frames.append((START_US, codec.encode(PARAM_VALUE(name, value, 9, len(told), index))))
    return [*frames, *(timed for name, timed in _flown() if name not in without)]


def with_fault(frames: Sequence[Timed], fault: str) -> list[Timed]:
    """Return frames with a fault of ``viso faults`` in them."""
    return list(inject(frames, parse_timeline(f"faults: [{{{fault}}}]")))


def evidence_of(frames: Iterable[Timed], firmware: Firmware | None = None) -> Evidence:
    """Return what the doctor gathers of frames, as a release takes them."""
    stream = Stream("made", tuple(StreamMessage(time_us, frame) for time_us, frame in frames))
    return gather(stream, firmware=firmware, is_tried=False)


def findings_of(evidence: Evidence) -> list[Finding]:
    """Return what is found about flow and ranges."""
    return diagnose(evidence, [check for check in CHECKS if check.family in ("XNF", "XNR")])
