# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""AUTO: what the commands of a mission do (ArduCopter/mode_auto.cpp).

FIRMWARE PARITY: legs are straight, a spline's too, and the vehicle slows down at each waypoint, where the firmware
flies a curve. It does not look at a place's height.
"""

import math
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Final

from ap_core.location import Location
from mav_handlers.handlers.commands.aux_functions import AuxSource, SwitchPosition, run_aux_function
from mav_handlers.transfers.mission_items import FRAME_RELATIVE, Cmd, MissionItem
from viso.vehicle.copter.arming import ArmMethod
from viso.vehicle.copter.flying.descents import Land, ReturnHome
from viso.vehicle.copter.flying.steering import LEVEL, PERIOD_S, Lean, Steering
from viso.vehicle.copter.landing import Landing
from viso.vehicle.copter.mission import Command
from viso.vehicle.copter.modes import ModeNumber, ModeReason
from viso.vehicle.sensors.vectors import ZERO, Three

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

OPTION_LIFT_OFF_WITHOUT_THROTTLE: Final = 1 << 1
ARRIVED_M: Final = 0.1
"""How near the way comes to a place where the vehicle stops."""
LEAST_M_S: Final = 0.5
LEAST_TAKEOFF_M: Final = 1.0
CIRCLE_RADIUS_M: Final = 10.0
CIRCLE_RATE_RAD_S: Final = math.radians(20.0)
"""Defaults of CIRCLE_RADIUS and CIRCLE_RATE."""
NEAR_CIRCLE_M: Final = 3.0
CIRCLE_GAIN_PER_S: Final = 1.0
WATCHED_COMMANDS: Final = 3
_TO_ALTITUDE_M: Final = 0.05
_AIRSPEED, _GROUND_SPEED, _CLIMB, _DESCENT = range(4)
_TURN: Final = 2.0 * math.pi
_PLACES: Final = frozenset(
    {Cmd.NAV_WAYPOINT, Cmd.NAV_SPLINE_WAYPOINT, Cmd.NAV_LOITER_UNLIM, Cmd.NAV_LOITER_TIME, Cmd.NAV_LOITER_TO_ALT}
)
_TIMED: Final = frozenset({Cmd.NAV_WAYPOINT, Cmd.NAV_SPLINE_WAYPOINT, Cmd.NAV_LOITER_TIME})
_WAYPOINTS: Final = frozenset({Cmd.NAV_WAYPOINT, Cmd.NAV_SPLINE_WAYPOINT})
_PASSED_ON_TO: Final = _WAYPOINTS | {Cmd.NAV_LOITER_UNLIM, Cmd.NAV_LOITER_TIME}
_DONE_AT_ONCE: Final = frozenset(
    {
        *(Cmd.DO_CHANGE_SPEED, Cmd.DO_SET_HOME, Cmd.DO_SET_ROI, Cmd.DO_SET_ROI_LOCATION, Cmd.DO_SET_ROI_NONE),
        *(Cmd.DO_FENCE_ENABLE, Cmd.DO_GUIDED_LIMITS, Cmd.DO_RETURN_PATH_START, Cmd.DO_LAND_START),
    }
)
_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6


class _Doing(Enum):
    STAY = "stay"
    TAKE_OFF = "take off"
    TRAVEL = "travel"
    TO_CIRCLE = "to the circle"
    CIRCLE = "circle"
    LAND = "land"
    RETURN = "return"


class Auto:
    """Flies a mission.

    Args:
        vehicle: whose mission it is.
        steering: what it steers with.
        landing, land, returns: how it takes off, lands and returns.
        place_ned: returns where a place is, m from the origin.
        disarm: disarms, with what did it.
    """

    def __init__(
        self,
        vehicle: "Vehicle",
        steering: Steering,
        landing: Landing,
        land: Land,
        returns: ReturnHome,
        place_ned: Callable[[Location], Three | None],
        disarm: Callable[[ArmMethod], object],
    ) -> None:
        self._vehicle = vehicle
        self._steering = steering
        self._landing = landing
        self._land = land
        self._returns = returns
        self._place_ned = place_ned
        self._disarm = disarm
        self._doing = _Doing.STAY
        self._target: Three = ZERO
        self._passes_on = False
        self._arrived_us: int | None = None
        self._wait_s = 0.0
        self._delay_until_us = self._condition_until_us = 0
        self._near_m = 0.0
        self._looks_at: tuple[float, float] | None = None
        self._circle_rate = self._circle_angle = self._circle_turned = 0.0
        self._circle_radius_m = CIRCLE_RADIUS_M
        self._centre: Three = ZERO
        self._circles_told = -1
        self._watched: tuple[int, int, tuple[MissionItem, ...]] = (0, 0, ())

    def is_landing(self) -> bool:
        """Return whether it descends to land (ModeAuto::is_landing)."""
        return self._doing is _Doing.LAND or (self._doing is _Doing.RETURN and self._returns.is_landing())

    # The mission's progress

    def step(self, *, armed: bool) -> None:
        """Begin the mission, or go on with it; 50 times per second, in the air and on the ground (ModeAuto::run)."""
        vehicle, mission = self._vehicle, self._vehicle.copter.mission
        if mission.waits:
            self._begin()
            if vehicle.ahrs.origin() is not None:
                mission.waits = False
                mission.start_or_resume()
                self._watched = self._changes_seen()
        else:
            self._heed_changes()
            mission.update()
        self._landing.is_landing_in_auto = self.is_landing()
        if armed and self._doing is _Doing.TAKE_OFF:
            options = vehicle.params.get_int("AUTO_OPTIONS")
            if options & OPTION_LIFT_OFF_WITHOUT_THROTTLE or not vehicle.copter.receiver.is_throttle_down():
                self._landing.allow_lift_off()
            self._landing.lift_off_if_allowed()

    def _begin(self) -> None:
        self._steering.forget_speeds()
        self._doing, self._target = _Doing.STAY, self._here()
        self._looks_at = None

    def _changes_seen(self) -> tuple[int, int, tuple[MissionItem, ...]]:
        mission = self._vehicle.copter.mission
        ahead: list[MissionItem] = []
        seq = mission.nav_seq
        while len(ahead) < WATCHED_COMMANDS and (found := mission.next_nav(seq)) is not None:
            ahead.append(found.item)
            seq = found.seq + 1
        return mission.changes, mission.nav_seq, tuple(ahead)

    def _heed_changes(self) -> None:
        """Begin a waypoint again if a client has changed what is ahead (AP_Mission_ChangeDetector)."""
        mission = self._vehicle.copter.mission
        changes, seq, ahead = self._watched
        if changes == mission.changes and seq == mission.nav_seq:
            return
        self._watched = self._changes_seen()
        if seq == mission.nav_seq and ahead != self._watched[2] and self._doing is _Doing.TRAVEL:
            restarted = mission.restart_nav()
            text = "Auto mission changed, restarted command"
            failure = "Auto mission changed but failed to restart command"
            self._tell(text if restarted else failure, _MAV_SEVERITY_CRITICAL)

    def _tell(self, text: str, severity: int = _MAV_SEVERITY_INFO) -> None:
        self._vehicle.texts.send_text(severity, text)

    def _now_us(self) -> int:
        return self._vehicle.clock.micros64()

    def _here(self) -> Three:
        return self._steering.estimate.pos or ZERO

    # Beginning a command

    def start(self, command: Command) -> bool:
        """Begin a command; return whether it can be done (ModeAuto::start_command)."""
        item = command.item
        first, second, third, fourth = item.params
        heading = self._steering.heading
        match item.command:
            case Cmd.NAV_TAKEOFF | Cmd.NAV_VTOL_TAKEOFF:
                self._take_off(item)
            case number if number in _PLACES:
                self._passes_on = self._passes(command)
                self._wait_s = first if number in _TIMED else 0.0
                self._go_to(self._place(item), _Doing.TRAVEL)
            case Cmd.NAV_LAND | Cmd.NAV_VTOL_LAND:
                self._land_at(item)
            case Cmd.NAV_RETURN_TO_LAUNCH:
                self._doing = _Doing.RETURN
                self._returns.enter()
            case Cmd.NAV_GUIDED_ENABLE:
                return first == 0
            case Cmd.NAV_LOITER_TURNS:
                self._go_to_circle(self._place(item), third)
            case Cmd.NAV_DELAY:
                delay_ms = int(1000 * first) if first > 0 else self._ms_until(int(second), int(third), int(fourth))
                self._delay_until_us = self._now_us() + 1000 * delay_ms
                self._tell(f"Delaying {delay_ms // 1000} sec")
            case Cmd.CONDITION_DELAY:
                self._condition_until_us = self._now_us() + int(1e6 * max(first, 0.0))
            case Cmd.CONDITION_DISTANCE:
                self._near_m = max(first, 0.0)
            case Cmd.CONDITION_YAW:
                heading.turn_to(math.radians(first), math.radians(second), int(third), is_relative=fourth > 0)
            case Cmd.DO_CHANGE_SPEED:
                self.change_speed(int(first), second)
            case Cmd.DO_SET_HOME:
                self._set_home(item)
            case Cmd.DO_SET_ROI | Cmd.DO_SET_ROI_LOCATION | Cmd.DO_SET_ROI_NONE:
                self._look_at(item)
            case Cmd.DO_AUX_FUNCTION:
                if second <= SwitchPosition.HIGH:
                    run_aux_function(self._vehicle, int(first), int(second), AuxSource.MISSION, command.seq)
            case number if number not in _DONE_AT_ONCE:
                return False
        return True

    def change_speed(self, kind: int, speed_m_s: float) -> None:
        """Fly on with another speed, horizontally or upwards or downwards (DO_CHANGE_SPEED)."""
        steering = self._steering
        if speed_m_s <= 0:
            return
        if kind in (_AIRSPEED, _GROUND_SPEED):
            steering.speed = speed_m_s
        elif kind == _CLIMB:
            steering.speed_up = speed_m_s
        elif kind == _DESCENT:
            steering.speed_down = speed_m_s

    def _passes(self, command: Command) -> bool:
        """Return whether the vehicle goes on at a waypoint without a stop (ModeAuto::set_next_wp)."""
        if command.item.command not in _WAYPOINTS or command.item.params[0] > 0:
            return False
        following = self._vehicle.copter.mission.next_nav(command.seq + 1)
        return following is not None and following.item.command in _PASSED_ON_TO

    def _absolute(self, item: MissionItem) -> Location:
        home = self._vehicle.copter.home.place
        above_cm = home.alt_cm if home is not None and item.frame == FRAME_RELATIVE else 0
        return Location(item.x, item.y, item.alt_cm + above_cm)

    def _place(self, item: MissionItem) -> Three:
        """Return where an item's place is; what is 0 is as it was at the last target, or as it is (loc_from_cmd)."""
        north, east, down = self._target if self._arrived_us is not None else self._here()
        place = self._place_ned(self._absolute(item))
        if place is not None:
            north, east = place[:2] if item.x or item.y else (north, east)
            down = place[2] if item.alt_cm else down
        return north, east, down

    def _take_off(self, item: MissionItem) -> None:
        north, east, down = self._here()
        place = self._place_ned(self._absolute(item))
        least_m = LEAST_TAKEOFF_M if self._landing.landed else 0.0
        self._target = north, east, min(down if place is None else place[2], down - least_m)
        self._arrived_us, self._doing = None, _Doing.TAKE_OFF
        self._steering.heading.hold()
        self._landing.take_off_in_auto(self._target[2])

    def _go_to(self, target: Three, doing: _Doing) -> None:
        self._target = self._steering.destination = target
        self._arrived_us, self._doing = None, doing
        if self._looks_at is None and self._steering.limits.wp_yaw_behavior:
            self._steering.heading.along_course()

    def _land_at(self, item: MissionItem) -> None:
        if item.x or item.y:
            place = self._place_ned(self._absolute(item)) or self._here()
            self._passes_on = False
            self._go_to((place[0], place[1], self._here()[2]), _Doing.TRAVEL)
        else:
            self._begin_landing()

    def _begin_landing(self) -> None:
        self._doing = _Doing.LAND
        self._land.enter()

    def _set_home(self, item: MissionItem) -> None:
        home = self._vehicle.copter.home
        if item.params[0] == 1 or not (item.x or item.y or item.alt_cm):
            home.set_here(lock=False)
        else:
            home.set(self._absolute(item), lock=False)

    def _look_at(self, item: MissionItem) -> None:
        place = self._place_ned(self._absolute(item)) if item.x or item.y or item.alt_cm else None
        self._looks_at = None if place is None else place[:2]
        if place is None and self._steering.limits.wp_yaw_behavior:
            self._steering.heading.along_course()

    def _ms_until(self, hour: int, minute: int, second: int) -> int:
        """Return how long it is until a time of day, UTC; -1 is any hour, or any minute (AP_RTC::get_time_utc)."""
        utc_us = self._vehicle.rtc.utc_us()
        if not utc_us or (hour, minute, second) == (-1, -1, -1):
            return 0
        day_ms = utc_us // 1000 % 86_400_000
        left_ms, turn_ms = 1000 * second - day_ms % 60_000, 60_000
        if (hour, minute) != (-1, -1):
            left_ms, turn_ms = left_ms + 60_000 * (minute - day_ms // 60_000 % 60), 3_600_000
        if hour != -1:
            left_ms, turn_ms = left_ms + 3_600_000 * (hour - day_ms // 3_600_000), 86_400_000
        return left_ms + turn_ms if left_ms < 0 else left_ms

    # Whether a command is done

    def verify(self, command: Command) -> bool:
        """Return whether a command is done, and tell clients if it is (ModeAuto::verify_command)."""
        if command.item.command == Cmd.NAV_LOITER_TO_ALT:  # of which clients are not told
            return self._is_at_altitude()
        is_done = self._is_done(command)
        if is_done:
            self._vehicle.copter.mission.note_reached(command.seq)
        return is_done

    def _is_done(self, command: Command) -> bool:
        landing, item = self._landing, command.item
        match item.command:
            case Cmd.NAV_TAKEOFF | Cmd.NAV_VTOL_TAKEOFF:
                return not landing.landed and not landing.is_taking_off()
            case number if number in _TIMED:
                return self._has_waited(command.seq)
            case Cmd.NAV_LOITER_UNLIM:
                return False
            case Cmd.NAV_GUIDED_ENABLE:
                return True
            case Cmd.NAV_LOITER_TURNS:
                return self._has_circled(item.params[0])
            case Cmd.NAV_LAND | Cmd.NAV_VTOL_LAND:
                return self._has_landed()
            case Cmd.NAV_RETURN_TO_LAUNCH:
                return self._returns.is_landing() and landing.has_idled()
            case Cmd.NAV_DELAY:
                return self._now_us() > self._delay_until_us
            case Cmd.CONDITION_DELAY:
                return self._now_us() > self._condition_until_us
            case Cmd.CONDITION_DISTANCE:
                return self._distance_m() < self._near_m
            case Cmd.CONDITION_YAW:
                return self._steering.heading.has_turned(self._steering.estimate.yaw_rad)
            case number if number in _DONE_AT_ONCE:
                return True
        self._tell(f"Skipping invalid cmd #{item.command}", _MAV_SEVERITY_WARNING)
        return True

    def _distance_m(self) -> float:
        here = self._here()
        return math.hypot(self._target[0] - here[0], self._target[1] - here[1])

    def _has_waited(self, seq: int) -> bool:
        if self._arrived_us is None or self._now_us() - self._arrived_us < 1e6 * self._wait_s:
            return False
        self._tell(f"Reached command #{seq}")
        return True

    def _is_at_altitude(self) -> bool:
        return self._distance_m() <= self._radius_m() and abs(self._here()[2] - self._target[2]) < _TO_ALTITUDE_M

    def _has_landed(self) -> bool:
        if self._doing is _Doing.TRAVEL:
            if self._arrived_us is not None:
                self._begin_landing()
            return False
        copter = self._vehicle.copter
        if not self._landing.has_idled():
            return False
        if copter.is_armed() and not copter.mission.continues_after_landing():
            self._disarm(ArmMethod.LANDED)
            return False
        return True

    def end(self) -> None:
        """Stay, or land without a position, or on the ground disarm (ModeAuto::exit_mission)."""
        copter = self._vehicle.copter
        if self._landing.landed:
            self._disarm(ArmMethod.MISSIONEXIT)
        elif copter.estimates.position_ok():
            self._passes_on = False
            self._target, self._doing = self._stopping_place(), _Doing.STAY
            self._steering.heading.hold()
        else:
            copter.set_mode(ModeNumber.LAND, ModeReason.MISSION_END)

    def _stopping_place(self) -> Three:
        """Return where the vehicle comes to a stop."""
        way, pace = self._steering.way, self._steering.travel_pace()
        speed = math.hypot(*way.vel[:2])
        after_s = 0.5 * speed / pace.accel
        return way.pos[0] + after_s * way.vel[0], way.pos[1] + after_s * way.vel[1], way.pos[2]

    # Flying

    def enter(self) -> None:
        """Go on: the mission says what to do."""

    def run(self) -> Lean | None:
        """Go on for a period."""
        steering = self._steering
        if steering.estimate.pos is None and self._doing is not _Doing.LAND:
            steering.way.climb(0.0, steering.travel_pace(), PERIOD_S)
            return LEVEL
        lean = None
        match self._doing:
            case _Doing.LAND:
                lean = self._land.run()
            case _Doing.RETURN:
                lean = self._returns.run()
            case _Doing.CIRCLE:
                self._circle()
            case _:
                self._travel()
        if self._looks_at is not None:
            here = self._here()
            bearing = math.atan2(self._looks_at[1] - here[1], self._looks_at[0] - here[0])
            steering.heading.turn_to(bearing)
        return lean

    def _radius_m(self) -> float:
        return self._steering.limits.wpnav_radius

    def _travel(self) -> None:
        """Fly straight to the target: horizontal and vertical way take the same time."""
        way, target = self._steering.way, self._target
        pace = self._steering.travel_pace()
        ahead_m = math.hypot(target[0] - way.pos[0], target[1] - way.pos[1])
        down_m = target[2] - way.pos[2]
        vertical = pace.speed_down if down_m > 0 else pace.speed_up
        time_s = max(ahead_m / pace.speed, abs(down_m) / vertical)
        if time_s > 0 and self._doing is not _Doing.STAY:
            rise = max(abs(down_m) / time_s, LEAST_M_S)
            pace = pace._replace(
                speed=max(ahead_m / time_s, LEAST_M_S),
                speed_up=min(rise, pace.speed_up),
                speed_down=min(rise, pace.speed_down),
            )
        way.to_place(target[0], target[1], pace, PERIOD_S)
        way.to_height(target[2], pace, PERIOD_S)
        if self._arrived_us is None and self._has_arrived():
            self._arrived_us = self._now_us()
            if self._doing is _Doing.TO_CIRCLE:
                self._begin_circle()

    def _has_arrived(self) -> bool:
        """Return whether the target is reached: where it is passed, the way alone has to be near (update_wpnav)."""
        radius_m, way, here = self._radius_m(), self._steering.way, self._here()
        on_way_m = math.dist(way.pos, self._target)
        if self._passes_on:
            return on_way_m <= radius_m
        return on_way_m <= ARRIVED_M and math.dist(here, self._target) <= radius_m

    # Circles

    def _go_to_circle(self, centre: Three, radius_m: float) -> None:
        """Fly to the nearest place of a circle, and then along it (ModeAuto::circle_movetoedge_start)."""
        self._circle_radius_m = abs(radius_m) or CIRCLE_RADIUS_M
        self._circle_rate = math.copysign(1.0, radius_m)
        self._circles_told, self._passes_on = -1, False
        north, east, _ = self._here()
        off = north - centre[0], east - centre[1]
        distance_m = math.hypot(*off)
        self._circle_angle = math.atan2(off[1], off[0]) if distance_m else self._steering.estimate.yaw_rad + math.pi
        self._centre = centre
        edge = self._on_circle()
        if abs(distance_m - self._circle_radius_m) > NEAR_CIRCLE_M:
            self._go_to((edge[0], edge[1], centre[2]), _Doing.TO_CIRCLE)
        else:
            self._begin_circle()

    def _on_circle(self) -> tuple[float, float]:
        angle, radius_m = self._circle_angle, self._circle_radius_m
        return self._centre[0] + radius_m * math.cos(angle), self._centre[1] + radius_m * math.sin(angle)

    def _begin_circle(self) -> None:
        self._doing, self._circle_turned = _Doing.CIRCLE, 0.0
        self._arrived_us = None

    def _circle(self) -> None:
        """Fly along the circle, and look at its centre (AC_Circle::update_cms)."""
        steering, radius_m = self._steering, self._circle_radius_m
        pace = steering.travel_pace()
        most = min(pace.speed, math.sqrt(0.5 * pace.accel * radius_m)) / radius_m
        rate = math.copysign(min(CIRCLE_RATE_RAD_S, most), self._circle_rate)
        self._circle_angle += rate * PERIOD_S
        self._circle_turned += abs(rate) * PERIOD_S
        north, east = self._on_circle()
        along = rate * radius_m
        way = steering.way
        way.at_velocity(
            -along * math.sin(self._circle_angle) + CIRCLE_GAIN_PER_S * (north - way.pos[0]),
            along * math.cos(self._circle_angle) + CIRCLE_GAIN_PER_S * (east - way.pos[1]),
            pace,
            PERIOD_S,
        )
        way.to_height(self._centre[2], pace, PERIOD_S)
        self._target = north, east, self._centre[2]
        steering.destination = self._target
        if self._looks_at is None:
            steering.heading.turn_to(self._circle_angle + math.pi)

    def _has_circled(self, turns: float) -> bool:
        if self._doing is not _Doing.CIRCLE:
            return False
        done = self._circle_turned / _TURN
        if int(done) != self._circles_told:
            self._circles_told = int(done)
            self._tell(f"Mission: starting circle {int(done) + 1}/{int(turns)}")
        return done >= turns
