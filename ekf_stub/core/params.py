# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of the filter, and its source sets, as numbers that are read again when one has changed.

Source: AP_NavEKF3/AP_NavEKF3.cpp (var_info), AP_NavEKF/AP_NavEKF_Source.cpp.
"""

from collections.abc import Callable
from typing import Final, final

from ekf_stub.release import FilterRelease

# EK3_SRCn_POSXY, VELXY, POSZ, VELZ and YAW
NONE: Final = 0
BARO: Final = 1  # of POSZ
COMPASS: Final = 1  # of YAW
RANGEFINDER: Final = 2  # of POSZ
GPS_YAW: Final = 2  # of YAW
GPS: Final = 3
GPS_COMPASS_FALLBACK: Final = 3  # of YAW
BEACON: Final = 4
OPTFLOW: Final = 5
EXTNAV: Final = 6
GSF: Final = 8  # of YAW

_SETS: Final = 3
FUSE_ALL_VELOCITIES: Final = 1 << 0  # of EK3_SRC_OPTIONS
ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW: Final = 1 << 1
SET_PER_CORE: Final = 1 << 3


@final
class Params:
    """The parameters, each called what follows ``EK3_`` in its name, with the firmware's units.

    FLOW_MAX is called MAX_FLOW by releases before 2026.
    """

    ABIAS_P_NSE: float = 0.0
    ACC_BIAS_LIM: float = 0.0
    ACC_P_NSE: float = 0.0
    AFFINITY: float = 0.0
    ALT_M_NSE: float = 0.0
    CHECK_SCALE: float = 0.0
    ERR_THRESH: float = 0.0
    FLOW_DELAY: float = 0.0
    FLOW_I_GATE: float = 0.0
    FLOW_MAX: float = 0.0
    FLOW_M_NSE: float = 0.0
    FLOW_USE: float = 0.0
    GBIAS_P_NSE: float = 0.0
    GLITCH_RAD: float = 0.0
    GPS_CHECK: float = 0.0
    GPS_VACC_MAX: float = 0.0
    GSF_RST_MAX: float = 0.0
    GSF_RUN_MASK: float = 0.0
    GSF_USE_MASK: float = 0.0
    GYRO_P_NSE: float = 0.0
    HGT_DELAY: float = 0.0
    HGT_I_GATE: float = 0.0
    HRT_FILT: float = 0.0
    MAGB_P_NSE: float = 0.0
    MAGE_P_NSE: float = 0.0
    MAG_CAL: float = 0.0
    MAG_EF_LIM: float = 0.0
    MAG_I_GATE: float = 0.0
    MAG_M_NSE: float = 0.0
    NOAID_M_NSE: float = 0.0
    OGNM_TEST_SF: float = 0.0
    OGN_HGT_MASK: float = 0.0
    OPTIONS: float = 0.0
    POSNE_M_NSE: float = 0.0
    POS_I_GATE: float = 0.0
    PRIMARY: float = 0.0
    RNG_I_GATE: float = 0.0
    RNG_M_NSE: float = 0.0
    RNG_USE_HGT: float = 0.0
    RNG_USE_SPD: float = 0.0
    TAU_OUTPUT: float = 0.0
    TERR_GRAD: float = 0.0
    VELD_M_NSE: float = 0.0
    VELNE_M_NSE: float = 0.0
    VEL_I_GATE: float = 0.0
    VIS_VERR_MAX: float = 0.0
    VIS_VERR_MIN: float = 0.0
    YAW_I_GATE: float = 0.0
    YAW_M_NSE: float = 0.0

    def read(self, get_float: Callable[[str], float]) -> None:
        """Read all of them; ``get_float`` takes a name without ``EK3_``."""
        for name in PARAM_NAMES:
            setattr(self, name, get_float(name))


PARAM_NAMES: Final = tuple(name for name in dir(Params()) if name.isupper())


def gate(percent: float) -> float:
    """Return the square of a gate in sigmas, of which the parameter has hundredths, at least 1."""
    sigmas = 0.01 * percent
    return sigmas * sigmas if sigmas > 1.0 else 1.0


@final
class SourceSet:
    """One source set: a sensor's number for each row."""

    def __init__(self, pos_xy: int, vel_xy: int, pos_z: int, vel_z: int, yaw: int) -> None:
        self.pos_xy = pos_xy
        self.vel_xy = vel_xy
        self.pos_z = pos_z
        self.vel_z = vel_z
        self.yaw = yaw

    def row(self, what: str) -> int:
        """Return a row by what follows ``EK3_SRCn_`` in its name, such as ``POSXY``."""
        return int(getattr(self, _ATTRIBUTES[what]))

    def names(self, sensor: int) -> bool:
        """Return whether any row has a sensor's number."""
        return self.pos_xy == sensor or self.vel_xy == sensor or self.pos_z == sensor or self.vel_z == sensor


_ATTRIBUTES: Final = {"POSXY": "pos_xy", "VELXY": "vel_xy", "POSZ": "pos_z", "VELZ": "vel_z", "YAW": "yaw"}


