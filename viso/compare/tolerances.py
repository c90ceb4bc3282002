# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tolerances between recorded and computed values, and known exceptions, each with its reason.

Fields without a row must be equal: floats bit by bit.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from ap_core.log_structure import UNITS as UNIT_NAMES
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from ekf_stub.log.ekf_log_structure import XKF1, XKF3, XKF4

CAPTURE: Final = "capture"
CAPTURE_LOG: Final = "log of a capture"
VECTORS: Final = "vectors"
CONVERSATION: Final = "conversation"
LOG: Final = "log"
FLIGHT: Final = "viso ekf, flight"
BENCH: Final = "viso ekf, bench"


class Tolerance(NamedTuple):
    """The tolerance of some fields.

    Attributes:
        kind: the comparison: a kind of recording, or ``viso ekf`` over a flight or on a bench.
        fields: as ``RECORD.Label``; ``float`` stands for all floats of a conversation.
        unit: the unit of the limits.
        reason: why the fields need not be equal.
        within: the limit of each difference.
        rms: the limit of the root mean square of a log's differences.
        backends: the values of VISO_TYPE for which it holds; empty for all.
        is_share: whether ``within`` is a share of the value.
    """

    kind: str
    fields: tuple[str, ...]
    unit: str
    reason: str
    within: float = math.inf
    rms: float = math.inf
    backends: tuple[int, ...] = ()
    is_share: bool = False

    def limits(self) -> str:
        """Return the limits in words, such as ``0.02 m rms, 0.12 m at worst``."""
        rms = f"{self.rms:g} {self.unit} rms" if math.isfinite(self.rms) else ""
        within = f"{self.within:g} {self.unit}".rstrip() if math.isfinite(self.within) else ""
        return f"{rms}, {within} at worst" if rms and within else rms or within


def _of(record: str, labels: str) -> tuple[str, ...]:
    return tuple(f"{record}.{label}" for label in labels.split())


_ALIGNED: Final = (2, 3)
_TIME_OF_HANDLING: Final = "a capture holds the time of handling; the port was read up to a loop (2.5 ms) before"
_BY_AHRS: Final = (
    "the T265 and VOXL backends turn and shift by the AHRS's yaw and position of that instant, which come from a log"
)
_PRINTED: Final = "logged in hundredths, with the rest cut off"
_LAST_BITS: Final = "the filter's sums are not rounded in the firmware's order; what differs in the last bits grows"
_IN_FLIGHT: Final = "target over a flight, from the start of aiding on"
_ON_BENCH: Final = "target on a parked vehicle, without the second after each event"

TOLERANCES: Final = (
    Tolerance(CAPTURE, (*_of("VISP", "CTimeMS"), *_of("VISV", "CTimeMS")), "ms", _TIME_OF_HANDLING, 3),
    Tolerance(CAPTURE, _of("VISP", "PX PY PZ"), "m", _BY_AHRS, 2e-3, backends=_ALIGNED),
    Tolerance(CAPTURE, _of("VISV", "VX VY VZ"), "m/s", _BY_AHRS, 2e-3, backends=_ALIGNED),
    Tolerance(CAPTURE, _of("VISP", "R P Y"), "deg", _BY_AHRS, 0.2, backends=_ALIGNED),
    Tolerance(CAPTURE_LOG, (*_of("REPH", "TS RT"), *_of("REVH", "TS")), "ms", _TIME_OF_HANDLING, 3),
    Tolerance(CAPTURE_LOG, _of("REPH", "PX PY PZ"), "m", _BY_AHRS, 2e-3, backends=_ALIGNED),
    Tolerance(CAPTURE_LOG, _of("REVH", "VX VY VZ"), "m/s", _BY_AHRS, 2e-3, backends=_ALIGNED),
    Tolerance(CAPTURE_LOG, _of("REPH", "Q1 Q2 Q3 Q4"), "", _BY_AHRS, math.radians(0.2) / 2, backends=_ALIGNED),
    Tolerance(
        CONVERSATION, ("float",), "of the value", "a float32 of the answer, written in decimals", 1e-6, is_share=True
    ),
    Tolerance(LOG, _of("XKF1", "PN PE PD"), "m", _LAST_BITS, 1e-3),
    Tolerance(LOG, _of("XKF1", "VN VE VD"), "m/s", _LAST_BITS, 1e-3),
    Tolerance(LOG, _of("XKF1", "Roll Pitch"), "deg", _PRINTED, 0.02),
    Tolerance(LOG, _of("XKF1", "Yaw"), "deg", _PRINTED, 0.02),
    Tolerance(LOG, _of("XKF3", "IPN IPE IPD"), "m", _PRINTED, rms=0.02),
    Tolerance(LOG, _of("XKF3", "IVN IVE IVD"), "m/s", _PRINTED, rms=0.02),
    Tolerance(LOG, _of("XKF4", "SV SP SH"), "", _PRINTED, 0.021),
    Tolerance(LOG, _of("XKF4", "OFN OFE"), "m", _LAST_BITS, 1e-3),
    Tolerance(LOG, ("MSG.TimeUS",), "s", "texts leave the filter in the frame in which they arise", 0.03),
    Tolerance(FLIGHT, _of("XKF1", "PN PE PD"), "m", _IN_FLIGHT, 1e-3),
    Tolerance(FLIGHT, _of("XKF1", "VN VE VD"), "m/s", _IN_FLIGHT, 1e-3),
    Tolerance(FLIGHT, _of("XKF1", "Roll Pitch Yaw"), "deg", _PRINTED, 0.03),
    Tolerance(FLIGHT, _of("XKF3", "IPN IPE IPD"), "m", _IN_FLIGHT, rms=0.02),
    Tolerance(FLIGHT, _of("XKF3", "IVN IVE IVD"), "m/s", _IN_FLIGHT, rms=0.03),
    Tolerance(FLIGHT, ("MSG.TimeUS",), "s", "target for the times of texts", 0.25),
    Tolerance(BENCH, _of("XKF1", "PN PE PD"), "m", _ON_BENCH, 1e-3),
    Tolerance(BENCH, _of("XKF1", "VN VE VD"), "m/s", _ON_BENCH, 1e-3),
    Tolerance(BENCH, _of("XKF4", "OFN OFE"), "m", "target for resets of position: as near as a position", 1e-3),
    Tolerance(BENCH, (*_of("MSG", "TimeUS"), *_of("XKF4", "TimeUS")), "s", "target for the times of events", 0.25),
)


