# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The doctor gets the last minute of what came, and tells what it finds in words and for machines."""

import asyncio
from collections.abc import Callable

import pytest

from ap_visualodom.verdicts import CONSUMED
from mav_handlers.endpoint import MessageEvent
from mav_handlers.wire.codec import Header
from mav_handlers.wire.messages import ODOMETRY
from tests.unit.viso.conftest import Bench
from tests.unit.viso.web.test_live_state import Watched
from viso.web.diagnosis import KEPT_US, RecentFrames, examine
from viso.web.requests import asks_for_diagnosis


def event(now_us: int, frame: bytes) -> MessageEvent:
    """Return a message that was dealt with at a time."""
    header = Header(ODOMETRY.__name__, 331, 1, 197, 0, 2, frame)
    return MessageEvent(0, now_us, header.name, header, None, CONSUMED)


def test_frames_older_than_a_minute_are_forgotten() -> None:
    recent = RecentFrames()
    for now_us in (0, 1_000_000, KEPT_US + 500_000):
        recent.take(event(now_us, b"\x01\x02"))
    assert recent.as_lists() == [(1_000_000, "0102"), (KEPT_US + 500_000, "0102")]
    recent.restart()
    assert recent.as_lists() == []


@pytest.mark.parametrize("text", ['{"do":"action","name":"arm"}', "{", "", "[1]"])
def test_only_a_wish_for_a_diagnosis_is_one(text: str) -> None:
    assert asks_for_diagnosis('{"do":"diagnose","id":1}')
    assert not asks_for_diagnosis(text)


@pytest.mark.slow
def test_doctor_finds_what_is_wrong_with_the_last_minute(make_bench: Callable[..., Bench]) -> None:
    watched = Watched(make_bench(VISO_TYPE=0))
    watched.bench.see(3)
    watched.batch()
    report = asyncio.run(examine(watched.state.material()))
    assert report is not None
    assert report["count"] in report["text"]
    codes = [finding["code"] for finding in report["json"]["findings"]]
    assert codes
    assert all(code in report["text"] for code in codes)


@pytest.mark.slow
def test_doctor_that_fails_finds_nothing() -> None:
    assert asyncio.run(examine({})) is None
