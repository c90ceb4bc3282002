# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A line for each message that reaches the autopilot: its outcome, and why; and of its samples in the filter.

Lines for people leave out what goes on as before: a sample that is used, whose source is not in use, or that is not let
in is told only if something else became of the one of its kind before it.
"""

import json
from enum import StrEnum
from typing import Final

from ekf_stub.inputs.ingest_rules import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from viso.terminal.line_writer import LineWriter
from viso.vehicle.outcomes.labels import Fate, as_dict, fate_of, is_final, is_model, sentence


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


_MAY_GO_ON: Final = (Fate.FUSED, Fate.UNUSED, Fate.REFUSED)


class VerdictStream:
    """Writes a line a message and a line a sample, in the order of what happened, without ever holding up the vehicle.

    ``name`` is what the stream is called when something about it is told.
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
        """Write the outcome of a sample in the filter, once that is settled; ``now_us`` is since boot."""
        rule = outcome.rule
        if not is_final(rule):
            return
        goes_on = fate_of(rule) in _MAY_GO_ON and self._last_rules.get(outcome.kind) == rule.code
        self._last_rules[outcome.kind] = rule.code
        if self._is_json:
            self._writer.put(filter_json_line(now_us, outcome))
        elif not goes_on:
            self._writer.put(filter_text_line(now_us, outcome))

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
