# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters to try a stream with: given, or else heard in it, or else assumed so that it can work."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from ekf_stub.ahrs.sources import EXTNAV
from mav_handlers.handlers import VISION_NAMES
from mav_handlers.wire.codec import message_name
from mav_handlers.wire.messages import VISION_POSITION_DELTA
from viso.doctor.evidence.tracks import POSE_TYPES, VELOCITY_TYPES
from viso.doctor.evidence.vehicle_data import VehicleData
from viso.firmware.flown import FlownVersion, JudgedBy
from viso.firmware.releases import Firmware
from viso.streams.stream import message_id_of
from viso.streams.stream_kinds import Stream

FEWEST_OF_WHOLE_LIST: Final = 300
"""No ArduPilot vehicle has fewer parameters."""
_BARO = 1
_COMPASS = 1
_NONE = 0
_EKF3: Final = 3
_HEIGHT_SOURCES: Final = {1: 2, 2: 3, 3: 4, 4: EXTNAV}  # of EKn_ALT_SOURCE, as the firmware of 4.1 converts it
_POSES = frozenset(cls.__name__ for cls in POSE_TYPES)
_VELOCITIES = frozenset(cls.__name__ for cls in (*VELOCITY_TYPES, VISION_POSITION_DELTA))


@dataclass(frozen=True, slots=True)
class Assumed:
    """A parameter that is not known, the value that is assumed for it, and why."""

    name: str
    value: float
    why: str


def _of_older(flown: FlownVersion, known: Mapping[str, float]) -> Iterator[Assumed]:
    """Yield parameters that make the vehicle of the trial behave as an older release."""
    if not flown.reads_quality:
        yield Assumed("VISO_QUAL_MIN", -1, "before 4.6 no quality is read")
    if flown.has_sources:
        return
    uses_compass = known.get("COMPASS_USE", 1) != 0 and known.get("COMPASS_ENABLE", 1) != 0
    yield Assumed("VISO_TYPE", 1, "before 4.1 messages go to the estimators whatever it is")
    yield Assumed("AHRS_EKF_TYPE", _EKF3, "EKF2 stands for the filter before 4.1")
    yield Assumed("EK3_ENABLE", 1, "likewise")
    yield Assumed("EK3_SRC1_POSXY", EXTNAV, "EKF2 takes positions where it has no GPS")
    yield Assumed("EK3_SRC1_VELXY", _NONE, "EKF2 takes no velocities")
    yield Assumed("EK3_SRC1_VELZ", _NONE, "likewise")
    height = int(known.get("EK2_ALT_SOURCE", 0))
    yield Assumed("EK3_SRC1_POSZ", _HEIGHT_SOURCES.get(height, _BARO), f"EK2_ALT_SOURCE is {height}")
    yield Assumed("EK3_SRC1_YAW", *((_COMPASS, "the compass is used") if uses_compass else (EXTNAV, "no compass")))


@dataclass(frozen=True, slots=True)
class SetUp:
    """The firmware and the parameters to try a stream with.

    Attributes:
        judged_by: the release that the vehicle of the trial is, and how it was found.
        known: parameters from the recording or the user.
        assumed: parameters that are not known, or that the release that flew does not have.
        is_complete: whether a parameter that is not known is one that the vehicle does not have.
        is_as_flown: whether the parameters are those that the vehicle flew with, as far as they are known.
    """

    judged_by: JudgedBy
    known: Mapping[str, float] = field(default_factory=dict)
    assumed: tuple[Assumed, ...] = ()
    is_complete: bool = False
    is_as_flown: bool = True

    @property
    def firmware(self) -> Firmware:
        """The release that the vehicle of the trial is."""
        return self.judged_by.firmware

    @property
    def lacks_visual_odometry(self) -> bool:
        """Whether a whole list of parameters has none of visual odometry: the build was made without it."""
        is_whole = self.is_complete and len(self.known) > FEWEST_OF_WHOLE_LIST
        return is_whole and "VISO_TYPE" not in self.known

    @property
    def params(self) -> dict[str, float]:
        """What the vehicle of the trial gets."""
        return {**self.known, **{parameter.name: parameter.value for parameter in self.assumed}}


def choose_set_up(
    stream: Stream,
    vehicle: VehicleData,
    given: Mapping[str, float],
    names: Collection[str],
    judged_by: JudgedBy,
) -> SetUp:
    """Return the parameters for a vehicle to try a stream.

    Given parameters win over those of the stream's file, and those win over what the vehicle reports in it.

    Args:
        stream: to be tried.
        vehicle: that is heard in it.
        given: by the user.
        names: of the messages of external navigation in the stream; without any nothing need be assumed.
        judged_by: the release that the vehicle is, which calls its parameters by names of its own.
    """
    recorded = {**vehicle.params, **stream.params}
    known = {**recorded, **given}
    if vehicle.system_id is not None:
        known.setdefault(judged_by.firmware.endpoint.params.system_id, float(vehicle.system_id))
    is_complete = bool(stream.params) or vehicle.has_all_params
    assumed = list[Assumed]()
    if names and judged_by.stands_for is not None:
        assumed += [one for one in _of_older(judged_by.stands_for, known) if one.name not in given]
    if not is_complete:
        assumed += fitting(names, {*known, *(parameter.name for parameter in assumed)})
    return SetUp(
        judged_by=judged_by,
        known=known,
        assumed=tuple(assumed),
        is_complete=is_complete,
        is_as_flown=all(recorded.get(name, value) == value for name, value in given.items()),
    )


def vision_carried(stream: Stream) -> frozenset[str]:
    """Return the names of a stream's messages of external navigation."""
    kinds = {message_id_of(message.frame) for message in stream.messages}
    return VISION_NAMES & {message_name(kind) for kind in kinds}


def fitting(names: Collection[str], known: Collection[str]) -> list[Assumed]:
    """Return the parameters that a vehicle needs for external navigation by messages of some names.

    Known parameters are left out, and all sources if one of them is known.
    """
    if not names:
        return []
    has_pose, has_velocity = not _POSES.isdisjoint(names), not _VELOCITIES.isdisjoint(names)
    pose = "the stream carries poses" if has_pose else "the stream carries no pose"
    velocity = "the stream carries velocities" if has_velocity else "the stream carries no velocity"
    yaw = "the stream carries the attitude" if has_pose else "the stream carries no attitude"
    sources = [
        Assumed("EK3_SRC1_POSXY", EXTNAV if has_pose else _NONE, pose),
        Assumed("EK3_SRC1_VELXY", EXTNAV if has_velocity else _NONE, velocity),
        Assumed("EK3_SRC1_POSZ", _BARO, "height from the barometer is what most use"),
        Assumed("EK3_SRC1_VELZ", EXTNAV if has_velocity else _NONE, velocity),
        Assumed("EK3_SRC1_YAW", EXTNAV if has_pose else _COMPASS, yaw),
    ]
    fit = [
        Assumed("VISO_TYPE", 1, "MAVLink, which passes samples on as they are"),
        Assumed("GPS1_TYPE", 0, "no GPS, as external navigation is to be tried"),
        *([] if any(name.startswith("EK3_SRC") for name in known) else sources),
    ]
    return [parameter for parameter in fit if parameter.name not in known]
