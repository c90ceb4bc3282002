# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording has all that the live view shows, and nothing that a page could command."""

import itertools
import json
from typing import Any

import pytest

from tests.places import ROOT
from viso.replay.ahrs import ahrs_maker
from viso.replay.run import ReplaySetup, run_replay
from viso.streams.capture import read_capture
from viso.terminal.ahrs import AhrsChoice
from viso.web.recording import MOST_POINTS, ReplayRecorder, recording
from viso.web.server import RecordingBroadcaster, encode


@pytest.fixture(scope="module")
def shown() -> dict[str, Any]:
    """Return what a page is told of a replayed capture."""
    stream = read_capture(ROOT / "tests/data/parity/2025-07/captures/dropout.jsonl.gz")
    recorder = ReplayRecorder(stream.name)
    setup = ReplaySetup(ahrs_maker(AhrsChoice(None, None, None, 0, 0.0), "follow"), with_filter=True)
    run_replay(stream, stream.params, setup, on_start=recorder.start)
    message = json.loads(encode(recorder.message()))
    assert isinstance(message, dict)
    return message


@pytest.mark.slow
def test_recording_has_points_texts_and_verdicts_of_the_whole_replay(shown: dict[str, Any]) -> None:
    times_s = [point["t"] for point in shown["points"]]
    assert times_s == sorted(times_s)
    assert times_s[-1] - times_s[0] > 10
    assert any(point["vision"] and point["quality"] for point in shown["points"])
    assert shown["texts"]
    assert shown["runs"]
    assert shown["table"]


@pytest.mark.slow
def test_filter_is_followed_while_nothing_comes(shown: dict[str, Any]) -> None:
    followed_s = [point["t"] for point in shown["points"] if point["ekf"]]
    seen_s = [point["t"] for point in shown["points"] if point["vision"]]
    assert max(later - sooner for sooner, later in itertools.pairwise(seen_s)) > 5
    assert max(later - sooner for sooner, later in itertools.pairwise(followed_s)) < 0.5


@pytest.mark.slow
def test_moments_tell_state_and_rates_about_once_a_second(shown: dict[str, Any]) -> None:
    times_s = [moment["t"] for moment in shown["moments"]]
    assert all(later - sooner >= 1 for sooner, later in itertools.pairwise(times_s))
    assert any(rate["per_s"]["offered"] for moment in shown["moments"] for rate in moment["rates"])
    assert shown["moments"][-1]["state"]["time_s"] == pytest.approx(times_s[-1], abs=0.1)


def test_long_recording_has_no_more_points_than_a_page_can_draw() -> None:
    told = recording({"points": [{"t": number} for number in range(3 * MOST_POINTS)], "actions": ["arm"]}, [])
    assert len(told["points"]) == MOST_POINTS
    assert told["actions"] == told["faults"] == []


def test_page_of_a_recording_gets_all_of_it_and_can_change_nothing() -> None:
    shelf = RecordingBroadcaster({"type": "recording"})
    assert json.loads(shelf.everything()) == {"type": "recording"}
    answer = shelf._ask(1, '{"do":"param","name":"VISO_TYPE","value":1,"id":4}')
    assert answer is not None
    assert (answer.ok, answer.request) == (False, 4)
