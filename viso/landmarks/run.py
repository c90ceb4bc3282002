# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A run of ``viso landmarks``: events in; rows, pictures and figures out."""

import csv
import json
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TextIO

from viso.errors import file_errors
from viso.files.outputs import output_file
from viso.landmarks.aircraft import state_vectors_record
from viso.landmarks.fit import PoseErrors, fit_pose_errors
from viso.landmarks.report import CSV_COLUMNS, csv_rows, errors_row, live_line, scene_row, summary_row
from viso.landmarks.residuals import Residuals, Summary, summarise
from viso.landmarks.scene import Scene
from viso.landmarks.session import MOST_PICTURES, PICTURE_PERIOD_S, ReceiverWatch, Session
from viso.landmarks.types import Event

LINE_PERIOD_S: Final = 1.0
_ROUNDING_S: Final = 1e-6

Sink = Callable[[Scene], None]
Draw = Callable[[Scene], bytes]


class Run:
    """Handles events, passes each scene to its sinks, and keeps the data for the final statistics.

    Args:
        session: makes the scenes.
        watch: estimates the receiver's position; None for no estimate.
        sinks: called with each scene.
        records: receiver of state vectors and estimates, a line of JSON each; None for none.

    Attributes:
        last: the newest scene; None before the first.
        estimate: the newest record of the receiver's position; None without any.
    """

    def __init__(
        self, session: Session, watch: ReceiverWatch | None, sinks: tuple[Sink, ...], records: TextIO | None = None
    ) -> None:
        self.session = session
        self._watch = watch
        self._sinks = sinks
        self._records = records
        self._landmarks: deque[Residuals] = deque(maxlen=MOST_PICTURES)
        self._aircraft: deque[Residuals] = deque(maxlen=MOST_PICTURES)
        self.last: Scene | None = None
        self.estimate: Mapping[str, Any] | None = None

    def take(self, event: Event) -> None:
        """Handle an event."""
        estimate = None if self._watch is None else self._watch.take(event)
        if estimate is not None:
            position, self.estimate = estimate
            self.session.take(position)
            self._record(self.estimate)
        for scene in self.session.take(event):
            self._show(scene)

    def finish(self) -> None:
        """End the run: complete the pictures that still wait for a pose."""
        for scene in self.session.finish():
            self._show(scene)

    def summaries(self) -> dict[str, Summary]:
        """Return the statistics of landmarks and aircraft."""
        return {"landmark": summarise(self._landmarks), "aircraft": summarise(self._aircraft)}

    def fit(self) -> PoseErrors:
        """Return the errors that best explain the innovations of the landmarks."""
        session = self.session
        return fit_pose_errors(session.camera, session.poses, session.landmarks, session.pictures)

    def row(self) -> dict[str, Any]:
        """Return the figures for JSON."""
        return {
            "scenes": self.session.scenes,
            **{name: summary_row(summary) for name, summary in self.summaries().items()},
            "fit": errors_row(self.fit()),
            "estimate": self.estimate,
            "dropped": dict(self.session.dropped),
        }

    def _show(self, scene: Scene) -> None:
        self.last = scene
        if scene.has_detections:
            self._landmarks.append(scene.landmark_residuals)
            self._aircraft.append(scene.aircraft_residuals)
        for sink in self._sinks:
            sink(scene)
        situation = scene.situation
        if self._records is not None and situation.origin is not None:
            self._record(state_vectors_record(scene.t_s, situation.origin, situation.odometry, situation.states))

    def _record(self, record: Mapping[str, Any] | None) -> None:
        if self._records is not None and record is not None:
            self._records.write(json.dumps(record) + "\n")


def csv_sink(file: TextIO) -> Sink:
    """Return a sink that writes innovations as CSV; the header is written at once."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    return lambda scene: writer.writerows(csv_rows(scene))


def json_sink(write: Callable[[str], None]) -> Sink:
    """Return a sink that writes innovations, an object for each picture."""

    def show(scene: Scene) -> None:
        row = scene_row(scene)
        if scene.has_detections or row["aircraft"]:
            write(json.dumps(row))

    return show


def line_sink(write: Callable[[str], None]) -> Sink:
    """Return a sink that writes a line per second of the input's time."""
    last_s: list[float] = []

    def show(scene: Scene) -> None:
        if not last_s or not 0 <= scene.t_s - last_s[0] < LINE_PERIOD_S - _ROUNDING_S:
            last_s[:] = [scene.t_s]
            write(live_line(scene))

    return show


class Frames:
    """Writes pictures for a video, at most five per second of the input's time, into a folder that it makes.

    Raises InputError if the folder cannot be made.
    """

    def __init__(self, folder: Path, draw: Draw) -> None:
        self._folder = folder
        self._draw = draw
        self._last_s: float | None = None
        self._count = 0
        with file_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)

    def __call__(self, scene: Scene) -> None:
        """Take a scene. Raises InputError if its picture cannot be written."""
        if self._last_s is not None and 0 <= scene.t_s - self._last_s < PICTURE_PERIOD_S - _ROUNDING_S:
            return
        self._last_s = scene.t_s
        self._count += 1
        with output_file(self._folder / f"frame_{self._count:06d}.png") as file:
            file.write(self._draw(scene))
