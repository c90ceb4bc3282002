# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenario files: those that come along, and what is told of bad ones."""

import pytest

from viso.errors import InputError
from viso.recording.scenario import SCENARIOS, STEPS, Change, Start, parse_scenario, read_scenario

GOOD = "name: good\nabout: x\nsteps: [pause: 1]\n"


def test_every_scenario_that_comes_along_can_be_read() -> None:
    scenarios = {name: read_scenario(name) for name in SCENARIOS}
    assert {name: one.name for name, one in scenarios.items()} == {name: name for name in SCENARIOS}
    assert all(one.about for one in scenarios.values())


def test_every_kind_of_step_is_in_a_scenario() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in SCENARIOS.values())
    assert [name for name in STEPS if f"- {name}:" not in text] == []


def test_streams_take_what_they_say_and_changes_no_more() -> None:
    text = GOOD.replace(
        "[pause: 1]",
        "\n- stream: {message: ODOMETRY, rate_hz: 10, quality: -1, covariance: [.nan, 1]}\n- change: {quality: 5}",
    )
    start, change = parse_scenario(text, "x").steps
    assert isinstance(start, Start)
    assert isinstance(change, Change)
    [stream] = start.streams
    assert (stream.rate_hz, stream.quality, stream.covariance[1]) == (10, -1, 1)
    assert change.values == {"quality": 5}


BAD = {
    "not YAML": ("name: [", "s.yaml: not YAML: line"),
    "no mapping": ("- 1", "s.yaml: not a mapping of names to values: [1]"),
    "no name": ("about: x\nsteps: [pause: 1]", "s.yaml: name: missing"),
    "a path": (GOOD.replace("good", "../x"), "s.yaml: name: '../x' is no name for files"),
    "a field too many": (GOOD + "colour: red", "s.yaml: colour: no such field"),
    "a parameter": (GOOD + "parameters: {VISO_TYPE: one}", "s.yaml: parameters: VISO_TYPE: 'one' is not a number"),
    "no steps": ("name: a\nabout: x\nsteps: []", "s.yaml: steps: missing, or empty"),
    "a step": (GOOD.replace("pause", "sleep"), "s.yaml: step 1: sleep: no such step; there are stream,"),
    "a time": (GOOD.replace("1]", "-1]"), "s.yaml: step 1: pause: -1 is not a number between 0 and 3600"),
    "a message": (GOOD.replace("pause: 1", "stream: {message: POSE}"), "s.yaml: step 1: stream 1: message: 'POSE' is"),
    "a rate": (
        GOOD.replace("pause: 1", "stream: {message: ODOMETRY, rate_hz: 0}"),
        "s.yaml: step 1: stream 1: rate_hz: 0 is not a number between 0.1 and 400",
    ),
    "a flag": (
        GOOD.replace("pause: 1", "until: {ekf: [happy]}"),
        "s.yaml: step 1: until: ekf: ['happy'] is not a list",
    ),
    "nothing": (GOOD.replace("pause: 1", "until: {timeout_s: 5}"), "s.yaml: step 1: until: nothing to wait for"),
    "a field of a message": (
        GOOD.replace("pause: 1", "send: [HEARTBEAT, {colour: 1}]"),
        "s.yaml: step 1: send: HEARTBEAT: colour: no such field",
    ),
    "a value of a message": (
        GOOD.replace("pause: 1", "send: [HEARTBEAT, {type: 999}]"),
        "s.yaml: step 1: send: a field does not fit its type",
    ),
    "truth on the bench": (
        GOOD.replace("pause: 1", "stream: {message: ODOMETRY, motion: truth}"),
        "s.yaml: needs_flight: motion 'truth' needs it to be true",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_file_is_told_in_one_line_that_names_file_and_field(kind: str) -> None:
    text, told = BAD[kind]
    with pytest.raises(InputError) as caught:
        parse_scenario(text, "s.yaml")
    assert str(caught.value).startswith(told)
    assert "\n" not in str(caught.value)
