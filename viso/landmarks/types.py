# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera, poses, landmarks, detections and aircraft: frozen records, validated when made.

Every constructor raises ``ValueError`` naming the field. The world is ENU, the body FLU; pictures have u to the right
and v down. Yaw is 0 to the east and positive counter-clockwise.
"""

import math
import re
from collections import Counter
from dataclasses import Field, dataclass
from typing import Any, ClassVar, Final

import numpy as np
import numpy.typing as npt

from viso.geometry.pose import read_only
from viso.geometry.rotation import Array

M_PER_FT: Final = 0.3048
M_S_PER_KT: Final = 0.514444
M_S_PER_FT_MIN: Final = 0.3048 / 60
_ICAO: Final = re.compile(r"[0-9A-F]{6}")


class _Record:
    """A record whose numbers are finite."""

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if isinstance(value, int | float) and not math.isfinite(value):
                raise ValueError(f"{name}: {value}")


def _on_globe(latitude_deg: float, longitude_deg: float) -> None:
    if abs(latitude_deg) > 90:
        raise ValueError(f"latitude_deg: {latitude_deg}, not on the globe")
    if abs(longitude_deg) > 180:
        raise ValueError(f"longitude_deg: {longitude_deg}, not on the globe")


@dataclass(frozen=True, slots=True)
class Camera(_Record):
    """A pinhole camera on a vehicle, looking forward.

    Attributes:
        width_px, height_px: size of the picture.
        fx_px, fy_px: focal lengths.
        cx_px, cy_px: principal point.
        offset_forward_m, offset_left_m: where it is in the body; turns with the vehicle's yaw only.
        height_m: above the local ground.
        heading_offset_rad: of the mounting, added to the vehicle's yaw.
        yaw_trim_rad, pitch_trim_rad: corrections of the mounting; pitch is positive nose up.
    """

    width_px: int = 1280
    height_px: int = 1024
    fx_px: float = 1000.0
    fy_px: float = 1000.0
    cx_px: float = 640.0
    cy_px: float = 512.0
    offset_forward_m: float = 0.0
    offset_left_m: float = 0.0
    height_m: float = 1.2
    heading_offset_rad: float = 0.0
    yaw_trim_rad: float = 0.0
    pitch_trim_rad: float = 0.0

    def __post_init__(self) -> None:
        _Record.__post_init__(self)  # slots replace the class, so the short form of super() would not find it
        for field in ("width_px", "height_px", "fx_px", "fy_px"):
            if getattr(self, field) <= 0:
                raise ValueError(f"{field}: {getattr(self, field)}, not above 0")

    @property
    def hfov_rad(self) -> float:
        """Horizontal field of view."""
        return 2 * math.atan(self.width_px / (2 * self.fx_px))

    @property
    def vfov_rad(self) -> float:
        """Vertical field of view."""
        return 2 * math.atan(self.height_px / (2 * self.fy_px))


@dataclass(frozen=True, slots=True, eq=False)
class VehiclePose(_Record):
    """The pose of the vehicle.

    Attributes:
        t_s: time, of whatever clock the other records of the same stream use.
        x_m, y_m: east and north of the local origin.
        yaw_rad: ENU.
        z_m: up from the local ground; None if only the camera's height is known.
        world_R_body: [3, 3], the full attitude; None if only the yaw is known or used.
    """

    t_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    z_m: float | None = None
    world_R_body: Array | None = None

    def __post_init__(self) -> None:
        _Record.__post_init__(self)
        if self.world_R_body is not None:
            object.__setattr__(self, "world_R_body", read_only(self.world_R_body, (3, 3), "world_R_body"))


@dataclass(frozen=True, slots=True)
class Landmark(_Record):
    """A known point on the ground, east, north and up of the local origin; its id is text, also of a number."""

    id: str
    x_m: float
    y_m: float
    z_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Detection(_Record):
    """Where a landmark, or an aircraft by its ICAO address, was seen: right and down of the picture's corner."""

    id: str
    u_px: float
    v_px: float


@dataclass(frozen=True, slots=True)
class Detections(_Record):
    """The detections in the picture taken at ``t_s``, in the given order."""

    t_s: float
    landmarks: tuple[Detection, ...] = ()
    aircraft: tuple[Detection, ...] = ()


