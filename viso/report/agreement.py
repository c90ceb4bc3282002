# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vision less EKF: both at the instant of a measurement.

Unlike the comparisons of `viso.compare`, nothing has to be equal here: the EKF is interpolated to the measurements, and
the report shows the differences over time.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from viso.estimators.series import Array, Mask, Series, wrapped_deg
from viso.geometry.rotation import rotations_from_euler
from viso.report.flight_data import Material, position_moves

BRIDGED_S: Final = 0.3
"""Between EKF records farther apart than this nothing is interpolated."""

DEFAULT_DELAY_MS: Final = 10.0
_WRAP_MS: Final = 2.0**32


@dataclass(frozen=True, slots=True)
class Poses:
    """Positions and attitudes, in the order of their times.

    Attributes:
        time_s: of the measurement, since boot [N].
        pos_ned: m from the EKF's origin [N, 3].
        rpy_deg: roll, pitch and yaw [N, 3].
        vel_ned: m/s [N, 3]; NaN where unknown.
    """

    time_s: Array
    pos_ned: Array
    rpy_deg: Array
    vel_ned: Array

    def where(self, chosen: Mask | npt.NDArray[np.intp]) -> "Poses":
        """Return those that a mask, or their numbers, select."""
        return Poses(self.time_s[chosen], self.pos_ned[chosen], self.rpy_deg[chosen], self.vel_ned[chosen])


def lag_ms(series: Series) -> Array:
    """Return how long before its record each measurement was sent by the autopilot's clock (CTimeMS), in ms."""
    lag = series.time_s * 1e3 - series["CTimeMS"]
    return (lag + _WRAP_MS / 2) % _WRAP_MS - _WRAP_MS / 2


def remote_lag_ms(series: Series) -> Array:
    """Return the same by the sender's clock (RTimeUS), in ms, more than at its smallest: the offset is unknown."""
    lag = series.time_s * 1e3 - series["RTimeUS"] * 1e-3
    known = np.isfinite(lag)
    return lag - lag[known].min() if known.any() else lag


def observed_s(series: Series, delay_ms: float) -> Array:
    """Return when each measurement was taken, as the EKF counts: VISO_DELAY_MS before CTimeMS, in s since boot."""
    return series.time_s - (lag_ms(series) + delay_ms) * 1e-3


def delay_ms_of(material: Material) -> float:
    """Return VISO_DELAY_MS of a log; its default if the log does not say."""
    known = material.parameter("VISO_DELAY_MS")
    return DEFAULT_DELAY_MS if known is None else known


def vision_poses(material: Material) -> Poses:
    """Return the poses of vision at the times of observation, with velocities of the same message if there are any."""
    visp, visv = material.visp, material.visv
    vel = np.full((len(visp), 3), np.nan)
    if len(visv):
        nearest = np.minimum(np.searchsorted(visv.time_s, visp.time_s), len(visv) - 1)
        same = visv.time_s[nearest] == visp.time_s
        vel[same] = visv.matrix("VX", "VY", "VZ")[nearest[same]]
    time_s = observed_s(visp, delay_ms_of(material))
    return Poses(time_s, visp.matrix("PX", "PY", "PZ"), visp.matrix("R", "P", "Y"), vel)


def ekf_poses(material: Material) -> Poses:
    """Return the poses of the EKF."""
    xkf1 = material.xkf1
    return Poses(
        xkf1.time_s, xkf1.matrix("PN", "PE", "PD"), xkf1.matrix("Roll", "Pitch", "Yaw"), xkf1.matrix("VN", "VE", "VD")
    )


def interpolated(poses: Poses, at_s: Array, moves_s: Array) -> Poses:
    """Return poses at other times, between neighbours no more than BRIDGED_S apart and over no jump; NaN elsewhere."""
    if len(poses.time_s) < 2:
        nothing = np.full((len(at_s), 3), np.nan)
        return Poses(at_s, nothing, nothing, nothing)
    after = np.clip(np.searchsorted(poses.time_s, at_s), 1, len(poses.time_s) - 1)
    gap_s = poses.time_s[after] - poses.time_s[after - 1]
    share = (at_s - poses.time_s[after - 1]) / np.where(gap_s > 0, gap_s, np.nan)
    jumped = np.searchsorted(moves_s, poses.time_s[after], "right") > np.searchsorted(
        moves_s, poses.time_s[after - 1], "right"
    )
    outside = ~((share >= 0) & (share <= 1) & (gap_s <= BRIDGED_S)) | jumped
    share = np.where(outside, np.nan, share)[:, np.newaxis]

    def between(values: Array) -> Array:
        return values[after - 1] + share * (values[after] - values[after - 1])

    before_deg = poses.rpy_deg[after - 1]
    rpy_deg = before_deg + share * wrapped_deg(poses.rpy_deg[after] - before_deg)
    return Poses(at_s, between(poses.pos_ned), rpy_deg, between(poses.vel_ned))


@dataclass(frozen=True, slots=True)
class VisionLessEkf:
    """How far vision is from the EKF at the same instants, both of where the camera is.

    Attributes:
        time_s: of the poses [N].
        pos_ned: m [N, 3]; NaN where the EKF has no record nearby.
        yaw_deg: -180 to 180 [N].
        vel_time_s: of the velocities [M].
        vel_ned: m/s [M, 3].
    """

    time_s: Array
    pos_ned: Array
    yaw_deg: Array
    vel_time_s: Array
    vel_ned: Array


def _camera_frd(material: Material) -> Array:
    """Return where the camera is on the vehicle (VISO_POS), m."""
    return np.array([material.parameter(f"VISO_POS_{axis}") or 0.0 for axis in "XYZ"])


def vision_less_ekf(material: Material) -> VisionLessEkf:
    """Return how far vision is from the EKF, withheld samples included."""
    ekf, vision = ekf_poses(material), vision_poses(material)
    moves_s, _ = position_moves(material.xkf4)
    at_poses = interpolated(ekf, vision.time_s, moves_s)
    visv = material.visv
    vel_time_s = observed_s(visv, delay_ms_of(material))
    return VisionLessEkf(
        time_s=vision.time_s,
        pos_ned=vision.pos_ned
        - at_poses.pos_ned
        - rotations_from_euler(np.radians(at_poses.rpy_deg)) @ _camera_frd(material),
        yaw_deg=wrapped_deg(vision.rpy_deg[:, 2] - at_poses.rpy_deg[:, 2]),
        vel_time_s=vel_time_s,
        vel_ned=visv.matrix("VX", "VY", "VZ") - interpolated(ekf, vel_time_s, moves_s).vel_ned,
    )
