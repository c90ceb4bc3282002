# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the filter is judged by a log: what counts, and where the targets end."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ekf_stub.inputs.measurements import Array
from viso.compare.estimates import MEASURED, Check, EstimateComparison, compare_estimates
from viso.compare.tolerances import BENCH, FLIGHT, UNITS, end_s, kind_of_log, log_name
from viso.replay.ekf.run import FIELDS, LABELS, EkfReplay

PERIOD_S = 0.1
RECORDS = 400
AIDING_S = 5.0
AIDING = [(1.0, "initialised"), (AIDING_S, "is using external nav data")]
TIMES_S: Array = PERIOD_S * np.arange(RECORDS, dtype=np.float64)


class Rig:
    """A log, and a filter that says the same unless told otherwise."""

    def __init__(self) -> None:
        self.ours = {label: np.zeros(RECORDS) for label in LABELS}
        self.recorded = {label: np.zeros(RECORDS) for label in LABELS}
        self.our_texts = list(AIDING)
        self.recorded_texts = list(AIDING)

    def set(self, label: str, value: float, start_s: float, end_s: float = 1e9, *, both: bool = False) -> None:
        """Set a value of ours, or of both, from a time up to, but without, another."""
        when = (start_s - 1e-6 <= TIMES_S) & (end_s - 1e-6 > TIMES_S)
        for values in (self.ours, self.recorded) if both else (self.ours,):
            values[label][when] = value

    def compare(self, *, bench: bool = False) -> EstimateComparison:
        replay = EkfReplay(TIMES_S, self.ours, self.recorded, self.our_texts, self.recorded_texts)
        return compare_estimates(replay, BENCH if bench else FLIGHT)

    def missed(self, *, bench: bool = False) -> list[str]:
        """Return what misses its target."""
        comparison = self.compare(bench=bench)
        missed = [check.what for check in comparison.checks if not check.passed]
        assert comparison.passed is (not missed)
        return missed


@pytest.fixture
def rig() -> Rig:
    return Rig()


def check_of(comparison: EstimateComparison, what: str) -> Check:
    return next(check for check in comparison.checks if check.what == what)


@pytest.mark.parametrize("bench", [False, True])
def test_filter_that_says_the_same_meets_all_targets(rig: Rig, bench: bool) -> None:
    comparison = rig.compare(bench=bench)
    assert comparison.passed
    assert comparison.aiding_s == (AIDING_S, AIDING_S)
    assert comparison.equal == {"TS": 1.0, "SS": 1.0, "both": 1.0}
    assert [check.what for check in comparison.checks][: len(MEASURED)] == list(MEASURED)


# In flight


@pytest.mark.parametrize(("label", "limit"), [
    *((label, 0.001) for label in ("PN", "PE", "PD", "VN", "VE", "VD")),
    *((label, 0.02) for label in ("IPN", "IPE", "IPD")),
    *((label, 0.03) for label in ("IVN", "IVE", "IVD", "Roll", "Pitch", "Yaw")),
])  # fmt: skip
def test_estimate_may_be_off_by_its_limit(rig: Rig, label: str, limit: float) -> None:
    rig.set(label, 0.99 * limit, 0)
    assert rig.missed() == []
    rig.set(label, -1.01 * limit, 0)
    assert rig.missed() == [label]


@pytest.mark.parametrize("label", ["PN", "VD"])
def test_single_estimate_counts(rig: Rig, label: str) -> None:
    rig.set(label, 0.0011, 20, 20.1)
    assert rig.missed() == [label]


def test_what_was_before_aiding_does_not_count(rig: Rig) -> None:
    for label in LABELS:
        rig.set(label, 50, 0, AIDING_S)
    assert rig.missed() == []
    assert rig.compare().records == RECORDS - round(AIDING_S / PERIOD_S)


def test_first_estimate_of_aiding_counts(rig: Rig) -> None:
    rig.set("PN", 0.2, AIDING_S, AIDING_S + PERIOD_S)
    assert rig.missed() == ["PN"]


def test_aiding_is_the_logs(rig: Rig) -> None:
    rig.our_texts = [AIDING[0], (5.2, AIDING[1][1])]
    rig.set("PN", 0.2, AIDING_S, 5.2)
    assert rig.missed() == ["PN"]


