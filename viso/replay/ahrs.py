# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The AHRS that a command line chooses: the filter on sensors, or the attitude and position of a log.

A log with replay records (LOG_REPLAY) has all that the vehicle's filter was given. The filter is run over them again,
and the vehicle has its estimates of each frame. Without them it has the estimates that the log holds, 10 per second.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.dataflash_columns import LogColumns
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs, RecordedStates
from ekf_stub.ahrs.sources import BARO, COMPASS, GPS, OPTICAL_FLOW, RANGEFINDER, VISUAL_ODOM, source_failure
from ekf_stub.core.aiding import NO_AIDING
from ekf_stub.core.core import Core
from ekf_stub.core.params import EkfSources
from ekf_stub.core.vectors import euler_of
from ekf_stub.inputs.measurements import DOWNWARD
from ekf_stub.log.ext_nav_log import ExtNavLog
from ekf_stub.log.replay_log import HAS_FLOW
from ekf_stub.reports import FilterFlag
from viso.errors import InputError
from viso.firmware.releases import Firmware
from viso.logs.recorded import RecordError, places_of, read_columns, recorded_states, records_in
from viso.replay.ekf.frames import Frames
from viso.replay.ekf.player import PLAYED, EkfPlayer
from viso.replay.ekf.run import recorded_firmware
from viso.terminal.ahrs import AhrsChoice, imu_options
from viso.vehicle.config import by_ekf3
from viso.vehicle.sensors.inertial_sources import read_source
from viso.vehicle.vehicle import Vehicle

_NOT_BY_FILTER: Final = (10, 11)  # of AHRS_EKF_TYPE: the simulator, External AHRS


class _NoEvents:
    """Discards texts and events of the filter: the log that is followed has them."""

    def send_text(self, severity: int, text: str) -> None:
        """Discard a text."""

    def passed(self) -> None:
        """Do nothing about a run."""

    def source_set(self, index: int) -> None:
        """Do nothing about a source set."""

    def origin(self, place: Location) -> None:
        """Do nothing about an origin."""


@dataclass(frozen=True)
class _ReplayRecords:
    """The replay records of a log, and the release of the filter that is run over them."""

    path: Path
    log: LogColumns
    frames: Frames
    firmware: Firmware


