# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The GPS out of its three records."""

from types import SimpleNamespace
from typing import Any

import pytest

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import GpsSample
from viso.replay.ekf.inputs import GpsRecords


def record(kind: str, **fields: object) -> Any:
    return SimpleNamespace(get_type=lambda: kind, **fields)


def slow(flags: int, fix_type: int = 3) -> Any:
    return record("RGPI", OX=0.0, OY=0.0, OZ=0.0, Lg=0.2, Flags=flags, Stat=fix_type, NSats=10, I=0)


def solution(instance: int, time_ms: int, **changed: float) -> Any:
    fields = {
        "VX": 1.0,
        "VY": 2.0,
        "VZ": 3.0,
        "SA": 0.5,
        "Y": 0.0,
        "Lat": 10,
        "Lon": 20,
        "Alt": 30,
        "HA": 1.5,
        "VA": 2.5,
    }
    return record("RGPJ", TS=time_ms, HD=121, I=instance, **{**fields, **changed})


class Rig:
    """The records of a vehicle with one GPS."""

    def __init__(self) -> None:
        self.records = GpsRecords()
        self.records.take(record("RGPH", NumInst=1, Primary=0))
        self.records.take(solution(0, 1000))

    def newest(self) -> GpsSample:
        sample = self.records.newest()
        assert sample is not None
        return sample

    def with_slow(self, flags: int, fix_type: int = 3) -> GpsSample:
        self.records.take(slow(flags, fix_type))
        return self.newest()


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_receiver_that_there_is_not_has_records_too() -> None:
    # As in the recorded logs.
    records = GpsRecords()
    records.take(record("RGPH", NumInst=0, Primary=0))
    records.take(slow(8, 0))
    records.take(solution(0, 0))
    assert records.newest() is None


def test_gps_needs_both_records(rig: Rig) -> None:
    assert rig.records.newest() is None


def test_solution_has_all_that_is_recorded(rig: Rig) -> None:
    expected = GpsSample(1000, 3, Location(10, 20, 30), Vector3f(1, 2, 3), 10, 121, last_fix_ms=1000)
    assert rig.with_slow(flags=8) == expected


def test_flags_tell_what_the_receiver_knows(rig: Rig) -> None:
    known = rig.with_slow(flags=1 | 2 | 4 | 16)
    assert known.has_vertical_velocity
    assert (known.speed_accuracy, known.horizontal_accuracy, known.vertical_accuracy) == (0.5, 1.5, 2.5)
    assert known.yaw_deg is None
    assert rig.with_slow(flags=32).yaw_deg == 0.0


def test_newer_solution_has_what_stood_before(rig: Rig) -> None:
    rig.with_slow(flags=1)
    rig.records.take(solution(0, 1200, VX=7.0))
    assert (rig.newest().time_ms, float(rig.newest().vel_ned.x)) == (1200, 7.0)
    assert rig.newest().has_vertical_velocity


def test_last_fix_is_remembered(rig: Rig) -> None:
    rig.with_slow(flags=8)
    lost = rig.with_slow(flags=8, fix_type=1)
    rig.records.take(solution(0, 1200))
    assert (lost.fix_type, lost.last_fix_ms) == (1, 1000)
    assert rig.newest().last_fix_ms == 1000


def test_gps_is_the_primary_one(rig: Rig) -> None:
    rig.with_slow(flags=8)
    rig.records.take(solution(1, 2000))
    assert rig.newest().time_ms == 1000
