# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every source of inertial data is told."""

from collections.abc import Callable
from dataclasses import dataclass

from viso.vehicle.sensors.errors import NO_ERRORS, SensorErrors


@dataclass(frozen=True, slots=True)
class ImuOptions:
    """What a source of inertial data may use.

    Attributes:
        heading_rad: where the vehicle points at first, if the source itself does not know.
        has_compass: says whether there is a compass, and in use.
        errors: what is wrong with the sensors.
        seed: of the random part of the errors.
    """

    heading_rad: float = 0.0
    has_compass: Callable[[], bool] = lambda: False
    errors: SensorErrors = NO_ERRORS
    seed: int = 0
