# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the estimates are good enough for flight modes and arming (ArduCopter/system.cpp)."""

from collections.abc import Callable, Iterator

from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.reports import FilterFlag, FilterStatus


class Estimates:
    """What the vehicle makes of the flags and variances of its estimator.

    A stand-in for the estimator has no flags; of it, height and position count as good while it has a position.

    Args:
        ahrs: whose estimator it is.
        is_armed: says whether the vehicle is armed, which asks for more than a prediction.
        aids_relative_position: says whether visual odometry or optical flow is enabled.
        is_in_failsafe: says whether the estimator has failed so that no position counts.
    """

    def __init__(
        self,
        ahrs: AhrsBase,
        is_armed: Callable[[], bool],
        aids_relative_position: Callable[[], bool],
        is_in_failsafe: Callable[[], bool],
    ) -> None:
        self._ahrs = ahrs
        self._is_armed = is_armed
        self._aids_relative_position = aids_relative_position
        self._is_in_failsafe = is_in_failsafe

    def _stand_in_knows_position(self) -> bool:
        return self._ahrs.get_relative_position_NED_origin_float() is not None

    def attitude_ok(self) -> bool:
        """Return whether the attitude is valid (AP_Arming_Copter::pre_arm_ekf_attitude_check)."""
        status = self._ahrs.get_filter_status()
        return self._ahrs.estimator_started() if status is None else FilterFlag.ATTITUDE in status.flags

    def alt_ok(self) -> bool:
        """Return whether height and climb rate are known (Copter::ekf_alt_ok)."""
        status = self._ahrs.get_filter_status()
        if status is None:
            return self._stand_in_knows_position()
        return FilterFlag.VERT_POS | FilterFlag.VERT_VEL in status.flags

    def position_ok(self) -> bool:
        """Return whether there is a position and no failsafe of the estimator (Copter::position_ok)."""
        return not self._is_in_failsafe() and self.has_position()

    def has_position(self) -> bool:
        """Return whether the horizontal position is known, or while disarmed will be.

        Source: Copter::ekf_has_absolute_position, Copter::ekf_has_relative_position.
        """
        status = self._ahrs.get_filter_status()
        if status is None:
            return self._stand_in_knows_position()
        return self._has_absolute_position(status.flags) or self._has_relative_position(status.flags)

    def _has_absolute_position(self, flags: FilterFlag) -> bool:
        if not self._is_armed():
            return bool(flags & (FilterFlag.HORIZ_POS_ABS | FilterFlag.PRED_HORIZ_POS_ABS))
        return FilterFlag.CONST_POS_MODE not in flags and FilterFlag.HORIZ_POS_ABS in flags

    def _has_relative_position(self, flags: FilterFlag) -> bool:
        if not self._aids_relative_position():
            return False
        if not self._is_armed():
            return FilterFlag.PRED_HORIZ_POS_REL in flags
        return FilterFlag.CONST_POS_MODE not in flags and FilterFlag.HORIZ_POS_REL in flags

    def is_gps_glitching(self) -> bool:
        """Return whether the estimator disbelieves the GPS."""
        status = self._ahrs.get_filter_status()
        return status is not None and FilterFlag.GPS_GLITCHING in status.flags

    def failing_variance(self, threshold: float) -> str | None:
        """Return which variance is not below a threshold, or None; 0 switches that off."""
        status = self._ahrs.get_filter_status()
        if status is None or threshold <= 0:
            return None
        return next((name for name, value in _variances(status) if not value < threshold), None)


def _variances(status: FilterStatus) -> Iterator[tuple[str, float]]:
    # FIRMWARE PARITY: the firmware takes the length of the vector of which this is the largest component.
    yield "compass", status.compass_variance
    yield "position", status.pos_horiz_variance
    yield "velocity", status.velocity_variance
    yield "height", status.pos_vert_variance
