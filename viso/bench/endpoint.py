# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many frames the endpoint takes, from bytes to a verdict and to the bytes of the answer where there is one."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from ap_core.cint import u32
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, TIMESYNC, Message
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import PERIOD_US, odometry_at
from viso.vehicle.vehicle import Vehicle, VehicleConfig

FRAMES_A_ROUND: Final = 100
_START_US: Final = 1_000_000

# What nobody acts on, what is answered at once, and what goes through the port to the door of the estimator.
_MESSAGES: Final[Mapping[str, Callable[[int], Message]]] = {
    "ATTITUDE, not acted on": lambda time_us: ATTITUDE(u32(time_us // 1000), 0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
    "TIMESYNC, answered": lambda time_us: TIMESYNC(0, time_us * 1000),
    "ODOMETRY with covariance": odometry_at,
}


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Make a vehicle with a link; its main loop stands still."""
    vehicle = Vehicle(VehicleConfig(defaults={"VISO_TYPE": 1}))
    channel, codec = vehicle.endpoint.open_channel("companion"), Codec(1, 197)
    next_us = _START_US

    def take_frames(make: Callable[[int], Message]) -> Part:
        nonlocal next_us
        times_us = [next_us + number * PERIOD_US for number in range(FRAMES_A_ROUND)]
        next_us = times_us[-1] + PERIOD_US
        frames = [codec.encode(make(time_us)) for time_us in times_us]
        begin_s = now_s()
        for time_us, frame in zip(times_us, frames, strict=True):
            vehicle.receive_bytes(channel, frame, time_us)
            vehicle.endpoint.bytes_to_send(channel)
        return Part(now_s() - begin_s, FRAMES_A_ROUND)

    def run_round() -> Mapping[str, Part]:
        return {name: take_frames(make) for name, make in _MESSAGES.items()}

    yield run_round
