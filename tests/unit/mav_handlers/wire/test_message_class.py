# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Message classes do what a frozen dataclass with slots does: the class of the standard library is the judge."""

import copy
import pickle
from collections.abc import Mapping
from dataclasses import MISSING, FrozenInstanceError, dataclass, fields, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.wire.messages import GPS_GLOBAL_ORIGIN, STATUSTEXT


@dataclass(frozen=True, slots=True)
class Judge:
    """The fields of GPS_GLOBAL_ORIGIN."""

    latitude: int
    longitude: int
    altitude: int
    time_usec: int = 0


NAMES = ("latitude", "longitude", "altitude", "time_usec", "other")
VALUES = st.none() | st.integers(-2, 2) | st.text(max_size=2) | st.just(float("nan"))
CALLS = st.tuples(st.lists(VALUES, max_size=5), st.dictionaries(st.sampled_from(NAMES), VALUES))
GOOD_CALLS = st.tuples(st.lists(VALUES, min_size=3, max_size=3), st.dictionaries(st.just("time_usec"), VALUES))

Call = tuple[list[Any], Mapping[str, Any]]


def outcome(cls: type[Any], call: Call) -> str:
    """Return what a class makes of a call, in words without the name of the class."""
    try:
        made = cls(*call[0], **call[1])
    except TypeError:
        return "TypeError"
    return repr(made).replace(cls.__qualname__, "")


@given(CALLS)
def test_values_are_taken_by_place_and_by_name_as_by_the_judge(call: Call) -> None:
    assert outcome(GPS_GLOBAL_ORIGIN, call) == outcome(Judge, call)


@given(GOOD_CALLS, GOOD_CALLS)
def test_equality_and_hash_are_those_of_the_judge(one: Call, other: Call) -> None:
    (first, second), (judge, second_judge) = (
        [cls(*values, **named) for values, named in (one, other)] for cls in (GPS_GLOBAL_ORIGIN, Judge)
    )
    assert (first == second) == (judge == second_judge)
    assert hash(first) == hash(judge)


def test_messages_of_other_classes_differ_though_all_fields_are_equal() -> None:
    assert GPS_GLOBAL_ORIGIN(1, 2, 3) != Judge(1, 2, 3)


def test_fields_can_neither_be_changed_nor_deleted_nor_added() -> None:
    origin = GPS_GLOBAL_ORIGIN(1, 2, 3)
    for name in ("latitude", "novel"):
        with pytest.raises(FrozenInstanceError):
            setattr(origin, name, 2)
        with pytest.raises(FrozenInstanceError):
            delattr(origin, name)
    assert origin == GPS_GLOBAL_ORIGIN(1, 2, 3)
    assert not hasattr(origin, "__dict__")


@given(GOOD_CALLS)
def test_a_message_survives_copying_pickling_and_replacing(call: Call) -> None:
    origin = GPS_GLOBAL_ORIGIN(*call[0], **call[1])
    assert repr(copy.deepcopy(origin)) == repr(copy.copy(origin)) == repr(origin)
    assert repr(pickle.loads(pickle.dumps(origin))) == repr(origin)
    assert replace(origin, latitude=7) == GPS_GLOBAL_ORIGIN(7, *[getattr(origin, name) for name in NAMES[1:4]])


def test_the_standard_library_sees_the_fields() -> None:
    assert [(field.name, field.default) for field in fields(GPS_GLOBAL_ORIGIN)][2:] == [
        ("altitude", MISSING),
        ("time_usec", 0),
    ]
    match STATUSTEXT(6, "Ready"):
        case STATUSTEXT(severity, text):
            assert (severity, text) == (6, "Ready")
