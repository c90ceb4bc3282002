# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which estimator AHRS_EKF_TYPE chooses (AP_AHRS/AP_AHRS.cpp: init, configured_ekf_type, _active_EKF_type).

FIRMWARE PARITY: as in the simulator, EKF2 is built in and never enabled. A flight controller without EKF2 takes EKF3 in
its place, also for 0 and for numbers that are none.
"""

from enum import IntEnum
from typing import Final

from ekf_stub.reports import FilterFlag, FilterStatus


class Estimator(IntEnum):
    """An estimator of attitude and position, by its number in AHRS_EKF_TYPE."""

    DCM = 0
    EKF2 = 2
    EKF3 = 3
    SIM = 10
    EXTERNAL = 11

    @property
    def title(self) -> str:
        """The name in texts."""
        return "External" if self is Estimator.EXTERNAL else self.name


SIM_STATUS: Final = FilterStatus(FilterFlag(0b11_0111_1111))
"""Of the simulator's truth: all is known (AP_AHRS_SIM::send_ekf_status_report)."""


def configured(number: int) -> Estimator:
    """Return the estimator that AHRS_EKF_TYPE chooses on a Copter or Sub, which always use an EKF."""
    is_chosen = number in (Estimator.EKF3, Estimator.SIM, Estimator.EXTERNAL)
    return Estimator(number) if is_chosen else Estimator.EKF2


def value_after_boot(number: int, *, has_ekf3: bool) -> int:
    """Return the value of AHRS_EKF_TYPE after boot: EKF2, which is not enabled, gives way to EKF3 if that is."""
    return Estimator.EKF3 if number == Estimator.EKF2 and has_ekf3 else number


def assumed_at_boot(number: int) -> Estimator:
    """Return the estimator that a vehicle with this AHRS_EKF_TYPE counts as running on before the first pass.

    That is DCM, unless the number is one that needs no start. The vehicle announces DCM, unless it was asked for.
    """
    return Estimator(number) if number in (Estimator.SIM, Estimator.EXTERNAL) else Estimator.DCM


def announces_dcm(number: int) -> bool:
    """Return whether the vehicle announces DCM as it boots with this AHRS_EKF_TYPE."""
    return number != Estimator.DCM and assumed_at_boot(number) is Estimator.DCM
