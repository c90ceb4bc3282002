# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Missions, fences and rally points: home is the only item, and there is no room for others."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

from ap_core.location import Location
from mav_handlers.verdicts import HANDLED, MISSION_TYPE, NO_HANDLER
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    MISSION_ACK,
    MISSION_CLEAR_ALL,
    MISSION_COUNT,
    MISSION_ITEM,
    MISSION_ITEM_INT,
    MISSION_REQUEST,
    MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST,
    MISSION_WRITE_PARTIAL_LIST,
    STATUSTEXT,
    Message,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

Make = Callable[[int], Message]

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
ACCEPTED, ERROR, UNSUPPORTED, NO_SPACE, INVALID_SEQUENCE = 0, 1, 3, 4, 13
HOME = Location(-353_632_610, 1_491_652_300, 58_412)
ME = (255, 190)
ZEROS = (0.0,) * 4
every_type = pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
unsupported_type = pytest.mark.parametrize("kind", [3, ALL])


@pytest.fixture
def home(bench: "Bench") -> "Bench":
    """Return a vehicle with a home."""
    bench.vehicle.set_origin(HOME)
    assert bench.vehicle.copter.home.set(HOME, lock=True)
    bench.run_ms(10)
    bench.client.read()
    return bench


def answers(bench: "Bench", message: Message) -> list[Message]:
    bench.client.tell(message)
    return bench.client.read()


def later(bench: "Bench") -> list[STATUSTEXT]:
    bench.run_ms(3)
    return bench.client.read_of(STATUSTEXT)


def item(kind: int = MISSION, seq: int = 0, current: int = 0) -> MISSION_ITEM_INT:
    return MISSION_ITEM_INT(1, 1, seq, 0, 16, current, 1, *ZEROS, 1, 2, 3.0, kind)


def ack(result: int, kind: int = MISSION) -> MISSION_ACK:
    return MISSION_ACK(*ME, result, kind)


# Reading


@every_type
def test_there_are_no_items_before_home_is_set(bench: "Bench", kind: int) -> None:
    assert answers(bench, MISSION_REQUEST_LIST(1, 1, kind)) == [MISSION_COUNT(*ME, 0, kind)]


@pytest.mark.parametrize(("kind", "count"), [(MISSION, 1), (FENCE, 0), (RALLY, 0)])
def test_home_is_the_first_item_of_the_mission(home: "Bench", kind: int, count: int) -> None:
    assert answers(home, MISSION_REQUEST_LIST(1, 1, kind)) == [MISSION_COUNT(*ME, count, kind)]


def test_home_can_be_read(home: "Bench") -> None:
    [reply] = answers(home, MISSION_REQUEST_INT(1, 1, 0))
    altitude_m = 584.1199951171875
    assert reply == MISSION_ITEM_INT(*ME, 0, 0, 16, 0, 1, *ZEROS, HOME.lat, HOME.lng, altitude_m)


def test_home_can_be_read_before_it_is_set(bench: "Bench") -> None:
    assert answers(bench, MISSION_REQUEST_INT(1, 1, 0)) == [MISSION_ITEM_INT(*ME, 0, 0, 16, 0, 1, *ZEROS, 0, 0, 0.0)]


def test_home_in_degrees_comes_with_advice_once(home: "Bench") -> None:
    for texts in ([STATUSTEXT(4, "got MISSION_REQUEST; use MISSION_REQUEST_INT!")], []):
        [reply] = answers(home, MISSION_REQUEST(1, 1, 0))
        assert isinstance(reply, MISSION_ITEM)
        assert (reply.x, reply.y, reply.z) == pytest.approx((-35.363261, 149.16523, 584.12))
        assert reply == MISSION_ITEM(*ME, 0, 0, 16, 0, 1, *ZEROS, reply.x, reply.y, reply.z)
        assert later(home) == texts


@pytest.mark.parametrize(("kind", "seq"), [(MISSION, 1), (MISSION, 65535), (FENCE, 0), (RALLY, 0)])
def test_item_that_is_not_there_is_answered_with_the_count(home: "Bench", kind: int, seq: int) -> None:
    count = MISSION_COUNT(*ME, 1 if kind == MISSION else 0, kind)
    assert answers(home, MISSION_REQUEST_INT(1, 1, seq, kind)) == [count, ack(INVALID_SEQUENCE, kind)]
    assert answers(home, MISSION_REQUEST(1, 1, seq, kind)) == [ack(INVALID_SEQUENCE, kind)]
    assert later(home) == []


# Writing


@every_type
def test_nothing_can_be_uploaded(bench: "Bench", kind: int) -> None:
    assert answers(bench, MISSION_COUNT(1, 1, 3, kind)) == [ack(NO_SPACE, kind)]
    assert later(bench) == [STATUSTEXT(4, "Only 0 items are supported")]


