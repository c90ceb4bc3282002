# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Links, admission, texts and scheduling at the autopilot's end of MAVLink."""

from typing import TYPE_CHECKING, Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from ap_core.internal_error import InternalError
from ap_core.verdict import VerdictKind
from mav_handlers.channel import OUTPUT_LIMIT_BYTES
from mav_handlers.endpoint import EVENTS_KEPT, MessageEvent
from mav_handlers.verdicts import (
    BAD_CRC,
    BAD_PREFIX,
    FLOW_NOT_READ,
    HANDLED,
    NO_HANDLER,
    NOT_ACCEPTED,
    NOT_ADDRESSED,
    OWN_MESSAGE,
    UNKNOWN_MESSAGE,
    UNREAD_FLOW,
)
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    ATTITUDE,
    COMMAND_ACK,
    COMMAND_LONG,
    HEARTBEAT,
    PARAM_ERROR,
    PARAM_REQUEST_READ,
    PARAM_SET,
    STATUSTEXT,
    TIMESYNC,
    VISION_SPEED_ESTIMATE,
    Message,
)
from viso.firmware.releases import STABLE_4_7
from viso.vehicle.vehicle import Vehicle, VehicleConfig

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

PREARM = COMMAND_LONG(1, 1, 401, 0, *(0.0,) * 7)
SPEED = VISION_SPEED_ESTIMATE(0, 1.0, 2.0, 3.0)


def hello() -> HEARTBEAT:
    return HEARTBEAT(6, 8, 0, 0, 4, 3)


def kinds(messages: list[Message]) -> set[str]:
    return {type(message).__name__ for message in messages}


def names(events: list[MessageEvent]) -> list[str]:
    return [event.name for event in events]


def packed(raw: Any, system_id: int = 255) -> bytes:
    """Return the frame of one of pymavlink's messages."""
    return bytes(raw.pack(dialect.MAVLink(None, srcSystem=system_id, srcComponent=68)))


RADIO = dialect.MAVLink_radio_message(0, 0, 0, 0, 0, 0, 0)
RADIO_STATUS = dialect.MAVLink_radio_status_message(0, 0, 0, 0, 0, 0, 0)
RANGEFINDER = dialect.MAVLink_rangefinder_message(1.0, 2.0)


class TestLinkState:
    """Who gets what."""

    def test_silent_client_gets_heartbeat_and_timesync_only(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0, filter_runs=False)
        bench.run_ms(11_000)
        assert kinds(bench.client.read()) == {"HEARTBEAT", "TIMESYNC"}

    def test_silent_client_gets_no_text(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None), until_ms=7000)
        bench.clients[1].tell(PREARM)
        bench.run_ms(100)
        assert bench.clients[1].read_texts() == ["PreArm: VisOdom: not healthy"]
        assert bench.clients[0].read_texts() == []

    def test_client_that_streams_gets_texts_before_it_sends(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0, MAV1_EXTRA1=1)
        bench.run_ms(5000)
        assert "ArduPilot Ready" in bench.client.read_texts()

    def test_any_packet_makes_a_link_active(self, bench: "Bench", client: "Client") -> None:
        client.tell(ATTITUDE(0, 0, 0, 0, 0, 0, 0))
        assert client.channel.active

    @pytest.mark.parametrize("raw", [RADIO, RADIO_STATUS])
    def test_radio_does_not_make_a_link_active(self, client: "Client", raw: Any) -> None:
        client.send_bytes(packed(raw))
        assert client.channel.frames_received == 1
        assert not client.channel.active

    def test_bad_bytes_do_not_make_a_link_active(self, client: "Client") -> None:
        client.send_bytes(b"hello")
        assert not client.channel.active

    def test_private_link_gets_no_text(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV1_OPTIONS=2)
        bench.client.tell(PREARM)
        bench.run_ms(100)
        assert kinds(bench.client.read()) == {"COMMAND_ACK"}

    def test_private_link_is_not_asked_for_its_time(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV1_OPTIONS=2, until_ms=0, filter_runs=False)
        bench.run_ms(11_000)
        assert kinds(bench.client.read()) == {"HEARTBEAT"}

    def test_private_link_gets_no_parameter_echo(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV1_OPTIONS=2)
        bench.client.tell(PARAM_SET(1, 1, "VISO_SCALE", 2.0, 9))
        bench.run_ms(100)
        assert bench.client.read() == []


