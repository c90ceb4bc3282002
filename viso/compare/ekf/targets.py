# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How near the filter is to come to a log's own estimates: by command, table and tests alike.

A log whose name begins with ``bench_`` shows one event after another on a parked vehicle, and is judged by when what
happens happens. Any other one is judged by its estimates, from the start of aiding to the end.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

BENCH_PREFIX: Final = "bench_"
END_S: Final = {"flight_voxl_reset": 71.0}
"""Where a log stops being comparable: in this one the vehicle fails, and the firmware changes cores."""

WITHIN_S: Final = 0.25
"""How far apart an event may be."""

AFTER_RESET_S: Final = 0.5
"""For how long height is left out after a reset, in flight."""

AFTER_EVENT_S: Final = 1.0
"""For how long positions and velocities are left out after an event, on the bench."""

EQUAL_SHARE: Final = 0.98
"""Of the records, how many are to have the same timeouts and status."""

UNDECIDED: Final = (0.8, 1.2)
"""A ratio within these is as good on one side of 1 as on the other."""

PRINTED_STEP: Final = 0.1
"""By how much a printed number may differ: its last digit, which rounding decides."""

MOVED_STEP_M: Final = 0.1
"""By how much a reset of position may differ: as much as a position."""


UNITS: Final = {
    **dict.fromkeys(("Roll", "Pitch", "Yaw"), "deg"),
    **dict.fromkeys(("VN", "VE", "VD", "IVN", "IVE", "IVD"), "m/s"),
    **dict.fromkeys(("PN", "PE", "PD", "IPN", "IPE", "IPD"), "m"),
}
"""Of what is measured, by the labels of XKF1 and XKF3."""


@dataclass(frozen=True, slots=True)
class Limit:
    """How far apart a quantity may be, in its unit."""

    rms: float
    worst: float = math.inf


FLIGHT_LIMITS: Final = {
    **dict.fromkeys(("PN", "PE"), Limit(0.02, worst=0.12)),
    "PD": Limit(0.03),
    **dict.fromkeys(("VN", "VE", "VD"), Limit(0.03)),
    **dict.fromkeys(("Roll", "Pitch"), Limit(0.1)),
    "Yaw": Limit(1.0),
    **dict.fromkeys(("IPN", "IPE", "IPD"), Limit(0.02)),
    **dict.fromkeys(("IVN", "IVE", "IVD"), Limit(0.03)),
}

BENCH_LIMITS: Final = dict.fromkeys(("PN", "PE", "PD", "VN", "VE", "VD"), Limit(0.1))


def log_name(path: Path) -> str:
    """Return the name of a log without what tells its format."""
    return path.name.removesuffix(".xz").removesuffix(".BIN")


def is_bench(path: Path) -> bool:
    """Return whether a log is judged as a bench's."""
    return log_name(path).startswith(BENCH_PREFIX)


def end_s(path: Path) -> float:
    """Return up to when a log is comparable, in s since boot."""
    return END_S.get(log_name(path), math.inf)
