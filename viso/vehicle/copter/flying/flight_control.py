# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flight controller: 50 times per second, from the estimate to lean angles, a thrust and a turn.

It knows where the vehicle is by the vehicle's own estimate alone. An estimate that is wrong flies it away.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from ap_core.clock import NEVER
from ap_core.location import Location
from ap_core.param import FromParams
from ap_core.vector3 import Vector3f
from ekf_stub.core.inertial import GRAVITY_MSS
from mav_handlers.handlers.commands.flight import GuidedTarget
from viso.vehicle.copter.arming import ArmMethod
from viso.vehicle.copter.estimates import Estimates
from viso.vehicle.copter.flying.auto import Auto
from viso.vehicle.copter.flying.descents import Land, ReturnHome
from viso.vehicle.copter.flying.guided import Guided
from viso.vehicle.copter.flying.piloted import Brake, HoldHeight, Loiter, Manual
from viso.vehicle.copter.flying.position_control import Estimate
from viso.vehicle.copter.flying.steering import PERIOD_S, Lean, Limits, Steering
from viso.vehicle.copter.home import Home
from viso.vehicle.copter.landing import Landing
from viso.vehicle.copter.modes import FlightModes, ModeNumber
from viso.vehicle.copter.receiver import Receiver
from viso.vehicle.sensors.airframe import MOTORS_OFF, Airframe, Demand
from viso.vehicle.sensors.vectors import Three, yawed

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

PERIOD_US: Final = round(1e6 * PERIOD_S)
SLOW_M_S: Final = 1.0
LEAST_THRUST_M_S2: Final = 0.1 * GRAVITY_MSS
LITTLE_LIFT_M_S2: Final = 0.25 * GRAVITY_MSS
"""Less than this of a manual throttle is meant to stay on the ground."""


@dataclass(frozen=True, slots=True)
class FlightTruth:
    """Where a simulated vehicle really is, and how it moves.

    Attributes:
        place: on earth.
        vel_ned_m_s: its velocity.
        quat_wxyz: its attitude, body (FRD) to earth (NED).
        rpy_rad: the same as roll, pitch and yaw.
        acc_frd_m_s2, rates_frd_rad_s: what ideal inertial sensors say.
    """

    place: Location
    vel_ned_m_s: tuple[float, float, float]
    quat_wxyz: tuple[float, float, float, float]
    rpy_rad: tuple[float, float, float]
    acc_frd_m_s2: tuple[float, float, float]
    rates_frd_rad_s: tuple[float, float, float]


class _Mode(Protocol):
    """A flight mode."""

    def enter(self) -> None:
        """Begin."""

    def run(self) -> Lean | None:
        """Move the way on for a period; return lean angles instead where nothing holds a horizontal position."""