class TestFurtherClient:
    """Another client of a link has all to itself but the link's parameters."""

    @pytest.fixture
    def bench(self, make_bench: "MakeBench") -> "Bench":
        bench = make_bench(bauds=(None, None), MAV1_EXTRA1=10)
        endpoint = bench.endpoint
        channel = endpoint.open_channel("link0#2", port=bench.client.channel.port, now_us=bench.now_us)
        bench.clients.append(type(bench.client)(bench, channel))
        return bench

    def test_it_counts_its_own_frames_and_streams_at_the_rates_of_the_link(self, bench: "Bench") -> None:
        bench.run_ms(1000)
        first, other = bench.clients[0].read_received(), bench.clients[2].read_received()
        assert [frame.header.sequence for frame in other] == list(range(len(other)))
        assert first[0].header.sequence > 0
        assert sum(isinstance(frame.message, ATTITUDE) for frame in other) in (9, 10, 11)

    def test_what_it_asks_for_it_gets_alone(self, bench: "Bench") -> None:
        bench.clients[2].tell(COMMAND_LONG(1, 1, 511, 0, 32.0, 20_000.0, 0, 0, 0, 0, 0))
        bench.run_ms(500)
        counts = [
            sum("LOCAL_POSITION_NED" in name for name in map(str, client.channel.intervals_ms))
            for client in bench.clients
        ]
        assert counts == [0, 0, 1]

    def test_half_a_frame_of_one_does_not_harm_the_other(self, bench: "Bench") -> None:
        frame = bench.client.codec.encode(hello())
        bench.clients[2].send_bytes(frame[:7])
        assert bench.client.tell(hello()) is HANDLED
        (event,) = bench.clients[2].send_bytes(frame[7:])
        assert event.verdict is HANDLED

    def test_what_it_sends_is_passed_on_to_the_other(self, bench: "Bench") -> None:
        bench.client.tell(hello())
        bench.clients[2].codec = Codec(1, 197)
        bench.clients[2].tell(SPEED)
        assert SPEED in bench.client.read()

    def test_nothing_is_left_of_one_that_has_gone(self, bench: "Bench") -> None:
        gone = bench.clients[2]
        gone.tell(hello())
        bench.endpoint.close_channel(gone.channel)
        bench.run_ms(2000)
        assert gone.channel.take_output() == b""
        assert not [route for route in bench.endpoint.routes.routes if route.channel == gone.channel.index]

    def test_the_next_begins_anew_with_its_number(self, bench: "Bench") -> None:
        gone = bench.clients[2].channel
        bench.clients[2].tell(COMMAND_LONG(1, 1, 511, 0, 32.0, 20_000.0, 0, 0, 0, 0, 0))
        bench.endpoint.close_channel(gone)
        counted = bench.endpoint.verdict_counts()
        channel = bench.endpoint.open_channel("link0#2", port=bench.client.channel.port, now_us=bench.now_us)
        assert (channel.index, channel.intervals_ms) == (gone.index, bench.client.channel.intervals_ms)
        assert bench.endpoint.verdict_counts() == counted


class TestHeartbeat:
    """HEARTBEAT, out."""

    def test_first_heartbeat_comes_at_once(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0)
        bench.run_ms(0)
        assert kinds(bench.client.read()) == {"HEARTBEAT"}

    def test_heartbeats_come_once_a_second(self, bench: "Bench", client: "Client") -> None:
        bench.run_ms(4000)
        assert len(client.read_of(HEARTBEAT)) == 4

    def test_state_is_boot_then_standby(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0)
        bench.run_ms(4000)
        assert [beat.system_status for beat in bench.client.read_of(HEARTBEAT)] == [1, 1, 1, 3, 3]

    def test_state_is_critical_after_an_internal_error(self, bench: "Bench", client: "Client") -> None:
        bench.vehicle.internal_errors(InternalError.CONSTRAINING_NAN)
        bench.run_ms(1000)
        assert [beat.system_status for beat in client.read_of(HEARTBEAT)] == [5]

    def test_it_comes_from_the_autopilot(self, bench: "Bench", client: "Client") -> None:
        bench.run_ms(1000)
        assert [(f.header.system_id, f.header.component_id) for f in client.read_received()] == [(1, 1)]

    def test_change_of_mav_sysid_takes_effect_at_once(self, bench: "Bench", client: "Client") -> None:
        client.tell(PARAM_SET(1, 1, "MAV_SYSID", 42.0, 4))
        bench.run_ms(3)
        assert {frame.header.system_id for frame in client.read_received()} == {42}


