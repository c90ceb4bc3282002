# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Optical flow: what is expected, what passes, what it changes, and what is known of it near the ground."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
import quaternion

from ekf_stub.filter.inertial import Array, InertialDelta
from ekf_stub.filter.states import ATT, VEL
from ekf_stub.inputs.flow_ingest import FlowMeasurement

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

NOW_MS = 50_000
DELTA = InertialDelta(np.zeros(3), np.zeros(3), 0.0025, 0.0025)
UP = 4.0


def flying(make_parts: MakeParts, sources: str = "05101", **params: float) -> "FilterParts":
    parts = make_parts(sources, **params)
    parts.state.pos = np.array([0.0, 0.0, -UP])
    parts.flow.takeoff_detected = True
    return parts


def step(
    parts: "FilterParts",
    flow: tuple[float, float] | None = (0.0, 0.0),
    *,
    gyro: tuple[float, float] = (0.0, 0.0),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    now_ms: int = NOW_MS,
    is_datum: bool = False,
) -> None:
    """Let a flow, as its sensor measures it, come due and be fused."""
    if flow is not None:
        parts.flow_ingest.write(FlowMeasurement(80, flow, gyro, offset), DELTA, now_ms, 0, 10)
    parts.ingest.horizon_ms = now_ms
    parts.flow.step(now_ms, ground_is_datum=is_datum)


@pytest.mark.parametrize(("vel", "axis", "innovation"), [
    ((0.4, 0.0, 0.0), 1, -0.1),
    ((0.0, 0.4, 0.0), 0, 0.1),
])  # fmt: skip
def test_velocity_over_height_is_expected(
    make_parts: MakeParts, vel: tuple[float, float, float], axis: int, innovation: float
) -> None:
    parts = flying(make_parts)
    parts.state.clear(ATT, 1e-12)
    parts.state.vel = np.array(vel)
    step(parts)
    assert parts.flow.innovations[axis] == pytest.approx(innovation)
    assert parts.flow.innovations[1 - axis] == pytest.approx(0.0, abs=1e-9)
    spread = 0.09 / UP**2
    assert parts.flow.ratios[axis] == pytest.approx(0.01 / (9 * (spread + 0.25**2)), rel=1e-6)
    gain = spread * UP / (spread + 0.25**2)
    assert float(np.abs(parts.state.vel).max()) == pytest.approx(0.4 - gain * 0.1, rel=1e-6)


def test_turning_is_not_taken_for_moving(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    step(parts, (0.5, -0.3), gyro=(0.5, -0.3))
    assert parts.flow.innovations == pytest.approx([0.0, 0.0])
    assert parts.told() == ["fusing optical flow"]


def test_turning_moves_a_sensor_that_is_off_the_imu(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    step(parts, (0.0, 0.8), gyro=(0.0, 0.8), offset=(0.0, 0.0, 1.0))
    assert parts.flow.innovations == pytest.approx([0.0, -0.8 / 3.0])


def test_row_is_how_the_flow_depends_on_the_errors(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    parts.turn_to(0.2, -0.1, 0.7)
    parts.state.vel = np.array([1.0, -2.0, 0.5])

    def predicted() -> Array:
        quat = parts.state.quat
        body = (quat.conjugate() * quaternion.quaternion(0.0, *parts.state.vel.tolist()) * quat).vec
        distance = UP / parts.state.rotation[2, 2]
        flow: Array = np.array([body[1], -body[0]]) / distance
        return flow

    step(parts, None)
    before, rows, quat = predicted(), [], parts.state.quat
    parts.state.fuse_spread = lambda *_: True  # type: ignore[method-assign]
    parts.state.spread_of = lambda row: (rows.append(row), (row, 1.0))[1]  # type: ignore[func-returns-value,method-assign]
    step(parts)
    for index in range(ATT.stop):
        error = np.zeros(4)
        error[index] = 1e-7
        parts.state.quat = quat + quaternion.quaternion(*error)
        slope = (predicted() - before) / 1e-7
        assert [row[index] for row in rows] == pytest.approx(slope.tolist(), abs=1e-5)
    parts.state.quat = quat
    for index in range(3):
        parts.state.vel = np.array([1.0, -2.0, 0.5]) + 1e-6 * np.eye(3)[index]
        slope = (predicted() - before) / 1e-6
        assert [row[VEL.start + index] for row in rows] == pytest.approx(slope.tolist(), abs=1e-6)


def test_flow_beyond_its_gate_is_not_fused(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    step(parts, (2.0, -2.0))
    assert min(parts.flow.ratios) > 1
    assert parts.state.vel.tolist() == [0.0, 0.0, 0.0]
    assert parts.told() == []
    assert parts.aiding.times.flow == 0


@pytest.mark.parametrize(("sources", "params"), [("06101", {}), ("05101", {"FLOW_USE": 2}), ("05101", {"FLOW_USE": 0})])
def test_flow_that_is_not_for_navigation_is_tested_alone(
    make_parts: MakeParts, sources: str, params: dict[str, float]
) -> None:
    parts = flying(make_parts, sources, **params)
    step(parts, (0.1, 0.2))
    assert parts.flow.innovations == pytest.approx([0.1, 0.2])
    assert parts.state.vel.tolist() == [0.0, 0.0, 0.0]
    assert not parts.flow.is_fused


def test_flow_that_turns_too_fast_one_way_round_is_not_fused(make_parts: MakeParts) -> None:
    # Of both, as the firmware compares with the sign.
    parts = flying(make_parts, MAX_FLOW=1.0)
    step(parts, (-1.1, 0.1), gyro=(-1.1, 0.0))
    assert not parts.flow.is_fused
    step(parts, (1.1, 0.1), gyro=(1.1, 0.0), now_ms=NOW_MS + 100)
    assert parts.flow.is_fused


def test_tilted_vehicle_does_not_see_the_ground(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    parts.turn_to(roll=0.8)
    step(parts, (0.1, 0.1))
    assert parts.flow.innovations == [0.0, 0.0]
    assert parts.flow.is_valid


def test_near_the_ground_flow_is_zero_until_take_off(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    parts.state.pos = np.array([0.0, 0.0, -0.4])
    parts.flow.takeoff_detected = False
    step(parts, (0.4, 0.4))
    assert parts.flow.innovations == pytest.approx([0.0, 0.0])
    step(parts, None, now_ms=NOW_MS + 5000)
    assert parts.flow.is_valid
    parts.flow.takeoff_detected = True
    step(parts, None, now_ms=NOW_MS + 5100)
    assert not parts.flow.is_valid


def test_flow_is_valid_for_a_second(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    step(parts)
    step(parts, None, now_ms=NOW_MS + 999)
    assert parts.flow.is_valid
    step(parts, None, now_ms=NOW_MS + 1000)
    assert not parts.flow.is_valid


def test_ground_is_known_for_five_seconds_or_as_datum(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    parts.ranges.is_due, parts.ranges.distance = True, UP
    step(parts, None)
    assert parts.terrain.valid_ms == NOW_MS
    parts.ranges.is_due = False
    for after_ms, is_datum, known in ((4999, False, True), (5000, False, False), (5000, True, True)):
        step(parts, None, now_ms=NOW_MS + after_ms, is_datum=is_datum)
        assert parts.flow.ground_is_valid is known


def test_sensor_on_the_ground_measures_nothing(make_parts: MakeParts) -> None:
    parts = flying(make_parts)
    step(parts, (0.1, 0.1), offset=(0.0, 0.0, UP))
    assert parts.flow.innovations == [0.0, 0.0]
