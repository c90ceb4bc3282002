# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated vehicle: everything wired together, behind a MAVLink endpoint."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np

from ap_core.clock import VirtualClock
from ap_core.fmath import degrees, f32
from ap_core.internal_error import InternalErrors
from ap_core.log_field import LogValue
from ap_core.log_structure import ARM, ATT, DSF, ERR, EV, MAV, MAVC, MODE, MSG, ORGN, VER
from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ap_visualodom.ports import Ahrs
from ekf_stub.ahrs_base import AHRS_START_US, Origin
from ekf_stub.ahrs_bench import BenchAhrs
from ekf_stub.ext_nav_log import ExtNavLog, VisualOdomFrame
from ekf_stub.sources import EkfSources
from emulator.arming import ANY_CHECK, CHECK_VISION, Arming, Check
from emulator.firmware import REFERENCE, Firmware
from emulator.ftp_files import VehicleFiles
from emulator.log_files import LogStore
from emulator.log_library import NoLogs, StoredLogs
from emulator.log_sink import LogSink
from emulator.logger import Logger
from emulator.param_store import ParamStore
from emulator.parameters import make_groups
from emulator.uarts_text import UartCounts, UartsText
from mav_handlers.channel import Channel
from mav_handlers.endpoint import MavEndpoint
from mav_handlers.ftp_ports import FtpFiles
from mav_handlers.log_transfer import LogLibrary
from mav_handlers.ports import Attitude, Location, OriginResult
from mav_handlers.signing import KeyStore, MemoryKeyStore
from mav_handlers.statustext import StatusTextQueue

LOOP_PERIOD_US: Final = 2500
CHECK_LOGGING: Final = 1 << 10
ERR_SUBSYSTEM_INTERNAL_ERROR: Final = 30
ERR_INTERNAL_ERRORS_DETECTED: Final = 1
MODE_STABILIZE: Final = 0
MODE_REASON_INITIALISED: Final = 26
EV_ARMED: Final = 10
EV_DISARMED: Final = 11
EV_SET_HOME: Final = 25
EV_SOURCE_SET_1: Final = 85
ORGN_EKF: Final = 0
ORGN_HOME: Final = 1
ARM_METHOD_MAVLINK: Final = 1
LOG_AFTER_DISARM_US: Final = 15_000_000
RTC_FROM_SYSTEM_TIME: Final = 1 << 1
FIRST_SECOND_US: Final = 450_000  # phase of the reference's once-a-second checks, in all recordings
OLDEST_VALID_UTC_US: Final = 1_640_995_200_000_000  # 2022-01-01

_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_INFO: Final = 6
_TENTH_US: Final = 100_000
_SECOND_US: Final = 1_000_000
_BOARD_TYPE_SITL: Final = 3


class VehicleAhrs(Ahrs, Protocol):
    """An AHRS with an origin, as the vehicle needs it."""

    def estimator_started(self) -> bool:
        """Tell whether the estimator runs."""

    def origin(self) -> Origin | None:
        """Return the EKF origin, or None while unset."""

    def set_origin(self, origin: Origin) -> bool:
        """Set the origin, once; tell whether it was set."""


@dataclass(frozen=True, slots=True)
class AhrsParts:
    """What an AHRS is made of."""

    clock: VirtualClock
    sources: EkfSources
    log: ExtNavLog
    params: ParamTable


def bench(heading_deg: float = 0.0) -> Callable[[AhrsParts], VehicleAhrs]:
    """Return the maker of an AHRS that stands still, level, with a heading; it has a compass if COMPASS_USE says so."""

    def make(parts: AhrsParts) -> VehicleAhrs:
        return BenchAhrs(
            parts.clock,
            parts.sources,
            parts.log,
            heading_rad=math.radians(heading_deg),
            has_compass=lambda: parts.params.get_int("COMPASS_USE") != 0,
        )

    return make


