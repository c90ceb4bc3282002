# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated vehicle: everything wired together, behind a MAVLink endpoint.

Two calls move it, both with the time: ``receive_bytes`` when a link has delivered, and ``loop`` 400 times per second. A
pass of the loop runs the tasks in the firmware's order, each at its own period: estimator, modes and arming, sensors,
slow tasks, telemetry, log. So records and messages come in the order that a real log has. Nothing here waits, sleeps
or runs beside; who calls decides whether time is real.

This is the one place that knows all parts. They do not know it: each is built with what it asks for, and where two
need each other, with a function that looks the other up later. The second half of the class is the vehicle as the
endpoint sees it (``mav_handlers.ports``), and for the most part passes on.
"""

from typing import Final

from ap_core.cint import i16
from ap_core.clock import NEVER, VirtualClock
from ap_core.internal_error import InternalErrors
from ap_core.param import ParamTable
from ap_core.param_cache import FromParams
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ahrs.parts import AhrsParts
from ekf_stub.core.params import EkfSources
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.log.ekf_log_structure import XKF1
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import ReplayLog
from ekf_stub.log.replay_log_structure import RFRH
from mav_handlers.channel import Channel
from mav_handlers.endpoint import MavEndpoint
from mav_handlers.ports import Location, OriginResult
from mav_handlers.statustext import TEXT_FIELD_LEN, StatusTextQueue
from viso.logs.library import NoLogs, StoredLogs
from viso.logs.logger import Logger
from viso.logs.vehicle_log import ORGN_EKF, ORGN_HOME, VehicleLog
from viso.parameters.conversion import carry_over
from viso.parameters.left_out import left_out
from viso.parameters.table import make_groups
from viso.sensors.flown.flight import Event, Happening
from viso.sensors.flown.source import RecordedSource
from viso.sensors.flying.source import FlyingSource
from viso.sensors.hil.source import HilSource
from viso.sensors.standing import BenchSource
from viso.vehicle.banner import banner
from viso.vehicle.config import VehicleConfig, bench
from viso.vehicle.copter.copter import Copter
from viso.vehicle.copter.parts import CopterParts
from viso.vehicle.flow import FLOW_PERIOD_US, MavlinkFlow
from viso.vehicle.ftp.files import VehicleFiles
from viso.vehicle.ftp.uarts_text import UartCounts, UartsText
from viso.vehicle.gps import GPS_PERIOD_US, SPECIFIED_TEXT, MavlinkGps
from viso.vehicle.ranges import FIRST_RANGE_US, RANGE_PERIOD_US, MavlinkRanges
from viso.vehicle.rtc import Rtc, RtcSource
from viso.vehicle.vicon import Vicon

__all__ = ["LOOP_PERIOD_US", "Vehicle", "VehicleConfig", "bench"]

LOOP_PERIOD_US: Final = 2500
ERR_SUBSYSTEM_INTERNAL_ERROR: Final = 30
ERR_INTERNAL_ERRORS_DETECTED: Final = 1
EV_EKF_YAW_RESET: Final = 62
EV_SOURCE_SET_1: Final = 85
MASK_LOG_ATTITUDE_FAST: Final = 1 << 0
THROTTLE_PERIOD_US: Final = 20_000
FAST_ATTITUDE_US: Final = 40_000
LOG_AFTER_DISARM_US: Final = 15_000_000
FIRST_SECOND_US: Final = 450_000  # phase of the reference's once-a-second checks, in all recordings

_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6
_TENTH_US: Final = 100_000
_SECOND_US: Final = 1_000_000


def _next_of(due_us: int, period_us: int, times_us: range) -> int:
    """Return when a task is due next that has run in each of some passes in which it was due."""
    last_us, step_us = times_us[-1], times_us.step
    if due_us > last_us:
        return due_us
    first_us = times_us.start + max(0, -((times_us.start - due_us) // step_us)) * step_us
    every_us = -(-period_us // step_us) * step_us
    return first_us + (last_us - first_us) // every_us * every_us + period_us


def _log_end_us(disarmed_us: int, now_us: int) -> int:
    """Return when the log ends after disarming, if that is to come."""
    end_us = disarmed_us + LOG_AFTER_DISARM_US
    return end_us if end_us > now_us else NEVER


class Vehicle:
    """A vehicle: its parameters, external navigation, log, checks and MAVLink endpoint.

    A scheduler or a real-time pacer sets the ``clock``, and calls ``loop`` and ``receive_bytes``.

    Attributes:
        firmware: the release that it is.
        clock, params, texts, log, logger, logs, files: what all share.
        battery_monitor: BATT_MONITOR at boot, 0 for none.
        ahrs, visual_odom, gps, flow, ranges, rtc, copter: what it is made of.
        hil: the simulator that its sensors come from, None where they do not.
        airframe: what flies, and where it really is; None of a vehicle that nobody flies.
        endpoint: its end of MAVLink.
        reboot_requested: a client has asked for a restart.

    Raises:
        ValueError: a default that its parameter cannot take, or a camera that has nothing to see.
    """

    def __init__(self, config: VehicleConfig) -> None:
        self._config = config
        self.firmware = config.firmware
        self.release = config.firmware.endpoint
        self.clock = VirtualClock()
        self.internal_errors = InternalErrors()
        visual_odom_params = make_params()
        links = config.links + config.vicon
        self.params = ParamTable(make_groups(links, visual_odom_params, config.firmware.params))
        renames = config.firmware.params.renames
        defaults = carry_over(config.defaults, self.params, renames)
        unknown = self.params.apply_defaults(defaults.values, "defaults", read_only=config.read_only)
        self.unknown_defaults = (*defaults.lost, *unknown)
        config.param_store.restore(self.params, renames)
        self.params.set_from_mavlink("STAT_BOOTCNT", i16(self.params.get_int("STAT_BOOTCNT") + 1))  # AP_Stats::init
        for name, value in config.overrides.items():
            self.params.set(name, value)
        open_log = config.open_log or (config.log_store.open_next if config.log_store else None)
        self.logger = Logger(self.clock, open_log, self._on_log_open, config.firmware.log.own)
        self.log = VehicleLog(self.logger, self.clock, config.firmware)
        self.logs = self._make_log_library()
        self.texts = StatusTextQueue(self.clock.micros64)
        self.texts.on_text.append(lambda _severity, text: self.log.text(text[:TEXT_FIELD_LEN]))
        self.sources = EkfSources(lambda name: self.params.get_int(f"EK3_{name}"))
        self.params.on_change.append(self.sources.forget)
        logs_replay = FromParams(self.params, lambda: self.params.get_int("LOG_REPLAY") != 0)
        self._replay_log = ReplayLog(
            self.logger, lambda: logs_replay() and self.logger.takes(RFRH), event_order=config.firmware.event_order
        )
        self.rtc = Rtc(self.clock, self.params, lambda: self.copter.arming.armed, config.boot_utc_us)
        self.gps = MavlinkGps(self.clock, self.params, self.texts, self.logger, self._take_gps_time)
        self.ranges = MavlinkRanges(self.clock, self.params, self.logger, config.firmware.params.range_unit)
        parts = AhrsParts(
            self.clock,
            self.sources,
            self._replay_log,
            self.logger,
            self.params,
            self.texts,
            gps=self._gps_sample,
            gps_lag_s=self._gps_lag_s,
            is_armed=lambda: self.copter.arming.armed,
            visual_odom_enabled=lambda: self.visual_odom.enabled(),
            on_yaw_reset=lambda: self.log.event(EV_EKF_YAW_RESET),
            on_primary=lambda core: self.copter.note_primary(core),
            flying_since_us=lambda: self.copter.landing.flying_since_us(),
            home=lambda: self.copter.home.place,
            release=config.firmware.ekf,
            ranges=self.ranges.state,
            expected=self._expected,
        )
        self.ahrs: AhrsBase = config.make_ahrs(parts)
        self.hil = self.ahrs.source if isinstance(self.ahrs.source, HilSource) else None
        self.airframe = self.ahrs.source if isinstance(self.ahrs.source, FlyingSource) else None
        self._vicon = self._make_vicon() if config.vicon else None
        self._vicon_channel: Channel | None = None
        self.flown = self.ahrs.source if isinstance(self.ahrs.source, RecordedSource) else None
        self.visual_odom = AP_VisualOdom(
            visual_odom_params,
            ahrs=self.ahrs,
            gcs=self.texts,
            logger=self.logger,
            clock=self.clock,
            errors=self.internal_errors,
            release=config.firmware.visual_odom,
        )
        self.visual_odom.init()
        self._camera_frames = FromParams(self.params, self._make_camera_frames)
        self._attitude_period_us = FromParams(self.params, self._find_attitude_period_us)
        self._logs_disarmed = FromParams(self.params, lambda: self.params.get_int("LOG_DISARMED") != 0)
        self.flow = MavlinkFlow(self.clock, self.params, self.ahrs, self.logger)
        self.battery_monitor = self.params.get_int("BATT_MONITOR")
        self._initialised = False
        self.copter = self._make_copter()
        self.copter.landing.is_told = self.flown is not None and self.flown.flight.tells_flying
        self._last_location: Location | None = None
        self._internal_errors_told = 0
        self._kept_generation = 0
        self._next_throttle_us = 0
        self._next_flow_us = 0
        self._next_range_us = FIRST_RANGE_US
        self._next_gps_us = 0
        self._next_tenth_us = 0
        self._next_attitude_us = 0
        self._next_second_us = FIRST_SECOND_US
        self._seen: tuple[object, ...] = ()
        self.reboot_requested = False
        self.signing_store = config.signing_store
        self.files = VehicleFiles(
            self.params,
            log_directory=config.log_store.directory if config.log_store else None,
            system_texts={"uarts.txt": UartsText(self._uart_counts, self.clock.micros64)},
        )
        self.endpoint = MavEndpoint(self, config.message_intervals)

    def _make_vicon(self) -> Vicon:
        if self.airframe is None:
            raise ValueError("the simulator's own camera sees a vehicle that flies alone")
        return Vicon(self.airframe, self.params.group("SIM_VICON_"))

    def _see(self, now_us: int) -> None:
        """Let the simulator's own camera look, on the link that comes after those of clients."""
        vicon, channel = self._vicon, self._vicon_channel
        if vicon is None:
            return
        if channel is None:
            channel = self._vicon_channel = self.endpoint.open_channel("vicon", now_us=now_us)
        arrived = vicon.update(now_us)
        if arrived:
            self.receive_bytes(channel, arrived)
        self.endpoint.bytes_to_send(channel)

    def _make_log_library(self) -> StoredLogs | NoLogs:
        if self._config.log_store is None:
            return NoLogs()
        return StoredLogs(
            self._config.log_store,
            clock=self.clock,
            open_number=lambda: self.logger.open_number,
            close_log=self.logger.close,
            utc_us=lambda: self.rtc.utc_us(),
        )

    def _uart_counts(self) -> list[UartCounts]:
        return [
            UartCounts(channel.bytes_sent, channel.bytes_received, channel.active, channel.name)
            for channel in self.endpoint.channels
        ]

    def _make_copter(self) -> Copter:
        return Copter(
            CopterParts(
                clock=self.clock,
                params=self.params,
                release=self._config.firmware.params,
                variance_texts=self._config.firmware.variance_texts,
                texts=self.texts,
                log=self.log,
                logger=self.logger,
                ahrs=self.ahrs,
                visual_odom=self.visual_odom,
                internal_errors=self.internal_errors,
                flow=self.flow,
                ranges=self.ranges,
                gps=self._gps_sample,
                is_initialised=self.is_initialised,
                is_downloading=lambda: self.endpoint.log_transfer.is_active,
                on_mode=lambda: self.endpoint.request_message_everywhere("HEARTBEAT"),
                on_armed=lambda: self.endpoint.log_transfer.pause(),
                airframe=self.airframe,
                stands_for_ever=isinstance(self.ahrs.source, BenchSource),
            )
        )

    def loop(self) -> None:
        """Run one pass of the main loop, 400 times per second."""
        now_us = self.clock.micros64()
        if not self._initialised and now_us >= AHRS_START_US:
            self._finish_boot()
        if self.flown is not None and self._initialised:
            for event in self.flown.events_until(now_us):
                self._let_happen(event)
        self._seen = self._situation()
        self.ahrs.update(self._camera_frames()[self.visual_odom.healthy()])
        self._align_camera()
        self._end_pass(now_us)

    def _end_pass(self, now_us: int) -> None:
        """Do what a pass does once the estimator has run."""
        self.copter.update()
        if self.internal_errors.mask != self._internal_errors_told:
            self._tell_internal_errors()
        if self._initialised:
            self._run_sensors(now_us)
        self._run_slow_tasks(now_us)
        self._see(now_us)
        self.endpoint.poll(now_us)
        self.logger.update(self._log_wanted(), self.params)

    def loop_quietly(self, times_us: range) -> int:
        """Run passes of which nothing comes but what the filter makes of its inertial data, and one with a task.

        What ``loop`` would have done is done for many at once; and for one of which something came, to its end.

        Args:
            times_us: of the next passes, since boot.

        Returns:
            How many were run: all, or until ``loop`` is to run the next.
        """
        if not times_us:
            return 0
        start_us, step_us = times_us.start, times_us.step
        until_us = self._estimator_quiet_until_us()
        task_us = self._next_task_us() if until_us > start_us else 0
        if not task_us:
            return 0
        before = -((start_us - until_us) // step_us)
        quiet = times_us[: min(before, max(0, -((start_us - task_us) // step_us)) + 1)]
        count = self.ahrs.run_quietly(quiet, self.clock.set_us, self._is_quiet)
        if not count:
            return 0
        now_us = quiet[count - 1]
        is_quiet = now_us < task_us and self._is_quiet(now_us)
        over = quiet[: count if is_quiet else count - 1]
        if over:
            self._next_gps_us = _next_of(self._next_gps_us, GPS_PERIOD_US, over)
            self._next_flow_us = _next_of(self._next_flow_us, FLOW_PERIOD_US, over)
            self._next_range_us = _next_of(self._next_range_us, RANGE_PERIOD_US, over)
            self._next_throttle_us = _next_of(self._next_throttle_us, THROTTLE_PERIOD_US, over)
            self._next_attitude_us = _next_of(self._next_attitude_us, self._attitude_period_us(), over)
            self.endpoint.poll_quietly(over[-1])
        self.clock.set_us(now_us)
        self._align_camera()
        if not is_quiet:
            self._end_pass(now_us)
        return count

    def quiet_until_us(self) -> int:
        """Return before when nothing comes of passes but what the filter makes of its data; 0 if of the next one."""
        until_us = self._estimator_quiet_until_us()
        return until_us and min(until_us, self._next_task_us())

    def _estimator_quiet_until_us(self) -> int:
        """Return before when passes bring no more to the estimator than inertial data, as things are; 0 if the next."""
        if not self._initialised or self._situation() != self._seen:
            return 0
        until_us = self.ahrs.quiet_until_us()
        return until_us if self.flown is None else min(until_us, self.flown.next_event_us())

    def _is_quiet(self, now_us: int) -> bool:
        """Return whether nothing but the estimator has to do anything in a pass."""
        copter = self.copter
        is_quiet = self.endpoint.quiet_until_us() > now_us and copter.quiet_until_us() > now_us
        return is_quiet and not copter.has_news_of_terrain()

    def _may_expect_ground(self) -> bool:
        """Return whether to look for the ground: a log may report it in place of the vehicle."""
        copter = self.copter
        may_expect = self._told_expected() is None and copter.landing.may_expect(armed=copter.arming.armed)
        return may_expect or copter.has_news_of_terrain()

    def _next_task_us(self) -> int:
        """Return when something is to be done next, as things are, beside running the filter; 0 if at once."""
        if self.internal_errors.mask != self._internal_errors_told:
            return 0
        wanted = self._log_wanted()
        disarmed_us = self.copter.disarmed_us if wanted else None
        return min(
            self._next_tenth_us,
            self._next_attitude_us if self.logger.takes(XKF1) else NEVER,
            self._next_second_us,
            max(self._next_gps_us, self.gps.quiet_until_us()),
            NEVER if self.flow.is_idle else self._next_flow_us,
            NEVER if self.ranges.is_idle else self._next_range_us,
            self._next_throttle_us if self._may_expect_ground() else NEVER,
            NEVER if self._vicon is None else self._vicon.next_us(),
            NEVER if disarmed_us is None else _log_end_us(disarmed_us, self.clock.micros64()),
            self.copter.quiet_until_us(),
            self.endpoint.quiet_until_us(),
            self.logger.quiet_until_us(wanted),
        )

    def _situation(self) -> tuple[object, ...]:
        """Return what may change in the course of a pass, and then counts from the next one on."""
        copter = self.copter
        return (
            self.params.generation,
            self.sources.active_set,
            copter.arming.armed,
            copter.landing.landed,
            copter.home.place,
            self._expected(),
        )

    def receive_bytes(self, channel: Channel, data: bytes, read_us: int | None = None) -> None:
        """Handle what a link delivered; ``read_us`` since boot if it was read earlier than now."""
        self.endpoint.receive_bytes(channel, data, self.clock.micros64(), read_us)

    def _finish_boot(self) -> None:
        self._initialised = True
        self.copter.enter_initial_mode()
        self.logger.update(self._log_wanted(), self.params)
        self.texts.send_text(_MAV_SEVERITY_INFO, "ArduPilot Ready")
        self.texts.send_text(_MAV_SEVERITY_INFO, "AHRS: DCM active")
        for line in left_out({**self._config.defaults, **{param.name: float(param.value) for param in self.params}}):
            self.texts.send_text(_MAV_SEVERITY_WARNING, line)

    def _gps_sample(self) -> GpsSample | None:
        return (self.flown and self.flown.gps()) or self.gps.sample()

    def _told_expected(self) -> tuple[bool, bool] | None:
        return None if self.flown is None else self.flown.expected()

    def _expected(self) -> tuple[bool, bool]:
        return self._told_expected() or self.copter.landing.expected

    def _gps_lag_s(self) -> float:
        sample = self._gps_sample()
        return self.gps.lag_s() if sample is None else sample.lag_s

    def _let_happen(self, event: Event) -> None:
        """Do what the vehicle of a log did, if it is not so already."""
        match event.what, event.value:
            case Happening.ARMED | Happening.DISARMED, _:
                self.copter.follow(armed=event.what is Happening.ARMED)
            case Happening.LIFTED_OFF | Happening.LANDED, _:
                self.copter.landing.follow(landed=event.what is Happening.LANDED)
            case Happening.SOURCE_SET, int(index):
                self.set_source_set(index)
            case Happening.ORIGIN, Location() as place:
                self.set_origin(place)

    def _align_camera(self) -> None:
        if self.visual_odom.enabled() and self.ahrs.estimator_started():
            self.visual_odom.align_position_to_ahrs(*self.sources.position_alignment())

    def _make_camera_frames(self) -> tuple[VisualOdomFrame, VisualOdomFrame]:
        """Return what the estimator is told of the camera while it is not healthy, and while it is."""
        camera = self.visual_odom
        fixed = camera.get_pos_offset(), camera.get_delay_ms()
        return VisualOdomFrame(*fixed, False, camera.enabled()), VisualOdomFrame(*fixed, True, camera.enabled())

    def _tell_internal_errors(self) -> None:
        mask = self._internal_errors_told = self.internal_errors.mask
        self.log.error(ERR_SUBSYSTEM_INTERNAL_ERROR, ERR_INTERNAL_ERRORS_DETECTED)
        self.texts.send_text(_MAV_SEVERITY_CRITICAL, f"Internal Errors 0x{mask:x}")

    def _run_sensors(self, now_us: int) -> None:
        if now_us >= self._next_throttle_us:
            self._next_throttle_us = now_us + THROTTLE_PERIOD_US
            self.copter.expect_ground()
        if now_us >= self._next_gps_us:
            self._next_gps_us = now_us + GPS_PERIOD_US
            self.gps.update()
        if now_us >= self._next_flow_us:
            self._next_flow_us = now_us + FLOW_PERIOD_US
            self.flow.update()
        if now_us >= self._next_range_us:
            self._next_range_us = now_us + RANGE_PERIOD_US
            self.ranges.update()

    def _run_slow_tasks(self, now_us: int) -> None:
        if now_us >= self._next_tenth_us:
            self._next_tenth_us = now_us + _TENTH_US
            self.copter.disarm_when_idle()
            self.copter.check_estimator()
        if now_us >= self._next_attitude_us:
            self._next_attitude_us = now_us + self._attitude_period_us()
            if self.logger.takes(XKF1):
                self.log.attitude(self.ahrs.get_quaternion(), self.ahrs.get_yaw_rad())
                self.ahrs.log_estimates()
        if now_us >= self._next_second_us:
            self._next_second_us = now_us + _SECOND_US
            self.copter.arming.update()
            self.log.statistics(self.endpoint.channels)
            self._keep_parameters()

    def _find_attitude_period_us(self) -> int:
        fast = self.params.get_int("LOG_BITMASK") & MASK_LOG_ATTITUDE_FAST
        return FAST_ATTITUDE_US if fast else _TENTH_US

    def keep_set_parameters(self) -> None:
        """Keep the parameters if one was set since the last time; what is sent after that confirms nothing unkept."""
        if self.params.stored_generation != self._kept_generation:
            self._keep_parameters(synced=False)

    def _keep_parameters(self, *, synced: bool = True) -> None:
        self._kept_generation = self.params.stored_generation
        self._config.param_store.save_if_changed(self.params.stored_values(), synced=synced)

    def _log_wanted(self) -> bool:
        # The reference's logs begin where booting ends; and pymavlink's reader trips over records of the first 256 us.
        if not self._initialised or (self.logs.suspends_logging and not self.copter.arming.armed):
            return False
        return self.is_time_to_log()

    def close(self) -> None:
        """Close the log properly, and keep the parameters."""
        self.endpoint.ftp.close()
        self.logger.close()
        self._keep_parameters()

    def _on_log_open(self) -> None:
        self._replay_log.new_log()
        modes = self.copter.modes
        self.log.start(self.banner(), modes.current.number, modes.reason)
        for kind, place in ((ORGN_EKF, self.ahrs.origin()), (ORGN_HOME, self.copter.home.place)):
            if place is not None:
                self.log.place(kind, place)
        if self.gps.has_driver:
            self.log.text(SPECIFIED_TEXT)

    # What the endpoint asks

    def firmware_version(self) -> tuple[int, str, str]:
        """Return flight_sw_version, the version text and the source hash."""
        firmware = self._config.firmware
        return firmware.sw_version, firmware.version_text, firmware.source_hash

    def banner(self) -> tuple[str, ...]:
        """Return the texts that introduce the vehicle."""
        return banner(self._config.firmware, self.params)

    def is_initialised(self) -> bool:
        """Return whether booting is over."""
        return self._initialised

    def is_time_to_log(self) -> bool:
        """Return whether it is armed, was so or was to be so a moment ago, or logs while disarmed (LOG_DISARMED)."""
        if self.copter.arming.armed or self._logs_disarmed():
            return True
        disarmed_us = self.copter.disarmed_us
        return disarmed_us is not None and self.clock.micros64() - disarmed_us < LOG_AFTER_DISARM_US

    def request_reboot(self) -> None:
        """Ask whoever runs the vehicle for a restart."""
        self.reboot_requested = True

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
        return OriginResult.SET

    def last_location(self) -> Location | None:
        """Return where the vehicle is, or where it was when somebody last asked and it was known."""
        # FIRMWARE PARITY: each link remembers what it told itself.
        self._last_location = self.ahrs.get_location() or self._last_location
        return self._last_location

    def _take_gps_time(self, utc_us: int) -> None:
        known_before = self.rtc.utc_us() != 0
        self.rtc.set_utc_us(utc_us, RtcSource.GPS)
        if not known_before and self.rtc.utc_us():
            endpoint = self.endpoint
            endpoint.signing.update_timestamp(endpoint.channels, self.rtc.utc_us(), self.clock.millis())
