# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks do not raise, whatever the stream."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.verdict import Verdict
from mav_handlers.verdicts import ALL_VERDICTS
from mav_handlers.wire.messages import ATT_POS_MOCAP, VICON_POSITION_ESTIMATE, VISION_POSITION_DELTA, Message
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.evidences import START_US, changed, evidence_of, pose, seen, speed
from viso.doctor import CHECKS, Evidence, Severity, diagnose
from viso.doctor.evidence.flow_fit import fit_flow
from viso.doctor.evidence.ground_sensors import FlowSeries, GroundSensors, RangeSeries
from viso.doctor.evidence.vehicle_data import AttitudeSeries
from viso.doctor.evidence.vehicle_position import LevelSeries, PositionSeries
from viso.doctor.output.machine_formats import as_json, as_junit, as_sarif
from viso.doctor.output.summary import summarise
from viso.doctor.output.terminal import finding_lines, summary_lines

NUMBERS = st.one_of(
    st.floats(-10, 10, width=32), st.floats(width=32), st.sampled_from([0.0, math.nan, math.inf, -math.inf, 1e30])
)
STAMPS = st.one_of(st.integers(0, 2**64 - 1), st.integers(0, 10**7))
QUATS = st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS)
TRIPLES = st.tuples(NUMBERS, NUMBERS, NUMBERS)
COVARIANCES = st.one_of(st.just((0.0,) * 21), st.tuples(*(NUMBERS,) * 21))


def _of(make: Any, *names: str, **fields: Any) -> st.SearchStrategy[Message]:
    return st.builds(make, STAMPS, **dict.fromkeys(names, NUMBERS), **fields)


MESSAGES = st.one_of(
    _of(
        odometry,
        *("x", "y", "z", "vx", "vy", "vz"),
        q=QUATS,
        pose_covariance=COVARIANCES,
        frame_id=st.integers(0, 255),
        child_frame_id=st.integers(0, 255),
        reset_counter=st.integers(0, 255),
        quality=st.integers(-128, 127),
    ),
    _of(pose, "x", "y", "z", "roll", "pitch", "yaw", covariance=COVARIANCES, reset_counter=st.integers(0, 255)),
    _of(speed, "x", "y", "z"),
    st.builds(ATT_POS_MOCAP, STAMPS, QUATS, NUMBERS, NUMBERS, NUMBERS, COVARIANCES),
    st.builds(VICON_POSITION_ESTIMATE, STAMPS, *(NUMBERS,) * 6),
    st.builds(
        VISION_POSITION_DELTA, STAMPS, st.integers(0, 10**6), st.tuples(*(NUMBERS,) * 3), st.just((0.0,) * 3), NUMBERS
    ),
)
PARAMS = st.dictionaries(
    st.sampled_from(["VISO_TYPE", "VISO_ORIENT", "VISO_DELAY_MS", "VISO_QUAL_MIN", "EK3_SRC1_POSZ", "EK3_SRC1_YAW"]),
    st.integers(-128, 127).map(float),
)
ANY_VERDICT: st.SearchStrategy[Verdict] = st.sampled_from(ALL_VERDICTS)


@pytest.mark.parametrize("count", [0, 1, 40])
def test_checks_and_outputs_take_nonsense(count: int) -> None:
    nowhere = dict.fromkeys(("x", "y", "z", "vx", "vy", "vz"), math.nan)
    messages = [
        seen(number, START_US + number * 40_000, odometry(number % 3, q=(math.inf, 0.0, 0.0, 0.0), **nowhere))
        for number in range(1, count + 1)
    ]
    take(evidence_of(messages))


@pytest.mark.slow
@settings(max_examples=60)
@given(data=st.data(), params=PARAMS, knows_attitude=st.booleans())
def test_checks_and_outputs_take_whatever_comes(
    data: st.DataObject, params: dict[str, float], knows_attitude: bool
) -> None:
    # A few kinds of messages over and over make tracks that are long enough for every check.
    kinds = data.draw(st.lists(st.tuples(MESSAGES, ANY_VERDICT), max_size=8))
    repeats = data.draw(st.integers(1, 30))
    gaps_us = data.draw(st.lists(st.sampled_from([0, 1, 5_000, 40_000, 400_000, 8_000_000]), min_size=1, max_size=4))
    senders = data.draw(st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255)), min_size=1, max_size=2))
    arrival_us, messages = START_US, []
    for number, (message, verdict) in enumerate(kinds * repeats):
        arrival_us += gaps_us[number % len(gaps_us)]
        system, component = senders[number % len(senders)]
        sequence = number * data.draw(st.sampled_from([1, 1, 3])) % 256 if number < 8 else number % 256
        fields = {"system_id": system, "component_id": component, "sequence": sequence, "version": 1 + number % 2}
        messages.append(seen(number + 1, arrival_us, message, verdict, **fields))
    attitude = None
    if knows_attitude:
        times = START_US + np.arange(0, 100) * 50_000
        attitude = AttitudeSeries(times, np.column_stack([np.sin(times * 1e-6 + axis) for axis in range(3)]))
    made = evidence_of(messages, params, attitude)
    if data.draw(st.booleans()):
        times = START_US + np.arange(0, 200) * 50_000
        ned_m = data.draw(st.sampled_from([1.0, 0.0])) * np.column_stack([np.cos(times * 1e-6 + n) for n in range(3)])
        level = LevelSeries("BARO", times, ned_m[:, 2], 1.5)
        made = changed(made, position=PositionSeries("SIM", times, 5 * ned_m, 0.05), level=level)
    take(made)


@pytest.mark.parametrize("count", [1, 2, 60])
@pytest.mark.parametrize("number", [math.nan, math.inf, 1e30, 0.0])
def test_checks_take_nonsense_of_flow_and_ranges(count: int, number: float) -> None:
    time_us, nothing = START_US + np.arange(count) * 40_000, np.zeros(0, np.int64)
    numbers, whole = np.full((count, 2), number), np.zeros(count, np.int64)
    said = FlowSeries("OF", time_us, numbers, numbers, whole + 100, nothing)
    sent = replace(said, numbers=whole, units=numbers, sent_rate=numbers)
    flat = numbers[:, 0]
    ranges = [
        RangeSeries("RFND", status, time_us, flat, flat, flat, whole + status, whole + 25, nothing)
        for status in (-1, 0, 4, 200)
    ]
    moved = np.column_stack([time_us, np.full((count, 3), number)])
    ground = GroundSensors((said, sent), tuple(ranges), moved, moved[:, :3], moved[:, :3])
    level = LevelSeries("BARO", time_us, flat, 1.0)
    attitude = AttitudeSeries(time_us, np.full((count, 3), number))
    position = PositionSeries("SIM", time_us, np.full((count, 3), number))
    with np.errstate(all="ignore"):
        fits = fit_flow(ground, attitude, None, position, uses_flow=False)
    asking = {"EK3_SRC1_VELXY": 5, "EK3_SRC1_POSZ": 2, "FLOW_TYPE": 5}
    take(evidence_of([], asking, attitude, ground=ground, flow_fits=fits, level=level, position=position))


def take(evidence: Evidence) -> None:
    """Let the checks and all outputs take some evidence."""
    findings = diagnose(evidence, CHECKS)
    summary = summarise(evidence)
    json.dumps(as_json(evidence, summary, findings))
    json.dumps(as_sarif("made", "1", CHECKS, findings))
    as_junit("made", CHECKS, findings, Severity.ERROR)
    assert summary_lines(summary)
    assert all(len(list(finding_lines(finding, 80))) >= 4 for finding in findings)