def tolerances_of(kind: str, backend: int = 0) -> Mapping[str, Tolerance]:
    """Return the tolerances of a kind of comparison by field, with those of a backend (VISO_TYPE)."""
    rows = (row for row in TOLERANCES if row.kind == kind and (not row.backends or backend in row.backends))
    return {field: row for row in rows for field in row.fields}


_RAW_UNITS: Final = {("s", "F"): "us", ("s", "C"): "ms"}
"""Units of fields that are logged without their multiplier."""


def _units() -> Mapping[str, str]:
    names = {**dict(UNIT_NAMES), "h": "deg"}
    return {
        f"{structure.name}.{label}": _RAW_UNITS.get((unit, multiplier), names[unit])
        for structure in (*LOG_STRUCTURE_FROM_VISUALODOM, XKF1, XKF3, XKF4)
        for label, unit, multiplier in zip(structure.fields, structure.units, structure.multipliers, strict=True)
    }


UNITS: Final = _units()
"""The unit of each field of the records that are compared."""

ANGLES: Final = frozenset((*_of("VISP", "R P Y"), "XKF1.Yaw"))
"""Fields of which 0 and 360 deg are the same."""

# What ``viso ekf`` counts

EQUAL_SHARE: Final = 1.0
"""Target for the share of a flight's records that have the same timeouts and status (XKF4.TS and SS)."""

UNDECIDED: Final = (0.8, 1.2)
"""A test ratio within these counts as on either side of 1."""

AFTER_RESET_S: Final = 0.5
"""The time after a reset for which height is not compared, in flight."""

AFTER_EVENT_S: Final = 1.0
"""The time after an event for which positions and velocities are not compared, on the bench."""

END_S: Final = {"flight_voxl_reset": 71.0}
"""The end of a log's comparable part: in this one the vehicle fails, and the firmware changes cores."""


def log_name(path: Path) -> str:
    """Return the name of a log without its endings."""
    return path.name.removesuffix(".xz").removesuffix(".BIN")


def kind_of_log(path: Path) -> str:
    """Return by which targets ``viso ekf`` checks a log: a name that begins with ``bench_`` says that it is a bench.

    A bench shows one event after another on a parked vehicle, and is checked by the times of events. A flight is
    checked by its estimates.
    """
    return BENCH if log_name(path).startswith("bench_") else FLIGHT


def end_s(path: Path) -> float:
    """Return the end of a log's comparable part, in s since boot."""
    return END_S.get(log_name(path), math.inf)


# What captures and conversations have besides

ABOUT_VISUAL_ODOM: Final = ("VisOdom: ", "PreArm: VisOdom: ", "Arm: VisOdom: ")
"""Prefixes of the compared texts; others depend on sensors and on other functions of the vehicle."""


class TextException(NamedTuple):
    """Texts of one recording that are allowed to differ.

    Attributes:
        name: its name in the first line.
        messages: number of its messages, which with the name identifies it.
        recorded: texts that the autopilot sent and viso does not send.
        ours: texts that viso sends and the autopilot did not send.
    """

    name: str
    messages: int
    recorded: tuple[str, ...]
    ours: tuple[str, ...]
    reason: str


TEXT_EXCEPTIONS: Final = (
    TextException(
        "prearm",
        995,
        (
            "PreArm: VisOdom: yaw diff 22.9 deg (>10)",
            "PreArm: VisOdom: not healthy",
            "Arm: VisOdom: not healthy",
        ),
        (
            "PreArm: VisOdom: yaw diff 30.0 deg (>10)",
            "PreArm: VisOdom: yaw diff 22.6 deg (>10)",
            "PreArm: VisOdom: yaw diff 17.4 deg (>10)",
            "Arm: VisOdom: yaw diff 17.4 deg (>10)",
        ),
        "The inertial sensors of the recording disagree, so its checks do not pass for a moment and fail again, which "
        "would show the failure unasked; those of viso do at 20 s, and at 26 s in place of 25 s. The last two commands "
        "came 1.5 and 3.6 s after the stream ended, but carry its last time: a command makes no record.",
    ),
    TextException(
        "voxl",
        913,
        (),
        ("PreArm: VisOdom: yaw diff 22.5 deg (>10)",),
        "Another check had failed before in the recording, so that this failure was no news there.",
    ),
)

TIMES: Final = frozenset({"time_boot_ms", "time_usec"})
"""Time fields of answers, which are not compared: they differ between any two runs."""
