# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the compasses say in a frame (AP_DAL/AP_DAL_Compass.h)."""

from typing import Final, NamedTuple

from ekf_stub.filter.inertial import Array
from ekf_stub.reports.core_report import Three


class CompassReading(NamedTuple):
    """What one compass says.

    Attributes:
        time_us: of the reading, since boot.
        field: mGauss, body (FRD).
        offsets: those that have been taken from it, mGauss.
        is_healthy: whether it works.
        is_used: whether it may be used for yaw.
    """

    time_us: int
    field: Array
    offsets: Three = (0.0, 0.0, 0.0)
    is_healthy: bool = True
    is_used: bool = True


class Compasses(NamedTuple):
    """All compasses, by their numbers.

    Attributes:
        readings: what each says.
        first_usable: the number of the first that may be used.
        own: that of the core, if it has affinity to a compass; None otherwise.
        are_consistent: whether all point the same way.
        are_available: whether there are any.
    """

    readings: tuple[CompassReading, ...] = ()
    first_usable: int = 0
    own: int | None = None
    are_consistent: bool = True
    are_available: bool = True


NO_COMPASS: Final = Compasses()
