# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may talk to the page's server."""

import socket

import pytest

from viso.web.same_site import is_own_name, is_same_site


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8080", "localhost:8080", "LOCALHOST", "[::1]:8080", "192.168.1.7", "named.example:80"]
)
def test_names_that_can_only_mean_this_server(host: str) -> None:
    assert is_own_name(host, "named.example")


def test_own_host_name_is_known() -> None:
    assert is_own_name(f"{socket.gethostname()}:8080", "0.0.0.0")


@pytest.mark.parametrize("host", ["", ":8080", "evil.example", "127.0.0.1.evil.example", "localhost.evil.example:8080"])
def test_names_that_somebody_may_have_made_mean_this_server(host: str) -> None:
    assert not is_own_name(host, "127.0.0.1")


def test_page_of_this_server_is_the_same_site() -> None:
    assert is_same_site("http://127.0.0.1:8080", "127.0.0.1:8080")


@pytest.mark.parametrize(
    "origin",
    [
        None, "null", "", "http://evil.example", "http://127.0.0.1:8081", "https://127.0.0.1:8080", "file://",
        "http://127.0.0.1:8080.evil.example",
    ],
)  # fmt: skip
def test_anybody_elses_page_is_not(origin: str | None) -> None:
    assert not is_same_site(origin, "127.0.0.1:8080")
