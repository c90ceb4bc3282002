# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded scenarios of the library through the batch port: samples as columns, everything else as events between."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ap_core.quaternion import Quaternion
from ap_visualodom.ap_visualodom import AP_VisualOdom
from ap_visualodom.batch import BatchVisualOdom, Event
from ap_visualodom.batch_samples import (
    CONSUMED_NUMBER,
    VERDICT_NUMBER,
    PoseResults,
    Poses,
    Velocities,
    VelocityResults,
)
from ap_visualodom.release import REFERENCE, VisualOdomRelease
from ap_visualodom.verdicts import DISABLED, NO_BACKEND
from viso.files.float_bits import bits_of, float_of, quaternion_of, vector_of
from viso.replay.vectors import Scenario

SAMPLES = {"pose", "pose_euler", "speed"}
DROPPED = {VERDICT_NUMBER[DISABLED], VERDICT_NUMBER[NO_BACKEND]}
Step = Sequence[Any]


@dataclass
class Script:
    """Steps of a scenario, sorted into samples and events."""

    poses: list[tuple[Any, ...]] = field(default_factory=list)
    velocities: list[tuple[Any, ...]] = field(default_factory=list)
    events: list[tuple[int, Step]] = field(default_factory=list)

    @property
    def places(self) -> int:
        return len(self.poses) + len(self.velocities)

    def add(self, step: Step, time_us: int) -> None:
        op, *args = step
        if op == "speed":
            remote_us, time_ms, vel, resets, quality = args
            row = (self.places, time_us, remote_us, time_ms, vector_of(vel).to_tuple(), resets, quality)
            self.velocities.append(row)
            return
        remote_us, time_ms, pos, attitude, pos_err, ang_err, resets, quality = args
        quat = quaternion_of(attitude) if op == "pose" else Quaternion.from_euler(*vector_of(attitude).to_tuple())
        self.poses.append(
            (
                *(self.places, time_us, remote_us, time_ms, vector_of(pos).to_tuple(), quat.to_wxyz()),
                *(float_of(pos_err), float_of(ang_err), resets, quality),
            )
        )

    def tables(self) -> tuple[Poses, Velocities]:
        return poses_of(self.poses), velocities_of(self.velocities)


def _common(columns: Sequence[Any]) -> tuple[Any, Any, Any, Any]:
    place, time_us, remote_us, time_ms = columns
    stamps = np.array(time_us, np.uint64), np.array(remote_us, np.uint64)
    return np.array(place, np.int64), *stamps, np.array(time_ms, np.uint32)


def _floats(column: Any, rows: int) -> Any:
    return np.array(column, np.float32).reshape(-1, rows).T.copy()


def poses_of(rows: Sequence[tuple[Any, ...]]) -> Poses:
    """Return a table of rows of place, time_us, remote_us, time_ms, xyz, wxyz, two errors, counter and quality."""
    columns: list[Any] = list(zip(*rows, strict=True)) if rows else [()] * 10
    pos, quat = _floats(columns[4], 3), _floats(columns[5], 4)
    errors = np.array(columns[6], np.float32), np.array(columns[7], np.float32)
    return Poses(
        *_common(columns[:4]), pos, quat, *errors, np.array(columns[8], np.uint8), np.array(columns[9], np.int8)
    )


def velocities_of(rows: Sequence[tuple[Any, ...]]) -> Velocities:
    """Return a table of rows of place, time_us, remote_us, time_ms, xyz, counter and quality."""
    columns: list[Any] = list(zip(*rows, strict=True)) if rows else [()] * 7
    counter, quality = np.array(columns[5], np.uint8), np.array(columns[6], np.int8)
    return Velocities(*_common(columns[:4]), _floats(columns[4], 3), counter, quality)


class BatchScenario(Scenario):
    """A vehicle whose library takes samples in columns."""

    def __init__(self, params: dict[str, object], release: VisualOdomRelease = REFERENCE) -> None:
        super().__init__(params, release)
        self.batch = BatchVisualOdom(
            self._params,
            ahrs=self._ahrs,
            gcs=self,
            logger=self,
            clock=self._clock,
            errors=self._error,
            release=release,
        )
        self._visual_odom: AP_VisualOdom = self.batch.visual_odom
        self._visual_odom.init()

    def run_all(self, steps: Sequence[Step]) -> tuple[list[list[Any]], list[Any]]:
        """Do all steps; return what came of each sample, and all else that was said or written, in order."""
        script, time_us = Script(), 0
        for step in steps:
            if step[0] in SAMPLES:
                script.add(step, time_us)
                continue
            time_us = step[1] if step[0] == "time_us" else time_us
            script.events.append((script.places, (time_us, step)))
        self._out = []
        poses, velocities = script.tables()
        made = self.batch.handle(poses, velocities, [self._event(place, *what) for place, what in script.events])
        return list(outputs_of(poses, velocities, *made)), self._out

    def _event(self, place: int, time_us: int, step: Step) -> Event:
        def happen() -> None:
            self._clock.set_us(time_us)
            said, self._out = self._out, []
            self._out = [*said, *self.run(step)]

        return place, happen


def _bits(values: Any) -> list[str]:
    return [bits_of(value) for value in values]


def outputs_of(
    poses: Poses, velocities: Velocities, made: PoseResults, made_velocities: VelocityResults
) -> Iterator[list[Any]]:
    """Yield what each sample caused as recordings have it, in the common sequence."""
    outputs: dict[int, list[Any]] = {}
    for row, (place, record) in enumerate(zip(poses.place.tolist(), made.visp(poses), strict=True)):
        outputs[place] = _logged("VISP", record, made.verdict[row])
        if made.verdict[row] == CONSUMED_NUMBER:
            errors = bits_of(made.pos_err[row]), bits_of(made.ang_err[row])
            times = int(poses.time_ms[row]), int(made.delay_ms[row]), int(made.reset_ms[row])
            outputs[place].insert(0, ["extnav", _bits(made.pos[:, row]), _bits(made.quat[:, row]), *errors, *times])
    for row, (place, record) in enumerate(
        zip(velocities.place.tolist(), made_velocities.visv(velocities), strict=True)
    ):
        outputs[place] = _logged("VISV", record, made_velocities.verdict[row])
        if made_velocities.verdict[row] == CONSUMED_NUMBER:
            vel, err = _bits(made_velocities.vel[:, row]), bits_of(made_velocities.err[row])
            time_ms, delay_ms = int(velocities.time_ms[row]), int(made_velocities.delay_ms[row])
            outputs[place].insert(0, ["extvel", vel, err, time_ms, delay_ms])
    yield from (outputs[place] for place in sorted(outputs))


def _logged(name: str, record: np.void, verdict: int) -> list[Any]:
    if verdict in DROPPED:
        return []
    values = [record[label] for label in (record.dtype.names or ())[1:]]
    return [["log", name, *(bits_of(one) if isinstance(one, np.float32) else int(one) for one in values)]]


def expected_of(steps: Sequence[Step]) -> tuple[list[list[Any]], list[Any]]:
    """Return what a recording says of the samples, and of all else, as BatchScenario.run_all does."""
    of_samples, rest = [], []
    for *step, result in steps:
        of_sample = [one for one in result["out"] if one[0] in ("extnav", "extvel")]
        of_sample += [one for one in result["out"] if one[:2] in (["log", "VISP"], ["log", "VISV"])]
        if step[0] in SAMPLES:
            of_samples.append(of_sample)
        rest += [one for one in result["out"] if one not in of_sample]
    return of_samples, rest
