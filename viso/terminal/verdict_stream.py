# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A line for each message that reaches the autopilot: its outcome, and why; and of its samples in the filter.

Lines for people leave out repetitions: a sample that is used, refused, or whose source is not in use has a line only if
the outcome of the sample of its kind before it was another. A thread of its own writes the lines, so that a slow reader
never delays the vehicle.
"""

import contextlib
import json
import os
import select
import sys
import threading
from collections import deque
from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Final

from ekf_stub.inputs.ingest_rules import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from viso.files.outputs import growing_file
from viso.vehicle.outcomes import OutcomeKind, as_dict, is_final, is_model, outcome_kind, sentence

LINES_WAITING: Final = 20_000
PATIENCE_S: Final = 2.0


class LineWriter:
    """Writes lines to a descriptor, which stays open; a line that finds too many waiting is lost, and counted.

    The count is complete after ``close``. An ``error`` has ended the writing, and everything after it is lost.
    """

    def __init__(self, descriptor: int, *, limit: int = LINES_WAITING) -> None:
        self._descriptor = descriptor
        self._limit = limit
        self._waiting: deque[bytes] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self.lost = 0
        self.error: OSError | None = None
        # What blocks for good ends with the process.
        self._thread = threading.Thread(target=self._run, name="lines", daemon=True)
        self._thread.start()

    @property
    def reader_left(self) -> bool:
        """Return whether the other end of a pipe has been closed."""
        return isinstance(self.error, BrokenPipeError)

    def put(self, line: str) -> None:
        """Queue a line; a line feed is added."""
        with self._changed:
            if self.error is not None or self._closing or len(self._waiting) >= self._limit:
                self.lost += 1
                return
            self._waiting.append(f"{line}\n".encode())
            self._changed.notify()

    def close(self, patience_s: float = PATIENCE_S) -> None:
        """Write what is waiting; what a reader has not taken after some seconds is lost."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(patience_s)
        with self._changed:
            self.lost += len(self._waiting)
            self._waiting.clear()

    def _run(self) -> None:
        while (line := self._next()) is not None:
            try:
                self._write(line)
            except OSError as error:
                self._give_up(error)
                return
            with self._changed, contextlib.suppress(IndexError):  # a closing that lost patience has counted it
                self._waiting.popleft()

    def _next(self) -> bytes | None:
        """Return the oldest line, which goes on waiting until it is written; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._closing)
            return self._waiting[0] if self._waiting else None

    def _write(self, line: bytes) -> None:
        rest = memoryview(line)
        while rest:
            try:
                rest = rest[os.write(self._descriptor, rest) :]
            except BlockingIOError:  # whoever shares the descriptor may have made it so
                select.select([], [self._descriptor], [])

    def _give_up(self, error: OSError) -> None:
        with self._changed:
            self.error = error
            self.lost += len(self._waiting)
            self._waiting.clear()


class VerdictFormat(StrEnum):
    """How a verdict is written."""

    TEXT = "text"
    JSON = "json"


def text_line(link: str, event: MessageEvent) -> str:
    """Return a verdict for people: time in seconds since boot, link, message and sender, outcome, reason."""
    header, verdict = event.header, event.verdict
    sender = "" if header is None else f" {header.system_id}:{header.component_id} #{header.sequence}"
    time_s = event.now_us / 1e6
    return f"{time_s:9.3f} s  {link}  {event.name}{sender}  {verdict.kind}: {verdict.rule.text} ({verdict.rule.code})"


def json_line(link: str, event: MessageEvent) -> str:
    """Return a verdict for machines; bytes that are no frame have neither sender nor sequence number."""
    header, verdict = event.header, event.verdict
    fields = {
        "time_us": event.now_us,
        "link": link,
        "type": event.name,
        "sysid": None if header is None else header.system_id,
        "compid": None if header is None else header.component_id,
        "seq": None if header is None else header.sequence,
        "outcome": verdict.kind.value,
        "rule": verdict.rule.code,
        "reason": verdict.rule.text,
        "model": False,
    }
    return json.dumps(fields)


def filter_text_line(now_us: int, outcome: FilterOutcome) -> str:
    """Return the outcome of a sample in the filter, for people."""
    code = outcome.rule.code + ("; a model's" if is_model(outcome.rule) else "")
    observed_s = outcome.time_ms / 1e3
    return f"{now_us / 1e6:9.3f} s  filter  {outcome.kind} at {observed_s:.3f} s  {sentence(outcome)} ({code})"


def filter_json_line(now_us: int, outcome: FilterOutcome) -> str:
    """Return the outcome of a sample in the filter, for machines; it belongs to no link."""
    return json.dumps({"time_us": now_us, "link": None, "type": "FILTER", **as_dict(outcome)})


_MAY_GO_ON: Final = (OutcomeKind.FUSED, OutcomeKind.UNUSED, OutcomeKind.REFUSED)


class VerdictStream:
    """Writes a line a message and a line a sample, in their order, and never delays the vehicle.

    ``name`` is the name of the stream in errors.
    """

    def __init__(self, writer: LineWriter, kind: VerdictFormat, name: str) -> None:
        self._writer = writer
        self._is_json = kind is VerdictFormat.JSON
        self._last_rules: dict[str, str] = {}
        self._name = name

    @property
    def reader_left(self) -> bool:
        """Return whether nobody can read any further."""
        return self._writer.reader_left

    def take(self, link: str, event: MessageEvent) -> None:
        """Write the verdict on a message that came over a link."""
        line = json_line if self._is_json else text_line
        self._writer.put(line(link, event))

    def take_outcome(self, now_us: int, outcome: FilterOutcome) -> None:
        """Write the outcome of a sample in the filter, if it is final; ``now_us`` is since boot."""
        rule = outcome.rule
        if not is_final(rule):
            return
        goes_on = outcome_kind(rule) in _MAY_GO_ON and self._last_rules.get(outcome.kind) == rule.code
        self._last_rules[outcome.kind] = rule.code
        if self._is_json:
            self._writer.put(filter_json_line(now_us, outcome))
        elif not goes_on:
            self._writer.put(filter_text_line(now_us, outcome))

    def close(self) -> None:
        """Write what is waiting, as long as the reader takes it."""
        self._writer.close()

    def failure(self) -> str | None:
        """Return what failed, in one line, or None; called after ``close``.

        A reader that has left is no failure.
        """
        writer = self._writer
        if writer.reader_left or not (writer.lost or writer.error):
            return None
        reason = "they were not read in time" if writer.error is None else writer.error.strerror or str(writer.error)
        return f"{self._name}: {writer.lost} verdicts lost: {reason}"


def open_streams(kind: VerdictFormat | None, file: Path | None, stack: ExitStack) -> list[VerdictStream]:
    """Return the streams that are asked for, which ``stack`` closes: on standard output, and as JSON to a file."""
    wanted = []
    if kind is not None:
        wanted.append((sys.stdout.fileno(), kind, "--verdicts"))
    if file is not None:
        descriptor = stack.enter_context(growing_file(file)).fileno()
        wanted.append((descriptor, VerdictFormat.JSON, str(file)))
    streams = [VerdictStream(LineWriter(descriptor), how, name) for descriptor, how, name in wanted]
    for stream in streams:
        stack.callback(stream.close)
    return streams
