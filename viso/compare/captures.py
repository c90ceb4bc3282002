# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures: messages are sent to a vehicle again; records, texts and acknowledgements are compared."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import COMMAND_ACK
from viso.compare.comparison import Comparison
from viso.compare.differences import ABSENT, Difference, Row, row_differences, sequence_differences
from viso.compare.tolerances import ABOUT_VISUAL_ODOM, CAPTURE, TEXT_EXCEPTIONS, UNITS, tolerances_of
from viso.documents import parsed_json
from viso.errors import InputError
from viso.files.float_bits import float_of
from viso.files.text_files import read_lines
from viso.firmware.releases import Firmware
from viso.logs.logger import LogSink
from viso.replay.ahrs import ahrs_maker
from viso.replay.run import ReplaySetup, run_replay
from viso.streams.stream_kinds import read_capture
from viso.terminal.ahrs import AhrsChoice

_STRUCTURES: Final = {structure.name: structure for structure in LOG_STRUCTURE_FROM_VISUALODOM}
_MAV_BACKEND: Final = 1

Line = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Capture:
    """The outputs of an autopilot for each message of a stream.

    The header is the first line, with ``params``, ``statustext``, ``command_ack``; the others have ``arrival_us``,
    ``type`` and ``out``.
    """

    header: Mapping[str, Any]
    lines: Sequence[Line]

    @property
    def backend(self) -> int:
        """The value of VISO_TYPE."""
        return int(self.header["params"].get("VISO_TYPE", 0))


@dataclass(frozen=True, slots=True)
class Played:
    """The outputs of the vehicle: lines with ``verdict``; severities and texts; commands and results; notes."""

    lines: Sequence[Line]
    texts: Sequence[tuple[int, str]]
    acks: Sequence[tuple[int, int]]
    notes: Sequence[str] = ()


def read_recorded(path: Path) -> Capture:
    """Read the outputs that a capture holds. Raises InputError that names the file, the line and the field."""
    header: Mapping[str, Any] = {}
    lines: list[Line] = []
    for number, text in read_lines(path):
        try:
            line = parsed_json(text)
            if not header:
                _check_header(line)
                header = line
            else:
                _check_line(line)
                lines.append(line)
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}") from error
    return Capture(header, lines)


def _check_header(line: Any) -> None:
    for field, kinds in (("statustext", (int, str)), ("command_ack", (int, int))):
        pairs = line.get(field, [])
        if not isinstance(pairs, list) or not all(_is_row(pair, kinds) for pair in pairs):
            raise ValueError(f"{field!r} is not a list of pairs of {' and '.join(kind.__name__ for kind in kinds)}")


def _is_row(values: Any, kinds: Sequence[type]) -> bool:
    if not isinstance(values, list) or len(values) != len(kinds):
        return False
    return all(isinstance(value, kind) for value, kind in zip(values, kinds, strict=True))


def _check_line(line: Any) -> None:
    if not isinstance(line, dict) or not isinstance(line.get("type"), str):
        raise ValueError("'type' is not the name of a message")
    records = line.get("out")
    if not isinstance(records, list):
        raise ValueError("'out' is not a list of records")
    for record in records:
        name = record[0] if isinstance(record, list) and record else None
        structure = _STRUCTURES.get(name) if isinstance(name, str) else None
        if structure is None or len(record) != 1 + len(structure.fields):
            raise ValueError(f"'out' has what is no record of {', '.join(_STRUCTURES)}: {str(record)[:60]}")
        for label, char, value in zip(structure.fields, structure.format, record[1:], strict=True):
            if char == "f":
                float_of(value)
            elif type(value) is not int:
                raise ValueError(f"{name}.{label} is not a whole number: {value!r}")


def log_beside(path: Path) -> Path | None:
    """Return the log of the same name beside a capture, or in ``logs`` beside its folder; None if there is none."""
    stem = path.name.removesuffix(".gz").removesuffix(".jsonl")
    folders = (path.parent, path.parent.parent / "logs")
    places = [folder / f"{stem}{ending}" for folder in folders for ending in (".BIN", ".BIN.xz")]
    return next((place for place in places if place.is_file()), None)


