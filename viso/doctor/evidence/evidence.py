# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All that checks may look at."""

from dataclasses import dataclass
from typing import Final, NamedTuple

from ekf_stub.ahrs.sources import EXTNAV, ROWS
from ekf_stub.core.params import FUSE_ALL_VELOCITIES
from mav_handlers.wire.messages import ODOMETRY
from viso.doctor.evidence.compare import ALIGNING_TYPES, Comparison, PathComparison
from viso.doctor.evidence.flow_fit import FlowFit
from viso.doctor.evidence.own_filter import VisionSensor, Witness
from viso.doctor.evidence.sender_clock import FEWEST_MESSAGES
from viso.doctor.evidence.set_up import SetUp
from viso.doctor.evidence.stream_data import StreamData
from viso.doctor.evidence.tracks import Poses
from viso.doctor.evidence.trial import Trial
from viso.doctor.evidence.vehicle_data import VehicleData
from viso.doctor.evidence.vehicle_position import SOURCE_SETS
from viso.streams.stream_kinds import Aspect
from viso.vehicle.outcomes import OutcomeKind, outcome_kind


class HeightUse(NamedTuple):
    """How many of some positions that were fused gave the height."""

    heights: int
    positions: int

    @property
    def is_rare(self) -> bool:
        """Whether most of the time something else, the barometer as a rule, gave the height."""
        return 2 * self.heights < self.positions


VISION_CHECK: Final = 1 << 18
"""The bit of visual odometry in ARMING_CHECK and ARMING_SKIPCHK."""

_CHECKS: Final = "ARMING_CHECK"
_SKIPPED_CHECKS: Final = "ARMING_SKIPCHK"


