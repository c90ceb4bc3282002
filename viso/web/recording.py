# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording in the page of the live view: all of it at once, and a slider to go through it."""

from collections.abc import Mapping
from typing import Any, Final

from mav_handlers.endpoint import MessageEvent
from viso.vehicle.outcomes import FilterWatch
from viso.vehicle.vehicle import Vehicle
from viso.web.faults import FaultSwitches
from viso.web.feed import LOOK_PERIOD_S, Feed
from viso.web.live_state import LiveState
from viso.web.requests import RequestQueue

MOST_POINTS: Final = 6000
MOMENT_S: Final = 1.0
"""The interval at which a recording has the vehicle's state and rates."""


def recording(everything: Mapping[str, Any], moments: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the message that shows a recording: no more points than a page can draw, and no actions.

    Args:
        everything: as ``LiveState.snapshot`` has it.
        moments: ``t`` in s since boot, ``state`` and ``rates`` of each.
    """
    points = everything["points"]
    step = -(-len(points) // MOST_POINTS) or 1
    changes = {"type": "recording", "points": points[::step], "actions": [], "faults": [], "moments": moments}
    return {**everything, **changes}


class ReplayRecorder:
    """Follows a replay of a stream as the live view follows a vehicle."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._state = LiveState(name, keeps_all=True)
        self._moments: list[dict[str, Any]] = []
        self._looked_s = 0.0

    def start(self, vehicle: Vehicle, watch: FilterWatch | None) -> None:
        """Follow a vehicle that is about to run."""
        self._vehicle = vehicle
        switches = FaultSwitches([])
        self._feed = Feed(RequestQueue(switches), switches, now_s=self._now_s)
        self._feed.watch(vehicle)
        vehicle.endpoint.on_event = self._take
        if watch is not None:
            watch.listeners.append(lambda test: self._feed.updates.put(lambda state: state.take_sample(test)))
            watch.lookers.append(self._look)  # what the filter does while nothing comes matters, too

    def _now_s(self) -> float:
        return self._vehicle.clock.micros64() / 1e6

    def _take(self, event: MessageEvent) -> None:
        self._feed.take(self._name, event)
        self._look()

    def _look(self) -> None:
        now_s = self._now_s()
        if now_s - self._looked_s < LOOK_PERIOD_S:
            return
        self._looked_s = now_s
        self._feed.update()
        self._state.take(self._feed.updates.take_all())
        batch = self._state.batch()
        if not self._moments or now_s - self._moments[-1]["t"] >= MOMENT_S:
            self._moments.append({"t": now_s, "state": batch["state"], "rates": batch["rates"]})

    def message(self) -> dict[str, Any]:
        """Return the message for a page."""
        return recording(self._state.snapshot(), self._moments)
