# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The type of message builders, helpers for fields, and the builder of messages that are never sent."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ap_core.cint import i16, int_of_float, u32
from ap_core.vector3 import Vector3f
from mav_handlers.channel import Channel
from mav_handlers.wire.messages import Message

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

Builder = Callable[["Vehicle", Channel, int], Message | None]
"""Makes a message for a link at a time in us since boot, or returns None if there is nothing to report."""


# Estimates depend on outside data and may be absurd; that must affect the field alone.
quiet_overflow = np.errstate(over="ignore", invalid="ignore")


def boot_ms(now_us: int) -> int:
    """Return ms since boot, in 32 bits (AP_HAL::millis)."""
    return u32(now_us // 1000)


def floats(vector: Vector3f) -> tuple[float, float, float]:
    """Return the components of a vector as a message takes them."""
    return float(vector.x), float(vector.y), float(vector.z)


def i16_of(value: np.float32) -> int:
    """Convert to a signed 16-bit integer by truncation, as on x86-64."""
    return i16(int_of_float(float(value)))


def nothing_to_report(_vehicle: Vehicle, _channel: Channel, _now_us: int) -> None:
    """A message known to the firmware but never sent here, because its subsystem does not exist."""
