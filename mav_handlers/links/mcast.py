# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Multicast link: ``mcast:``, ``mcast:PORT`` or ``mcast:GROUP:PORT``; every member receives from all others.

Unlike the other defaults this one leaves the machine: the group is joined on the interface of the default route, as
other programs do for ``mcast:``.
"""

import socket

from mav_handlers.links.address import SocketAddress, parse_host_port, resolve
from mav_handlers.links.base import cannot_open
from mav_handlers.links.datagram import DatagramLink, datagram_socket

GROUP = "239.255.145.50"
PORT = 14550
ANY_INTERFACE = "0.0.0.0"


class McastLink(DatagramLink):
    """A link to a multicast group, without its own datagrams.

    A second socket sends; its port identifies the link's own datagrams.
    """

    def __init__(self, name: str, group: SocketAddress, interface: str = ANY_INTERFACE) -> None:
        """Join ``group`` on the interface with the given address; the default lets the system choose."""
        receiver, self._sender = datagram_socket(), datagram_socket()
        local = socket.inet_aton(interface)
        try:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # members share the port
            receiver.bind(group)
            membership = socket.inet_aton(group[0]) + local
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            self._sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, local)
            self._sender.connect(group)
        except OSError as error:
            receiver.close()
            self._sender.close()
            raise cannot_open(name, error) from None
        self._sender.setblocking(False)
        self._own_address: SocketAddress = self._sender.getsockname()
        super().__init__(name, receiver)

    def close(self) -> None:
        """Leave the group."""
        super().close()
        self._sender.close()

    def _accept(self, peer: SocketAddress, data: bytes) -> bool:
        return peer != self._own_address

    def _transmit(self, data: bytes) -> None:
        self._send_to(self._sender, data)


def open_mcast(name: str, address: str) -> McastLink:
    """Open ``mcast:[[GROUP:]PORT]``. Raises LinkError for a bad address or a group that cannot be joined."""
    return McastLink(name, resolve(name, parse_host_port(name, address or str(PORT), GROUP)))
