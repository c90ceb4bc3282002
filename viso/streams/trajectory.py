# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories that an odometry or a motion capture recorded, as a companion computer would send them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from viso.errors import InputError, as_input_errors, within
from viso.geometry.frame_change import FrameChange, parse_axes
from viso.geometry.rotation import Array
from viso.geometry.trajectory import Trajectory
from viso.geometry.trajectory_files import TrajectoryError
from viso.streams.messages import FORMS, Form
from viso.streams.player import Playback, Player, RecordedEngine
from viso.streams.readers import Source, load_trajectory
from viso.streams.stream import LONGEST_SILENCE_US, Stream, StreamMessage

LONGEST_GAP_S = 1.0
"""No pose is interpolated over a longer time."""
MIN_RATE_HZ, MAX_RATE_HZ = 0.1, 1000.0


@dataclass(frozen=True, slots=True)
class TrajectoryOptions:
    """How to take a trajectory; texts are as of ``viso play``.

    Attributes:
        form: what to send, a name of ``FORMS``.
        format_name: of the file, a name of ``FORMATS``; None to find out.
        topic: of a bag; None for the only one with poses.
        times: file with the times of KITTI's poses.
        axes: of the recording: a preset, or WORLD/BODY in letters.
        rate_hz: what to interpolate to, 0.1 to 1000; None for the recording's own.
    """

    form: str = "odometry"
    format_name: str | None = None
    topic: str | None = None
    times: Path | None = None
    axes: str = "enu_flu"
    rate_hz: float | None = None


def read_trajectory(path: Path, lead_us: int, options: TrajectoryOptions) -> Stream:
    """Read a trajectory as the messages that would carry it, with a heartbeat a second.

    Its first pose is sent ``lead_us`` after the vehicle's boot, and stamps are from 0 on. Raises InputError if it
    cannot be read, or an option cannot be used.
    """
    form = form_of(options.form)
    within("--rate", options.rate_hz, MIN_RATE_HZ, MAX_RATE_HZ)
    world, body = axes_of(options.axes)
    source = Source(path, options.topic, options.times)
    recorded = load(source, options.format_name)
    trajectory = FrameChange(world, body, np.eye(3)).apply(recorded)
    if options.rate_hz is not None:
        trajectory = trajectory.resampled(options.rate_hz, LONGEST_GAP_S)
    engine = RecordedEngine(trajectory, Playback(form))
    player = Player(engine)
    messages: list[StreamMessage] = []
    sent_us = 0
    while (due_us := engine.next_due_us()) is not None:
        if due_us - sent_us > LONGEST_SILENCE_US:
            player.skip_heartbeats(due_us)
        frames = player.next_frames()
        messages += [StreamMessage(lead_us + frame.due_us, frame.data) for frame in frames]
        sent_us = frames[0].due_us
    return Stream(path.stem, tuple(messages), notes=tuple(left_out(source, recorded)))


def form_of(name: str) -> Form:
    """Return what to send by the name that ``--as`` takes. Raises InputError if there is none such."""
    if name not in FORMS:
        raise InputError(f"--as {name}: there are {', '.join(FORMS)}")
    return FORMS[name]


def axes_of(text: str) -> tuple[Array, Array]:
    """Return the matrices [3, 3] of world and body that ``--axes`` names. Raises InputError if it names none."""
    try:
        return parse_axes(text)
    except ValueError as error:
        raise InputError(f"--axes: {error}") from error


def load(source: Source, format_name: str | None, *, from_anywhere: bool = False) -> Trajectory:
    """Return what a file holds, as ``load_trajectory`` does. Raises InputError if it cannot be read."""
    with as_input_errors(TrajectoryError):
        return load_trajectory(source, format_name, from_anywhere=from_anywhere)


def left_out(source: Source, trajectory: Trajectory) -> Iterator[str]:
    """Yield what was passed over, a line a reason."""
    for reason, count in trajectory.left_out.items():
        yield f"{source.path}: {count} with {reason}"
