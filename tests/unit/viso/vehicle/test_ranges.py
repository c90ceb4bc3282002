# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The range finders: what counts as a range, what is told of it, and what fails before arming."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from ap_core.clock import VirtualClock
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ekf_stub.inputs.measurements import DOWNWARD, FinderState, RangeStatus
from mav_handlers.wire.messages import DISTANCE_SENSOR
from viso.firmware.log_releases import RFND
from viso.firmware.releases import STABLE_4_6
from viso.parameters.table import make_groups
from viso.vehicle.ranges import RANGE_PERIOD_US, RangeFinders

UPWARD = 24


def distance(
    cm: int, orientation: int = DOWNWARD, *, least_cm: int = 20, most_cm: int = 3000, quality: int = 0
) -> DISTANCE_SENSOR:
    return DISTANCE_SENSOR(9, least_cm, most_cm, cm, 1, 9, orientation, 9, signal_quality=quality)


class Rig:
    """Range finders that are updated 20 times per second; the first hears MAVLink unless told otherwise."""

    def __init__(self, release: Any = None, **params: float) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(1, None, *([] if release is None else [release])))
        for name, value in {"RNGFND1_TYPE": 10, **params}.items():
            self.params.set(name, value)
        self.records: list[dict[str, Any]] = []
        unit = [] if release is None else [release.range_unit]
        self.ranges = RangeFinders(self.clock, self.params, self, *unit)
        self.clock.set_us(3_000_000)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        assert structure is RFND
        structure.pack(values)
        self.records.append(dict(zip(structure.fields, values, strict=True)))

    def run_us(self, duration_us: int) -> None:
        for _ in range(duration_us // RANGE_PERIOD_US):
            self.clock.set_us(self.clock.micros64() + RANGE_PERIOD_US)
            self.ranges.update()

    def see(self, *packets: DISTANCE_SENSOR) -> FinderState:
        """Hear messages at one moment and return what the estimator is told of the first after the next update."""
        for packet in packets:
            self.ranges.take(packet)
        self.run_us(RANGE_PERIOD_US)
        return self.told()[0]

    def told(self) -> tuple[FinderState, ...]:
        state = self.ranges.state()
        assert state is not None
        return state.finders


@pytest.mark.parametrize(("cm", "metres", "status"), [
    (17, 0.17000000178813934, RangeStatus.TOO_NEAR),
    (18, 0.17999999225139618, RangeStatus.TOO_NEAR),
    (19, 0.1899999976158142, RangeStatus.TOO_NEAR),
    (20, 0.19999998807907104, RangeStatus.TOO_NEAR),
    (21, 0.20999999344348907, RangeStatus.GOOD),
    (3000, 30.0, RangeStatus.GOOD),
    (3001, 30.010000228881836, RangeStatus.TOO_FAR),
])  # fmt: skip
def test_ranges_and_their_worth_are_those_of_the_recordings(cm: int, metres: float, status: RangeStatus) -> None:
    told = Rig(RNGFND1_MAX=40).see(distance(cm))
    assert (told.distance, told.status) == (metres, status)


@pytest.mark.parametrize(("least_cm", "most_cm", "limits"), [
    (0, 0, (0.5, 10.0)),
    (20, 3000, (0.5, 10.0)),
    (70, 500, (0.7, 5.0)),
    (0, 500, (0.5, 5.0)),
    (70, 0, (0.7, 0.0)),
])  # fmt: skip
def test_closer_limits_count(least_cm: int, most_cm: int, limits: tuple[float, float]) -> None:
    rig = Rig(RNGFND1_MIN=0.5, RNGFND1_MAX=10)
    rig.see(distance(300, least_cm=least_cm, most_cm=most_cm))
    (report,) = rig.ranges.reports()
    assert (report.least, report.most) == pytest.approx(limits)


def test_range_lasts_for_half_a_second() -> None:
    rig = Rig()
    assert rig.see(distance(300)).status is RangeStatus.GOOD
    rig.run_us(450_000)
    assert rig.told()[0].status is RangeStatus.GOOD
    rig.run_us(50_000)
    assert rig.told()[0] == FinderState((0.0, 0.0, 0.0), 0.0, DOWNWARD, RangeStatus.NO_DATA)
    assert not rig.ranges.has_data()


def test_only_the_last_range_before_an_update_counts() -> None:
    assert Rig().see(distance(300), distance(400)).distance == 4.0


def test_range_of_another_direction_is_refused() -> None:
    rig = Rig()
    assert not rig.ranges.take(distance(300, UPWARD))
    assert rig.see(distance(300, UPWARD)).status is RangeStatus.NO_DATA
    rig.params.set("RNGFND1_ORIENT", UPWARD)
    assert rig.ranges.take(distance(300, UPWARD))
    assert not rig.ranges.is_present()


@pytest.mark.parametrize("kind", [0, 1, 100])
def test_other_types_take_no_messages(kind: int) -> None:
    rig = Rig(RNGFND1_TYPE=kind)
    assert not rig.ranges.take(distance(300))
    rig.run_us(50_000)
    assert rig.records == []
    assert rig.ranges.state() is None
    assert not rig.ranges.is_enabled


def test_range_finder_needs_its_type_at_boot() -> None:
    rig = Rig(RNGFND1_TYPE=0)
    rig.params.set("RNGFND1_TYPE", 10)
    assert not rig.ranges.take(distance(300))


def test_one_that_is_switched_off_is_not_there_while_the_estimator_keeps_its_last_range() -> None:
    rig = Rig()
    before = rig.see(distance(300))
    rig.params.set("RNGFND1_TYPE", 0)
    assert rig.see(distance(400)) == before
    assert not rig.ranges.is_present()
    assert not rig.ranges.reports()
    rig.params.set("RNGFND1_TYPE", 10)
    assert rig.ranges.failure() == "Rangefinder 1: Not Connected"


def test_estimator_is_told_of_the_first_good_one_that_looks_down() -> None:
    rig = Rig(RNGFND2_TYPE=10, RNGFND1_ORIENT=UPWARD, RNGFND2_MAX=20, RNGFND2_GNDCLR=0.25, RNGFND2_POS_X=0.5)
    rig.see(distance(300), distance(100, UPWARD))
    state = rig.ranges.state()
    assert state is not None
    assert (state.ground_clearance, state.max_distance) == (0.25, 20.0)
    assert [finder.distance for finder in state.finders] == [1.0, 3.0]
    assert state.finders[1].place_frd == (0.5, 0.0, 0.0)
    assert rig.ranges.downward() == (3.0, 0.0)


def test_gap_before_a_second_one_is_not_connected() -> None:
    rig = Rig(RNGFND1_TYPE=0, RNGFND2_TYPE=10)
    assert rig.see(distance(300)).status is RangeStatus.NOT_CONNECTED
    assert rig.told()[1].status is RangeStatus.GOOD


def test_estimator_is_told_the_same_until_that_changes() -> None:
    rig = Rig()
    rig.see(distance(300))
    state = rig.ranges.state()
    rig.see(distance(300))
    assert rig.ranges.state() is state


@pytest.mark.parametrize(("quality", "percent"), [(0, -1), (1, 0), (2, 2), (100, 100)])
def test_every_update_is_logged(quality: int, percent: int) -> None:
    rig = Rig()
    rig.run_us(50_000)
    rig.see(distance(300, quality=quality))
    assert [tuple(record.values()) for record in rig.records] == [
        (3_050_000, 0, 0.0, RangeStatus.NO_DATA, DOWNWARD, -1),
        (3_100_000, 0, 3.0, RangeStatus.GOOD, DOWNWARD, percent),
    ]


def test_nothing_is_logged_without_the_bit_for_height_control() -> None:
    rig = Rig(LOG_BITMASK=180222 & ~(1 << 4))
    rig.run_us(50_000)
    assert rig.records == []


@pytest.mark.parametrize(("params", "text"), [
    ({}, "Rangefinder 1: No Data"),
    ({"RNGFND1_TYPE": 0}, None),
    ({"RNGFND1_TYPE": 1}, "Rangefinder 1: Not Detected"),
    ({"RNGFND1_TYPE": 0, "RNGFND2_TYPE": 10}, "Rangefinder 2: No Data"),
])  # fmt: skip
def test_what_does_not_work_fails_before_arming(params: dict[str, float], text: str | None) -> None:
    rig = Rig(**params)
    rig.run_us(50_000)
    assert rig.ranges.failure() == text


@pytest.mark.parametrize("cm", [10, 300, 5000])
def test_any_range_is_enough_for_arming(cm: int) -> None:
    rig = Rig()
    rig.see(distance(cm))
    assert rig.ranges.failure() is None


def test_limits_of_4_6_are_in_centimetres() -> None:
    rig = Rig(STABLE_4_6.params, RNGFND1_MIN_CM=50, RNGFND1_MAX_CM=1000, RNGFND1_GNDCLEAR=25)
    assert rig.see(distance(49)).status is RangeStatus.TOO_NEAR
    assert rig.see(distance(1001)).status is RangeStatus.TOO_FAR
    state = rig.ranges.state()
    assert state is not None
    assert (state.ground_clearance, state.max_distance) == (0.25, 10.0)


@pytest.mark.parametrize(("cm", "given"), [(22, 22), (23, 22), (24, 24), (27, 26), (2900, 2900)])
def test_range_of_4_6_is_whole_centimetres_and_single_precision_may_cost_one(cm: int, given: int) -> None:
    rig = Rig(STABLE_4_6.params, RNGFND1_MAX_CM=4000)
    told = rig.see(distance(cm))
    assert told.distance == np.float32(given) * np.float32(0.01)
    assert rig.records[-1]["Dist"] == given