def test_heading_wraps(rig: Rig) -> None:
    rig.set("Yaw", 359.9, 0)
    rig.recorded["Yaw"][:] = 0.1
    assert rig.compare().errors["Yaw"].worst == pytest.approx(0.2)


def jump(rig: Rig, time_s: float, *, moved: bool) -> None:
    rig.set("PD", -3.0, time_s, both=True)
    if moved:
        rig.set("OFN", 4.0, time_s, both=True)


@pytest.mark.parametrize("moved", [True, False])
def test_height_does_not_count_for_half_a_second_after_a_reset(rig: Rig, moved: bool) -> None:
    jump(rig, 20.0, moved=moved)
    rig.set("PD", 2.0, 20.0, 20.4)
    assert rig.missed() == []
    rig.set("PD", 2.0, 20.0, 20.7)
    assert rig.missed() == ["PD"]


def test_height_does_not_count_for_half_a_second_after_aiding_begins(rig: Rig) -> None:
    rig.set("PD", 2.0, AIDING_S, AIDING_S + 0.5)
    assert rig.missed() == []


def test_height_that_moves_with_its_velocity_is_no_reset(rig: Rig) -> None:
    rig.set("VD", -5.0, 20.0, both=True)
    for values in (rig.ours, rig.recorded):
        values["PD"] = np.minimum(0.0, -5.0 * (TIMES_S - 20.0))
    rig.set("PD", 2.0, 20.5, 20.6)
    assert rig.missed() == ["PD"]


def test_height_that_glides_is_no_reset(rig: Rig) -> None:
    for values in (rig.ours, rig.recorded):
        values["PD"] = np.interp(TIMES_S, [20, 24], [0, -12])
    rig.ours["PD"][220:225] += 2.0
    assert rig.missed() == ["PD"]


def test_position_counts_after_a_reset_too(rig: Rig) -> None:
    jump(rig, 20.0, moved=True)
    rig.set("PN", 0.2, 20.0, 20.1)
    assert rig.missed() == ["PN"]


def test_timeouts_and_status_are_equal_in_all_records(rig: Rig) -> None:
    # Of 350 records; a record in which either differs counts once.
    rig.set("TS", 1, 20, 20 + 7 * PERIOD_S)
    rig.set("SS", 1, 20, 20 + 5 * PERIOD_S)
    assert rig.missed() == ["TS and SS equal"]
    assert rig.compare().equal["both"] == pytest.approx(1 - 7 / 350)
    assert rig.compare().equal["SS"] == pytest.approx(1 - 5 / 350)


def test_log_that_ends_before_aiding_meets_nothing(rig: Rig) -> None:
    rig.our_texts, rig.recorded_texts = [(99.0, AIDING[1][1])], [(99.0, AIDING[1][1])]
    assert (rig.compare().records, rig.missed()) == (0, ["TS and SS equal"])


def test_texts_count_from_the_beginning(rig: Rig) -> None:
    rig.our_texts = AIDING[1:]
    assert rig.missed() == ["texts"]
    assert check_of(rig.compare(), "texts").figure == "1 differ"


@pytest.mark.parametrize("text", ["is using external nav data", "started relative aiding", "is using GPS"])
def test_aiding_starts_by_whatever_means(rig: Rig, text: str) -> None:
    rig.recorded_texts = [(6.0, text), *AIDING[1:]]
    assert rig.compare().aiding_s == (AIDING_S, 6.0)


def test_log_without_aiding_counts_as_a_whole(rig: Rig) -> None:
    rig.our_texts = rig.recorded_texts = []
    assert (rig.compare().records, rig.compare().aiding_s) == (RECORDS, (None, None))


def test_ratios_and_resets_are_not_asked_for_in_flight(rig: Rig) -> None:
    rig.set("SP", 3, 0)
    rig.set("OFN", 3, 20)
    assert rig.missed() == []


# On the bench


@pytest.mark.parametrize("label", ["PN", "PE", "PD", "VN", "VE", "VD"])
def test_estimate_on_the_bench_may_be_off_by_a_millimetre(rig: Rig, label: str) -> None:
    rig.set(label, 0.0009, 0)
    assert rig.missed(bench=True) == []
    rig.set(label, 0.0011, 0)
    assert rig.missed(bench=True) == [label]