@final
class _Sets:
    """The source sets, the options, and which set is active: the same for all cores."""

    def __init__(self, get_int: Callable[[str], int]) -> None:
        self._get_int = get_int
        self.is_read = False
        self.sets: list[SourceSet] = []
        self.options = 0
        self.active = 0

    def read(self) -> None:
        get = self._get_int
        self.sets = [
            SourceSet(
                get(f"SRC{number}_POSXY"),
                get(f"SRC{number}_VELXY"),
                get(f"SRC{number}_POSZ"),
                get(f"SRC{number}_VELZ"),
                get(f"SRC{number}_YAW"),
            )
            for number in range(1, _SETS + 1)
        ]
        self.options = get("SRC_OPTIONS")
        self.is_read = True


@final
class EkfSources:
    """The three source sets and which one is active (AP_NavEKF_Source).

    Args:
        get_int: returns a parameter by its name after ``EK3_``, such as ``SRC1_POSXY``.
    """

    def __init__(self, get_int: Callable[[str], int]) -> None:
        self._all = _Sets(get_int)
        self._get_int = get_int
        self._core = _SETS  # of whom no set can be

    def of_core(self, core: int, release: FilterRelease) -> "EkfSources":
        """Return the sources of a core: with EK3_SRC_OPTIONS each of the first three has the set of its number."""
        if release.shares_source_set:
            return self
        own = EkfSources(self._get_int)
        own._all, own._core = self._all, core
        return own

    @property
    def active_set(self) -> int:
        """The set that was chosen, 0..2."""
        return self._all.active

    @active_set.setter
    def active_set(self, index: int) -> None:
        self._all.active = index

    def forget(self) -> None:
        """Read all parameters again when one is asked for next, as one of them may have changed."""
        self._all.is_read = False

    def sets(self) -> list[SourceSet]:
        """Return the source sets."""
        if not self._all.is_read:
            self._all.read()
        return self._all.sets

    def active(self) -> SourceSet:
        """Return the active source set."""
        sets = self.sets()
        has_own = self._core < _SETS and self._all.options & SET_PER_CORE != 0
        return sets[self._core if has_own else self._all.active]

    def value(self, index: int, what: str) -> int:
        """Return a row of a set, such as ``POSXY`` of set 0..2."""
        return self.sets()[index].row(what)

    def pos_xy(self) -> int:
        """Return the active source of horizontal position."""
        return self.active().pos_xy

    def pos_z(self) -> int:
        """Return the active source of height."""
        return self.active().pos_z

    def yaw(self) -> int:
        """Return the active source of yaw."""
        return self.active().yaw

    def _fuses_all_velocities(self) -> bool:
        return self._all.options & FUSE_ALL_VELOCITIES != 0

    def uses_vel_xy(self, source: int) -> bool:
        """Return whether horizontal velocity is taken from a source (useVelXYSource)."""
        if self.active().vel_xy == source:
            return True
        if not self._fuses_all_velocities():
            return False
        for one in self._all.sets:
            if one.vel_xy == source:
                return True
        return False

    def uses_vel_z(self, source: int) -> bool:
        """Return whether vertical velocity is taken from a source (useVelZSource)."""
        if self.active().vel_z == source:
            return True
        if not self._fuses_all_velocities():
            return False
        for one in self._all.sets:
            if one.vel_z == source:
                return True
        return False

    def has_vel_z(self) -> bool:
        """Return whether there is any source of vertical velocity (haveVelZSource)."""
        if self.active().vel_z != NONE:
            return True
        if not self._fuses_all_velocities():
            return False
        for one in self._all.sets:
            if one.vel_z != NONE:
                return True
        return False

    def ext_nav_enabled(self) -> bool:
        """Return whether any set names external navigation for anything."""
        for one in self.sets():
            if one.names(EXTNAV) or one.yaw == EXTNAV:
                return True
        return False

    def uses_gps(self) -> bool:
        """Return whether the active set takes anything from GPS; its yaw alone does not count (usingGPS)."""
        return self.active().names(GPS) or self.active().yaw == GSF

    def position_alignment(self, release: FilterRelease) -> tuple[bool, bool]:
        """Return whether external navigation is to be aligned in x and y, and in z, as no core uses it.

        Source: NavEKF3::align_inactive_sources.
        """
        xy_is_allowed, z_is_allowed, xy_has, z_has = True, True, False, False
        for core in range(_SETS):
            one = self.of_core(core, release).active()
            by_flow = one.vel_xy == OPTFLOW and self._all.options & ALIGN_EXTNAV_POS_WHEN_USING_OPTFLOW != 0
            by_flow = by_flow and (release.aligns_source_in_use or one.pos_xy != EXTNAV)
            xy_is_allowed = xy_is_allowed and (one.pos_xy == GPS or one.pos_xy == BEACON or by_flow)
            z_is_allowed = z_is_allowed and one.pos_z in (BARO, RANGEFINDER, GPS, BEACON)
        for one in self._all.sets:
            xy_has = xy_has or one.pos_xy == EXTNAV
            z_has = z_has or one.pos_z == EXTNAV
        return xy_is_allowed and xy_has, z_is_allowed and z_has
