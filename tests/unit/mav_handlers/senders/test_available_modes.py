# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of flight modes, on request."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.messages import AVAILABLE_MODES, AVAILABLE_MODES_MONITOR

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

ACCEPTED = 0
AVAILABLE_MODES_ID = 435
MONITOR_ID = 437


def request(client: "Client", index: float) -> int:
    return client.command(512, AVAILABLE_MODES_ID, index)


def indices(client: "Client") -> list[int]:
    return [message.mode_index for message in client.read_of(AVAILABLE_MODES)]


def test_mode_is_told_by_its_index(bench: "Bench", client: "Client") -> None:
    modes = bench.vehicle.copter.available_modes()
    assert request(client, 2) == ACCEPTED
    bench.run_ms(3)
    assert client.read_of(AVAILABLE_MODES) == [
        AVAILABLE_MODES(len(modes), 2, modes[1].standard_mode, modes[1].custom_mode, modes[1].properties, modes[1].name)
    ]


def test_first_mode_is_auto_rtl(bench: "Bench", client: "Client") -> None:
    request(client, 1)
    bench.run_ms(3)
    assert client.read_of(AVAILABLE_MODES) == [AVAILABLE_MODES(24, 1, 0, 27, 0, "AUTO RTL")]


def test_each_mode_can_be_asked_for(bench: "Bench", client: "Client") -> None:
    for index in range(1, 25):
        request(client, index)
        bench.run_ms(3)
        assert indices(client) == [index]


@pytest.mark.parametrize("index", [25.0, 255.0, -1.0])
def test_mode_that_there_is_not_is_accepted_and_not_told(bench: "Bench", client: "Client", index: float) -> None:
    assert request(client, index) == ACCEPTED
    bench.run_ms(1000)
    assert indices(client) == []


def test_request_for_all_gets_the_first_one_only(bench: "Bench", client: "Client") -> None:
    request(client, 0)
    bench.run_ms(5000)
    assert indices(client) == [1]


def test_others_come_at_the_rate_of_the_parameters(make_bench: "MakeBench") -> None:
    bench = make_bench(MAV1_PARAMS=10)
    request(bench.client, 0)
    bench.run_ms(1050)
    assert indices(bench.client) == list(range(1, 12))
    bench.run_ms(5000)
    assert indices(bench.client) == list(range(12, 25))


def test_each_further_request_for_all_starts_over(bench: "Bench", client: "Client") -> None:
    for _ in range(2):
        request(client, 0)
        bench.run_ms(10)
        assert indices(client) == [1]


def test_list_is_told_to_whom_asks(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None), MAV1_PARAMS=50, MAV2_PARAMS=50)
    request(bench.clients[1], 0)
    bench.run_ms(2000)
    assert [len(indices(client)) for client in bench.clients] == [0, 24]


def test_monitor_is_streamed_after_the_first_request(bench: "Bench", client: "Client") -> None:
    bench.run_ms(6000)
    assert client.read_of(AVAILABLE_MODES_MONITOR) == []
    request(client, 1)
    bench.run_ms(10_000)
    assert client.read_of(AVAILABLE_MODES_MONITOR) == [AVAILABLE_MODES_MONITOR(0)] * 2


def test_monitor_can_be_asked_for(bench: "Bench", client: "Client") -> None:
    assert client.command(512, MONITOR_ID) == ACCEPTED
    bench.run_ms(3)
    assert client.read_of(AVAILABLE_MODES_MONITOR) == [AVAILABLE_MODES_MONITOR(0)]
