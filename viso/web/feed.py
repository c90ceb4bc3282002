# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The side of the vehicle: it notes what happens for pages, and never waits for a reader."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_visualodom.log_structure import VISP, VISV
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs.ingest_rules import FilterOutcome
from mav_handlers.endpoint import MessageEvent
from mav_handlers.links.base import Link
from viso.vehicle.copter.modes import MODES
from viso.vehicle.outcomes import SampleTest
from viso.vehicle.vehicle import Vehicle
from viso.web.faults import FaultSwitches
from viso.web.live_state import LiveState, StateUpdate, defaults_of, finite, read_params
from viso.web.requests import BoundedQueue, RequestQueue

THINGS_WAITING: Final = 20_000
LOOK_PERIOD_S: Final = 0.1
_MAV_SEVERITY_INFO: Final = 6


class Feed:
    """Listens to a vehicle and carries out what pages ask for, all on the thread of the vehicle.

    Args:
        requests: those of pages, which wait.
        faults: the switches.
        links: those of the vehicle.
        now_s: a monotonic clock in seconds.

    Attributes:
        updates: those that were not applied yet; when it is full, the oldest goes.
    """

    def __init__(
        self, requests: RequestQueue, faults: FaultSwitches, *, links: Sequence[Link] = (), now_s: Callable[[], float]
    ) -> None:
        self._requests = requests
        self._faults = faults
        self._links = tuple(links)
        self._now_s = now_s
        self._vehicle: Vehicle | None = None
        self._looked_s: float | None = None
        self._generation = -1
        self.updates: BoundedQueue[StateUpdate] = BoundedQueue(THINGS_WAITING)

    def watch(self, vehicle: Vehicle) -> None:
        """Follow a vehicle that is about to run, in place of the one before it."""
        self._vehicle = vehicle
        self._generation = -1
        defaults = defaults_of(vehicle.params)
        firmware = vehicle.firmware.name
        self.updates.put(lambda state: state.take_boot(defaults, firmware))
        vehicle.texts.on_text.append(self._take_text)
        vehicle.logger.on_write = self._take_record

    def take(self, link: str, event: MessageEvent) -> None:
        """Note the outcome of a message that came over a link."""
        self.updates.put(lambda state: state.take_message(link, event))

    def take_outcome(self, now_us: int, outcome: FilterOutcome) -> None:
        """Note what the filter did with a sample, at a time in us since boot."""
        self.updates.put(lambda state: state.take_sample(SampleTest(now_us, outcome)))

    def take_news(self, link: str, news: str) -> None:
        """Note who comes and goes on a link, or what fails on it."""
        self._take_text(_MAV_SEVERITY_INFO, f"{link}: {news}")

    def _take_text(self, severity: int, text: str) -> None:
        assert self._vehicle is not None
        now_us = self._vehicle.clock.micros64()
        self.updates.put(lambda state: state.take_text(now_us, severity, text))

    def _take_record(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        if structure.name in (VISP.name, VISV.name):
            self.updates.put(lambda state: state.take_record(structure.name == VISP.name, values))

    def update(self) -> None:
        """Carry out requests, and note the state of the vehicle now and then; called between passes of its loop."""
        if self._vehicle is None:
            return
        for answer in self._requests.run(self._vehicle):
            self.updates.put(partial(LiveState.take_answer, answer=answer))
        now_s = self._now_s()
        if self._looked_s is None or now_s - self._looked_s >= LOOK_PERIOD_S:
            self._looked_s = now_s
            self._look(self._vehicle)

    def _look(self, vehicle: Vehicle) -> None:
        if vehicle.params.generation != self._generation:
            self._generation = vehicle.params.generation
            reading = read_params(vehicle.params)
            self.updates.put(lambda state: state.take_params(reading))
        now_us, now = vehicle.clock.micros64(), _state_of(vehicle)
        now["faults"] = list(self._faults.on)
        now["clients"] = [[link.name, peer] for link in self._links for peer in link.peer_names]
        self.updates.put(lambda state: state.take_state(now_us, now))


def _state_of(vehicle: Vehicle) -> dict[str, Any]:
    """Return how a vehicle is now, as JSON has it."""
    pos = vehicle.ahrs.get_relative_position_NED_origin_float()
    ekf = None if pos is None else [finite(part, 3) for part in (pos.x, pos.y, pos.z)]
    number = vehicle.copter.custom_mode()
    return {
        "time_s": vehicle.clock.micros64() / 1e6,
        "mode": MODES[number].name if number in MODES else str(number),
        "armed": vehicle.copter.is_armed(),
        "prearm": vehicle.copter.arming.passed,
        "camera": _camera_of(vehicle),
        "aiding": _aiding_of(vehicle),
        "source_set": vehicle.sources.active_set,
        "ekf": None if ekf is None or None in ekf else ekf,
        "yaw_deg": finite(math.degrees(vehicle.ahrs.get_yaw_rad()), 1),
    }


def _camera_of(vehicle: Vehicle) -> str:
    """Return why visual odometry prevents arming; "healthy" if it does not, "off" if it is disabled."""
    camera = vehicle.visual_odom
    return (camera.pre_arm_check() or "healthy") if camera.enabled() else "off"


def _aiding_of(vehicle: Vehicle) -> str | None:
    """Return how the filter navigates: none, absolute or relative; None without a filter."""
    ahrs = vehicle.ahrs
    if not isinstance(ahrs, Ekf3Ahrs) or ahrs.core is None or not ahrs.core.initialised:
        return None
    return ahrs.aiding_mode().value
