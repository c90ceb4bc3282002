# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which compass is read, when another one takes its place, and what is forgotten then."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ekf_stub.fusion.compass_reading import CompassReader
from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.inputs.compasses import Compasses, CompassReading

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

PARKED = Vehicle(armed=False, on_ground=True, in_flight=False)
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)
SETTLED_MS = 30_001
LOST_MS = 10_001


class Rig:
    """A core that has begun at 0 ms, and its compasses, whose readings are as old as the frame."""

    def __init__(self, parts: "FilterParts", count: int = 3, **said: Any) -> None:
        self.parts = parts
        self.reader: CompassReader = parts.yaw.compass
        self.count, self.said = count, said
        self.readings: dict[int, dict[str, Any]] = {}
        self.reader.begin(self.compasses(0), 0)

    def compasses(self, now_ms: int) -> Compasses:
        field = np.array([240.0, 0.0, -530.0])
        readings = [
            CompassReading(1000 * now_ms, field)._replace(**self.readings.get(i, {})) for i in range(self.count)
        ]
        return Compasses(tuple(readings), **self.said)

    def run(self, now_ms: int, vehicle: Vehicle = FLYING) -> list[str]:
        """Make a frame and a step; return what was told."""
        self.reader.select(self.compasses(now_ms), now_ms, armed=vehicle.armed)
        self.reader.check_timeout(now_ms, is_in_use=True)
        self.reader.read(now_ms, vehicle, is_in_use=True)
        return self.parts.told()


def test_compass_that_fails_its_gate_in_flight_gives_way_to_each_of_the_others(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"))
    rig.parts.state.body_field = np.full(3, 0.1)
    # The numbers are counted on from the compass that was just chosen: of three the first comes back.
    assert rig.run(SETTLED_MS) == ["switching to compass 1", "switching to compass 0"]
    assert rig.reader.wants_reset
    assert rig.reader.forgets_body_field
    assert not rig.reader.is_lost
    assert not rig.parts.state.body_field.any()
    assert rig.run(SETTLED_MS + 100) == []
    rig.count = 2
    assert rig.run(SETTLED_MS + LOST_MS) == ["switching to compass 1"]


@pytest.mark.parametrize(
    ("now_ms", "vehicle", "said"),
    [(SETTLED_MS - 1, FLYING, {}), (SETTLED_MS, PARKED, {}), (SETTLED_MS, FLYING, {"own": 0})],
)
def test_compass_that_fails_its_gate_is_kept_before_on_the_ground_and_with_affinity(
    make_parts: MakeParts, now_ms: int, vehicle: Vehicle, said: dict[str, int]
) -> None:
    assert Rig(make_parts("66661"), **said).run(now_ms, vehicle) == []


def test_compass_that_breaks_gives_way_after_10_s_even_on_the_ground(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"), first_usable=0)
    rig.run(1000, PARKED)
    rig.readings = {0: {"is_healthy": False}, 1: {"is_used": False}}
    assert rig.run(1000 + LOST_MS - 1, PARKED) == []
    rig.said["first_usable"] = 2
    assert rig.run(1000 + LOST_MS, PARKED) == ["switching to compass 2"]


def test_vehicle_that_is_disarmed_goes_back_to_the_first_compass(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"))
    rig.reader.number = 1
    assert rig.run(1000) == []
    assert rig.run(1100, PARKED) == ["switching to compass 0"]


def test_compass_of_the_core_is_used_while_it_works(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"), own=2)
    assert rig.run(1000, PARKED) == []
    assert rig.reader.number == 2
    rig.readings[2] = {"is_healthy": False}
    rig.run(1100, PARKED)
    assert rig.reader.number == 2  # the one that it has had
    rig.reader.number = 0
    rig.run(1200, PARKED)
    assert rig.reader.number == 0


def test_offsets_that_change_make_the_vehicles_field_unknown(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"), count=1)
    rig.run(1000)
    assert not rig.reader.forgets_body_field
    rig.readings[0] = {"offsets": (5.0, 0.0, 0.0)}
    rig.run(1100)
    assert rig.reader.forgets_body_field
    assert rig.reader.samples.recall(1034).sample is not None
    assert rig.reader.samples.recall(1034).sample is None


def test_without_any_compass_none_is_used_from_then_on(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"), are_available=False)
    rig.run(1000)
    rig.parts.yaw.control(FLYING)
    assert not rig.parts.yaw.uses_compass


def test_compass_that_may_not_be_used_for_yaw_is_none(make_parts: MakeParts) -> None:
    rig = Rig(make_parts("66661"))
    assert rig.parts.yaw.compass.is_used()
    rig.readings[0] = {"is_used": False}
    rig.run(1000)
    assert not rig.parts.yaw.compass.is_used()


@pytest.mark.parametrize(("are_consistent", "aligns"), [(True, True), (False, False)])
def test_compass_that_is_off_for_5_s_before_arming_aligns_yaw_anew(
    make_parts: MakeParts, are_consistent: bool, aligns: bool
) -> None:
    rig = Rig(make_parts("66661"), are_consistent=are_consistent)
    rig.run(1000, PARKED)
    rig.parts.yaw.ratio = 1.1
    for now_ms in (1000, 6000, 6001):
        rig.parts.yaw.check_compass(now_ms, PARKED)
    assert rig.parts.yaw._alignment.is_requested is aligns
