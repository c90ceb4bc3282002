# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of visual-inertial odometry: as fast as can be, or in real time with or without a vehicle."""

import dataclasses
import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mav_handlers.links import open_link
from mav_handlers.links.base import LinkStats
from mav_handlers.wire.messages import STATUSTEXT
from viso.companion.run.live import NOW_NS, LiveVio
from viso.companion.run.log import VioLog
from viso.companion.sources.base import Recording, SourceError
from viso.companion.sources.camera import LiveCamera
from viso.companion.vio.config import LocalAlignment, VioConfig
from viso.companion.vio.log import JsonFormatter
from viso.companion.vio.runtime import run_through
from viso.companion.vio.types import NavCameraFrame, SensorEvent
from viso.errors import InputError, as_input_errors
from viso.files.text_files import write_text

Stop = Callable[[], bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class VioSession:
    """A source, and how to run it.

    Attributes:
        until_s: where to end, in seconds since the first frame; None for the source's end.
    """

    source: Recording | LiveCamera
    config: VioConfig
    log: VioLog
    logger: logging.Logger
    stop: Stop
    until_s: float | None = None

    def run_through(self) -> None:
        """Run through a recording as fast as possible; the same data give the same poses.

        Raises InputError if the recording cannot be read on.
        """
        source = self._source()
        assert isinstance(source, Recording)
        listeners = (self.log.take,)
        with as_input_errors(SourceError):
            results = run_through(
                source, self.config, source.start, clock_ns=NOW_NS, logger=self.logger, listeners=listeners
            )
            for _ in results:
                pass

    def run_live(
        self,
        master: str | None,
        *,
        wait_s: float,
        delay_s: float,
        alignment: LocalAlignment | None,
        show: Callable[[str], None],
    ) -> dict[str, Any]:
        """Run in real time; return the messages that were sent and the texts of the vehicle.

        Args:
            master: name of the link to it; None for no vehicle.
            wait_s: how long to wait until it is heard; 0 for not at all.
            delay_s: before the first frame.
            alignment: of the local frame; None for north if the vehicle knows it at the first pose.

        Raises:
            InputError: if the vehicle is not heard, the camera not to be opened, or the recording not to be read on.
        """
        texts: list[STATUSTEXT] = []

        def take(text: STATUSTEXT) -> None:
            texts.append(text)
            show(f"({text.severity}) {printable(text.text)}")

        with ExitStack() as stack:
            link = None if master is None else open_link(master)
            if link is not None:
                stack.callback(link.close)
            stack.enter_context(as_input_errors(SourceError))
            vio = LiveVio(self._source(), self.config, self.log, self.logger, link, alignment=alignment, on_text=take)
            if link is not None and wait_s and not vio.wait_for_vehicle(wait_s, self.stop) and not self.stop():
                vio.close()
                why = f": {link.stats.unreached}" if link.stats.unreached else ""
                reason = f"no vehicle heard within {wait_s:g} s{why} (--wait 0 sends unheard)"
                raise InputError(f"--master {master}: {reason}")
            before = None if link is None else link.stats
            vio.run(self.stop, delay_s=delay_s, until_s=self.until_s)
            if link is not None and before is not None:
                _show_losses(link.name, before, link.stats, show)
        if link is None:
            return {}
        received = [{"severity": text.severity, "text": printable(text.text)} for text in texts]
        return {"sent": vio.sent(), "texts": received}

    def _source(self) -> Recording | LiveCamera:
        """Return the source up to the end time."""
        source = self.source
        if not isinstance(source, Recording):
            return source
        data = source.data
        return dataclasses.replace(source, data=lambda: self._wanted(data()))

    def _wanted(self, events: Iterator[SensorEvent]) -> Iterator[SensorEvent]:
        end_ns: int | None = None
        for event in events:
            if end_ns is None and self.until_s is not None and isinstance(event, NavCameraFrame):
                end_ns = event.capture_timestamp + round(self.until_s * 1e9)
            if self.stop() or (end_ns is not None and event.t_ns > end_ns):
                return
            yield event


@contextmanager
def event_logger(path: Path | None) -> Iterator[logging.Logger]:
    """Yield a logger of its own that writes events to a file, each as a line of JSON; or nowhere.

    Raises InputError if the file cannot be written.
    """
    logger = logging.Logger("viso.companion.run", logging.CRITICAL + 1 if path is None else logging.INFO)
    if path is None:
        yield logger
        return
    with write_text(path, growing=True) as file:
        handler = logging.StreamHandler(file)
        handler.setFormatter(JsonFormatter(NOW_NS))
        handler.handleError = lambda record: None  # type: ignore[method-assign]  # closing the file shows it
        logger.addHandler(handler)
        yield logger


def printable(text: str) -> str:
    """Return a text of the vehicle without control characters."""
    return "".join(character if character.isprintable() else "?" for character in text)


def _show_losses(name: str, before: LinkStats, after: LinkStats, show: Callable[[str], None]) -> None:
    if after.bytes_dropped > before.bytes_dropped:  # a heartbeat may have been ahead of the connection
        reasons = ", ".join(after.drop_reasons)
        lost = after.bytes_dropped - before.bytes_dropped
        show(f"note: {name}: {lost} bytes did not reach the vehicle: {reasons}")
