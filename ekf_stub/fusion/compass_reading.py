# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the compass in use, and goes over to another one when that fails.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readMagData, tryChangeCompass, update_mag_selection).
"""

from typing import Final

import numpy as np

from ap_core.cint import u32
from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.fusion.measurements import MagSample
from ekf_stub.fusion.parts import FilterParts, Fusion
from ekf_stub.inputs.compasses import NO_COMPASS, Compasses, CompassReading
from ekf_stub.inputs.ext_nav_ingest import HALF_FILTER_STEP_MS
from ekf_stub.inputs.obs_ring import ObsRing
from ekf_stub.reports.core_report import Three

DELAY_MS: Final = 60
INTERVAL_US: Final = 50_000
TIMEOUT_MS: Final = 10_000
SETTLED_MS: Final = 30_000


class CompassReader(Fusion):
    """The compass in use.

    Attributes:
        said: what all compasses say in this frame.
        number: of the one in use.
        samples: its readings that wait for the horizon.
        is_healthy: whether the last that was tested passed its gate.
        is_lost: whether it has been in use and failed its gate for 10 s.
        has_failed: there is none, or yaw was taken from GPS because of it: none is used from then on.
        are_consistent: whether compasses pointed the same way at the last reading.
        wants_reset: the magnetic fields are to be reset, whatever is known of them.
        forgets_body_field: what is known of the vehicle's field is to be forgotten with the next prediction.
    """

    def __init__(self, parts: FilterParts) -> None:
        super().__init__(parts)
        self._is_there = parts.has_compass
        self.said = NO_COMPASS
        self.number, self._may_be_used, self._was_armed = 0, True, False
        self.samples: ObsRing[MagSample] = ObsRing(parts.ring_size)
        self.is_healthy = self.is_lost = self.has_failed = False
        self.are_consistent = self.wants_reset = self.forgets_body_field = False
        self._began_ms = self._healthy_ms = self._read_ms = self._time_us = 0
        self._offsets: Three | None = None

    def _reading(self, number: int) -> CompassReading | None:
        return self.said.readings[number] if number < len(self.said.readings) else None

    def is_used(self) -> bool:
        """Return whether the compass may be used for yaw."""
        return self._may_be_used and self._is_there()

    def _choose(self, number: int) -> None:
        reading = self._reading(number)
        self.number, self._may_be_used = number, reading is None or reading.is_used

    def begin(self, compasses: Compasses, now_ms: int) -> None:
        """Take the first one, as the filter begins (InitialiseVariablesMag)."""
        self.said = compasses
        self._choose(compasses.first_usable)
        self._began_ms = self._healthy_ms = now_ms

    def select(self, compasses: Compasses, now_ms: int, *, armed: bool) -> None:
        """Hear what compasses say in a frame; go over to the core's own, or on the ground to the first one."""
        if compasses is self.said and armed == self._was_armed:  # as in most frames
            return
        self.said, self._was_armed = compasses, armed
        self._choose(self.number)
        own = compasses.own
        if own is not None:
            reading = self._reading(own)
            if reading is not None and reading.is_healthy and reading.is_used:
                self._choose(own)
        elif not armed and self.number != compasses.first_usable:
            self._try(compasses.first_usable, now_ms)

    def check_timeout(self, now_ms: int, *, is_in_use: bool) -> None:
        """Find out whether the compass is lost."""
        if self.is_healthy:
            self.is_lost, self._healthy_ms = False, now_ms
        elif now_ms - self._healthy_ms > TIMEOUT_MS and is_in_use:
            self.is_lost = True

    def read(self, now_ms: int, vehicle: Vehicle, *, is_in_use: bool) -> None:
        """Read the compass once a step, another one if it is lost (readMagData)."""
        if not self.said.are_available:
            self.has_failed = True
        reading = self._reading(self.number)
        if reading is None or self.has_failed:
            return
        if len(self.said.readings) > 1:
            has_settled = now_ms - self._began_ms > SETTLED_MS
            fails_gate = self.is_lost and not vehicle.on_ground and has_settled and self.said.own is None
            if fails_gate or (not reading.is_healthy and now_ms - self._read_ms > TIMEOUT_MS):
                self._try_others(now_ms)
                reading = self.said.readings[self.number]
        if is_in_use and reading.is_healthy and u32(reading.time_us - self._time_us) > INTERVAL_US:
            self._take(reading, now_ms)

    def _take(self, reading: CompassReading, now_ms: int) -> None:
        if self._offsets is not None and reading.offsets != self._offsets:
            self._forget()
        self._offsets, self._time_us, self._read_ms = reading.offsets, reading.time_us, now_ms
        self.are_consistent = self.said.are_consistent
        self.samples.push(MagSample(u32(now_ms - DELAY_MS - HALF_FILTER_STEP_MS), 0.001 * reading.field))

    def _try_others(self, now_ms: int) -> None:
        """Try each number after that in use, which goes on from where it has got to (tryChangeCompass)."""
        count = len(self.said.readings)
        for ahead in range(1, count):
            self._try((self.number + ahead) % count, now_ms)

    def _try(self, number: int, now_ms: int) -> None:
        reading = self._reading(number)
        if reading is None or not (reading.is_healthy and reading.is_used) or number == self.number:
            return
        self._choose(number)
        self._texts.add(f"switching to compass {number}")
        self.is_lost, self._healthy_ms = False, now_ms
        self.wants_reset = True
        self._forget()

    def _forget(self) -> None:
        """Restart with the compass's own errors."""
        self._state.body_field = np.zeros(3)
        self.samples.clear()
        self.forgets_body_field = True
