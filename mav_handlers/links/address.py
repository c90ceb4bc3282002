# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""HOST:PORT in connection strings; IPv4 addresses and host names only."""

import socket
from dataclasses import dataclass

from mav_handlers.links.base import bad_string, cannot_open

LOOPBACK = "127.0.0.1"

SocketAddress = tuple[str, int]


@dataclass(frozen=True)
class HostPort:
    """One end of a network link; ``host`` is as written, or the default."""

    host: str
    port: int


def text_of(address: SocketAddress) -> str:
    """Return an address as HOST:PORT."""
    host, port = address
    return f"{host}:{port}"


def is_loopback(address: SocketAddress) -> bool:
    """Return whether an IPv4 address can only be reached from this machine."""
    return address[0].startswith("127.")


def parse_host_port(name: str, address: str, default_host: str = LOOPBACK, *, any_port: bool = False) -> HostPort:
    """Read ``HOST:PORT``, ``:PORT`` or ``PORT``; the host defaults to ``default_host``.

    pymavlink refuses ``PORT`` and takes an empty host as every interface; here the default host keeps traffic on the
    machine.

    Args:
        name: The whole connection string, for the error.
        address: What follows the scheme.
        default_host: The host if there is none.
        any_port: Whether port 0 (the system chooses) is allowed.

    Raises:
        ConnectionStringError: The address has another form.
    """
    host, _, port_text = address.rpartition(":")
    if ":" in host:
        raise bad_string(name, "expected HOST:PORT with an IPv4 address or a name")
    if not (port_text.isascii() and port_text.isdigit() and len(port_text) <= 5):
        raise bad_string(name, f"{port_text!r} is not a port number")
    port = int(port_text)
    if port > 65535 or (port == 0 and not any_port):
        raise bad_string(name, f"port {port} is out of range")
    return HostPort(host or default_host, port)


def resolve(name: str, where: HostPort) -> SocketAddress:
    """Look up the host and return its IPv4 address. Raises LinkError if the name is unknown."""
    try:
        found = socket.getaddrinfo(where.host, where.port, socket.AF_INET, socket.SOCK_STREAM)
    except (OSError, ValueError) as error:  # a host that cannot be encoded is a ValueError
        raise cannot_open(name, error) from None
    return str(found[0][4][0]), where.port
