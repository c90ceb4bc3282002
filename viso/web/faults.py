# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults that are switched on and off while the vehicle runs, in what arrives on its links."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from mav_handlers.links.base import Link, LinkStats
from viso.faults import Injector, TimedFrame, Timeline, make_entry
from viso.faults.packet import FrameSplitter

_LONGEST_FRAME: Final = 280  # bytes; with fewer at a time there might be none to return


@dataclass(frozen=True, slots=True)
class Switch:
    """A fault that can be switched on, asked for by its name; ``kind`` and ``fields`` are as in a timeline."""

    name: str
    label: str
    about: str
    kind: str
    fields: Mapping[str, Any] = field(default_factory=dict)

    def injector(self) -> Injector:
        """Return a fresh injector of this fault alone."""
        return Injector(Timeline((make_entry(self.kind, self.fields),)))


SWITCHES: Final = (
    Switch("silence", "No vision", "All messages of external navigation are lost.", "fail"),
    Switch("loss", "Lose half", "Each of them is lost with a probability of 0.5.", "loss", {"probability": 0.5}),
    Switch("frames", "Wrong frames", "ODOMETRY names LOCAL_NED and BODY_NED, which are refused.", "frame_ids"),
    Switch("nan", "NaN position", "x, y and z are not a number.", "nan"),
    Switch("frozen", "Frozen pose", "Position and attitude stay as they are now; stamps go on.", "frozen"),
    Switch("jump", "10 m jump", "Positions are 10 m off in x, and the reset is not counted.", "glit", {"x_m": 10.0}),
    Switch("yaw", "Yaw 30° off", "The attitude is turned by 30° about the vertical.", "yawerr", {"yaw_deg": 30.0}),
    Switch("scale", "Scale 1.5", "Lengths are too great by half, as of a wrong baseline.", "scale", {"factor": 1.5}),
    Switch("quality", "Quality 0", "The quality of ODOMETRY is 0, which means unknown.", "quality", {"values": [0]}),
    Switch("late", "150 ms late", "Messages arrive 150 ms after they were sent.", "delay", {"delay_ms": 150.0}),
    Switch("clock", "Clock +5 s", "The sender's clock is 5 s ahead of what it was.", "clock_step", {"step_ms": 5000.0}),
)
_BY_NAME: Final = {switch.name: switch for switch in SWITCHES}


class FaultyLink:
    """A link that lets faults into what it receives, by a clock that does not go back; all else is the link's own."""

    def __init__(self, link: Link, now_us: Callable[[], int]) -> None:
        self._link = link
        self._now_us = now_us
        self._splitter = FrameSplitter()
        self._faults: dict[str, Injector] = {}
        self._ready = bytearray()
        self._others: list[FaultyLink] = []
        self.name, self.news = link.name, link.news
        self.baud = link.baud

    @property
    def peer_names(self) -> tuple[str, ...]:
        """Return who is at the link's other end."""
        return self._link.peer_names

    def admit(self) -> Link | None:
        """Return a link for one more client of a server, with the faults that are on."""
        link = self._link.admit()
        if link is None:
            return None
        other = FaultyLink(link, self._now_us)
        for name in self._faults:
            other.switch(name, on=True)
        self._others = [*(link for link in self._others if link.peer_names), other]
        return other

    @property
    def stats(self) -> LinkStats:
        """Return a snapshot of the link's counters."""
        return self._link.stats

    def send(self, data: bytes) -> None:
        """Send the bytes as they are."""
        self._link.send(data)

    def fileno(self) -> int:
        """Return the link's descriptor; what is held back becomes due without it."""
        return self._link.fileno()

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    def switch(self, name: str, *, on: bool) -> None:
        """Switch a fault on or off; what it holds back comes out as it goes off."""
        for other in self._others:
            other.switch(name, on=on)
        if on and name not in self._faults:
            self._faults[name] = _BY_NAME[name].injector()
        elif not on and name in self._faults:
            behind = list(self._faults)[list(self._faults).index(name) + 1 :]
            self._pass(self._faults.pop(name).drain(), behind)

    def receive(self, max_bytes: int = 65536) -> bytes:
        """Return bytes that have arrived and are due."""
        if not self._faults and not self._ready and not self._splitter.unread_bytes:
            return self._link.receive(max_bytes)
        now_us = self._now_us()
        room = max(max_bytes, _LONGEST_FRAME) - len(self._ready)
        while room > 0 and (data := self._link.receive(room)):
            room -= len(data)
            self._pass(((now_us, piece) for piece in self._splitter.feed(data)), list(self._faults))
        self._pass((), list(self._faults))
        taken = bytes(self._ready[:max_bytes])
        del self._ready[:max_bytes]
        return taken

    def _pass(self, frames: Iterable[TimedFrame], names: Iterable[str]) -> None:
        now_us = self._now_us()
        for name in names:
            fault = self._faults[name]
            for _, frame in frames:
                fault.push(now_us, frame)
            frames = fault.pop_due(now_us)
        for _, frame in frames:
            self._ready += frame


class FaultSwitches:
    """The switches of a vehicle, for all of its links at once."""

    def __init__(self, links: Iterable[FaultyLink]) -> None:
        self._links = tuple(links)
        self._on: set[str] = set()

    @property
    def on(self) -> tuple[str, ...]:
        """The names of those that are on, in the order of the table."""
        return tuple(switch.name for switch in SWITCHES if switch.name in self._on)

    def set(self, name: str, *, on: bool) -> bool:
        """Switch a fault on or off; say whether there is such a one."""
        if name not in _BY_NAME:
            return False
        (self._on.add if on else self._on.discard)(name)
        for link in self._links:
            link.switch(name, on=on)
        return True
