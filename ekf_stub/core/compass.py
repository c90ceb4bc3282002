# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The compass in use, and when yaw and magnetic field are set by it.

Source: AP_NavEKF3/AP_NavEKF3_Measurements.cpp (readMagData, tryChangeCompass, update_mag_selection),
AP_NavEKF3/AP_NavEKF3_MagFusion.cpp (controlMagYawReset), AP_NavEKF3/AP_NavEKF3_Control.cpp
(setWindMagStateLearningMode).
"""

from typing import Final, final

from ekf_stub.core import events as ev
from ekf_stub.core.aiding import Vehicle
from ekf_stub.core.events import Events
from ekf_stub.core.inputs import CompassReading, CoreInputs
from ekf_stub.core.samples import HALF_FILTER_STEP_MS, MagSample, ObsRing
from ekf_stub.core.state import State
from ekf_stub.core.vectors import U32, ZERO, Quat, Vec3, angle_between, length2, scaled, since_ms

_DELAY_MS: Final = 60
_INTERVAL_US: Final = 50_000
_TIMEOUT_MS: Final = 10_000
_SETTLED_MS: Final = 30_000


@final
class CompassReader:
    """Reads the compass in use, and goes over to another one when that fails.

    Args:
        keeps_compass: see ``FilterRelease``.

    Attributes:
        compasses: what all compasses say in this pass.
        number: of the one in use.
        samples: its readings that wait for the horizon.
        is_healthy: whether the last that was tested passed its gate.
        is_lost: whether it has been in use and failed its gate for 10 s.
        has_failed: there is none, or yaw was taken from GPS because of it: none is used from then on.
        are_consistent: whether compasses pointed the same way at the last reading.
        wants_reset: the magnetic fields are to be reset, whatever is known of them.
        forgets_body_field: what is known of the vehicle's field is to be forgotten with the next prediction.
    """

    def __init__(
        self, state: State, events: Events, inputs: CoreInputs, ring_size: int, now_ms: int, keeps_compass: bool
    ) -> None:
        self._keeps_compass = keeps_compass
        self._state = state
        self._events = events
        self._inputs = inputs
        self.compasses = inputs.compasses
        self.number = 0
        self._may_be_used = True
        self._was_armed = False
        self.samples: ObsRing[MagSample] = ObsRing(ring_size)
        self.is_healthy = False
        self.is_lost = False
        self.has_failed = False
        self.are_consistent = False
        self.wants_reset = False
        self.forgets_body_field = False
        self._began_ms = now_ms
        self._healthy_ms = now_ms
        self._read_ms = 0
        self._time_us = 0
        self._offsets: Vec3 = ZERO
        self._has_offsets = False
        self._choose(self.compasses.first_usable)

    def _reading(self, number: int) -> CompassReading | None:
        readings = self.compasses.readings
        return readings[number] if number < len(readings) else None

    def is_used(self) -> bool:
        """Return whether the compass may be used for yaw."""
        return self._may_be_used and self._inputs.has_compass

    def _choose(self, number: int) -> None:
        reading = self._reading(number)
        self.number = number
        self._may_be_used = reading is None or reading.is_used

    def select(self, now_ms: int) -> None:
        """Look at what compasses say in a pass; go over to the core's own, or on the ground to the first one."""
        compasses, armed = self._inputs.compasses, self._inputs.armed
        if compasses is self.compasses and armed == self._was_armed:  # as in most passes
            return
        self.compasses, self._was_armed = compasses, armed
        self._choose(self.number)
        own = compasses.own
        if own >= 0:
            reading = self._reading(own)
            if reading is not None and reading.is_healthy and reading.is_used:
                self._choose(own)
        elif not armed and self.number != compasses.first_usable and not self._keeps_compass:
            self._try(compasses.first_usable, now_ms)

    def check_timeout(self, now_ms: int, is_in_use: bool) -> None:
        """Find out whether the compass is lost."""
        if self.is_healthy:
            self.is_lost, self._healthy_ms = False, now_ms
        elif now_ms - self._healthy_ms > _TIMEOUT_MS and is_in_use:
            self.is_lost = True

    def read(self, now_ms: int, vehicle: Vehicle, is_in_use: bool) -> None:
        """Read the compass once a step, another one if it is lost (readMagData)."""
        compasses = self.compasses
        if not compasses.are_available:
            self.has_failed = True
        reading = self._reading(self.number)
        if reading is None or self.has_failed:
            return
        if len(compasses.readings) > 1:
            has_settled = now_ms - self._began_ms > _SETTLED_MS
            fails_gate = self.is_lost and not vehicle.on_ground and has_settled and compasses.own < 0
            if fails_gate or (not reading.is_healthy and now_ms - self._read_ms > _TIMEOUT_MS):
                self._try_others(now_ms)
                reading = compasses.readings[self.number]
        if is_in_use and reading.is_healthy and since_ms(reading.time_us, self._time_us) > _INTERVAL_US:
            self._take(reading, now_ms)

    def _take(self, reading: CompassReading, now_ms: int) -> None:
        if self._has_offsets and reading.offsets != self._offsets:
            self._forget()
        self._offsets, self._has_offsets = reading.offsets, True
        self._time_us, self._read_ms = reading.time_us, now_ms
        self.are_consistent = self.compasses.are_consistent
        time_ms = (now_ms - _DELAY_MS - HALF_FILTER_STEP_MS) & U32
        self.samples.push(MagSample(time_ms, scaled(reading.field, 0.001)))

    def _try_others(self, now_ms: int) -> None:
        """Try each number after that in use, which goes on from where it has got to (tryChangeCompass).

        A release that keeps compasses ends with the first that can be used.
        """
        count, before = len(self.compasses.readings), self.number
        for ahead in range(1, count):
            self._try((self.number + ahead) % count, now_ms)
            if self._keeps_compass and self.number != before:
                return

    def _try(self, number: int, now_ms: int) -> None:
        reading = self._reading(number)
        if reading is None or not (reading.is_healthy and reading.is_used) or number == self.number:
            return
        self._choose(number)
        self._events.say(ev.SWITCHING_COMPASS, (float(number), 0.0, 0.0))
        self.is_lost, self._healthy_ms = False, now_ms
        self.wants_reset = True
        self._forget()

    def _forget(self) -> None:
        """Restart with the compass's own errors."""
        self._state.set_body_field(ZERO)
        self.samples.clear()
        self.forgets_body_field = True


