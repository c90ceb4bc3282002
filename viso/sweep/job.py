# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Works out one point of a sweep: in a process of this machine, or anywhere in a cluster."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import yaml

from ekf_stub.ahrs.ahrs_base import AhrsBase
from viso.documents import parsed_yaml
from viso.errors import InputError, as_input_errors
from viso.extras import installed_version
from viso.faults import Timeline, TimelineError, inject, parse_timeline
from viso.files.first_bytes import Content, content_of
from viso.firmware.releases import PROFILES
from viso.geometry.trajectory import Trajectory
from viso.logs.recorded import read_recorded_states
from viso.replay.ahrs import ahrs_maker
from viso.replay.figures import Judge, Row
from viso.replay.run import ReplaySetup, run_replay
from viso.streams.readers import Source
from viso.streams.stream import timed_frames
from viso.streams.stream_kinds import (
    TRAJECTORY,
    Stream,
    StreamMessage,
    TrajectoryOptions,
    kind_of,
    read_stream,
)
from viso.streams.trajectory import load
from viso.sweep.dimensions import fault_field
from viso.sweep.plan import Faults, InputFile, Point, Recorded, SweepPlan, input_file
from viso.terminal.ahrs import AhrsChoice, imu_options
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.inertial_sources import read_source
from viso.vehicle.vehicle import Vehicle

_KEPT: Final = 4
"""How many files of a kind a process remembers."""


@dataclass(frozen=True, slots=True)
class Result:
    """Outcome of a point: its figures, or why there are none."""

    number: int
    row: Row | None
    error: str = ""


def run_point(plan: SweepPlan, point: Point) -> Result:
    """Replay a point and return its figures; an error is a part of the result, and not raised."""
    try:
        return Result(point.number, _row_of(plan, point))
    except InputError as error:
        return Result(point.number, None, str(error))
    except Exception as error:  # one point that meets a bug is no reason to lose the others
        return Result(point.number, None, " ".join(f"{type(error).__name__}: {error}".split()))


def _row_of(plan: SweepPlan, point: Point) -> Row:
    if plan.code != installed_version():
        raise InputError(f"a worker has viso {installed_version()}, the sweep was defined with {plan.code}")
    recorded, firmware = plan.recordings[point.recording], PROFILES[point.firmware]
    values = {axis.name: value for axis, value in zip(plan.axes, point.values, strict=True)}
    for file in (recorded.file, *recorded.others):
        check_file(file)
    path, lead_us = Path(recorded.file.path), round(plan.lead_s * 1e6)
    whole = _read_stream(path, lead_us, plan.trajectory)
    stream = _until(_faulty(whole, plan.faults[point.faults], values, point.seed), plan.until_s)
    chosen = {name: value for name, value in values.items() if fault_field(name) is None}
    baud = (stream.baud if plan.baud is None else plan.baud) or None
    make_ahrs = _ahrs(plan, recorded, point.seed)
    truth = None
    if recorded.reference is not None:
        truth = read_reference(Path(recorded.reference), path, lead_us, plan.trajectory)
    judge = Judge(truth)
    outcome = run_replay(
        stream,
        {**stream.params, **plan.settings[point.firmware], **chosen},
        ReplaySetup(make_ahrs, baud, recorded.ahrs is None, firmware),
        on_message=judge.take_message,
        on_start=judge.start,
    )
    return judge.row(outcome)


# What files hold, read once a process and checked to be what the sweep was defined with

_read_stream = lru_cache(_KEPT)(read_stream)
_read_source = lru_cache(_KEPT)(read_source)


@lru_cache(_KEPT * 4)
def check_file(file: InputFile) -> None:
    """Raise InputError unless a file is there and is the one that was meant; looked at once a process."""
    if input_file(Path(file.path)).sha256 != file.sha256:
        raise InputError(f"{file.path}: not the file that the sweep was begun with")


def _ahrs(plan: SweepPlan, recorded: Recorded, seed: int | None) -> Callable[[Vehicle], AhrsBase]:
    if recorded.ahrs is not None:
        return _following(recorded.ahrs)
    choice = AhrsChoice(None, recorded.imu, list(plan.imu_errors), seed or 0, plan.heading_deg)
    return by_ekf3(_read_source(recorded.imu), imu_options(choice), buffer_ms=math.ceil(plan.buffer_ms))


@lru_cache(_KEPT)
def _following(log: str) -> Callable[[Vehicle], AhrsBase]:
    return ahrs_maker(AhrsChoice(Path(log)))


@lru_cache(_KEPT)
def read_reference(path: Path, stream: Path, lead_us: int, options: TrajectoryOptions) -> Trajectory:
    """Return the positions of a reference, on the clock of the vehicle that a stream is replayed into.

    A DataFlash log gives the positions that its own filter estimated (XKF1). A trajectory is taken to be in seconds
    since boot, or on the clock of the stream if that is a trajectory as well; ``lead_us`` is then from boot to its
    first message. Raises InputError if one cannot be read, or the reference has no positions.
    """
    if content_of(path) is Content.DATAFLASH_LOG:
        states = read_recorded_states(path)
        times_ns = np.round(np.asarray(states.pos_time_us) * 1000).astype(np.int64)
        kept = np.diff(times_ns, prepend=-1) > 0
        times_ns, places = times_ns[kept], np.asarray(states.pos_ned)[kept]
    else:
        truth = load(Source(path), None)
        times_ns, places = truth.times_ns, truth.positions
        if kind_of(stream, options) == TRAJECTORY:
            source = Source(stream, options.topic, options.times)
            times_ns = times_ns - load(source, options.format_name).times_ns[0] + lead_us * 1000
    if len(times_ns) < 2:
        raise InputError(f"{path}: a reference without positions")
    return Trajectory(times_ns, np.asarray(places, np.float64), np.tile((1.0, 0.0, 0.0, 0.0), (len(times_ns), 1)))


# Streams


def _until(stream: Stream, end_s: float) -> Stream:
    kept = tuple(
        message for message in stream.messages if message.arrival_us is None or message.arrival_us <= end_s * 1e6
    )
    return stream if len(kept) == len(stream.messages) else replace(stream, messages=kept)


def _faulty(stream: Stream, faults: Faults, values: Mapping[str, float], seed: int | None) -> Stream:
    if not faults.text:
        return stream
    timeline = timeline_of(faults, values)
    spoiled = tuple(StreamMessage(due_us, frame) for due_us, frame in inject(timed_frames(stream), timeline, seed))
    return replace(stream, messages=spoiled)


def timeline_of(faults: Faults, values: Mapping[str, float]) -> Timeline:
    """Return a timeline with the fields that axes change. Raises InputError that names timeline, entry and field."""
    document = parsed_yaml(faults.text)
    for name, value in values.items():
        place = fault_field(name)
        if place is not None:
            entry, key = place
            if entry > len(document["faults"]):
                raise InputError(f"{faults.name}: {name}: there are {len(document['faults'])} entries")
            document["faults"][entry - 1][key] = int(value) if value.is_integer() else value
    with as_input_errors(TimelineError):
        return parse_timeline(yaml.safe_dump(document, sort_keys=False), faults.name)
