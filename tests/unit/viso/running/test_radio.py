# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The radio over UDP: whatever comes, there are sixteen pulse lengths."""

import socket
import struct
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.links import LinkError, wait_readable
from viso.running.radio import UdpRadio
from viso.vehicle.copter.receiver import RADIO_AT_REST_US


@pytest.fixture
def radio() -> Iterator[UdpRadio]:
    radio = UdpRadio("127.0.0.1", 0)
    yield radio
    radio.close()


def send(radio: UdpRadio, *datagrams: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for data in datagrams:
            sender.sendto(data, ("127.0.0.1", radio.port))
    wait_readable([radio], 1.0)


def packed(*pulses_us: int) -> bytes:
    return struct.pack(f"<{len(pulses_us)}H", *pulses_us)


def test_rests_until_it_is_moved(radio: UdpRadio) -> None:
    assert radio.channels_us() == RADIO_AT_REST_US


def test_last_datagram_counts_and_zero_leaves_a_channel(radio: UdpRadio) -> None:
    send(radio, packed(*range(1101, 1117)), packed(*[1900, 0] * 8))
    expected = [1900 if number % 2 == 0 else 1101 + number for number in range(16)]
    assert list(radio.channels_us()) == expected


def test_radio_of_eight_channels_leaves_the_others(radio: UdpRadio) -> None:
    send(radio, packed(*(1200,) * 8))
    assert radio.channels_us() == (1200,) * 8 + RADIO_AT_REST_US[8:]


@given(st.binary(max_size=70).filter(lambda data: len(data) not in (16, 32)))
def test_datagram_of_another_length_is_dropped_and_counted(data: bytes) -> None:
    radio = UdpRadio("127.0.0.1", 0)
    send(radio, data)
    assert radio.channels_us() == RADIO_AT_REST_US
    assert radio.malformed == 1
    radio.close()


def test_port_in_use_is_one_line(radio: UdpRadio) -> None:
    with pytest.raises(LinkError, match=f"cannot open the radio's UDP port 127.0.0.1:{radio.port}: address already"):
        UdpRadio("127.0.0.1", radio.port)
