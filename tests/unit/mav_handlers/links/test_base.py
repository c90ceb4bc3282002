# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors in one line, and waiting on several links."""

import errno
import socket

import pytest

from mav_handlers.links import make_pair, open_link, wait_readable
from mav_handlers.links.base import LinkError, cannot_open, reason_of
from mav_handlers.links.udp import UdpInLink


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (OSError(errno.EADDRINUSE, "whatever the library says"), "address already in use"),
        (socket.gaierror(-2, "Name or service not known"), "name or service not known"),
        (socket.gaierror("Odd"), "odd"),
        (OSError("Two\n lines"), "two lines"),
        (ValueError("Not valid"), "not valid"),
    ],
)
def test_reason_is_the_systems_words_in_one_line(error: Exception, text: str) -> None:
    assert reason_of(error) == text


def test_cannot_open_names_the_link_and_the_reason() -> None:
    error = cannot_open("tcpin:127.0.0.1:5760", OSError(errno.EADDRINUSE, ""))
    assert isinstance(error, LinkError)
    assert str(error) == "cannot open tcpin:127.0.0.1:5760: address already in use"


def test_wait_returns_the_links_with_data_only() -> None:
    quiet = UdpInLink("udpin:0", ("127.0.0.1", 0))
    busy = UdpInLink("udpin:0", ("127.0.0.1", 0))
    client = open_link(f"udpout:127.0.0.1:{busy.address[1]}")
    client.send(b"x")
    assert wait_readable([quiet, busy], 5.0) == [busy]
    for link in (quiet, busy, client):
        link.close()


def test_wait_passes_over_links_without_descriptor() -> None:
    left, right = make_pair()
    left.send(b"x")
    assert wait_readable([right], 0.0) == []
