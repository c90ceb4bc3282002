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
from ekf_stub.core.ekf3_core import Ekf3Core, Frame
from ekf_stub.core.reporting import report_of
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.log.ekf_log import UNINITIALISED
from ekf_stub.reports.core_report import CoreReport
from ekf_stub.reports.core_texts import CoreTexts, cores_of_mask
from viso.ekf_runs.inputs import ARMED, TAKEOFF_EXPECTED, TOUCHDOWN_EXPECTED, ReplayInputs
from viso.logs.record_fields import RecordError, finite, numbers, text, whole
from viso.vehicle.kernels import chosen_kernel, kernel_of

EKF3_RUNS: Final = 4 | 8  # of RFRF.FTypes: starts, runs
_AFTER_THE_FRAME: Final = frozenset({"XKF4", "REPH", "REVH", "RBOH", "RSO3", "REV3"})
_RESET_HEIGHT_DATUM: Final = 1  # of REV3.Event
_REQUEST_YAW_RESET: Final = 11
_SOURCE_SETS: Final = range(13, 16)


class PlayerEvents(TextSink, Protocol):
    """Who hears what the filter says, and what the vehicle does to it."""

    def source_set(self, index: int) -> None:
        """Hear that a source set was chosen, 0..2."""

    def origin(self, place: Location) -> None:
        """Hear that the origin was set."""


