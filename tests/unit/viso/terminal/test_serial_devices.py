# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulator's words for what a serial port is connected to."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.errors import InputError
from viso.terminal.serial_devices import DEFAULT_DEVICES, SerialDevice, mavlink_ports, read_device
from viso.terminal.settings import known_parameters


def read(text: str) -> SerialDevice:
    return read_device("--serial1", text, 5770, "127.0.0.1")


@pytest.mark.parametrize(
    ("text", "device"),
    [
        ("tcp:0:wait", SerialDevice("tcpin:127.0.0.1:5770", waits=True)),
        ("tcp:2", SerialDevice("tcpin:127.0.0.1:5772")),
        ("tcp:5792:nowait", SerialDevice("tcpin:127.0.0.1:5792")),
        ("tcpclient:10.0.0.1:99", SerialDevice("tcp:10.0.0.1:99")),
        ("udpclient:127.0.0.1", SerialDevice("udpout:127.0.0.1:14550")),
        ("udpclient:host:14560", SerialDevice("udpout:host:14560")),
        ("udp:127.0.0.1:14550", SerialDevice("udp:127.0.0.1:14550")),
        ("mcast:", SerialDevice("mcast:")),
        ("uart:/dev/ttyUSB0:57600", SerialDevice("serial:/dev/ttyUSB0,57600")),
        ("uart:/dev/ttyUSB0", SerialDevice("serial:/dev/ttyUSB0")),
        ("sim:vicon:", SerialDevice(is_vicon=True)),
        ("sim:vicon", SerialDevice(is_vicon=True)),
        ("none", SerialDevice()),
        ("GPS1", SerialDevice()),
    ],
)
def test_device_is_a_link(text: str, device: SerialDevice) -> None:
    assert read(text) == device


@pytest.mark.parametrize("text", ["", "tcp", "tcp:x", "tcpclient:host", "file:x", "sim", "5760", "uart:"])
def test_no_device_is_one_line(text: str) -> None:
    with pytest.raises(InputError, match=r"^--serial1 "):
        read(text)


def test_simulated_device_that_is_not_there_is_named() -> None:
    with pytest.raises(InputError, match="no simulated nmea here; there is sim:vicon"):
        read("sim:nmea")


@given(st.text(max_size=30))
def test_any_text_is_a_device_or_refused(text: str) -> None:
    with contextlib.suppress(InputError):
        read(text)


def test_mavlink_is_on_the_ports_that_have_its_protocol() -> None:
    params = known_parameters(4)
    assert mavlink_ports(params, len(DEFAULT_DEVICES)) == [0, 1, 2]
    params.set("SERIAL5_PROTOCOL", 2)
    params.set("SERIAL1_PROTOCOL", -1)
    assert mavlink_ports(params, len(DEFAULT_DEVICES)) == [0, 2, 5]