class ReplayedAhrs(RecordedAhrs):
    """The estimates of a filter that is run over a log's replay records, as of the latest frame.

    The log's own attitude and position are taken until the filter has initialised, while AHRS_EKF_TYPE chooses the
    simulator or an External AHRS, and from a record on with which the filter cannot continue.
    """

    def __init__(
        self,
        clock: VirtualClock,
        sources: EkfSources,
        log: ExtNavLog,
        states: RecordedStates,
        replayed: _ReplayRecords,
    ) -> None:
        super().__init__(clock, sources, log, states)
        self._replayed = replayed
        self._player = EkfPlayer(_NoEvents(), replayed.frames)
        self._player.release = replayed.firmware.ekf
        self._places = places_of(replayed.log, PLAYED).tolist()
        self._records = records_in(replayed.log, PLAYED)
        self._next_record = 0
        self._next_frame_us = 0
        self._problem = replayed.frames.problem()
        self._failed = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Where attitude and position come from, and from when on the filter cannot continue, if so."""
        of_filter = f"attitude and position: the filter, run over the replay records of {self._replayed.path.name}"
        return (f"{of_filter}; {self._failed}",) if self._failed else (of_filter,)

    def _core(self) -> Core | None:
        """Return the primary core, after the frames up to now; None while the log's own estimates count."""
        now_us = self._clock.micros64()
        if not self._failed and now_us >= self._next_frame_us:
            try:
                self._run_until(now_us)
            except RecordError as error:
                self._failed = f"from {self._player.time_us / 1e6:.3f} s on those of its ATT and XKF1 records: {error}"
        lanes = self._player.lanes
        if lanes is None or self._failed or self._player.params.get("AHRS_EKF_TYPE") in _NOT_BY_FILTER:
            return None
        return lanes.primary_filter if lanes.primary_filter.initialised else None

    def _run_until(self, now_us: int) -> None:
        frames, player = self._replayed.frames, self._player
        after = int(np.searchsorted(frames.begin_times_us, now_us, side="right"))
        is_last = after == len(frames.begins)
        end = frames.end if is_last else int(frames.begins[after])
        self._next_frame_us = 2**63 if is_last else int(frames.begin_times_us[after])
        while self._next_record < len(self._places) and self._places[self._next_record] < end:
            place = self._places[self._next_record]
            self._check(place)
            player.run_until(place, np.inf)
            player.take(next(self._records))
            self._next_record += 1
        self._check(end)
        player.run_until(end, np.inf)

    def _check(self, place: int) -> None:
        """Raise RecordError if the log cannot be used up to a place."""
        if self._problem is not None and place > self._problem[0]:
            raise self._problem[1]

    def origin(self) -> Location | None:
        """Return the origin that was set here, or that of the filter."""
        lanes = self._player.lanes
        if self._origin is None and self._core() is not None and lanes is not None:
            self._origin = lanes.origin
        return self._origin or super().origin()

    def using_extnav_for_yaw(self) -> bool:
        """Return whether the filter takes its yaw from external navigation."""
        core = self._core()
        return super().using_extnav_for_yaw() if core is None else core.uses_ext_nav_for_yaw(self._now_ms())

    def get_yaw_rad(self) -> np.float32:
        """Return the yaw, -pi..pi."""
        core = self._core()
        return super().get_yaw_rad() if core is None else f32(euler_of(core.output.now.quat)[2])

    def get_quaternion(self) -> Quaternion | None:
        """Return the attitude."""
        core = self._core()
        return super().get_quaternion() if core is None else Quaternion(*core.output.now.quat)

    def get_relative_position_NED_origin_float(self) -> Vector3f | None:
        """Return the position while the filter navigates."""
        core = self._core()
        if core is None:
            return super().get_relative_position_NED_origin_float()
        navigates = core.aiding.mode != NO_AIDING and core.flags & FilterFlag.VERT_POS
        return Vector3f(*core.position()) if navigates else None

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what is wrong with the source sets, by the sensors that the log has, or None."""
        if self._core() is None:
            return super().pre_arm_failure(requires_position)
        return source_failure(self._sources, self._is_fitted, requires_position=requires_position)

    def _is_fitted(self, sensor: str) -> bool:
        inputs = self._player.inputs
        finders = () if inputs.ranges is None else inputs.ranges.finders
        fitted = {
            BARO: True,
            COMPASS: len(inputs.compasses.readings) > 0,
            GPS: inputs.gps is not None,
            OPTICAL_FLOW: inputs.flags & HAS_FLOW != 0,
            RANGEFINDER: any(finder.orientation == DOWNWARD for finder in finders),
            VISUAL_ODOM: inputs.camera_frd is not None,
        }
        return fitted.get(sensor, False)


def ahrs_maker(
    choice: AhrsChoice, default_imu: str = "bench", *, log_firmware: Firmware | None = None
) -> Callable[[Vehicle], AhrsBase]:
    """Return the maker of the AHRS that was chosen; files are read now.

    Args:
        choice: from the command line.
        default_imu: the source of inertial data if none was chosen.
        log_firmware: the release whose filter is run over a log; None for the one that the log names.

    Raises:
        InputError: a file cannot be read or lacks something, an option cannot be used, or two exclude each other.
    """
    options = imu_options(choice, default_imu)
    if choice.log is None:
        return by_ekf3(read_source(choice.imu or default_imu), options)
    for name, value in (("--imu", choice.imu), ("--imu-error", choice.imu_errors), ("--home", choice.home)):
        if value:
            raise InputError(f"--ahrs and {name}: a vehicle that follows a log has no sensors")
    path, log = choice.log, read_columns(choice.log)
    states = recorded_states(path, log)
    if not log.counts.get("RFRH"):
        note = f"attitude and position: the ATT and XKF1 records of {path.name}, which has no replay records"
        return lambda vehicle: RecordedAhrs(vehicle.clock, vehicle.sources, vehicle.replay_log, states, note)
    firmware = recorded_firmware(log, log_firmware).firmware
    replayed = _ReplayRecords(path, log, Frames(log, np.inf), firmware)
    return lambda vehicle: ReplayedAhrs(vehicle.clock, vehicle.sources, vehicle.replay_log, states, replayed)
