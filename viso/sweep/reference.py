# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the vehicle truly was, by times since boot, for the error of its estimates."""

from pathlib import Path

import numpy as np

from viso.companion.recorded.readers import Source
from viso.companion.trials.evaluation import TimedPoses
from viso.errors import InputError
from viso.logs.recorded import read_recorded_states
from viso.streams.stream_kinds import TRAJECTORY, TrajectoryOptions, kind_of
from viso.streams.trajectory import load

_LOGS = (".bin", ".bin.xz")


def read_reference(path: Path, stream: Path, lead_us: int, options: TrajectoryOptions) -> TimedPoses:
    """Return the positions of a reference, on the clock of the vehicle that a stream is replayed into.

    A DataFlash log gives the positions that its own filter estimated (XKF1). A trajectory is taken to be in seconds
    since boot, or on the clock of the stream if that is a trajectory as well; ``lead_us`` is then from boot to its
    first message. Raises InputError if one cannot be read, or the reference has no positions.
    """
    if path.name.lower().endswith(_LOGS):
        states = read_recorded_states(path)
        times_ns = np.round(np.asarray(states.pos_time_us) * 1000).astype(np.int64)
        kept = np.diff(times_ns, prepend=-1) > 0
        return _poses(path, times_ns[kept], np.asarray(states.pos_ned)[kept])
    truth = load(Source(path), None)
    times_ns = truth.times_ns
    if kind_of(stream, options) == TRAJECTORY:
        source = Source(stream, options.topic, options.times)
        times_ns = times_ns - load(source, options.format_name).times_ns[0] + lead_us * 1000
    return _poses(path, times_ns, truth.positions)


def _poses(path: Path, times_ns: np.ndarray[tuple[int, ...], np.dtype[np.int64]], places: object) -> TimedPoses:
    if len(times_ns) < 2:
        raise InputError(f"{path}: a reference without positions")
    return TimedPoses(times_ns, np.asarray(places, np.float64), np.tile((1.0, 0.0, 0.0, 0.0), (len(times_ns), 1)))
