# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plays a recorded engine: on a link by the wall clock, or into a telemetry log without waiting."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from mav_handlers.links import TlogWriter, wait_readable
from mav_handlers.links.base import Link
from mav_handlers.links.tlog import YEAR_2000_US, YEAR_2100_US
from viso.companion.sender import HEARTBEAT_PERIOD_US
from viso.files.outputs import output_file
from viso.streams.player import Player, Text

LONGEST_WAIT_S: Final = 0.1
"""How long to wait at once, so that a signal is heeded soon."""


class LinkPlay:
    """Plays over a link in step with the wall clock, and listens meanwhile.

    ``on_text`` is called with each text of the vehicle, ``stop`` says whether to end before the end, ``speedup`` is how
    many seconds of the recording pass in one of ``now_s``, a monotonic clock.
    """

    def __init__(
        self,
        link: Link,
        player: Player,
        *,
        on_text: Callable[[Text], None],
        stop: Callable[[], bool],
        speedup: float = 1.0,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._link = link
        self._player = player
        self._on_text = on_text
        self._stop = stop
        self._speedup = speedup
        self._now_s = now_s

    def wait_for_vehicle(self, patience_s: float) -> bool:
        """Send heartbeats until something is heard; say whether it was before patience ended."""
        start_s = next_beat_s = self._now_s()
        while not self._player.heard and not self._stop():
            now_s = self._now_s()
            if now_s - start_s >= patience_s:
                break
            if now_s >= next_beat_s:
                next_beat_s += HEARTBEAT_PERIOD_US * 1e-6
                self._link.send(self._player.heartbeat())
            self._listen(LONGEST_WAIT_S)
        return self._player.heard

    def sent(self) -> dict[str, int]:
        """Return how many messages of each type were sent."""
        return dict(self._player.sent)

    def run(self, until_us: int | None = None) -> None:
        """Play until the trajectory ends, or for so long of its time."""
        start_s = self._now_s()
        while (due_us := self._player.next_due_us()) is not None and not self._stop():
            if until_us is not None and due_us > until_us:
                break
            wait_s = start_s + due_us * 1e-6 / self._speedup - self._now_s()
            if wait_s > 0:
                self._listen(min(wait_s, LONGEST_WAIT_S))
            else:
                for frame in self._player.next_frames():
                    self._link.send(frame.data)
        self._listen(0.0)

    def _listen(self, wait_s: float) -> None:
        wait_readable([self._link], wait_s)
        while data := self._link.receive():
            for text in self._player.receive_bytes(data):
                self._on_text(text)


def write_telemetry_log(path: Path, player: Player, start_ns: int, until_us: int | None) -> None:
    """Write a .tlog of what a player sends, up to ``until_us`` of its time. Raises InputError if that cannot be done.

    The log begins at ``start_ns`` if that is a time of day in this century, else with the century.
    """
    start_us = start_ns // 1000
    epoch_us = start_us if YEAR_2000_US <= start_us < YEAR_2100_US else YEAR_2000_US
    with output_file(path) as file, TlogWriter(path, file) as log:
        while (due_us := player.next_due_us()) is not None and (until_us is None or due_us <= until_us):
            for frame in player.next_frames():
                log.write(epoch_us + frame.due_us, frame.data)