def play(
    path: Path,
    firmware: Firmware,
    *,
    open_log: Callable[[], LogSink] | None = None,
    on_progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> Played:
    """Play a capture, with the attitude and position of the log beside it if there is one.

    ``on_progress`` takes the number of messages so far, and of all. Raises InputError if the capture or its log cannot
    be used.
    """
    stream = read_capture(path)
    make_ahrs = ahrs_maker(AhrsChoice(log_beside(path)), log_firmware=firmware)
    lines: list[Line] = []
    sent = Codec(0, 0)
    outcome = run_replay(
        stream,
        stream.params,
        ReplaySetup(make_ahrs, stream.baud, firmware=firmware),
        open_log=open_log,
        on_message=lambda message: lines.append(message.as_dict()),
        on_progress=lambda done: on_progress(done, len(stream.messages)),
        on_sent=sent.feed,
    )
    texts = [(severity, text) for _, severity, text in outcome.texts]
    return Played(lines, texts, list(_acks(sent)), outcome.notes)


def _acks(sent: Codec) -> Iterator[tuple[int, int]]:
    while (received := sent.next_received()) is not None:
        message = received.message if isinstance(received, Received) else None
        if isinstance(message, COMMAND_ACK):
            yield int(message.command), int(message.result)


# Differences


def _rows(line: Line) -> list[Row]:
    rows = [Row("", {key: line.get(key, ABSENT) for key in ("arrival_us", "type")})]
    for name, *values in line["out"]:
        structure = _STRUCTURES[name]
        columns = zip(structure.fields, structure.format, values, strict=True)
        rows.append(Row(name, {label: float_of(value) if char == "f" else value for label, char, value in columns}))
    return rows


def record_differences(recorded: Sequence[Line], ours: Sequence[Line], backend: int) -> Iterator[Difference]:
    """Yield what differs in the records that messages made; ``backend`` is VISO_TYPE, on which tolerances depend."""
    tolerances = tolerances_of(CAPTURE, backend)
    if len(recorded) != len(ours):
        yield Difference("end", "messages", str(len(recorded)), str(len(ours)))
    for number, lines in enumerate(zip(recorded, ours, strict=False), 2):
        theirs, mine = map(_rows, lines)
        yield from row_differences(f"line {number}", theirs, mine, tolerances, units=UNITS)


def text_differences(capture: Capture, texts: Sequence[tuple[int, str]]) -> Iterator[Difference]:
    """Yield what differs between recorded texts about visual odometry and ours, and in the severity of all texts."""
    recorded = [(severity, text) for severity, text in capture.header["statustext"]]
    theirs, ours = ([text for _, text in side if text.startswith(ABOUT_VISUAL_ODOM)] for side in (recorded, texts))
    which = capture.header.get("name"), len(capture.lines)
    for exception in TEXT_EXCEPTIONS:
        known = Counter(exception.recorded) <= Counter(theirs) and Counter(exception.ours) <= Counter(ours)
        if known and theirs != ours and (exception.name, exception.messages) == which:
            theirs, ours = _without(theirs, exception.recorded), _without(ours, exception.ours)
    yield from sequence_differences("texts", "STATUSTEXT.text", theirs, ours)
    severities = {text: severity for severity, text in recorded}
    for severity, text in dict.fromkeys(texts):
        if severity != severities.get(text, severity):
            yield Difference(f"text {text!r}", "STATUSTEXT.severity", str(severities[text]), str(severity))


def _without(texts: Sequence[str], exceptions: Sequence[str]) -> list[str]:
    """Return texts without each exception once, the last of its kind."""
    left = list(reversed(texts))
    for exception in exceptions:
        left.remove(exception)
    return left[::-1]


def ack_differences(recorded: Sequence[Sequence[int]], ours: Sequence[Sequence[int]]) -> Iterator[Difference]:
    """Yield what differs in acknowledgements: command and result, in order."""
    theirs, mine = ([f"command {command} result {result}" for command, result in side] for side in (recorded, ours))
    yield from sequence_differences("acknowledgements", "COMMAND_ACK", theirs, mine)


def all_differences(capture: Capture, played: Played) -> Iterator[Difference]:
    """Yield all that differs; what the capture does not hold is not compared."""
    yield from record_differences(capture.lines, played.lines, capture.backend)
    if "statustext" in capture.header:
        yield from text_differences(capture, played.texts)
    if "command_ack" in capture.header:
        yield from ack_differences(capture.header["command_ack"], played.acks)


def compare_capture(path: Path, firmware: Firmware, on_progress: Callable[[int, int], None]) -> Comparison:
    """Play a capture and compare. Raises InputError if it, or the log beside it, cannot be used."""
    capture = read_recorded(path)
    played = play(path, firmware, on_progress=on_progress)
    records = [record for line in capture.lines for record in line["out"]]
    beside = "statustext", "command_ack"
    texts_and_acks = sum(len(capture.header.get(field, ())) for field in beside)
    notes = [f"no {field!r} in the first line: not compared" for field in beside if field not in capture.header]
    if capture.header.get("complete") is False:
        notes.append("the recording is not complete")
    if capture.backend > _MAV_BACKEND and log_beside(path) is None:
        notes.append(
            "no log beside it: VISO_TYPE 2 and 3 align to the AHRS of a vehicle that stands still, facing north"
        )
    return Comparison(
        path,
        CAPTURE,
        firmware.name,
        len(capture.lines),
        len(records),
        sum(len(record) - 1 for record in records) + texts_and_acks,
        tuple(all_differences(capture, played)),
        (*notes, *played.notes),
    )
