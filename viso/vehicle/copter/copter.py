# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of the vehicle that is ArduCopter: mode, home, arming, and whether it flies."""

from collections.abc import Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Final

from ap_core.cint import u8
from ap_core.clock import NEVER
from viso.vehicle.copter.arming import Arming, ArmMethod
from viso.vehicle.copter.arming_checks import ArmingChecks
from viso.vehicle.copter.ekf_check import EkfCheck
from viso.vehicle.copter.estimates import Estimates
from viso.vehicle.copter.flying.flight_control import FlightControl
from viso.vehicle.copter.home import Home
from viso.vehicle.copter.landing import Landing
from viso.vehicle.copter.mission import Mission
from viso.vehicle.copter.modes import AvailableMode, FlightModes, ModeNumber, ModeReason
from viso.vehicle.copter.motors import Motors
from viso.vehicle.copter.receiver import Receiver
from viso.vehicle.copter.switches import Switches
from viso.vehicle.sensors.airframe import Airframe

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

EV_EKF_ALT_RESET: Final = 60
EV_EKF_YAW_RESET: Final = 62
ERR_SUBSYSTEM_EKF_PRIMARY: Final = 24

STANDS_TEXT: Final = "Takeoff refused: nothing moves it; use --imu fly"
"""At most 50 bytes: one STATUSTEXT."""

_MAV_SEVERITY_WARNING: Final = 4


class EkfAction(IntEnum):
    """Values of FS_EKF_ACTION that differ from the others (ArduCopter/defines.h)."""

    REPORT = 0
    ALT_HOLD = 2
    ALWAYS_LAND = 3


