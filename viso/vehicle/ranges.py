# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Range finders, and their drivers: of messages, of the simulator's sensor, and of its voltage.

Source: AP_RangeFinder/AP_RangeFinder.cpp, AP_RangeFinder_Backend.cpp, AP_RangeFinder_MAVLink.cpp,
AP_RangeFinder_SITL.cpp, AP_RangeFinder_analog.cpp.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from ap_core.cint import i8, int_of_float, u16, u32
from ap_core.clock import NEVER, Clock
from ap_core.fmath import f32
from ap_core.param import FromParams, ParamTable
from ap_core.sinks import RecordSink
from ekf_stub.inputs.measurements import DOWNWARD, FinderState, RangeState, RangeStatus
from ekf_stub.reports import Three
from mav_handlers.wire.messages import DISTANCE_SENSOR
from viso.firmware.log_releases import RFND
from viso.parameters.releases import STABLE_4_7, RangeUnit
from viso.parameters.sensors import RANGE_FINDERS
from viso.vehicle.simulated_ranges import SimulatedRanges

RANGE_TYPE_NONE: Final = 0
RANGE_TYPE_ANALOG: Final = 1
RANGE_TYPE_MAVLINK: Final = 10
RANGE_TYPE_SIMULATED: Final = 100
RANGE_PERIOD_US: Final = 50_000
FIRST_RANGE_US: Final = 2_500_000  # phase of the reference's updates, in all recordings
TIMEOUT_MS: Final = 500
MASK_LOG_CTUN: Final = 1 << 4

NO_PIN: Final = -1
SIMULATED_PIN: Final = 0

_CENTI: Final = f32(0.01)
_MILLI: Final = f32(0.001)
_HUNDRED: Final = f32(100)
_THOUSAND: Final = f32(1000)
_ZERO: Final = f32(0)
_OF_UNKNOWN_KIND: Final = 4  # MAV_DISTANCE_SENSOR_UNKNOWN
_UNKNOWN_QUALITY: Final = -1
_WORST_QUALITY: Final = 0
_HAVE_NO_DATA: Final = (RangeStatus.NOT_CONNECTED, RangeStatus.NO_DATA)


@dataclass(frozen=True, slots=True)
class RangeReport:
    """What a range finder says: its number, kind and orientation as DISTANCE_SENSOR has them, ranges in m.

    ``quality`` is in percent, -1 unknown.
    """

    number: int
    kind: int
    orientation: int
    distance: float
    least: float
    most: float
    quality: int


class _Setting(NamedTuple):
    """The parameters of a range finder: metres; its place in body (FRD)."""

    type: int
    orientation: int
    least: np.float32
    most: np.float32
    ground_clearance: np.float32
    place_frd: Three


