# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plays the replay records of a log to the filter, in the order in which the firmware wrote them (AP_DAL/AP_DAL.cpp).

A log has them when it was written with LOG_REPLAY: each frame's inertial data and sensors, and every call with external
navigation. Frames are passed to the filter in blocks, up to the next record that is not inertial data.
"""

from collections.abc import Callable
from typing import Any, Final, Protocol

import numpy as np

from ap_core.cint import i32
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.sinks import TextSink
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_ekf3 import body_velocity, yaw_of
from ekf_stub.core.buffers import buffer_sizes
from ekf_stub.core.core import Core
from ekf_stub.core.imus import Imus
from ekf_stub.core.lanes import Lanes
from ekf_stub.core.params import EkfSources, Params
from ekf_stub.inputs.measurements import PlaceCache, RangeState, from_imu, gps_counted_from
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
from ekf_stub.log.reporting import UNINITIALISED, report_of
from ekf_stub.release import STABLE_4_7
from ekf_stub.reports import CoreReport, Three, cores_of_mask, words_of
from viso.logs.recorded import RecordError, finite, numbers, text, whole
from viso.parameters.ekf3 import FLOW_LIMIT, FLOW_LIMIT_LATER
from viso.replay.ekf.frames import AFTER_THE_FILTER, Frames
from viso.replay.ekf.inputs import CoreInputs, ReplayInputs, flow_of

PLAYED: Final = (
    *("PARM", "RFRN", "RISH", "RBRH", "RBRI", "RMGH", "RMGI", "RVOH", "RRNH", "RRNI", "RGPH", "RGPI", "RGPJ"),
    *AFTER_THE_FILTER,
)
"""The types of records that ``EkfPlayer.take`` takes; RFRH, RISI and RFRF, which each frame has, are in ``Frames``."""

_RENAMED: Final = {FLOW_LIMIT_LATER: FLOW_LIMIT, FLOW_LIMIT: FLOW_LIMIT_LATER}
_SOURCE_SETS: Final = range(SOURCE_SET_1, SOURCE_SET_1 + 3)
_USUAL: Final = {"EK3_AFFINITY": 0.0, "EK3_ERR_THRESH": 0.2, "EK3_OPTIONS": 0.0, "EK3_PRIMARY": 0.0}
"""Parameters of several cores, which not every log has."""


class PlayerEvents(TextSink, Protocol):
    """Receives the texts of the filter, and the vehicle's actions on it."""

    def passed(self) -> None:
        """Handle a run up to a pass with something to log."""

    def source_set(self, index: int) -> None:
        """Handle the choice of a source set, 0..2."""

    def origin(self, place: Location) -> None:
        """Handle the setting of the origin."""


