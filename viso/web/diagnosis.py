# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The doctor on the last minute of what came: in a process of its own, for it takes seconds of a processor."""

import asyncio
import json
import sys
from collections import deque
from collections.abc import Mapping
from typing import Any, Final

from mav_handlers.endpoint import MessageEvent

KEPT_US: Final = 60_000_000
FRAMES_KEPT: Final = 30_000
NAME: Final = "the last minute"


class RecentFrames:
    """The frames of the last minute, with the times at which they were dealt with."""

    def __init__(self) -> None:
        self._frames: deque[tuple[int, bytes]] = deque(maxlen=FRAMES_KEPT)

    def take(self, event: MessageEvent) -> None:
        """Keep a message."""
        if event.header is None:
            return
        self._frames.append((event.now_us, event.header.frame))
        while event.now_us - self._frames[0][0] > KEPT_US:
            self._frames.popleft()

    def restart(self) -> None:
        """Restart, as time does."""
        self._frames.clear()

    def as_lists(self) -> list[tuple[int, str]]:
        """Return times in us since boot, and frames in hex."""
        return [(time_us, frame.hex()) for time_us, frame in self._frames]


async def examine(material: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return what the doctor finds, as ``report_on`` does; None if it fails.

    Args:
        material: ``firmware`` by its name, ``params`` by theirs, and ``frames`` as ``RecentFrames.as_lists`` has them.
    """
    child = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", f"from {__name__} import main; main()"),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for the autopilot alone
    )
    try:
        output, _ = await child.communicate(json.dumps(material).encode())
    finally:
        if child.returncode is None:
            child.kill()
    found: dict[str, Any] | None = json.loads(output) if child.returncode == 0 else None
    return found


def report_on(material: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the doctor finds: ``count`` in words, ``json`` as ``viso doctor --json`` has it, and ``text``."""
    # The doctor is imported where it is wanted: the page alone opens without it.
    from viso.doctor import all_checks, diagnose, gather
    from viso.doctor.output.machine_formats import as_json
    from viso.doctor.output.summary import summarise
    from viso.doctor.output.terminal import count_text, finding_lines, summary_lines
    from viso.firmware.releases import PROFILES
    from viso.streams.stream_kinds import Stream, StreamMessage

    messages = tuple(StreamMessage(time_us, bytes.fromhex(frame)) for time_us, frame in material["frames"])
    firmware = PROFILES[material["firmware"]]
    evidence = gather(Stream(NAME, messages, material["params"]), firmware=firmware)
    findings, summary = diagnose(evidence, all_checks()), summarise(evidence)
    lines = [line.plain for finding in findings for line in finding_lines(finding, None)]
    count = count_text(findings)
    text = "\n".join([*lines, str(evidence.set_up.judged_by), *summary_lines(summary), f"{NAME}: {count}", ""])
    text_of_report = json.dumps(as_json(evidence, summary, findings))
    return {"count": count, "text": text, "json": json.loads(text_of_report, parse_constant=lambda _: None)}


def main() -> None:
    """Read what is to be examined, and write what was found, as JSON."""
    json.dump(report_on(json.load(sys.stdin)), sys.stdout)