class EkfPlayer:
    """A filter on the inputs of a log.

    Args:
        events: who hears of it.

    Attributes:
        params: the parameters as the log has them so far.
        inputs: the sensors.
        place_declination: of the magnetic field at the origin, rad, as far as it is known; None otherwise.
        core: the filter; None until the log says that it has been started.
        imus: the IMU of each core of the log; the filter stands for all of them, with the inputs of the first.
    """

    def __init__(self, events: PlayerEvents) -> None:
        self._events = events
        self.params: dict[str, float] = {}
        self.imus: tuple[int, ...] = (0,)
        self.inputs = ReplayInputs()
        self.core: Ekf3Core | None = None
        self.place_declination: float | None = None
        self._began = self._frame_has_run = False
        self._on_param: list[Callable[[], None]] = []
        self._sources = EkfSources(lambda name: int(self.param(f"EK3_{name}")), self._on_param.append)
        self._handlers: dict[str, Callable[[Any], None]] = {
            "PARM": self._take_parm,
            "RFRH": self._take_rfrh,
            "RFRF": self._take_rfrf,
            "REPH": self._take_reph,
            "REVH": self._take_revh,
            "RBOH": self._take_rboh,
            "RSO3": self._take_rso3,
            "REV3": self._take_rev3,
        }

    @property
    def time_us(self) -> int:
        """The time of the present frame, since boot."""
        return self.inputs.time_us

    def param(self, name: str) -> float:
        """Return a parameter. Raises RecordError if the log has no such parameter."""
        try:
            return self.params[name]
        except KeyError:
            raise RecordError(f"no PARM record of {name}") from None

    def report(self) -> CoreReport:
        """Return what the filter says at present."""
        if self.core is None or not self.core.initialised:
            return UNINITIALISED
        return report_of(self.core, self.time_us // 1000)

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
        if not self._began:
            self._begin()
        self._frame_has_run = False

    def _begin(self) -> None:
        self.imus = cores_of_mask(int(self.param("EK3_IMU_MASK")))
        if not self.imus:
            raise RecordError("EK3_IMU_MASK selects no IMU")
        self.inputs.imu = self.imus[0]
        self._began = True

    def _take_rfrf(self, record: Any) -> None:
        (frame_types,) = whole(record, "FTypes")
        if self.core is None and frame_types & EKF3_RUNS and self.inputs.delta is not None:
            self._make_core()
        if frame_types & EKF3_RUNS:
            self._run_frame()

    def _run_frame(self) -> None:
        if self.core is None or self._frame_has_run:
            return
        self._frame_has_run = True
        inputs = self.inputs
        assert inputs.delta is not None
        self.core.run(
            Frame(
                inputs.time_us,
                inputs.delta,
                armed=bool(inputs.flags & ARMED),
                flying_ms=inputs.flying_ms,
                takeoff_expected=bool(inputs.flags & TAKEOFF_EXPECTED),
                touchdown_expected=bool(inputs.flags & TOUCHDOWN_EXPECTED),
                baro=inputs.baro,
                mag=inputs.mag,
                gps=inputs.gps,
                declination=inputs.declination,
                place_declination=self.place_declination,
                lever_arm=self._lever_arm(),
                home_lat=inputs.home_lat,
            )
        )

    def _lever_arm(self) -> tuple[float, float, float]:
        """Return the camera's place from the IMU."""
        if self.inputs.camera_frd is None:
            return (0.0, 0.0, 0.0)
        imu = self.imus[0] + 1
        x, y, z = (
            camera - self.param(f"INS_POS{imu}_{axis}")
            for axis, camera in zip("XYZ", self.inputs.camera_frd, strict=True)
        )
        return x, y, z

    def _make_core(self) -> None:
        lag_s = self.inputs.gps_lag_s
        if lag_s is None and self._sources.uses_gps():
            return  # the firmware waits for it, to know how long its buffers must be
        has_camera = self.inputs.camera_frd is not None
        sizes = buffer_sizes(
            lambda name: int(self.param(name)), self._sources, has_camera=has_camera, gps_lag_s=lag_s or 0.0
        )
        self.core = Ekf3Core(
            self._sources,
            lambda name: self.param(f"EK3_{name}"),
            sizes,
            CoreTexts(self._events, self.imus),
            Counter(),
            lambda: self.inputs.mag is not None,
            kernel_of(chosen_kernel()),
        )

    # Between the frames

    def _take_reph(self, record: Any) -> None:
        if self.core is not None:
            pos = Vector3f(*numbers(record, "PX", "PY", "PZ"))
            quat = Quaternion(*numbers(record, "Q1", "Q2", "Q3", "Q4"))
            pos_err, yaw_err = map(np.float32, numbers(record, "PEr", "AEr"))
            stamp_ms, reset_ms, delay_ms = whole(record, "TS", "RT", "D")
            self.core.ingest.write_pose(pos, quat, (pos_err, yaw_err), stamp_ms, delay_ms, reset_ms)

    def _take_revh(self, record: Any) -> None:
        if self.core is not None:
            vel = Vector3f(*numbers(record, "VX", "VY", "VZ"))
            (err,) = map(np.float32, numbers(record, "Er"))
            self.core.ingest.write_velocity(vel, err, *whole(record, "TS", "D"))

    def _take_rboh(self, record: Any) -> None:
        if self.core is not None:
            del_pos = Vector3f(*numbers(record, "DPX", "DPY", "DPZ"))
            del_ang = Vector3f(*numbers(record, "DAX", "DAY", "DAZ"))
            quality, del_time = map(np.float32, numbers(record, "Q", "DT"))
            (stamp_ms,) = whole(record, "TS")
            # The firmware leaves this record's offset and delay unfilled; RVOH has what it was given.
            deltas, offset = (del_pos, del_ang, del_time), Vector3f(*self._lever_arm())
            self.core.ingest.write_odometry(quality, deltas, stamp_ms, self.inputs.camera_delay_ms, offset)

    def _take_rso3(self, record: Any) -> None:
        lat, lng, alt_cm = map(i32, whole(record, "Lat", "Lon", "Alt"))
        place = Location(lat, lng, alt_cm)
        if self.core is not None and self.core.set_origin(place):
            self._events.origin(place)

    def _take_rev3(self, record: Any) -> None:
        (event,) = whole(record, "Event")
        if event in _SOURCE_SETS:
            self._sources.active_set = _SOURCE_SETS.index(event)
            self._events.source_set(self._sources.active_set)
        elif event == _RESET_HEIGHT_DATUM and self.core is not None:
            self.core.reset_height_datum()
        elif event == _REQUEST_YAW_RESET and self.core is not None:
            self.core.request_yaw_reset()
