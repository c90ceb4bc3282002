# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast virtual time runs: the whole vehicle on the bench, with its filter, its log and a companion computer."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec
from tools.bench.odometry import PERIOD_US, odometry_at
from viso.logs.files import LogStore
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.options import ImuOptions
from viso.vehicle.sensors.standing import BenchSource
from viso.vehicle.vehicle import Vehicle, VehicleConfig

# Until it fuses what it is sent, and for longer.
WARM_UP_MESSAGES: Final = 400
MESSAGES_A_SECOND: Final = 30
_PARAMS: Final = {
    "VISO_TYPE": 1,
    "GPS1_TYPE": 0,
    "LOG_DISARMED": 1,
    **{f"EK3_SRC1_{what}": 6 for what in ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")},
}


class FullVehicle:
    """A vehicle and the link over which it gets ODOMETRY; no telemetry but heartbeats.

    Args:
        log_dir: where its log goes.
        period_us: from one message to the next.
        imus: how many IMUs it has that differ, each with a core; 1 for cores with equal data.
        params: further parameters.

    Attributes:
        vehicle: it.
    """

    def __init__(self, log_dir: Path, *, period_us: int = PERIOD_US, imus: int = 1, **params: float) -> None:
        self._period_us = period_us
        defaults = {**_PARAMS, **params}
        config = VehicleConfig(defaults=defaults, log_store=LogStore(log_dir))
        if imus > 1:
            errors = SensorErrors(gyro_noise_deg_s_rthz=0.01, accel_noise_m_s2_rthz=0.001, imus=imus)
            defaults["EK3_IMU_MASK"] = (1 << imus) - 1
            config = replace(config, make_ahrs=by_ekf3(BenchSource, ImuOptions(errors=errors)))
        self.vehicle = Vehicle(config)
        self._scheduler = Scheduler(self.vehicle)
        self._wire, self._companion_wire = make_pair(("autopilot", "companion"))
        self._channel = self.vehicle.endpoint.open_channel("companion")
        self._codec = Codec(1, 197)
        self._time_us = 0

    def run(self, messages: int) -> float:
        """Run for some messages; return the seconds that this took, without what the companion does beforehand."""
        times_us = [self._time_us + number * self._period_us for number in range(1, messages + 1)]
        frames = [(time_us, self._codec.encode(odometry_at(time_us))) for time_us in times_us]
        begin_s = time.process_time()
        for time_us, frame in frames:
            self._companion_wire.send(frame)
            self._scheduler.run_until(time_us)
            self._scheduler.deliver(self._channel, self._wire.receive())
            self._wire.send(self.vehicle.endpoint.bytes_to_send(self._channel))
        elapsed_s = time.process_time() - begin_s
        self._companion_wire.receive()
        self._time_us = times_us[-1]
        return elapsed_s


def prepare(stack: ExitStack, *, imus: int = 1) -> Callable[[], float]:
    """Start a vehicle; a round is a second of it."""
    run = FullVehicle(Path(stack.enter_context(TemporaryDirectory())), imus=imus)
    stack.callback(run.vehicle.close)
    run.run(WARM_UP_MESSAGES)
    return lambda: run.run(MESSAGES_A_SECOND)
