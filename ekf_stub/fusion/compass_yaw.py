# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When yaw and magnetic field are set by the compass, and how the field is fused (controlMagYawReset).

Source: AP_NavEKF3/AP_NavEKF3_MagFusion.cpp, AP_NavEKF3/AP_NavEKF3_Control.cpp (setWindMagStateLearningMode).
"""

import math
from typing import Final

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import limited
from ekf_stub.fusion.height_source import Vehicle

FINAL_HEIGHT_M: Final = 2.5
MAX_TURN: Final = 0.1745
ANOMALY_CLIMB_M: Final = 0.5
ANOMALY_INNOVATION: Final = 0.25
MAX_ANOMALIES: Final = 2
NEVER, IN_FLIGHT, MANOEUVRING, AFTER_CLIMB, ALWAYS, GROUND_AND_CLIMBED = 2, 0, 1, 3, 4, 7  # EK3_MAG_CAL
ON_GROUND: Final = (ALWAYS, GROUND_AND_CLIMBED)
MANOEUVRING_MSS: Final = 0.5


def angle_between(first: quaternion.quaternion, second: quaternion.quaternion) -> float:
    """Return the angle from one attitude to another, rad."""
    turn = (first * second.conjugate()).normalized()
    return 2 * math.acos(limited(abs(turn.w), 0.0, 1.0))


class CompassAlignment:
    """Which alignments have been made, and which is due.

    Attributes:
        yaw_done, field_done: the final ones of this flight, of yaw and of the magnetic field.
        field_set: the field has been set at all.
        is_requested: an alignment is wanted for another reason.
    """

    def __init__(self, state: ErrorState) -> None:
        self._state = state
        self.yaw_done = self.field_done = self.field_set = self.is_requested = False
        self._quat_before = state.quat
        self._anomalies = 0
        self._quat_at_reset = state.quat
        self._down_at_reset = self._innovation_at_reset = 0.0

    def update(self, vehicle: Vehicle, innovation: float) -> None:
        """Follow the vehicle on the ground, in each frame in which something may have changed."""
        if not vehicle.on_ground:
            return
        self.yaw_done = self.field_done = False
        self._anomalies = 0
        if self.field_set:
            self._snapshot(innovation)

    def _snapshot(self, innovation: float) -> None:
        self._down_at_reset = self._state.down
        self._quat_at_reset = self._state.quat
        self._innovation_at_reset = innovation

    def wants_field(self, magcal: int, vehicle: Vehicle) -> bool:
        """Return whether the field is to be estimated."""
        moves = math.hypot(*self._state.accel_filtered[:2].tolist()) > MANOEUVRING_MSS
        has_climbed = self.yaw_done and self.field_done
        wanted = {
            IN_FLIGHT: vehicle.in_flight,
            MANOEUVRING: moves,
            AFTER_CLIMB: has_climbed,
            ALWAYS: True,
            GROUND_AND_CLIMBED: has_climbed or not vehicle.in_flight,
        }
        return wanted.get(magcal, False) and not (vehicle.on_ground and magcal not in ON_GROUND)

    def request_for_field(self, vehicle: Vehicle) -> None:
        """Ask for an alignment as the field begins to be estimated, unless there was one."""
        if not self.field_set or (not self.field_done and vehicle.in_flight):
            self.is_requested = True

    def due(self, vehicle: Vehicle, innovation: float, climbed_m: float, *, aligned: bool) -> str | None:
        """Return which alignment is due: ``initial``, ``final``, ``interim``, ``requested``, or None."""
        initial = final = interim = False
        if not self.yaw_done:
            turns_slowly = angle_between(self._state.quat, self._quat_before) < MAX_TURN
            self._quat_before = self._state.quat
            initial = turns_slowly and vehicle.tilt_aligned and not aligned
            if turns_slowly and not vehicle.on_ground:
                final = climbed_m > FINAL_HEIGHT_M
                interim = not final and self._is_anomalous(innovation)
        reasons = {"initial": initial, "final": final, "interim": interim, "requested": self.is_requested}
        return next((reason for reason, holds in reasons.items() if holds), None)

    def _is_anomalous(self, innovation: float) -> bool:
        climbs = self._down_at_reset - self._state.down > ANOMALY_CLIMB_M
        increase = abs(innovation) - abs(self._innovation_at_reset)
        turned = angle_between(self._quat_at_reset, self._state.quat) > increase
        return self._anomalies < MAX_ANOMALIES and climbs and increase > ANOMALY_INNOVATION and not turned

    def note_yaw(self, vehicle: Vehicle) -> None:
        """Note that yaw was set, by whatever."""
        self.is_requested = False
        self.yaw_done = self.yaw_done or vehicle.in_flight

    def note_field(self, vehicle: Vehicle, innovation: float) -> None:
        """Note that the field was set."""
        self.field_set = True
        self.field_done = self.field_done or vehicle.in_flight
        self._snapshot(innovation)

    def note_anomaly(self) -> None:
        """Note an alignment that is not the last one of the flight."""
        self._anomalies += 1
        self.yaw_done = self.field_done = False
