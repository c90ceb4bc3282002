# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration: a scripted flight, a camera with faults, an autopilot that takes its reports; virtual time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_visualodom.log_structure import VISP
from companion.clock import OffsetClock
from companion.sender import Companion
from companion.simulated_camera import CameraFaults, SimulatedCamera, Span
from companion.trajectory import Flight
from emulator.log_sink import LogSink
from emulator.scheduler import Scheduler
from emulator.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig, bench
from mav_handlers.endpoint import MessageEvent
from mav_handlers.links.pair import make_pair
from mav_handlers.wire.messages import SET_GPS_GLOBAL_ORIGIN

HEADING_RAD: Final = math.radians(30)
CAMERA_YAW_RAD: Final = math.radians(-75)
COMPANION_START_S: Final = 7.5
FLIGHT: Final = Flight(start_s=28.0, heading_rad=HEADING_RAD)
FAULTS: Final = CameraFaults(reset_s=43.0, low_quality=Span(36.0, 39.0), dropout=Span(50.0, 52.0))
END_S: Final = FLIGHT.end_s + 4.0
ARM_S: Final = 26.0

PARAMS: Final = {
    "VISO_TYPE": 2,
    "VISO_QUAL_MIN": 20,
    "DISARM_DELAY": 0,  # no throttle is there to be raised
    "VISO_DELAY_MS": 40,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 6,
    "EK3_SRC1_VELZ": 6,
    "EK3_SRC1_YAW": 1,
    "GPS1_TYPE": 0,
}

_RUN_PREARM_CHECKS: Final = 401
_ARM_DISARM: Final = 400


@dataclass(frozen=True, slots=True)
class PoseSample:
    """A VISP record: seconds since boot, metres NED as given to the EKF, whether it was withheld."""

    time_s: float
    pos_ned: tuple[float, float, float]
    ignored: bool


@dataclass
class DemoResult:
    """What happened: texts with their times in seconds and severities, poses, and verdict counts."""

    texts: list[tuple[float, int, str]] = field(default_factory=list)
    poses: list[PoseSample] = field(default_factory=list)
    raw: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)


def make_vehicle(open_log: Callable[[], LogSink]) -> Vehicle:
    """Return the demonstration's vehicle: on the bench at its heading, a T265 as its camera."""
    config = VehicleConfig(
        bench(math.degrees(HEADING_RAD)),
        defaults=PARAMS,
        open_log=open_log,
    )
    return Vehicle(config)


class Demo:
    """One run of the demonstration.

    Args:
        seed: of the camera's noise; the same seed gives the same log, byte for byte.
        open_log: opens the log.
    """

    def __init__(self, seed: int, open_log: Callable[[], LogSink]) -> None:
        self.vehicle = make_vehicle(open_log)
        self.result = DemoResult()
        self._scheduler = Scheduler(self.vehicle)
        self._wire, companion_wire = make_pair(("autopilot", "companion"))
        self._channel = self.vehicle.endpoint.open_channel("companion")
        camera = SimulatedCamera(
            FLIGHT,
            seed,
            frame_yaw_rad=CAMERA_YAW_RAD,
            clock=OffsetClock(offset_us=1_700_000_000_000_000, drift_ppm=30.0),
            faults=FAULTS,
        )
        self.companion = Companion(
            companion_wire, camera.report, latency_us=40_000, start_us=int(COMPANION_START_S * 1e6)
        )
        self.vehicle.texts.on_text.append(self._take_text)
        self.vehicle.logger.on_write = self._take_record
        self.vehicle.endpoint.on_event = self._take_event

    def _now_s(self) -> float:
        return self.vehicle.clock.micros64() * 1e-6

    def _take_text(self, severity: int, text: str) -> None:
        self.result.texts.append((self._now_s(), severity, text))

    def _take_record(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        if structure is VISP:
            x, y, z = (float(value) for value in values[3:6])
            self.result.poses.append(PoseSample(self._now_s(), (x, y, z), bool(values[12])))

    def _take_event(self, event: MessageEvent) -> None:
        message = event.message
        if event.name == "ODOMETRY" and message is not None:
            position = (float(getattr(message, axis)) for axis in ("x", "y", "z"))
            x, y, z = position
            self.result.raw.append((self._now_s(), (x, y, z)))

    def _script(self) -> list[tuple[float, Callable[[], None]]]:
        send = self.companion.send
        command = self.companion.command
        return [
            (7.0, lambda: command(_RUN_PREARM_CHECKS)),
            (8.0, lambda: send(SET_GPS_GLOBAL_ORIGIN(1, -353632610, 1491652300, 584000))),
            (12.0, lambda: command(_RUN_PREARM_CHECKS)),
            (24.0, lambda: command(_RUN_PREARM_CHECKS)),
            (ARM_S, lambda: command(_ARM_DISARM, 1)),
            (END_S - 2.0, lambda: command(_ARM_DISARM, 0)),
        ]

    def run(self, on_progress: Callable[[float], None] = lambda _time_s: None) -> DemoResult:
        """Run to the end and close the log.

        Args:
            on_progress: told the time in seconds since boot now and then.
        """
        script = self._script()
        now_us, end_us = 0, int(END_S * 1e6)
        try:
            while now_us <= end_us:
                self._scheduler.run_until(now_us)
                while script and script[0][0] * 1e6 <= now_us:
                    script.pop(0)[1]()
                self.companion.run(now_us)
                self._exchange()
                if now_us % 1_000_000 == 0:
                    on_progress(now_us * 1e-6)
                now_us += LOOP_PERIOD_US
        finally:
            self.vehicle.close()
        return self.result

    def _exchange(self) -> None:
        while data := self._wire.receive():
            self._scheduler.deliver(self._channel, data)
        output = self.vehicle.endpoint.bytes_to_send(self._channel)
        if output:
            self._wire.send(output)