@pytest.mark.parametrize(("kind", "texts"), [
    (MISSION, [STATUSTEXT(6, "Flight plan received")]), (FENCE, []), (RALLY, []),
])  # fmt: skip
def test_empty_upload_is_accepted(home: "Bench", kind: int, texts: list[STATUSTEXT]) -> None:
    assert answers(home, MISSION_COUNT(1, 1, 0, kind)) == [ack(ACCEPTED, kind)]
    assert later(home) == texts


@every_type
@pytest.mark.parametrize(
    "make", [lambda kind: MISSION_CLEAR_ALL(1, 1, kind), lambda kind: MISSION_COUNT(1, 1, 0, kind)]
)
def test_cleared_mission_lacks_home_until_that_is_set_again(home: "Bench", kind: int, make: Make) -> None:
    assert answers(home, make(kind)) == [ack(ACCEPTED, kind)]
    left = 0 if kind == MISSION else 1
    assert answers(home, MISSION_REQUEST_LIST(1, 1)) == [MISSION_COUNT(*ME, left)]
    home.vehicle.copter.home.set(HOME, lock=True)
    assert answers(home, MISSION_REQUEST_LIST(1, 1)) == [MISSION_COUNT(*ME, 1)]


@every_type
def test_part_of_a_list_cannot_be_replaced(home: "Bench", kind: int) -> None:
    assert answers(home, MISSION_WRITE_PARTIAL_LIST(1, 1, 0, 0, kind)) == [ack(ERROR, kind)]
    assert later(home) == [STATUSTEXT(4, "Flight plan update rejected")]


@every_type
@pytest.mark.parametrize("current", [0, 2, 3])
def test_item_that_nobody_asked_for_is_an_error(bench: "Bench", kind: int, current: int) -> None:
    assert answers(bench, item(kind, current=current)) == [ack(ERROR, kind)]
    assert later(bench) == []


def test_item_in_degrees_comes_with_advice_once(bench: "Bench") -> None:
    old = MISSION_ITEM(1, 1, 0, 0, 16, 0, 1, *ZEROS, 1.0, 2.0, 3.0)
    for texts in ([STATUSTEXT(4, "got MISSION_ITEM; GCS should send MISSION_ITEM_INT")], []):
        assert answers(bench, old) == [ack(ERROR)]
        assert later(bench) == texts


# Kinds and links


@unsupported_type
@pytest.mark.parametrize("make", [
    lambda kind: MISSION_REQUEST_LIST(1, 1, kind),
    lambda kind: MISSION_COUNT(1, 1, 0, kind),
    lambda kind: MISSION_CLEAR_ALL(1, 1, kind),
    lambda kind: MISSION_WRITE_PARTIAL_LIST(1, 1, 0, 0, kind),
    item,
])  # fmt: skip
def test_other_kinds_are_not_supported(bench: "Bench", kind: int, make: Make) -> None:
    assert answers(bench, make(kind)) == [ack(UNSUPPORTED, kind)]


@unsupported_type
@pytest.mark.parametrize("request_type", [MISSION_REQUEST, MISSION_REQUEST_INT])
def test_request_for_an_item_of_another_kind_is_dropped(
    client: "Client", kind: int, request_type: type[MISSION_REQUEST | MISSION_REQUEST_INT]
) -> None:
    assert client.tell(request_type(1, 1, 0, kind)) is MISSION_TYPE
    assert client.read() == []


@pytest.mark.parametrize("message", [
    MISSION_REQUEST_LIST(1, 1, FENCE),
    MISSION_COUNT(1, 1, 0, RALLY),
    MISSION_WRITE_PARTIAL_LIST(1, 1, 0, 0, FENCE),
    MISSION_REQUEST(1, 1, 0, FENCE),
    MISSION_REQUEST_INT(1, 1, 0, RALLY),
], ids=lambda message: type(message).__name__)  # fmt: skip
def test_fences_and_rally_points_need_mavlink_2(bench: "Bench", message: Message) -> None:
    bench.client.channel.codec.version = 1
    assert answers(bench, message) == [ack(UNSUPPORTED)]
    assert later(bench) == [STATUSTEXT(4, "Need mavlink2 for item transfer")]


def test_answers_go_to_the_sender_on_its_link(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None))
    bench.clients[1].codec = Codec(7, 3)
    assert bench.clients[1].tell(MISSION_REQUEST_LIST(1, 1)) is HANDLED
    assert bench.clients[1].read() == [MISSION_COUNT(7, 3, 0)]
    assert bench.client.read() == []


def test_end_of_a_client_s_transfer_is_ignored(client: "Client") -> None:
    assert client.tell(MISSION_ACK(1, 1, 0)) is NO_HANDLER
    assert client.read() == []
