# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the worker says about a frame, to its listeners."""

import uuid
from collections.abc import Callable
from dataclasses import dataclass

from viso.companion.vio.strategy import FrameReport
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
