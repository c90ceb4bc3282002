# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One link: transport time of a UART, time correction, counters, and the limit on waiting output."""

import pytest

from ap_core.verdict import VerdictKind
from mav_handlers.channel import OUTPUT_LIMIT_BYTES, Channel, ParamListState
from mav_handlers.schedule import NEVER_MS
from mav_handlers.verdicts import BAD_PREFIX, HANDLED
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    ATT_POS_MOCAP,
    COMMAND_INT,
    GLOBAL_VISION_POSITION_ESTIMATE,
    HEARTBEAT,
    ODOMETRY,
    TIMESYNC,
    VICON_POSITION_ESTIMATE,
    VISION_POSITION_ESTIMATE,
    VISION_SPEED_ESTIMATE,
    Message,
)

READ_US = 10_000_000
HEARTBEAT_BYTES = 21


def make_channel(baud: int | None = None) -> Channel:
    return Channel(0, "link", Codec(1, 1), baud)


def heartbeat() -> HEARTBEAT:
    return HEARTBEAT(2, 3, 81, 0, 3, 3)


@pytest.mark.parametrize(
    ("message_type", "payload_size"),
    [
        (VISION_POSITION_ESTIMATE, 129),
        (GLOBAL_VISION_POSITION_ESTIMATE, 129),
        (VICON_POSITION_ESTIMATE, 128),
        (VISION_SPEED_ESTIMATE, 69),
        (ATT_POS_MOCAP, 132),
        (ODOMETRY, 245),
        (COMMAND_INT, 47),
        (TIMESYNC, 28),
    ],
)
def test_uart_takes_86_us_for_each_byte_at_115200(message_type: type[Message], payload_size: int) -> None:
    assert make_channel(115200).arrival_us(message_type, READ_US, READ_US) == READ_US - 86 * payload_size


@pytest.mark.parametrize(
    ("baud", "per_byte_us"), [(57600, 173), (115200, 86), (230400, 43), (460800, 21), (921600, 10), (1500000, 6)]
)
def test_time_of_a_byte_is_a_whole_number_of_microseconds(baud: int, per_byte_us: int) -> None:
    assert make_channel(baud).arrival_us(TIMESYNC, READ_US, READ_US) == READ_US - per_byte_us * 28


def test_bytes_still_unread_came_after_the_message() -> None:
    channel = make_channel(115200)
    channel.codec.feed(b"\xfd" + bytes(9))
    assert channel.arrival_us(TIMESYNC, READ_US, READ_US) == READ_US - 86 * (28 + 10)


def test_network_link_adds_no_transport_time() -> None:
    assert make_channel().arrival_us(ODOMETRY, READ_US, READ_US) == READ_US


def test_arrival_before_boot_wraps_in_64_bits() -> None:
    assert make_channel(115200).arrival_us(TIMESYNC, 0, 0) == (1 << 64) - 86 * 28


def test_first_sample_is_made_when_it_arrived() -> None:
    assert make_channel(115200).correct_time_ms(TIMESYNC, 5, READ_US, READ_US) == (READ_US - 86 * 28) // 1000


def test_arrival_time_of_zero_means_now() -> None:
    assert make_channel().correct_time_ms(TIMESYNC, 5, 0, 7_654_321) == 7654


def test_corrected_time_has_the_low_32_bits_of_the_milliseconds() -> None:
    read_us = ((1 << 32) + 5) * 1000
    assert make_channel().correct_time_ms(TIMESYNC, 0, read_us, read_us) == 5


@pytest.mark.parametrize(("age_us", "reserved"), [(0, 100), (1_999_999, 100), (2_000_000, 0)])
def test_room_kept_for_parameters_counts_as_received_bytes_for_2_s(age_us: int, reserved: int) -> None:
    channel = make_channel(115200)
    channel.reserve.start(READ_US - age_us)
    assert channel.arrival_us(TIMESYNC, READ_US, READ_US) == READ_US - 86 * (28 + reserved)


def test_heartbeat_and_parameters_alone_are_no_streaming() -> None:
    channel = make_channel()
    channel.deferred.set_interval("HEARTBEAT", 1000, 0)
    channel.deferred.set_interval("PARAM_VALUE", 100, 0)
    assert not channel.streaming


def test_nothing_is_streamed_to_nobody() -> None:
    channel = make_channel()
    channel.buckets.set_interval("ATTITUDE", 20, 0)
    assert channel.wait_ms(0) == 20
    channel.has_reader = False
    assert (channel.wait_ms(0), channel.intervals_ms["ATTITUDE"]) == (NEVER_MS, 20)


def test_any_other_message_is_streaming() -> None:
    channel = make_channel()
    channel.buckets.set_interval("ATTITUDE", 1000, 0)
    assert channel.streaming


