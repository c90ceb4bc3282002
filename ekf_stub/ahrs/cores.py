# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cores that a vehicle runs, from its parameters and IMUs (AP_NavEKF3/AP_NavEKF3.cpp, InitialiseFilter).

Cores that are given the same say the same: where all IMUs do so, one filter stands for all cores.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

from ap_core.internal_error import InternalErrors
from ap_core.param import FromParams, ParamTable
from ap_core.quaternion import Quaternion
from ap_core.sinks import RecordSink, TextSink
from ekf_stub.ahrs.vehicle_state import VehicleState, compass_in_use, imu_pos
from ekf_stub.core.core import AFFINITY_BARO, AFFINITY_GPS, AFFINITY_MAG, Core
from ekf_stub.core.ext_nav import ExtNav
from ekf_stub.core.imus import MAX_IMUS, Imus
from ekf_stub.core.inputs import Compasses, CompassReading
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.params import SET_PER_CORE, EkfSources, Params
from ekf_stub.core.samples import RingSizes
from ekf_stub.inputs.measurements import (
    FIX_3D,
    AllGps,
    BaroReading,
    ImuReading,
    PlaceCache,
    RangeState,
    first_healthy,
    first_usable,
    from_imu,
    gps_counted_from,
)
from ekf_stub.inputs.sensors import Sensors
from ekf_stub.log.ekf_log import EkfLog
from ekf_stub.log.replay_log import SensorSet
from ekf_stub.log.reporting import report_of
from ekf_stub.release import FilterRelease
from ekf_stub.reports import CoreReport, Three, words_of

MOST_LEAN_APART: Final = math.radians(10.0)
MOST_YAW_APART: Final = math.radians(20.0)
_COMPASSES: Final = SensorSet().compasses
_HERE: Final = (0.0, 0.0, 0.0)
_FLOW_MAX: Final = "FLOW_MAX"


