# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of EKF3's sources for the page on the filter: values and sensors from the code, needs from here."""

from collections.abc import Iterator, Mapping
from typing import Final

from ekf_stub.ahrs.sources import (
    ALLOWED,
    BARO,
    BEACON,
    COMPASS,
    GPS,
    OPTICAL_FLOW,
    RANGEFINDER,
    WHEEL_ENCODER,
    SourceXY,
    SourceYaw,
    SourceZ,
)
from viso.doctor.checks import CHECKS

_CODES: Final = frozenset(check.code for check in CHECKS)
_NAMES: Final[Mapping[str, type[SourceXY] | type[SourceYaw] | type[SourceZ]]] = {
    "POSXY": SourceXY,
    "VELXY": SourceXY,
    "POSZ": SourceZ,
    "VELZ": SourceZ,
    "YAW": SourceYaw,
}
_MISSING: Final = {BEACON: "no", WHEEL_ENCODER: "no"}
_POSES: Final = "`VISO_TYPE` 1 to 3, and poses: ODOMETRY, VISION_POSITION_ESTIMATE and others"
_VELOCITIES: Final = "`VISO_TYPE` 1 to 3, and velocities: ODOMETRY, VISION_SPEED_ESTIMATE"
_FIXES: Final = "a GPS: `GPS1_TYPE`, a 3D fix"
_BAROMETER: Final = "a barometer"
_NEEDS: Final[Mapping[str | None, str]] = {
    None: "",
    BARO: _BAROMETER,
    BEACON: "beacons",
    COMPASS: "a compass, or a GPS that tells its yaw",
    GPS: _FIXES,
    OPTICAL_FLOW: "`FLOW_TYPE` (5: OPTICAL_FLOW) and `EK3_FLOW_USE` 1; a range finder for the distance to the ground",
    RANGEFINDER: "`RNGFND1_TYPE` (10: DISTANCE_SENSOR), `RNGFND1_ORIENT` 25, good ranges",
    WHEEL_ENCODER: "wheel encoders",
}
_ROW_NEEDS: Final[Mapping[tuple[str, int], str]] = {
    ("POSXY", SourceXY.NONE): "nothing: the place drifts, or follows the velocity",
    ("VELXY", SourceXY.NONE): "nothing: the velocity follows from positions",
    ("POSZ", SourceZ.NONE): "nothing: the height drifts",
    ("VELZ", SourceZ.NONE): "nothing: the vertical velocity follows from heights",
    ("YAW", SourceYaw.NONE): "VISION_POSITION_DELTA or flow alone: no position needs yaw then",
    ("POSXY", SourceXY.EXTNAV): _POSES,
    ("VELXY", SourceXY.EXTNAV): f"{_VELOCITIES}, beside poses",
    ("POSZ", SourceZ.EXTNAV): _POSES,
    ("VELZ", SourceZ.EXTNAV): f"{_VELOCITIES}, with `VELXY` 6 as well",
    ("YAW", SourceYaw.EXTNAV): _POSES,
    ("YAW", SourceYaw.COMPASS): "a compass: `COMPASS_ENABLE`, `COMPASS_USE`",
    ("YAW", SourceYaw.GPS): "a GPS that tells its yaw (GPS_INPUT with `yaw`)",
    ("YAW", SourceYaw.GSF): "a GPS's velocities, and motion: no compass",
}
_TOLD: Final[Mapping[tuple[str, int], tuple[str, ...]]] = {
    ("POSXY", SourceXY.EXTNAV): ("XN1-01", "XN7-01", "XN7-03"),
    ("VELXY", SourceXY.OPTFLOW): ("XNF-01", "XNF-12"),
    ("VELXY", SourceXY.EXTNAV): ("XN7-03", "XN7-10"),
    ("POSZ", SourceZ.RANGEFINDER): ("XNR-01", "XNR-03", "XNR-04"),
    ("POSZ", SourceZ.EXTNAV): ("XN7-03", "XN7-11"),
    ("VELZ", SourceZ.EXTNAV): ("XN7-03", "XN7-09"),
    ("YAW", SourceYaw.NONE): ("XN7-08",),
    ("YAW", SourceYaw.COMPASS): ("XN7-08",),
    ("YAW", SourceYaw.GPS_COMPASS_FALLBACK): ("XN7-08",),
    ("YAW", SourceYaw.EXTNAV): ("XN7-03",),
}


def rows() -> Iterator[tuple[str, ...]]:
    """Yield parameter, value, what it needs, the text of arming without it, whether it is here, and the doctor's codes.

    Raises KeyError if a code is of no check.
    """
    for what, allowed in ALLOWED.items():
        for value, sensor in allowed.items():
            key = what, value
            codes = _TOLD.get(key, ())
            if not _CODES.issuperset(codes):
                raise KeyError(f"{key}: {codes}")
            yield (
                f"`EK3_SRCn_{what}`",
                f"{int(value)} {_NAMES[what](value).name}",
                _ROW_NEEDS.get(key, _NEEDS.get(sensor, "")),
                f"`EK3 sources require {sensor}`" if sensor else "",
                _MISSING.get(sensor or "", "yes"),
                ", ".join(f"[{code}](doctor-codes.md#{code.lower()})" for code in codes),
            )
