# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the autopilot believed becomes a motion that sensors can feel."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import quaternion

from tests.unit.viso.vehicle.sensors.flown.made import Array, log_of
from viso.geometry.rotation import quats_from_euler
from viso.vehicle.sensors.flight import PASS_US, Basis, Flight
from viso.vehicle.sensors.flown.estimates import VELOCITY_SIGMA, estimates, smoothed

GRAVITY = 9.80665
RADIUS_M, TURN = 2.0, 0.8  # rad/s


def motion(time_s: npt.NDArray[Any]) -> tuple[Array, Array, Array]:
    """Return position, velocity and angles [N, 3] of a vehicle on a circle, its nose ahead, climbing and descending."""
    phase = TURN * time_s
    height = 0.5 * np.sin(0.7 * time_s)
    pos = np.column_stack([RADIUS_M * np.sin(phase), -RADIUS_M * np.cos(phase), -height])
    vel = np.column_stack(
        [RADIUS_M * TURN * np.cos(phase), RADIUS_M * TURN * np.sin(phase), -0.35 * np.cos(0.7 * time_s)]
    )
    angles = np.column_stack([np.full_like(phase, 0.13), 0.05 * np.sin(phase), phase])
    return pos, vel, angles


TIMES_S = np.arange(3.0, 10.0, 0.1)


def records(pos: Array, vel: Array, angles: Array, times_s: Array = TIMES_S) -> dict[str, list[list[float]]]:
    quats = quats_from_euler(angles)
    times_us = 1e6 * times_s
    return {
        "XKF1": [[t, 0, *v, *p] for t, v, p in zip(times_us, vel.tolist(), pos.tolist(), strict=True)],
        "XKQ": [[t, 0, *q] for t, q in zip(times_us, quats.tolist(), strict=True)],
    }


def flown(**rows: list[list[float]]) -> Flight:
    flight = estimates(log_of(**rows), 0)
    assert flight is not None
    return flight


def navigated(flight: Flight) -> tuple[Array, Array, Any]:
    """Return velocity and position that the passes lead to from the first on, and the attitude at the end."""
    start_s = 1e-6 * (flight.time_us[:1] - PASS_US)
    (pos,), (vel,), (angles,) = motion(start_s)
    quat = quaternion.as_quat_array(quats_from_euler([angles]))[0]
    places = []
    for delta in flight.deltas:
        turned = quat * quaternion.from_rotation_vector(delta[3:6])
        felt = (turned * quaternion.quaternion(0.0, *delta[:3]) * turned.conj()).vec
        gained = felt + np.array([0.0, 0.0, GRAVITY * 2.5e-3])
        pos, vel, quat = pos + 2.5e-3 * (vel + 0.5 * gained), vel + gained, turned
        places.append(pos)
    return vel, np.array(places), quat


def test_sensors_of_the_flight_lead_along_the_estimate() -> None:
    flight = flown(**records(*motion(TIMES_S)))
    assert flight.basis is Basis.ESTIMATE
    vel, places, quat = navigated(flight)
    pos_expected, vel_expected, angles = motion(1e-6 * flight.time_us)
    assert vel == pytest.approx(vel_expected[-1], abs=0.02)
    assert np.abs(places - pos_expected).max() < 0.1  # after 7 s of dead reckoning
    turn = quaternion.as_quat_array(quats_from_euler(angles[-1:]))[0].conj() * quat
    assert 2 * math.hypot(turn.x, turn.y, turn.z) < 0.01


def worst_rates(flight: Flight) -> tuple[float, float]:
    """Return the greatest rate of turn in rad/s, and the greatest specific force besides gravity in m/s^2."""
    rates = np.linalg.norm(flight.deltas[:, 3:6], axis=1) / 2.5e-3
    forces = np.linalg.norm(flight.deltas[:, :3] / 2.5e-3, axis=1) - GRAVITY
    return float(rates.max()), float(np.abs(forces).max())


def test_jumps_of_the_filter_are_no_motion() -> None:
    pos, vel, angles = motion(TIMES_S)
    smooth = worst_rates(flown(**records(pos, vel, angles)))
    later = TIMES_S > 6.05
    jumped = records(pos + np.outer(later, [3.0, -4.0, 1.0]), vel, angles + np.outer(later, [0.0, 0.0, 1.5]))
    assert worst_rates(flown(**jumped)) == pytest.approx(smooth, abs=0.1)


def test_small_step_of_yaw_at_a_reset_is_no_turn() -> None:
    pos, vel, angles = motion(TIMES_S)
    stepped = records(pos, vel, angles + np.outer(TIMES_S > 6.05, [0.0, 0.0, 0.08]))
    turned = worst_rates(flown(**stepped))[0]
    told = worst_rates(flown(**stepped, EV=[[6_060_000, 62]]))[0]
    assert turned > TURN + 0.5
    assert told == pytest.approx(TURN, abs=0.06)


def test_log_without_the_filters_states_has_attitude_and_place() -> None:
    pos, _, angles = motion(TIMES_S)
    degrees = np.degrees(angles)
    times_us = 1e6 * TIMES_S
    scale = 0.0111319 * np.array([1.0, math.cos(math.radians(35)), -1.0])
    units = np.round([-35e7, 149e7, 0.0] + pos / scale)
    units[:, 2] = 58400 - np.round(100 * pos[:, 2])
    places = [[t, *row] for t, row in zip(times_us, units.tolist(), strict=True)]
    flight = flown(ATT=[[t, *row] for t, row in zip(times_us, degrees.tolist(), strict=True)], POS=places)
    assert flight.notes == ("no XKF1 in the log: velocity is what POS moves by",)
    vel, _, _ = navigated(flight)
    assert vel == pytest.approx(motion(1e-6 * flight.time_us[-1:])[1][0], abs=0.4)


def test_other_lanes_do_not_count() -> None:
    rows = records(*motion(TIMES_S))
    wild = {kind: [[row[0], 1, *(5 * np.array(row[2:]))] for row in of_kind] for kind, of_kind in rows.items()}
    both = {kind: rows[kind] + wild[kind] for kind in rows}
    alone, beside = flown(**rows), flown(**both)
    assert np.array_equal(alone.deltas, beside.deltas)


def test_long_flight_stays_smooth() -> None:
    times_s = np.arange(3.0, 63.0, 0.1)
    pos, vel, _ = motion(times_s)
    found, acc = smoothed(times_s, np.hstack([pos, vel]), VELOCITY_SIGMA)
    assert np.abs(found - vel).max() < 0.01
    assert np.abs(acc[10:-10] - np.gradient(vel, times_s, axis=0)[10:-10]).max() < 0.05


def test_too_few_records_are_no_flight() -> None:
    assert estimates(log_of(), 0) is None
    assert estimates(log_of(ATT=[[1e6 + 1e5 * n, 0, 0, 0] for n in range(100)]), 0) is None
