# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Missions, fences and rally points are uploaded, read back and deleted, item by item."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.location import Location
from mav_handlers.transfers.mission_items import (
    COMMAND_KINDS,
    MemoryItemStore,
    MissionItem,
    MissionType,
    Params,
    kept_of_mission,
)
from mav_handlers.verdicts import HANDLED, MISSION_TYPE, NO_HANDLER
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    MISSION_ACK,
    MISSION_CLEAR_ALL,
    MISSION_COUNT,
    MISSION_CURRENT,
    MISSION_ITEM,
    MISSION_ITEM_INT,
    MISSION_REQUEST,
    MISSION_REQUEST_INT,
    MISSION_REQUEST_LIST,
    MISSION_SET_CURRENT,
    MISSION_WRITE_PARTIAL_LIST,
    STATUSTEXT,
    Message,
)
from viso.firmware.releases import JULY_2025, STABLE_4_7, Firmware
from viso.vehicle.vehicle import Vehicle, VehicleConfig

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

Make = Callable[[int], Message]

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE, INVALID, INVALID_PARAM1 = range(7)
INVALID_PARAM5, INVALID_PARAM6, INVALID_PARAM7, INVALID_SEQUENCE, DENIED, OPERATION_CANCELLED = range(10, 16)
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


def item(kind: int = MISSION, seq: int = 0, current: int = 0, **fields: Any) -> MISSION_ITEM_INT:
    return replace(MISSION_ITEM_INT(1, 1, seq, 0, 16, current, 1, *ZEROS, 1, 2, 3.0, kind), **fields)


def fence(command: int, param1: float) -> MISSION_ITEM_INT:
    return item(command=command, param1=param1)


def rally() -> MISSION_ITEM_INT:
    return item(command=5100, frame=3)


MISSION_OF_THREE = [
    item(),
    item(seq=1, frame=3, command=22, x=0, y=0, z=20.0),
    item(seq=2, frame=6, param1=7.0, x=HOME.lat, y=HOME.lng, z=20.0),
]


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


@pytest.mark.parametrize(("kind", "most"), [(MISSION, 650), (FENCE, 70), (RALLY, 46)])
def test_longer_lists_are_refused(bench: "Bench", kind: int, most: int) -> None:
    assert answers(bench, MISSION_COUNT(1, 1, most + 1, kind)) == [ack(NO_SPACE, kind)]
    assert later(bench) == [STATUSTEXT(4, f"Only {most} items are supported")]
    assert answers(bench, MISSION_COUNT(1, 1, most, kind)) == [MISSION_REQUEST(*ME, 0, kind)]


def upload(bench: "Bench", items: list[MISSION_ITEM_INT], kind: int = MISSION) -> Message:
    """Upload items, each as it is requested, and return what ends that."""
    [reply] = answers(bench, MISSION_COUNT(1, 1, len(items), kind))
    for seq, one in enumerate(items):
        assert reply == MISSION_REQUEST(*ME, seq, kind)
        [reply] = answers(bench, replace(one, seq=seq, mission_type=kind))
    return reply


def read_back(bench: "Bench", kind: int = MISSION) -> list[MISSION_ITEM_INT]:
    [count] = answers(bench, MISSION_REQUEST_LIST(1, 1, kind))
    assert isinstance(count, MISSION_COUNT)
    items = [one for seq in range(count.count) for one in answers(bench, MISSION_REQUEST_INT(1, 1, seq, kind))]
    return [one for one in items if isinstance(one, MISSION_ITEM_INT)]


def test_mission_is_read_back_with_home_in_front(home: "Bench") -> None:
    assert upload(home, MISSION_OF_THREE) == ack(ACCEPTED)
    assert later(home) == [STATUSTEXT(6, "Flight plan received")]
    first, *others = read_back(home)
    assert (first.x, first.y) == (HOME.lat, HOME.lng)
    assert others == [
        MISSION_ITEM_INT(*ME, 1, 3, 22, 0, 1, *ZEROS, 0, 0, 20.0),
        MISSION_ITEM_INT(*ME, 2, 3, 16, 0, 1, 7.0, 0.0, 0.0, 0.0, HOME.lat, HOME.lng, 20.0),
    ]


def test_shorter_mission_replaces_a_longer_one(home: "Bench") -> None:
    upload(home, MISSION_OF_THREE)
    upload(home, MISSION_OF_THREE[:2])
    assert [one.command for one in read_back(home)] == [16, 22]