class _Finder:
    """A range finder, of a driver's kind that its type at boot chose.

    Attributes:
        kind: as DISTANCE_SENSOR has it.
        distance, volts, quality: what it measured last, m, by which voltage, 0 if by none, and how good that is in
            percent, -1 unknown.
    """

    kind = _OF_UNKNOWN_KIND

    def __init__(self, number: int, params: ParamTable, unit: RangeUnit) -> None:
        self._prefix = f"RNGFND{number}_"
        self._params = params
        self._unit = unit
        self.setting = FromParams(params, self._read)
        self._status = RangeStatus.NOT_CONNECTED
        self.distance = self.volts = f32(0)
        self.quality = _UNKNOWN_QUALITY

    def _read(self) -> _Setting:
        params, prefix, unit = self._params, self._prefix, self._unit
        least, most, clearance = (
            f32(params.get_number(prefix + name)) * unit.metres for name in (unit.least, unit.most, unit.clearance)
        )
        x, y, z = (float(params.get_float(f"{prefix}POS_{axis}")) for axis in "XYZ")
        kind, orientation = (params.get_int(prefix + name) for name in ("TYPE", "ORIENT"))
        return _Setting(kind, orientation, least, most, clearance, (x, y, z))

    @property
    def is_there(self) -> bool:
        """Whether it has not been switched off since boot."""
        return self.setting().type != RANGE_TYPE_NONE

    @property
    def status(self) -> RangeStatus:
        """What its range is worth."""
        return self._status if self.is_there else RangeStatus.NOT_CONNECTED

    @property
    def has_data(self) -> bool:
        """Whether ranges come in, good or not."""
        return self._status not in _HAVE_NO_DATA

    def take(self, packet: DISTANCE_SENSOR, now_ms: int) -> bool:
        """Take a range of a message; return whether it is for this range finder."""
        return False

    def lacks_pin(self) -> bool:
        """Return whether it needs a pin and has none."""
        return False

    def measure(self, now_ms: int) -> bool:
        """Measure; return whether there is a range."""
        raise NotImplementedError

    def update(self, now_ms: int) -> None:
        """Make what is measured now known (AP_RangeFinder_Backend::update_status)."""
        if not self.is_there:
            self._status = RangeStatus.NOT_CONNECTED
        elif not self.measure(now_ms):
            self._status = RangeStatus.NO_DATA
        else:
            least, most = self.limits()
            is_near, is_far = self.distance < least, self.distance > most
            near_or_good = RangeStatus.TOO_NEAR if is_near else RangeStatus.GOOD
            self._status = RangeStatus.TOO_FAR if is_far else near_or_good

    def limits(self) -> tuple[np.float32, np.float32]:
        """Return the shortest and the longest range that counts, m."""
        setting = self.setting()
        return setting.least, setting.most


class _MavlinkFinder(_Finder):
    """A range finder whose ranges come in messages."""

    def __init__(self, number: int, params: ParamTable, unit: RangeUnit) -> None:
        super().__init__(number, params, unit)
        self._heard_ms = 0
        self._heard: DISTANCE_SENSOR | None = None
        self.kind = 0

    def take(self, packet: DISTANCE_SENSOR, now_ms: int) -> bool:
        """Take a range; return whether it is measured in the direction of this range finder."""
        if not self.is_there or packet.orientation != self.setting().orientation:
            return False
        self._heard, self._heard_ms = packet, now_ms
        self.kind = packet.type
        return True

    def measure(self, now_ms: int) -> bool:
        """Take what was heard last, if that is not long ago."""
        if self._heard is None or u32(now_ms - self._heard_ms) > TIMEOUT_MS:
            self.distance, self.quality = f32(0), _UNKNOWN_QUALITY
            return False
        self.distance = f32(self._heard.current_distance) * _CENTI
        self.quality = _quality(self._heard.signal_quality)
        return True

    def limits(self) -> tuple[np.float32, np.float32]:
        """Return the shortest and the longest range that counts, m: the closer of its own and those of messages."""
        (own_least, own_most), heard = super().limits(), self._heard
        if heard is None or heard.min_distance == heard.max_distance == 0:
            return own_least, own_most
        least, most = (f32(limit) * _CENTI for limit in (heard.min_distance, heard.max_distance))
        return max(own_least, least), min(own_most, most)


class _SimulatedFinder(_Finder):
    """The simulator's range finder."""

    def __init__(self, number: int, params: ParamTable, unit: RangeUnit, simulated: SimulatedRanges) -> None:
        super().__init__(number, params, unit)
        self._simulated = simulated

    def measure(self, now_ms: int) -> bool:
        """Take its range; with nothing in sight there is none."""
        range_m = self._simulated.range_m
        if math.isinf(range_m):
            return False
        self.distance = f32(range_m)
        return True


class _Function(IntEnum):
    """How a range follows from a voltage (RNGFNDn_FUNCTION)."""

    LINEAR = 0
    INVERTED = 1
    HYPERBOLA = 2


