# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Radios with full transmit buffers."""

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.radio import RadioLink, adapted_slowdown_ms
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.messages import ATTITUDE, HEARTBEAT, PARAM_REQUEST_LIST, PARAM_VALUE, RADIO, RADIO_STATUS

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench


def status(txbuf: int, kind: type[RADIO | RADIO_STATUS] = RADIO_STATUS) -> RADIO | RADIO_STATUS:
    return kind(100, 90, txbuf, 10, 10, 0, 0)


@pytest.mark.parametrize(
    ("before_ms", "txbuf", "after_ms"),
    [
        (0, 0, 60),
        (0, 19, 60),
        (0, 20, 20),
        (0, 49, 20),
        (100, 50, 100),
        (100, 90, 100),
        (100, 91, 80),
        (100, 96, 80),
        (200, 96, 180),
        (201, 96, 161),
        (300, 95, 280),
        (20, 100, 0),
        (15, 100, 0),
        (0, 100, 0),
        (1999, 0, 2059),
        (2000, 0, 2000),
        (2000, 49, 2000),
    ],
)
def test_slowdown_follows_the_free_buffer(before_ms: int, txbuf: int, after_ms: int) -> None:
    assert adapted_slowdown_ms(before_ms, txbuf) == after_ms


@given(st.lists(st.integers(0, 255)))
def test_slowdown_stays_within_its_limits(reports: list[int]) -> None:
    slowdown_ms = 0
    for txbuf in reports:
        slowdown_ms = adapted_slowdown_ms(slowdown_ms, txbuf)
        assert 0 <= slowdown_ms <= 2059


@pytest.mark.parametrize(("txbuf", "greater"), [(33, False), (34, True)])
def test_fresh_report_counts(txbuf: int, greater: bool) -> None:
    radio = RadioLink()
    radio.report(txbuf, 10_000_000)
    assert radio.txbuf_is_greater(33, 15_000_999) is greater


def test_report_is_forgotten_after_5_s() -> None:
    radio = RadioLink()
    radio.report(0, 10_000_000)
    assert radio.txbuf_is_greater(33, 15_001_000)


def test_all_is_free_until_a_radio_has_reported() -> None:
    assert RadioLink().txbuf_is_greater(99, 0)


@pytest.mark.parametrize("kind", [RADIO, RADIO_STATUS])
def test_report_slows_its_link_down(make_bench: "MakeBench", kind: type[RADIO | RADIO_STATUS]) -> None:
    bench = make_bench(bauds=(None, None), MAV1_EXTRA1=50, MAV2_EXTRA1=50)
    for _ in range(3):
        assert bench.client.tell(status(0, kind)) is HANDLED
    bench.run_ms(2000)
    assert [len(client.read_of(ATTITUDE)) for client in bench.clients] == [10, 100]


def test_heartbeat_is_not_slowed_down(bench: "Bench", client: "Client") -> None:
    for _ in range(40):
        client.tell(status(0))
    bench.run_ms(5000)
    assert len(client.read_of(HEARTBEAT)) == 5


def test_parameter_list_waits_for_the_radio_of_any_link(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None), until_ms=6000)
    bench.clients[1].tell(status(33))
    bench.client.tell(PARAM_REQUEST_LIST(1, 1))
    bench.run_ms(4000)
    assert bench.client.read_of(PARAM_VALUE) == []
    bench.clients[1].tell(status(34))
    bench.run_ms(2000)
    assert len(bench.client.read_of(PARAM_VALUE)) == bench.vehicle.params.count