class FlightControl:
    """Flies the airframe."""

    def __init__(
        self,
        airframe: Airframe,
        vehicle: "Vehicle",
        modes: FlightModes,
        landing: Landing,
        estimates: Estimates,
        home: Home,
        receiver: Receiver,
        disarm: Callable[[ArmMethod], object],
    ) -> None:
        self._airframe = airframe
        self._source = vehicle.source
        self._ahrs = vehicle.ahrs
        self._clock = vehicle.clock
        self._flight_modes = modes
        self._landing = landing
        self._home = home
        self._limits = FromParams(vehicle.params, lambda: Limits.of(vehicle.params, vehicle.firmware.params.flying))
        self._steering = Steering(self._limits())
        self._receiver = receiver
        self.guided = Guided(self._steering)
        self.land = Land(self._steering, estimates.position_ok, self._height_m)
        self._returns = ReturnHome(self._steering, self.land, self._home_ned)
        self.auto = Auto(vehicle, self._steering, landing, self.land, self._returns, self.place_ned, disarm)
        loiter, height, manual = Loiter(self._steering), HoldHeight(self._steering), Manual(self._steering)
        self._modes: Mapping[int, _Mode] = {
            ModeNumber.GUIDED: self.guided,
            ModeNumber.AUTO: self.auto,
            ModeNumber.LAND: self.land,
            ModeNumber.RTL: self._returns,
            ModeNumber.SMART_RTL: self._returns,
            ModeNumber.BRAKE: Brake(self._steering),
            **dict.fromkeys((ModeNumber.STABILIZE, ModeNumber.ACRO), manual),
            **dict.fromkeys((ModeNumber.ALT_HOLD, ModeNumber.GUIDED_NOGPS), height),
        }
        self._others = loiter
        self._mode: _Mode | None = None
        self._next_us = 0
        self._is_flying = self._was_idle = False
        self._takeoff_down_m: float | None = None

    # What others ask

    def idle_until_us(self, *, armed: bool) -> int:
        """Return before when ``update`` has nothing to do: until it decides next, or for ever with motors off."""
        return self._next_us if armed or self._is_flying or self._is_auto() else NEVER

    def _is_auto(self) -> bool:
        return self._flight_modes.current.number == ModeNumber.AUTO

    def is_landing(self) -> bool:
        """Return whether RTL or a mission has come to its end, the landing."""
        if self._is_auto():
            return self.auto.is_landing()
        return self._mode is self._returns and self._returns.is_landing()

    def way_to_target(self) -> tuple[float, float]:
        """Return how far it is to where the vehicle is going, m north and east; 0 if it is going nowhere."""
        here, target = self._estimate().pos, self._steering.destination
        return (0.0, 0.0) if here is None or target is None else (target[0] - here[0], target[1] - here[1])

    def guide(self, target: GuidedTarget | None) -> None:
        """Obey a target in GUIDED, or stay where the vehicle is."""
        self._landing.end_take_off()
        self._takeoff_down_m = None
        self._steering.now_us, self._steering.limits = self._clock.micros64(), self._limits()
        if target is None:
            self.guided.enter()
        else:
            self.guided.guide(target)

    def land_later(self) -> None:
        """Stay for a while before the descent of a landing that a failsafe asks for (set_mode_land_with_pause)."""
        self._enter(self.land)
        self.land.pause()

    def truth(self) -> FlightTruth:
        """Return where the vehicle really is, as of the last pass."""
        airframe = self._airframe
        truth, state = airframe.truth(), airframe.state
        acc_frd, rates_frd = airframe.felt()
        place = self._source.home.offset(Vector3f(*truth.pos_ned))
        return FlightTruth(place, truth.vel_ned, truth.quat_wxyz, state.rpy, acc_frd, rates_frd)

    def turn_to(self, yaw_rad: float, slew_rad_s: float, direction: int, *, is_relative: bool) -> None:
        """Look somewhere (CONDITION_YAW); ``Heading.turn_to`` has the arguments."""
        self._steering.heading.turn_to(yaw_rad, slew_rad_s, direction, is_relative=is_relative)

    def change_speed(self, kind: int, speed_m_s: float) -> None:
        """Fly to targets with another speed until the mode changes; ``kind`` is DO_CHANGE_SPEED's param1."""
        self.auto.change_speed(kind, speed_m_s)

    def place_ned(self, place: Location) -> Three | None:
        """Return where a place is, m from the origin; None without one."""
        origin = self._ahrs.origin()
        if origin is None:
            return None
        way = origin.distance_ned(place)
        return float(way.x), float(way.y), float(way.z)

    def _home_ned(self) -> Three | None:
        home = self._home.place
        return None if home is None else self.place_ned(home)

    def _height_m(self) -> float:
        home = self._home_ned()
        down_m = self._steering.way.pos[2]
        return -down_m if home is None else home[2] - down_m

    # What it does

    def update(self, *, armed: bool) -> bool:
        """Decide, if it is time to; return whether it was. Once a pass of the main loop."""
        now_us = self._clock.micros64()
        late_us = now_us - self._next_us
        if late_us < 0:
            return False
        self._next_us = (now_us // PERIOD_US + 1) * PERIOD_US
        if self._was_idle and late_us >= PERIOD_US and now_us % PERIOD_US:
            self._was_idle = False
            return False  # passes were left out; it decides when it would have if they had not been
        steering = self._steering
        steering.now_us, steering.limits, steering.sticks = now_us, self._limits(), self._receiver.sticks()
        steering.estimate = self._estimate()
        if armed and self._landing.landed and self._is_piloted():
            self._landing.heed_throttle(is_up=steering.sticks.throttle > 0)
        if self._is_auto():
            self.auto.step(armed=armed)
        if not armed or self._landing.landed:
            self._idle()
        else:
            self._fly()
        return True

    def _is_piloted(self) -> bool:
        return isinstance(
            self._modes.get(self._flight_modes.current.number, self._others), Loiter | HoldHeight | Manual
        )

    def _estimate(self) -> Estimate:
        ahrs = self._ahrs
        pos, vel = ahrs.get_relative_position_NED_origin_float(), ahrs.get_velocity_NED()
        return Estimate(
            None if pos is None else (float(pos.x), float(pos.y), float(pos.z)),
            (0.0, 0.0, 0.0) if vel is None else (float(vel.x), float(vel.y), float(vel.z)),
            float(ahrs.get_yaw_rad()),
            ahrs.control_limits(),
        )

    def _idle(self) -> None:
        self._was_idle = True
        self._airframe.demand(MOTORS_OFF)
        self._is_flying = not self._airframe.state.is_at_rest()
        self._landing.grounded_since_us = self._mode = None
        self._takeoff_down_m = None

    def _fly(self) -> None:
        steering, landing = self._steering, self._landing
        if not self._is_flying or self._mode is None:
            steering.restart()
        self._is_flying = True
        self._was_idle = False
        steering.way.heed_reset(steering.estimate, PERIOD_S)
        mode = self._modes.get(self._flight_modes.current.number, self._others)
        if mode is not self._mode:
            self._enter(mode)
        lean = None
        if landing.is_taking_off():
            self._climb_out()
        else:
            lean = self._run(mode)
        self._demand(lean)
        self._watch_ground(None if lean is None else lean.lift_m_s2)

    def _enter(self, mode: _Mode) -> None:
        self._mode = mode
        if mode is not self.auto:  # whose mission may have asked for a speed on the ground already
            self._steering.forget_speeds()
            self._steering.destination = None
        mode.enter()

    def _climb_out(self) -> None:
        """Climb straight up to where the take-off ends."""
        self._takeoff_down_m = self._landing.takeoff_down_m()
        pace = self._steering.travel_pace()
        self._steering.way.at_velocity(0.0, 0.0, pace, PERIOD_S)
        self._steering.way.to_height(self._takeoff_down_m, pace, PERIOD_S)

    def _run(self, mode: _Mode) -> Lean | None:
        if self._takeoff_down_m is not None and mode is self.guided:
            self.guided.stay_at_height(self._takeoff_down_m)
        self._takeoff_down_m = None
        return mode.run()

    def _demand(self, lean: Lean | None) -> None:
        steering = self._steering
        most = steering.limits.angle_max
        north, east, down = steering.way.acceleration(steering.estimate, PERIOD_S)
        if lean is None and steering.estimate.pos is None:
            lean = Lean(0.0, 0.0)
        if lean is None:
            ahead, right, _ = yawed((north, east, down), -steering.estimate.yaw_rad)
            pitch = math.atan(-ahead / GRAVITY_MSS)
            roll = math.atan(right * math.cos(pitch) / GRAVITY_MSS)
            largest = max(abs(pitch), abs(roll))
            scale = 1.0 if largest <= most else most / largest
            lean = Lean(scale * roll, scale * pitch)
        turn = steering.heading.rate(
            steering.estimate.yaw_rad, steering.way.vel[:2], steering.limits.atc_slew_yaw, PERIOD_S
        )
        lift = GRAVITY_MSS - down if lean.lift_m_s2 is None else lean.lift_m_s2
        thrust = max(lift, LEAST_THRUST_M_S2) / (math.cos(lean.roll) * math.cos(lean.pitch))
        self._airframe.demand(Demand(lean.roll, lean.pitch, thrust, turn))

    def _watch_ground(self, lift_m_s2: float | None) -> None:
        """Note since when it is on the ground and to stay there; ``lift_m_s2`` is that of a manual throttle."""
        steering = self._steering
        goes_down = steering.way.vel[2] > 0.0 if lift_m_s2 is None else lift_m_s2 < LITTLE_LIFT_M_S2
        is_to_land = goes_down and abs(steering.estimate.vel[2]) < SLOW_M_S
        if not (is_to_land and self._airframe.state.is_on_ground()):
            self._landing.grounded_since_us = None
        elif self._landing.grounded_since_us is None:
            self._landing.grounded_since_us = steering.now_us
