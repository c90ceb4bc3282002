# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of links share: bounded waits, and a multicast group of their own."""

import socket
import time
from collections.abc import Callable

import pytest

from mav_handlers.links import Link, wait_readable

DEADLINE_S = 5.0

Collect = Callable[[Link, int], bytes]
Until = Callable[[Callable[[], bool], Link], None]


@pytest.fixture
def until() -> Until:
    """Return a function that waits on a link until a condition holds, and fails after a deadline."""

    def wait(condition: Callable[[], bool], link: Link) -> None:
        deadline_s = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline_s, f"{link.name}: nothing happened"
            wait_readable([link], 0.001)

    return wait


@pytest.fixture
def collect(until: Until) -> Collect:
    """Return a function that reads a number of bytes from a link."""

    def read(link: Link, count: int) -> bytes:
        got = bytearray()

        def enough() -> bool:
            got.extend(link.receive())
            return len(got) >= count

        until(enough, link)
        return bytes(got)

    return read


@pytest.fixture
def group() -> tuple[str, int]:
    """Return a multicast group and port that no other test run uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return "239.255.145.50", int(probe.getsockname()[1])
