# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands: results, side effects, and what comes before and after the acknowledgement."""

import math
from typing import TYPE_CHECKING

import pytest

from mav_handlers.channel import OUTPUT_LIMIT_BYTES
from mav_handlers.handlers.commands import COMMANDS, to_command_int
from mav_handlers.senders import SENDERS
from mav_handlers.senders.intervals import can_send
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.codec import Codec, message_id
from mav_handlers.wire.messages import (
    ATTITUDE,
    AUTOPILOT_VERSION,
    COMMAND_ACK,
    COMMAND_INT,
    COMMAND_LONG,
    HEARTBEAT,
    MESSAGE_INTERVAL,
    SET_GPS_GLOBAL_ORIGIN,
    STATUSTEXT,
    VISION_SPEED_ESTIMATE,
    Message,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
ARM_DISARM, PREARM, AUX, SOURCE_SET = 400, 401, 218, 42007
GET_INTERVAL, SET_INTERVAL, REQUEST_MESSAGE, CAPABILITIES, BANNER, GET_HOME = 510, 511, 512, 520, 42428, 410
SET_HOME = 179
NAN = math.nan
READY_MS = 7000
BITS_OF_JUST_UNDER_1 = 0.99999994


@pytest.fixture
def bench(make_bench: "MakeBench") -> "Bench":
    """Return a vehicle whose estimator has told all there is to tell, and whose heartbeats have just been sent."""
    return make_bench(until_ms=READY_MS)


def kinds(messages: list[Message]) -> list[str]:
    return [type(message).__name__ for message in messages]


def command_long(number: int, *params: float, confirmation: int = 0) -> COMMAND_LONG:
    return COMMAND_LONG(1, 1, number, confirmation, *params, *(0.0,) * (7 - len(params)))


def see(bench: "Bench") -> None:
    """Make the visual odometry healthy, so that the vehicle can be armed."""
    bench.client.tell(VISION_SPEED_ESTIMATE(0, 0.0, 0.0, 0.0))


def later(bench: "Bench") -> list[str]:
    bench.run_ms(3)
    return bench.client.read_texts()


class TestAcknowledgement:
    """COMMAND_ACK."""

    @pytest.mark.parametrize(("system_id", "component_id"), [(255, 190), (1, 197), (7, 0)])
    def test_it_is_addressed_to_the_sender(self, client: "Client", system_id: int, component_id: int) -> None:
        client.codec = Codec(system_id, component_id)
        assert client.tell(command_long(PREARM)) is HANDLED
        assert client.read() == [COMMAND_ACK(PREARM, ACCEPTED, 0, 0, system_id, component_id)]

    def test_it_goes_to_the_link_of_the_request_only(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(command_long(PREARM))
        assert [len(client.read()) for client in bench.clients] == [0, 1]

    @pytest.mark.parametrize("number", [0, 16, 246, 519, 43003, 65535])
    def test_unknown_command_is_unsupported(self, client: "Client", number: int) -> None:
        assert client.command(number) == UNSUPPORTED

    @pytest.mark.parametrize("number", [192, 201])
    def test_unknown_command_with_a_place_is_unsupported(self, client: "Client", number: int) -> None:
        assert client.command_int(number, 1, 2, 3.0) == UNSUPPORTED

    def test_confirmation_is_ignored_and_the_command_runs_again(self, bench: "Bench", client: "Client") -> None:
        client.tell(command_long(BANNER), command_long(BANNER, confirmation=1))
        bench.run_ms(3)
        assert kinds(client.read()) == ["COMMAND_ACK"] * 2 + ["STATUSTEXT"] * 6

    def test_texts_of_a_command_come_after_it(self, bench: "Bench", client: "Client") -> None:
        client.tell(command_long(PREARM))
        bench.run_ms(3)
        assert kinds(client.read()) == ["COMMAND_ACK", "STATUSTEXT"]

    def test_command_is_logged_with_its_result(self, bench: "Bench", client: "Client") -> None:
        client.tell(COMMAND_INT(1, 7, 5, 43002, 0, 0, 1.5, 2.5, 3.5, 4.5, -6, 7, 8.5))
        [record] = bench.logged("MAVC")
        assert list(record.values())[1:] == [1, 7, 255, 190, 5, 43002, 1.5, 2.5, 3.5, 4.5, -6, 7, 8.5, UNSUPPORTED, 0]

    def test_command_long_is_logged_as_such(self, bench: "Bench", client: "Client") -> None:
        client.tell(command_long(PREARM))
        [record] = bench.logged("MAVC")
        assert list(record.values())[-2:] == [ACCEPTED, 1]

    def test_every_command_of_the_table_is_acknowledged_once(self, client: "Client") -> None:
        for number in COMMANDS:
            client.tell(command_long(number))
            assert [ack.command for ack in client.read_of(COMMAND_ACK)] == [number]


class TestConversion:
    """COMMAND_LONG to COMMAND_INT."""

    @pytest.mark.parametrize("number", [179, 195, 192, 201, 611, 43003])
    def test_place_is_converted_in_single_precision(self, number: int) -> None:
        # As the firmware was seen to do; in double precision it would be 473977432.
        latitude = 47.397743225097656  # the float32 next to 47.3977420
        converted = to_command_int(command_long(number, 0, 0, 0, 0, latitude, -latitude, 9.5))
        assert (converted.x, converted.y, converted.z) == (473_977_440, -473_977_440, 9.5)

    def test_other_numbers_are_truncated_towards_zero(self) -> None:
        converted = to_command_int(command_long(PREARM, 1, 2, 3, 4, 5.9, -6.9, 7.5))
        assert (converted.param1, converted.param2, converted.param3, converted.param4) == (1, 2, 3, 4)
        assert (converted.x, converted.y, converted.z) == (5, -6, 7.5)

    @pytest.mark.parametrize("number", [PREARM, 179])
    def test_nan_becomes_zero(self, number: int) -> None:
        converted = to_command_int(command_long(number, 0, 0, 0, 0, NAN, NAN, NAN))
        assert (converted.x, converted.y) == (0, 0)

    @pytest.mark.parametrize("value", [math.inf, -math.inf, 3e38, -3e38])
    def test_number_out_of_range_becomes_the_least_integer(self, value: float) -> None:
        assert to_command_int(command_long(PREARM, 0, 0, 0, 0, value)).x == -(1 << 31)

    @pytest.mark.parametrize(("number", "frame"), [(179, 0), (195, 3), (201, 3), (PREARM, 3)])
    def test_frame_is_an_assumption(self, number: int, frame: int) -> None:
        assert to_command_int(command_long(number)).frame == frame


class TestArmDisarm:
    """COMPONENT_ARM_DISARM."""

    def test_arming_when_checks_pass(self, bench: "Bench", client: "Client") -> None:
        see(bench)
        assert client.command(ARM_DISARM, 1) == ACCEPTED
        assert bench.vehicle.copter.is_armed()

    def test_arming_is_seen_in_the_next_heartbeat(self, bench: "Bench", client: "Client") -> None:
        see(bench)
        client.command(ARM_DISARM, 1)
        bench.run_ms(1000)
        assert [(beat.base_mode, beat.system_status) for beat in client.read_of(HEARTBEAT)] == [(209, 3)]

    def test_failing_check_fails_and_is_told_after_the_ack(self, bench: "Bench", client: "Client") -> None:
        client.tell(command_long(ARM_DISARM, 1))
        bench.run_ms(3)
        assert client.read() == [
            COMMAND_ACK(ARM_DISARM, FAILED, 0, 0, 255, 190),
            STATUSTEXT(2, "Arm: VisOdom: not healthy"),
        ]

    @pytest.mark.parametrize("magic", [2989, 21196])
    def test_magic_numbers_skip_the_checks(self, bench: "Bench", client: "Client", magic: float) -> None:
        assert client.command(ARM_DISARM, 1, magic) == ACCEPTED
        assert bench.vehicle.copter.is_armed()

    @pytest.mark.parametrize("magic", [1, 2988, -21196, NAN])
    def test_other_numbers_do_not(self, client: "Client", magic: float) -> None:
        assert client.command(ARM_DISARM, 1, magic) == FAILED

    def test_magic_number_does_not_skip_the_mandatory_checks(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=3000)
        assert bench.client.command(ARM_DISARM, 1, 2989) == FAILED
        assert later(bench)[0] == "Arm: AHRS: not using configured AHRS type"

    def test_arming_the_armed_is_accepted(self, client: "Client") -> None:
        client.command(ARM_DISARM, 1, 2989)
        assert client.command(ARM_DISARM, 1) == ACCEPTED

    @pytest.mark.parametrize("magic", [0, 21196])
    def test_disarming(self, bench: "Bench", client: "Client", magic: float) -> None:
        client.command(ARM_DISARM, 1, 2989)
        assert client.command(ARM_DISARM, 0, magic) == ACCEPTED
        assert not bench.vehicle.copter.is_armed()

    def test_disarming_the_disarmed_is_accepted(self, client: "Client") -> None:
        assert client.command(ARM_DISARM, 0) == ACCEPTED

    @pytest.mark.parametrize("param1", [2, -1, 0.5, 255, NAN, math.inf])
    def test_anything_else_is_unsupported(self, bench: "Bench", client: "Client", param1: float) -> None:
        assert client.command(ARM_DISARM, param1, 2989) == UNSUPPORTED
        assert not bench.vehicle.copter.is_armed()

    def test_numbers_are_compared_as_the_firmware_compares_floats(self, bench: "Bench", client: "Client") -> None:
        assert client.command(ARM_DISARM, BITS_OF_JUST_UNDER_1, 2989) == ACCEPTED
        assert client.command(ARM_DISARM, 1e-8) == ACCEPTED
        assert not bench.vehicle.copter.is_armed()


class TestPrearmChecks:
    """RUN_PREARM_CHECKS."""

    def test_it_is_accepted_when_checks_fail_and_tells_them(self, bench: "Bench", client: "Client") -> None:
        assert client.command(PREARM) == ACCEPTED
        assert later(bench) == ["PreArm: VisOdom: not healthy"]

    def test_all_failing_checks_are_told(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=3000)
        assert bench.client.command(PREARM) == ACCEPTED
        assert later(bench) == [
            "PreArm: EKF attitude is bad",
            "PreArm: AHRS: not using configured AHRS type",
            "PreArm: VisOdom: not healthy",
        ]

    def test_it_is_accepted_without_a_word_when_checks_pass(self, bench: "Bench", client: "Client") -> None:
        see(bench)
        assert client.command(PREARM) == ACCEPTED
        assert later(bench) == []

    def test_it_is_temporarily_rejected_while_armed(self, client: "Client") -> None:
        client.command(ARM_DISARM, 1, 2989)
        assert client.command(PREARM) == TEMPORARILY_REJECTED

    def test_type_set_at_run_time_is_out_of_memory(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=READY_MS, VISO_TYPE=0)
        bench.vehicle.params.set("VISO_TYPE", 1)
        bench.client.command(PREARM)
        assert later(bench) == ["PreArm: VisOdom: out of memory"]


class TestAuxFunction:
    """DO_AUX_FUNCTION."""

    @pytest.fixture
    def filter_starts(self) -> bool:
        return False

    @pytest.mark.parametrize("position", [2.1, 3, 255, math.inf])
    def test_position_above_high_is_denied(self, client: "Client", position: float) -> None:
        assert client.command(AUX, 90, position) == DENIED

    @pytest.mark.parametrize("number", [0, 1, 79, 81, 65535])
    def test_unknown_function_fails_with_a_text(self, bench: "Bench", client: "Client", number: int) -> None:
        assert client.command(AUX, number, 2) == FAILED
        assert later(bench) == [f"Invalid channel option ({number})"]

    @pytest.mark.parametrize("position", [0, 1, 2])
    def test_alignment_is_accepted_in_silence_in_any_position(
        self, bench: "Bench", client: "Client", position: int
    ) -> None:
        assert client.command(AUX, 80, position) == ACCEPTED
        assert later(bench) == []

    @pytest.mark.parametrize(("position", "requests"), [(0, 0), (1, 0), (2, 1)])
    def test_alignment_is_requested_in_the_high_position_only(
        self, bench: "Bench", client: "Client", monkeypatch: pytest.MonkeyPatch, position: int, requests: int
    ) -> None:
        asked: list[bool] = []
        monkeypatch.setattr(bench.vehicle.visual_odom, "request_align_yaw_to_ahrs", lambda: asked.append(True))
        client.command(AUX, 80, position)
        assert len(asked) == requests

    @pytest.mark.parametrize("position", [0, 1, 2])
    def test_source_set_is_selected_with_a_text(self, bench: "Bench", client: "Client", position: int) -> None:
        assert client.command(AUX, 90, position) == ACCEPTED
        assert bench.vehicle.sources.active_set == position
        assert later(bench) == [f"Using EKF Source Set {position + 1}"]

    @pytest.mark.parametrize("position", [-1, -2, NAN])
    def test_position_that_is_none_selects_the_first_source_set(
        self, bench: "Bench", client: "Client", position: float
    ) -> None:
        assert client.command(AUX, 90, position) == ACCEPTED
        assert bench.vehicle.sources.active_set == 0

    def test_change_of_the_source_set_is_logged_as_an_event(self, bench: "Bench", client: "Client") -> None:
        for position in (1, 1, 2, 0):
            client.command(AUX, 90, position)
        assert [record["Id"] for record in bench.logged("EV")] == [86, 87, 85]

    @pytest.mark.parametrize(("number", "result"), [(80, 1), (90, 1), (7, 0)])
    def test_call_is_logged_with_source_3(self, make_bench: "MakeBench", number: int, result: int) -> None:
        bench = make_bench(until_ms=READY_MS, has_log=True)
        bench.client.command(AUX, number, 1)
        [record] = bench.logged("AUXF")
        assert (record["function"], record["pos"], record["source"], record["result"]) == (number, 1, 3, result)

    def test_denied_call_is_not_logged(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=READY_MS, has_log=True)
        bench.client.command(AUX, 80, 3)
        assert bench.logged("AUXF") == []


class TestSourceSet:
    """SET_EKF_SOURCE_SET."""

    @pytest.fixture
    def filter_starts(self) -> bool:
        return False

    @pytest.mark.parametrize("number", [1, 2, 3])
    def test_it_is_selected_without_a_text(self, bench: "Bench", client: "Client", number: int) -> None:
        assert client.command(SOURCE_SET, number) == ACCEPTED
        assert bench.vehicle.sources.active_set == number - 1
        assert later(bench) == []

    def test_other_numbers_are_denied(self, bench: "Bench", client: "Client") -> None:
        for number in (0, 4, -1, 0.9, NAN, math.inf, 4294967297.0 * 2):
            assert client.command(SOURCE_SET, number) == DENIED, number
            assert bench.vehicle.sources.active_set == 0, number


class TestSetMessageInterval:
    """SET_MESSAGE_INTERVAL."""

    @pytest.fixture
    def filter_starts(self) -> bool:
        return False

    @pytest.mark.parametrize(
        ("interval_us", "interval_ms"),
        [(3000, 3), (3999, 3), (100_000, 100), (33_333, 33), (60_000_000, 60_000), (61_000_000, 60_000)],
    )
    def test_interval_is_in_whole_milliseconds_up_to_a_minute(
        self, client: "Client", interval_us: float, interval_ms: int
    ) -> None:
        assert client.command(SET_INTERVAL, 30, interval_us) == ACCEPTED
        assert client.channel.intervals_ms["ATTITUDE"] == interval_ms

    def test_message_comes_at_the_interval(self, bench: "Bench", client: "Client") -> None:
        client.command(SET_INTERVAL, 30, 100_000)
        bench.run_ms(1000)
        assert len(client.read_of(ATTITUDE)) == 10

    def test_third_parameter_must_be_zero(self, client: "Client") -> None:
        for param3 in (1, -1, NAN):
            assert client.command(SET_INTERVAL, 30, 100_000, param3) == DENIED
        assert "ATTITUDE" not in client.channel.intervals_ms

    def test_third_parameter_may_be_next_to_zero(self, client: "Client") -> None:
        assert client.command(SET_INTERVAL, 30, 100_000, 1e-8) == ACCEPTED

    @pytest.mark.parametrize("msg_id", [102, 4, 16_777_215, 70_000])
    def test_message_that_cannot_be_sent_is_denied_with_a_text(
        self, bench: "Bench", client: "Client", msg_id: int
    ) -> None:
        assert client.command(SET_INTERVAL, msg_id, 100_000) == DENIED
        assert later(bench) == [f"No ap_message for mavlink id ({msg_id})"]

    @pytest.mark.parametrize("interval_us", [-2, -1000, -3e9, math.inf, NAN])
    def test_interval_below_minus_1_is_denied(self, client: "Client", interval_us: float) -> None:
        assert client.command(SET_INTERVAL, 30, interval_us) == DENIED

    @pytest.mark.parametrize("interval_us", [1, 999, 1000, 2000, 2999])
    def test_interval_faster_than_the_loop_allows_is_denied_with_a_long_text(
        self, bench: "Bench", client: "Client", interval_us: float
    ) -> None:
        assert client.command(SET_INTERVAL, 30, interval_us) == DENIED
        text = "Requested rate for message ID 30 too fast. Increase SCHED_LOOP_RATE"
        assert later(bench) == [text[:50], text[50:]]

    def test_minus_1_stops(self, bench: "Bench", client: "Client") -> None:
        client.command(SET_INTERVAL, 0, -1)
        bench.run_ms(2500)
        assert client.read() == []

    def test_zero_restores_the_heartbeat_s_second(self, client: "Client") -> None:
        client.command(SET_INTERVAL, 0, 100_000)
        assert client.command(SET_INTERVAL, 0, 0) == ACCEPTED
        assert client.channel.intervals_ms["HEARTBEAT"] == 1000

    def test_zero_restores_the_group_s_rate(self, make_bench: "MakeBench") -> None:
        client = make_bench(MAV1_EXTRA1=4).client
        client.command(SET_INTERVAL, 30, -1)
        client.command(SET_INTERVAL, 30, 0)
        assert client.channel.intervals_ms["ATTITUDE"] == 250

    def test_zero_switches_off_what_is_in_no_group(self, client: "Client") -> None:
        client.command(SET_INTERVAL, 49, 100_000)
        assert client.command(SET_INTERVAL, 49, 0) == ACCEPTED
        assert "GPS_GLOBAL_ORIGIN" not in client.channel.intervals_ms

    def test_message_id_that_is_nan_reads_as_zero(self, client: "Client") -> None:
        assert client.command(SET_INTERVAL, NAN, 100_000) == ACCEPTED
        assert client.channel.intervals_ms["HEARTBEAT"] == 100


class TestGetMessageInterval:
    """GET_MESSAGE_INTERVAL."""

    @pytest.fixture
    def filter_starts(self) -> bool:
        return False

    def ask(self, client: "Client", *params: float, command: int = GET_INTERVAL) -> list[Message]:
        client.tell(command_long(command, *params))
        return client.read()

    def test_answer_comes_before_the_ack(self, client: "Client") -> None:
        assert kinds(self.ask(client, 0)) == ["MESSAGE_INTERVAL", "COMMAND_ACK"]

    @pytest.mark.parametrize(
        ("msg_id", "interval_us", "result"),
        [(0, 1_000_000, ACCEPTED), (30, -1, ACCEPTED), (102, 0, FAILED), (11_111, 0, FAILED)],
    )
    def test_interval_is_told_in_microseconds(
        self, client: "Client", msg_id: int, interval_us: int, result: int
    ) -> None:
        assert self.ask(client, msg_id) == [
            MESSAGE_INTERVAL(msg_id, interval_us),
            COMMAND_ACK(GET_INTERVAL, result, 0, 0, 255, 190),
        ]

    @pytest.mark.parametrize(("msg_id", "told"), [(65536, 0), (65536 + 30, 30), (-1, 65535), (3e9, 24064)])
    def test_id_beyond_16_bits_fails(self, client: "Client", msg_id: float, told: int) -> None:
        interval, ack = self.ask(client, msg_id)
        assert interval == MESSAGE_INTERVAL(told, 0)
        assert isinstance(ack, COMMAND_ACK)
        assert ack.result == FAILED

    def test_truncated_interval_is_told(self, client: "Client") -> None:
        client.command(SET_INTERVAL, 30, 33_333)
        assert self.ask(client, 30)[0] == MESSAGE_INTERVAL(30, 33_000)

    def test_it_can_be_asked_for_by_request_message(self, client: "Client") -> None:
        assert self.ask(client, 244, 0, command=REQUEST_MESSAGE) == [
            MESSAGE_INTERVAL(0, 1_000_000),
            COMMAND_ACK(REQUEST_MESSAGE, ACCEPTED, 0, 0, 255, 190),
        ]

    def test_it_is_temporarily_rejected_while_the_peer_does_not_read(self, bench: "Bench", client: "Client") -> None:
        while client.channel.send(HEARTBEAT(6, 8, 0, 0, 4, 3)):
            pass
        client.tell(command_long(GET_INTERVAL, 0))
        assert [list(record.values())[-2] for record in bench.logged("MAVC")] == [TEMPORARILY_REJECTED]
        assert len(client.channel.take_output()) < OUTPUT_LIMIT_BYTES + 21


class TestRequestMessage:
    """REQUEST_MESSAGE."""

    def test_message_comes_after_the_ack(self, bench: "Bench", client: "Client") -> None:
        client.tell(command_long(REQUEST_MESSAGE, 30))
        bench.run_ms(3)
        assert kinds(client.read()) == ["COMMAND_ACK", "ATTITUDE"]

    def test_message_comes_once(self, bench: "Bench", client: "Client") -> None:
        client.command(REQUEST_MESSAGE, 30)
        bench.run_ms(900)
        assert kinds(client.read()) == ["ATTITUDE"]

    def test_everything_that_is_known_can_be_requested(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET_GPS_GLOBAL_ORIGIN(1, 1, 1, 1))
        bench.run_ms(10)
        client.read()
        known = {name: sender for name, sender in SENDERS.items() if can_send(name, bench.vehicle.release)}
        for name, sender in known.items():
            assert client.command(REQUEST_MESSAGE, message_id(name)) == ACCEPTED, name
            bench.run_ms(3)
            said = sender(bench.vehicle, client.channel, bench.now_us) is not None
            assert kinds(client.read()) == [name] * said

    @pytest.mark.parametrize("msg_id", [102, 395, 65536, -1, 3e9])
    def test_unknown_message_fails(self, client: "Client", msg_id: float) -> None:
        assert client.command(REQUEST_MESSAGE, msg_id) == FAILED

    @pytest.mark.parametrize("msg_id", [49, 242])
    def test_message_with_nothing_to_say_is_accepted_and_not_sent(
        self, bench: "Bench", client: "Client", msg_id: int
    ) -> None:
        assert client.command(REQUEST_MESSAGE, msg_id) == ACCEPTED
        bench.run_ms(500)
        assert client.read() == []


class TestOthers:
    """REQUEST_AUTOPILOT_CAPABILITIES, GET_HOME_POSITION and DO_SEND_BANNER."""

    def test_capabilities_are_sent(self, bench: "Bench", client: "Client") -> None:
        assert client.command(CAPABILITIES, 1) == ACCEPTED
        bench.run_ms(3)
        assert [version.capabilities for version in client.read_of(AUTOPILOT_VERSION)] == [59823]

    @pytest.mark.parametrize("param1", [0, 2, NAN])
    def test_capabilities_must_be_asked_for_with_1(self, bench: "Bench", client: "Client", param1: float) -> None:
        assert client.command(CAPABILITIES, param1) == FAILED
        bench.run_ms(3)
        assert client.read() == []

    def test_home_fails_while_unset(self, client: "Client") -> None:
        assert client.command(GET_HOME) == FAILED

    def set_home(self, bench: "Bench") -> None:
        bench.client.tell(SET_GPS_GLOBAL_ORIGIN(1, 1, 1, 1))
        assert bench.client.command_int(SET_HOME, 1, 1, 1.0) == ACCEPTED
        bench.run_ms(10)
        bench.client.read()

    def test_home_and_origin_come_before_the_ack(self, bench: "Bench", client: "Client") -> None:
        self.set_home(bench)
        client.tell(command_long(GET_HOME))
        assert kinds(client.read()) == ["HOME_POSITION", "GPS_GLOBAL_ORIGIN", "COMMAND_ACK"]

    def test_home_without_an_origin_comes_alone(
        self, bench: "Bench", client: "Client", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.set_home(bench)
        monkeypatch.setattr(bench.vehicle.ahrs, "origin", lambda: None)
        client.tell(command_long(GET_HOME))
        assert kinds(client.read()) == ["HOME_POSITION", "COMMAND_ACK"]

    def test_banner_follows_the_ack(self, bench: "Bench", client: "Client") -> None:
        assert client.command(BANNER) == ACCEPTED
        assert later(bench) == list(bench.vehicle.banner())
