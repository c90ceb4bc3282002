# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameter protocol: list, read, set."""

import math
from typing import TYPE_CHECKING

import pytest

from ap_visualodom.ap_visualodom import make_params
from mav_handlers.verdicts import (
    HANDLED,
    PARAM_NOT_FINITE,
    PARAM_QUEUE_FULL,
    PARAM_READ_ONLY,
    PARAM_UNKNOWN,
)
from mav_handlers.wire.messages import (
    ATTITUDE,
    HEARTBEAT,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_SET,
    PARAM_VALUE,
    STATUSTEXT,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

NO_INDEX = 65535
INT8, INT16, INT32, REAL32 = 2, 4, 6, 9
LIST = PARAM_REQUEST_LIST(1, 1)


@pytest.fixture
def filter_starts() -> bool:
    return False


def by_name(name: str) -> PARAM_REQUEST_READ:
    return PARAM_REQUEST_READ(1, 1, name, -1)


def by_index(index: int) -> PARAM_REQUEST_READ:
    return PARAM_REQUEST_READ(1, 1, "", index)


def to_set(name: str, value: float, wire_type: int = REAL32) -> PARAM_SET:
    return PARAM_SET(1, 1, name, value, wire_type)


def values(client: "Client") -> list[PARAM_VALUE]:
    return client.read_of(PARAM_VALUE)


def answer(bench: "Bench", request: PARAM_REQUEST_READ) -> PARAM_VALUE:
    bench.client.tell(request)
    bench.run_ms(100)
    [value] = values(bench.client)
    return value


def stored(bench: "Bench", name: str, value: float) -> int:
    bench.client.tell(to_set(name, value))
    return bench.vehicle.params.get_int(name)


def echo(bench: "Bench", name: str, value: float) -> list[PARAM_VALUE]:
    bench.client.tell(to_set(name, value))
    bench.run_ms(3)
    return values(bench.client)


def fill(client: "Client") -> None:
    while client.channel.send(HEARTBEAT(6, 8, 0, 0, 4, 3)):
        pass


class TestList:
    """PARAM_REQUEST_LIST."""

    def test_every_parameter_comes_once_in_order(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(LIST) is HANDLED
        bench.run_ms(1000)
        assert [(value.param_index, value.param_id) for value in values(client)] == [
            (param.index, param.name) for param in bench.vehicle.params
        ]

    def test_list_begins_with_format_version_at_index_0(self, bench: "Bench", client: "Client") -> None:
        client.tell(LIST)
        bench.run_ms(1000)
        count = bench.vehicle.params.count
        assert values(client)[0] == PARAM_VALUE("FORMAT_VERSION", 120.0, INT16, count, 0)

    def test_banner_comes_first(self, quiet_bench: "Bench") -> None:
        quiet_bench.client.tell(LIST)
        quiet_bench.run_ms(1000)
        kinds = [type(message) for message in quiet_bench.client.read()]
        assert kinds[:3] == [STATUSTEXT] * 3
        assert STATUSTEXT not in kinds[3:]

    def test_banner_is_for_the_requester_alone(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None), until_ms=7000)
        bench.clients[1].tell(LIST)
        bench.clients[0].tell(LIST)
        bench.run_ms(1000)
        assert [len(client.read_of(STATUSTEXT)) for client in bench.clients] == [3, 3]

    def test_banner_names_firmware_and_frame(self, bench: "Bench", client: "Client") -> None:
        client.tell(LIST)
        bench.run_ms(3)
        firmware, system, frame = client.read_of(STATUSTEXT)
        assert firmware.text.startswith("ArduCopter V4.7.0-dev (")
        assert len(system.text) == 32
        assert (frame.text, frame.severity) == ("Frame: QUAD/PLUS", 6)

    def test_first_part_comes_after_100_ms(self, bench: "Bench", client: "Client") -> None:
        client.tell(LIST)
        bench.run_ms(97)
        assert values(client) == []
        bench.run_ms(3)
        assert values(client) != []

    def test_list_comes_with_the_next_turn(self, bench: "Bench", client: "Client") -> None:
        bench.run_ms(60)
        client.tell(LIST)
        bench.run_ms(37)
        assert values(client) == []
        bench.run_ms(3)
        assert values(client) != []

    @pytest.mark.parametrize(
        ("rate_hz", "turns"),
        [(0, 10), (4, 4), (50, 50), *(pytest.param(rate, rate, marks=pytest.mark.slow) for rate in (1, 20))],
    )
    def test_turns_come_at_the_rate_of_the_group(self, make_bench: "MakeBench", rate_hz: int, turns: int) -> None:
        bench = make_bench(bauds=(1200,), MAV1_PARAMS=rate_hz, until_ms=6000)
        bench.client.tell(LIST)
        bench.run_ms(1000)
        # So slow a link gets one parameter a turn.
        assert len(values(bench.client)) == turns

    def test_new_request_starts_over(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,))
        bench.client.tell(LIST)
        bench.run_ms(350)
        bench.client.tell(LIST)
        bench.run_ms(100)
        # The second list has had half a turn's bandwidth when its first turn comes.
        indices = [value.param_index for value in values(bench.client)]
        assert indices == [*range(15), *range(4)]

    def test_count_is_that_of_the_start_whatever_comes_after_it(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,), VISO_TYPE=0)
        count = bench.vehicle.params.count
        bench.client.tell(LIST)
        bench.run_ms(250)
        bench.client.tell(to_set("VISO_TYPE", 1))
        bench.run_ms((bench.vehicle.params.count // 5 + 20) * 100)
        listed = [value for value in values(bench.client) if value.param_index != NO_INDEX]
        assert bench.vehicle.params.count > count
        assert [value.param_index for value in listed] == list(range(bench.vehicle.params.count))
        assert {value.param_count for value in listed} == {count}

    def test_list_that_has_become_shorter_ends(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,))
        bench.client.tell(LIST)
        bench.client.tell(to_set("VISO_TYPE", 0))
        bench.run_ms((bench.vehicle.params.count // 5 + 20) * 100)
        assert bench.client.channel.param_list is None
        assert values(bench.client)[-1].param_index == bench.vehicle.params.count - 1

    def test_disabled_group_shows_its_first_parameter_only(self, make_bench: "MakeBench") -> None:
        with_group = make_bench(VISO_TYPE=1).vehicle.params.count
        assert make_bench(VISO_TYPE=0).vehicle.params.count == with_group - len(make_params().slots) + 1

    def test_list_ends_when_fewer_parameters_are_left_than_were_sent(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,))
        count = bench.vehicle.params.count
        bench.client.tell(LIST)
        bench.run_ms((count // 5 - 1) * 100)
        sent = len(values(bench.client))
        assert count - 10 < sent < count
        bench.client.tell(to_set("VISO_TYPE", 0))
        assert bench.vehicle.params.count < sent
        bench.run_ms(100)
        assert bench.client.channel.param_list is None
        assert [value.param_index for value in values(bench.client)] == [NO_INDEX]

    @pytest.mark.parametrize(("baud", "per_run"), [(115200, 5), (57600, 4), (19200, 1), (9600, 1)])
    def test_uart_gets_a_share_of_its_bandwidth_and_at_least_one(
        self, make_bench: "MakeBench", baud: int, per_run: int
    ) -> None:
        bench = make_bench(bauds=(baud,))
        bench.client.tell(LIST)
        bench.run_ms(100)
        assert len(values(bench.client)) == per_run

    def test_list_goes_on_where_a_full_link_stopped_it(self, bench: "Bench", client: "Client") -> None:
        client.tell(LIST)
        fill(client)
        bench.run_ms(300)
        client.channel.take_output()
        bench.run_ms(500)
        assert [value.param_index for value in values(client)] == list(range(bench.vehicle.params.count))

    def test_telemetry_is_four_times_slower_meanwhile(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(57600,), MAV1_EXTRA1=4)
        bench.client.tell(LIST)
        bench.run_ms(2000)
        assert len(bench.client.read_of(ATTITUDE)) == 2

    def test_list_goes_to_the_link_that_asked(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(LIST)
        bench.run_ms(1000)
        assert values(bench.clients[0]) == []


class TestRead:
    """PARAM_REQUEST_READ."""

    def test_read_by_index_echoes_the_index(self, bench: "Bench") -> None:
        assert answer(bench, by_index(0)) == PARAM_VALUE("FORMAT_VERSION", 120.0, INT16, bench.vehicle.params.count, 0)

    def test_read_by_name_has_no_index(self, bench: "Bench") -> None:
        value = answer(bench, by_name("VISO_DELAY_MS"))
        assert value == PARAM_VALUE("VISO_DELAY_MS", 10.0, INT16, bench.vehicle.params.count, NO_INDEX)

    def test_name_comes_back_as_it_was_spelled(self, bench: "Bench") -> None:
        assert answer(bench, by_name("viso_type")).param_id == "viso_type"

    def test_name_of_16_characters_has_no_terminator(self, bench: "Bench") -> None:
        longest = next(param.name for param in bench.vehicle.params if len(param.name) == 16)
        assert answer(bench, by_name(longest)).param_id == longest

    def test_vector_s_own_name_gives_nan(self, bench: "Bench") -> None:
        value = answer(bench, by_name("VISO_POS"))
        assert math.isnan(value.param_value)
        assert value.param_type == REAL32

    @pytest.mark.parametrize(
        "name",
        ["SYSID_THISMAV", "SR0_POSITION", "ARMING_SKIPCHK", "VISO_POS_x", "", "\N{LATIN SMALL LETTER U WITH ACUTE}"],
    )
    def test_unknown_name_gets_no_reply(self, bench: "Bench", client: "Client", name: str) -> None:
        assert client.tell(by_name(name)) is PARAM_UNKNOWN
        bench.run_ms(500)
        assert client.read() == []

    @pytest.mark.parametrize("index", [10_000, 32_767, -2, -32_768])
    def test_unknown_index_gets_no_reply(self, bench: "Bench", client: "Client", index: int) -> None:
        assert client.tell(by_index(index)) is PARAM_UNKNOWN
        bench.run_ms(500)
        assert client.read() == []

    def test_hidden_group_answers_by_name(self, make_bench: "MakeBench") -> None:
        assert answer(make_bench(VISO_TYPE=0), by_name("VISO_SCALE")).param_value == 1

    @pytest.mark.parametrize(
        ("name", "wire_type"),
        [("VISO_TYPE", INT8), ("VISO_DELAY_MS", INT16), ("LOG_BITMASK", INT32), ("VISO_SCALE", 9)],
    )
    def test_type_is_the_stored_one(self, bench: "Bench", name: str, wire_type: int) -> None:
        assert answer(bench, by_name(name)).param_type == wire_type

    def test_reply_comes_with_the_next_turn(self, bench: "Bench", client: "Client") -> None:
        bench.run_ms(60)
        client.tell(by_index(0))
        bench.run_ms(37)
        assert client.read() == []
        bench.run_ms(3)
        assert len(client.read()) == 1

    def test_replies_leave_five_at_a_time_every_100_ms(self, bench: "Bench", client: "Client") -> None:
        for index in range(12):
            client.tell(by_index(index))
        counts = []
        for _ in range(3):
            bench.run_ms(100)
            counts.append(len(values(client)))
        assert counts == [5, 5, 2]

    def test_twenty_requests_may_wait(self, bench: "Bench", client: "Client") -> None:
        verdicts = [client.tell(by_index(0)) for _ in range(60)]
        assert verdicts == [HANDLED] * 20 + [PARAM_QUEUE_FULL] * 40
        bench.run_ms(900)
        assert len(values(client)) == 20

    def test_unknown_parameters_wait_in_the_queue_as_well(self, bench: "Bench", client: "Client") -> None:
        assert [client.tell(by_name("NONE")) for _ in range(21)] == [PARAM_UNKNOWN] * 20 + [PARAM_QUEUE_FULL]
        bench.run_ms(50)
        assert client.tell(by_name("NONE")) is PARAM_UNKNOWN

    def test_value_is_that_of_the_time_when_the_request_is_looked_up(self, bench: "Bench", client: "Client") -> None:
        client.tell(by_name("VISO_SCALE"), to_set("VISO_SCALE", 2.0))
        bench.run_ms(95)
        client.read()
        client.tell(to_set("VISO_SCALE", 3.0))
        bench.run_ms(5)
        echo_and_reply = [value.param_value for value in values(client)]
        assert echo_and_reply == [3, 2]

    def test_replies_wait_until_the_peer_reads(self, bench: "Bench", client: "Client") -> None:
        client.tell(by_index(3))
        fill(client)
        bench.run_ms(500)
        client.channel.take_output()
        bench.run_ms(100)
        assert [value.param_index for value in values(client)] == [3]

    def test_reply_goes_to_the_link_that_asked(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(by_index(0))
        bench.run_ms(100)
        assert [len(values(client)) for client in bench.clients] == [0, 1]

    def test_all_links_share_the_queue_and_each_has_its_turn(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        for client in bench.clients:
            for _ in range(10):
                client.tell(by_index(0))
        assert bench.client.tell(by_index(0)) is PARAM_QUEUE_FULL
        bench.run_ms(100)
        assert [len(values(client)) for client in bench.clients] == [5, 0]
        bench.run_ms(100)
        assert [len(values(client)) for client in bench.clients] == [5, 0]

    def test_full_link_holds_up_the_replies_of_all(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        fill(bench.client)
        bench.client.tell(by_index(1))
        bench.clients[1].tell(by_index(2))
        bench.run_ms(300)
        assert values(bench.clients[1]) == []
        bench.client.channel.take_output()
        bench.run_ms(100)
        assert [value.param_index for value in values(bench.clients[1])] == [2]

    def test_replies_take_the_whole_turn_of_a_list(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(115200,))
        bench.client.tell(LIST, by_index(9))
        bench.run_ms(200)
        assert [value.param_index for value in values(bench.client)] == [9, 0, 1, 2, 3, 4]

    def test_reply_that_finds_no_room_keeps_some_on_every_link(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, 115200))
        uart = bench.clients[1].channel
        without = uart.arrival_us(PARAM_VALUE, bench.now_us, bench.now_us)
        fill(bench.client)
        bench.client.tell(by_index(1))
        assert without - uart.arrival_us(PARAM_VALUE, bench.now_us, bench.now_us) == 86 * 100
        bench.run_ms(2000)
        now_us = bench.now_us
        assert now_us - uart.arrival_us(PARAM_VALUE, now_us, now_us) == 86 * (25 + 12 + 100)
        bench.client.channel.take_output()
        bench.run_ms(2100)
        now_us = bench.now_us
        assert now_us - uart.arrival_us(PARAM_VALUE, now_us, now_us) == 86 * (25 + 12)


class TestSet:
    """PARAM_SET."""

    @pytest.mark.parametrize(
        ("value", "kept"),
        [(10.6, 10), (-10.6, -10), (9.99, 10), (9.98, 9), (300.0, 127), (-300.0, -128), (99.0, 99), (-1.0, -1)],
    )
    def test_int8_is_rounded_up_a_little_limited_and_truncated(self, bench: "Bench", value: float, kept: int) -> None:
        assert stored(bench, "VISO_QUAL_MIN", value) == kept

    @pytest.mark.parametrize(("value", "kept"), [(99_999.0, 32_767), (-99_999.0, -32_768), (3e38, 32_767)])
    def test_int16_is_limited(self, bench: "Bench", value: float, kept: int) -> None:
        assert stored(bench, "VISO_DELAY_MS", value) == kept

    def test_documented_range_is_not_enforced(self, bench: "Bench") -> None:
        assert stored(bench, "VISO_TYPE", 99) == 99

    @pytest.mark.parametrize("wire_type", [0, INT8, INT32, REAL32, 10, 255])
    def test_type_in_the_packet_is_ignored(self, bench: "Bench", client: "Client", wire_type: int) -> None:
        client.tell(to_set("VISO_SCALE", 1.5, wire_type))
        assert bench.vehicle.params.get_float("VISO_SCALE") == 1.5

    @pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
    def test_value_that_is_not_finite_is_ignored_in_silence(
        self, bench: "Bench", client: "Client", value: float
    ) -> None:
        assert client.tell(to_set("VISO_SCALE", value)) is PARAM_NOT_FINITE
        bench.run_ms(500)
        assert client.read() == []
        assert bench.vehicle.params.get_float("VISO_SCALE") == 1

    def test_unknown_name_is_ignored_in_silence(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(to_set("SYSID_THISMAV", 3)) is PARAM_UNKNOWN
        bench.run_ms(500)
        assert client.read() == []

    def test_echo_has_canonical_name_own_type_and_no_index(self, bench: "Bench") -> None:
        count = bench.vehicle.params.count
        assert echo(bench, "viso_delay_ms", 20) == [PARAM_VALUE("VISO_DELAY_MS", 20.0, INT16, count, NO_INDEX)]

    def test_echo_carries_the_value_that_was_kept(self, bench: "Bench") -> None:
        assert [value.param_value for value in echo(bench, "VISO_QUAL_MIN", 300)] == [127]

    def test_echo_goes_to_every_active_link(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None, None))
        bench.clients[2].tell(by_index(10_000))
        assert len(echo(bench, "VISO_SCALE", 2)) == 1
        assert [len(values(client)) for client in bench.clients[1:]] == [0, 1]

    def test_echo_tells_the_count_of_that_moment(self, bench: "Bench") -> None:
        before = bench.vehicle.params.count
        [value] = echo(bench, "VISO_TYPE", 0)
        assert value.param_count < before

    def test_default_that_was_never_stored_is_echoed_as_real32(self, bench: "Bench") -> None:
        [value] = echo(bench, "VISO_DELAY_MS", 10)
        assert (value.param_value, value.param_type) == (10, REAL32)

    def test_first_element_of_a_vector_echoes_all_three(self, bench: "Bench") -> None:
        assert [(value.param_id, value.param_value) for value in echo(bench, "VISO_POS_X", 0.5)] == [
            ("VISO_POS_X", 0.5),
            ("VISO_POS_Y", 0),
            ("VISO_POS_Z", 0),
        ]

    @pytest.mark.parametrize("axis", ["_Y", "_Z"])
    def test_other_element_of_a_vector_echoes_itself(self, bench: "Bench", axis: str) -> None:
        assert [value.param_id for value in echo(bench, f"VISO_POS{axis}", 0.5)] == [f"VISO_POS{axis}"]

    def test_hidden_group_can_be_set_by_name(self, make_bench: "MakeBench") -> None:
        assert len(echo(make_bench(VISO_TYPE=0), "VISO_SCALE", 2)) == 1

    def test_each_set_is_logged_as_spelled_and_as_echoed(self, bench: "Bench", monkeypatch: pytest.MonkeyPatch) -> None:
        logged: list[tuple[str, float]] = []
        monkeypatch.setattr(bench.vehicle.log, "parameter", lambda *values: logged.append(values))
        echo(bench, "viso_qual_min", 300)
        assert logged == [("viso_qual_min", 127), ("VISO_QUAL_MIN", 127)]

    def test_value_is_used_at_once(self, bench: "Bench", client: "Client") -> None:
        client.tell(to_set("VISO_TYPE", 0))
        assert not bench.vehicle.visual_odom.enabled()

    def test_stream_rate_of_a_running_stream_is_not_changed(self, bench: "Bench", client: "Client") -> None:
        client.tell(to_set("MAV1_EXTRA1", 10))
        bench.run_ms(1000)
        assert client.read_of(ATTITUDE) == []

    def test_read_only_parameter_is_refused_with_a_text_and_the_old_value(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(by_index(10_000))
        bench.vehicle.params.apply_defaults({"VISO_SCALE": 3}, "defaults", read_only={"VISO_SCALE"})
        assert bench.client.tell(to_set("viso_scale", 2)) is PARAM_READ_ONLY
        count = bench.vehicle.params.count
        assert values(bench.client) == [PARAM_VALUE("viso_scale", 3.0, REAL32, count, NO_INDEX)]
        bench.run_ms(3)
        assert bench.client.read() == [STATUSTEXT(4, "Param write denied (viso_scale)")]
        assert values(bench.clients[1]) == []
