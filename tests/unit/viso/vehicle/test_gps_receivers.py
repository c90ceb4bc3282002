# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of two GPS a vehicle uses."""

from collections.abc import Sequence
from dataclasses import replace

import pytest

from ap_core.clock import VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from mav_handlers.wire.messages import GPS_INPUT
from viso.parameters.table import make_groups
from viso.vehicle.gps import Gps
from viso.vehicle.gps_receivers import GpsReceivers

PACKET = GPS_INPUT(0, 0, 0, 0, 0, 3, 473977418, 85455938, 488.5, 0.5, 0.75, 1.0, 2.0, 3.0, 0.25, 0.5, 1.5, 10, 0)


class Rig:
    """Two GPS that messages feed."""

    def __init__(self, **params: float) -> None:
        self.clock = VirtualClock()
        self.clock.set_us(3_000_000)
        self.params = ParamTable(make_groups(1))
        for name, value in {"GPS1_TYPE": 14, "GPS2_TYPE": 14, **params}.items():
            self.params.set(name, value)
        self.texts: list[str] = []
        self.changes: list[int] = []
        self.records: list[tuple[str, tuple[LogValue, ...]]] = []
        first, second = (Gps(self.clock, self.params, self, self, lambda _: None, number=number) for number in (1, 2))
        self.gps = GpsReceivers(self.clock, self.params, (first, second), self._note_change)
        self.gps.update()

    def _note_change(self) -> None:
        self.changes.append(self.gps.primary)

    def send_text(self, _severity: int, text: str) -> None:
        self.texts.append(text)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.records.append((structure.name, tuple(values)))

    def hear(self, first: tuple[int, int], second: tuple[int, int], seconds: float = 0.2) -> int:
        """Let each have solutions of a kind of fix with so many satellites; return which one is used then."""
        for _ in range(round(seconds / 0.2)):
            for number, (fix_type, satellites) in enumerate((first, second)):
                packet = replace(PACKET, gps_id=number, fix_type=fix_type, satellites_visible=satellites)
                assert self.gps.take(packet)
            self.clock.set_us(self.clock.micros64() + 200_000)
            self.gps.update()
        return self.gps.primary


@pytest.fixture
def rig() -> Rig:
    """Return two GPS that have been switched on."""
    return Rig()


def test_each_is_announced_with_its_number(rig: Rig) -> None:
    rig.hear((3, 10), (3, 10))
    assert rig.texts == [
        *("GPS 1: specified as MAV", "GPS 2: specified as MAV"),
        *("GPS 1: detected MAV", "GPS 2: detected MAV"),
    ]


def test_first_is_used_of_two_that_are_as_good(rig: Rig) -> None:
    assert rig.hear((3, 10), (3, 10), 30.0) == 0
    assert rig.changes == []


def test_better_fix_is_used_at_once(rig: Rig) -> None:
    assert rig.hear((3, 10), (5, 8)) == 1
    assert rig.hear((5, 8), (5, 8), 1.0) == 1
    assert rig.hear((5, 8), (3, 8)) == 0
    assert rig.changes == [1, 0]


@pytest.mark.parametrize(("more", "seconds"), [(1, 20.0), (2, 5.0)])
def test_more_satellites_count_after_a_while(rig: Rig, more: int, seconds: float) -> None:
    rig.hear((3, 10), (5, 10))
    rig.hear((5, 10), (3, 10))  # a change, from which the time counts
    assert rig.hear((3, 10), (3, 10 + more), seconds - 0.4) == 0
    assert rig.hear((3, 10), (3, 10 + more), 0.6) == 1


def test_primary_one_alone_is_used_if_asked_for() -> None:
    rig = Rig(GPS_AUTO_SWITCH=0, GPS_PRIMARY=1)
    assert rig.hear((5, 14), (1, 0)) == 1
    rig.params.set("GPS2_TYPE", 0)
    rig.gps.update()
    assert rig.gps.primary == 0


def test_primary_one_is_used_while_it_has_a_fix() -> None:
    rig = Rig(GPS_AUTO_SWITCH=4, GPS_PRIMARY=1)
    assert rig.hear((5, 14), (3, 7)) == 1
    assert rig.hear((5, 14), (1, 7)) == 0


def test_log_tells_which_one_is_used(rig: Rig) -> None:
    rig.hear((3, 10), (5, 10), 0.4)
    assert [(values[1], values[-1]) for name, values in rig.records if name == "GPS"][-2:] == [(0, 0), (1, 1)]


def test_solutions_have_the_numbers_of_their_gps(rig: Rig) -> None:
    rig.hear((3, 10), (5, 12))
    told = rig.gps.samples()
    assert [one.num_sats for one in told.solutions if one is not None] == [10, 12]
    assert told.used is rig.gps.sample() is told.solutions[1]


def test_message_for_a_third_one_is_taken_by_none(rig: Rig) -> None:
    assert not rig.gps.take(replace(PACKET, gps_id=2))
