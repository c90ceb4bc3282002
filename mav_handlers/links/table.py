# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The links by the scheme of their connection strings, one row each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ap_core.plugins import with_plugins
from mav_handlers.links.address import is_loopback
from mav_handlers.links.base import ConnectionStringError, Link, LinkError, bad_string
from mav_handlers.links.mcast import McastLink, open_mcast
from mav_handlers.links.tcp import TcpServerLink, open_tcp, open_tcpin
from mav_handlers.links.udp import UdpInLink, open_udpin, open_udpout


@dataclass(frozen=True)
class LinkFactory:
    """Opens links of one scheme.

    ``form`` is the form of the connection string, ``summary`` a description of the link. ``open`` takes the whole
    connection string and the part after its scheme.
    """

    form: str
    summary: str
    open: Callable[[str, str], Link]

    def __call__(self, connection: str, address: str) -> Link:
        """Open the link. Raises LinkError if that fails."""
        return self.open(connection, address)


def _open_serial(connection: str, address: str) -> Link:
    from mav_handlers.links.serial_port import open_serial  # only serial links need pyserial

    return open_serial(connection, address)


SERIAL = "serial"

LINKS: Mapping[str, LinkFactory] = MappingProxyType(
    {
        "udpin": LinkFactory("udpin:[HOST:]PORT", "UDP, bind and answer those who send", open_udpin),
        "udpout": LinkFactory("udpout:[HOST:]PORT", "UDP, send to an address", open_udpout),
        "udp": LinkFactory("udp:[HOST:]PORT", "the same as udpin", open_udpin),
        "tcp": LinkFactory("tcp:[HOST:]PORT", "TCP client, reconnects", open_tcp),
        "tcpin": LinkFactory(
            "tcpin:[HOST:]PORT",
            "TCP server; `viso serve` serves up to 8 clients at once, other commands one",
            open_tcpin,
        ),
        "mcast": LinkFactory("mcast:[[GROUP:]PORT]", "UDP multicast", open_mcast),
        SERIAL: LinkFactory("[serial:]/dev/ttyX[,BAUD]", "serial port, 115200 baud by default", _open_serial),
    }
)


def all_links() -> Mapping[str, LinkFactory]:
    """Return all links by scheme, including those of plug-ins."""
    return with_plugins("viso.links", LINKS, LinkFactory)


def open_link(connection: str) -> Link:
    """Open the link that a connection string describes.

    The strings are pymavlink's, with two differences that keep traffic on this machine and in one program: without a
    host the address is 127.0.0.1, and a UDP port in use is an error. Raises LinkError for a string of none of the known
    forms, or a link that cannot be opened.
    """
    scheme, address = _split(connection)
    try:
        factory = LINKS.get(scheme) or all_links().get(scheme)
        if factory is None:
            raise bad_string(connection, "no link has this form")
        return factory(connection, address)
    except ConnectionStringError as error:
        forms = ", ".join(factory.form for factory in all_links().values())
        raise LinkError(f"{error}; known forms: {forms}") from None


def is_open_to_network(link: Link) -> bool:
    """Return whether a link accepts data from other machines."""
    return isinstance(link, UdpInLink | TcpServerLink | McastLink) and not is_loopback(link.address)


def _split(connection: str) -> tuple[str, str]:
    """Return scheme and address; a bare device path is a serial port."""
    if connection.startswith("/"):
        return SERIAL, connection
    scheme, colon, address = connection.partition(":")
    return (scheme, address) if colon else ("", connection)
