# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration: a scripted flight, a camera with faults, an autopilot that navigates by it; virtual time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_visualodom.log_structure import VISP
from ekf_stub.core.samples import HALF_FILTER_STEP_MS
from viso.companion.sender import Companion, OffsetClock
from viso.companion.simulated_camera import CameraFaults, Flight, SimulatedCamera, Span, Vector
from viso.demo.loop import ARM_DISARM, ORIGIN, RUN_PREARM_CHECKS, VehicleLoop
from viso.demo.record import LoopRecord
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.logger import LogSink
from viso.vehicle.config import by_ekf3
from viso.vehicle.outcomes import AidingSpan
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.script.legs import Motion, ScriptedPath
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import Script
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.vectors import Three
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig

HEADING_RAD: Final = math.radians(30)
CAMERA_YAW_RAD: Final = math.radians(-75)
COMPANION_START_S: Final = 7.5
FLIGHT: Final = Flight(start_s=28.0, heading_rad=HEADING_RAD)
FAULTS: Final = CameraFaults(
    reset_s=43.0, low_quality=Span(36.0, 39.0), dropout=Span(50.0, 52.0), mismatch=Span(54.0, 55.0)
)
SENSOR_ERRORS: Final = SensorErrors(
    gyro_bias_deg_s=(0.1, -0.05, 0.08),
    gyro_noise_deg_s_rthz=0.01,
    accel_bias_m_s2=(0.02, -0.01, 0.03),
    accel_noise_m_s2_rthz=0.002,
    baro_noise_m=0.05,
    compass_noise_mgauss=2.0,
)
END_S: Final = FLIGHT.end_s + 4.0
ARM_S: Final = 26.0
_STILL: Final[Three] = (0.0, 0.0, 0.0)

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
    "LOG_DISARMED": 1,
    "LOG_REPLAY": 1,  # so that the filter can be run on the log
}


@dataclass(frozen=True)
class FlightLeg:
    """A whole flight as one leg of a script; its accelerations are those of its positions."""

    flight: Flight

    @property
    def duration_s(self) -> float:
        """From take-off to touch-down."""
        return self.flight.end_s - self.flight.start_s

    def at(self, t: float) -> Motion:
        """Return the motion t seconds after take-off, without the acceleration, for which nobody asks here."""
        time_s, flight = self.flight.start_s + t, self.flight
        pos, vel, rpy = flight.position_ned(time_s), flight.velocity_ned(time_s), flight.attitude_rpy_rad(time_s)
        return Motion(_three(pos), _three(vel), _STILL, _three(rpy))


def _three(vector: Vector) -> Three:
    x, y, z = vector.tolist()
    return x, y, z


def flight_source(flight: Flight, options: ImuOptions) -> ScriptSource:
    """Return the sensors of a vehicle that flies it, whether armed or not."""
    return ScriptSource(options, Script(ScriptedPath([FlightLeg(flight)], tilts=False), flight.start_s, 0.0))


class PoseSample(NamedTuple):
    """A VISP record: seconds since boot, when it was observed as the filter sees it, metres NED, was it withheld?"""

    time_s: float
    observed_ms: int
    pos_ned: tuple[float, float, float]
    ignored: bool


@dataclass
class DemoResult(LoopRecord):
    """What happened: also the poses as they were logged, and by what the filter navigated."""

    poses: list[PoseSample] = field(default_factory=list)
    aiding: list[AidingSpan] = field(default_factory=list)


def make_vehicle(seed: int, open_log: Callable[[], LogSink], firmware: Firmware = DEFAULT) -> Vehicle:
    """Return the demonstration's vehicle: it flies the scripted flight, felt by its sensors, with a T265 as its camera.

    Args:
        seed: of the noise of the sensors.
    """
    options = ImuOptions(heading_rad=HEADING_RAD, errors=SENSOR_ERRORS, seed=seed)
    make_ahrs = by_ekf3(lambda options: flight_source(FLIGHT, options), options)
    return Vehicle(VehicleConfig(make_ahrs, defaults=PARAMS, open_log=open_log, firmware=firmware))


class Demo(VehicleLoop):
    """One run of the demonstration.

    Args:
        seed: of the noise of camera and sensors; the same seed gives the same log, byte for byte.
    """

    def __init__(self, seed: int, open_log: Callable[[], LogSink], firmware: Firmware = DEFAULT) -> None:
        self.result = DemoResult()
        super().__init__(make_vehicle(seed, open_log, firmware), self.result)
        camera = SimulatedCamera(
            FLIGHT,
            seed,
            frame_yaw_rad=CAMERA_YAW_RAD,
            clock=OffsetClock(offset_us=1_700_000_000_000_000, drift_ppm=30.0),
            faults=FAULTS,
        )
        self.companion = Companion(
            self.companion_wire, camera.report, latency_us=40_000, start_us=int(COMPANION_START_S * 1e6)
        )
        self.vehicle.logger.on_write = self._take_record

    def _take_record(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        if structure.name == VISP.name:
            observed_ms = int(values[2]) - int(PARAMS["VISO_DELAY_MS"]) - HALF_FILTER_STEP_MS
            x, y, z = (float(value) for value in values[3:6])
            time_s = self.vehicle.clock.micros64() * 1e-6
            self.result.poses.append(PoseSample(time_s, observed_ms, (x, y, z), bool(values[12])))

    def run_companion(self, now_us: int) -> None:
        """Let the companion do what is due by a time since the autopilot's boot."""
        self.companion.run(now_us)

    def run(
        self,
        on_progress: Callable[[float], None] = lambda _time_s: None,
        stop: Callable[[], bool] = lambda: False,
    ) -> DemoResult:
        """Run to the end, or until ``stop`` says so, and close the log."""
        command = self.companion.command
        acts: dict[float, Callable[[], None]] = {
            7.0: lambda: command(RUN_PREARM_CHECKS),
            8.0: lambda: self.companion.send(ORIGIN),
            12.0: lambda: command(RUN_PREARM_CHECKS),
            24.0: lambda: command(RUN_PREARM_CHECKS),
            ARM_S: lambda: command(ARM_DISARM, 1),
            END_S - 2.0: lambda: command(ARM_DISARM, 0),
        }
        # Each is there when the pass of its time looks at the link.
        script = [(time_s - 1e-6 * LOOP_PERIOD_US, act) for time_s, act in acts.items()]
        self.play(script, END_S, on_progress, stop)
        self.result.aiding = self.watch.aiding()
        return self.result