class Cores:
    """The filters, their inputs, and their logs.

    ``imus`` has the IMU of each core, in the order of the cores; ``differ`` says how many IMUs differ, 0 for none, and
    ``baros_differ`` whether barometers do. In ``lanes`` is a filter for each core, or one for all.
    """

    def __init__(
        self,
        params: ParamTable,
        sources: EkfSources,
        logger: RecordSink,
        texts: TextSink,
        release: FilterRelease,
        buffers: Callable[[EkfSources], RingSizes],
        imus: Sequence[int],
        *,
        differ: int,
        baros_differ: bool,
        has_camera: bool,
    ) -> None:
        numbers = list(range(len(imus)))
        self._all_params = params
        self._texts = texts
        self._release = release
        self._differ = differ > 0
        self._has_camera = has_camera
        has_set_each = not release.shares_source_set and params.get_int("EK3_SRC_OPTIONS") & SET_PER_CORE != 0
        affinity = params.get_int("EK3_AFFINITY")
        has_gps_each = affinity & AFFINITY_GPS and params.get_int("GPS2_TYPE") != 0
        has_baro_each = affinity & AFFINITY_BARO and baros_differ
        has_own = differ or has_set_each or has_gps_each or has_baro_each
        self._groups = [(number,) for number in numbers] if has_own else [tuple(numbers)]
        self._imu_of_core = list(imus)
        self._params = Params()
        self._params_generation: int | None = None
        self._read_params()
        self._imus = Imus(max(differ, 1))
        self.lanes = Lanes(
            self._params,
            sources,
            [buffers(sources.of_core(group[0], release)) for group in self._groups],
            release,
            self._imus,
            [group[0] for group in self._groups],
            [imus[group[0]] for group in self._groups],
            len(imus),
        )
        self._logs = [EkfLog(logger, params.get_int, group, lambda: self.lanes.primary) for group in self._groups]
        self._affinity = FromParams(params, lambda: params.get_int("EK3_AFFINITY"))
        self._used_gps = [0] * len(self._groups)
        self._used_baros = [0] * len(self._groups)
        self._has_compass = compass_in_use(params)
        self._places = FromParams(params, lambda: _places(params))
        self._given: dict[tuple[str, int], tuple[object, ...]] = {}
        self._levers = PlaceCache(from_imu)
        self._ranges = PlaceCache(RangeState.counted_from)
        self._gps = PlaceCache(gps_counted_from)

    def _read_params(self) -> None:
        params = self._all_params
        if params.generation != self._params_generation:
            self._params_generation = params.generation
            renamed = {_FLOW_MAX: self._release.flow_limit}
            self._params.read(lambda name: params.get_number(f"EK3_{renamed.get(name, name)}"))

    # Inputs

    def set_vehicle(
        self,
        state: VehicleState,
        expected: tuple[bool, bool],
        *,
        lever_arm: Three,
        gps: AllGps,
        ranges: RangeState | None,
    ) -> None:
        """Set the state of the vehicle and the data of slow sensors, before the filters run.

        Args:
            state: of which arming and home count.
            expected: whether a take-off is expected, and whether a touchdown is.
            lever_arm: the camera's place from the first IMU, m, body (FRD).
            gps: the newest solutions, with antennas' places from the first IMU.
            ranges: with places from the first IMU.
        """
        self._read_params()
        has_compass, (takeoff_expected, touchdown_expected) = self._has_compass(), expected
        home_lat = 0 if state.home is None else state.home.lat
        for index, core in enumerate(self.lanes.cores):
            inputs, accel = core.inputs, self._imus.accel_of(core.imu)
            place = self._places()[accel] if self._differ else _HERE
            inputs.armed = state.armed
            inputs.takeoff_expected, inputs.touchdown_expected = takeoff_expected, touchdown_expected
            inputs.home_lat, inputs.has_compass = home_lat, has_compass
            self._used_gps[index] = self._gps_of(core, gps)
            solution = gps.of(self._used_gps[index])
            if self._has_changed("gps", core, solution, place):
                inputs.set_gps(None if solution is None else self._gps(core.number, solution, place))
            if self._has_changed("ranges", core, ranges, place):
                inputs.set_ranges(None if ranges is None else self._ranges(accel, ranges, place))
            if self._has_changed("lever_arm", core, lever_arm, place):
                inputs.set_lever_arm(self._levers(accel, lever_arm, place) if self._has_camera else lever_arm)

    def set_sensors(self, sensors: Sensors) -> None:
        """Set the data of barometer and compass, and which IMUs may be used."""
        own = bool(self._affinity() & AFFINITY_MAG)
        for index, core in enumerate(self.lanes.cores):
            self._used_baros[index] = self._baro_of(core, sensors.baros)
            baro = sensors.baros[self._used_baros[index]].timed_height if sensors.baros else sensors.baro
            if self._has_changed("baro", core, baro):
                core.inputs.set_baro(*(baro or (-1, 0.0)))
            if self._has_changed("mag", core, sensors.mag, own):
                core.inputs.set_compasses(_compasses_of(sensors, core.number if own else None))
            if self._has_changed("declination", core, sensors.declination):
                core.inputs.set_declination(sensors.declination)
        for imu, reading in zip(self._imus.imus, sensors.imus or (ImuReading(sensors.delta),), strict=False):
            imu.has_data, imu.has_gyro, imu.has_accel = True, reading.has_gyro, reading.has_accel
        self._imus.first_gyro, self._imus.first_accel = first_usable(sensors.imus)

    def _gps_of(self, core: Core, gps: AllGps) -> int:
        """Return the number of the GPS that a core uses (update_gps_selection)."""
        own = gps.of(core.number) if self._affinity() & AFFINITY_GPS else None
        return gps.primary if own is None or own.fix_type < FIX_3D else core.number

    def _baro_of(self, core: Core, baros: Sequence[BaroReading]) -> int:
        """Return the number of the barometer that a core uses (update_baro_selection)."""
        has_own = self._affinity() & AFFINITY_BARO and core.number < len(baros) and baros[core.number].is_healthy
        return core.number if has_own else first_healthy(baros)

    def _has_changed(self, name: str, core: Core, *given: object) -> bool:
        """Return whether an input differs from the one that a core was given last.

        Sources replace a solution, a reading or a field by a new object when it changes, and never change the object
        itself. The same object therefore is the same input.
        """
        before = self._given.get((name, core.number))
        if before is not None and all(map(_is_unchanged, before, given)):
            return False
        self._given[name, core.number] = given
        return True

    def ext_navs(self) -> list[ExtNav]:
        """Return where each filter takes external navigation."""
        return [core.ext_nav for core in self.lanes.cores]

    def place_of_imu(self, lane: int) -> Three:
        """Return the place of a filter's IMU as counted from the first IMU, m, body (FRD)."""
        return self._places()[self._imus.accel_of(self._imu_of_core[lane])] if self._differ else _HERE

    # Outputs

    def send_texts(self) -> None:
        """Send the texts of the filters, all lines of a filter for each core that it stands for."""
        texts = self.lanes.texts
        while texts:
            number, lines = texts[0].core, []
            while texts and texts[0].core == number:
                text = texts.pop(0)
                lines.append(words_of(text.code, text.values))
            for name in self._names_of(number):
                for severity, words in lines:
                    self._texts.send_text(severity, name + words)

    def _names_of(self, number: int) -> list[str]:
        """Return the names of the cores that a filter stands for, by the number of the first; "" for all."""
        groups = [group for group in self._groups if group[0] == number]
        return [f"EKF3 IMU{self._imu_of_core[core]} " for core in groups[0]] if groups else [""]

    def log_pass(self, now_us: int) -> None:
        """Log the records that the filters write after a pass."""
        for core, log in zip(self.lanes.cores, self._logs, strict=True):
            log.log_pass(core, now_us)

    def log_estimates(self, now_us: int) -> None:
        """Log the present estimates."""
        for index, log in enumerate(self._logs):
            report = report_of(self.lanes, index)
            report.baro, report.gps = self._used_baros[index], self._used_gps[index]
            log.write_streaming(report, now_us)

    def report(self, core: Core) -> CoreReport:
        """Return the present report of a filter."""
        return report_of(self.lanes, self.lanes.cores.index(core))

    def disagreement(self, *, checks_yaw: bool) -> str | None:
        """Return in words how the attitude of a core differs from that of the primary one, None while all agree.

        Source: AP_AHRS::attitudes_consistent.
        """
        lanes = self.lanes
        primary = _attitude_of(lanes.primary_filter)
        for quat in map(_attitude_of, lanes.cores if len(lanes.cores) > 1 else ()):
            lean = float(primary.roll_pitch_difference(quat, InternalErrors()))
            turn = abs(float(primary.angular_difference(quat).to_axis_angle().z)) if checks_yaw else 0.0
            for axis, apart, most in (("Roll/Pitch", lean, MOST_LEAN_APART), ("Yaw", turn, MOST_YAW_APART)):
                if apart > most:
                    return f"EKF3 {axis} inconsistent {int(math.degrees(apart))} deg. Wait or reboot"
        return None


