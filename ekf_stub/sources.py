# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which sensor feeds what, by the EK3_SRCn parameters (AP_NavEKF/AP_NavEKF_Source.cpp)."""

from collections.abc import Callable
from enum import IntEnum
from typing import Final

SETS: Final = 3
OPTION_FUSE_ALL_VELOCITIES: Final = 1 << 0
OPTION_ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW: Final = 1 << 1


class SourceXY(IntEnum):
    """EK3_SRCn_POSXY and EK3_SRCn_VELXY."""

    NONE = 0
    GPS = 3
    BEACON = 4
    OPTFLOW = 5
    EXTNAV = 6
    WHEEL_ENCODER = 7


class SourceZ(IntEnum):
    """EK3_SRCn_POSZ and EK3_SRCn_VELZ."""

    NONE = 0
    BARO = 1
    RANGEFINDER = 2
    GPS = 3
    BEACON = 4
    EXTNAV = 6


class SourceYaw(IntEnum):
    """EK3_SRCn_YAW."""

    NONE = 0
    COMPASS = 1
    GPS = 2
    GPS_COMPASS_FALLBACK = 3
    EXTNAV = 6
    GSF = 8


ROWS: Final = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")
_NAMES: Final = tuple({what: f"SRC{number}_{what}" for what in ROWS} for number in range(1, SETS + 1))
EXTNAV: Final = 6  # in every row


class EkfSources:
    """The three source sets and which one is active.

    Args:
        get_param: returns an integer parameter by its name after ``EK3_``, such as ``SRC1_POSXY``.
        generation: returns another number whenever a parameter may have changed, until when each is asked for once;
            None when nobody knows.
    """

    def __init__(self, get_param: Callable[[str], int], generation: Callable[[], int] | None = None) -> None:
        self._get_param = get_param
        self._generation = generation
        self._seen: int | None = None
        self._known: dict[str, int] = {}
        self._alignments: dict[int, tuple[bool, bool]] = {}
        self.active_set = 0

    def _forget_changed(self) -> None:
        generation = None if self._generation is None else self._generation()
        if generation is None or generation != self._seen:
            self._seen = generation
            self._known.clear()
            self._alignments.clear()

    def _param(self, name: str) -> int:
        self._forget_changed()
        value = self._known.get(name)
        if value is None:
            value = self._known[name] = self._get_param(name)
        return value

    def value(self, index: int, what: str) -> int:
        """Return a row of a set, such as ``POSXY`` of set 0..2."""
        name = _NAMES[index][what]
        if self._generation is not None and self._generation() == self._seen:
            value = self._known.get(name)
            if value is not None:
                return value
        return self._param(name)

    def pos_xy(self) -> int:
        """Return the active source of horizontal position."""
        return self.value(self.active_set, "POSXY")

    def pos_z(self) -> int:
        """Return the active source of height."""
        return self.value(self.active_set, "POSZ")

    def yaw(self) -> int:
        """Return the active yaw source."""
        return self.value(self.active_set, "YAW")

    def uses_vel_xy(self, source: SourceXY) -> bool:
        """Tell whether horizontal velocity is taken from a source (useVelXYSource)."""
        return self._uses_velocity("VELXY", source)

    def uses_vel_z(self, source: SourceZ) -> bool:
        """Tell whether vertical velocity is taken from a source (useVelZSource)."""
        return self._uses_velocity("VELZ", source)

    def _uses_velocity(self, what: str, source: int) -> bool:
        if self.value(self.active_set, what) == source:
            return True
        fuse_all = self._param("SRC_OPTIONS") & OPTION_FUSE_ALL_VELOCITIES != 0
        return fuse_all and self._any_set_has(what, source)

    def ext_nav_enabled(self) -> bool:
        """Tell whether any set names external navigation for anything."""
        return any(self._any_set_has(what, EXTNAV) for what in ROWS)

    def uses_gps(self) -> bool:
        """Tell whether the active set takes anything from GPS; its yaw alone does not count (usingGPS)."""
        rows = (self.value(self.active_set, what) for what in ROWS[:-1])
        return SourceXY.GPS in rows or self.yaw() == SourceYaw.GSF

    def _any_set_has(self, what: str, value: int) -> bool:
        return any(self.value(index, what) == value for index in range(SETS))

    def position_alignment(self) -> tuple[bool, bool]:
        """Return whether external navigation is to be aligned in x and y, and in z, as it is not in use.

        All cores use the active set.
        Source: NavEKF3::align_inactive_sources.
        """
        self._forget_changed()
        alignment = self._alignments.get(self.active_set)
        if alignment is None:  # it is asked for in every frame, and seldom changes
            alignment = self._alignments[self.active_set] = self._work_out_alignment()
        return alignment

    def _work_out_alignment(self) -> tuple[bool, bool]:
        xy, z = self.value(self.active_set, "POSXY"), self.value(self.active_set, "POSZ")
        by_flow = (
            self.value(self.active_set, "VELXY") == SourceXY.OPTFLOW
            and self._param("SRC_OPTIONS") & OPTION_ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW != 0
        )
        xy_allowed = xy in (SourceXY.GPS, SourceXY.BEACON) or (by_flow and xy != SourceXY.EXTNAV)
        z_allowed = z in (SourceZ.BARO, SourceZ.RANGEFINDER, SourceZ.GPS, SourceZ.BEACON)
        return (
            xy_allowed and self._any_set_has("POSXY", SourceXY.EXTNAV),
            z_allowed and self._any_set_has("POSZ", SourceZ.EXTNAV),
        )
