# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated vehicle: everything wired together, behind a MAVLink endpoint."""

import math
from typing import Final

from ap_core.clock import VirtualClock
from ap_core.fmath import f32
from ap_core.internal_error import InternalErrors
from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ekf_stub.ahrs_base import AHRS_START_US
from ekf_stub.ext_nav_log import ExtNavLog, VisualOdomFrame
from ekf_stub.sources import EkfSources
from emulator.arming import ANY_CHECK, CHECK_VISION, Arming, Check
from emulator.ftp_files import VehicleFiles
from emulator.log_library import NoLogs, StoredLogs
from emulator.logger import Logger
from emulator.parameters import make_groups
from emulator.uarts_text import UartCounts, UartsText
from emulator.vehicle_config import AhrsParts, VehicleAhrs, VehicleConfig, bench
from emulator.vehicle_log import ORGN_EKF, ORGN_HOME, VehicleLog
from mav_handlers.channel import Channel
from mav_handlers.endpoint import MavEndpoint
from mav_handlers.ftp_ports import FtpFiles
from mav_handlers.log_transfer import LogLibrary
from mav_handlers.ports import Attitude, Location, OriginResult
from mav_handlers.statustext import StatusTextQueue

__all__ = ["LOOP_PERIOD_US", "AhrsParts", "Vehicle", "VehicleAhrs", "VehicleConfig", "bench"]

LOOP_PERIOD_US: Final = 2500
CHECK_LOGGING: Final = 1 << 10
ERR_SUBSYSTEM_INTERNAL_ERROR: Final = 30
ERR_INTERNAL_ERRORS_DETECTED: Final = 1
MODE_STABILIZE: Final = 0
EV_ARMED: Final = 10
EV_DISARMED: Final = 11
EV_SET_HOME: Final = 25
EV_SOURCE_SET_1: Final = 85
LOG_AFTER_DISARM_US: Final = 15_000_000
RTC_FROM_SYSTEM_TIME: Final = 1 << 1
FIRST_SECOND_US: Final = 450_000  # phase of the reference's once-a-second checks, in all recordings
OLDEST_VALID_UTC_US: Final = 1_640_995_200_000_000  # 2022-01-01

_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_INFO: Final = 6
_TENTH_US: Final = 100_000
_SECOND_US: Final = 1_000_000


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
        self.log = VehicleLog(self.logger, self.clock)
        self._logs = self._make_log_library()
        self.texts = StatusTextQueue(self.clock.micros64)
        self.texts.on_text.append(lambda _severity, text: self.log.text(text))
        self.sources = EkfSources(lambda name: self.params.get_int(f"EK3_{name}"))
        self._ext_nav_log = ExtNavLog(self.logger, lambda: self.params.get_int("LOG_REPLAY") != 0)
        parts = AhrsParts(
            self.clock,
            self.sources,
            self._ext_nav_log,
            self.params,
            self.texts,
            gps=lambda: None,
            is_armed=self.is_armed,
            visual_odom_enabled=lambda: self.visual_odom.enabled(),
        )
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
            Check(0, self._check_ahrs),
            Check(CHECK_LOGGING, lambda: "Logging failed" if self.logger.failure else None),
            Check(CHECK_LOGGING, lambda: "Downloading logs" if self.endpoint.log_transfer.is_active else None),
            Check(ANY_CHECK, self._check_internal_errors),
            Check(CHECK_VISION, self._check_visual_odom),
        )

    def _check_ahrs(self) -> str | None:
        failure = self.ahrs.pre_arm_failure(requires_position=False)
        return None if failure is None else f"AHRS: {failure}"

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
        self.ahrs.update()
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
        self._home = origin
        self._home_changed = True
        self.log.place(ORGN_HOME, self._home)
        self.log.event(EV_SET_HOME)
        self.texts.send_text(_MAV_SEVERITY_INFO, f"Field Elevation Set: {math.trunc(origin.alt_cm / 100)}m")

    def _tell_internal_errors(self) -> None:
        mask = self.internal_errors.mask
        if mask != self._internal_errors_told:
            self._internal_errors_told = mask
            self.log.error(ERR_SUBSYSTEM_INTERNAL_ERROR, ERR_INTERNAL_ERRORS_DETECTED)
            self.texts.send_text(_MAV_SEVERITY_CRITICAL, f"Internal Errors 0x{mask:x}")

    def _run_slow_tasks(self, now_us: int) -> None:
        if now_us >= self._next_tenth_us:
            self._next_tenth_us = now_us + _TENTH_US
            self.log.attitude(self.attitude())
        if now_us >= self._next_second_us:
            self._next_second_us = now_us + _SECOND_US
            if not self.arming.armed:
                self.arming.update()
            self.log.statistics(self.endpoint.channels)
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

    def _on_log_open(self) -> None:
        self._ext_nav_log.new_log()
        self.log.start(self._config.firmware, self.banner(), MODE_STABILIZE)
        for kind, place in ((ORGN_EKF, self.origin()), (ORGN_HOME, self._home)):
            if place is not None:
                self.log.place(kind, place)

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
        self.log.arming(armed=armed, checks=self.arming.enabled_checks(), forced=forced)
        self.log.event(event)

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
            self.log.event(EV_SOURCE_SET_1 + index)

    def set_origin(self, location: Location) -> OriginResult:
        """Set the EKF origin, once; every core says so."""
        if not self.ahrs.set_origin(location):
            return OriginResult.FAILED
        self.log.place(ORGN_EKF, location)
        mask = self.params.get_int("EK3_IMU_MASK")
        for core in (number for number in range(2) if mask >> number & 1):
            self.texts.send_text(_MAV_SEVERITY_INFO, f"EKF3 IMU{core} origin set")
        return OriginResult.SET

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""
        return self.ahrs.origin()

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