@dataclass(frozen=True, slots=True)
class Evidence:
    """A stream, the vehicle that is heard in it, and what the autopilot made of it in virtual time.

    Attributes:
        stream: what was sent.
        vehicle: what the recorded vehicle reported of itself.
        set_up: firmware and parameters of the trial, and where they come from.
        trial: what the emulated autopilot did.
        comparisons: what the vehicle's attitude says about the stream's.
        paths: what the vehicle's path says about the stream's positions.
        flow_fits: what the vehicle's motion says about the flow.
        notes: on how the stream was read.
    """

    stream: StreamData
    vehicle: VehicleData
    set_up: SetUp
    trial: Trial
    comparisons: tuple[Comparison, ...] = ()
    paths: tuple[PathComparison, ...] = ()
    flow_fits: tuple[FlowFit, ...] = ()
    notes: tuple[str, ...] = ()

    def param(self, name: str) -> float:
        """Return a parameter's value at boot; 0 if this autopilot lacks it."""
        return float(self.trial.params.get(name, 0.0))

    def source(self, name: str, number: int = 1) -> int:
        """Return the source of POSXY, VELXY, POSZ, VELZ or YAW in a source set."""
        return int(self.param(f"EK3_SRC{number}_{name}"))

    @property
    def vehicle_witness(self) -> Witness:
        """What the vehicle left: a log or telemetry; the stream where it left nothing."""
        return Witness.STREAM if self.vehicle.own_filter is None else self.vehicle.own_filter.witness

    @property
    def until_us(self) -> int:
        """When the recording ends, us since boot: a log goes on after its last message of external navigation."""
        own, lacks = self.vehicle.own_filter, self.stream.lacks
        if own is None or own.witness is not Witness.LOG or Aspect.LINK not in lacks or Aspect.RESETS in lacks:
            return self.stream.end_us
        series = [own.time_us, *([] if self.vehicle.attitude is None else [self.vehicle.attitude.time_us])]
        return max(self.stream.end_us, *(int(times[-1]) for times in series if len(times)), 0)

    @property
    def system_id(self) -> int:
        """The vehicle's own system id at boot."""
        return int(self.param(self.set_up.firmware.endpoint.params.system_id))

    @property
    def ground_station_id(self) -> int:
        """The system id of the ground station in charge, at boot."""
        return int(self.param(self.set_up.firmware.endpoint.params.ground_station_id))

    @property
    def viso_type(self) -> int:
        """VISO_TYPE at boot."""
        return int(self.param("VISO_TYPE"))

    @property
    def vision_sensor(self) -> VisionSensor | None:
        """The sensor of external navigation in SYS_STATUS; None without SYS_STATUS, or if the bit is another's."""
        own = self.vehicle.own_filter
        return None if own is None or self._is_landing_sensor else own.vision

    @property
    def _is_landing_sensor(self) -> bool:
        """Whether the vision sensor in SYS_STATUS is that of precision landing alone, for which Copter sets its bit."""
        known = self.set_up.known
        kind, lands = known.get("VISO_TYPE"), known.get("PLND_ENABLED")
        if kind:
            return False
        return kind == 0 or self._hears_landing_targets if lands is None else lands != 0

    @property
    def is_sensor_shared(self) -> bool:
        """Whether precision landing is on as well: one bit of SYS_STATUS tells the health of both."""
        return self.set_up.known.get("PLND_ENABLED", float(self._hears_landing_targets)) != 0

    @property
    def _hears_landing_targets(self) -> bool:
        return "LANDING_TARGET" in self.stream.kinds

    @property
    def uses_attitude(self) -> bool:
        """Whether anything uses the attitude of poses: types 2 and 3, a source of yaw, or velocities of ODOMETRY."""
        if self.viso_type in ALIGNING_TYPES or any(self.source("YAW", number) == EXTNAV for number in SOURCE_SETS):
            return True
        turned = any(one.track.sender.name == ODOMETRY.__name__ for one in self.stream.velocities)
        return turned and self.uses_velocities

    @property
    def uses_velocities(self) -> bool:
        """Whether a source set takes its velocity from external navigation."""
        return any(EXTNAV in (self.source("VELXY", number), self.source("VELZ", number)) for number in SOURCE_SETS)

    @property
    def velocities_of_other_sets(self) -> list[str]:
        """The velocity sources of sets 2 and 3 that are fused though set 1 names another, by EK3_SRC_OPTIONS."""
        if not int(self.param("EK3_SRC_OPTIONS")) & FUSE_ALL_VELOCITIES:
            return []
        return [
            f"EK3_SRC{number}_{name}"
            for number in SOURCE_SETS[1:]
            for name in ("VELXY", "VELZ")
            if self.source(name, number) == EXTNAV != self.source(name)
        ]

    @property
    def poses_with_attitude(self) -> tuple[Poses, ...]:
        """Poses whose attitude can be judged: it is there, or it is used, so that it should be."""
        return tuple(poses for poses in self.stream.poses if poses.has_attitude or self.uses_attitude)

    @property
    def height_by_extnav(self) -> HeightUse | None:
        """How many positions were fused, and how many of them gave the height (a model's opinion).

        None if EK3_SRC1_POSZ is not 6, if too few positions were fused, or if none was tried.
        """
        if self.source("POSZ") != EXTNAV:
            return None
        fused = heights = 0
        for message in self.stream.vision:
            for sample in message.samples:
                kinds = {test.outcome.kind: outcome_kind(test.outcome.rule) for test in sample.outcomes}
                fused += kinds.get("pose") is OutcomeKind.FUSED
                heights += kinds.get("height") in (OutcomeKind.FUSED, OutcomeKind.REJECTED, OutcomeKind.RESET)
        return HeightUse(heights, fused) if fused >= FEWEST_MESSAGES else None

    @property
    def arming_parameter(self) -> str:
        """The parameter by which arming checks the vision sensor or not, with its value; "" if it is not known."""
        names = [name for name in (_SKIPPED_CHECKS, _CHECKS) if name in self.set_up.known]
        return f"{names[0]} {self.set_up.known[names[0]]:.0f}" if names else ""

    @property
    def checks_vision(self) -> bool | None:
        """Whether arming checks the vision sensor (AP_Arming::check_enabled); None if that is not known."""
        known = self.set_up.known
        if _SKIPPED_CHECKS in known:
            return not int(known[_SKIPPED_CHECKS]) & VISION_CHECK
        return bool(int(known[_CHECKS]) & (VISION_CHECK | 1)) if _CHECKS in known else None

    @property
    def has_sensor(self) -> bool | None:
        """Whether SYS_STATUS lists a sensor of external navigation; None where that is not known."""
        own = self.vehicle.own_filter
        if own is None or own.vision is None:
            return None
        if self._is_landing_sensor:
            return False if "VISO_TYPE" in self.set_up.known or self.set_up.is_complete else None
        return bool(own.vision.present.any())

    @property
    def requests(self) -> tuple[str, ...]:
        """The parameters that ask for external navigation, with their values, or else the sensor in SYS_STATUS."""
        found = [f"VISO_TYPE {self.viso_type}"] if self.viso_type else []
        found += [
            f"EK3_SRC{number}_{name} {EXTNAV}"
            for number in SOURCE_SETS
            for name in ROWS
            if self.source(name, number) == EXTNAV
        ]
        return tuple(found) or (("the sensor in SYS_STATUS",) if self.has_sensor else ())

    @property
    def is_off(self) -> bool:
        """Whether VISO_TYPE is known to be 0, or not to be there."""
        is_known = self.has_sensor is False or self.set_up.is_complete or "VISO_TYPE" in self.set_up.known
        return is_known and not self.viso_type and not self.has_sensor

    @property
    def is_concerned(self) -> bool:
        """Whether external navigation comes or is asked for, so that what prevents it matters."""
        return bool(self.stream.vision or self.requests)

    @property
    def has_compass(self) -> bool:
        """Whether there is a compass, and it is in use."""
        return self.param("COMPASS_ENABLE") != 0 and self.param("COMPASS_USE") != 0
