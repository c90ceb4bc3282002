# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters to try a stream with: given, else heard in it, else assumed so that it can work."""

from collections.abc import Collection, Mapping

from mav_handlers.wire.messages import VISION_POSITION_DELTA
from viso.doctor.evidence import EXTNAV, Assumed
from viso.doctor.measures.tracks import POSE_TYPES, VELOCITY_TYPES
from viso.doctor.measures.vehicle_data import VehicleData
from viso.firmware.releases import Firmware
from viso.streams.stream_kinds import Stream

_BARO = 1
_COMPASS = 1
_NONE = 0
_POSES = frozenset(cls.__name__ for cls in POSE_TYPES)
_VELOCITIES = frozenset(cls.__name__ for cls in (*VELOCITY_TYPES, VISION_POSITION_DELTA))


def _fitting(names: Collection[str]) -> list[Assumed]:
    has_pose, has_velocity = not _POSES.isdisjoint(names), not _VELOCITIES.isdisjoint(names)
    pose = "the stream carries poses" if has_pose else "the stream carries no pose"
    velocity = "the stream carries velocities" if has_velocity else "the stream carries no velocity"
    yaw = "the stream carries the attitude" if has_pose else "the stream carries no attitude"
    yaw_source = EXTNAV if has_pose else _COMPASS
    return [
        Assumed("VISO_TYPE", 1, "MAVLink, which passes samples on as they are"),
        Assumed("GPS1_TYPE", 0, "no GPS, as external navigation is to be tried"),
        Assumed("EK3_SRC1_POSXY", EXTNAV if has_pose else _NONE, pose),
        Assumed("EK3_SRC1_VELXY", EXTNAV if has_velocity else _NONE, velocity),
        Assumed("EK3_SRC1_POSZ", _BARO, "height from the barometer is what most use"),
        Assumed("EK3_SRC1_VELZ", EXTNAV if has_velocity else _NONE, velocity),
        Assumed("EK3_SRC1_YAW", yaw_source, yaw),
    ]


def settle(
    stream: Stream, vehicle: VehicleData, given: Mapping[str, float], names: Collection[str], firmware: Firmware
) -> tuple[dict[str, float], tuple[Assumed, ...]]:
    """Return parameters for a vehicle to try a stream, and which of them were assumed.

    Args:
        stream: with the parameters that its file holds.
        vehicle: with those heard in the stream.
        given: what the user says, which wins.
        names: of the messages of external navigation in the stream.
        firmware: which calls its parameters by names of its own.
    """
    told = {**vehicle.params, **stream.params, **given}
    if vehicle.system_id is not None:
        told.setdefault(firmware.endpoint.params.system_id, float(vehicle.system_id))
    if stream.params or vehicle.has_all_params:
        return told, ()
    sources_told = any(name.startswith("EK3_SRC") for name in told)
    assumed = [
        one for one in _fitting(names) if one.name not in told and not (sources_told and one.name.startswith("EK3_SRC"))
    ]
    return told | {one.name: one.value for one in assumed}, tuple(assumed)
