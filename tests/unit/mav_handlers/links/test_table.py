# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Connection strings, from text to link."""

import os
import subprocess
import sys

import pytest

from mav_handlers.links import LINKS, LinkError, is_open_to_network, open_link
from mav_handlers.links.mcast import McastLink
from mav_handlers.links.serial_port import SerialLink
from mav_handlers.links.tcp import TcpLink, TcpServerLink
from mav_handlers.links.udp import UdpInLink, UdpOutLink


@pytest.mark.parametrize(
    ("connection", "kind"),
    [
        ("udpin:127.0.0.1:0", UdpInLink),
        ("udp:0", UdpInLink),
        ("udpout:127.0.0.1:14550", UdpOutLink),
        ("tcp:127.0.0.1:1", TcpLink),
        ("tcpin:localhost:0", TcpServerLink),
    ],
)
def test_scheme_selects_the_link_and_name_is_the_string(connection: str, kind: type) -> None:
    link = open_link(connection)
    assert type(link) is kind
    assert link.name == connection
    link.close()


@pytest.mark.parametrize(
    ("connection", "is_open"),
    [
        ("udpin:0", False),
        ("udpin:0.0.0.0:0", True),
        ("udpout:127.0.0.1:14550", False),
        ("tcp:127.0.0.1:1", False),
        ("tcpin:localhost:0", False),
        ("tcpin:0.0.0.0:0", True),
    ],
)
def test_link_that_listens_beyond_this_machine_is_open_to_the_network(connection: str, is_open: bool) -> None:
    link = open_link(connection)
    link.close()
    assert is_open_to_network(link) is is_open


@pytest.mark.parametrize("form", ["{}", "{},57600", "serial:{}", "serial:{},57600"])
def test_device_is_a_serial_link_with_or_without_scheme_and_rate(form: str) -> None:
    master, slave = os.openpty()
    link = open_link(form.format(os.ttyname(slave)))
    assert isinstance(link, SerialLink)
    assert link.baud == (57600 if "," in form else 115200)
    link.close()
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize(
    ("address", "group"),
    [("", ("239.255.145.50", 14550)), ("5", ("239.255.145.50", 5)), ("239.1.2.3:6", ("239.1.2.3", 6))],
)
def test_mcast_defaults_are_pymavlinks(address: str, group: tuple[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[tuple[str, int]] = []
    monkeypatch.setattr(McastLink, "__init__", lambda self, name, where: opened.append(where))
    open_link(f"mcast:{address}")
    assert opened == [group]


@pytest.mark.parametrize(
    "connection",
    ["", "COM3", "ftp:host:1", "udpin:", "udpout:host", "tcp:1:2:3", "serial:", "/dev/ttyX,fast", "/dev/ttyX,0"],
)
def test_bad_string_is_an_error_that_lists_the_known_forms(connection: str) -> None:
    with pytest.raises(LinkError) as caught:
        open_link(connection)
    text = str(caught.value)
    assert text.startswith(f"bad connection string {connection!r}: ")
    assert all(factory.form in text for factory in LINKS.values())
    assert "\n" not in text


def test_form_of_each_row_shows_its_scheme() -> None:
    assert all(scheme in factory.form and factory.summary for scheme, factory in LINKS.items())


def test_without_host_nothing_is_bound_beyond_loopback() -> None:
    for connection in ("udpin:0", "tcpin:0", "udp::0"):
        link = open_link(connection)
        assert isinstance(link, UdpInLink | TcpServerLink)
        assert link.address[0] == "127.0.0.1"
        link.close()


def test_importing_the_links_does_not_import_pyserial() -> None:
    code = "import sys, mav_handlers.links; sys.exit('serial' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