def test_first_item_before_home_is_set_is_kept_behind_home(
    bench: "Bench",
) -> None:
    upload(bench, MISSION_OF_THREE[:1])
    assert len(read_back(bench)) == 2
    upload(bench, MISSION_OF_THREE)
    assert [one.command for one in read_back(bench)] == [16, 22, 16]


@pytest.mark.parametrize(("kind", "items", "shown"), [
    (FENCE, [fence(5001, 3.0), fence(5001, 3.0), fence(5001, 3.0), fence(5003, 12.5)], [3.0, 3.0, 3.0, 12.5]),
    (RALLY, [rally(), rally()], [0.0, 0.0]),
])  # fmt: skip
def test_fences_and_rally_points_are_kept(
    bench: "Bench", kind: int, items: list[MISSION_ITEM_INT], shown: list[float]
) -> None:
    assert upload(bench, items, kind) == ack(ACCEPTED, kind)
    kept = read_back(bench, kind)
    assert [(one.command, one.x, one.y) for one in kept] == [(one.command, one.x, one.y) for one in items]
    assert [one.param1 for one in kept] == shown
    assert answers(bench, MISSION_COUNT(1, 1, 0, kind)) == [ack(ACCEPTED, kind)]
    assert read_back(bench, kind) == []


@pytest.mark.parametrize(("wrong", "result"), [
    (item(command=30_000), UNSUPPORTED),
    (item(command=1), INVALID),
    (item(frame=10), UNSUPPORTED_FRAME),
    (item(x=900_000_064), INVALID_PARAM5),
    (item(y=1_800_000_128), INVALID_PARAM6),
    (item(z=math.nan), INVALID_PARAM7),
    (item(param1=math.inf), INVALID_PARAM1),
    (item(command=177, param1=3.0), ERROR),
    (item(command=177, param1=0.0), ERROR),
])  # fmt: skip
def test_wrong_item_ends_the_upload(home: "Bench", wrong: MISSION_ITEM_INT, result: int) -> None:
    upload(home, MISSION_OF_THREE)
    answers(home, MISSION_COUNT(1, 1, 3))
    answers(home, MISSION_OF_THREE[0])
    assert answers(home, replace(wrong, seq=1)) == [ack(result)]
    assert answers(home, MISSION_OF_THREE[1]) == [ack(ERROR)]


@pytest.mark.parametrize(("release", "result"), [(JULY_2025, ACCEPTED), (STABLE_4_7, INVALID_PARAM1)])
def test_time_at_a_waypoint_that_does_not_fit(make_bench: "MakeBench", release: Firmware, result: int) -> None:
    bench = make_bench(firmware=release)
    assert upload(bench, [item(param1=-1.0)]) == ack(result)


def test_item_out_of_turn_does_not_end_the_upload(home: "Bench") -> None:
    answers(home, MISSION_COUNT(1, 1, 3))
    assert answers(home, replace(MISSION_OF_THREE[1], seq=1)) == [ack(INVALID_SEQUENCE)]
    assert answers(home, MISSION_OF_THREE[0]) == [MISSION_REQUEST(*ME, 1)]


def test_item_is_requested_again_every_second_for_eight_seconds(home: "Bench") -> None:
    answers(home, MISSION_COUNT(1, 1, 3))
    home.run_ms(1000)
    assert home.client.read_of(MISSION_REQUEST) == []
    home.run_ms(6990)
    assert home.client.read_of(MISSION_REQUEST) == [MISSION_REQUEST(*ME, 0)] * 7
    home.run_ms(1020)
    received = home.client.read()
    assert [one for one in received if isinstance(one, MISSION_ACK)] == [ack(OPERATION_CANCELLED)]
    assert STATUSTEXT(4, "Mission upload timeout") in received
    assert answers(home, MISSION_REQUEST_LIST(1, 1)) == [MISSION_COUNT(*ME, 1)]


def test_nobody_else_reads_or_writes_during_an_upload(make_bench: "MakeBench") -> None:
    bench = make_bench(bauds=(None, None))
    answers(bench, MISSION_COUNT(1, 1, 3))
    other = bench.clients[1]
    other.codec = Codec(7, 3)
    denied = MISSION_ACK(7, 3, DENIED)
    for message in (MISSION_REQUEST_LIST(1, 1), MISSION_REQUEST_INT(1, 1, 0), MISSION_COUNT(1, 1, 2)):
        other.tell(message)
        assert other.read() == [denied]
    other.tell(MISSION_OF_THREE[0])
    assert other.read() == []
    assert bench.client.read() == [denied]