class TestAdmission:
    """Which frames are processed at all."""

    def test_own_system_and_component_id_is_dropped(self, client: "Client") -> None:
        client.codec = Codec(1, 1)
        assert client.tell(SPEED) is OWN_MESSAGE

    @pytest.mark.parametrize("component_id", [0, 2, 197, 255])
    def test_own_system_with_another_component_is_processed(self, client: "Client", component_id: int) -> None:
        client.codec = Codec(1, component_id)
        assert client.tell(SPEED).kind is VerdictKind.ACCEPTED

    def test_vision_data_is_taken_from_any_sender(self, client: "Client") -> None:
        client.codec = Codec(77, 33)
        assert client.tell(SPEED).kind is VerdictKind.ACCEPTED

    def test_message_for_another_system_is_dropped(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(COMMAND_LONG(2, 1, 401, 0, *(0.0,) * 7)) is NOT_ADDRESSED
        bench.run_ms(100)
        assert client.read() == []

    def test_broadcast_command_is_executed_and_acknowledged(self, client: "Client") -> None:
        assert client.command(401, target=(0, 0)) == 0

    @pytest.mark.parametrize("component_id", [0, 1, 42])
    def test_command_to_any_component_is_executed_and_acknowledged_by_component_1(
        self, client: "Client", component_id: int
    ) -> None:
        client.tell(COMMAND_LONG(1, component_id, 401, 0, *(0.0,) * 7))
        [frame] = client.read_received()
        assert isinstance(frame.message, COMMAND_ACK)
        assert (frame.header.system_id, frame.header.component_id) == (1, 1)

    def test_address_follows_mav_sysid(self, bench: "Bench", client: "Client") -> None:
        client.tell(PARAM_SET(1, 1, "MAV_SYSID", 42.0, 4))
        assert client.tell(PREARM) is NOT_ADDRESSED
        client.read()
        assert client.command(401, target=(42, 1)) == 0

    def test_option_bit_0_admits_the_ground_station(self, make_bench: "MakeBench") -> None:
        assert make_bench(MAV_OPTIONS=1).client.tell(SPEED).kind is VerdictKind.ACCEPTED

    def test_option_bit_0_admits_the_own_system(self, make_bench: "MakeBench") -> None:
        client = make_bench(MAV_OPTIONS=1).client
        client.codec = Codec(1, 197)
        assert client.tell(SPEED).kind is VerdictKind.ACCEPTED

    def test_option_bit_0_keeps_others_out(self, make_bench: "MakeBench") -> None:
        client = make_bench(MAV_OPTIONS=1).client
        client.codec = Codec(254, 190)
        assert client.tell(SPEED) is NOT_ACCEPTED

    @pytest.mark.parametrize("raw", [RADIO, RADIO_STATUS])
    def test_option_bit_0_admits_radios(self, make_bench: "MakeBench", raw: Any) -> None:
        [event] = make_bench(MAV_OPTIONS=1).client.send_bytes(packed(raw, system_id=51))
        assert event.verdict is not NOT_ACCEPTED

    def test_option_bit_0_follows_mav_gcs_sysid(self, make_bench: "MakeBench") -> None:
        client = make_bench(MAV_OPTIONS=1, MAV_GCS_SYSID=254).client
        assert client.tell(SPEED) is NOT_ACCEPTED

    def test_frame_that_is_not_admitted_still_makes_the_link_active(self, make_bench: "MakeBench") -> None:
        client = make_bench(MAV_OPTIONS=1, MAV_GCS_SYSID=254).client
        client.tell(SPEED)
        assert client.channel.active


class TestVerdicts:
    """Every frame and every byte is accounted for."""

    def test_bytes_between_frames_are_counted(self, bench: "Bench", client: "Client") -> None:
        client.send_bytes(b"012345" + client.codec.encode(hello()))
        assert bench.endpoint.verdict_counts() == {
            ("BAD_DATA", VerdictKind.DROPPED, "bad_prefix"): 6,
            ("HEARTBEAT", VerdictKind.HANDLED, "handled"): 1,
        }

    def test_wake_up_bytes_of_a_radio_are_no_frame(self, client: "Client") -> None:
        events = client.send_bytes(b"\x30\x20" * 3 + client.codec.encode(hello()))
        assert [event.verdict for event in events] == [BAD_PREFIX, HANDLED]

    def test_damaged_frame_is_counted_with_all_its_bytes(self, bench: "Bench", client: "Client") -> None:
        frame = bytearray(client.codec.encode(SPEED))
        frame[20] ^= 1
        [event] = client.send_bytes(bytes(frame))
        assert event.verdict is BAD_CRC
        assert bench.endpoint.verdict_counts() == {("BAD_DATA", VerdictKind.DROPPED, "bad_crc"): len(frame)}

    def test_event_of_bad_bytes_has_neither_header_nor_message(self, client: "Client") -> None:
        [event] = client.send_bytes(b"abc")
        assert (event.name, event.header, event.message) == ("BAD_DATA", None, None)

    def test_message_id_outside_the_dialect(self, client: "Client") -> None:
        [event] = client.send_bytes(bytes.fromhex("fd00000000fe01ffffff0000"))
        assert (event.name, event.verdict) == ("UNKNOWN", UNKNOWN_MESSAGE)

    def test_message_of_the_dialect_that_nothing_handles(self, client: "Client") -> None:
        assert client.send_bytes(packed(RANGEFINDER))[0].verdict is NO_HANDLER

    def test_flow_that_no_release_reads_has_a_verdict_of_its_own(self, client: "Client") -> None:
        rad = dialect.MAVLink_optical_flow_rad_message(0, 0, 40_000, 0.1, 0.2, 0.0, 0.0, 0.0, 2000, 180, 0, 1.0)
        hil = dialect.MAVLink_hil_optical_flow_message(0, 0, 40_000, 0.1, 0.2, 0.0, 0.0, 0.0, 2000, 180, 0, 1.0)
        events = [client.send_bytes(packed(message))[0] for message in (rad, hil)]
        assert {event.name for event in events} == UNREAD_FLOW
        assert {event.verdict for event in events} == {FLOW_NOT_READ}

    def test_known_message_that_the_autopilot_only_sends(self, client: "Client") -> None:
        assert client.tell(ATTITUDE(0, 0, 0, 0, 0, 0, 0)) is NO_HANDLER

    def test_counts_of_all_links_add_up(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        for client in bench.clients:
            client.tell(hello())
        assert bench.endpoint.verdict_counts() == {("HEARTBEAT", VerdictKind.HANDLED, "handled"): 2}

    def test_bytes_and_frames_are_counted(self, client: "Client") -> None:
        frame = client.codec.encode(hello())
        client.send_bytes(frame + b"xx" + frame)
        channel = client.channel
        assert (channel.bytes_received, channel.frames_received) == (2 * len(frame) + 2, 2)
        assert channel.packets_dropped == 1

    def test_event_tells_link_time_header_and_message(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        client = bench.clients[1]
        [event] = client.send_bytes(client.codec.encode(hello()))
        assert event.header is not None
        assert (event.channel, event.now_us, event.name) == (1, 5_000_000, "HEARTBEAT")
        assert (event.header.system_id, event.header.component_id) == (255, 190)
        assert event.message == hello()

    def test_listener_hears_every_event_at_once(self, bench: "Bench", client: "Client") -> None:
        heard: list[MessageEvent] = []
        bench.endpoint.on_event = heard.append
        client.send_bytes(b"x" + client.codec.encode(hello()))
        assert names(heard) == ["BAD_DATA", "HEARTBEAT"]

    def test_newest_events_are_kept_and_lost_ones_counted(self, bench: "Bench", client: "Client") -> None:
        frames = b"".join(client.codec.encode(hello()) for _ in range(EVENTS_KEPT + 2))
        bench.endpoint.receive_bytes(client.channel, b"x" + frames, bench.now_us)
        assert names(bench.drop_events()) == ["HEARTBEAT"] * EVENTS_KEPT
        assert bench.endpoint.events_lost == 3


class TestTexts:
    """STATUSTEXT, out."""

    def test_text_queued_before_the_first_poll_goes_to_every_link(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None), until_ms=0)
        bench.vehicle.texts.send_text(6, "early")
        bench.run_ms(0)
        assert [client.read_texts() for client in bench.clients] == [["early"], ["early"]]

    def test_text_without_any_link_is_gone(self) -> None:
        vehicle = Vehicle(VehicleConfig())
        vehicle.texts.send_text(6, "early")
        vehicle.advance(range(1))
        assert list(vehicle.texts.pending()) == []

    def test_long_text_arrives_in_chunks(self, bench: "Bench", client: "Client") -> None:
        client.tell(hello())
        bench.vehicle.texts.send_text(4, "x" * 100)
        bench.run_ms(3)
        assert client.read_of(STATUSTEXT) == [
            STATUSTEXT(4, "x" * 50, 1, 0),
            STATUSTEXT(4, "x" * 50, 1, 1),
            STATUSTEXT(4, "", 1, 2),
        ]

    def test_text_of_exactly_50_characters_arrives_whole(self, bench: "Bench", client: "Client") -> None:
        client.tell(hello())
        bench.vehicle.texts.send_text(6, "x" * 50)
        bench.run_ms(3)
        assert client.read_of(STATUSTEXT) == [STATUSTEXT(6, "x" * 50, 0, 0)]

    def test_log_gets_the_first_50_characters(self, bench: "Bench") -> None:
        bench.vehicle.texts.send_text(6, "y" * 70)
        assert [fields["Message"] for fields in bench.logged("MSG")] == ["y" * 50]

    def test_text_waits_until_the_peer_reads(self, bench: "Bench", client: "Client") -> None:
        client.tell(hello())
        self._fill(client)
        bench.vehicle.texts.send_text(6, "patience")
        bench.run_ms(100)
        client.channel.take_output()
        bench.run_ms(3)
        assert client.read_texts() == ["patience"]

    def test_text_that_waits_for_5_s_is_discarded(self, bench: "Bench", client: "Client") -> None:
        client.tell(hello())
        bench.run_ms(10_000)
        self._fill(client)
        bench.vehicle.texts.send_text(6, "too late")
        bench.run_ms(6100)
        client.channel.take_output()
        bench.run_ms(3)
        assert client.read_texts() == []
        assert bench.vehicle.texts.expired == 1

    @staticmethod
    def _fill(client: "Client") -> None:
        while client.channel.send(hello()):
            pass


class TestScheduling:
    """What is sent when."""

    def test_telemetry_waits_for_the_telemetry_delay_in_units_of_1024_ms(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_TELEM_DELAY=3, MAV1_EXTRA1=10, until_ms=0)
        bench.run_ms(3070)
        assert kinds(bench.client.read()) == {"STATUSTEXT"}
        bench.run_ms(5)
        assert kinds(bench.client.read()) == {"HEARTBEAT", "ATTITUDE"}

    def test_parameters_and_requests_wait_for_the_telemetry_delay(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_TELEM_DELAY=7)
        bench.client.tell(PARAM_REQUEST_READ(1, 1, "VISO_TYPE", -1), COMMAND_LONG(1, 1, 512, 0, 30, *(0.0,) * 6))
        bench.run_ms(2000)
        assert kinds(bench.client.read()) - {"STATUSTEXT"} == {"COMMAND_ACK"}
        bench.run_ms(200)
        assert kinds(bench.client.read()) - {"STATUSTEXT"} == {"ATTITUDE", "HEARTBEAT", "PARAM_VALUE"}

    def test_timesync_does_not_wait_for_the_telemetry_delay(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV_TELEM_DELAY=30, until_ms=0, filter_runs=False)
        bench.run_ms(11_000)
        assert kinds(bench.client.read()) == {"TIMESYNC"}

    def test_stream_rates_of_the_parameters_hold_from_boot(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV1_EXTRA1=4)
        bench.run_ms(1000)
        assert len(bench.client.read_of(ATTITUDE)) == 4

    def test_streams_are_off_by_default(self, bench: "Bench", client: "Client") -> None:
        client.tell(hello())
        bench.run_ms(3000)
        assert kinds(client.read()) - {"STATUSTEXT"} == {"HEARTBEAT"}

    def test_message_with_nothing_to_say_is_left_out(self, bench: "Bench", client: "Client") -> None:
        bench.endpoint.request_message(client.channel, "HOME_POSITION")
        bench.run_ms(100)
        assert client.read() == []

    def test_message_that_is_requested_twice_in_a_row_comes_once(self, bench: "Bench", client: "Client") -> None:
        bench.endpoint.request_message(client.channel, "ATTITUDE")
        bench.endpoint.request_message(client.channel, "ATTITUDE")
        bench.run_ms(100)
        assert len(client.read()) == 1

    def test_links_have_their_own_sequence_numbers(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[0].command(401)
        bench.run_ms(1000)
        sequences = [frame.header.sequence for client in bench.clients for frame in client.read_received()]
        assert sequences[-1] == 6
        assert sequences[0] > 6

    @pytest.mark.slow
    def test_peer_that_never_reads_costs_limited_memory(self, make_bench: "MakeBench") -> None:
        bench = make_bench(MAV1_EXTRA1=333)
        bench.run_ms(10_000)
        assert bench.client.channel.times_full > 100
        assert len(bench.endpoint.bytes_to_send(bench.client.channel)) < OUTPUT_LIMIT_BYTES + 300


class TestVersions:
    """MAVLink 1 and 2."""

    def test_mavlink_1_link_sends_mavlink_1(self, make_bench: "MakeBench") -> None:
        bench = make_bench(version=1)
        bench.client.tell(PREARM)
        bench.run_ms(1000)
        assert {frame.header.version for frame in bench.client.read_received()} == {1}

    def test_mavlink_1_link_sends_no_message_whose_id_needs_two_bytes(self, make_bench: "MakeBench") -> None:
        for version, answers in ((1, []), (2, [PARAM_ERROR])):
            bench = make_bench(version=version, firmware=STABLE_4_7)
            bench.client.tell(PARAM_SET(1, 1, "NO_SUCH", 1.0, 9))
            assert [type(message) for message in bench.client.read()] == answers

    def test_mavlink_2_link_sends_mavlink_2_from_the_first_byte(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=0)
        bench.run_ms(0)
        assert bench.client.channel.take_output()[0] == 0xFD

    def test_mavlink_1_frames_are_accepted_on_a_mavlink_2_link(self, client: "Client") -> None:
        client.codec = Codec(255, 190, version=1)
        client.tell(PREARM)
        [frame] = client.read_received()
        assert (frame.header.name, frame.header.version) == ("COMMAND_ACK", 2)

    def test_extension_fields_of_a_mavlink_1_frame_read_as_zero(self, bench: "Bench", client: "Client") -> None:
        client.codec = Codec(255, 190, version=1)
        client.tell(VISION_SPEED_ESTIMATE(0, 1.0, 2.0, 3.0, (9.0,) * 9, reset_counter=7))
        assert [fields["Rst"] for fields in bench.logged("VISV")] == [0]

    def test_truncated_payload_is_extended_with_zeros(self, bench: "Bench", client: "Client") -> None:
        frame = client.codec.encode(VISION_SPEED_ESTIMATE(5, 1.0, 0.0, 0.0))
        assert frame[1] == 12
        client.send_bytes(frame)
        [fields] = bench.logged("VISV")
        assert (fields["VX"], fields["VY"], fields["VZ"]) == (1, 0, 0)

    def test_timesync_request_is_answered_on_the_same_link_only(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(TIMESYNC(0, 9))
        assert [len(client.read()) for client in bench.clients] == [0, 1]
