# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every link is: bytes in, bytes out, counters, and no exception once it is open."""

import os
import resource
import select
import socket
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeVar

DROP_CLOSED = "link closed"
DROP_NO_PEER = "no peer"
DROP_BACKLOG_FULL = "backlog full"

SPARE_DESCRIPTORS = 16
"""So many file descriptors are kept from newcomers, for what the vehicle itself opens: its logs, its parameters."""


MOST_REFUSED_TOLD = 16
"""So many who were turned away are told by name, until there is room again."""


class LinkError(Exception):
    """A link that cannot be opened, in one line: which one and why."""


class ConnectionStringError(LinkError):
    """A connection string that names no link."""


def bad_string(name: str, why: str) -> ConnectionStringError:
    """Build the error for a connection string, in one line."""
    return ConnectionStringError(f"bad connection string {name!r}: {why}")


@dataclass
class LinkStats:
    """Hold what a link has carried and lost since it was opened.

    ``bytes_in`` and ``bytes_out`` count what the system gave and took; ``bytes_dropped`` counts what was
    sent and is known to be lost, also when the system reports that afterwards. ``drop_reasons`` counts
    losses (a call to ``send``, a datagram or a whole backlog) by reason; a failed read is counted there
    too, with no bytes. ``connects`` and ``disconnects`` count peers gained and lost, where a link can tell.
    ``open_failures`` counts attempts to get a peer or a device that failed; ``open_failure`` is why the last of a
    client's did.
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
        """Why there has never been a peer; empty if there was one, or no attempt has failed."""
        return "" if self.connects else self.open_failure

    def snapshot(self) -> "LinkStats":
        """Return the present values, which count no further."""
        return replace(self, drop_reasons=self.drop_reasons.copy())


class News:
    """Tells whoever listens, in a few words, who comes and goes on a link, and what fails.

    What fails again and again for one reason is told once; so is each of those who are turned away for want of room,
    and no more than 16 of them, until there was room.
    """

    def __init__(self) -> None:
        self._listener: Callable[[str], None] = lambda _text: None
        self._failure = ""
        self._refused: set[str] = set()

    def tell(self, listener: Callable[[str], None]) -> None:
        """Have somebody told of each from now on, and at once of what fails already."""
        self._listener = listener
        if self._failure:
            listener(self._failure)

    def connected(self, peer: str) -> None:
        """Tell that somebody is there."""
        self._failure = ""
        self._listener(f"{peer} connected")

    def left(self, peer: str, why: str) -> None:
        """Tell that somebody is gone."""
        self._refused.clear()
        self._listener(f"{peer} left: {why}")

    def failed(self, why: str) -> None:
        """Tell that nobody can be reached."""
        text = f"{why}; attempts go on"
        if text != self._failure:
            self._failure = text
            self._listener(text)

    def refused(self, peer: str, why: str) -> None:
        """Tell that somebody was turned away."""
        if peer not in self._refused and len(self._refused) < MOST_REFUSED_TOLD:
            self._refused.add(peer)
            self._listener(f"{peer} refused: {why}")


class Link(Protocol):
    """Carry bytes to and from a peer without ever blocking or raising.

    ``name`` is the connection string as given. ``baud`` is the rate for the model of the UART's transport
    time, None for no delay; whoever owns the link may set it, as the firmware's simulator applies a rate to
    its TCP ports. ``news`` tells who comes and goes.
    """

    name: str
    baud: int | None
    news: News

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return who is at the other end, by address or device, where the link can tell."""

    def admit(self) -> "Link | None":
        """Return a link of its own for one more client of a server that waits; None where nobody does.

        Such a link is over once it has no peer. A server that is never asked serves one client after the other.
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
        """Return the descriptor to wait on for reading, -1 if there is none; it may change in any call."""

    def close(self) -> None:
        """Release everything; after that ``receive`` returns b"" and ``send`` counts a drop."""


class LinkParts:
    """What a link has whatever carries its bytes; one that knows nobody and takes in nobody unless it says so."""

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
        """Return nobody: who is at the other end is not known."""
        return ()

    def admit(self) -> Link | None:
        """Return None: there is one other end."""
        return None


def check_max_bytes(max_bytes: int) -> None:
    """Raise ValueError unless positive: a read of 0 bytes would look like the end of a stream."""
    if max_bytes < 1:
        raise ValueError(f"max_bytes must be positive, not {max_bytes}")


def reason_of(error: Exception) -> str:
    """Return the system's own words for an error, short and in one line, without the path it names."""
    if isinstance(error, socket.gaierror):  # its numbers are not those of errno
        text = error.strerror or str(error)
    elif isinstance(error, OSError) and error.errno is not None:
        text = os.strerror(error.errno)
    else:
        text = " ".join(str(error).split())
    return text[:1].lower() + text[1:]


def cannot_open(name: str, error: Exception) -> LinkError:
    """Build the error for a link that does not open."""
    return LinkError(f"cannot open {name}: {reason_of(error)}")


def is_short_of_descriptors(descriptor: int) -> bool:
    """Return whether a descriptor that the system has just given is one of the last few that the process may have.

    The system gives the lowest that is free, so this one tells how many are in use. A newcomer with such a descriptor
    is turned away; one whose descriptor was refused altogether would have taken the vehicle's last ones.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return limit != resource.RLIM_INFINITY and descriptor >= limit - SPARE_DESCRIPTORS


class Readable(Protocol):
    """What can be waited for."""

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""


R = TypeVar("R", bound=Readable)


def wait_readable(links: Iterable[R], timeout_s: float) -> list[R]:
    """Wait until a link has something to read, or for ``timeout_s`` seconds, and return those that have.

    A link without a descriptor is never returned: poll it. The descriptors are asked for again in each call
    because a link that lost its peer may come back under the same number, which a kept set would miss. It takes no
    descriptor itself, so that a process that has none left goes on.
    """
    poller = select.poll()
    waiting: dict[int, R] = {}
    for link in links:
        fd = link.fileno()
        if fd >= 0:
            poller.register(fd, select.POLLIN)
            waiting[fd] = link
    return [waiting[fd] for fd, _ in poller.poll(max(0.0, timeout_s) * 1000.0)]
