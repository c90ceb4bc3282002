# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A kind of recorded stream: a line a position, time in s and x, y and z in m (NED), between blanks."""

from pathlib import Path

from mav_handlers import VISION_POSITION_ESTIMATE, Codec
from viso import InputError, Stream, StreamMessage
from viso.streams import StreamKind, TrajectoryOptions


def read(path: Path, lead_us: int, options: TrajectoryOptions) -> Stream:
    """Return the positions as messages that arrive at once. Raises InputError for a file that cannot be read."""
    camera, messages = Codec(1, 197), []
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            time_s, x, y, z = map(float, line.split())
            time_us = round(time_s * 1e6)
            pose = VISION_POSITION_ESTIMATE(time_us, x, y, z, roll=0.0, pitch=0.0, yaw=0.0)
            messages.append(StreamMessage(lead_us + time_us, camera.encode(pose)))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {error}") from error
    return Stream(path.stem, tuple(messages))


POSITION_TABLE = StreamKind((".positions",), "a line a position: time, x, y and z", "", read)