def test_sender_may_begin_its_upload_anew(home: "Bench") -> None:
    answers(home, MISSION_COUNT(1, 1, 3))
    answers(home, MISSION_OF_THREE[0])
    assert answers(home, MISSION_COUNT(1, 1, 2)) == [MISSION_REQUEST(*ME, 0)]
    assert answers(home, MISSION_CLEAR_ALL(1, 1)) == [ack(ACCEPTED)]
    assert answers(home, MISSION_OF_THREE[0]) == [ack(ERROR)]


def test_part_of_a_mission_is_replaced(home: "Bench") -> None:
    upload(home, MISSION_OF_THREE)
    assert answers(home, MISSION_WRITE_PARTIAL_LIST(1, 1, 2, 2)) == [MISSION_REQUEST(*ME, 2)]
    assert answers(home, replace(item(command=20), seq=2)) == [ack(ACCEPTED)]
    assert [one.command for one in read_back(home)] == [16, 22, 20]


def test_part_of_a_fence_is_replaced(bench: "Bench") -> None:
    upload(bench, [fence(5003, 1.0), fence(5003, 2.0)], FENCE)
    answers(bench, MISSION_WRITE_PARTIAL_LIST(1, 1, 1, 1, FENCE))
    assert answers(bench, replace(fence(5003, 5.0), seq=1, mission_type=FENCE)) == [ack(ACCEPTED, FENCE)]
    assert [one.param1 for one in read_back(bench, FENCE)] == [1.0, 5.0]


def test_unfinished_fence_leaves_the_old_one(bench: "Bench") -> None:
    upload(bench, [fence(5003, 1.0)], FENCE)
    answers(bench, MISSION_COUNT(1, 1, 2, FENCE))
    assert answers(bench, replace(fence(16, 5.0), mission_type=FENCE)) == [ack(UNSUPPORTED, FENCE)]
    assert [one.param1 for one in read_back(bench, FENCE)] == [1.0]


def test_items_are_kept_over_a_restart() -> None:
    config = VehicleConfig()
    first = Vehicle(config)
    for kind, items in first.item_lists().items():
        items.begin(1)
        assert items.put(0, MissionItem(16 + kind))
        assert items.complete()
    first.keep_set_parameters()
    again = Vehicle(config)
    assert {kind: items.count() for kind, items in again.item_lists().items()} == {MISSION: 2, FENCE: 1, RALLY: 1}
    assert again.params.get_int("MIS_TOTAL") == 2


def test_mission_is_forgotten_at_start_up_if_asked_for() -> None:
    store = MemoryItemStore()
    store.save_if_changed({MissionType.MISSION: [MissionItem(16), MissionItem(22)]})
    vehicle = Vehicle(VehicleConfig(item_store=store, defaults={"MIS_OPTIONS": 1}))
    assert vehicle.copter.mission.count() == 0


numbers = st.floats(width=32, allow_nan=False, allow_infinity=False) | st.floats(-300, 300, width=32)


@given(
    command=st.sampled_from(sorted(COMMAND_KINDS)),
    frame=st.sampled_from([0, 3, 5, 6]),
    params=st.tuples(*[numbers] * 4),
    place=st.tuples(st.integers(-900_000_000, 900_000_000), st.integers(-1_800_000_000, 1_800_000_000)),
    z=st.floats(-82_999, 82_999, width=32),
)
def test_what_is_read_back_is_kept_as_it_is(
    command: int, frame: int, params: Params, place: tuple[int, int], z: float
) -> None:
    kept = kept_of_mission(MISSION_ITEM_INT(1, 1, 1, frame, command, 0, 1, *params, *place, z))
    assert isinstance(kept, MissionItem)
    again = MISSION_ITEM_INT(1, 1, 1, kept.frame, kept.command, 0, 1, *kept.params, kept.x, kept.y, kept.z)
    kept_again = kept_of_mission(again)
    assert isinstance(kept_again, MissionItem)
    assert replace(kept_again, z=kept.z) == kept
    if COMMAND_KINDS[command].has_place:
        assert (kept.x, kept.y) == place
        # Each time it is cut off at centimetres.
        assert abs(kept.z - z) < 0.02
        assert abs(kept_again.z - kept.z) < 0.02


