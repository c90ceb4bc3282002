# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Multicast: members hear each other and not themselves."""

from collections.abc import Callable

import pytest

from mav_handlers.links import Link, LinkError, is_open_to_network
from mav_handlers.links.mcast import McastLink

Collect = Callable[[Link, int], bytes]


def test_member_hears_the_others_but_not_itself(group: tuple[str, int], collect: Collect) -> None:
    first, second = McastLink("mcast:", group, "127.0.0.1"), McastLink("mcast:", group, "127.0.0.1")
    first.send(b"mine")
    second.send(b"yours")
    assert collect(first, 5) == b"yours"
    assert first.receive() == b""
    assert is_open_to_network(first)
    first.close()
    second.close()


def test_address_that_is_no_group_is_an_error_in_one_line() -> None:
    with pytest.raises(LinkError, match=r"\Acannot open mcast:127\.0\.0\.1:24552: [^\n]+\Z"):
        McastLink("mcast:127.0.0.1:24552", ("127.0.0.1", 24552))