def _is_unchanged(before: object, given: object) -> bool:
    """Return whether an input is the same object as before, or an equal number or tuple of numbers."""
    return before is given or (
        isinstance(given, float | tuple) and not _has_other_than_numbers(given) and before == given
    )


def _has_other_than_numbers(given: object) -> bool:
    return isinstance(given, tuple) and not all(isinstance(part, float | int) for part in given)


def _attitude_of(core: Core) -> Quaternion:
    return Quaternion(*core.output.now.quat)


def _places(params: ParamTable) -> list[Three]:
    """Return the place of each IMU as counted from the first, m, body (FRD)."""
    x_y_z = (map(float, imu_pos(params, imu).to_tuple()) for imu in range(MAX_IMUS))
    first, *others = [(x, y, z) for x, y, z in x_y_z]
    return [_HERE, *(from_imu(place, first) for place in others)]


def _compasses_of(sensors: Sensors, own: int | None) -> Compasses:
    """Return the data of the compasses, all alike; ``own`` is the number of the core's own by EK3_AFFINITY."""
    if sensors.mag is None:
        return Compasses([])
    time_us, field = sensors.mag
    x, y, z = field.tolist()
    reading = CompassReading(time_us, (x, y, z))
    return Compasses([reading]) if own is None else Compasses([reading] * _COMPASSES, 0, own)
