# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated vehicle: everything wired together, behind a MAVLink endpoint.

Two calls move it: ``receive_bytes`` when a link has delivered, and ``advance``, with the times of passes of the main
loop, which are 400 per second. A pass runs what comes before the filter, the filter, and then the tasks that have their
turn, in the firmware's order. So records and messages come in the order that a real log has. Nothing here waits, sleeps
or runs beside; who calls decides whether time is real.

This is the one place that knows all parts. The copter, the maker of the AHRS, and handlers and senders of the endpoint
get the vehicle, and take what they need of its parts; all others get the objects that they ask for. The last part of
the class is what the endpoint asks of the vehicle itself.
"""

from collections.abc import Mapping
from typing import Final

from ap_core.cint import i16
from ap_core.clock import NEVER, VirtualClock, count_before
from ap_core.internal_error import InternalErrors
from ap_core.location import Location
from ap_core.param import FromParams, ParamTable
from ap_visualodom.ap_visualodom import AP_VisualOdom, make_params
from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ahrs.estimator import announces_dcm, value_after_boot
from ekf_stub.core.params import EkfSources
from ekf_stub.log.ekf_log_structure import XKF1
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import ReplayLog
from ekf_stub.log.replay_log_structure import RFRH
from mav_handlers.channel import Channel
from mav_handlers.endpoint import MavEndpoint
from mav_handlers.senders.status import system_text
from mav_handlers.statustext import TEXT_FIELD_LEN, StatusTextQueue
from mav_handlers.transfers.log_transfer import LogTransfer
from mav_handlers.transfers.mission_items import FenceItems, ItemList, KeptItems, MissionType
from viso.logs.library import NoLogs, StoredLogs
from viso.logs.logger import Logger
from viso.logs.vehicle_log import ORGN_EKF, ORGN_HOME, VehicleLog
from viso.parameters.conversion import carry_over_from_any
from viso.parameters.left_out import left_out
from viso.parameters.releases import ALL_RENAMES
from viso.parameters.table import make_groups
from viso.vehicle.config import VehicleConfig, bench
from viso.vehicle.copter.copter import Copter
from viso.vehicle.copter.motors import frame_text
from viso.vehicle.copter.origin import Origin
from viso.vehicle.copter.switches import SWITCH_PERIOD_US
from viso.vehicle.flow import FLOW_PERIOD_US, OpticalFlow
from viso.vehicle.ftp import UartCounts, UartsText, VehicleFiles
from viso.vehicle.gps import GPS_PERIOD_US, Gps
from viso.vehicle.gps_receivers import GpsReceivers
from viso.vehicle.ranges import FIRST_RANGE_US, RANGE_PERIOD_US, RangeFinders
from viso.vehicle.rtc import Rtc, RtcSource
from viso.vehicle.sensors.flight import Event, Happening
from viso.vehicle.sensors.source import ImuOptions, VehicleSource
from viso.vehicle.simulated_flow import SimulatedFlow
from viso.vehicle.simulated_gps import SimulatedGps
from viso.vehicle.simulated_ranges import SimulatedRanges
from viso.vehicle.tasks import Task, always_idle, next_due_us
from viso.vehicle.vicon import Vicon

__all__ = ["LOOP_PERIOD_US", "Vehicle", "VehicleConfig", "bench"]

LOOP_PERIOD_US: Final = 2500
ERR_SUBSYSTEM_INTERNAL_ERROR: Final = 30
ERR_INTERNAL_ERRORS_DETECTED: Final = 1
EV_GPS_PRIMARY_CHANGED: Final = 67
EV_SOURCE_SET_1: Final = 85
SECOND_SIMULATED_GPS: Final = "SIM_GPS2_"
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


class Vehicle:
    """A vehicle: its parameters, external navigation, log, checks and MAVLink endpoint.

    A scheduler or a real-time pacer calls ``advance`` and ``receive_bytes``.

    Attributes:
        firmware: the release that it is.
        clock, params, texts, log, logger, logs, log_transfer, files: what all share.
        sources, replay_log: the EKF's source sets, and where its inputs are logged.
        battery_monitor: BATT_MONITOR at boot, 0 for none.
        ahrs, source, visual_odom, gps, flow, ranges, rtc, copter: what it is made of; ``source`` is where its sensors'
            data come from.
        endpoint: its end of MAVLink.
        reboot_requested: a client has asked for a restart; who runs the vehicle restarts it.

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
        defaults = carry_over_from_any(config.defaults, self.params, ALL_RENAMES)
        unknown = self.params.apply_defaults(defaults.values, "defaults", read_only=config.read_only)
        self.unknown_defaults = (*defaults.lost, *unknown)
        config.param_store.restore(self.params, ALL_RENAMES)
        self.params.set_from_mavlink("STAT_BOOTCNT", i16(self.params.get_int("STAT_BOOTCNT") + 1))  # AP_Stats::init
        for name, value in config.overrides.items():
            self.params.set(name, value)
        ekf_type, has_ekf3 = self.params.get_int("AHRS_EKF_TYPE"), self.params.get_int("EK3_ENABLE") != 0
        self.params.set("AHRS_EKF_TYPE", value_after_boot(ekf_type, has_ekf3=has_ekf3))
        open_log = config.open_log or (config.log_store.open_next if config.log_store else None)
        self.logger = Logger(self.clock, open_log, self._on_log_open, config.firmware.log.own)
        self.log = VehicleLog(self.logger, self.clock, config.firmware)
        self.rtc = Rtc(self.clock, self.params, self.is_armed, config.boot_utc_us)
        self.logs = (
            NoLogs()
            if config.log_store is None
            else StoredLogs(config.log_store, self.clock, self.logger, self.rtc.utc_us)
        )
        self.texts = StatusTextQueue(self.clock.micros64)
        self.texts.on_text.append(self._log_text)
        self.log_transfer = LogTransfer(self.logs, self.texts.send_text_to)
        self.sources = EkfSources(self.params.group("EK3_").get_int)
        self.params.on_change.append(self.sources.forget)
        self._has_log_replay = FromParams(self.params, lambda: self.params.get_int("LOG_REPLAY") != 0)
        self._logs_disarmed = FromParams(self.params, lambda: self.params.get_int("LOG_DISARMED") != 0)
        self.replay_log = ReplayLog(
            self.logger,
            self._logs_replay,
            event_order=config.firmware.event_order,
            ranges_in_cm=config.firmware.params.range_unit.is_cm,
            fills_odometry=config.firmware.log.fills_odometry,
        )
        self.ahrs: AhrsBase = config.make_ahrs(self)
        source = self.ahrs.source
        self.source = source if isinstance(source, VehicleSource) else VehicleSource(ImuOptions())
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
        self.gps = GpsReceivers(self.clock, self.params, (self._make_gps(1), self._make_gps(2)), self._log_other_gps)
        airframe, shared = self.source.airframe, (self.source, self.params)
        self.flow = OpticalFlow(
            self.clock,
            self.params,
            self.ahrs,
            self.logger,
            reads_rates=config.firmware.reads_flow_rates,
            simulated=None if airframe is None else SimulatedFlow(self.clock, airframe, *shared),
        )
        seen = None if airframe is None else SimulatedRanges(airframe, *shared)
        self.ranges = RangeFinders(self.clock, self.params, self.logger, config.firmware.params.range_unit, seen)
        self.battery_monitor = self.params.get_int("BATT_MONITOR")
        self.origin = Origin(self)
        self.copter = Copter(self)
        self._plans_kept = config.item_store
        plans = self._plans_kept.load()
        self.copter.mission.load(plans.get(MissionType.MISSION, ()))
        self._fence = FenceItems(plans.get(MissionType.FENCE, ()))
        self._rally = KeptItems(plans.get(MissionType.RALLY, ()))
        self._last_location: Location | None = None
        self._internal_errors_told = 0
        self._kept_generation = 0
        self._kept_changes = self._item_changes()
        self.reboot_requested = False
        self.signing_store = config.signing_store
        self.files = VehicleFiles(
            self.params,
            log_directory=config.log_store.directory if config.log_store else None,
            system_texts={"uarts.txt": UartsText(self._uart_counts, self.clock.micros64)},
        )
        self.endpoint = MavEndpoint(self, config.message_intervals)
        self._vicon = self._make_vicon() if config.vicon else None
        self._vicon_channel: Channel | None = None
        self._attitude = Task("attitude", self._log_attitude, idle_until_us=self._attitude_idle_until_us)
        self.params.on_change.append(self._choose_attitude_period)
        self._choose_attitude_period()
        self._before_filter, self._after_filter = self._tasks()

    def _tasks(self) -> tuple[list[Task], list[Task]]:
        """Return what a pass of the main loop does before the filter runs, and what it does then, in their order."""
        copter, gps, flow, ranges, endpoint = self.copter, self.gps, self.flow, self.ranges, self.endpoint
        boot_us = AHRS_START_US
        before = [
            Task("boot", self._finish_boot, period_us=NEVER, next_us=boot_us),
            Task("log flown again", self._follow_flight, next_us=boot_us, idle_until_us=self.source.next_event_us),
        ]
        after = [
            # It asks for an alignment at the next sample: to ask once before that is enough.
            Task("camera", self._align_camera, idle_until_us=always_idle),
            Task("origin", self.origin.update, idle_until_us=self.origin.idle_until_us),
            Task("copter", copter.update, idle_until_us=copter.idle_until_us),
            Task("internal errors", self._tell_internal_errors, idle_until_us=self._errors_idle_until_us),
            Task("ground", copter.expect_ground, THROTTLE_PERIOD_US, copter.ground_idle_until_us, boot_us),
            Task("gps", self._update_gps, GPS_PERIOD_US, gps.idle_until_us, boot_us),
            Task("flow", flow.update, FLOW_PERIOD_US, flow.idle_until_us, boot_us),
            Task("ranges", ranges.update, RANGE_PERIOD_US, ranges.idle_until_us, FIRST_RANGE_US),
            Task("disarming", copter.disarm_when_idle, _TENTH_US),
            Task("switches", copter.switches.update, SWITCH_PERIOD_US, copter.switches.idle_until_us),
            Task("EKF check", copter.check_estimator, _TENTH_US),
            self._attitude,
            Task("once a second", self._each_second, _SECOND_US, next_us=FIRST_SECOND_US),
            *([] if self._vicon is None else [Task("vicon", self._see, idle_until_us=self._vicon.next_us)]),
            Task("endpoint", self._poll, idle_until_us=endpoint.idle_until_us),
            Task("log", self._update_log, idle_until_us=self._log_idle_until_us),
        ]
        return before, after

    # The main loop

    def advance(self, times_us: range) -> int:
        """Run passes of the main loop, up to one at which more is done than to run the filter.

        The clock is at the last one then. What comes of passes does not depend on how many are asked for at once.

        Args:
            times_us: of the next passes, since boot, evenly spaced; not empty.

        Returns:
            How many were run, at least one.
        """
        first_us = times_us[0]
        self.clock.set_us(first_us)
        for task in self._before_filter:
            task.run_if_due(first_us)
        self._tell_ahrs()
        alike = times_us[: max(1, count_before(times_us, next_due_us(self._before_filter)))]
        count = self.ahrs.advance(alike, self._next_after_filter_us)
        now_us = times_us[count - 1]
        if count > 1:
            for task in self._after_filter:
                task.leave_out(times_us[: count - 1])
            self.endpoint.leave_out(times_us[count - 2])
        for task in self._after_filter:
            task.run_if_due(now_us)
        return count

    def next_due_us(self) -> int:
        """Return when the main loop has something to do but to run the filter, as things are; 0 if at once."""
        if not self.ahrs.runs_ahead:
            return 0
        return min(self._next_after_filter_us(), next_due_us(self._before_filter))

    def _next_after_filter_us(self) -> int:
        return next_due_us(self._after_filter)

    def _tell_ahrs(self) -> None:
        """Bring up to date what the AHRS knows of the vehicle."""
        state, copter = self.ahrs.state, self.copter
        state.camera = self._camera_frames()[self.visual_odom.healthy()]
        state.armed = copter.arming.armed
        state.flying_since_us = copter.landing.flying_since_us()
        state.home = copter.home.place
        state.expected = copter.landing.expected
        state.gps, state.gps_lag_s = self.gps.samples(), self.gps.lag_s()
        state.ranges = self.ranges.state()

    def _make_camera_frames(self) -> tuple[VisualOdomFrame, VisualOdomFrame]:
        """Return the camera for the estimator while it is not healthy, and while it is."""
        camera = self.visual_odom
        fixed = camera.get_pos_offset(), camera.get_delay_ms()
        return VisualOdomFrame(*fixed, False, camera.enabled()), VisualOdomFrame(*fixed, True, camera.enabled())

    # Its tasks

    def _finish_boot(self) -> None:
        self.copter.enter_initial_mode()
        self._update_log()
        self.texts.send_text(_MAV_SEVERITY_INFO, "ArduPilot Ready")
        if announces_dcm(self.params.get_int("AHRS_EKF_TYPE")):
            self.texts.send_text(_MAV_SEVERITY_INFO, "AHRS: DCM active")
        for line in left_out({**self._config.defaults, **{param.name: float(param.value) for param in self.params}}):
            self.texts.send_text(_MAV_SEVERITY_WARNING, line)

    def _follow_flight(self) -> None:
        for event in self.source.events_until(self.clock.micros64()):
            self._let_happen(event)

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
            axes = self.sources.position_alignment(self.firmware.ekf)
            self.visual_odom.align_position_to_ahrs(*axes)

    def _update_gps(self) -> None:
        self.gps.update()
        if not self.source.knows_declination and self.gps.sample() is not None:
            place = self.ahrs.get_location()  # which is that of a fix, before there is an origin
            if place is not None:
                self.source.learn_declination(place)

    def _errors_idle_until_us(self) -> int:
        return NEVER if self.internal_errors.mask == self._internal_errors_told else 0

    def _tell_internal_errors(self) -> None:
        mask = self.internal_errors.mask
        if mask != self._internal_errors_told:
            self._internal_errors_told = mask
            self.log.error(ERR_SUBSYSTEM_INTERNAL_ERROR, ERR_INTERNAL_ERRORS_DETECTED)
            self.texts.send_text(_MAV_SEVERITY_CRITICAL, f"Internal Errors 0x{mask:x}")

    def _choose_attitude_period(self) -> None:
        fast = self.params.get_int("LOG_BITMASK") & MASK_LOG_ATTITUDE_FAST
        self._attitude.period_us = FAST_ATTITUDE_US if fast else _TENTH_US

    def _attitude_idle_until_us(self) -> int:
        return 0 if self.logger.takes(XKF1) else NEVER

    def _log_attitude(self) -> None:
        if self.logger.takes(XKF1):
            self.log.attitude(self.ahrs.get_quaternion(), self.ahrs.get_yaw_rad())
            self.ahrs.log_estimates()
            self._log_truth()

    def _log_truth(self) -> None:
        """Write where a simulated vehicle really is, as SIMSTATE tells it."""
        if self.copter.flight is not None:
            truth = self.copter.flight.truth()
            self.log.simulated(truth.place, truth.rpy_rad, truth.quat_wxyz)

    def _each_second(self) -> None:
        self.copter.arming.update()
        self.endpoint.conclude()
        self.log.statistics(self.endpoint.channels)
        self._keep_parameters()
        self._keep_items()

    def _make_gps(self, number: int) -> Gps:
        receiver = self._make_receiver(number)
        shared = self.clock, self.params, self.texts, self.logger, self._take_gps_time
        return Gps(*shared, receiver, number=number)

    def _make_receiver(self, number: int) -> SimulatedGps | None:
        airframe, is_second = self.source.airframe, number == 2
        prefix = SECOND_SIMULATED_GPS if is_second else self.firmware.params.simulated_gps_prefix
        params, boot_utc_us = self.params.group(prefix), self._config.boot_utc_us
        if airframe is None:
            return None
        return SimulatedGps(airframe, self.source, params, boot_utc_us, number - 1, falls_silent=is_second)

    def _log_other_gps(self) -> None:
        self.log.event(EV_GPS_PRIMARY_CHANGED)

    def _make_vicon(self) -> Vicon:
        if self.source.airframe is None:
            raise ValueError("the simulator's own camera sees a vehicle that flies alone")
        return Vicon(self.source.airframe, self.params.group("SIM_VICON_"))

    def _see(self) -> None:
        """Send the messages of the simulator's own camera, on the port after those of clients."""
        vicon, channel, now_us = self._vicon, self._vicon_channel, self.clock.micros64()
        if vicon is None:
            return
        if channel is None:
            channel = self._vicon_channel = self.endpoint.open_channel("vicon", now_us=now_us, port=self._config.links)
        arrived = vicon.update(now_us)
        if arrived:
            self.receive_bytes(channel, arrived)
        self.endpoint.bytes_to_send(channel)

    def _poll(self) -> None:
        self.endpoint.poll(self.clock.micros64())

    def _update_log(self) -> None:
        self.logger.update(self._log_wanted(), self.params)

    def _log_idle_until_us(self) -> int:
        if self.logs.suspends_logging:
            return 0
        wanted = self._log_wanted()
        until_us, disarmed_us = self.logger.idle_until_us(wanted), self.copter.disarmed_us
        end_us = 0 if disarmed_us is None else disarmed_us + LOG_AFTER_DISARM_US
        return min(until_us, end_us) if wanted and end_us > self.clock.micros64() else until_us

    def _log_wanted(self) -> bool:
        # The reference's logs begin where booting ends; and pymavlink's reader trips over records of the first 256 us.
        if not self.copter.has_booted or (self.logs.suspends_logging and not self.copter.arming.armed):
            return False
        return self.is_time_to_log()

    def _logs_replay(self) -> bool:
        return self._has_log_replay() and self.logger.takes(RFRH)

    def _log_text(self, _severity: int, text: str) -> None:
        self.log.text(text[:TEXT_FIELD_LEN])

    def _on_log_open(self) -> None:
        self.replay_log.new_log()
        modes = self.copter.modes
        self.log.start(self.banner(), modes.current.number, modes.reason)
        for kind, place in ((ORGN_EKF, self.ahrs.origin()), (ORGN_HOME, self.copter.home.place)):
            if place is not None:
                self.log.place(kind, place)
        for gps in self.gps.all:
            if gps.introduction is not None:
                self.log.text(gps.introduction)
        self.copter.mission.log_items()

    # Messages, and the end

    def receive_bytes(self, channel: Channel, data: bytes, read_us: int | None = None) -> None:
        """Handle what a link delivered; ``read_us`` since boot if it was read earlier than now."""
        self.endpoint.receive_bytes(channel, data, self.clock.micros64(), read_us)

    def keep_set_parameters(self) -> None:
        """Keep parameters and missions if one was set since the last time.

        What is sent after that confirms nothing unkept.
        """
        if self.params.stored_generation != self._kept_generation:
            self._keep_parameters(synced=False)
        if self._item_changes() != self._kept_changes:
            self._keep_items(synced=False)

    def _item_changes(self) -> int:
        return self.copter.mission.changes + self._fence.changes + self._rally.changes

    def _keep_items(self, *, synced: bool = True) -> None:
        self._kept_changes = self._item_changes()
        plans = {
            MissionType.MISSION: self.copter.mission.items,
            MissionType.FENCE: self._fence.items,
            MissionType.RALLY: self._rally.items,
        }
        self._plans_kept.save_if_changed(plans, synced=synced)

    def _keep_parameters(self, *, synced: bool = True) -> None:
        self._kept_generation = self.params.stored_generation
        self._config.param_store.save_if_changed(self.params.stored_values(), synced=synced)

    def close(self) -> None:
        """Close the log properly, and keep parameters and missions."""
        self.endpoint.ftp.close()
        self.logger.close()
        self._keep_parameters()
        self._keep_items()

    # What the endpoint asks

    def item_lists(self) -> Mapping[MissionType, ItemList]:
        """Return what clients may upload: mission, fence and rally points."""
        return {
            MissionType.MISSION: self.copter.mission,
            MissionType.FENCE: self._fence,
            MissionType.RALLY: self._rally,
        }

    def _uart_counts(self) -> list[UartCounts]:
        return [
            UartCounts(channel.bytes_sent, channel.bytes_received, channel.active, channel.name)
            for channel in self.endpoint.channels
        ]

    def banner(self) -> tuple[str, ...]:
        """Return the texts with the firmware, the system id and the frame (GCS_MAVLINK_Copter::send_banner)."""
        system_id = self.params.get_int(self.release.params.system_id)
        return self.firmware.banner, system_text(system_id), frame_text(self.params)

    def is_armed(self) -> bool:
        """Return whether it is armed."""
        return self.copter.arming.armed

    def is_time_to_log(self) -> bool:
        """Return whether it is armed, was so or was to be so a moment ago, or logs while disarmed (LOG_DISARMED)."""
        if self.copter.arming.armed or self._logs_disarmed():
            return True
        disarmed_us = self.copter.disarmed_us
        return disarmed_us is not None and self.clock.micros64() - disarmed_us < LOG_AFTER_DISARM_US

    def set_source_set(self, index: int) -> None:
        """Choose one of the three EKF source sets, 0..2."""
        if index != self.sources.active_set:
            self.sources.active_set = index
            self.log.event(EV_SOURCE_SET_1 + index)

    def set_origin(self, location: Location) -> bool:
        """Set the EKF origin, once; return whether it was set, as every core does in a text."""
        if not self.ahrs.set_origin(location):
            return False
        self.log.place(ORGN_EKF, location)
        self.origin.note(location)
        return True

    def last_location(self) -> Location | None:
        """Return the position of the vehicle, or the last one that was known at a call."""
        # FIRMWARE PARITY: each link remembers what it told itself.
        self._last_location = self.ahrs.last_location() or self._last_location
        return self._last_location

    def _take_gps_time(self, utc_us: int) -> None:
        known_before = self.rtc.utc_us() != 0
        self.rtc.set_utc_us(utc_us, RtcSource.GPS)
        if not known_before and self.rtc.utc_us():
            endpoint = self.endpoint
            endpoint.signing.update_timestamp(endpoint.channels, self.rtc.utc_us(), self.clock.millis())
