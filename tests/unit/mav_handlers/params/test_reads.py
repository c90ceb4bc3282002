# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The queues of parameter reads: how fast they move."""

from itertools import pairwise

import pytest

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from mav_handlers.channel import Channel
from mav_handlers.params.reads import REPLY_QUEUE_LENGTH, ParamReads, find_requested
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import PARAM_REQUEST_READ


@pytest.fixture
def params() -> ParamTable:
    return ParamTable([make_params()])


@pytest.fixture
def channel() -> Channel:
    return Channel(0, "link", Codec(1, 1))


def ask(reads: ParamReads, channel: Channel, count: int) -> None:
    for _ in range(count):
        assert reads.request(channel, PARAM_REQUEST_READ(1, 1, "VISO_TYPE", -1), 0)


def test_one_request_is_looked_up_every_millisecond(params: ParamTable, channel: Channel) -> None:
    reads = ParamReads()
    ask(reads, channel, 5)
    waiting = []
    for last_us, now_us in pairwise((0, 0, 999, 1000, 2500, 4999, 6000)):
        reads.look_up(params, last_us, now_us)
        waiting.append(reads.waiting)
    assert waiting == [5, 5, 4, 3, 1, 0]


def test_time_without_requests_is_not_made_up_for(params: ParamTable, channel: Channel) -> None:
    reads = ParamReads()
    reads.look_up(params, 0, 10_000_000)
    ask(reads, channel, 3)
    reads.look_up(params, 10_000_000, 10_001_000)
    assert reads.waiting == 2


def test_requests_wait_while_five_replies_do(params: ParamTable, channel: Channel) -> None:
    reads = ParamReads()
    ask(reads, channel, 8)
    reads.look_up(params, 0, 1_000_000)
    assert reads.waiting == 8 - REPLY_QUEUE_LENGTH
    assert reads.send(1_000_000)
    assert channel.codec.frames_sent == REPLY_QUEUE_LENGTH
    assert not reads.send(1_000_000)


@pytest.mark.parametrize(("index", "name"), [(-1, "VISO_SCALE"), (0, "VISO_TYPE"), (-2, None), (32_767, None)])
def test_only_index_minus_1_means_the_name(params: ParamTable, index: int, name: str | None) -> None:
    params.set("VISO_TYPE", 1)
    found = find_requested(params, PARAM_REQUEST_READ(1, 1, "VISO_SCALE", index))
    assert (None if found is None else found.name) == name
