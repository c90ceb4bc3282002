# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plays the replay records of a log to the filter, in the order in which the firmware wrote them (AP_DAL/AP_DAL.cpp).

A log has them when it was written with LOG_REPLAY: each frame's inertial data and sensors, and every call by which
external navigation came in.
"""

from collections import Counter
from collections.abc import Callable
from typing import Any, Final, Protocol

import numpy as np

from ap_core.cint import i32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.sinks import TextSink
from ap_core.vector3 import Vector3f
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.ekf3_core import CommonOrigin, Ekf3Core, Frame
from ekf_stub.core.lanes import Lanes
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.release import REFERENCE
from ekf_stub.inputs.places import Moved, from_imu, gps_seen_from
from ekf_stub.inputs.range_state import RangeState
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.log.ekf_log import UNINITIALISED
from ekf_stub.log.replay_log import (
    ARMED,
    CHECK_LANE_SWITCH,
    HAS_FLOW,
    REQUEST_YAW_RESET,
    RESET_HEIGHT_DATUM,
    SOURCE_SET_1,
    TAKEOFF_EXPECTED,
    TERRAIN_STABLE,
    TERRAIN_UNSTABLE,
    TOUCHDOWN_EXPECTED,
)
from ekf_stub.reports.core_report import CoreReport, Three
from ekf_stub.reports.core_texts import CoreTexts, cores_of_mask
from viso.ekf_runs.core_inputs import CoreInputs
from viso.ekf_runs.inputs import ReplayInputs, flow_of
from viso.logs.record_fields import RecordError, finite, numbers, text, whole
from viso.parameters.ekf3 import FLOW_LIMIT, FLOW_LIMIT_LATER
from viso.vehicle.kernels import chosen_kernel, kernel_of

EKF3_RUNS: Final = 4 | 8  # of RFRF.FTypes: starts, runs
_AFTER_THE_FRAME: Final = frozenset({"XKF4", "ROFH", "REPH", "REVH", "RBOH", "RSO3", "RSLL", "REV3"})
_LATER_NAMES: Final = {f"EK3_{FLOW_LIMIT}": f"EK3_{FLOW_LIMIT_LATER}"}
_SOURCE_SETS: Final = range(SOURCE_SET_1, SOURCE_SET_1 + 3)
_SLOW_EKF3: Final = 4  # first bit of RFRF.Slow that is about EKF3
_USUAL: Final = {"EK3_AFFINITY": 0.0, "EK3_ERR_THRESH": 0.2, "EK3_OPTIONS": 0.0, "EK3_PRIMARY": 0.0}
"""Parameters of several cores, which not every log has."""


class PlayerEvents(TextSink, Protocol):
    """Who hears what the filter says, and what the vehicle does to it."""

    def source_set(self, index: int) -> None:
        """Hear that a source set was chosen, 0..2."""

    def origin(self, place: Location) -> None:
        """Hear that the origin was set."""


class EkfPlayer:
    """The filter's cores on the inputs of a log.

    Args:
        events: who hears of it.
        only: the number of the core to run, None for all.

    Attributes:
        params: the parameters as the log has them so far.
        place_declination: of the magnetic field at the origin, rad, as far as it is known; None otherwise.
        place_field: that field as the firmware's table of the world has it, Gauss, NED, as far as it is known.
        imus: the IMU of each core that is run, by the core's number; empty before the first frame.
        lanes: the cores, in that order; None until the log says that they have been started.
        slow: RFRF.Slow of the present frame, which has to be told ahead of its records.
    """

    def __init__(self, events: PlayerEvents, only: int | None = None) -> None:
        self.release = REFERENCE
        self._events = events
        self._only = only
        self.params: dict[str, float] = {}
        self.imus: dict[int, int] = {}
        self.inputs = ReplayInputs()
        self._core_inputs: list[CoreInputs] = []
        self.lanes: Lanes | None = None
        self.slow = 0
        self.place_declination: float | None = None
        self.place_field: Array | None = None
        self._frame_has_run = False
        self._ranges = Moved(RangeState.seen_from)
        self._gps = Moved(gps_seen_from)
        self._on_param: list[Callable[[], None]] = []
        self._sources = EkfSources(lambda name: int(self.param(f"EK3_{name}")), self._on_param.append)
        self._handlers: dict[str, Callable[[Any], None]] = {
            "PARM": self._take_parm,
            "RFRH": self._take_rfrh,
            "RFRF": self._take_rfrf,
            "ROFH": self._take_rofh,
            "REPH": self._take_reph,
            "REVH": self._take_revh,
            "RBOH": self._take_rboh,
            "RSO3": self._take_rso3,
            "RSLL": self._take_rsll,
            "REV3": self._take_rev3,
        }

    @property
    def time_us(self) -> int:
        """The time of the present frame, since boot."""
        return self.inputs.time_us

    def param(self, name: str) -> float:
        """Return a parameter, also by its later name. Raises RecordError if the log has no such parameter."""
        for known in (name, _LATER_NAMES.get(name, name)):
            if known in self.params:
                return self.params[known]
        raise RecordError(f"no PARM record of {name}")

    @property
    def cores(self) -> dict[int, Ekf3Core]:
        """The cores that have been started, by their numbers."""
        return {} if self.lanes is None else dict(zip(self.imus, self.lanes.cores, strict=True))

    @property
    def primary(self) -> int:
        """The number of the primary core."""
        return list(self.imus)[0 if self.lanes is None else self.lanes.primary]

    def report(self, number: int) -> CoreReport:
        """Return what a core says at present."""
        return UNINITIALISED if self.lanes is None else self.lanes.report(list(self.imus).index(number))

    def take(self, record: Any) -> None:
        """Take the next record of the log, whatever it is. Raises RecordError if the filter cannot go on with it."""
        kind = record.get_type()
        if kind in _AFTER_THE_FRAME:
            # The filter has run before any task of the frame, whether or not RFRF has already said so.
            self._run_frame()
        self.inputs.take(record)
        handler = self._handlers.get(kind)
        if handler is not None:
            handler(record)

    def _take_parm(self, record: Any) -> None:
        (self.params[text(record, "Name")],) = finite(record, "Value")
        for listener in self._on_param:
            listener()

    # Frames

    def _take_rfrh(self, _record: Any) -> None:
        self._frame_has_run = False

    def _begin(self) -> None:
        imus = dict(enumerate(cores_of_mask(int(self.param("EK3_IMU_MASK")), self.inputs.imu_count)))
        if not imus:
            raise RecordError("EK3_IMU_MASK selects no IMU")
        if self._only is not None and self._only not in imus:
            raise RecordError(f"no core {self._only}; the log has {', '.join(map(str, imus))}")
        self.imus = imus if self._only is None else {self._only: imus[self._only]}
        self._core_inputs = [
            CoreInputs(self.inputs, number, imu, lambda: int(self._ekf_param("AFFINITY")))
            for number, imu in self.imus.items()
        ]

    def _take_rfrf(self, record: Any) -> None:
        (frame_types,) = whole(record, "FTypes")
        if not self.imus:
            self._begin()
        if self.lanes is None and frame_types & EKF3_RUNS and all(core.has_data for core in self._core_inputs):
            self._make_cores()
        if frame_types & EKF3_RUNS:
            self._run_frame()

    def _run_frame(self) -> None:
        self.inputs.filter_rates()
        if self.lanes is None or self._frame_has_run:
            return
        self._frame_has_run = True
        frames = [self._frame(number, core) for number, core in zip(self.imus, self._core_inputs, strict=True)]
        self.lanes.run(frames)

    def _frame(self, number: int, sensors: CoreInputs) -> Frame:
        inputs, accel = self.inputs, sensors.accel
        place, gps, ranges = self._place_of(accel), sensors.gps(), inputs.ranges
        return Frame(
            inputs.time_us,
            sensors.delta(),
            armed=bool(inputs.flags & ARMED),
            flying_ms=inputs.flying_ms,
            takeoff_expected=bool(inputs.flags & TAKEOFF_EXPECTED),
            touchdown_expected=bool(inputs.flags & TOUCHDOWN_EXPECTED),
            baro=sensors.baro(),
            gps=None if gps is None else self._gps(accel, gps, place),
            declination=inputs.declination,
            place_declination=self.place_declination,
            place_field=self.place_field,
            lever_arm=self._lever_arm(place),
            home_lat=inputs.home_lat,
            ranges=None if ranges is None else self._ranges(accel, ranges, place),
            compasses=sensors.compasses(),
            imu_rates=sensors.imu_rates(),
            is_late=bool(self.slow >> _SLOW_EKF3 >> number & 1),
        )

    def _lever_arm(self, place: Three) -> Three:
        """Return the camera's place from an accelerometer that is at a place."""
        camera_frd = self.inputs.camera_frd
        return (0.0, 0.0, 0.0) if camera_frd is None else from_imu(camera_frd, place)

    def _place_of(self, accel: int) -> Three:
        x, y, z = (self.param(f"INS_POS{accel + 1}_{axis}") for axis in "XYZ")
        return x, y, z

    def _make_cores(self) -> None:
        lag_s = self.inputs.gps_lag_s
        if lag_s is None and self._sources.uses_gps():
            return  # the firmware waits for it, to know how long its buffers must be
        has_camera = self.inputs.camera_frd is not None
        sizes = buffer_sizes(
            lambda name: int(self.param(name)),
            self._sources,
            has_camera=has_camera,
            has_flow=bool(self.inputs.flags & HAS_FLOW),
            gps_lag_s=lag_s or 0.0,
        )
        common, kernel = CommonOrigin(), kernel_of(chosen_kernel())
        cores = [
            Ekf3Core(
                self._sources,
                self._ekf_param,
                sizes,
                CoreTexts(self._events, (imu,)),
                Counter(),
                lambda: bool(self.inputs.compasses.readings),
                kernel,
                common=common,
                number=number,
                imu=imu,
                release=self.release,
            )
            for number, imu in self.imus.items()
        ]
        self.lanes = Lanes(cores, common, self._ekf_param, self._events)

    def _ekf_param(self, name: str) -> float:
        name = f"EK3_{name}"
        return _USUAL[name] if name in _USUAL and name not in self.params else self.param(name)

    # Between the frames

    def _take_rofh(self, record: Any) -> None:
        if self.lanes is not None:
            measured = flow_of(record)
            for core, sensors in zip(self.lanes.cores, self._core_inputs, strict=True):
                core.write_flow(measured._replace(offset=from_imu(measured.offset, self._place_of(sensors.accel))))

    def _take_reph(self, record: Any) -> None:
        if self.lanes is not None:
            pos = Vector3f(*numbers(record, "PX", "PY", "PZ"))
            quat = Quaternion(*numbers(record, "Q1", "Q2", "Q3", "Q4"))
            pos_err, yaw_err = map(np.float32, numbers(record, "PEr", "AEr"))
            stamp_ms, reset_ms, delay_ms = whole(record, "TS", "RT", "D")
            for core in self.lanes.cores:
                core.ingest.write_pose(pos, quat, (pos_err, yaw_err), stamp_ms, delay_ms, reset_ms)

    def _take_revh(self, record: Any) -> None:
        if self.lanes is not None:
            vel = Vector3f(*numbers(record, "VX", "VY", "VZ"))
            (err,) = map(np.float32, numbers(record, "Er"))
            for core in self.lanes.cores:
                core.ingest.write_velocity(vel, err, *whole(record, "TS", "D"))

    def _take_rboh(self, record: Any) -> None:
        if self.lanes is not None:
            del_pos = Vector3f(*numbers(record, "DPX", "DPY", "DPZ"))
            del_ang = Vector3f(*numbers(record, "DAX", "DAY", "DAZ"))
            quality, del_time = map(np.float32, numbers(record, "Q", "DT"))
            (stamp_ms,) = whole(record, "TS")
            # The firmware leaves this record's offset and delay unfilled; RVOH has what it was given.
            deltas, delay_ms = (del_pos, del_ang, del_time), self.inputs.camera_delay_ms
            for core, sensors in zip(self.lanes.cores, self._core_inputs, strict=True):
                offset = Vector3f(*self._lever_arm(self._place_of(sensors.accel)))
                core.ingest.write_odometry(quality, deltas, stamp_ms, delay_ms, offset)

    def _take_rso3(self, record: Any) -> None:
        lat, lng, alt_cm = map(i32, whole(record, "Lat", "Lon", "Alt"))
        place = Location(lat, lng, alt_cm)
        if self.lanes is not None and self.lanes.set_origin(place):
            self._events.origin(place)

    def _take_rsll(self, record: Any) -> None:
        if self.lanes is not None:
            lat, lng = map(i32, whole(record, "Lat", "Lng"))
            (accuracy_m,), (time_ms,) = numbers(record, "PosAccSD"), whole(record, "TS")
            self.lanes.set_place(Location(lat, lng, 0), accuracy_m, time_ms)

    def _take_rev3(self, record: Any) -> None:
        (event,) = whole(record, "Event")
        if event in _SOURCE_SETS:
            self._sources.active_set = _SOURCE_SETS.index(event)
            self._events.source_set(self._sources.active_set)
        elif event == RESET_HEIGHT_DATUM and self.lanes is not None:
            self.lanes.reset_height_datum()
        elif event in (TERRAIN_STABLE, TERRAIN_UNSTABLE) and self.lanes is not None:
            for core in self.lanes.cores:
                core.set_terrain_stable(is_stable=event == TERRAIN_STABLE)
        elif event == REQUEST_YAW_RESET and self.lanes is not None:
            self.lanes.request_yaw_reset()
        elif event == CHECK_LANE_SWITCH and self.lanes is not None:
            self.lanes.check_lane_switch()