class _AnalogFinder(_Finder):
    """A range finder whose range is a voltage on a pin; the simulator's is on pin 0, and there is none on others."""

    def __init__(self, number: int, params: ParamTable, unit: RangeUnit, simulated: SimulatedRanges) -> None:
        super().__init__(number, params, unit)
        self._simulated = simulated
        self._pin = FromParams(params, lambda: params.get_int(f"{self._prefix}PIN"))

    def lacks_pin(self) -> bool:
        """Return whether no pin is set."""
        return self._pin() == NO_PIN

    def measure(self, now_ms: int) -> bool:
        """Take the range that the voltage means, in whole mV; without one it is that of 0 V."""
        volts = f32(self._simulated.volts if self._pin() == SIMULATED_PIN else 0.0)
        self.volts = f32(u16(int_of_float(float(volts * _THOUSAND)))) * _MILLI
        self.distance = max(self._range(self.volts), _ZERO)
        return True

    def _range(self, volts: np.float32) -> np.float32:
        params, prefix = self._params, self._prefix
        scaling, offset = params.get_float(f"{prefix}SCALING"), params.get_float(f"{prefix}OFFSET")
        match params.get_int(f"{prefix}FUNCTION"):
            case _Function.LINEAR:
                return f32((volts - offset) * scaling)
            case _Function.INVERTED:
                return f32((offset - volts) * scaling)
            case _Function.HYPERBOLA if volts > offset:
                return min(f32(scaling / (volts - offset)), self.setting().most)
        return _ZERO


def whole_cm(metres: np.float32) -> int:
    """Return the whole centimetres of a length (AP_RangeFinder_Backend::distance_cm, up to 4.6)."""
    return int(metres * _HUNDRED)


def _quality(signal_quality: int) -> int:
    # A message has 0 for unknown and 1 for the worst.
    return {0: _UNKNOWN_QUALITY, 1: _WORST_QUALITY}.get(signal_quality, i8(signal_quality))


def _report(number: int, finder: _Finder) -> RangeReport:
    (least, most), setting = map(float, finder.limits()), finder.setting()
    distance = float(finder.distance)
    return RangeReport(number - 1, finder.kind, setting.orientation, distance, least, most, finder.quality)


def _make_finder(number: int, params: ParamTable, unit: RangeUnit, simulated: SimulatedRanges | None) -> _Finder | None:
    """Return a range finder of the type that its parameters ask for; None if there is none of that type."""
    kind = params.get_int(f"RNGFND{number}_TYPE")
    if kind == RANGE_TYPE_MAVLINK:
        return _MavlinkFinder(number, params, unit)
    if simulated is not None and kind == RANGE_TYPE_SIMULATED:
        return _SimulatedFinder(number, params, unit, simulated)
    if simulated is not None and kind == RANGE_TYPE_ANALOG and params.get_int(f"RNGFND{number}_PIN") != NO_PIN:
        return _AnalogFinder(number, params, unit, simulated)
    return None


