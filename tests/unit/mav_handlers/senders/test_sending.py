# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a link sends in one pass, and in which order."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.senders import SENDERS, STREAM_GROUPS
from mav_handlers.senders.intervals import set_interval
from mav_handlers.wire.messages import (
    ATTITUDE,
    AUTOPILOT_VERSION,
    HEARTBEAT,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_VALUE,
    REQUEST_DATA_STREAM,
    STATUSTEXT,
    SYS_STATUS,
    SYSTEM_TIME,
    Message,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench


def names(client: "Client") -> list[str]:
    """Return what has come, without texts, which have a queue of their own."""
    return [type(message).__name__ for message in client.read() if not isinstance(message, STATUSTEXT)]


def fill(client: "Client", leave_bytes: int = 0) -> None:
    """Leave room for so many bytes, and at most 21 more."""
    client.channel.take_output()
    while client.channel.txspace() > leave_bytes + 21:
        client.channel.send(HEARTBEAT(6, 8, 0, 0, 4, 3))


class TestOrder:
    """Who comes first."""

    def test_everything_at_one_rate_comes_in_the_firmware_s_order(self, bench: "Bench", client: "Client") -> None:
        client.tell(REQUEST_DATA_STREAM(1, 1, 0, 4, 1))
        bench.run_ms(500)
        client.read()
        bench.run_ms(250)
        burst = names(client)
        streamed = {name for _, group in STREAM_GROUPS.values() for name in group}
        assert burst == [name for name in SENDERS if name in burst]
        assert {"ATTITUDE", "SYS_STATUS", "SYSTEM_TIME"} <= set(burst) <= streamed

    def test_timers_come_before_requests_and_requests_before_bursts(self, bench: "Bench", client: "Client") -> None:
        for name in ("SYS_STATUS", "ATTITUDE"):
            set_interval(client.channel, name, 1000, bench.now_us)
        bench.run_ms(998)
        client.tell(PARAM_REQUEST_READ(1, 1, "", 0), PARAM_REQUEST_READ(1, 1, "", 1))
        client.read()
        client.channel.requested |= {"SYSTEM_TIME", "AUTOPILOT_VERSION"}
        bench.run_ms(2)
        timers = ["HEARTBEAT", "PARAM_VALUE", "PARAM_VALUE"]
        assert names(client) == [*timers, "SYSTEM_TIME", "AUTOPILOT_VERSION", "SYS_STATUS"]

    def test_requests_come_in_the_firmware_s_order_and_once(self, bench: "Bench", client: "Client") -> None:
        for name in ("AUTOPILOT_VERSION", "ATTITUDE", "SYSTEM_TIME", "ATTITUDE"):
            bench.endpoint.request_message(client.channel, name)
        bench.run_ms(10)
        assert names(client) == ["ATTITUDE", "SYSTEM_TIME", "AUTOPILOT_VERSION"]

    def test_every_message_that_can_be_sent_can_be_requested(self, bench: "Bench", client: "Client") -> None:
        for name in SENDERS:
            bench.endpoint.request_message(client.channel, name)
        bench.run_ms(3)
        received = names(client)
        assert {"ATTITUDE", "SYS_STATUS", "HEARTBEAT", "AVAILABLE_MODES_MONITOR"} <= set(received)
        assert client.channel.requested == set()


class TestRoom:
    """A peer that does not read."""

    def test_rest_of_a_burst_comes_when_there_is_room(self, bench: "Bench", client: "Client") -> None:
        for name in ("ATTITUDE", "SYS_STATUS", "SYSTEM_TIME"):
            set_interval(client.channel, name, 300, bench.now_us)
        bench.run_ms(400)
        # Room for ATTITUDE, 28 bytes and 12 around them, and not for SYS_STATUS, 43 bytes.
        fill(client, leave_bytes=40)
        bench.run_ms(300)
        assert names(client)[-1] == "ATTITUDE"
        bench.run_ms(5)
        assert names(client) == ["SYS_STATUS", "SYSTEM_TIME"]
        bench.run_ms(200)
        assert names(client) == ["ATTITUDE", "SYS_STATUS", "SYSTEM_TIME"]

    def test_nothing_overtakes_what_does_not_fit(self, bench: "Bench", client: "Client") -> None:
        # Room for SYSTEM_TIME, 12 bytes and 12 around them, and not for SYS_STATUS, 43 bytes.
        fill(client, leave_bytes=20)
        bench.endpoint.request_message(client.channel, "SYS_STATUS")
        bench.endpoint.request_message(client.channel, "SYSTEM_TIME")
        before = client.channel.codec.frames_sent
        bench.run_ms(5)
        assert client.channel.codec.frames_sent == before
        client.channel.take_output()
        bench.run_ms(3)
        assert names(client) == ["SYS_STATUS", "SYSTEM_TIME"]

    def test_messages_that_do_not_fit_are_counted(self, bench: "Bench", client: "Client") -> None:
        fill(client)
        bench.endpoint.request_message(client.channel, "ATTITUDE")
        bench.run_ms(2.5)
        assert client.channel.times_full == 1

    def test_room_kept_for_parameters_holds_up_everything_else(self, bench: "Bench", client: "Client") -> None:
        fill(client, leave_bytes=110)
        client.channel.reserve.start(bench.now_us)
        bench.endpoint.request_message(client.channel, "ATTITUDE")
        before = client.channel.codec.frames_sent
        bench.run_ms(1997)
        assert client.channel.codec.frames_sent == before
        bench.run_ms(5)
        assert client.channel.codec.frames_sent > before


class TestBoot:
    """Before initialisation is finished."""

    @pytest.mark.parametrize("kind", [ATTITUDE, SYSTEM_TIME, SYS_STATUS])
    def test_streams_begin_when_initialisation_ends(self, make_bench: "MakeBench", kind: type[Message]) -> None:
        bench = make_bench(until_ms=0, MAV1_EXTRA1=10, MAV1_EXTRA3=10, MAV1_EXT_STAT=10)
        while not bench.vehicle.copter.has_booted:
            assert bench.client.read_of(kind) == []
            bench.run_ms(5)
        bench.run_ms(400)
        assert bench.client.read_of(kind) != []

    def test_heartbeats_come_from_the_first_pass_on(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0)
        bench.run_ms(2000)
        assert [beat.system_status for beat in bench.client.read_of(HEARTBEAT)] == [1, 1, 1]

    def test_version_and_parameters_can_be_had(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0)
        bench.run_ms(1000)
        assert not bench.vehicle.copter.has_booted
        bench.endpoint.request_message(bench.client.channel, "AUTOPILOT_VERSION")
        bench.client.tell(PARAM_REQUEST_READ(1, 1, "VISO_TYPE", -1))
        bench.run_ms(200)
        received = names(bench.client)
        assert {"AUTOPILOT_VERSION", "PARAM_VALUE"} <= set(received)

    def test_other_requests_are_lost(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=1000)
        bench.endpoint.request_message(bench.client.channel, "ATTITUDE")
        bench.run_ms(4000)
        assert bench.client.read_of(ATTITUDE) == []

    def test_texts_do_not_wait_for_the_telemetry_loop(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=1000)
        bench.client.tell(HEARTBEAT(6, 8, 0, 0, 4, 3))
        bench.vehicle.texts.send_text(6, "now")
        assert bench.client.read_texts() == ["now"]


class TestTelemetryDelay:
    """MAV_TELEM_DELAY."""

    def test_parameter_list_waits_for_it(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_TELEM_DELAY=8, until_ms=6000)
        bench.client.tell(PARAM_REQUEST_LIST(1, 1))
        bench.run_ms(2190)
        assert bench.client.read_of(PARAM_VALUE) == []
        bench.run_ms(10)
        assert bench.client.read_of(PARAM_VALUE) != []

    def test_requests_wait_for_it(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_TELEM_DELAY=6)
        bench.endpoint.request_message(bench.client.channel, "AUTOPILOT_VERSION")
        bench.run_ms(1140)
        assert bench.client.read_of(AUTOPILOT_VERSION) == []
        bench.run_ms(10)
        assert len(bench.client.read_of(AUTOPILOT_VERSION)) == 1


class TestSlowDown:
    """Transfers slow telemetry down."""

    def test_telemetry_is_four_times_slower_during_a_list(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(9600,), MAV1_EXTRA1=4, until_ms=6000)
        bench.client.tell(PARAM_REQUEST_LIST(1, 1))
        bench.run_ms(4000)
        assert len(bench.client.read_of(ATTITUDE)) == 4
