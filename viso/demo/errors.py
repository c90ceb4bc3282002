# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the companion's odometry and the autopilot's estimate are from the truth, in a closed loop."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from viso.demo.loop import LoopSetup
from viso.demo.record import Arrived, Estimate
from viso.geometry.rotation import Array, euler_from_rotations, rotations_from_quats
from viso.vehicle.sensors.world_flight import WorldFlight

IN_FLIGHT_M: Final = 1.0
"""Height above where it stood from which a vehicle counts as flying."""

_POSITION: Final = [0, 6, 11]  # the diagonal of a covariance in a message


@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Poses against the truth, at N times; the frame is NED from where the vehicle stood.

    Attributes:
        t_s: [N], since the autopilot's boot.
        pos_ned: [N, 3] in m.
        true_ned: [N, 3] in m.
        sigmas_m: [N, 3], as stated.
        tilt_rad: [N], the angle between the verticals.
        yaw_rad: [N], by how much the heading is too large.
    """

    t_s: Array
    pos_ned: Array
    true_ned: Array
    sigmas_m: Array
    tilt_rad: Array
    yaw_rad: Array

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def errors_ned(self) -> Array:
        """How far positions are off, [N, 3] in m."""
        return self.pos_ned - self.true_ned

    @property
    def horizontal_m(self) -> Array:
        """How far positions are off horizontally, [N]."""
        distances: Array = np.hypot(*self.errors_ned[:, :2].T)
        return distances

    def chosen(self, which: npt.NDArray[np.bool_]) -> "PoseErrors":
        """Return some of them."""
        return PoseErrors(*(getattr(self, name)[which] for name in self.__slots__))

    def in_flight(self) -> "PoseErrors":
        """Return those at whose time the vehicle is in the air."""
        return self.chosen(-self.true_ned[:, 2] > IN_FLIGHT_M)


def odometry_errors(setup: LoopSetup, arrived: Sequence[Arrived]) -> PoseErrors:
    """Return the errors of the poses that are no repetition of a lost one, at the times that they are for."""
    messages = [one.message for one in arrived if one.message.quality > 0]
    covariances = np.array([message.pose_covariance for message in messages]).reshape(-1, 21)
    return _against_truth(
        setup,
        [setup.boot_time_us(message.time_usec) for message in messages],
        [(message.x, message.y, message.z) for message in messages],
        np.sqrt(covariances[:, _POSITION]),
        [message.q for message in messages],
    )


def estimate_errors(setup: LoopSetup, estimates: Sequence[Estimate]) -> PoseErrors:
    """Return the errors of the autopilot's estimates, as long as it navigates."""
    known = [one for one in estimates if None not in (one.pos_ned, one.sigmas_m, one.quat_wxyz)]
    return _against_truth(
        setup,
        [one.time_us for one in known],
        [one.pos_ned for one in known],
        np.array([one.sigmas_m for one in known]).reshape(-1, 3),
        [one.quat_wxyz for one in known],
    )


def truth(setup: LoopSetup, t_s: Array) -> tuple[Array, Array]:
    """Return positions [N, 3] in m and attitudes [N, 3, 3], body to NED, at times [N] in s since boot."""
    flown_s = np.maximum(t_s - setup.companion_us * 1e-6, 0.0)
    pos_ned, _, rotation = WorldFlight(setup.flight.trajectory).at(flown_s)
    return pos_ned, rotation


def _against_truth(
    setup: LoopSetup, time_us: Sequence[int], pos_ned: Sequence[Any], sigmas_m: Array, quats_wxyz: Sequence[Any]
) -> PoseErrors:
    t_s = np.array(time_us, np.float64) * 1e-6
    true_ned, true_rotation = truth(setup, t_s)
    rotation = rotations_from_quats(np.array(quats_wxyz).reshape(-1, 4))
    across = np.cross(rotation[:, 2], true_rotation[:, 2])  # of where each has down in the body
    turned = euler_from_rotations(rotation)[:, 2] - euler_from_rotations(true_rotation)[:, 2]
    return PoseErrors(
        t_s=t_s,
        pos_ned=np.array(pos_ned, np.float64).reshape(-1, 3),
        true_ned=true_ned,
        sigmas_m=sigmas_m,
        tilt_rad=np.arcsin(np.minimum(np.linalg.norm(across, axis=1), 1.0)),
        yaw_rad=np.remainder(turned + np.pi, 2 * np.pi) - np.pi,
    )
