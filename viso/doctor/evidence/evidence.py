# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All that the rules may look at."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from ekf_stub.inputs.sources import EXTNAV
from mav_handlers.handlers import VISION_MESSAGES
from viso.doctor.evidence.compare import Comparison, PathComparison
from viso.doctor.evidence.flow_fit import FlowFit
from viso.doctor.evidence.ground_sensors import NO_GROUND_SENSORS, GroundSensors
from viso.doctor.evidence.motion import Motion
from viso.doctor.evidence.own_filter import OwnFilter, Witness
from viso.doctor.evidence.refused_frames import FrameKind
from viso.doctor.evidence.tracks import Poses, SeenMessage, Track, Velocities
from viso.doctor.evidence.vehicle_data import AttitudeSeries, HeightSeries, ParamChange
from viso.doctor.evidence.vehicle_position import LevelSeries, PositionSeries
from viso.firmware.flown import FlownVersion
from viso.firmware.releases import Firmware
from viso.streams.stream_kinds import Aspect
from viso.vehicle.outcomes.watch import AidingSpan, Innovations

__all__ = ["EXTNAV", "Assumed", "Evidence", "SeenMessage"]

SOURCE_NAMES: Final = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")


@dataclass(frozen=True, slots=True)
class Assumed:
    """A parameter that nobody told, and why it is taken to be so."""

    name: str
    value: float
    why: str


@dataclass(frozen=True, slots=True)
class Evidence:
    """A stream, and what the autopilot made of it in virtual time.

    Attributes:
        name: of the stream.
        firmware: the release that it was tried on.
        messages: all of them, the autopilot's own included.
        tracks: stamped messages of external navigation by sender and type.
        poses, velocities: what they say.
        motions: path and velocities of each sender, side by side.
        attitude, height: the vehicle's by its own account, if there is one.
        comparisons: what that says about the stream's attitude.
        params: every parameter at boot, defaults included.
        assumed: parameters that were assumed.
        changes: parameters that changed within the stream.
        texts: what the emulated autopilot said: time in us since boot, severity, text.
        vehicle_texts: what the autopilot in the stream said, likewise.
        aiding: by what the filter navigated, a model's opinion.
        innovations: by kind of sample, likewise.
        end_us: when the stream ends, us since boot.
        notes: on how the stream was read.
        vision: the messages that carry external navigation.
        lacks: what of the messages was made up, because the recording does not hold it.
        paths: what the vehicle's own path says about the stream's positions.
        own_filter: what the filter of the vehicle that really flew said; None if no such vehicle is heard.
        is_as_flown: whether the parameters are those that it flew with, as far as they are told.
        kinds: how many messages there are by name, the damaged by the name that they claim.
        told: parameters that the recording or the user told.
        tells_all: whether a parameter that was not told is one that the vehicle does not have.
        flown: the release that flew, if the recording tells.
        refused: the types and senders of which frames failed their checksum.
        model_jumps: how many jumps without a reset the imagined vehicle that follows the stream saw in it.
        position, level: the vehicle's place and height, by something that does not take them from the stream.
        truth: the vehicle's attitude by a simulator.
        is_simulated: whether the vehicle flies in a simulator.
        ground: what flow sensors and range finders said.
        flow_fits: what the vehicle's motion says about the flow.
    """

    name: str
    firmware: Firmware
    messages: tuple[SeenMessage, ...]
    tracks: tuple[Track, ...]
    poses: tuple[Poses, ...]
    velocities: tuple[Velocities, ...]
    motions: tuple[Motion, ...]
    attitude: AttitudeSeries | None
    height: HeightSeries | None
    comparisons: tuple[Comparison, ...]
    params: Mapping[str, float]
    assumed: tuple[Assumed, ...]
    changes: tuple[ParamChange, ...]
    texts: tuple[tuple[int, int, str], ...]
    vehicle_texts: tuple[tuple[int, int, str], ...]
    aiding: tuple[AidingSpan, ...]
    innovations: Mapping[str, Innovations]
    end_us: int
    notes: tuple[str, ...]
    vision: tuple[SeenMessage, ...]
    lacks: frozenset[Aspect] = frozenset()
    paths: tuple[PathComparison, ...] = ()
    own_filter: OwnFilter | None = None
    is_as_flown: bool = True
    kinds: Mapping[str, int] = field(default_factory=dict)
    told: Mapping[str, float] = field(default_factory=dict)
    tells_all: bool = True
    flown: FlownVersion | None = None
    model_jumps: int = 0
    refused: tuple[FrameKind, ...] = ()
    position: PositionSeries | None = None
    level: LevelSeries | None = None
    truth: AttitudeSeries | None = None
    is_simulated: bool = False
    ground: GroundSensors = NO_GROUND_SENSORS
    flow_fits: tuple[FlowFit, ...] = ()

    def param(self, name: str) -> float:
        """Return a parameter's value at boot; 0 of one that this autopilot lacks."""
        return float(self.params.get(name, 0.0))

    def source(self, name: str, number: int = 1) -> int:
        """Return what a source set takes POSXY, VELXY, POSZ, VELZ or YAW from."""
        return int(self.param(f"EK3_SRC{number}_{name}"))

    @property
    def vehicle_witness(self) -> Witness:
        """What the vehicle left: a log or telemetry; the stream where it left nothing."""
        return Witness.STREAM if self.own_filter is None else self.own_filter.witness

    @property
    def system_id(self) -> int:
        """The vehicle's own system id at boot."""
        return int(self.param(self.firmware.endpoint.params.system_id))

    @property
    def ground_station_id(self) -> int:
        """The system id of the ground station in charge, at boot."""
        return int(self.param(self.firmware.endpoint.params.ground_station_id))

    @property
    def viso_type(self) -> int:
        """VISO_TYPE at boot."""
        return int(self.param("VISO_TYPE"))

    @property
    def has_sensor(self) -> bool | None:
        """Whether SYS_STATUS named a sensor of external navigation; None if there was none."""
        sensor = None if self.own_filter is None else self.own_filter.vision
        return None if sensor is None else bool(sensor.present.any())

    @property
    def asks(self) -> tuple[str, ...]:
        """What asks for external navigation in the set-up of the vehicle, messages apart: names with their values."""
        found = [f"VISO_TYPE {self.viso_type}"] if self.viso_type else []
        found += [
            f"EK3_SRC{number}_{name} {EXTNAV}"
            for number in (1, 2, 3)
            for name in SOURCE_NAMES
            if self.source(name, number) == EXTNAV
        ]
        return tuple(found) or (("the sensor in SYS_STATUS",) if self.has_sensor else ())

    @property
    def is_off(self) -> bool:
        """Whether VISO_TYPE is known to be 0, or not to be there."""
        is_known = self.has_sensor is False or self.tells_all or "VISO_TYPE" in self.told
        return is_known and not self.viso_type and not self.has_sensor

    @property
    def is_concerned(self) -> bool:
        """Whether external navigation comes or is asked for, so that what stands against it matters."""
        return bool(self.vision or self.asks)

    @property
    def has_compass(self) -> bool:
        """Whether there is a compass, and in use."""
        return self.param("COMPASS_ENABLE") != 0 and self.param("COMPASS_USE") != 0


def vision_of(messages: tuple[SeenMessage, ...]) -> tuple[SeenMessage, ...]:
    """Return the messages that carry external navigation."""
    kinds = tuple(VISION_MESSAGES)
    return tuple(one for one in messages if isinstance(one.message, kinds))