class RangeFinders:
    """The range finders, each of the driver that its RNGFNDn_TYPE chose at boot.

    Args:
        clock, params, logger: the vehicle's.
        unit: that of the release's parameters.
        simulated: the simulator's range finder; None of a vehicle that nobody flies.
    """

    def __init__(
        self,
        clock: Clock,
        params: ParamTable,
        logger: RecordSink,
        unit: RangeUnit = STABLE_4_7.range_unit,
        simulated: SimulatedRanges | None = None,
    ) -> None:
        self._clock = clock
        self._params = params
        self._logger = logger
        self._unit = unit
        self._simulated = simulated
        made = ((number, _make_finder(number, params, unit, simulated)) for number in range(1, RANGE_FINDERS + 1))
        self._finders: Mapping[int, _Finder] = {number: finder for number, finder in made if finder is not None}
        self._told: dict[int, FinderState] = {}
        self._state = self._find_state()
        self.is_enabled = self._downward() is not None

    def _present(self) -> dict[int, _Finder]:
        return {number: finder for number, finder in self._finders.items() if finder.is_there}

    def _downward(self) -> _Finder | None:
        """Return the first that looks down and has a good range, else the first that looks down (find_instance)."""
        down = [finder for finder in self._present().values() if finder.setting().orientation == DOWNWARD]
        good = (finder for finder in down if finder.status is RangeStatus.GOOD)
        return next(good, down[0] if down else None)

    def take(self, packet: DISTANCE_SENSOR) -> bool:
        """Take a range; return whether a range finder has its direction (RangeFinder::handle_msg)."""
        now_ms = self._clock.millis()
        takers = [finder for finder in self._finders.values() if finder.take(packet, now_ms)]
        return bool(takers)

    def idle_until_us(self) -> int:
        """Return before when ``update`` has nothing to do; 0 if the next one may."""
        return NEVER if not self._finders else 0

    def update(self) -> None:
        """Make what is measured known, 20 times per second (RangeFinder::update)."""
        if not self._finders:
            return
        if self._simulated is not None:
            self._simulated.measure()
        for finder in self._finders.values():
            finder.update(self._clock.millis())
        state = self._find_state()
        if state != self._state:
            self._state = state
        if self._params.get_int("LOG_BITMASK") & MASK_LOG_CTUN:
            for number, finder in self._present().items():
                dist = whole_cm(finder.distance) if self._unit.is_cm else finder.distance
                reading = dist, finder.status, finder.setting().orientation, finder.quality
                self._logger.write(RFND, (self._clock.micros64(), number - 1, *reading))

    def state(self) -> RangeState | None:
        """Return the ranges for the estimator, the same object until they change; None without range finders."""
        return self._state

    def _find_state(self) -> RangeState | None:
        if not self._finders:
            return None
        # Of one that is switched off the estimator keeps what it was told last; what lies between is not connected.
        for number, finder in self._present().items():
            setting = finder.setting()
            distance = f32(whole_cm(finder.distance)) * _CENTI if self._unit.is_cm else finder.distance
            self._told[number] = FinderState(setting.place_frd, float(distance), setting.orientation, finder.status)
        down = self._downward()
        clearance = 0.0 if down is None else float(down.setting().ground_clearance)
        most = 0.0 if down is None else float(down.limits()[1])
        count = max(self._finders)
        finders = (self._told.get(number, _ABSENT) for number in range(1, count + 1))
        return RangeState(tuple(finders), clearance, most)

    # What the vehicle tells

    def is_present(self) -> bool:
        """Return whether one looks down (RangeFinder::has_orientation)."""
        return self._downward() is not None

    def has_data(self) -> bool:
        """Return whether ranges come in from the one that looks down (RangeFinder::has_data_orient)."""
        down = self._downward()
        return down is not None and down.has_data

    def downward(self) -> tuple[float, float] | None:
        """Return the range of the one that looks down, m, and the voltage that means it, V; None without any."""
        down = self._downward()
        return None if down is None else (float(down.distance), float(down.volts))

    def reports(self) -> list[RangeReport]:
        """Return the data of each range finder that has any."""
        return [_report(number, finder) for number, finder in self._present().items() if finder.has_data]

    def failure(self) -> str | None:
        """Return what is wrong with the first that does not work, or None (RangeFinder::prearm_healthy)."""
        for number in range(1, RANGE_FINDERS + 1):
            finder = self._finders.get(number)
            if self._params.get_int(f"RNGFND{number}_TYPE") == RANGE_TYPE_NONE:
                continue
            if finder is not None and finder.lacks_pin():
                return f"RNGFND{number}_PIN not set"
            what = "Not Detected" if finder is None else _FAILURES.get(finder.status)
            if what is not None:
                return f"Rangefinder {number:X}: {what}"
        return None


_ABSENT: Final = FinderState((0.0, 0.0, 0.0), 0.0, 0, RangeStatus.NOT_CONNECTED)
_FAILURES: Final = {RangeStatus.NO_DATA: "No Data", RangeStatus.NOT_CONNECTED: "Not Connected"}