@dataclass(frozen=True)
class VehicleConfig:
    """How to build a vehicle.

    Attributes:
        make_ahrs: makes the AHRS; a vehicle on the bench, heading north, unless told otherwise.
        links: how many links it will have.
        defaults: parameter values by name that count as its defaults, as from a defaults file.
        overrides: parameter values by name that hold whatever defaults and stored values say.
        open_log: opens the next log; None for no logging, or for the next one of ``log_store``.
        log_store: the folder of logs, which clients may list, download and erase.
        param_store: where parameters are kept over a restart.
        signing_store: where the signing key is kept.
        firmware: what it claims to be.
        boot_utc_us: time of day at boot, 0 when unknown.
    """

    make_ahrs: Callable[[AhrsParts], VehicleAhrs] = field(default_factory=bench)
    links: int = 1
    defaults: Mapping[str, float] = field(default_factory=dict)
    overrides: Mapping[str, float] = field(default_factory=dict)
    open_log: Callable[[], LogSink] | None = None
    log_store: LogStore | None = None
    param_store: ParamStore | None = None
    signing_store: KeyStore = field(default_factory=MemoryKeyStore)
    firmware: Firmware = REFERENCE
    boot_utc_us: int = 0


class Vehicle:
    """A vehicle without motors: its parameters, external navigation, log, checks and MAVLink endpoint.

    Time comes from whoever calls ``loop`` and ``receive_bytes``; a scheduler or a real-time pacer.

    Raises:
        ValueError: a default that its parameter cannot take.
    """

    def __init__(self, config: VehicleConfig) -> None:
        self._config = config
        self.clock = VirtualClock()
        self.internal_errors = InternalErrors()
        visual_odom_params = make_params()
        self.params = ParamTable(make_groups(config.links, visual_odom_params))
        self.unknown_defaults = tuple(self.params.apply_defaults(config.defaults, "defaults"))
        if config.param_store is not None:
            config.param_store.restore(self.params)
        for name, value in config.overrides.items():
            self.params.set(name, value)
        open_log = config.open_log or (config.log_store.open_next if config.log_store else None)
        self.logger = Logger(self.clock, open_log, self._on_log_open)
        self._logs = self._make_log_library()
        self.texts = StatusTextQueue(self.clock.micros64)
        self.texts.on_text.append(lambda _severity, text: self.log_text(text))
        self.sources = EkfSources(lambda name: self.params.get_int(f"EK3_{name}"))
        self._ext_nav_log = ExtNavLog(self.logger, lambda: self.params.get_int("LOG_REPLAY") != 0)
        parts = AhrsParts(self.clock, self.sources, self._ext_nav_log, self.params)
        self.ahrs: VehicleAhrs = config.make_ahrs(parts)
        self.visual_odom = AP_VisualOdom(
            visual_odom_params,
            ahrs=self.ahrs,
            gcs=self.texts,
            logger=self.logger,
            clock=self.clock,
            errors=self.internal_errors,
        )
        self.visual_odom.init()
        self.arming = Arming(self._make_checks(), self.params.group("ARMING_"), self.texts, self.clock)
        self._utc_offset_us = config.boot_utc_us
        self._initialised = False
        self._home: Location | None = None
        self._home_changed = False
        self._disarmed_us: int | None = None
        self._internal_errors_told = 0
        self._next_tenth_us = 0
        self._next_second_us = FIRST_SECOND_US
        self.signing_store = config.signing_store
        self._files = VehicleFiles(
            self.params,
            log_directory=config.log_store.directory if config.log_store else None,
            system_texts={"uarts.txt": UartsText(self._uart_counts, self.clock.micros64)},
        )
        self.endpoint = MavEndpoint(self)

    def _make_log_library(self) -> StoredLogs | NoLogs:
        if self._config.log_store is None:
            return NoLogs()
        return StoredLogs(
            self._config.log_store,
            clock=self.clock,
            open_number=lambda: self.logger.open_number,
            close_log=self.logger.close,
            utc_us=self.utc_us,
        )

    def _uart_counts(self) -> list[UartCounts]:
        return [
            UartCounts(channel.bytes_sent, channel.bytes_received, channel.active, channel.name)
            for channel in self.endpoint.channels
        ]

    def _make_checks(self) -> tuple[Check, ...]:
        # The firmware's order, of those checks that have something to look at here.
        return (
            Check(0, lambda: None if self._initialised else "System not initialised", ends=True),
            Check(0, lambda: None if self.ahrs.estimator_started() else "AHRS: EKF3 not started"),
            Check(CHECK_LOGGING, lambda: "Logging failed" if self.logger.failure else None),
            Check(CHECK_LOGGING, lambda: "Downloading logs" if self.endpoint.log_transfer.is_active else None),
            Check(ANY_CHECK, self._check_internal_errors),
            Check(CHECK_VISION, self._check_visual_odom),
        )

    def _check_internal_errors(self) -> str | None:
        errors = self.internal_errors
        return f"Internal errors 0x{errors.mask:x} l:{errors.last_line} {errors.describe()}" if errors.mask else None

    def _check_visual_odom(self) -> str | None:
        failure = self.visual_odom.pre_arm_check()
        return None if failure is None else f"VisOdom: {failure}"

    def loop(self, now_us: int) -> None:
        """Run one pass of the main loop at ``now_us`` since boot, 400 times a second."""
        self.clock.set_us(now_us)
        if not self._initialised and now_us >= AHRS_START_US:
            self._finish_boot()
        self._run_estimator_frame()
        self._set_home_once()
        self._tell_internal_errors()
        self._run_slow_tasks(now_us)
        self.endpoint.poll(now_us)
        self.logger.update(self._log_wanted(now_us), self.params)

    def receive_bytes(self, channel: Channel, data: bytes, now_us: int, read_us: int | None = None) -> None:
        """Handle what a link delivered, at ``now_us`` since boot (``read_us`` if it was read earlier)."""
        self.clock.set_us(now_us)
        self.endpoint.receive_bytes(channel, data, now_us, read_us)

    def _finish_boot(self) -> None:
        self._initialised = True
        self.logger.update(self._log_wanted(self.clock.micros64()), self.params)
        self.texts.send_text(_MAV_SEVERITY_INFO, "ArduPilot Ready")
        self.texts.send_text(_MAV_SEVERITY_INFO, "AHRS: DCM active")

    def _run_estimator_frame(self) -> None:
        if not self.ahrs.estimator_started():
            return
        camera = self.visual_odom
        self._ext_nav_log.frame(
            VisualOdomFrame(camera.get_pos_offset(), camera.get_delay_ms(), camera.healthy(), camera.enabled())
        )
        if camera.enabled():
            camera.align_position_to_ahrs(*self.sources.position_alignment())

    def _set_home_once(self) -> None:
        origin = self.ahrs.origin()
        if origin is None or self._home is not None:
            return
        self._home = Location(origin.lat, origin.lng, origin.alt_cm)
        self._home_changed = True
        self._log_place(ORGN_HOME, self._home)
        self._log_event(EV_SET_HOME)
        self.texts.send_text(_MAV_SEVERITY_INFO, f"Field Elevation Set: {math.trunc(origin.alt_cm / 100)}m")

    def _tell_internal_errors(self) -> None:
        mask = self.internal_errors.mask
        if mask != self._internal_errors_told:
            self._internal_errors_told = mask
            error = (ERR_SUBSYSTEM_INTERNAL_ERROR, ERR_INTERNAL_ERRORS_DETECTED)
            self.logger.write(ERR, (self.clock.micros64(), *error))
            self.texts.send_text(_MAV_SEVERITY_CRITICAL, f"Internal Errors 0x{mask:x}")

    def _run_slow_tasks(self, now_us: int) -> None:
        if now_us >= self._next_tenth_us:
            self._next_tenth_us = now_us + _TENTH_US
            self._log_attitude(now_us)
        if now_us >= self._next_second_us:
            self._next_second_us = now_us + _SECOND_US
            if not self.arming.armed:
                self.arming.update()
            self._log_statistics(now_us)
            self._store_parameters()

    def _store_parameters(self) -> None:
        if self._config.param_store is not None:
            self._config.param_store.save_if_changed(self.params.stored_values())

    def _log_wanted(self, now_us: int) -> bool:
        # The reference's logs begin where booting ends; and pymavlink's reader trips over records of the first 256 us.
        if not self._initialised:
            return False
        if self.arming.armed:
            return True
        if self._logs.suspends_logging:
            return False
        if self.params.get_int("LOG_DISARMED") != 0:
            return True
        return self._disarmed_us is not None and now_us - self._disarmed_us < LOG_AFTER_DISARM_US

    def close(self) -> None:
        """Close the log properly, and keep the parameters."""
        self.endpoint.ftp.close()
        self.logger.close()
        self._store_parameters()

    # What the log begins with, and what goes into it

    def _on_log_open(self) -> None:
        self._ext_nav_log.new_log()
        firmware, now_us = self._config.firmware, self.clock.micros64()
        self.log_text(firmware.banner)
        version = (firmware.major, firmware.minor, firmware.patch, firmware.release_type)
        source_hash = int(firmware.source_hash, 16)
        numbers = (*version, source_hash, firmware.banner, 0, 2, 2, 0, 0)
        self.logger.write(VER, (now_us, _BOARD_TYPE_SITL, 65535, *numbers))
        for line in self.banner()[1:]:
            self.log_text(line)
        self.logger.write(MODE, (now_us, MODE_STABILIZE, MODE_STABILIZE, MODE_REASON_INITIALISED))
        origin = self.origin()
        if origin is not None:
            self._log_place(ORGN_EKF, origin)
        if self._home is not None:
            self._log_place(ORGN_HOME, self._home)

    def _log_attitude(self, now_us: int) -> None:
        now = self.attitude()
        if now is not None:
            roll, pitch, yaw = degrees(now.roll), degrees(now.pitch), degrees(now.yaw)
            heading = yaw if yaw >= 0 else yaw + f32(360)
            self.logger.write(ATT, (now_us, roll, roll, pitch, pitch, heading, heading, 3))

    def _log_statistics(self, now_us: int) -> None:
        self.logger.write(DSF, (now_us, self.logger.dropped, 0, self.logger.size, 0, 0, 0))
        for channel in self.endpoint.channels:
            if channel.active:
                counts = (channel.codec.frames_sent, channel.frames_received, channel.packets_dropped)
                self.logger.write(MAV, (now_us, channel.index, *counts, 0, 0, 0, 0))

    def _log_event(self, event: int) -> None:
        self.logger.write(EV, (self.clock.micros64(), event))

    def _log_place(self, kind: int, place: Location) -> None:
        self.logger.write(ORGN, (self.clock.micros64(), kind, place.lat, place.lng, place.alt_cm))

    def log_text(self, text: str) -> None:
        """Write a MSG record, which holds the first 50 characters."""
        self.logger.write(MSG, (self.clock.micros64(), text[:50]))

    def log_parameter(self, name: str, value: np.float32) -> None:
        """Write a PARM record of a change."""
        self.logger.write_parameter(name, value)

    def log_command(self, values: Sequence[LogValue]) -> None:
        """Write a MAVC record: everything after TimeUS."""
        self.logger.write(MAVC, (self.clock.micros64(), *values))

    def log_timesync(self, system_id: int, round_trip_us: int) -> None:
        """Write a TSYN record."""
        values = (self.clock.micros64(), system_id, round_trip_us)
        self.logger.write_named("TSYN", "TimeUS,SysID,RTT", "s-s", "F-F", "QBQ", values)

    def log_aux_function(self, function: int, position: int, result: bool) -> None:
        """Write an AUXF record for a function run by MAVLink (source 3)."""
        values = (self.clock.micros64(), function, position, 3, 0, int(result))
        labels = "TimeUS,function,pos,source,index,result"
        self.logger.write_named("AUXF", labels, "s#----", "F-----", "QHBBHB", values)

    def log_dropped(self) -> int:
        """Return the number of log records lost."""
        return self.logger.dropped

    # What the endpoint asks

    @property
    def files(self) -> FtpFiles:
        """What MAVLink FTP shows."""
        return self._files

    @property
    def logs(self) -> LogLibrary:
        """The logs that clients may download."""
        return self._logs

    def firmware_version(self) -> tuple[int, str, str]:
        """Return flight_sw_version, the version text and the source hash."""
        firmware = self._config.firmware
        return firmware.sw_version, firmware.version_text, firmware.source_hash

    def banner(self) -> tuple[str, ...]:
        """Return the texts that introduce the vehicle."""
        frame_type = "X" if self.params.get_int("FRAME_TYPE") == 1 else "PLUS"
        return self._config.firmware.banner, f"Frame: QUAD/{frame_type}"

    def is_initialised(self) -> bool:
        """Tell whether booting is over."""
        return self._initialised

    def is_armed(self) -> bool:
        """Tell whether the vehicle is armed."""
        return self.arming.armed

    def custom_mode(self) -> int:
        """Return STABILIZE; there is no flight controller behind it."""
        return MODE_STABILIZE

    def arm(self, do_checks: bool) -> bool:
        """Try to arm; failures are told as texts."""
        armed = self.arming.arm(do_checks)
        if armed:
            self.endpoint.log_transfer.pause()
            # The log that arming opens is to hold the fact.
            self.logger.update(True, self.params)
            self._log_arm(armed=True, forced=not do_checks, event=EV_ARMED)
        else:
            self._disarmed_us = self.clock.micros64()
        return armed

    def disarm(self, force: bool) -> bool:
        """Disarm; tell whether that changed anything."""
        disarmed = self.arming.disarm()
        if disarmed:
            self._disarmed_us = self.clock.micros64()
            self._log_arm(armed=False, forced=force, event=EV_DISARMED)
        return disarmed

    def _log_arm(self, *, armed: bool, forced: bool, event: int) -> None:
        checks = self.arming.enabled_checks()
        values = (int(armed), checks, int(forced), ARM_METHOD_MAVLINK)
        self.logger.write(ARM, (self.clock.micros64(), *values))
        self._log_event(event)

    def run_prearm_checks(self) -> None:
        """Run all pre-arm checks and tell their failures as texts."""
        self.arming.pre_arm_checks(display=True)

    def prearm_passed(self) -> bool:
        """Tell whether the last run of the checks passed."""
        return self.arming.passed

    def checks_enabled(self) -> bool:
        """Tell whether any arming check is enabled."""
        return self.arming.enabled_checks() != 0

    def set_source_set(self, index: int) -> None:
        """Choose one of the three EKF source sets, 0..2."""
        if index != self.sources.active_set:
            self.sources.active_set = index
            self._log_event(EV_SOURCE_SET_1 + index)

    def set_origin(self, location: Location) -> OriginResult:
        """Set the EKF origin, once; every core says so."""
        if not self.ahrs.set_origin(Origin(location.lat, location.lng, location.alt_cm)):
            return OriginResult.FAILED
        self._log_place(ORGN_EKF, location)
        mask = self.params.get_int("EK3_IMU_MASK")
        for core in (number for number in range(2) if mask >> number & 1):
            self.texts.send_text(_MAV_SEVERITY_INFO, f"EKF3 IMU{core} origin set")
        return OriginResult.SET

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""
        origin = self.ahrs.origin()
        return None if origin is None else Location(origin.lat, origin.lng, origin.alt_cm)

    def home(self) -> Location | None:
        """Return home, or None while unset."""
        return self._home

    def take_home_changed(self) -> bool:
        """Tell, once, that home has changed."""
        changed, self._home_changed = self._home_changed, False
        return changed

    def attitude(self) -> Attitude | None:
        """Return the attitude, or None while there is none; body rates are zero."""
        quat = self.ahrs.get_quaternion()
        if quat is None:
            return None
        roll, pitch, _ = quat.to_euler()
        return Attitude(roll, pitch, self.ahrs.get_yaw_rad(), (f32(0), f32(0), f32(0)))

    def utc_us(self) -> int:
        """Return the time of day in us since 1970, 0 while unknown."""
        return self._utc_offset_us + self.clock.micros64() if self._utc_offset_us else 0

    def set_utc_us(self, utc_us: int) -> None:
        """Take a time of day if BRD_RTC_TYPES admits it, it is plausible, and time does not run backwards."""
        if not self.params.get_int("BRD_RTC_TYPES") & RTC_FROM_SYSTEM_TIME or utc_us < OLDEST_VALID_UTC_US:
            return
        if utc_us > self.utc_us() and self._utc_offset_us == 0:
            self._utc_offset_us = utc_us - self.clock.micros64()