_FINAL_HEIGHT_M: Final = 2.5
_MAX_TURN: Final = 0.1745
_ANOMALY_CLIMB_M: Final = 0.5
_ANOMALY_INNOVATION: Final = 0.25
_MAX_ANOMALIES: Final = 2
_MANOEUVRING_MSS: Final = 0.5
# Of EK3_MAG_CAL:
_IN_FLIGHT: Final = 0
_MANOEUVRING: Final = 1
NEVER: Final = 2
_AFTER_CLIMB: Final = 3
ALWAYS: Final = 4
GROUND_AND_CLIMBED: Final = 7
# Which alignment is due:
NOT_DUE: Final = 0
INITIAL: Final = 1
FINAL: Final = 2
INTERIM: Final = 3
REQUESTED: Final = 4


@final
class CompassAlignment:
    """Which alignments by the compass have been made, and which is due.

    Attributes:
        yaw_done, field_done: the final ones of this flight, of yaw and of the magnetic field.
        field_set: the field has been set at all.
        is_requested: an alignment is wanted for another reason.
    """

    def __init__(self, state: State) -> None:
        self._state = state
        self.yaw_done = False
        self.field_done = False
        self.field_set = False
        self.is_requested = False
        self._quat_before: Quat = state.quat
        self._anomalies = 0
        self._quat_at_reset: Quat = state.quat
        self._down_at_reset = 0.0
        self._innovation_at_reset = 0.0

    def update(self, vehicle: Vehicle, innovation: float) -> None:
        """Follow the vehicle on the ground."""
        if not vehicle.on_ground:
            return
        self.yaw_done = False
        self.field_done = False
        self._anomalies = 0
        if self.field_set:
            self._keep_reset(innovation)

    def _keep_reset(self, innovation: float) -> None:
        self._down_at_reset = self._state.pos[2]
        self._quat_at_reset = self._state.quat
        self._innovation_at_reset = innovation

    def wants_field(self, magcal: int, vehicle: Vehicle) -> bool:
        """Return whether the field is to be estimated."""
        if vehicle.on_ground and magcal != ALWAYS and magcal != GROUND_AND_CLIMBED:
            return False
        has_climbed = self.yaw_done and self.field_done
        if magcal == _IN_FLIGHT:
            return vehicle.in_flight
        if magcal == _MANOEUVRING:
            north, east, _ = self._state.accel_filtered
            return length2(north, east) > _MANOEUVRING_MSS
        if magcal == _AFTER_CLIMB:
            return has_climbed
        if magcal == GROUND_AND_CLIMBED:
            return has_climbed or not vehicle.in_flight
        return magcal == ALWAYS

    def request_for_field(self, vehicle: Vehicle) -> None:
        """Ask for an alignment as the field begins to be estimated, unless there was one."""
        if not self.field_set or (not self.field_done and vehicle.in_flight):
            self.is_requested = True

    def due(self, vehicle: Vehicle, innovation: float, climbed_m: float, aligned: bool) -> int:
        """Return which alignment is due."""
        if not self.yaw_done:
            quat = self._state.quat
            turns_slowly = angle_between(quat, self._quat_before) < _MAX_TURN
            self._quat_before = quat
            if turns_slowly and vehicle.tilt_aligned and not aligned:
                return INITIAL
            if turns_slowly and not vehicle.on_ground:
                if climbed_m > _FINAL_HEIGHT_M:
                    return FINAL
                if self._is_anomalous(innovation):
                    return INTERIM
        return REQUESTED if self.is_requested else NOT_DUE

    def _is_anomalous(self, innovation: float) -> bool:
        climbs = self._down_at_reset - self._state.pos[2] > _ANOMALY_CLIMB_M
        increase = abs(innovation) - abs(self._innovation_at_reset)
        turned = angle_between(self._quat_at_reset, self._state.quat) > increase
        return self._anomalies < _MAX_ANOMALIES and climbs and increase > _ANOMALY_INNOVATION and not turned

    def note_yaw(self, vehicle: Vehicle) -> None:
        """Note that yaw was set, by whatever."""
        self.is_requested = False
        self.yaw_done = self.yaw_done or vehicle.in_flight

    def note_field(self, vehicle: Vehicle, innovation: float) -> None:
        """Note that the field was set."""
        self.field_set = True
        self.field_done = self.field_done or vehicle.in_flight
        self._keep_reset(innovation)

    def note_anomaly(self) -> None:
        """Note an alignment that is not the last one of the flight."""
        self._anomalies += 1
        self.yaw_done = False
        self.field_done = False
