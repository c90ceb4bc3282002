# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded trajectories for commands: what is wrong with a file or an option is told in one line."""

from collections.abc import Iterator

from viso.companion.recorded.frame_change import parse_axes
from viso.companion.recorded.messages import FORMS, Form
from viso.companion.recorded.readers import Source, load_records, load_trajectory
from viso.companion.recorded.recorded_trajectory import RecordedTrajectory
from viso.companion.recorded.records import Records, TrajectoryError
from viso.companion.vio.se3 import Array
from viso.errors import InputError, told_errors


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


def load(source: Source, format_name: str | None, *, from_anywhere: bool = False) -> RecordedTrajectory:
    """Return what a file holds, as ``load_trajectory`` does. Raises InputError if it cannot be read."""
    with told_errors(TrajectoryError):
        return load_trajectory(source, format_name, from_anywhere=from_anywhere)


def load_as_it_is(source: Source, format_name: str | None) -> Records:
    """Return what a file holds, usable or not. Raises InputError if it cannot be read."""
    with told_errors(TrajectoryError):
        return load_records(source, format_name)


def left_out(source: Source, trajectory: RecordedTrajectory) -> Iterator[str]:
    """Yield what was passed over, a line a reason."""
    for reason, count in trajectory.left_out.items():
        yield f"{source.path}: {count} with {reason}"
