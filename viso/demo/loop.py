# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The closed loop: a vehicle flies through a world, a companion sees it, and the vehicle navigates by the companion.

All in virtual time and in one thread: the same set-up gives the same log, byte for byte.
"""

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from mav_handlers.links.pair import make_pair
from mav_handlers.wire.messages import SET_GPS_GLOBAL_ORIGIN
from viso.companion.run.virtual_companion import VirtualCompanion
from viso.companion.sender import command_long
from viso.companion.vio.config import AglSource, Scene, VioConfig
from viso.companion.world.flight import SyntheticFlight
from viso.demo.record import AUTOPILOT, COMPANION, LOOK_PERIOD_US, LoopRecord, LoopRecorder
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.logger import LogSink
from viso.running.virtual_time import Scheduler
from viso.vehicle.config import by_ekf3
from viso.vehicle.outcomes import FilterWatch
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.world_flight import flight_source
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

PARAMS: Final = MappingProxyType(
    {
        "VISO_TYPE": 1,
        "VISO_QUAL_MIN": 10,
        "VISO_DELAY_MS": 5,
        "EK3_SRC1_POSXY": 6,
        "EK3_SRC1_VELXY": 6,
        "EK3_SRC1_POSZ": 1,
        "EK3_SRC1_VELZ": 0,
        "EK3_SRC1_YAW": 1,
        "GPS1_TYPE": 0,
        "DISARM_DELAY": 0,  # no throttle is there to be raised
    }
)
SENSOR_ERRORS: Final = SensorErrors(
    gyro_bias_deg_s=(0.1, -0.05, 0.08),
    gyro_noise_deg_s_rthz=0.01,
    accel_bias_m_s2=(0.02, -0.01, 0.03),
    accel_noise_m_s2_rthz=0.002,
    baro_noise_m=0.05,
    compass_noise_mgauss=1.0,
)
ORIGIN: Final = SET_GPS_GLOBAL_ORIGIN(1, -353632610, 1491652300, 584000)
RUN_PREARM_CHECKS: Final = 401
ARM_DISARM: Final = 400

_NS_PER_US: Final = 1000

Script = Sequence[tuple[float, Callable[[], None]]]
OnProgress = Callable[[float], None]


@dataclass(frozen=True, kw_only=True)
class LoopSetup:
    """What is flown, by whom.

    Attributes:
        flight: what the companion's sensors tell; at rest at its beginning, which is when the companion comes up.
        companion_us: when that is, since the autopilot's boot.
        params: the autopilot's, over those of ``PARAMS``.
        sensor_errors: of the autopilot's own sensors.
        seed: of the random part of those.
    """

    flight: SyntheticFlight
    companion_us: int = 7_000_000
    config: VioConfig = field(default_factory=lambda: VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER))
    params: Mapping[str, float] = field(default_factory=dict)
    sensor_errors: SensorErrors = SENSOR_ERRORS
    seed: int = 0
    firmware: Firmware = DEFAULT

    def companion_time_us(self, time_us: int) -> int:
        """Return what the companion's clock shows at a time since the autopilot's boot."""
        return self.flight.start_ns // _NS_PER_US + time_us - self.companion_us

    def boot_time_us(self, companion_us: int) -> int:
        """Return the time since the autopilot's boot at which the companion's clock shows another."""
        return companion_us - self.flight.start_ns // _NS_PER_US + self.companion_us


class VehicleLoop(ABC):
    """A vehicle, back to back with a companion that a subclass gives.

    Args:
        vehicle: fresh.

    Attributes:
        companion_wire: the companion's end of the link.
    """

    def __init__(self, vehicle: Vehicle, record: LoopRecord) -> None:
        self.vehicle, self.record = vehicle, record
        self.watch = FilterWatch(vehicle)
        self.recorder = LoopRecorder(vehicle, self.watch, record)
        self._scheduler = Scheduler(vehicle)
        self._wire, self.companion_wire = make_pair((AUTOPILOT, COMPANION))
        self._channel = vehicle.endpoint.open_channel(COMPANION)
        self.now_us = 0

    @abstractmethod
    def run_companion(self, now_us: int) -> None:
        """Let the companion do what is due by a time since the autopilot's boot."""

    def run_until(self, time_us: int) -> None:
        """Go on to a time since the autopilot's boot."""
        while self.now_us <= time_us:
            self._step(self.now_us)
            self.now_us += LOOP_PERIOD_US

    def play(self, script: Script, end_s: float, on_progress: OnProgress, stop: Callable[[], bool]) -> None:
        """Run a script up to the end, or until ``stop`` says so, and close.

        Args:
            script: what to do after which time in s since boot.
            end_s: when to end, in s since boot.
            on_progress: called with the time in s since boot, once a second.
            stop: asked as often.
        """
        try:
            for time_s, act in (*(entry for entry in script if entry[0] < end_s), (end_s, lambda: None)):
                for second in range(-(-self.now_us // 1_000_000), int(time_s) + 1):
                    self.run_until(second * 1_000_000)
                    on_progress(second)
                    if stop():
                        return
                self.run_until(round(time_s * 1e6))
                act()
        finally:
            self.close()

    def close(self) -> None:
        """Close the vehicle's log."""
        self.vehicle.close()

    def _step(self, now_us: int) -> None:
        self._scheduler.run_until(now_us)
        self.watch.look()
        if now_us % LOOK_PERIOD_US == 0:
            self.recorder.look()
        self.run_companion(now_us)
        while data := self._wire.receive():
            self._scheduler.deliver(self._channel, data)
        if output := self.vehicle.endpoint.bytes_to_send(self._channel):
            self._wire.send(output)


class CompanionLoop(VehicleLoop):
    """A vehicle and a companion with an odometry.

    Raises:
        StrategyNotAvailableError: if the strategy's libraries are not there.
    """

    def __init__(self, setup: LoopSetup, open_log: Callable[[], LogSink]) -> None:
        self.setup = setup
        super().__init__(_make_vehicle(setup, open_log), LoopRecord())
        logger = logging.Logger(COMPANION, logging.INFO)  # of its own: it is not the program's
        logger.addHandler(self.recorder)
        listeners = [self.recorder.take_result]
        self.companion = VirtualCompanion(setup.flight, setup.config, self.companion_wire, logger, listeners)

    def command(self, command: int, *params: float) -> None:
        """Send the autopilot a COMMAND_LONG over the companion's link; missing parameters are 0."""
        self.companion.sender.send(command_long(command, *params))

    def run_companion(self, now_us: int) -> None:
        """Let the companion do what is due by a time since the autopilot's boot."""
        if now_us >= self.setup.companion_us:
            self.companion.run(self.setup.companion_time_us(now_us))

    def close(self) -> None:
        """Close the vehicle's log and the companion."""
        super().close()
        self.companion.close()


def _make_vehicle(setup: LoopSetup, open_log: Callable[[], LogSink]) -> Vehicle:
    def make_source(options: ImuOptions) -> ScriptSource:
        return flight_source(setup.flight.trajectory, setup.companion_us * 1e-6, options)

    make_ahrs = by_ekf3(make_source, ImuOptions(errors=setup.sensor_errors, seed=setup.seed))
    params = {**PARAMS, **setup.params}
    return Vehicle(VehicleConfig(make_ahrs, defaults=params, open_log=open_log, firmware=setup.firmware))
