# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the vehicle's thread tells the page's of its state, and of what was asked for."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class VehicleState:
    """How the vehicle is at a moment.

    Attributes:
        time_us: since boot.
        mode: the flight mode's name.
        is_armed: whether it is armed.
        has_prearm_passed: whether its last pre-arm checks passed.
        camera: what its visual odometry says against arming; "healthy" for nothing, "off" where it is disabled.
        aiding: how the filter navigates: ``none``, ``absolute``, ``relative``; None without a filter.
        source_set: the EKF's active one, 0 to 2.
        pos_ned: m from the EKF's origin; None while that is not known.
        yaw_rad: -pi to pi.
        faults: names of the faults that are on.
        clients: who is connected, each after the name of its link.
    """

    time_us: int
    mode: str
    is_armed: bool
    has_prearm_passed: bool
    camera: str
    aiding: str | None
    source_set: int
    pos_ned: tuple[float, float, float] | None
    yaw_rad: float
    faults: tuple[str, ...]
    clients: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Answer:
    """Outcome of something that a page asked for.

    Attributes:
        client: number of the page.
        request: the page's own number for what it asked.
        ok: whether it was done.
        text: what is to be told.
    """

    client: int
    request: int
    ok: bool
    text: str
