# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the vehicle counts as standing on the ground, and when it disarms there by itself.

Source: ArduCopter/motors.cpp (auto_disarm_check), ArduCopter/takeoff.cpp, ArduCopter/land_detector.cpp,
ArduCopter/baro_ground_effect.cpp.
"""

import math
from typing import TYPE_CHECKING, Final

from ap_core.clock import NEVER
from viso.vehicle.copter.modes import MODES, FlightModes, Mode, ModeNumber, UserTakeoff
from viso.vehicle.copter.motors import Motors
from viso.vehicle.copter.receiver import Receiver

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

EV_AUTO_ARMED: Final = 15
EV_LAND_COMPLETE_MAYBE: Final = 17
EV_LAND_COMPLETE: Final = 18
EV_NOT_LANDED: Final = 28
MAYBE_US: Final = 200_000
TOUCHDOWN_US: Final = 1_000_000
"""For how long it has to stand on the ground and still descend to have perhaps landed, and to have landed.

Source: ArduCopter/config.h, LAND_DETECTOR_MAYBE_TRIGGER_SEC, LAND_DETECTOR_TRIGGER_SEC.
"""

LANDED_BELOW_M: Final = 0.3
HIGH_ENOUGH_M: Final = 0.1
TAKEOFF_US: Final = 5_000_000
TAKEOFF_CLIMB_M: Final = 0.5
SLOW_M_S: Final = 1.25
SLOW_DESCENT_M_S: Final = 0.6


class Landing:
    """Whether the vehicle stands on the ground.

    FIRMWARE PARITY: unless somebody flies it there are no motors. After an accepted take-off the vehicle counts as
    flying, wherever external navigation says that it is, and as taking off until it is nearly as high as asked for; in
    a mode that lands it counts as landed when it is not above the place of arming. A take-off is no longer expected
    once it is above that, whoever lifts it. A touchdown is expected of the mode and of how fast the vehicle
    is, and GND_EFFECT_COMP counts as 1.

    Attributes:
        landed: whether it stands on the ground.
        expected: whether a take-off is expected, and whether a touchdown is: air under rotors misleads barometers.
        is_from_log: somebody else tells when it lifts off, lands and is disarmed.
        is_flown: somebody flies it.
        is_landing_in_auto: the mission has come to a landing.
        grounded_since_us: since when it has stood on the ground in a descent, of one that is flown; else None.
    """

    def __init__(self, vehicle: "Vehicle", modes: FlightModes, motors: Motors, receiver: Receiver) -> None:
        self._ahrs = vehicle.ahrs
        self._log = vehicle.log
        self._params = vehicle.params
        self._clock = vehicle.clock
        self._modes = modes
        self._motors = motors
        self._receiver = receiver
        self._armed_down_m = 0.0
        self._idle_since_us = 0
        self._lift_off_us: int | None = None
        self._auto_armed = self._is_throttle_up = False
        self._perhaps_landed = True
        self._takeoff: tuple[Mode, float] | None = None  # the mode, and where it ends, m below the origin
        self._flying_since_us = 0
        self._grounded_us = 0
        self.landed = True
        self.expected = False, False
        self.is_from_log = vehicle.source.flight is not None and vehicle.source.flight.tells_flying
        self.is_flown = vehicle.source.airframe is not None
        self.is_landing_in_auto = False
        self.grounded_since_us: int | None = None

    def flying_since_us(self) -> int | None:
        """Return since when the vehicle has been flying, None on the ground (AP_Vehicle::get_time_flying_ms)."""
        return None if self.landed else self._flying_since_us

    def _down_m(self) -> float:
        position = self._ahrs.get_relative_position_NED_origin_float()
        return self._armed_down_m if position is None else float(position.z)

    def note_armed(self) -> None:
        """Remember the height of arming."""
        self._armed_down_m = self._down_m()

    def note_disarmed(self) -> None:
        """Count as landed, as a disarmed vehicle does."""
        self._lift_off_us = self._takeoff = None
        self._auto_armed = self._is_throttle_up = False
        self._set_landed(True)

    def is_taking_off(self) -> bool:
        """Return whether the vehicle climbs to where it was asked to take off to (Mode::is_taking_off)."""
        return self._takeoff is not None and self._takeoff[0] is self._modes.current

    def take_off(self, must_navigate: bool, climb_m: float) -> bool:
        """Start an armed vehicle's take-off by some metres; return whether the mode can (Mode::do_user_takeoff)."""
        takeoff = self._modes.current.takeoff
        able = takeoff is UserTakeoff.ALWAYS or (takeoff is UserTakeoff.BY_PILOT and not must_navigate)
        if not self.landed or not able:
            return False
        if not self._spools_up():
            self._spool_up()
        self._takeoff = self._modes.current, self._down_m() - climb_m
        return True

    def take_off_in_auto(self, down_m: float) -> None:
        """Take off to a height, m below the origin, as soon as lifting off is allowed."""
        self._takeoff = MODES[ModeNumber.AUTO], down_m

    def lift_off_if_allowed(self) -> None:
        """Lift an armed vehicle off, if it is to take off in AUTO and the throttle has been up (auto_armed)."""
        if self._auto_armed and self.landed and self.is_taking_off() and self._lift_off_us is None:
            self._spool_up()

    def allow_lift_off(self) -> None:
        """Take note that an armed vehicle may lift off by itself (Copter::set_auto_armed)."""
        if not self._auto_armed:
            self._auto_armed = True
            self._log.event(EV_AUTO_ARMED)

    def _spool_up(self) -> None:
        self._lift_off_us = self._motors.lift_us()
        self.allow_lift_off()

    def lands(self) -> bool:
        """Return whether the mode, or in AUTO the mission, brings the vehicle down."""
        mode = self._modes.current
        return mode.lands or (mode.number == ModeNumber.AUTO and self.is_landing_in_auto)

    def _spools_up(self) -> bool:
        return self._lift_off_us is not None and (self._is_throttle_up or self.is_taking_off())

    def heed_throttle(self, *, is_up: bool) -> None:
        """Take note of the throttle stick of an armed vehicle on the ground, in a mode that a pilot flies.

        The vehicle lifts off once its motors have spooled up while the stick is above its middle.
        """
        if is_up and not self._spools_up():
            self._spool_up()
        self._is_throttle_up = is_up

    def takeoff_down_m(self) -> float:
        """Return where a take-off that is under way ends, m below the origin."""
        return self._down_m() if self._takeoff is None else self._takeoff[1]

    def end_take_off(self) -> None:
        """End a take-off, as another target is set."""
        self._takeoff = None

    def update(self) -> None:
        """Lift off, or land, of an armed vehicle; every main loop."""
        if self.is_from_log:
            return
        if self._lift_off_us is not None and self._clock.micros64() >= self._lift_off_us:
            if self._is_throttle_up or self.is_taking_off():
                self._set_landed(False)
            self._lift_off_us = None
        if self._takeoff is not None and self._down_m() <= self._takeoff[1] + HIGH_ENOUGH_M:
            self._takeoff = None
        if not self.landed:
            self._see_ground()

    def _see_ground(self) -> None:
        if not self.is_flown:
            if self._modes.current.lands and self._down_m() >= self._armed_down_m - LANDED_BELOW_M:
                self._set_landed(True)
            return
        since_us = self.grounded_since_us
        grounded_us = 0 if since_us is None else self._clock.micros64() - since_us
        if grounded_us >= TOUCHDOWN_US:
            self._set_landed(True)
        else:
            self._set_perhaps_landed(grounded_us >= MAYBE_US)

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do for an armed vehicle, us since boot; 0 if it may at once."""
        if self.is_from_log:
            return NEVER
        if not self.is_flown and (self._takeoff is not None or (self._modes.current.lands and not self.landed)):
            return 0
        if self.landed and self._modes.current.lands:
            return self._motors.idle_us()
        return NEVER if self._lift_off_us is None else self._lift_off_us

    def expect(self, *, armed: bool) -> None:
        """See whether the vehicle is about to lift off or to touch down; 50 times per second.

        Source: Copter::update_ground_effect_detector.
        """
        if not armed:
            self.expected = False, False
            return
        takes_off, mode, now_us = self.expected[0], self._modes.current, self._clock.micros64()
        if self.landed:
            takes_off, self._grounded_us = True, now_us
        climbed = now_us - self._grounded_us > TAKEOFF_US or self._armed_down_m - self._down_m() > TAKEOFF_CLIMB_M
        velocity = self._ahrs.get_velocity_NED() if self.lands() else None
        sinks_slowly = (
            velocity is not None
            and math.hypot(float(velocity.x), float(velocity.y)) < SLOW_M_S
            and abs(float(velocity.z)) <= SLOW_DESCENT_M_S
        )
        self.expected = takes_off and not climbed and mode.number != ModeNumber.THROW, sinks_slowly

    def may_expect(self, *, armed: bool) -> bool:
        """Return whether ``expect`` may change anything now."""
        return any(self.expected) or (armed and (self.landed or self.lands()))

    def _set_landed(self, landed: bool) -> None:
        if landed != self.landed:
            self.landed = landed
            self._flying_since_us = self._clock.micros64()
            self._log.event(EV_LAND_COMPLETE if landed else EV_NOT_LANDED)
            self._set_perhaps_landed(landed)
            if landed:
                self._motors.land()

    def _set_perhaps_landed(self, perhaps: bool) -> None:
        if perhaps and not self._perhaps_landed:
            self._log.event(EV_LAND_COMPLETE_MAYBE)
        self._perhaps_landed = perhaps

    def follow(self, *, landed: bool) -> None:
        """Lift off or land, as a vehicle did whose flight is flown again."""
        self._set_landed(landed)

    def wants_disarming(self, armed: bool) -> bool:
        """Tell, ten times per second, whether the vehicle has idled on the ground for DISARM_DELAY.

        Source: Copter::auto_disarm_check.
        """
        now_us = self._clock.micros64()
        delay_us = self._params.get_int("DISARM_DELAY") * 1_000_000
        idles = armed and not self.is_from_log and delay_us > 0 and self.landed and not self._spools_up()
        idles = idles and self._receiver.is_throttle_down()
        if not idles or self._modes.current.number == ModeNumber.THROW:
            self._idle_since_us = now_us
        return idles and now_us - self._idle_since_us >= delay_us

    def has_landed_by_itself(self) -> bool:
        """Return whether a mode that lands is done (ModeLand::run, ModeRTL::land_run)."""
        return self.has_idled() and not self.is_from_log and self._modes.current.lands

    def has_idled(self) -> bool:
        """Return whether it stands on the ground and its motors have spooled down."""
        return self.landed and self._clock.micros64() >= self._motors.idle_us()
