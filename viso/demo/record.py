# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The record of a closed loop: texts, messages, estimates and outcomes, with their times."""

import logging
import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from ap_core.verdict import VerdictKind
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.core.covariance import POS
from ekf_stub.reports import AidingMode, FilterFlag
from mav_handlers.endpoint import MessageEvent
from mav_handlers.wire.messages import ODOMETRY
from viso.companion.vio.result import Result
from viso.companion.vio.types import VioState
from viso.vehicle.outcomes import FilterWatch, SampleTest, is_final
from viso.vehicle.vehicle import Vehicle

AUTOPILOT: Final = "autopilot"
COMPANION: Final = "companion"
LOOK_PERIOD_US: Final = 50_000
DEGRADED_EVENT: Final = "vio_degraded"
_SEVERITIES: Final = {logging.ERROR: 3, logging.WARNING: 4, logging.INFO: 6}

Three = tuple[float, float, float]


class LoopText(NamedTuple):
    """A text, who sent it, and its severity (MAV_SEVERITY); us since the autopilot's boot."""

    time_us: int
    who: str
    severity: int
    text: str


class Health(NamedTuple):
    """The state of the odometry after a frame; us since the autopilot's boot."""

    time_us: int
    state: VioState


class StateSpan(NamedTuple):
    """The state of the odometry over a span of time, us since the autopilot's boot."""

    start_us: int
    end_us: int
    state: VioState


class Arrived(NamedTuple):
    """An ODOMETRY message that reached the autopilot, and whether the filter got it."""

    time_us: int
    message: ODOMETRY
    is_accepted: bool


class Estimate(NamedTuple):
    """The estimate of the autopilot.

    ``pos_ned`` (m) is None while it does not navigate, ``quat_wxyz`` before it has an attitude. ``sigmas_m`` of the
    position, and ``moved_ne`` (m), by how much its last reset has moved it, are None before the filter runs.
    """

    time_us: int
    pos_ned: Three | None
    sigmas_m: Three | None
    moved_ne: tuple[float, float] | None
    quat_wxyz: tuple[float, float, float, float] | None
    flags: FilterFlag
    mode: AidingMode
    is_armed: bool
    is_camera_healthy: bool

    @property
    def time_s(self) -> float:
        """When, in s since the autopilot's boot."""
        return self.time_us * 1e-6


@dataclass
class LoopRecord:
    """All events of a loop, each list in the order of time."""

    all_texts: list[LoopText] = field(default_factory=list)
    health: list[Health] = field(default_factory=list)
    arrived: list[Arrived] = field(default_factory=list)
    estimates: list[Estimate] = field(default_factory=list)
    outcomes: list[SampleTest] = field(default_factory=list)

    def texts(self, who: str) -> list[str]:
        """Return the texts of the autopilot or of the companion."""
        return [text.text for text in self.all_texts if text.who == who]

    def states(self, start_us: int, end_us: int) -> list[StateSpan]:
        """Return how the odometry has been, from when it came up to a time."""
        changes = [(start_us, VioState.INIT)]
        for one in self.health:
            if one.state is not changes[-1][1]:
                changes.append((one.time_us, one.state))
        ends_us = [*(time_us for time_us, _ in changes[1:]), max(end_us, changes[-1][0])]
        return [StateSpan(time_us, end_us, state) for (time_us, state), end_us in zip(changes, ends_us, strict=True)]


class LoopRecorder(logging.Handler):
    """Listens to vehicle and companion; the companion's log comes to it as to any handler.

    Args:
        vehicle: fresh.
    """

    def __init__(self, vehicle: Vehicle, watch: FilterWatch, record: LoopRecord) -> None:
        super().__init__(logging.INFO)
        self.record = record
        self._vehicle, self._watch = vehicle, watch
        vehicle.texts.on_text.append(lambda severity, text: self._note(AUTOPILOT, severity, text))
        vehicle.endpoint.on_event = self._take_event
        watch.listeners.append(self._take_outcome)

    def look(self) -> None:
        """Note the present estimate of the autopilot."""
        ahrs = self._vehicle.ahrs
        position, attitude = ahrs.get_relative_position_NED_origin_float(), ahrs.get_quaternion()
        status = ahrs.get_filter_status()
        pos_ned = None if position is None else (float(position.x), float(position.y), float(position.z))
        w, x, y, z = (1.0, 0.0, 0.0, 0.0) if attitude is None else map(float, attitude.to_wxyz())
        self.record.estimates.append(
            Estimate(
                self._now_us(),
                pos_ned,
                *self._of_filter(),
                None if attitude is None else (w, x, y, z),
                FilterFlag.UNINITIALISED if status is None else status.flags,
                self._watch.mode(),
                self._vehicle.copter.is_armed(),
                self._vehicle.visual_odom.healthy(),
            )
        )

    def emit(self, record: logging.LogRecord) -> None:
        """Note what the companion logs, except for what it repeats every second while it is degraded."""
        if getattr(record, "event", None) == DEGRADED_EVENT:
            return
        self._note(COMPANION, _SEVERITIES.get(record.levelno, 6), record.getMessage())

    def take_result(self, result: Result) -> None:
        """Note the state after a frame (a listener of the companion's pipeline)."""
        self.record.health.append(Health(self._now_us(), result.state))

    def _of_filter(self) -> tuple[Three | None, tuple[float, float] | None]:
        """Return the sigmas of the position, and its last reset."""
        ahrs = self._vehicle.ahrs
        if not isinstance(ahrs, Ekf3Ahrs) or ahrs.core is None or not ahrs.core.initialised:
            return None, None
        cov = ahrs.core.state.cov
        sigma_n, sigma_e, sigma_d = (math.sqrt(max(cov.var(POS + axis), 0.0)) for axis in range(3))
        return (sigma_n, sigma_e, sigma_d), ahrs.core.resets.moved_ne

    def _now_us(self) -> int:
        return self._vehicle.clock.micros64()

    def _note(self, who: str, severity: int, text: str) -> None:
        self.record.all_texts.append(LoopText(self._now_us(), who, severity, text))

    def _take_event(self, event: MessageEvent) -> None:
        if isinstance(event.message, ODOMETRY):
            is_accepted = event.verdict.kind is VerdictKind.ACCEPTED
            self.record.arrived.append(Arrived(event.now_us, event.message, is_accepted))

    def _take_outcome(self, test: SampleTest) -> None:
        if is_final(test.outcome.rule):
            self.record.outcomes.append(test)
