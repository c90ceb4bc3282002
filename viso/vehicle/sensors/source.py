# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every source of inertial data is to the vehicle, its options, and when barometer and compass are read.

The reference reads both ten times per second, and its filter gets a reading in the next pass of the main loop.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ap_core.clock import NEVER
from ap_core.declination import get_declination_rad, get_earth_field_ga
from ap_core.location import Location
from ap_core.param import ParamTable
from ekf_stub.core.vectors import Quat
from ekf_stub.inputs.measurements import Array
from ekf_stub.inputs.sensors import SensorSource
from mav_handlers.wire.messages import HIL_SENSOR, HIL_STATE_QUATERNION
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.errors import NO_ERRORS, ErrorModel, SensorErrors, to_single
from viso.vehicle.sensors.flight import Event, Flight
from viso.vehicle.sensors.vectors import to_body


@dataclass(frozen=True, slots=True)
class ImuOptions:
    """The options of a source of inertial data.

    Attributes:
        heading_rad: where the vehicle points at first, if the source itself does not know.
        has_compass: says whether there is a compass, and in use.
        errors: what is wrong with the sensors.
        seed: of the random part of the errors.
        params: the vehicle's parameters, by which sensors of a vehicle that flies err; None for none that err.
        with_each_imu: whether each IMU of a vehicle that flies has data of its own, as many as SIM_IMU_COUNT says, with
            the calibration that INS_ parameters say; otherwise all have the same, and one filter stands for all cores.
        home: where the vehicle starts; None for where the firmware's simulator does. A vehicle that nobody flies is
            then at the filter's origin, as soon as there is one.
    """

    heading_rad: float = 0.0
    has_compass: Callable[[], bool] = lambda: False
    errors: SensorErrors = NO_ERRORS
    seed: int = 0
    params: ParamTable | None = None
    with_each_imu: bool = False
    home: Location | None = None


PERIOD_US: Final = 100_000
PHASE_US: Final = 50_000
HOME: Final = Location(-353632610, 1491652300, 58409)
"""Where the reference's simulator stands, and a vehicle of which nobody says where it starts."""


def last_reading_us(now_us: int) -> int | None:
    """Return when the newest reading was taken that a pass of the main loop sees, in us since boot; None if never."""
    reading_us = (now_us - 1 - PHASE_US) // PERIOD_US * PERIOD_US + PHASE_US
    return reading_us if reading_us >= 0 else None


def ideal_field(place: Location | None, quat: Quat) -> Array:
    """Return the magnetic field at a place in mGauss, body (FRD), of an attitude, body to earth (NED).

    Without a place it is that of ``HOME``, turned to true north.
    """
    north, east, down = (1e3 * float(part) for part in get_earth_field_ga(place or HOME).to_tuple())
    if place is None:
        north, east = math.hypot(north, east), 0.0
    return to_single(to_body(quat, (north, east, down)))


class VehicleSource(SensorSource):
    """The sensors of a vehicle, and what else moves along with them.

    Attributes:
        place: on earth, from which its positions count; its compass measures the field there. None while nobody says
            where a vehicle stands that nobody flies: its compass points to true north then.
        knows_declination: its compass knows the declination of a place.
        airframe: what flies; None of a vehicle that nobody flies.
        flight: the flight of a log that is flown again; None of a vehicle that does something else.
        stands_for_ever: nothing can move it.
    """

    airframe: Airframe | None = None
    flight: Flight | None = None
    stands_for_ever = False

    def __init__(self, options: ImuOptions) -> None:
        self._options = options
        self._model = ErrorModel(options.errors, options.seed)
        self._next_reading_us = 0
        self._baro: tuple[int, float] | None = None
        self._mag: tuple[int, Array] | None = None
        self.place = options.home
        self._declination = 0.0
        self.knows_declination = False

    @property
    def home(self) -> Location:
        """Where its positions count from on earth; the simulator's home while nobody says so."""
        return self.place or HOME

    def stand_at(self, origin: Location) -> None:
        """Let the compass know the declination of the filter's origin, and stand there unless a home is given."""
        self.learn_declination(origin)
        if self._options.home is None and self.airframe is None:
            self.place = origin

    def learn_declination(self, place: Location) -> None:
        """Let the compass know the declination of a place (Compass::try_set_initial_location)."""
        self.knows_declination, self._declination = True, float(get_declination_rad(place))

    def _read(self, now_us: int, height_m: float, quat: Quat) -> None:
        """Read the barometer, and the compass if there is one, of a vehicle with an attitude (body to NED)."""
        reading_us = last_reading_us(now_us)
        if reading_us is None:
            return
        self._next_reading_us = reading_us + PERIOD_US
        self._baro = reading_us // 1000, float(np.float32(height_m))
        self._mag = (reading_us, ideal_field(self.place, quat)) if self._options.has_compass() else None

    def next_event_us(self) -> int:
        """Return the time of the next event that sensors do not show, us since boot."""
        return NEVER

    def events_until(self, now_us: int) -> Iterable[Event]:
        """Return what has happened since the last call, up to a time."""
        return ()

    def take_hil_sensor(self, message: HIL_SENSOR, now_us: int) -> bool:
        """Take a simulator's sensors at a time in us since boot; return whether the data come from a simulator."""
        return False

    def take_hil_state(self, message: HIL_STATE_QUATERNION, now_us: int) -> bool:
        """Take a simulator's truth at a time in us since boot; return whether the data come from a simulator."""
        return False
