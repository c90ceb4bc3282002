# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a live topic of ROS 2 to an autopilot on a link: each pose at once, and what a companion says beside it."""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from mav_handlers.links import wait_readable
from mav_handlers.links.base import Link, Readable
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.odometry.inbound import FcInbound
from viso.companion.odometry.sender import OdometrySender
from viso.companion.vio.config import OdometryConfig
from viso.dds.poses import Heard, PoseTopic
from viso.running.playing import LONGEST_WAIT_S
from viso.streams.live import LivePoses
from viso.streams.player import Text, TextPieces

SILENT_NS: Final = 3_000_000_000
GONE_NS: Final = 1_000_000_000
"""A writer that has been silent for so long is given up for another."""
LAST: Final = 10_000
ANOTHER_CLOCK_MS: Final = 10_000.0
DAMAGED: Final = "bytes that cannot be read"
SECOND_WRITER: Final = "another sender, beside the one that is listened to"


class Bridge:
    """Sends the poses of a topic to an autopilot, for as long as it is run.

    One sender is listened to. Where it falls silent and another speaks, as after a restart, the frame may be another:
    the reset counter counts up.

    ``poses`` makes messages of those of the topic. ``on_text`` gets each text of the autopilot, ``on_news`` a line
    about what is waited for, when poses begin to come, and when they do not. ``wall_ns`` is the clock of the
    stamps of poses, since 1970, which may be set meanwhile; ``now_ns`` is a monotonic one.
    """

    def __init__(
        self,
        link: Link,
        topic: PoseTopic,
        poses: LivePoses,
        *,
        on_text: Callable[[Text], None],
        on_news: Callable[[str], None],
        stop: Callable[[], bool],
        wall_ns: Callable[[], int] = time.time_ns,
        now_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._link, self._topic, self._poses = link, topic, poses
        self._wall_ns, self._monotonic_ns = wall_ns, now_ns
        self._epoch_ns = wall_ns() - now_ns()
        self._on_text, self._on_news, self._stop = on_text, on_news, stop
        self._sync, self._pieces = ClockSync(), TextPieces()
        # Odometry is sent as it comes; the sender's own schedule finds none.
        self._sender = OdometrySender(
            link,
            lambda _now_us: None,
            self._sync,
            FcInbound(self._sync, lambda _sample: None),
            OdometryConfig(rate_hz=4.0),
            start_us=self._now_ns() // 1000,
        )
        self._writer: int | None = None
        self._heard_ns = self._quiet_ns = self._now_ns()
        self._news = ""
        self._ages_ns: deque[int] = deque(maxlen=LAST)
        self._delays_ns: deque[int] = deque(maxlen=LAST)
        self.heard = 0

    def _now_ns(self) -> int:
        """Return the time of TIMESYNC: by the clock of the stamps, but for what that is set by meanwhile."""
        return self._monotonic_ns() + self._epoch_ns

    def run(self, until_us: int | None = None) -> None:
        """Run until ``stop`` says so, or for a time."""
        self._on_news(f"{self._topic.name}: waiting for poses")
        start_ns = self._quiet_ns = self._now_ns()
        while not self._stop() and (until_us is None or self._now_ns() - start_ns < until_us * 1000):
            self._topic.find()
            self._serve_link((self._link, self._topic))
            self._take_poses(self._now_ns())

    def wait_for_vehicle(self, patience_s: float) -> bool:
        """Send heartbeats until something is heard of the vehicle; say whether it was before patience ended."""
        end_ns = self._now_ns() + round(patience_s * 1e9)
        while not self._link.stats.bytes_in and not self._stop() and self._now_ns() < end_ns:
            self._serve_link((self._link,))
        return self._link.stats.bytes_in > 0

    def _serve_link(self, waited: Sequence[Readable]) -> None:
        """Send what is due, take in what the autopilot says, and wait a moment for what comes next."""
        now_ns = self._now_ns()
        self._sender.run(now_ns // 1000)
        while self._sender.texts:
            for text in self._pieces.take(self._sender.texts.popleft()):
                self._on_text(text)
        wait_s = min(LONGEST_WAIT_S, self._sender.next_due_us() * 1e-6 - now_ns * 1e-9)
        wait_readable(waited, max(wait_s, 0.0))

    def _take_poses(self, now_ns: int) -> None:
        for heard in self._topic.take(self._wall_ns()):
            self._take(heard, now_ns)
        if now_ns - self._quiet_ns > SILENT_NS:
            self._quiet_ns = now_ns
            self._tell(f"{self._topic.name}: nothing heard for {SILENT_NS * 1e-9:g} s: {self._topic.silence()}")

    def _tell(self, news: str) -> None:
        if news != self._news:
            self._on_news(news)
        self._news = news

    def _take(self, heard: Heard, now_ns: int) -> None:
        if self._writer is not None and heard.writer != self._writer:
            if now_ns - self._heard_ns < GONE_NS:
                self._poses.left_out[SECOND_WRITER] += 1
                return
            self._poses.begin_anew()
        if self._writer != heard.writer or self._news:
            self._tell(f"{self._topic.name}: poses come, {self._topic.kind}")
            self._news = ""
        self._writer, self._heard_ns, self._quiet_ns = heard.writer, now_ns, now_ns
        self.heard += 1
        result = self._poses.take(heard.message)
        if result is None:
            return
        for message in result.messages:
            self._sender.send(message)
        sent_ns = self._wall_ns()
        self._ages_ns.append(sent_ns - result.time_ns)
        self._delays_ns.append(sent_ns - heard.written_ns)

    def sent(self) -> dict[str, int]:
        """Return how many messages of which kind were sent."""
        return {name: count for name, count in dict(self._sender.counters).items() if not name.startswith("received")}

    def summary(self) -> Mapping[str, Any]:
        """Return the outcome of the poses; latencies in ms, of the last 10 000 poses."""
        return {
            "topic": self._topic.name,
            "type": self._topic.kind,
            "heard": self.heard,
            "left_out": dict(self._poses.left_out + Counter({DAMAGED: self._topic.damaged})),
            "resets": self._poses.resets,
            "sent": self.sent(),
            "age_ms": _spread_ms(self._ages_ns),
            "bridge_ms": _spread_ms(self._delays_ns),
            "round_trip_ms": None if self._sync.round_trip_ns is None else self._sync.round_trip_ns * 1e-6,
        }


def _spread_ms(values_ns: deque[int]) -> dict[str, float] | None:
    if not values_ns:
        return None
    least, median, most = np.percentile(np.array(values_ns), (1, 50, 99)).tolist()
    return {"1 %": round(least * 1e-6, 3), "median": round(median * 1e-6, 3), "99 %": round(most * 1e-6, 3)}


def delay_lines(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield the sentences of a summary about time."""
    if summary["round_trip_ms"] is not None:
        yield f"To the autopilot and back, by TIMESYNC: {summary['round_trip_ms']:.1f} ms at best."
    for since, name in (("publishing", "bridge_ms"), ("the stamp", "age_ms")):
        spread = summary[name]
        if spread is None:
            return
        if abs(spread["median"]) > ANOTHER_CLOCK_MS:
            yield f"From {since} to sending: not known, as that is told by another clock than this machine's."
        else:
            yield f"From {since} to sending: {spread['median']:.1f} ms, 99 % within {spread['99 %']:.1f} ms."
    # The autopilot subtracts the jitter above the least lag so far.
    if 0 <= summary["age_ms"]["1 %"] < ANOTHER_CLOCK_MS:
        yield f"VISO_DELAY_MS {summary['age_ms']['1 %']:.0f} fits."
