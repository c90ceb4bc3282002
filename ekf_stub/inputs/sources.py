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


# In Python 3.11 it takes 0.1 us to look up a member of an enumeration.
XY_NONE, XY_GPS, XY_OPTFLOW, XY_EXTNAV = SourceXY.NONE, SourceXY.GPS, SourceXY.OPTFLOW, SourceXY.EXTNAV
Z_NONE, Z_BARO, Z_RANGE, Z_GPS, Z_EXTNAV = SourceZ.NONE, SourceZ.BARO, SourceZ.RANGEFINDER, SourceZ.GPS, SourceZ.EXTNAV
YAW_NONE, YAW_COMPASS, YAW_GPS = SourceYaw.NONE, SourceYaw.COMPASS, SourceYaw.GPS
YAW_EXTNAV, YAW_GSF = SourceYaw.EXTNAV, SourceYaw.GSF

ROWS: Final = ("POSXY", "VELXY", "POSZ", "VELZ", "YAW")
_NAMES: Final[tuple[dict[str, str], ...]] = (
    *({what: f"SRC{number}_{what}" for what in ROWS} for number in range(1, SETS + 1)),
    {"OPTIONS": "SRC_OPTIONS"},  # of all sets
)
EXTNAV: Final = 6  # in every row


class _Rows(dict[int, dict[str, int]]):
    """What sets say, by their index; it fills itself, since to ask a dictionary is the fastest way to ask."""

    def __init__(self, read: Callable[[int], dict[str, int]]) -> None:
        super().__init__()
        self._read = read

    def __missing__(self, index: int) -> dict[str, int]:
        return self._read(index)


class EkfSources:
    """The three source sets and which one is active.

    Args:
        get_param: returns an integer parameter by its name after ``EK3_``, such as ``SRC1_POSXY``.
        on_change: is given what to call whenever a parameter may have changed, until when each is asked for once;
            None when nobody knows.
    """

    def __init__(
        self, get_param: Callable[[str], int], on_change: Callable[[Callable[[], None]], None] | None = None
    ) -> None:
        self._get_param = get_param
        self._keeps = on_change is not None
        self._rows = _Rows(self._read_row)
        self._alignments: dict[int, tuple[bool, bool]] = {}
        self.active_set = 0
        if on_change is not None:
            on_change(self._forget)

    def _forget(self) -> None:
        self._rows.clear()
        self._alignments.clear()

    def _read_row(self, index: int) -> dict[str, int]:
        row = {what: self._get_param(name) for what, name in _NAMES[index].items()}
        if self._keeps:
            self._rows[index] = row
        return row

    def value(self, index: int, what: str) -> int:
        """Return a row of a set, such as ``POSXY`` of set 0..2."""
        return self._rows[index][what]

    def _options(self) -> int:
        return self._rows[SETS]["OPTIONS"]

    def active(self) -> dict[str, int]:
        """Return the active set by row: the same object until a parameter or the active set changes, if it is told."""
        return self._rows[self.active_set]

    def pos_xy(self) -> int:
        """Return the active source of horizontal position."""
        return self._rows[self.active_set]["POSXY"]

    def pos_z(self) -> int:
        """Return the active source of height."""
        return self._rows[self.active_set]["POSZ"]

    def yaw(self) -> int:
        """Return the active yaw source."""
        return self._rows[self.active_set]["YAW"]

    def uses_vel_xy(self, source: SourceXY) -> bool:
        """Return whether horizontal velocity is taken from a source (useVelXYSource)."""
        return self._uses_velocity("VELXY", source)

    def uses_vel_z(self, source: SourceZ) -> bool:
        """Return whether vertical velocity is taken from a source (useVelZSource)."""
        return self._uses_velocity("VELZ", source)

    def _uses_velocity(self, what: str, source: int) -> bool:
        if self._rows[self.active_set][what] == source:
            return True
        fuse_all = self._options() & OPTION_FUSE_ALL_VELOCITIES != 0
        return fuse_all and self._any_set_has(what, source)

    def ext_nav_enabled(self) -> bool:
        """Return whether any set names external navigation for anything."""
        return any(self._any_set_has(what, EXTNAV) for what in ROWS)

    def uses_gps(self) -> bool:
        """Return whether the active set takes anything from GPS; its yaw alone does not count (usingGPS)."""
        rows = (self.value(self.active_set, what) for what in ROWS[:-1])
        return SourceXY.GPS in rows or self.yaw() == SourceYaw.GSF

    def _any_set_has(self, what: str, value: int) -> bool:
        return any(self.value(index, what) == value for index in range(SETS))

    def position_alignment(self) -> tuple[bool, bool]:
        """Return whether external navigation is to be aligned in x and y, and in z, as it is not in use.

        All cores use the active set.
        Source: NavEKF3::align_inactive_sources.
        """
        alignment = self._alignments.get(self.active_set)
        if alignment is None:  # it is asked for in every frame, and seldom changes
            alignment = self._work_out_alignment()
            if self._keeps:
                self._alignments[self.active_set] = alignment
        return alignment

    def _work_out_alignment(self) -> tuple[bool, bool]:
        xy, z = self.value(self.active_set, "POSXY"), self.value(self.active_set, "POSZ")
        by_flow = (
            self.value(self.active_set, "VELXY") == SourceXY.OPTFLOW
            and self._options() & OPTION_ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW != 0
        )
        xy_allowed = xy in (SourceXY.GPS, SourceXY.BEACON) or (by_flow and xy != SourceXY.EXTNAV)
        z_allowed = z in (SourceZ.BARO, SourceZ.RANGEFINDER, SourceZ.GPS, SourceZ.BEACON)
        return (
            xy_allowed and self._any_set_has("POSXY", SourceXY.EXTNAV),
            z_allowed and self._any_set_has("POSZ", SourceZ.EXTNAV),
        )
