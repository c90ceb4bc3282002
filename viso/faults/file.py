# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded streams in and out of the injector."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from mav_handlers.links import TlogError, TlogWriter, read_tlog
from mav_handlers.links.tlog import STX_V1, STX_V2, YEAR_2000_US
from viso.errors import InputError, as_input_errors
from viso.faults import TimedFrame
from viso.files.outputs import output_file
from viso.files.text_files import write_text
from viso.streams.stream import timed_frames
from viso.streams.stream_kinds import Stream, read_stream

TLOG: Final = (".tlog", ".tlog.gz")
CAPTURE: Final = (".jsonl", ".jsonl.gz")
_MARKERS: Final = (bytes([STX_V1]), bytes([STX_V2]))


@dataclass(frozen=True, slots=True)
class Recording:
    """A recorded stream, with times in us as the file has them, and what it holds beside frames.

    ``stream`` is what else is known of it; None of a telemetry log.
    """

    frames: tuple[TimedFrame, ...]
    stream: Stream | None = None
    notes: tuple[str, ...] = ()


def read_recording(path: Path) -> Recording:
    """Read a telemetry log, or any other stream that can be replayed. Raises InputError if it cannot be read."""
    if not path.name.lower().endswith(TLOG):
        stream = read_stream(path, 0)
        return Recording(tuple(timed_frames(stream)), stream, stream.notes)
    with as_input_errors(TlogError):
        reader = read_tlog(path)
        frames = tuple((entry.time_us, entry.data) for entry in reader)
    notes = []
    if reader.skipped_bytes:
        notes.append(f"{path}: {reader.skipped_bytes} damaged bytes passed over")
    if reader.truncated:
        notes.append(f"{path}: the last entry is cut short, {reader.truncated_bytes} bytes")
    return Recording(frames, notes=tuple(notes))


def check_output(path: Path, source: Path) -> None:
    """Check that a stream can be written to a file of this name. Raises InputError naming the file."""
    name = path.name.lower()
    if not name.endswith((*TLOG, *CAPTURE)):
        raise InputError(f"{path}: neither a telemetry log (.tlog) nor a capture (.jsonl, .jsonl.gz)")
    if name.endswith(CAPTURE) and source.name.lower().endswith(TLOG):
        raise InputError(f"{path}: a telemetry log has no parameters, which a capture needs; write a .tlog")


def write_recording(path: Path, frames: Iterable[TimedFrame], recording: Recording) -> int:
    """Write a stream in the form that the file's name tells; return how many pieces a .tlog cannot hold.

    Raises InputError if it cannot be written.
    """
    stream = recording.stream
    if stream is None or not path.name.lower().endswith(CAPTURE):
        return _write_tlog(path, frames, 0 if stream is None else YEAR_2000_US)
    with write_text(path) as file:
        file.write(json.dumps({"name": stream.name, "params": dict(stream.params)}) + "\n")
        for time_us, frame in frames:
            file.write(json.dumps({"arrival_us": time_us, "msg": frame.hex()}) + "\n")
    return 0


def _write_tlog(path: Path, frames: Iterable[TimedFrame], epoch_us: int) -> int:
    left_out = 0
    with output_file(path) as file, TlogWriter(path, file) as log:
        for time_us, frame in frames:
            if frame[:1] in _MARKERS:
                log.write(epoch_us + time_us, frame)
            else:
                left_out += 1
    return left_out
