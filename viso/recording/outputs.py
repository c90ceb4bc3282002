# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a recording: capture, conversation, parameters, what it is, telemetry log and DataFlash log."""

import dataclasses
import gzip
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from mav_handlers.links import TlogWriter
from mav_handlers.links.tlog import YEAR_2000_US
from mav_handlers.wire.messages import Message
from viso.files.outputs import output_file
from viso.firmware.flown import FlownVersion, profile_for
from viso.firmware.releases import Firmware
from viso.recording.matching import Handled, baud_of, match, out_of, vision_records
from viso.recording.recorder import Recording
from viso.recording.scenario import Start
from viso.streams.heard import version_told
from viso.vehicle.vehicle import Vehicle, VehicleConfig

_IN_CAPTURES: Final = ("VISO_", "EK3_", "AHRS_EKF_", "ARMING_")
"""Parameters that a capture tells, beside those that the scenario set, where they are not viso's defaults."""

FILES: Final[Mapping[str, str]] = {
    ".json": "what it is: scenario, version, parameters that differ, events, complete or why not",
    ".parm": "all parameters before the scenario set any",
    ".jsonl.gz": "the capture: each message with the records that it made, if a log came",
    ".conversation.jsonl": "questions and answers, if the scenario asks",
    ".tlog": "all frames both ways; times begin with the year 2000",
    ".BIN": "the DataFlash log, as far as it came",
}
"""What is written, by what follows the scenario's name."""


def version_of(recording: Recording) -> FlownVersion | None:
    """Return which firmware was recorded, if it sent its version."""
    return None if recording.version is None else version_told(recording.version, recording.vehicle_type)


def version_text(recording: Recording) -> str:
    """Return the firmware as it introduces itself, with its revision."""
    found = version_of(recording)
    if found is None:
        return "unknown"
    return f"{found.text} ({found.source_hash})"


def differing(recording: Recording) -> dict[str, float]:
    """Return the parameters that held in the steps, where they are not those of viso's nearest profile."""
    held = recording.params | recording.set_params
    defaults = _defaults(profile_for(version_of(recording), held).firmware)
    return {name: value for name, value in held.items() if name in defaults and defaults[name] != value}


def _defaults(firmware: Firmware) -> dict[str, float]:
    vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": 1}, firmware=firmware))
    return {param.name: float(param.value) for param in vehicle.params} | {"VISO_TYPE": 0.0}


def params_of_capture(recording: Recording) -> dict[str, float]:
    """Return the parameters that a replay needs."""
    own = {name: value for name, value in differing(recording).items() if name.startswith(_IN_CAPTURES)}
    return {name: _short(value) for name, value in (own | recording.set_params).items()}


def _short(value: float) -> float:
    """Return a float32 as the shortest number that stands for it."""
    return float(f"{value:.7g}")


def write_recording(folder: Path, recording: Recording) -> list[str]:
    """Write all files of a recording, and return their names. Raises InputError if one cannot be written."""
    handled, unmatched = match(recording.sent, vision_records(recording.log) if recording.log else ())
    contents: dict[str, Iterable[str] | bytes] = {
        ".json": [json.dumps(_summary(recording, handled, unmatched), indent=1), "\n"],
        ".parm": _parm(recording),
    }
    if recording.sent:
        contents[".jsonl.gz"] = _lines([_header(recording, handled), *map(_line, handled)])
    if recording.exchanges:
        contents[".conversation.jsonl"] = _lines(_conversation(recording))
    if recording.log:
        contents[".BIN"] = recording.log
    names = []
    for ending, content in contents.items():
        names.append(f"{recording.scenario.name}{ending}")
        data = content if isinstance(content, bytes) else "".join(content).encode("utf-8")
        with output_file(folder / names[-1]) as file:
            file.write(gzip.compress(data, mtime=0) if ending.endswith(".gz") else data)
    if recording.traffic:
        names.append(f"{recording.scenario.name}.tlog")
        path = folder / names[-1]
        with output_file(path) as file, TlogWriter(path, file) as log:
            for now_us, frame in recording.traffic:
                log.write(YEAR_2000_US + now_us, frame)
    return names


def _lines(lines: Iterable[object]) -> list[str]:
    return [f"{json.dumps(line)}\n" for line in lines]


def _header(recording: Recording, handled: list[Handled]) -> dict[str, object]:
    return {
        "name": recording.scenario.name,
        "firmware": version_text(recording),
        "params": params_of_capture(recording),
        "baud": baud_of(handled),
        "complete": not recording.problems,
        "statustext": recording.texts,
        "command_ack": recording.acks,
    }


def _line(handled: Handled) -> dict[str, object]:
    sent = handled.sent
    kind = type(sent.message).__name__
    return {"arrival_us": handled.arrival_us, "type": kind, "msg": sent.frame.hex(), "out": out_of(handled)}


def _conversation(recording: Recording) -> list[dict[str, object]]:
    streams = [one for step in recording.scenario.steps if isinstance(step, Start) for one in step.streams]
    head: dict[str, object] = {
        "name": recording.scenario.name,
        "firmware": version_text(recording),
        "begins_s": (recording.began_us or 0) * 1e-6,
        "camera_hz": next((one.rate_hz for one in streams), 0),
        "params": params_of_capture(recording),
    }
    lines = [head]
    for ask, answers in ((one.ask, one.answers) for one in recording.exchanges):
        line: dict[str, object] = {"name": ask.name, "send": _plain(ask.given), "answers": list(map(_answer, answers))}
        line["wait_ms"] = round(ask.wait_s * 1e3)
        if ask.show:
            line["also show"] = list(ask.show)
        if ask.hide:
            line["hide"] = list(ask.hide)
        lines.append(line)
    return lines


def _answer(message: Message) -> list[object]:
    values: dict[str, object] = {}
    for one in dataclasses.fields(message):
        value = getattr(message, one.name)
        values[one.name] = bytes(value).rstrip(b"\0").hex() if one.name == "payload" else _plain(value)
    return [type(message).__name__, values]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def _parm(recording: Recording) -> list[str]:
    title = f"# {recording.scenario.name}: {version_text(recording)}\n"
    return [title, *(f"{name} {_short(value):.9g}\n" for name, value in recording.params.items())]


def _summary(recording: Recording, handled: list[Handled], unmatched: int) -> dict[str, object]:
    version = recording.version
    fields = () if version is None else dataclasses.fields(version)
    return {
        "name": recording.scenario.name,
        "about": recording.scenario.about,
        "complete": not recording.problems,
        "problems": recording.problems,
        "firmware": version_text(recording),
        "version": {one.name: _plain(getattr(version, one.name)) for one in fields} or None,
        "set": recording.set_params,
        "differ": {name: _short(value) for name, value in differing(recording).items()},
        "messages": len(recording.sent),
        "records": sum(len(one.records) for one in handled),
        "records_of_no_message": unmatched,
        "questions": len(recording.exchanges),
        "events": [{"time_us": time_us, "event": text} for time_us, text in recording.events],
    }
