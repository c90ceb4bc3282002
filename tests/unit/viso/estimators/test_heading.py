# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A heading leaves the vehicle's by what wanders, not by what stays the same."""

import numpy as np
import pytest
import quaternion

from viso.estimators.heading import heading_departure
from viso.geometry.rotation import Array, quats_from_euler

TIME_S = np.arange(0, 40, 0.1)
FLOWN = np.column_stack((0.15 * np.sin(2 * TIME_S), 0.1 * np.sin(1.3 * TIME_S), 2.5 * np.sin(0.3 * TIME_S)))


def times(*quats_wxyz: Array) -> Array:
    first, *others = (quaternion.as_quat_array(one) for one in quats_wxyz)
    for one in others:
        first = first * one
    quats: Array = quaternion.as_float_array(first)
    return quats


def everywhere(euler_deg: tuple[float, float, float]) -> Array:
    return np.repeat(quats_from_euler(np.radians([euler_deg])), len(TIME_S), axis=0)


@pytest.mark.parametrize("world", [(0, 0, 0), (0, 0, 130), (180, 0, 90)])
@pytest.mark.parametrize("body", [(0, 0, 0), (180, 0, 0), (0, 90, 0), (0, -20, 0)])
def test_turned_frames_are_no_departure(world: tuple[float, float, float], body: tuple[float, float, float]) -> None:
    vehicle = quats_from_euler(FLOWN)
    off = np.abs(heading_departure(times(everywhere(world), vehicle, everywhere(body)), vehicle))
    assert np.degrees(np.quantile(off, 0.95)) < (5 if body == (0, -20, 0) else 1e-6)


@pytest.mark.parametrize("body", [(0, 0, 0), (180, 0, 0)])
def test_wandering_is_told_beside_a_turned_frame(body: tuple[float, float, float]) -> None:
    vehicle, wander = quats_from_euler(FLOWN), np.radians(60) * np.sin(0.5 * TIME_S) ** 2
    wandering = quats_from_euler(np.column_stack((np.zeros((len(wander), 2)), wander)))
    off = heading_departure(times(everywhere((0, 0, 50)), wandering, vehicle, everywhere(body)), vehicle)
    assert np.ptp(np.degrees(off)) == pytest.approx(60, abs=2)


def test_most_of_it_counts_as_right() -> None:
    vehicle, jump = quats_from_euler(FLOWN), np.radians(40) * (TIME_S > 30)
    jumped = quats_from_euler(np.column_stack((np.zeros((len(jump), 2)), jump)))
    off = np.degrees(heading_departure(times(jumped, vehicle), vehicle))
    assert np.abs(off[TIME_S < 30]).max() < 2
    assert np.abs(off[TIME_S > 30.1]).min() > 38
