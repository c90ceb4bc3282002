# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""HOST:PORT, and what stands in for a missing half."""

import pytest

from mav_handlers.links import LinkError
from mav_handlers.links.address import HostPort, parse_host_port, resolve


@pytest.mark.parametrize(
    ("address", "host", "port"),
    [
        ("192.0.2.7:14550", "192.0.2.7", 14550),
        ("vehicle.local:1", "vehicle.local", 1),
        ("0.0.0.0:65535", "0.0.0.0", 65535),
        ("14550", "127.0.0.1", 14550),
        (":14550", "127.0.0.1", 14550),
    ],
)
def test_address_without_host_means_loopback(address: str, host: str, port: int) -> None:
    assert parse_host_port("x", address) == HostPort(host, port)


@pytest.mark.parametrize(
    "address", ["", ":", "host", "host:", "host:-1", "host:65536", "host:0", "host:1e3", "::1:14550", "h:²"]
)
def test_malformed_address_is_an_error_in_one_line(address: str) -> None:
    with pytest.raises(LinkError, match=r"\Abad connection string 'tcp:[^\n]*\Z"):
        parse_host_port(f"tcp:{address}", address)


def test_port_0_is_for_those_who_bind() -> None:
    assert parse_host_port("x", "0", any_port=True).port == 0


def test_name_resolves_to_ipv4() -> None:
    assert resolve("x", HostPort("localhost", 5)) == ("127.0.0.1", 5)


def test_unusable_host_is_an_error_in_one_line() -> None:
    host = "a" * 300
    with pytest.raises(LinkError, match=r"\Acannot open x: [^\n]+\Z"):
        resolve("x", HostPort(host, 5))
