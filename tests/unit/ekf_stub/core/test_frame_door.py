# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What sensors say comes into the filter if it can be reckoned with, and is counted if it cannot."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.core.ekf3_core import Frame
from ekf_stub.core.frame_door import FrameDoor
from ekf_stub.filter.inertial import GRAVITY_MSS, MIN_DT, InertialDelta
from ekf_stub.inputs.compasses import NO_COMPASS, Compasses, CompassReading
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.range_state import DOWNWARD, FinderState, RangeState, RangeStatus

DT = 0.0025
FIX = GpsSample(1000, 3, Location(0, 0, 0), Vector3f(1, 2, 3), 10, speed_accuracy=0.3, yaw_deg=359.0)


def inertial(vx: float = 0.1, az: float = 0.0, vel_dt: float = DT, ang_dt: float = DT) -> InertialDelta:
    return InertialDelta(np.array([vx, 0.0, -GRAVITY_MSS * DT]), np.array([0.0, 0.0, az]), vel_dt, ang_dt)


def frame(**fields: Any) -> Frame:
    sound = {
        "delta": inertial(),
        "baro": (900, 12.5),
        "mag": (900_000, np.array([240.0, 0.0, -530.0])),
        "gps": FIX,
        "declination": 0.2,
        "place_declination": -0.2,
        "lever_arm": (0.1, 0.0, -0.2),
        "ranges": RangeState((FinderState((0.0, 0.0, 0.0), 3.0, DOWNWARD, RangeStatus.GOOD),), 0.1, 40.0),
    }
    return Frame(1_000_000, **{**sound, **fields})


def test_what_is_sound_comes_in_as_it_is() -> None:
    door, given = FrameDoor(), frame()
    assert door.admit(given) is given
    assert door.delta is given.delta
    assert not door.refused


def test_sensors_that_are_not_there_are_not_refused() -> None:
    door, given = FrameDoor(), Frame(1_000_000, inertial())
    assert door.admit(given) is given


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e30])
@pytest.mark.parametrize(
    ("field", "make", "stand_in"),
    [
        ("baro", lambda bad: (900, bad), None),
        ("mag", lambda bad: (900_000, np.array([0.0, bad, 0.0])), None),
        ("gps", lambda bad: replace(FIX, vel_ned=Vector3f(0, 0, bad)), None),
        ("gps", lambda bad: replace(FIX, speed_accuracy=bad), None),
        ("gps", lambda bad: replace(FIX, horizontal_accuracy=bad), None),
        ("gps", lambda bad: replace(FIX, vertical_accuracy=bad), None),
        ("gps", lambda bad: replace(FIX, yaw_deg=bad), None),
        ("declination", lambda bad: bad, 0.0),
        ("place_declination", lambda bad: bad, None),
        ("lever_arm", lambda bad: (0.0, bad, 0.0), (0.0, 0.0, 0.0)),
        ("ranges", lambda bad: RangeState((FinderState((0.0, 0.0, 0.0), bad, DOWNWARD, RangeStatus.GOOD),)), None),
        ("ranges", lambda bad: RangeState((FinderState((0.0, bad, 0.0), 1.0, DOWNWARD, RangeStatus.GOOD),)), None),
        ("ranges", lambda bad: RangeState((), bad), None),
        ("compasses", lambda bad: Compasses((CompassReading(0, np.full(3, bad)),)), NO_COMPASS),
    ],
)
def test_what_is_absurd_counts_as_not_there(field: str, make: Any, stand_in: object, bad: float) -> None:
    door, given = FrameDoor(), frame(**{field: make(bad)})
    admitted = door.admit(given)
    assert getattr(admitted, field) == stand_in
    assert admitted._replace(**{field: getattr(given, field)}) == given
    assert door.refused == {field: 1}


@pytest.mark.parametrize("bad", [{"vx": math.nan}, {"az": math.inf}, {"vx": 1e5}, {"vel_dt": -0.1}, {"ang_dt": 2.0}])
def test_last_sound_inertial_data_stand_in_for_what_is_absurd(bad: dict[str, float]) -> None:
    door, before = FrameDoor(), frame()
    door.admit(before)
    admitted = door.admit(frame(delta=inertial(**bad)))
    assert admitted.delta is door.delta is before.delta
    assert door.refused == {"delta": 1}


def test_rest_stands_in_for_inertial_data_that_are_absurd_from_the_first_on() -> None:
    door = FrameDoor()
    delta = door.admit(frame(delta=inertial(vx=math.nan))).delta
    assert (delta.del_vel.tolist(), delta.del_ang.tolist()) == ([0.0, 0.0, -GRAVITY_MSS * DT], [0.0, 0.0, 0.0])


@pytest.mark.parametrize("short", [0.0, 1e-300, 0.5 * MIN_DT])
def test_intervals_have_the_firmwares_least_length(short: float) -> None:
    door, given = FrameDoor(), inertial(vel_dt=short, ang_dt=short)
    delta = door.admit(frame(delta=given)).delta
    assert (delta.del_vel_dt, delta.del_ang_dt) == (MIN_DT, MIN_DT)
    assert delta.del_vel is given.del_vel


def test_every_frame_in_which_something_is_refused_counts() -> None:
    door, baro = FrameDoor(), (900, math.nan)
    for _ in range(3):
        assert door.admit(frame(baro=baro)).baro is None
    door.admit(frame())
    assert door.refused == {"baro": 3}


def test_reading_that_is_sound_again_comes_in() -> None:
    door = FrameDoor()
    door.admit(frame(baro=(900, math.nan)))
    assert door.admit(frame(baro=(1000, 3.0))).baro == (1000, 3.0)