@dataclass(frozen=True, slots=True)
class AircraftReport(_Record):
    """An ADS-B report of an aircraft, in its units.

    Attributes:
        t_s: when its position was received.
        icao: address, 6 hexadecimal digits in upper case.
        latitude_deg, longitude_deg: WGS 84.
        altitude_ft: None if unknown.
        speed_kt: over ground.
        heading_deg: of the track, true, clockwise from north.
        vertical_rate_ft_min: positive up.
        is_baro: whether the altitude is pressure altitude (1013.25 hPa), otherwise above the ellipsoid.
    """

    t_s: float
    icao: str
    latitude_deg: float
    longitude_deg: float
    altitude_ft: float | None = None
    speed_kt: float = 0.0
    heading_deg: float = 0.0
    vertical_rate_ft_min: float = 0.0
    is_baro: bool = True

    def __post_init__(self) -> None:
        if not _ICAO.fullmatch(self.icao):
            raise ValueError(f"icao: {self.icao!r}, not 6 hexadecimal digits in upper case")
        _Record.__post_init__(self)
        _on_globe(self.latitude_deg, self.longitude_deg)


@dataclass(frozen=True, slots=True)
class GeodeticPoint(_Record):
    """A place on the globe, WGS 84; the enclosing record defines the reference of its height."""

    latitude_deg: float
    longitude_deg: float
    alt_m: float = 0.0

    def __post_init__(self) -> None:
        _Record.__post_init__(self)
        _on_globe(self.latitude_deg, self.longitude_deg)

    @property
    def is_fix(self) -> bool:
        """Whether this is a real place: receivers without a fix report (0, 0)."""
        return self.latitude_deg != 0 or self.longitude_deg != 0


@dataclass(frozen=True, slots=True, eq=False)
class AircraftState(_Record):
    """An aircraft relative to the vehicle.

    Attributes:
        report: its last report.
        east_m, north_m: from the vehicle.
        up_m: above the reference; None if the altitude is unknown.
        vel_enu: [3], m/s.
        quat_wxyz: [4], attitude FLU to ENU.
        turn_rate_rad_s: about up; None until two headings are known.
    """

    report: AircraftReport
    east_m: float
    north_m: float
    up_m: float | None
    vel_enu: npt.NDArray[np.float64]
    quat_wxyz: npt.NDArray[np.float64]
    turn_rate_rad_s: float | None = None

    def __post_init__(self) -> None:
        _Record.__post_init__(self)
        object.__setattr__(self, "vel_enu", read_only(self.vel_enu, (3,), "vel_enu"))
        object.__setattr__(self, "quat_wxyz", read_only(self.quat_wxyz, (4,), "quat_wxyz"))

    @property
    def range_m(self) -> float:
        """Horizontal distance from the vehicle."""
        return math.hypot(self.east_m, self.north_m)


@dataclass(frozen=True, slots=True)
class LandmarkMap(_Record):
    """All landmarks that are known from ``t_s`` on, each id once."""

    t_s: float
    landmarks: tuple[Landmark, ...]

    def __post_init__(self) -> None:
        _Record.__post_init__(self)
        counts = Counter(landmark.id for landmark in self.landmarks)
        twice = next((name for name, count in counts.items() if count > 1), None)
        if twice is not None:
            raise ValueError(f"landmarks: {twice!r} is there twice")


@dataclass(frozen=True, slots=True)
class GlobalFix(_Record):
    """The vehicle's place on the globe, above mean sea level, or above the ellipsoid if the source has only that."""

    t_s: float
    point: GeodeticPoint


@dataclass(frozen=True, slots=True)
class EstimatedPosition(_Record):
    """The estimated place of the ADS-B receiver, without a height."""

    t_s: float
    point: GeodeticPoint


@dataclass(frozen=True, slots=True)
class CameraInfo(_Record):
    """The intrinsics of a camera from its driver; an uncalibrated one has 0 for ``fx_px``."""

    t_s: float
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float


Event = VehiclePose | GlobalFix | EstimatedPosition | LandmarkMap | Detections | AircraftReport | CameraInfo
"""The events that inputs yield, in the order of arrival."""
