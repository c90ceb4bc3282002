# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the worker says about a frame, to its listeners and to telemetry."""

import uuid
from collections.abc import Callable
from dataclasses import dataclass

from viso.companion.vio.strategy import FrameReport
from viso.companion.vio.telemetry_records import Record, health_values, output_values
from viso.companion.vio.types import VioHealth, VioOutput


@dataclass(frozen=True, slots=True, eq=False)
class VioUpdate:
    """What there is to know about a frame.

    Where frames stop coming, the last one is told again, without its output and with the health LOST.

    Attributes:
        frame_id, sequence: of the frame.
        t_ns: of the frame, in the IMU's time.
        output: to be used with less weight in DEGRADED; None in INIT and LOST.
        health: after the frame.
        report: what else the strategy says.
        dropped: frames that gave way to newer ones, since the start.
    """

    frame_id: uuid.UUID
    sequence: int
    t_ns: int
    output: VioOutput | None
    health: VioHealth
    report: FrameReport
    dropped: int


Listener = Callable[[VioUpdate], None]


def update_record(update: VioUpdate, clock_offset_ns: int | None) -> Record:
    """Return the telemetry record of an update.

    Args:
        update: what there is to know about a frame.
        clock_offset_ns: the autopilot's clock against the companion's, None while unknown.
    """
    return {
        "kind": "frame",
        "frame_id": str(update.frame_id),
        "sequence": update.sequence,
        "t_ns": update.t_ns,
        "health": health_values(update.health),
        "output": None if update.output is None else output_values(update.output),
        "innovation_ratio": update.report.innovation_ratio,
        "resets": update.report.resets,
        "stage_ms": update.report.stage_ms,
        "dropped": update.dropped,
        "clock_offset_ns": clock_offset_ns,
        "clock_synced": clock_offset_ns is not None,
    }
