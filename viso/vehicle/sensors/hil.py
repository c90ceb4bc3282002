# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors that a simulator sends over MAVLink, as HIL_SENSOR or HIL_STATE_QUATERNION.

The firmware has no handler for either: this is an input of the emulator only.
"""

import math
from collections import Counter
from typing import Final

import numpy as np

from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import Quat, euler_of, normalized, scaled
from ekf_stub.inputs.measurements import Array
from ekf_stub.inputs.sensors import Sensors
from mav_handlers.wire.messages import HIL_SENSOR, HIL_STATE_QUATERNION
from viso.vehicle.sensors.errors import exact_delta, to_single
from viso.vehicle.sensors.source import PERIOD_US, ImuOptions, VehicleSource, ideal_field, last_reading_us
from viso.vehicle.sensors.vectors import ZERO, Three, added, halfway, rotation_between, to_body

NEWEST_WEIGHT: Final = 0.02
SHORTEST, LONGEST = 0.25, 4.0
"""Of an interval that is used, in average ones."""

LATE_US: Final = 1_000_000
"""What is older than the newest message by less is late; by more, time has restarted."""

REFERENCE_US: Final = 1_000_000
"""How long heights are averaged for their zero."""

_USUAL_US: Final = (1000.0, 100_000.0)
_SEA_LEVEL_HPA: Final = 1013.25
_ISA_SCALE_M: Final = 288.15 / 0.0065
_ISA_EXPONENT: Final = 287.053 * 0.0065 / 9.80665


def isa_height_m(pressure_hpa: float) -> float:
    """Return the height of the standard atmosphere (troposphere) at a pressure above 0."""
    return _ISA_SCALE_M * (1.0 - math.pow(pressure_hpa / _SEA_LEVEL_HPA, _ISA_EXPONENT))


class MessageTime:
    """Intervals of messages by their stamps, us."""

    def __init__(self) -> None:
        self._last_us: int | None = None
        self._average_us = 0.0
        self._intervals = 0

    def refusal(self, time_us: int) -> str | None:
        """Return why a message of that time is of no use, or None."""
        if self._last_us is None or not 0 <= self._last_us - time_us < LATE_US:
            return None
        return "repeated" if time_us == self._last_us else "late"

    def interval_us(self, time_us: int) -> int | None:
        """Return how long after the message before one comes that is not refused; None if time begins with it."""
        last_us, self._last_us = self._last_us, time_us
        return None if last_us is None or time_us < last_us else time_us - last_us

    def restart(self) -> None:
        """Start the time with the next message."""
        self._last_us = None

    def limited_s(self, interval_us: int) -> float:
        """Return an interval in s, within what is usual, and learn from it what is."""
        low, high = _USUAL_US
        if self._intervals:
            low, high = max(low, 0.5 * self._average_us), min(high, 2.0 * self._average_us)
        self._intervals += 1
        weight = max(1.0 / self._intervals, NEWEST_WEIGHT)
        self._average_us += weight * (max(low, min(float(interval_us), high)) - self._average_us)
        return 1e-6 * max(SHORTEST * self._average_us, min(float(interval_us), LONGEST * self._average_us))


class RelativeHeight:
    """Heights above the average of the first second."""

    def __init__(self) -> None:
        self._first_us: int | None = None
        self._sum = 0.0
        self._count = 0

    def take(self, time_us: int, height_m: float) -> float | None:
        """Return a height above the reference, or None until the reference is known."""
        if self._first_us is None:
            self._first_us = time_us
        if self._count and not 0 <= time_us - self._first_us < REFERENCE_US:
            return height_m - self._sum / self._count
        self._sum += height_m
        self._count += 1
        return None


UPDATED_INERTIAL: Final = 0b111111
UPDATED_MAG: Final = 0b111 << 6
UPDATED_ABS_PRESSURE: Final = 1 << 9
UPDATED_PRESSURE_ALT: Final = 1 << 11
UPDATED_RESET: Final = 1 << 31

MAX_ACCEL: Final = 320.0
MAX_RATE: Final = 70.0
MAX_FIELD_GAUSS: Final = 10.0
PRESSURE_HPA: Final = (10.0, 1200.0)
HEIGHT_M: Final = (-1000.0, 50_000.0)

GAP_US: Final = 100_000
"""What would fill a longer gap between two messages is left out, and what waits for longer is dropped."""

SENSOR_PREFERRED_US: Final = 1_000_000
"""How long after a HIL_SENSOR the other message is ignored."""

_LENGTH_TOLERANCE: Final = 0.1


class HilSource(VehicleSource):
    """The data of a simulator's messages; the loop of the filter runs at their rate, and waits while there are none.

    HIL_SENSOR gives specific force and rates, which are multiplied by the time since the message before, limited to
    0.25..4 average intervals; height, by ``pressure_alt`` if that is marked as new, otherwise by ``abs_pressure`` in
    the standard atmosphere; and the magnetic field. ``fields_updated`` 0 stands for all but ``pressure_alt``.

    HIL_STATE_QUATERNION serves where there is no HIL_SENSOR: angles and velocities are the differences of two messages,
    gravity included, so that no rounding adds up. Its rates and accelerations are not used: accelerations come in steps
    of 1 mG, and simulators differ in whether gravity is part of them. Heights are those of ``alt``, the magnetic field
    is what an ideal compass would show.

    Heights count from their average over the first second, and there are none before. Barometer and compass are read
    ten times per second.

    Attributes:
        ignored: how many messages, or readings in them, were not used, by reason.
    """

    def __init__(self, options: ImuOptions) -> None:
        super().__init__(options)
        self._sensor_time, self._state_time = MessageTime(), MessageTime()
        self._altitude, self._pressure_height, self._state_height = RelativeHeight(), RelativeHeight(), RelativeHeight()
        self._sensor_us: int | None = None
        self._force: Three | None = None
        self._quat: Quat | None = None
        self._vel: Three = ZERO
        self._clear()
        self._height: float | None = None
        self._field: Array | None = None
        self.ignored: Counter[str] = Counter()

    # What the sensors say

    def sense(self, now_us: int) -> Sensors | None:
        """Return what has come since the last call, or None if that is nothing."""
        if not self._dt:
            return None
        delta = exact_delta(self._del_vel, self._del_ang, self._dt)
        self._clear()
        if now_us > self._next_reading_us:
            self._read_received(now_us)
        return self._model.apply(Sensors(delta, self._baro, self._mag, self._declination))

    def _read_received(self, now_us: int) -> None:
        reading_us = last_reading_us(now_us)
        if reading_us is None:
            return
        self._next_reading_us = reading_us + PERIOD_US
        if self._height is not None:
            self._baro = reading_us // 1000, float(np.float32(self._height))
        if not self._options.has_compass():
            self._mag = None
        elif self._field is not None:
            self._mag = reading_us, self._field
        self._height = self._field = None

    def yaw_rad(self) -> float:
        """Return the heading in rad: the simulator's, or the compass's, or that of the options."""
        if self._quat is not None:
            return euler_of(self._quat)[2]
        if self._force is not None and self._mag is not None:
            return compass_yaw_rad(self._force, self._mag[1])
        return self._options.heading_rad

    def _clear(self) -> None:
        self._del_vel: Three = ZERO
        self._del_ang: Three = ZERO
        self._dt = 0.0

    def _add(self, del_vel: Three, del_ang: Three, dt: float) -> None:
        if self._dt and self._dt + dt > 1e-6 * GAP_US:
            self.ignored["not_asked_for"] += 1
            self._clear()
        self._del_vel, self._del_ang = added(self._del_vel, del_vel), added(self._del_ang, del_ang)
        self._dt += dt

    # HIL_SENSOR

    def take_hil_sensor(self, message: HIL_SENSOR, now_us: int) -> bool:
        """Take sensors that come at a time since boot; what cannot be used is counted in ``ignored``."""
        self._take_sensor(message, now_us)
        return True

    def _take_sensor(self, message: HIL_SENSOR, now_us: int) -> None:
        if message.fields_updated & UPDATED_RESET:
            self._sensor_time.restart()
        reason = "other_sensor" if message.id else self._sensor_time.refusal(message.time_usec)
        if reason is not None:
            self.ignored[reason] += 1
            return
        updated = message.fields_updated or UPDATED_INERTIAL | UPDATED_MAG | UPDATED_ABS_PRESSURE
        if updated & UPDATED_INERTIAL:
            self._take_inertial(message, now_us)
        if updated & UPDATED_MAG:
            self._take_field(message)
        if updated & (UPDATED_PRESSURE_ALT | UPDATED_ABS_PRESSURE):
            self._take_pressure(message, has_altitude=bool(updated & UPDATED_PRESSURE_ALT))

    def _take_inertial(self, message: HIL_SENSOR, now_us: int) -> None:
        force, rate = (message.xacc, message.yacc, message.zacc), (message.xgyro, message.ygyro, message.zgyro)
        if not (_all_within(force, MAX_ACCEL) and _all_within(rate, MAX_RATE)):
            self.ignored["absurd_inertial_data"] += 1
            return
        self._force, self._sensor_us = force, now_us
        interval_us = self._sensor_time.interval_us(message.time_usec)
        if interval_us is not None:
            dt = self._sensor_time.limited_s(interval_us)
            self._add(scaled(force, dt), scaled(rate, dt), dt)

    def _take_field(self, message: HIL_SENSOR) -> None:
        field = message.xmag, message.ymag, message.zmag
        if _all_within(field, MAX_FIELD_GAUSS) and any(field):
            self._field = to_single(scaled(field, 1000.0))
        else:
            self.ignored["absurd_field"] += 1

    def _take_pressure(self, message: HIL_SENSOR, *, has_altitude: bool) -> None:
        if has_altitude and HEIGHT_M[0] <= message.pressure_alt <= HEIGHT_M[1]:
            self._height = self._altitude.take(message.time_usec, message.pressure_alt)
        elif not has_altitude and PRESSURE_HPA[0] <= message.abs_pressure <= PRESSURE_HPA[1]:
            self._height = self._pressure_height.take(message.time_usec, isa_height_m(message.abs_pressure))
        else:
            self.ignored["absurd_pressure"] += 1

    # HIL_STATE_QUATERNION

    def take_hil_state(self, message: HIL_STATE_QUATERNION, now_us: int) -> bool:
        """Take the truth that comes at a time since boot; what cannot be used is counted in ``ignored``."""
        self._take_state(message, now_us)
        return True

    def _take_state(self, message: HIL_STATE_QUATERNION, now_us: int) -> None:
        w, x, y, z = message.attitude_quaternion
        reason = self._state_time.refusal(message.time_usec)
        if not abs(math.hypot(w, x, y, z) - 1.0) <= _LENGTH_TOLERANCE:
            reason = "absurd_attitude"
        if reason is not None:
            self.ignored[reason] += 1
            return
        before, vel_before = self._quat, self._vel
        self._quat, self._vel = normalized((w, x, y, z)), (0.01 * message.vx, 0.01 * message.vy, 0.01 * message.vz)
        interval_us = self._state_time.interval_us(message.time_usec)
        if self._sensor_us is not None and now_us - self._sensor_us < SENSOR_PREFERRED_US:
            self.ignored["state_beside_sensor"] += 1
            return
        self._height = self._state_height.take(message.time_usec, 1e-3 * message.alt)
        self._field = ideal_field(self.place, self._quat)
        if before is not None and interval_us is not None:
            self._add_difference(before, self._quat, vel_before, interval_us)

    def _add_difference(self, before: Quat, quat: Quat, vel_before: Three, interval_us: int) -> None:
        if interval_us > GAP_US:
            self.ignored["after_gap"] += 1
            return
        dt = 1e-6 * interval_us
        del_vel_ned = added(added(self._vel, vel_before, -1.0), (0.0, 0.0, -GRAVITY_MSS * dt))
        del_ang = rotation_between(before, quat)
        if not (_all_within(del_vel_ned, MAX_ACCEL * dt) and _all_within(del_ang, MAX_RATE * dt)):
            self.ignored["absurd_inertial_data"] += 1
            return
        self._add(to_body(halfway(before, quat), del_vel_ned), del_ang, dt)


def _all_within(vector: Three, limit: float) -> bool:
    # NaN is within nothing.
    return all(abs(part) <= limit for part in vector)


def compass_yaw_rad(force: Three, field: Array) -> float:
    """Return the heading that a magnetic field shows; the specific force of a vehicle at rest tells where down is.

    Both are of the body frame (FRD), in any unit; declination is 0.
    """
    roll, pitch = math.atan2(-force[1], -force[2]), math.atan2(force[0], math.hypot(force[1], force[2]))
    x, y, z = field.tolist()
    level_x = x * math.cos(pitch) + (y * math.sin(roll) + z * math.cos(roll)) * math.sin(pitch)
    return math.atan2(z * math.sin(roll) - y * math.cos(roll), level_x)