@pytest.mark.parametrize(("command", "params", "kept"), [
    (16, (7.9, 1.0, 2.0, math.nan), (7.0, 0.0, 0.0, 0.0)),
    (17, (1.0, 1.0, -12.5, 0.0), (0.0, 0.0, -12.0, 0.0)),
    (18, (2.0, 9.0, -20.0, 1.0), (2.0, 0.0, -20.0, 1.0)),
    (18, (0.5, 0.0, 1234.0, 0.0), (0.5, 0.0, 1230.0, 0.0)),
    (19, (70_000.0, 0.0, -3.0, 0.5), (4464.0, 0.0, -1.0, 1.0)),
    (21, (0.0, 0.0, 0.0, math.nan), (0.0, 0.0, 0.0, 1.0)),
    (93, (1.5, -1.0, 30.0, 59.9), (1.5, -1.0, 30.0, 59.0)),
    (115, (90.5, 20.5, -1.0, 1.0), (90.5, 20.5, -1.0, 1.0)),
    (177, (1.0, -1.0, 5.0, 5.0), (1.0, -1.0, 0.0, 0.0)),
    (218, (90.0, 2.0, 5.0, 5.0), (90.0, 2.0, 0.0, 0.0)),
])  # fmt: skip
def test_what_is_kept_of_parameters(command: int, params: Params, kept: Params) -> None:
    found = kept_of_mission(MISSION_ITEM_INT(1, 1, 1, 3, command, 0, 1, *params, 0, 0, 0.0))
    assert isinstance(found, MissionItem)
    assert found.params == kept


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
@pytest.mark.parametrize("part", [(2, 2), (1, 0), (0, 2)])
def test_items_that_are_not_there_cannot_be_replaced(home: "Bench", kind: int, part: tuple[int, int]) -> None:
    assert answers(home, MISSION_WRITE_PARTIAL_LIST(1, 1, *part, kind)) == [ack(ERROR, kind)]
    assert later(home) == [STATUSTEXT(4, "Flight plan update rejected")]


@pytest.mark.parametrize(("kind", "current", "result"), [
    *((kind, 0, ERROR) for kind in (MISSION, FENCE, RALLY)),
    (MISSION, 2, ERROR),
    (MISSION, 3, ACCEPTED),
    (RALLY, 3, ERROR),
])  # fmt: skip
def test_item_that_nobody_asked_for(bench: "Bench", kind: int, current: int, result: int) -> None:
    assert answers(bench, item(kind, current=current)) == [ack(result, kind)]
    assert later(bench) == []


def test_item_for_guided_is_a_target(make_bench: "MakeBench") -> None:
    bench = make_bench(flies=True)
    bench.vehicle.set_origin(HOME)
    assert bench.client.command(176, 1, 4) == 0
    assert answers(bench, item(current=2, x=HOME.lat, y=HOME.lng, z=600.0)) == [ack(ACCEPTED)]
    assert answers(bench, item(current=2, command=20)) == [ack(ERROR)]


# The current item


def test_mission_goes_on_with_an_item_and_confirms_its_number(home: "Bench") -> None:
    upload(home, MISSION_OF_THREE)
    for asked, current in ((2, 2), (0, 1)):
        assert answers(home, MISSION_SET_CURRENT(1, 1, asked)) == [MISSION_CURRENT(asked, 2, 2, 0)]
        assert home.vehicle.copter.mission.nav_seq == current
    assert answers(home, MISSION_SET_CURRENT(1, 1, 3)) == []


@pytest.mark.parametrize(("seq", "result"), [(2, 0), (3, 2), (65_537, 0)])
def test_command_sets_the_current_item(home: "Bench", seq: int, result: int) -> None:
    upload(home, MISSION_OF_THREE)
    assert home.client.command(224, seq) == result


def test_home_alone_cannot_be_current(home: "Bench") -> None:
    assert home.client.command(224, 0) == 4


def test_mission_goes_on_at_a_tag(home: "Bench") -> None:
    upload(home, [*MISSION_OF_THREE, item(command=600, param1=5.0), item()])
    assert home.client.command(601, 5) == 0
    assert home.vehicle.copter.mission.nav_seq == 4
    assert home.client.command(601, 6) == 4
    assert home.client.command(601, 65_536) == 2


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
