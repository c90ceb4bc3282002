# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface of links: bytes in, bytes out, counters, and no exception once a link is open."""

import os
import resource
import select
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeVar

Monotonic = Callable[[], float]
"""A clock in seconds that never goes back; links read ``time.monotonic`` unless a test passes its own."""

DROP_CLOSED = "link closed"
DROP_NO_PEER = "no peer"
DROP_BACKLOG_FULL = "backlog full"

SPARE_DESCRIPTORS = 16
"""File descriptors reserved for the vehicle's own files, such as logs and parameters; new clients do not get them."""


MOST_REFUSED_TOLD = 16
"""The number of refused clients that are reported by name, until there is room again."""


class LinkError(Exception):
    """A link that cannot be opened; the text is one line that names the link and the reason."""


class ConnectionStringError(LinkError):
    """A connection string of no known form."""


def bad_string(name: str, why: str) -> ConnectionStringError:
    """Build the error for a connection string, in one line."""
    return ConnectionStringError(f"bad connection string {name!r}: {why}")


@dataclass
class LinkStats:
    """Counters of what a link has carried and lost since it was opened.

    ``bytes_in`` and ``bytes_out`` count the bytes read from and written to the system. ``bytes_dropped`` counts bytes
    known to be lost, also when the system reports the loss later. ``drop_reasons`` counts losses (a call to ``send``, a
    datagram or a whole backlog) by reason, and failed reads, which lose no bytes. ``connects`` and ``disconnects``
    count peers gained and lost, if a link knows its peers. ``open_failures`` counts failed attempts to get a peer or a
    device; ``open_failure`` is the reason of a client's last one.
    """

    bytes_in: int = 0
    bytes_out: int = 0
    bytes_dropped: int = 0
    connects: int = 0
    disconnects: int = 0
    open_failures: int = 0
    open_failure: str = ""
    drop_reasons: Counter[str] = field(default_factory=Counter)

    def drop(self, size: int, reason: str) -> None:
        """Count one loss of ``size`` bytes."""
        self.bytes_dropped += size
        self.drop_reasons[reason] += 1

    @property
    def unreached(self) -> str:
        """The reason why there has never been a peer; empty if there was one, or no attempt has failed."""
        return "" if self.connects else self.open_failure

    def snapshot(self) -> "LinkStats":
        """Return a copy of the present values."""
        return replace(self, drop_reasons=self.drop_reasons.copy())


class News:
    """Reports to a listener which peers come and go on a link, and what fails.

    A failure that repeats for one reason is reported once. So is each refused client, up to 16 of them, until there is
    room again.
    """

    def __init__(self) -> None:
        self._listener: Callable[[str], None] = lambda _text: None
        self._failure = ""
        self._refused: set[str] = set()

    def tell(self, listener: Callable[[str], None]) -> None:
        """Set the listener, and report a present failure at once."""
        self._listener = listener
        if self._failure:
            listener(self._failure)

    def connected(self, peer: str) -> None:
        """Report a new peer."""
        self._failure = ""
        self._listener(f"{peer} connected")

    def left(self, peer: str, why: str) -> None:
        """Report that a peer has left."""
        self._refused.clear()
        self._listener(f"{peer} left: {why}")

    def failed(self, why: str) -> None:
        """Report that no peer can be reached."""
        text = f"{why}; attempts go on"
        if text != self._failure:
            self._failure = text
            self._listener(text)

    def refused(self, peer: str, why: str) -> None:
        """Report that a client was refused."""
        if peer not in self._refused and len(self._refused) < MOST_REFUSED_TOLD:
            self._refused.add(peer)
            self._listener(f"{peer} refused: {why}")