class Copter:
    """Mode, home, arming and landing, each of which depends on the others.

    Attributes:
        receiver, switches: of the pilot's radio.
        mission: what it flies in AUTO.
        flight: who flies it; None if nobody does.
        safety_on: the safety switch keeps the motors off.
        disarmed_us: when it was disarmed, or arming it failed; None before the first time.
        has_booted: booting is over.
    """

    def __init__(self, vehicle: "Vehicle") -> None:
        self._vehicle = vehicle
        self.estimates = Estimates(vehicle.ahrs, self.is_armed, self._aids_relative_position, self.is_in_failsafe)
        self._ekf_check = EkfCheck(
            vehicle, has_position=self.estimates.has_position, is_armed=self.is_armed, act=self._act_on_ekf_failure
        )
        self.safety_on = False
        self.mission = Mission(vehicle, lambda: self.home.place)
        self.home = Home(vehicle, self.is_armed, self.mission)
        self.modes = FlightModes(vehicle, self.estimates, self.home, self.is_armed)
        self._motors = Motors(vehicle)
        self.receiver = Receiver(vehicle.params, vehicle.clock)
        self.switches = Switches(vehicle, self.receiver)
        self.landing = Landing(vehicle, self.modes, self._motors, self.receiver)
        checks = ArmingChecks(vehicle).lists()
        group = vehicle.params.group("ARMING_")
        self.arming = Arming(checks, group, vehicle.texts, vehicle.log, vehicle.clock, vehicle.firmware.params)
        self.disarmed_us: int | None = None
        self.has_booted = False
        self._was_stable = True
        self._mode_has_changed = False
        self._primary = vehicle.ahrs.primary
        self._yaw_reset_ms = vehicle.ahrs.yaw_reset_ms
        airframe = vehicle.source.airframe
        self.flight = None if airframe is None else self._make_flight(airframe)

    def _make_flight(self, airframe: Airframe) -> FlightControl:
        parts = self.modes, self.landing, self.estimates, self.home, self.receiver
        flight = FlightControl(airframe, self._vehicle, *parts, self._disarm)
        self.mission.crew = flight.auto
        return flight

    def _act_on_ekf_failure(self) -> str | None:
        """Leave a mode that needs a position, as FS_EKF_ACTION has it; return the new one's name if it was left.

        Source: Copter::failsafe_ekf_event.
        """
        # FIRMWARE PARITY: a vehicle that nobody flies stays in its mode.
        action, flight, mode = self._vehicle.params.get_int("FS_EKF_ACTION"), self.flight, self.modes.current
        if flight is None or (action == EkfAction.REPORT and self._vehicle.firmware.reports_ekf_failure):
            return None
        if mode.number == ModeNumber.LAND and flight.land.holds_position:
            flight.land.holds_position = False
            return None
        if not mode.requires_position and action != EkfAction.ALWAYS_LAND:
            return None
        if action != EkfAction.ALT_HOLD or not self.modes.set_mode(ModeNumber.ALT_HOLD, ModeReason.EKF_FAILSAFE):
            self.modes.set_mode(ModeNumber.LAND, ModeReason.EKF_FAILSAFE)
            flight.land_later()
        self._mode_has_changed = True
        return self.modes.name_of(self.modes.current)

    def _aids_relative_position(self) -> bool:
        return self._vehicle.visual_odom.enabled() or self._vehicle.flow.enabled()

    def is_armed(self) -> bool:
        """Return whether the vehicle is armed."""
        return self.arming.armed

    def has_home(self) -> bool:
        """Return whether home is set."""
        return self.home.place is not None

    # What happens by itself

    def enter_initial_mode(self) -> None:
        """Enter the mode of INITIAL_MODE, at the end of booting, or stay in STABILIZE (Copter::init_ardupilot)."""
        self.has_booted = True
        self.modes.set_mode(u8(self._vehicle.params.get_int("INITIAL_MODE")), ModeReason.INITIALISED)

    def update(self) -> None:
        """Note resets of the estimator, set home, lift off, land; once a pass of the main loop."""
        self._check_ekf_reset()
        self.home.update()
        self._motors.update()
        decides = self.flight is None or self.flight.update(armed=self.arming.armed)
        if self.arming.armed and (decides or self.landing.idle_until_us() <= self._vehicle.clock.micros64()):
            self.landing.update()
            if self.landing.has_landed_by_itself():
                self._disarm(ArmMethod.LANDED)

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do, us since boot; 0 if it may have at once."""
        if self._mode_has_changed or self._ekf_has_reset():
            return 0
        until_us = min(self.home.idle_until_us(), self._motors.idle_until_us())
        if self.flight is not None:
            until_us = min(until_us, self.flight.idle_until_us(armed=self.arming.armed))
        return min(until_us, self.landing.idle_until_us()) if self.arming.armed else until_us

    def _ekf_has_reset(self) -> bool:
        ahrs = self._vehicle.ahrs
        return ahrs.yaw_reset_ms != self._yaw_reset_ms or ahrs.primary != self._primary

    def _check_ekf_reset(self) -> None:
        """Log and send a reset of yaw, and a change of the primary core.

        Source: Copter::check_ekf_reset.
        """
        ahrs, vehicle = self._vehicle.ahrs, self._vehicle
        if ahrs.yaw_reset_ms != self._yaw_reset_ms:
            self._yaw_reset_ms = ahrs.yaw_reset_ms
            vehicle.log.event(EV_EKF_YAW_RESET)
        if ahrs.primary != self._primary:
            self._primary = ahrs.primary
            vehicle.log.error(ERR_SUBSYSTEM_EKF_PRIMARY, self._primary)
            vehicle.texts.send_text(_MAV_SEVERITY_WARNING, f"EKF primary changed:{self._primary}")

    def take_changed(self) -> list[str]:
        """Return, once, the messages for what has changed."""
        changed = ["HOME_POSITION", "GPS_GLOBAL_ORIGIN"] if self.home.take_changed() else []
        if self._mode_has_changed:
            self._mode_has_changed = False
            changed.append("HEARTBEAT")
        if self.mission.take_reached():
            changed.append("MISSION_ITEM_REACHED")
        return changed

    def check_estimator(self) -> None:
        """Check the variances of the estimator; ten times per second."""
        self._ekf_check.update()

    def ground_idle_until_us(self) -> int:
        """Return until when ``expect_ground`` has nothing to do, us since boot; 0 if it may have at once."""
        is_told = self._vehicle.source.expected() is not None
        may_change = not is_told and self.landing.may_expect(armed=self.arming.armed)
        # Whether the estimator has a position may change in any pass.
        may_be_stable = self._was_stable or self.landing.is_taking_off() or self.landing.lands()
        return 0 if may_change or may_be_stable else NEVER

    def _is_stable(self) -> bool:
        return (self.landing.is_taking_off() or self.landing.lands()) and self.estimates.position_ok()

    def expect_ground(self) -> None:
        """See whether take-off or touchdown is near, and let heights count from the ground then; 50 times per second.

        Source: Copter::update_ground_effect_detector, Copter::update_ekf_terrain_height_stable.
        """
        self.landing.expect(armed=self.is_armed())
        self._was_stable = self._is_stable()
        self._vehicle.ahrs.set_terrain_stable(is_stable=self._was_stable)

    def disarm_when_idle(self) -> None:
        """Disarm after DISARM_DELAY on the ground; ten times per second."""
        if self.landing.wants_disarming(self.is_armed()):
            self._disarm(ArmMethod.DISARMDELAY)

    # What clients ask for

    def set_mode(self, number: int, reason: ModeReason = ModeReason.GCS_COMMAND) -> bool:
        """Enter a mode on behalf of a client; return whether the vehicle is in it now. A refusal is sent as a text."""
        before = self.modes.current
        entered = self.modes.set_mode(number, reason)
        self._mode_has_changed |= self.modes.current is not before
        return entered

    def custom_mode(self) -> int:
        """Return the flight mode's number."""
        return self.modes.current.number

    def available_modes(self) -> Sequence[AvailableMode]:
        """Return the flight modes that clients may list."""
        return self.modes.available()

    def is_holding_height(self) -> bool:
        """Return whether the mode runs the vertical position controller."""
        return self.modes.current.holds_height

    def is_holding_position(self) -> bool:
        """Return whether the mode runs the horizontal position controller."""
        return self.modes.current.holds_position

    def is_landed(self) -> bool:
        """Return whether the vehicle stands on the ground."""
        return self.landing.landed

    def is_taking_off(self) -> bool:
        """Return whether it climbs to where it was asked to take off to (Mode::is_taking_off)."""
        return self.landing.is_taking_off()

    def is_landing(self) -> bool:
        """Return whether the mode brings it down; RTL does so at its end only (Mode::is_landing)."""
        return self.modes.current.number == ModeNumber.LAND or (self.flight is not None and self.flight.is_landing())

    def is_in_failsafe(self) -> bool:
        """Return whether a failsafe is active: the estimator's is the only one (Copter::any_failsafe_triggered)."""
        return self._ekf_check.in_failsafe

    def take_off(self, altitude_cm: float, must_navigate: bool) -> bool:
        """Start a take-off to a height above home; return whether it was accepted (Mode::do_user_takeoff)."""
        if not self.is_armed() or altitude_cm <= self._height_above_home_cm():
            return False
        if self._vehicle.source.stands_for_ever:
            self._vehicle.texts.send_text(_MAV_SEVERITY_WARNING, STANDS_TEXT)
            return False
        return self.landing.take_off(must_navigate, 0.01 * (altitude_cm - self._height_above_home_cm()))

    def _height_above_home_cm(self) -> float:
        # current_loc: above home or, while that is unset, above the origin.
        place, home = self._vehicle.ahrs.get_location(), self.home.place
        if place is not None and home is not None:
            return place.alt_cm - home.alt_cm
        position = self._vehicle.ahrs.get_relative_position_NED_origin_float()
        return 0.0 if position is None else -100 * float(position.z)

    def arm(self, do_checks: bool, method: ArmMethod = ArmMethod.MAVLINK) -> bool:
        """Try to arm; failures are sent as texts (AP_Arming_Copter::arm)."""
        vehicle = self._vehicle
        if not do_checks:
            # The log that arming opens is to hold the fact; the checks would have opened it.
            vehicle.logger.update(True, vehicle.params)
        if not self.arming.arm(do_checks, method):
            self.disarmed_us = vehicle.clock.micros64()
            return False
        self._note_armed()
        return True

    def follow(self, *, armed: bool) -> None:
        """Be armed or not, as a vehicle was whose flight is flown again."""
        if armed and not self.is_armed():
            self._vehicle.logger.update(True, self._vehicle.params)
            self.arming.become_armed(forced=True)
            self._note_armed()
        elif not armed:
            self._disarm(ArmMethod.MAVLINK, forced=True)

    def _note_armed(self) -> None:
        vehicle = self._vehicle
        vehicle.logger.update(True, vehicle.params)
        if not self.has_home():
            vehicle.ahrs.reset_height_datum()
            vehicle.log.event(EV_EKF_ALT_RESET)
        elif not self.home.locked:
            self.home.set_here(lock=False)
        self._motors.arm()
        self.landing.note_armed()
        self.modes.log_mode()
        vehicle.log_transfer.pause()

    def disarm(self, force: bool, method: ArmMethod = ArmMethod.MAVLINK) -> bool:
        """Disarm, in flight only when forced; return whether that changed anything (AP_Arming_Copter::disarm)."""
        if not force and not self.landing.landed:
            return False
        return self._disarm(method, forced=force)

    def _disarm(self, method: ArmMethod, *, forced: bool = False) -> bool:
        if not self.arming.disarm(method, forced=forced):
            return False
        self.disarmed_us = self._vehicle.clock.micros64()
        self.landing.note_disarmed()
        self._motors.disarm()
        self.mission.reset()
        return True
