# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared parts of inputs: the error of a file, counted refusals, line readers, numbers and poses of records."""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, Protocol

from viso.companion.vio.frames import ENU_TO_NED, FLU_TO_FRD
from viso.geometry.rotation import Array, rotation_from_quat_wxyz, rotations_from_euler, yaw_of
from viso.landmarks.types import Event, VehiclePose

LARGEST_M: Final = 1e8
"""No coordinate is larger; those of UTM reach 1e7."""
LARGEST_S: Final = 1e11
"""No time is larger; a larger one is not in seconds."""
NO_TIME: Final = "no time"
NOT_ICAO: Final = "not an ICAO address"
NO_FIX: Final = "no fix: (0, 0)"
NO_POSITION: Final = "aircraft without a position"


class InputFileError(Exception):
    """A file that cannot be read, in one line: which file, which line or record, and why."""

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.split()))


class Refused(Exception):
    """Carries the reason why a record, or a part of it, is unusable."""


class LineReader(ABC):
    """Turns lines of text into events; each format defines the epoch of its times.

    Attributes:
        refused: number of unusable records, or parts of them, by reason.
    """

    def __init__(self, refused: Counter[str] | None = None) -> None:
        self.refused: Counter[str] = Counter() if refused is None else refused

    def take(self, line: str, arrival_s: float | None = None) -> list[Event]:
        """Return the events of a line. Never raises because of its content.

        Args:
            line: with or without its end; blank ones are skipped.
            arrival_s: when it arrived, on the clock of the other inputs; None if unknown.
        """
        events: list[Event] = []
        if line.strip():
            with counted(self.refused):
                events = self._events(line, arrival_s)
        return events

    @abstractmethod
    def _events(self, line: str, arrival_s: float | None) -> list[Event]:
        """Return the events of a line that is not blank. Raises Refused or a record's ValueError if unusable."""


class FileReader(Protocol):
    """Turns a file into events; ``refused`` is complete after the last one."""

    refused: Counter[str]

    def events(self) -> Iterator[Event]:
        """Yield the file's events. Raises InputFileError if it cannot be read."""
        ...


@contextmanager
def counted(refused: Counter[str]) -> Iterator[None]:
    """Count a refusal by its reason, and continue after the block; so for a record's ValueError, by its field."""
    try:
        yield
    except Refused as refusal:
        refused[str(refusal)] += 1
    except ValueError as error:
        refused[f"bad {str(error).partition(':')[0]}"] += 1


def number(record: Mapping[str, Any], key: str, largest: float = math.inf) -> float:
    """Return a number of a record. Raises Refused if it is missing, none, not finite, or beyond ``largest``."""
    value = record.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Refused(f"{key} is no number")
    if not abs(value) <= largest or not abs(value) < math.inf:
        raise Refused(f"{key} is out of range")
    try:
        return float(value)
    except OverflowError:
        raise Refused(f"{key} is out of range") from None


def optional_number(record: Mapping[str, Any], key: str, refused: Counter[str]) -> float | None:
    """Return a number of a record, None if missing; a value that is not a number is counted."""
    if record.get(key) is not None:
        with counted(refused):
            return number(record, key)
    return None


def icao_of(text: object) -> str:
    """Return an ICAO address in upper case; raises Refused for other addresses, which receivers mark with a tilde."""
    icao = text.strip().upper() if isinstance(text, str) else ""
    if len(icao) != 6 or not set(icao) <= set("0123456789ABCDEF"):
        raise Refused(NOT_ICAO)
    return icao


def not_null_island(latitude_deg: float, longitude_deg: float) -> None:
    """Raise Refused for (0, 0), which receivers send without a fix."""
    if latitude_deg == 0 and longitude_deg == 0:
        raise Refused(NO_FIX)


_UNIT_LENGTH = 0.05


def rotation_of_quat(quat_wxyz: tuple[float, float, float, float]) -> Array:
    """Return the rotation matrix [3, 3] of a quaternion. Raises Refused if its length is not 1 within 5 %."""
    if not abs(math.hypot(*quat_wxyz) - 1) <= _UNIT_LENGTH:
        raise Refused("an attitude that is no rotation")
    return rotation_from_quat_wxyz(quat_wxyz)


def ned_R_frd(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Return the attitude [3, 3] of the autopilot's angles, which turn about z, then y, then x.

    Raises Refused if one is not finite.
    """
    if not math.isfinite(roll_rad + pitch_rad + yaw_rad):
        raise Refused("an attitude that is no rotation")
    return rotations_from_euler((roll_rad, pitch_rad, yaw_rad))


def pose_from_enu(t_s: float, position_enu: tuple[float, float, float], enu_R_flu: Array) -> VehiclePose:
    """Return a pose with full attitude. Raises Refused if the position is not finite or too large."""
    if not all(abs(value) <= LARGEST_M for value in position_enu):
        raise Refused("a position out of range")
    x_m, y_m, z_m = position_enu
    return VehiclePose(t_s, x_m, y_m, yaw_of(enu_R_flu), z_m, enu_R_flu)


def pose_from_ned(t_s: float, position_ned: tuple[float, float, float], attitude: Array) -> VehiclePose:
    """Return the pose of a position in NED and an attitude [3, 3] from FRD to NED, as :func:`pose_from_enu`."""
    north_m, east_m, down_m = position_ned
    return pose_from_enu(t_s, (east_m, north_m, -down_m), ENU_TO_NED.T.dot(attitude).dot(FLU_TO_FRD))
