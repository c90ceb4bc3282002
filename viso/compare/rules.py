# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How far what an autopilot recorded may be from what viso does: tolerances and known exceptions, each with its reason.

What no row names has to be equal: floats bit by bit.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

CAPTURE: Final = "capture"
VECTORS: Final = "vectors"
CONVERSATION: Final = "conversation"
LOG: Final = "log"


class Tolerance(NamedTuple):
    """By how much some fields of a kind of recording may differ.

    Attributes:
        fields: as ``RECORD.Label``.
        within: the most, in ``unit``; of an answer's numbers, a share.
        backends: values of VISO_TYPE for which it holds; empty for all.
        is_angle: whether a full turn is nothing.
        is_rms: whether the root of the mean square of a log's records is meant, and not each record.
    """

    kind: str
    fields: tuple[str, ...]
    within: float
    unit: str
    reason: str
    backends: tuple[int, ...] = ()
    is_angle: bool = False
    is_rms: bool = False


def _of(record: str, labels: str) -> tuple[str, ...]:
    return tuple(f"{record}.{label}" for label in labels.split())


_ALIGNED: Final = (2, 3)
_BY_AHRS: Final = (
    "the T265 and VOXL backends turn and shift by the AHRS's yaw and position of that instant, which come from a log"
)
_PRINTED: Final = "logged in hundredths, with the rest cut off"
_LAST_BITS: Final = "the filter's sums are not rounded in the firmware's order; what differs in the last bits grows"

TOLERANCES: Final = (
    Tolerance(
        CAPTURE,
        (*_of("VISP", "CTimeMS"), *_of("VISV", "CTimeMS")),
        3,
        "ms",
        "a capture holds the time of handling; the port was read up to a loop (2.5 ms) before",
    ),
    Tolerance(CAPTURE, _of("VISP", "PX PY PZ"), 2e-3, "m", _BY_AHRS, _ALIGNED),
    Tolerance(CAPTURE, _of("VISV", "VX VY VZ"), 2e-3, "m/s", _BY_AHRS, _ALIGNED),
    Tolerance(CAPTURE, _of("VISP", "R P Y"), 0.2, "deg", _BY_AHRS, _ALIGNED, is_angle=True),
    Tolerance(CONVERSATION, ("float",), 1e-6, "of the value", "a float32 of the answer, written in decimals"),
    Tolerance(LOG, _of("XKF1", "PN PE PD"), 0.011, "m", _LAST_BITS),
    Tolerance(LOG, _of("XKF1", "VN VE VD"), 0.005, "m/s", _LAST_BITS),
    Tolerance(LOG, _of("XKF1", "Roll Pitch"), 0.02, "deg", _PRINTED),
    Tolerance(LOG, _of("XKF1", "Yaw"), 0.02, "deg", _PRINTED, is_angle=True),
    Tolerance(LOG, _of("XKF3", "IPN IPE IPD"), 0.02, "m", _PRINTED, is_rms=True),
    Tolerance(LOG, _of("XKF3", "IVN IVE IVD"), 0.02, "m/s", _PRINTED, is_rms=True),
    Tolerance(LOG, _of("XKF4", "SV SP SH"), 0.021, "", _PRINTED),
    Tolerance(LOG, _of("XKF4", "OFN OFE"), 1e-3, "m", _LAST_BITS),
    Tolerance(LOG, ("MSG.TimeUS",), 0.03, "s", "texts leave the filter in the frame in which they arise"),
    Tolerance(LOG, ("MSG.Message",), 0.1, "of a number in it", "the last digit of a printed number"),
)


def tolerances_of(kind: str, backend: int = 0) -> Mapping[str, Tolerance]:
    """Return the tolerances of a kind of recording by field; those of a backend (VISO_TYPE) too."""
    rows = (row for row in TOLERANCES if row.kind == kind and (not row.backends or backend in row.backends))
    return {field: row for row in rows for field in row.fields}


ABOUT_VISUAL_ODOM: Final = ("VisOdom: ", "PreArm: VisOdom: ", "Arm: VisOdom: ")
"""How texts begin that are compared; others depend on sensors and on what else the vehicle does."""


class TextException(NamedTuple):
    """Texts of one recording that are not the same, and need not be.

    Attributes:
        name: what its first line calls it.
        messages: how many it has, which with the name tells it from others.
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
"""Fields of answers that are not compared: when they were made, which no two runs share."""

UNASKED: Final = frozenset({"HEARTBEAT", "TIMESYNC"})
"""What comes all the time, and counts in a conversation only where an exchange has it in ``also show``."""