class EkfPlayer:
    """The filter's cores on the inputs of a log.

    Args:
        events: the receiver of texts and events.
        frames: the frames of the log.
        only: the number of the core to run, None for all.

    Attributes:
        params: the parameters as the log has them so far.
        imus: the IMU of each core that runs, by the core's number; empty before the first frame.
        lanes: the cores, in that order; None until they start.
        time_us: the time of the present frame, since boot.
        next_frame: the number of the first frame that has not been run.
    """

    def __init__(self, events: PlayerEvents, frames: Frames, only: int | None = None) -> None:
        self.release = STABLE_4_7
        self._events = events
        self._frames = frames
        self._only = only
        self.params: dict[str, float] = {}
        self.imus: dict[int, int] = {}
        self.inputs = ReplayInputs()
        self._core_inputs: list[CoreInputs] = []
        self._core_params = Params()
        self._imus = Imus()
        self.lanes: Lanes | None = None
        self.time_us = 0
        self.next_frame = 0
        self._changes_of_use = frames.changes_of_use()
        self._inputs_changed = self._params_changed = True
        self._ranges = PlaceCache(RangeState.counted_from)
        self._gps = PlaceCache(gps_counted_from)
        self._sources = EkfSources(lambda name: int(self.param(f"EK3_{name}")))
        self._handlers: dict[str, Callable[[Any], None]] = {
            "PARM": self._take_parm,
            "ROFH": self._take_rofh,
            "REPH": self._take_reph,
            "REVH": self._take_revh,
            "RBOH": self._take_rboh,
            "RSO3": self._take_rso3,
            "RSLL": self._take_rsll,
            "REV3": self._take_rev3,
        }

    def param(self, name: str) -> float:
        """Return a parameter, also by its other name. Raises RecordError if the log has no such parameter."""
        short = name.removeprefix("EK3_")
        for known in (name, f"EK3_{_RENAMED.get(short, short)}"):
            if known in self.params:
                return self.params[known]
        if name in _USUAL:
            return _USUAL[name]
        raise RecordError(f"no PARM record of {name}")

    @property
    def cores(self) -> dict[int, Core]:
        """The cores that have been started, by their numbers."""
        return {} if self.lanes is None else dict(zip(self.imus, self.lanes.cores, strict=True))

    @property
    def primary(self) -> int:
        """The number of the primary core."""
        return list(self.imus)[0 if self.lanes is None else self.lanes.primary]

    def report(self, number: int) -> CoreReport:
        """Return the present estimates of a core."""
        return UNINITIALISED if self.lanes is None else report_of(self.lanes, list(self.imus).index(number))

    def choose_source_set(self, index: int) -> None:
        """Choose a set of sources, 0..2."""
        self._sources.active_set = index

    def take(self, record: Any) -> None:
        """Handle the next record of the log that is not inertial data.

        Raises RecordError if the filter cannot continue with it.
        """
        if self.inputs.take(record):
            self._inputs_changed = True
            return
        handler = self._handlers.get(record.get_type())
        if handler is not None:
            handler(record)
            self._send_texts()

    def _take_parm(self, record: Any) -> None:
        (self.params[text(record, "Name")],) = finite(record, "Value")
        self._params_changed = self._inputs_changed = True
        self._sources.forget()

    # Frames

    def run_until(self, place: int, until_us: float) -> None:
        """Run the frames that come before a place in the log, in bytes, up to the first at or after a time in us.

        Raises RecordError if the filter cannot continue with the data.
        """
        frames = self._frames
        while self.lanes is None and self.next_frame < len(frames) and frames.starts[self.next_frame] < place:
            self._run_before_start(self.next_frame)
            self.next_frame += 1
        if self.lanes is None:
            return
        end = int(np.searchsorted(frames.runs, place)) if place < frames.end else len(frames)
        if until_us < np.inf:
            end = min(end, int(np.searchsorted(frames.time_us, until_us)) + 1)
        while self.next_frame < end:
            self._run_block(self.lanes, end)

    def _run_before_start(self, frame: int) -> None:
        """Run a frame before there are cores; make them if EKF3 starts in it and all its IMUs have data."""
        self.time_us = int(self._frames.time_us[frame])
        if not self.imus:
            self._begin()
        self._follow_imus(frame)
        if self._frames.is_confirmed[frame] and all(map(self._imus.has_data_of, self.imus.values())):
            self._make_cores()
        if self.lanes is None:
            rows, first, _ = self._frames.rows(frame, len(self._imus.imus))
            self._imus.read(rows, (frame - first) * self._imus.columns())
        else:
            self._inputs_changed = True
            self._run_block(self.lanes, frame + 1)
            self.next_frame = frame

    def _run_block(self, lanes: Lanes, end: int) -> None:
        """Run frames from the next one on, up to one with something to log."""
        frame = self.next_frame
        changes = self._changes_of_use
        at = int(np.searchsorted(changes, frame))
        if at < len(changes) and changes[at] == frame:
            self._follow_imus(frame)
            self._inputs_changed, at = True, at + 1
        if self._inputs_changed:
            self._set_inputs(lanes)
        if at < len(changes):
            end = min(end, int(changes[at]))
        rows, first, last = self._frames.rows(frame, len(self._imus.imus))
        self.next_frame = first + lanes.advance(rows, frame - first, min(end, last) - first)
        self.time_us = lanes.now_us
        self._send_texts()
        self._events.passed()

    def _follow_imus(self, frame: int) -> None:
        """Note which IMUs have data in a frame, and which of their sensors may be used."""
        self._imus.first_gyro, self._imus.first_accel = self.inputs.first_gyro, self.inputs.first_accel
        self._imus.loop_dt = self.inputs.loop_dt
        for number in self._frames.imus_with_data(frame):
            if number < len(self._imus.imus):
                imu = self._imus.imus[number]
                imu.has_data = True
                imu.has_gyro, imu.has_accel = self._frames.usable(frame, number)

    def _begin(self) -> None:
        imus = dict(enumerate(cores_of_mask(int(self.param("EK3_IMU_MASK")), self.inputs.imu_count)))
        if not imus:
            raise RecordError("EK3_IMU_MASK selects no IMU")
        if self._only is not None and self._only not in imus:
            raise RecordError(f"no core {self._only}; the log has {', '.join(map(str, imus))}")
        self.imus = imus if self._only is None else {self._only: imus[self._only]}
        self._imus = Imus(self.inputs.imu_count)
        self._core_inputs = [CoreInputs(self.inputs, number) for number in self.imus]

    def _make_cores(self) -> None:
        lag_s = self.inputs.gps_lag_s
        sources = [self._sources.of_core(number, self.release) for number in self.imus]
        if lag_s is None and any(one.uses_gps() for one in sources):
            return  # the firmware waits for it, to size its buffers
        sizes = [
            buffer_sizes(
                lambda name: int(self.param(name)),
                one,
                has_camera=self.inputs.camera_frd is not None,
                has_flow=bool(self.inputs.flags & HAS_FLOW),
                gps_lag_s=lag_s or 0.0,
            )
            for one in sources
        ]
        self._read_params()
        self.lanes = Lanes(
            self._core_params,
            self._sources,
            sizes,
            self.release,
            self._imus,
            list(self.imus),
            list(self.imus.values()),
            len(self.imus),
        )

    def _read_params(self) -> None:
        if self._params_changed:
            self._params_changed = False
            self._core_params.read(lambda name: self.param(f"EK3_{name}"))

    def _set_inputs(self, lanes: Lanes) -> None:
        """Pass the sensor data since the last block to the cores."""
        self._inputs_changed = False
        self._read_params()
        self._imus.first_gyro, self._imus.first_accel = self.inputs.first_gyro, self.inputs.first_accel
        given, flags, affinity = self.inputs, self.inputs.flags, int(self.param("EK3_AFFINITY"))
        for core, sensors in zip(lanes.cores, self._core_inputs, strict=True):
            if not self._imus.has_data_of(core.imu):
                imu = self._imus.gyro_of(core.imu)
                raise RecordError(f"no RISI record of IMU {imu}, which RISH names as the first that can be used")
            inputs, accel = core.inputs, self._imus.accel_of(core.imu)
            place = self._place_of(accel)
            inputs.armed = bool(flags & ARMED)
            inputs.takeoff_expected = bool(flags & TAKEOFF_EXPECTED)
            inputs.touchdown_expected = bool(flags & TOUCHDOWN_EXPECTED)
            inputs.home_lat = given.home_lat
            inputs.has_compass = bool(given.compasses.readings)
            inputs.set_baro(*(sensors.baro(affinity) or (-1, 0.0)))
            inputs.set_compasses(sensors.compasses(affinity))
            gps, ranges = sensors.gps(affinity), given.ranges
            inputs.set_gps(None if gps is None else self._gps(accel, gps, place))
            inputs.set_ranges(None if ranges is None else self._ranges(accel, ranges, place))
            inputs.set_declination(given.declination)
            inputs.set_lever_arm(self._lever_arm(place))

    def _lever_arm(self, place: Three) -> Three:
        """Return the camera's position relative to an accelerometer."""
        camera_frd = self.inputs.camera_frd
        return (0.0, 0.0, 0.0) if camera_frd is None else from_imu(camera_frd, place)

    def _place_of(self, accel: int) -> Three:
        x, y, z = (self.param(f"INS_POS{accel + 1}_{axis}") for axis in "XYZ")
        return x, y, z

    def _send_texts(self) -> None:
        """Send the texts of the cores."""
        if self.lanes is None:
            return
        for text_ in self.lanes.texts:
            severity, words = words_of(text_.code, text_.values)
            name = "" if text_.core < 0 else f"EKF3 IMU{self.imus[text_.core]} "
            self._events.send_text(severity, name + words)
        self.lanes.texts.clear()
        for core in self.lanes.cores:
            core.events.outcomes.clear()

    # Between the frames

    def _take_rofh(self, record: Any) -> None:
        if self.lanes is not None:
            measured = flow_of(record)
            for core in self.lanes.cores:
                offset = from_imu(measured.offset, self._place_of(self._imus.accel_of(core.imu)))
                core.write_flow(measured.quality, measured.flow, measured.gyro, offset)

    def _take_reph(self, record: Any) -> None:
        if self.lanes is not None:
            x, y, z = numbers(record, "PX", "PY", "PZ")
            yaw = yaw_of(Quaternion(*numbers(record, "Q1", "Q2", "Q3", "Q4")))
            pos_err, yaw_err = numbers(record, "PEr", "AEr")
            stamp_ms, reset_ms, delay_ms = whole(record, "TS", "RT", "D")
            for core in self.lanes.cores:
                core.ext_nav.write_pose((x, y, z), pos_err, yaw, yaw_err, stamp_ms, delay_ms, reset_ms)

    def _take_revh(self, record: Any) -> None:
        if self.lanes is not None:
            x, y, z, err = numbers(record, "VX", "VY", "VZ", "Er")
            stamp_ms, delay_ms = whole(record, "TS", "D")
            for core in self.lanes.cores:
                core.ext_nav.write_velocity((x, y, z), err, stamp_ms, delay_ms)

    def _take_rboh(self, record: Any) -> None:
        if self.lanes is not None:
            del_pos = Vector3f(*numbers(record, "DPX", "DPY", "DPZ"))
            del_ang = Vector3f(*numbers(record, "DAX", "DAY", "DAZ"))
            quality, del_time = map(f32, numbers(record, "Q", "DT"))
            (stamp_ms,) = whole(record, "TS")
            errors = self.param("EK3_VIS_VERR_MIN"), self.param("EK3_VIS_VERR_MAX")
            vel, err, has_nan = body_velocity(quality, del_pos, del_ang, del_time, Vector3f(), errors)
            # The firmware leaves this record's offset and delay unfilled; RVOH has its values.
            delay_ms = self.inputs.camera_delay_ms
            for core in self.lanes.cores:
                offset = self._lever_arm(self._place_of(self._imus.accel_of(core.imu)))
                core.ext_nav.write_odometry(vel, err, float(del_time), has_nan, stamp_ms, delay_ms, offset)

    def _take_rso3(self, record: Any) -> None:
        lat, lng, alt_cm = map(i32, whole(record, "Lat", "Lon", "Alt"))
        place = Location(lat, lng, alt_cm)
        if self.lanes is not None and self.lanes.set_origin(place):
            self._send_texts()
            self._events.origin(place)

    def _take_rsll(self, record: Any) -> None:
        if self.lanes is not None:
            lat, lng = map(i32, whole(record, "Lat", "Lng"))
            (accuracy_m,), (time_ms,) = numbers(record, "PosAccSD"), whole(record, "TS")
            self.lanes.set_place(Location(lat, lng, 0), accuracy_m, time_ms)

    def _take_rev3(self, record: Any) -> None:
        (event,) = whole(record, "Event")
        if event in _SOURCE_SETS:
            self.choose_source_set(_SOURCE_SETS.index(event))
            self._events.source_set(self._sources.active_set)
        elif event == RESET_HEIGHT_DATUM and self.lanes is not None:
            self.lanes.reset_height_datum()
        elif event in (TERRAIN_STABLE, TERRAIN_UNSTABLE) and self.lanes is not None:
            for core in self.lanes.cores:
                core.set_terrain_stable(event == TERRAIN_STABLE)
        elif event == REQUEST_YAW_RESET and self.lanes is not None:
            self.lanes.request_yaw_reset()
        elif event == CHECK_LANE_SWITCH and self.lanes is not None:
            self.lanes.check_lane_switch()
