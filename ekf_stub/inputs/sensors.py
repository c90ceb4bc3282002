# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the estimator is given by sensors, and who gives it."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import Array, BaroReading, GpsSample, ImuReading, InertialDelta
from ekf_stub.reports import Three


@dataclass(frozen=True, slots=True)
class Sensors:
    """The data of the sensors in a pass of the main loop; None for a sensor that is missing.

    Attributes:
        delta: inertial data since the last pass; exact in single precision, as the firmware's and a log's are.
            All IMUs have these data, unless ``imus`` has others.
        baro: time of the last reading in ms since boot, and height in m; exact in single precision. All barometers
            have it, unless ``baros`` has others.
        mag: time of the last reading in us since boot, and the field in mGauss, body (FRD).
        declination: of the magnetic field, rad.
        baros: the reading of each of several barometers that differ, and whether it works; ``baro`` is that of the
            first that does.
        imus: the data of each of several IMUs that differ, the first one's ``delta``; from the first pass on, or never.
    """

    delta: InertialDelta
    baro: tuple[int, float] | None = None
    mag: tuple[int, Array] | None = None
    declination: float = 0.0
    imus: tuple[ImuReading, ...] = ()
    baros: tuple[BaroReading, ...] = ()


_NOTHING_AHEAD: Final[Array] = np.zeros((0, 8))


class SensorSource:
    """Where inertial data, height and magnetic field come from; this one has no sensors.

    Attributes:
        has_recorded_heights: its barometer was set to zero as the recorded vehicle did so; it is not to be set again.
        follows_poses: it follows the poses of external navigation (``take_pose``).
    """

    has_recorded_heights = False
    follows_poses = False

    def sense(self, now_us: int) -> Sensors | None:
        """Return the data at a time since boot, or None while there are no new inertial data.

        Called once a pass of the main loop, with times that grow. Without data the filter skips the frame.
        """
        return None

    def ahead(self, times_us: range) -> Array:
        """Return the inertial data of the next passes, as far as they are sound and nothing else changes.

        Args:
            times_us: of the passes.

        Returns:
            Shape (n, 8), n up to their number: a pass's ``del_vel``, ``del_ang``, ``del_vel_dt`` and ``del_ang_dt``.
            Of IMUs that differ, one after the other in each row.
        """
        return _NOTHING_AHEAD

    def pass_over(self, times_us: range) -> None:
        """Skip passes that got the data of ``ahead``."""

    def set_armed(self, armed: bool) -> None:
        """Set whether the vehicle is armed; called before each pass."""

    def stand_at(self, origin: Location) -> None:
        """Take the filter's origin, once it has one: the place whose magnetic field the compass is to measure."""

    def is_at_rest(self, until_us: int) -> bool:
        """Return whether the vehicle stands still until a time since boot, as far as is known now.

        If so, passes of the main loop may be left out until then.
        """
        return True

    def yaw_rad(self) -> float:
        """Return the true heading as far as the source knows it, rad; what a simple estimate (DCM) starts from."""
        return 0.0

    def truth(self, now_us: int) -> tuple[Three, Three, tuple[float, float, float, float]] | None:
        """Return where the vehicle really is at a time since boot; None if the source does not know.

        The place is in m from where it stood at first, the velocity in m/s, both NED; the attitude is body to earth.
        """
        return None

    def gps(self) -> GpsSample | None:
        """Return the newest solution of a GPS of the source's own; None without one."""
        return None

    def expected(self) -> tuple[bool, bool] | None:
        """Return whether a take-off and whether a touchdown is expected; None if the vehicle is to find out."""
        return None

    def take_pose(self, pos_ned: Vector3f, quat: Quaternion, observed_ms: int, is_reset: bool) -> None:
        """Take a pose of external navigation.

        Args:
            pos_ned: the IMU's place, m.
            quat: the attitude, body (FRD) to earth.
            observed_ms: when it was observed, since boot.
            is_reset: whether it may have jumped.
        """
