# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The log as JSON lines."""

import io
import json
import logging
import uuid
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.vio.log import JsonFormatter, compact_json, finite_json, log_event


class Rig:
    """A logger whose lines are kept."""

    def __init__(self) -> None:
        self.stream = io.StringIO()
        handler = logging.StreamHandler(self.stream)
        handler.setFormatter(JsonFormatter(lambda: 1234))
        self.logger = logging.Logger("vio")
        self.logger.addHandler(handler)

    def line(self) -> dict[str, Any]:
        (line,) = self.stream.getvalue().splitlines()
        parsed = json.loads(line)
        assert isinstance(parsed, dict)
        return parsed


def test_event_has_the_standing_keys_first() -> None:
    rig = Rig()
    log_event(
        rig.logger, logging.INFO, "vio_ready", "VIO ready", {"x": 1}, strategy="klt_ransac", frame=uuid.UUID(int=7)
    )
    assert list(rig.line().items()) == [
        ("ts_ns", 1234),
        ("level", "INFO"),
        ("component", "vio"),
        ("event", "vio_ready"),
        ("strategy", "klt_ransac"),
        ("frame", "00000000-0000-0000-0000-000000000007"),
        ("msg", "VIO ready"),
        ("x", 1),
    ]


def test_warning_is_called_warn() -> None:
    rig = Rig()
    log_event(rig.logger, logging.WARNING, "vio_degraded", "VIO degraded")
    assert rig.line()["level"] == "WARN"


def test_plain_record_becomes_an_object_too() -> None:
    rig = Rig()
    rig.logger.warning("%d of %d", 3, 4)
    line = rig.line()
    assert (line["event"], line["msg"], line["strategy"], line["frame"]) == ("log", "3 of 4", None, None)


def test_percent_signs_in_a_message_are_left_alone() -> None:
    rig = Rig()
    log_event(rig.logger, logging.INFO, "x", "100 %d")
    assert rig.line()["msg"] == "100 %d"


def test_traceback_stays_on_the_line() -> None:
    rig = Rig()
    try:
        raise ValueError("bad")
    except ValueError as error:
        log_event(rig.logger, logging.ERROR, "x", "y", error=error)
    assert rig.line()["exception"].endswith("ValueError: bad")


def test_line_breaks_do_not_break_the_line() -> None:
    rig = Rig()
    rig.logger.error("two\nlines\u2028three")
    assert rig.line()["msg"] == "two\nlines\u2028three"


def test_no_field_overrides_a_standing_key() -> None:
    rig = Rig()
    log_event(rig.logger, logging.INFO, "x", "y", {"level": "lie"})
    assert rig.line()["level"] == "INFO"


@pytest.mark.parametrize("value", [np.nan, float("inf"), -np.inf, np.float64("nan"), np.float32("nan")])
def test_what_is_not_finite_is_null(value: float) -> None:
    assert compact_json({"mre": value, "all": [value, 1.5]}) == '{"mre":null,"all":[null,1.5]}'


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.array([[1.0, np.nan]]), "[[1.0,null]]"),
        (np.int64(3), "3"),
        (np.bool_(True), "true"),
        ((1, 2), "[1,2]"),
        ({3: b"x"}, '{"3":"b\'x\'"}'),
        ("\ud800", '"\\ud800"'),
    ],
)
def test_whatever_value_becomes_json(value: object, text: str) -> None:
    assert compact_json(value) == text


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(PLAIN)
def test_plain_values_stay_as_they_are(value: object) -> None:
    assert finite_json(value) == value
    assert json.loads(compact_json(value)) == value
