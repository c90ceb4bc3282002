# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A line for each message that reaches the autopilot: what became of it, and why."""

import json
import os
from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Final

from emulator.errors import InputError
from emulator.line_writer import LineWriter
from mav_handlers.endpoint import MessageEvent


class VerdictFormat(StrEnum):
    """How a verdict is written."""

    TEXT = "text"
    JSON = "json"


def text_line(link: str, event: MessageEvent) -> str:
    """Return a verdict for people: time in seconds since boot, link, message and sender, outcome, reason."""
    header, verdict = event.header, event.verdict
    sender = "" if header is None else f" {header.system_id}:{header.component_id} #{header.sequence}"
    time_s = event.now_us / 1e6
    return (
        f"{time_s:9.3f} s  {link}  {event.name}{sender}  {verdict.outcome}: {verdict.rule.text} ({verdict.rule.code})"
    )


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
        "outcome": verdict.outcome.value,
        "rule": verdict.rule.code,
        "reason": verdict.rule.text,
    }
    return json.dumps(fields)


LINES: Final[Mapping[VerdictFormat, Callable[[str, MessageEvent], str]]] = MappingProxyType(
    {VerdictFormat.TEXT: text_line, VerdictFormat.JSON: json_line}
)


class VerdictStream:
    """Writes a line a message, in the order in which the autopilot dealt with them, without ever holding it up.

    Args:
        writer: where lines go.
        kind: how they look.
        name: what the stream is called when something about it is told.
    """

    def __init__(self, writer: LineWriter, kind: VerdictFormat, name: str) -> None:
        self._writer = writer
        self._line = LINES[kind]
        self._name = name

    @property
    def reader_left(self) -> bool:
        """Tell whether nobody can read any further."""
        return self._writer.reader_left

    def take(self, link: str, event: MessageEvent) -> None:
        """Write the verdict on a message that came over a link."""
        self._writer.put(self._line(link, event))

    def close(self) -> None:
        """Write what is waiting, as long as the reader takes it."""
        self._writer.close()

    def failure(self) -> str | None:
        """Return what went wrong, in one line, or None; ask after ``close``.

        A reader that has left is nothing wrong.
        """
        writer = self._writer
        if writer.reader_left or not (writer.lost or writer.error):
            return None
        reason = "they were not read in time" if writer.error is None else writer.error.strerror or str(writer.error)
        return f"{self._name}: {writer.lost} verdicts lost: {reason}"


def create_verdict_file(path: Path) -> int:
    """Open a file anew for verdicts and return its descriptor.

    Raises:
        InputError: it cannot be written.
    """
    try:
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
