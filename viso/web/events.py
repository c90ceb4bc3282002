# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the vehicle's thread tells the page's: small things, in the order in which they happened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ap_core.log_field import LogValue
from ekf_stub.inputs.ext_nav_ingest import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from viso.web.params import Reading


@dataclass(frozen=True, slots=True)
class SeenBoot:
    """A vehicle starts, and time counts from 0; ``defaults`` are those of its parameters, by name."""

    defaults: Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class SeenMessage:
    """A message was dealt with; ``link`` is the name of what it came over."""

    link: str
    event: MessageEvent


@dataclass(frozen=True, slots=True)
class SeenSample:
    """The filter did something with a sample, at a time in us since boot.

    ``innovation`` is a length in the unit of its kind, None where the sample was not tested.
    """

    time_us: int
    outcome: FilterOutcome
    innovation: float | None


@dataclass(frozen=True, slots=True)
class SeenRecord:
    """A VISP or VISV record: its values, TimeUS first."""

    has_position: bool
    values: Sequence[LogValue]


@dataclass(frozen=True, slots=True)
class SeenText:
    """The vehicle said something, at a time in us since boot; ``severity`` is a MAV_SEVERITY."""

    time_us: int
    severity: int
    text: str


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


@dataclass(frozen=True, slots=True)
class SeenParams:
    """Parameters have changed, or others are listed."""

    reading: Reading


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of something that a page asked for.

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


Seen = SeenBoot | SeenMessage | SeenSample | SeenRecord | SeenText | VehicleState | SeenParams | Answer