class Link(Protocol):
    """Carries bytes to and from a peer without ever blocking or raising.

    ``name`` is the connection string as given. ``baud`` is the rate for the model of the UART's transport
    time, None for no delay; the owner may set it, as the firmware's simulator applies a rate to its TCP ports. ``news``
    reports peers that come and go.
    """

    name: str
    baud: int | None
    news: News

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return the addresses or devices of the peers, if the link knows them."""

    def admit(self) -> "Link | None":
        """Return a new link for a further client that waits at a server; None if none waits.

        Such a link ends when its client leaves. A server whose ``admit`` is never called serves one client after the
        other.
        """

    @property
    def stats(self) -> LinkStats:
        """Return a snapshot of the counters."""

    def receive(self, max_bytes: int = 65536) -> bytes:
        """Return bytes that have arrived, at most ``max_bytes``, or b"" when there are none.

        Call it until it returns b"": a datagram that was cut by ``max_bytes`` does not make ``fileno``
        readable. Raises ValueError if ``max_bytes`` is not positive.
        """

    def send(self, data: bytes) -> None:
        """Send the bytes, or keep them in a bounded backlog, or drop the whole call and count it."""

    def fileno(self) -> int:
        """Return the descriptor to wait on for reading, -1 if there is none; any call may change it."""

    def close(self) -> None:
        """Release everything; after that ``receive`` returns b"" and ``send`` counts a drop."""


class LinkParts:
    """Base of links: name, counters and news; without known peers or further clients unless a subclass has them."""

    def __init__(self, name: str, baud: int | None = None) -> None:
        self.name = name
        self.baud = baud
        self.news = News()
        self._counters = LinkStats()
        self._closed = False

    @property
    def stats(self) -> LinkStats:
        """Return a snapshot of the counters."""
        return self._counters.snapshot()

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return no names: the peer is not known."""
        return ()

    def admit(self) -> Link | None:
        """Return None: there are no further clients."""
        return None


def check_max_bytes(max_bytes: int) -> None:
    """Raise ValueError unless positive: a read of 0 bytes would look like the end of a stream."""
    if max_bytes < 1:
        raise ValueError(f"max_bytes must be positive, not {max_bytes}")


def reason_of(error: Exception) -> str:
    """Return the system's text for an error in one short line, without the path."""
    if isinstance(error, socket.gaierror):  # its numbers are not those of errno
        text = error.strerror or str(error)
    elif isinstance(error, OSError) and error.errno is not None:
        text = os.strerror(error.errno)
    else:
        text = " ".join(str(error).split())
    return text[:1].lower() + text[1:]


def cannot_open(name: str, error: Exception) -> LinkError:
    """Build the error for a link that cannot be opened."""
    return LinkError(f"cannot open {name}: {reason_of(error)}")


def is_short_of_descriptors(descriptor: int) -> bool:
    """Return whether a new descriptor is one of the last few that the process may have.

    The system returns the lowest free number, so the number shows how many are in use. A client with such a descriptor
    is refused, to leave the last ones to the vehicle's files.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return limit != resource.RLIM_INFINITY and descriptor >= limit - SPARE_DESCRIPTORS


class Readable(Protocol):
    """An object with a descriptor to wait on."""

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""


R = TypeVar("R", bound=Readable)


def wait_readable(links: Iterable[R], timeout_s: float) -> list[R]:
    """Wait until a link is readable, or for ``timeout_s`` seconds, and return the readable ones.

    A link without a descriptor is never returned: poll it. Each call reads the descriptors again, because a link that
    lost its peer may return under the same number. The call uses no descriptor of its own, so it works in a process
    that has none left.
    """
    poller = select.poll()
    waiting: dict[int, R] = {}
    for link in links:
        fd = link.fileno()
        if fd >= 0:
            poller.register(fd, select.POLLIN)
            waiting[fd] = link
    return [waiting[fd] for fd, _ in poller.poll(max(0.0, timeout_s) * 1000.0)]


class Backoff:
    """The time of the next attempt; each failure in a row doubles the wait."""

    def __init__(self, monotonic: Monotonic = time.monotonic, first_s: float = 0.25, max_s: float = 4.0) -> None:
        self._monotonic = monotonic
        self._first_s = first_s
        self._max_s = max_s
        self._wait_s = first_s
        self._due_s = monotonic()

    def due(self) -> bool:
        """Return whether to try now."""
        return self._monotonic() >= self._due_s

    def failed(self) -> None:
        """Wait before the next attempt, twice as long as last time."""
        self._due_s = self._monotonic() + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, self._max_s)

    def succeeded(self) -> None:
        """Forget the failures: after a loss, the next attempt waits only the first interval."""
        self._wait_s = self._first_s

    def lost(self) -> None:
        """Wait the first interval after the loss of a connection."""
        self.succeeded()
        self.failed()