def test_other_estimates_are_not_asked_for_on_the_bench(rig: Rig) -> None:
    for label in ("Roll", "Pitch", "Yaw", "IVN", "IPD"):
        rig.set(label, 50, 0)
    comparison = rig.compare(bench=True)
    assert comparison.passed
    assert check_of(comparison, "Yaw").target == ""


def events(rig: Rig, what: str) -> None:
    if what == "text":
        for texts in (rig.our_texts, rig.recorded_texts):
            texts.append((20.0, "stopped aiding"))
    else:
        rig.set(what, 4.0, 20.0, both=True)


@pytest.mark.parametrize("what", ["text", "TS", "SS", "OFN", "OFE", "PD"])
def test_second_after_an_event_does_not_count_on_the_bench(rig: Rig, what: str) -> None:
    events(rig, what)
    rig.set("PN", 30.0, 20.0, 20.9)
    assert rig.missed(bench=True) == []
    rig.set("PN", 30.0, 20.0, 21.2)
    assert rig.missed(bench=True) == ["PN"]


@pytest.mark.parametrize(("what", "missed"), [("TS", "TS changes"), ("SS", "SS changes"), ("OFE", "resets (OFN, OFE)")])
def test_change_on_the_bench_may_be_a_quarter_of_a_second_apart(rig: Rig, what: str, missed: str) -> None:
    rig.recorded[what][200:] = 4.0
    rig.ours[what][202:] = 4.0
    assert rig.missed(bench=True) == []
    rig.ours[what][202] = 0.0
    assert rig.missed(bench=True) == [missed]


@pytest.mark.parametrize(("what", "missed"), [("TS", "TS changes"), ("SS", "SS changes"), ("OFN", "resets (OFN, OFE)")])
def test_change_that_only_one_has_is_missed(rig: Rig, what: str, missed: str) -> None:
    rig.set(what, 4.0, 20.0)
    assert rig.missed(bench=True) == [missed]


def test_first_status_on_the_bench_counts(rig: Rig) -> None:
    rig.set("SS", 4.0, 0)
    assert rig.missed(bench=True) == ["SS changes"]


def sides(rig: Rig, ours: Sequence[float], recorded: Sequence[float]) -> list[str]:
    rig.ours["SP"][: len(ours)] = ours
    rig.recorded["SP"][: len(recorded)] = recorded
    return rig.missed(bench=True)


def test_ratio_on_the_other_side_of_1_is_missed(rig: Rig) -> None:
    assert sides(rig, [20.0, 0.5], [1.5, 0.1]) == []
    assert sides(rig, [0.9], [1.5]) == ["SP side of 1"]
    assert sides(rig, [1.1], [0.5]) == ["SP side of 1"]


def test_ratio_near_1_is_on_either_side(rig: Rig) -> None:
    assert sides(rig, [0.9, 1.1], [1.19, 0.81]) == []


# Targets


@pytest.mark.parametrize(("name", "bench"), [
    ("bench_steps.BIN.xz", True),
    ("bench_steps.BIN", True),
    ("flight_t265.BIN", False),
    ("my_bench_1.BIN", False),
])  # fmt: skip
def test_kind_of_a_log_is_in_its_name(name: str, bench: bool) -> None:
    path = Path("logs") / name
    assert kind_of_log(path) == (BENCH if bench else FLIGHT)
    assert log_name(path) == name.split(".")[0]


def test_flight_that_fails_ends_there() -> None:
    path = Path("logs/flight_voxl_reset.BIN.xz")
    assert end_s(path) == 71.0
    assert end_s(path.with_name("voxl.BIN")) == float("inf")


def test_every_quantity_has_a_unit() -> None:
    assert all(UNITS[FIELDS[label]] for label in MEASURED)


def test_comparison_of_the_beginning_leaves_out_the_rest(rig: Rig) -> None:
    rig.set("PN", 50, 30)
    replay = EkfReplay(TIMES_S, rig.ours, rig.recorded, rig.our_texts, rig.recorded_texts)
    assert not compare_estimates(replay, FLIGHT).passed
    assert compare_estimates(replay.until(29.99), FLIGHT).passed
    assert replay.until(1.0).our_texts == AIDING[:1]
