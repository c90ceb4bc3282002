# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes: what their texts mean, and where a sample lies on them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.errors import InputError
from viso.sweep.dimensions import MOST_VALUES, Axis, fault_field, parse_axes
from viso.terminal.settings import known_parameters

TABLE = known_parameters(1)


def axis(text: str) -> Axis:
    (found,) = parse_axes([text], TABLE)
    return found


def test_steps_include_both_ends() -> None:
    found = axis("viso_delay_ms=0:200:10")
    assert (found.name, found.values[0], found.values[-1], len(found.values)) == ("VISO_DELAY_MS", 0.0, 200.0, 21)


def test_steps_that_do_not_meet_the_end_stop_before_it() -> None:
    assert axis("VISO_DELAY_MS=0:25:10").values == (0.0, 10.0, 20.0)


def test_steps_are_the_decimals_that_one_would_write() -> None:
    assert axis("VISO_SCALE=0.8:1.2:0.1").values == (0.8, 0.9, 1.0, 1.1, 1.2)


def test_lists_keep_their_order() -> None:
    assert axis("EK3_SRC1_YAW=6,1").values == (6.0, 1.0)


def test_of_one_name_the_last_counts() -> None:
    found = parse_axes(["VISO_DELAY_MS=1", "VISO_SCALE=2", "VISO_DELAY_MS=3"], TABLE)
    assert [(one.name, one.values) for one in found] == [("VISO_DELAY_MS", (3.0,)), ("VISO_SCALE", (2.0,))]


def test_fields_of_faults_are_no_parameters() -> None:
    assert axis("faults.2.probability=0:1:0.5").values == (0.0, 0.5, 1.0)
    assert fault_field("faults.2.probability") == (2, "probability")
    assert fault_field("faults.0.probability") is None


@pytest.mark.parametrize(("text", "complaint"), [
    ("VISO_DELAY_MS", "not NAME=START:STOP:STEP, NAME=A,B,C or, with --sample, NAME=LOW:HIGH"),
    ("VISO_DELAY=1", "unknown parameter VISO_DELAY"),
    ("VISO_POS=1", "VISO_POS is a vector: set its _X, _Y or _Z"),
    ("VISO_DELAY_MS=0:10:2.5", "VISO_DELAY_MS takes whole numbers, 2.5 is none"),
    ("VISO_DELAY_MS=a", "'a' is not a finite number"),
    ("VISO_SCALE=1,nan", "'nan' is not a finite number"),
    ("VISO_SCALE=", "'' is not a finite number"),
    ("VISO_SCALE=2:1:1", "1 is not above 2"),
    ("VISO_SCALE=1:2:0", "a step of 0 does not lead from 1 to 2"),
    ("VISO_SCALE=1:2:3", "a step of 3 does not lead from 1 to 2"),
    ("VISO_SCALE=1:2:3:4", "not START:STOP:STEP"),
    ("VISO_SCALE=1,2,1", "a value is there twice"),
    ("VISO_SCALE=0:1:1e-9", f"1000000001 values; {MOST_VALUES} are the most"),
])  # fmt: skip
def test_what_cannot_be_used_is_told_in_one_line(text: str, complaint: str) -> None:
    with pytest.raises(InputError) as error:
        axis(text)
    assert str(error.value).startswith(f"--set {text!r}")
    assert str(error.value).endswith(complaint)


@given(share=st.floats(0, 1, exclude_max=True), low=st.integers(-100, 100), width=st.integers(1, 300))
def test_samples_of_whole_numbers_are_whole_and_within(share: float, low: int, width: int) -> None:
    value = Axis("N", span=(low, low + width), is_whole=True).at(share)
    assert value.is_integer()
    assert low <= value <= low + width


def test_each_whole_number_gets_the_same_share() -> None:
    span = Axis("N", span=(0, 3), is_whole=True)
    assert [span.at(share) for share in (0.0, 0.2499, 0.25, 0.5, 0.75, 1 - 1e-12)] == [0, 0, 1, 2, 3, 3]


@given(share=st.floats(0, 1, exclude_max=True))
def test_samples_of_numbers_are_within(share: float) -> None:
    assert 0.9 <= Axis("X", span=(0.9, 1.1)).at(share) <= 1.1
    assert Axis("X", (5.0, 6.0)).at(share) in (5.0, 6.0)
    assert not math.isnan(Axis("X", span=(0.9, 1.1)).at(share))