def test_intervals_are_those_of_timers_and_buckets() -> None:
    channel = make_channel()
    channel.deferred.set_interval("HEARTBEAT", 1000, 0)
    channel.buckets.set_interval("ATTITUDE", 20, 0)
    assert channel.intervals_ms == {"HEARTBEAT": 1000, "ATTITUDE": 20}


@pytest.mark.parametrize(
    ("slowdown_ms", "is_listing", "ftp_is_busy", "interval_ms"),
    [
        (0, False, False, 250),
        (60, False, False, 310),
        (0, True, False, 1000),
        (0, False, True, 1000),
        (0, True, True, 4000),
        (60, True, True, 4960),
    ],
)
def test_intervals_grow_with_the_radio_s_buffer_and_then_with_each_transfer(
    slowdown_ms: int, is_listing: bool, ftp_is_busy: bool, interval_ms: int
) -> None:
    channel = make_channel()
    channel.stream_slowdown_ms = slowdown_ms
    channel.param_list = ParamListState(0, 9) if is_listing else None
    channel.ftp_is_busy = ftp_is_busy
    assert channel.reschedule_interval_ms(250) == interval_ms


def test_slowed_interval_is_limited_to_a_minute() -> None:
    channel = make_channel()
    channel.ftp_is_busy = True
    assert channel.reschedule_interval_ms(15_001) == 60_000


def test_verdicts_are_counted_by_message_and_rule() -> None:
    channel = make_channel()
    channel.count("HEARTBEAT", HANDLED)
    channel.count("HEARTBEAT", HANDLED)
    channel.count("BAD_DATA", BAD_PREFIX, 17)
    assert channel.counters == {
        ("HEARTBEAT", VerdictKind.HANDLED, "handled"): 2,
        ("BAD_DATA", VerdictKind.DROPPED, "bad_prefix"): 17,
    }


def test_output_is_given_once() -> None:
    channel = make_channel()
    channel.send(heartbeat())
    assert len(channel.take_output()) == HEARTBEAT_BYTES
    assert channel.take_output() == b""


def test_peer_that_does_not_read_costs_limited_memory() -> None:
    channel = make_channel()
    for _ in range(20_000):
        channel.send(heartbeat())
    assert len(channel.take_output()) < OUTPUT_LIMIT_BYTES + HEARTBEAT_BYTES


def test_frames_that_find_no_room_are_counted() -> None:
    channel = make_channel()
    sent = sum(channel.send(heartbeat()) for _ in range(4000))
    assert (sent, channel.frames_not_sent) == (3121, 879)
    assert channel.send(heartbeat(), heartbeat()) is False
    assert channel.frames_not_sent == 881


def test_frames_of_others_that_find_no_room_are_counted() -> None:
    channel = make_channel()
    forwarded = sum(channel.forward(bytes(280)) for _ in range(236))
    assert (forwarded, channel.frames_not_sent) == (235, 1)


def test_frames_that_find_no_room_take_no_sequence_number() -> None:
    channel = make_channel()
    while channel.send(heartbeat()):
        pass
    assert len(channel.take_output()) == channel.codec.frames_sent * HEARTBEAT_BYTES


def test_room_comes_back_as_the_peer_reads() -> None:
    channel = make_channel()
    while channel.send(heartbeat()):
        pass
    channel.take_output()
    assert channel.send(heartbeat())


def test_transmit_space_shows_8192_at_most() -> None:
    assert make_channel().txspace() == 8192


def test_transmit_space_is_what_is_left() -> None:
    channel = make_channel()
    while channel.txspace() >= 200:
        channel.send(heartbeat())
    assert channel.txspace() == OUTPUT_LIMIT_BYTES - len(channel.take_output())


def test_transmit_space_of_an_overfull_link_is_none() -> None:
    channel = make_channel()
    while channel.send(heartbeat()):
        pass
    assert channel.txspace() == 0


def test_message_that_does_not_fit_is_counted() -> None:
    channel = make_channel()
    assert channel.has_space_for(ODOMETRY)
    assert channel.times_full == 0
    while channel.txspace() >= 245:
        channel.send(heartbeat())
    assert not channel.has_space_for(ODOMETRY)
    assert channel.times_full == 1


def test_room_kept_for_parameters_is_not_for_others() -> None:
    channel = make_channel()
    while channel.txspace() >= 120:
        channel.send(heartbeat())
    channel.reserve.start(0)
    assert channel.has_space_for(HEARTBEAT)
    assert not channel.has_space_for(HEARTBEAT, 1_999_999)
    assert channel.has_space_for(HEARTBEAT, 2_000_000)
