# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a message costs from its bytes to its log records, beside pymavlink's parse of the same bytes."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.wire.messages import Message
from viso.bench.logging_vehicle import LoggingVehicle
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import odometry_at, pose_at

FRAMES_A_ROUND: Final = 100
MESSAGES: Final[Mapping[str, Callable[[int], Message]]] = {
    "ODOMETRY with covariance": odometry_at,
    "VISION_POSITION_ESTIMATE with covariance": pose_at,
}


def parse_s(frames: Sequence[bytes], now_s: NowS) -> float:
    """Return how long pymavlink takes to parse some frames, one after the other."""
    parser = dialect.MAVLink(None)
    parser.robust_parsing = True
    begin_s = now_s()
    for frame in frames:
        parser.parse_char(frame)
    return now_s() - begin_s


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Start a vehicle that logs; its main loop then stands still."""
    vehicle = LoggingVehicle()

    def run_round() -> Mapping[str, Part]:
        parts = {}
        for name, make in MESSAGES.items():
            frames = vehicle.frames(make, FRAMES_A_ROUND)
            parsing_s = parse_s([frame for _, frame in frames], now_s)
            parts[name] = Part(vehicle.take(frames, now_s), FRAMES_A_ROUND, parsing_s)
        return parts

    yield run_round
