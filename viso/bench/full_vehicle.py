# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast virtual time runs: the whole vehicle on the bench, with its filter, its log and a companion computer."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import PERIOD_US, odometry_at
from viso.logs.files import LogStore
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

# Until it fuses what it is sent, and for longer.
WARM_UP_MESSAGES: Final = 400
MESSAGES_A_ROUND: Final = 15
_YAW_SOURCES: Final = {"yaw of the camera": 6, "yaw of the compass": 1}
_PARAMS: Final = {
    "VISO_TYPE": 1,
    "GPS1_TYPE": 0,
    "LOG_DISARMED": 1,
    **{f"EK3_SRC1_{what}": 6 for what in ("POSXY", "VELXY", "POSZ", "VELZ")},
}


class FullVehicle:
    """A vehicle and the link over which it gets ODOMETRY; no telemetry but heartbeats.

    Args:
        yaw_source: EK3_SRC1_YAW.
        log_dir: where its log goes.
        period_us: from one message to the next.
    """

    def __init__(self, yaw_source: int, log_dir: Path, *, period_us: int = PERIOD_US) -> None:
        self._period_us = period_us
        config = VehicleConfig(defaults={**_PARAMS, "EK3_SRC1_YAW": yaw_source}, log_store=LogStore(log_dir))
        self.vehicle = Vehicle(config)
        self._scheduler = Scheduler(self.vehicle)
        self._wire, self._companion_wire = make_pair(("autopilot", "companion"))
        self._channel = self.vehicle.endpoint.open_channel("companion")
        self._codec = Codec(1, 197)
        self._time_us = 0

    def run(self, messages: int, now_s: NowS) -> Part:
        """Run for some messages; what the companion does beforehand is not measured."""
        first_us = self._time_us
        times_us = [first_us + number * self._period_us for number in range(1, messages + 1)]
        frames = [(time_us, self._codec.encode(odometry_at(time_us))) for time_us in times_us]
        begin_s = now_s()
        for time_us, frame in frames:
            self._companion_wire.send(frame)
            self._scheduler.run_until(time_us)
            self._scheduler.deliver(self._channel, self._wire.receive())
            self._wire.send(self.vehicle.endpoint.bytes_to_send(self._channel))
        elapsed_s = now_s() - begin_s
        self._companion_wire.receive()
        self._time_us = times_us[-1]
        return Part(elapsed_s, (self._time_us - first_us) * 1e-6)


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Start vehicles that take yaw from different places; a round is half a second of each."""
    with TemporaryDirectory() as folder:
        runs = {name: FullVehicle(source, Path(folder, name)) for name, source in _YAW_SOURCES.items()}
        try:
            for run in runs.values():
                run.run(WARM_UP_MESSAGES, now_s)

            def run_round() -> Mapping[str, Part]:
                return {name: run.run(MESSAGES_A_ROUND, now_s) for name, run in runs.items()}

            yield run_round
        finally:
            for run in runs.values():
                run.vehicle.close()
