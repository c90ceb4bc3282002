# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight modes: which there are, and when one may be entered (ArduCopter/mode.h, ArduCopter/mode.cpp).

FIRMWARE PARITY: a mode is a number that is told and logged, with the firmware's rules about entering it, arming in it
and taking off in it; none flies, but those of the model in ``viso.vehicle.copter.flying`` if there is one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TYPE_CHECKING, Final

from viso.vehicle.copter.estimates import Estimates
from viso.vehicle.copter.home import Home

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

ERR_SUBSYSTEM_FLIGHT_MODE: Final = 10

_MAV_SEVERITY_CRITICAL: Final = 2
_MAV_SEVERITY_WARNING: Final = 4
_NON_STANDARD: Final = 0
_NO_PROPERTIES: Final = 0
_NOT_SELECTABLE: Final = 2


class ModeReason(IntEnum):
    """Why the mode is what it is (AP_Vehicle/ModeReason.h)."""

    RC_COMMAND = 1
    GCS_COMMAND = 2
    EKF_FAILSAFE = 6
    MISSION_END = 8
    INITIALISED = 26
    DDS_COMMAND = 52


class ModeNumber(IntEnum):
    """HEARTBEAT's custom_mode of a copter."""

    STABILIZE = 0
    ACRO = 1
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    CIRCLE = 7
    LAND = 9
    DRIFT = 11
    FLIP = 14
    AUTOTUNE = 15
    POSHOLD = 16
    BRAKE = 17
    THROW = 18
    AVOID_ADSB = 19
    GUIDED_NOGPS = 20
    SMART_RTL = 21
    FLOWHOLD = 22
    FOLLOW = 23
    ZIGZAG = 24
    SYSTEMID = 25
    AUTO_RTL = 27
    TURTLE = 28


class UserTakeoff(Enum):
    """Whether NAV_TAKEOFF works in a mode (Mode::has_user_takeoff)."""

    NEVER = "never"
    BY_PILOT = "only where the pilot does the horizontal part"
    ALWAYS = "always"


@dataclass(frozen=True, slots=True)
class Mode:
    """One flight mode.

    Attributes:
        number: its custom_mode.
        name: as in texts and AVAILABLE_MODES, in capitals.
        words: the same in releases that spell it out.
        requires_position: it cannot do without a position (requires_GPS).
        manual_throttle: the pilot has the throttle, so that no height is needed.
        arms: it may be armed in by a ground station.
        takeoff: whether NAV_TAKEOFF works in it.
        holds_height, holds_position: it runs the vertical, the horizontal position controller, on the ground too.
        lands: it brings the vehicle down and disarms it there.
    """

    number: ModeNumber
    name: str
    words: str
    requires_position: bool = False
    manual_throttle: bool = False
    arms: bool = True
    takeoff: UserTakeoff = UserTakeoff.NEVER
    holds_height: bool = True
    holds_position: bool = True
    lands: bool = False


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """A flight mode as AVAILABLE_MODES lists it: MAV_STANDARD_MODE 0 is none of those, properties are bits."""

    name: str
    custom_mode: int
    standard_mode: int
    properties: int


def _modes(*modes: Mode) -> Mapping[int, Mode]:
    return {mode.number: mode for mode in modes}


_N = ModeNumber

MODES: Final = _modes(
    Mode(_N.AUTO, "AUTO", "Auto", requires_position=True, arms=False),
    Mode(_N.ACRO, "ACRO", "Acro", manual_throttle=True, holds_height=False, holds_position=False),
    Mode(_N.STABILIZE, "STABILIZE", "Stabilize", manual_throttle=True, holds_height=False, holds_position=False),
    Mode(_N.ALT_HOLD, "ALT_HOLD", "Altitude Hold", takeoff=UserTakeoff.BY_PILOT, holds_position=False),
    Mode(_N.CIRCLE, "CIRCLE", "Circle", requires_position=True, arms=False),
    Mode(_N.LOITER, "LOITER", "Loiter", requires_position=True, takeoff=UserTakeoff.ALWAYS),
    Mode(_N.GUIDED, "GUIDED", "Guided", requires_position=True, takeoff=UserTakeoff.ALWAYS),
    Mode(_N.LAND, "LAND", "Land", arms=False, lands=True),
    Mode(_N.RTL, "RTL", "RTL", requires_position=True, arms=False, lands=True),
    Mode(_N.DRIFT, "DRIFT", "Drift", requires_position=True, holds_height=False, holds_position=False),
    Mode(_N.FLIP, "FLIP", "Flip", arms=False, holds_height=False, holds_position=False),
    Mode(_N.AUTOTUNE, "AUTOTUNE", "Autotune", arms=False),
    Mode(_N.POSHOLD, "POSHOLD", "Position Hold", requires_position=True, takeoff=UserTakeoff.ALWAYS),
    Mode(_N.BRAKE, "BRAKE", "Brake", requires_position=True, arms=False),
    Mode(_N.THROW, "THROW", "Throw", requires_position=True, holds_height=False, holds_position=False),
    Mode(_N.AVOID_ADSB, "AVOID_ADSB", "Avoid ADSB", requires_position=True, arms=False, takeoff=UserTakeoff.ALWAYS),
    Mode(_N.GUIDED_NOGPS, "GUIDED_NOGPS", "Guided No GPS", takeoff=UserTakeoff.ALWAYS),
    Mode(_N.SMART_RTL, "SMARTRTL", "Smart RTL", requires_position=True, arms=False, lands=True),
    Mode(_N.FLOWHOLD, "FLOWHOLD", "Flow Hold", takeoff=UserTakeoff.BY_PILOT),
    Mode(_N.FOLLOW, "FOLLOW", "Follow", requires_position=True, arms=False, takeoff=UserTakeoff.ALWAYS),
    Mode(_N.ZIGZAG, "ZIGZAG", "ZigZag", requires_position=True, takeoff=UserTakeoff.ALWAYS),
    Mode(_N.SYSTEMID, "SYSTEMID", "SystemID", manual_throttle=True, arms=False),
    Mode(_N.TURTLE, "TURTLE", "Turtle", manual_throttle=True),
)
"""The modes of the reference build by number, in the order of AVAILABLE_MODES."""

# What these say when they refuse: their parameters have the values of the firmware's defaults.
_TEXTS: Final = {
    ModeNumber.FOLLOW: "Set FOLL_ENABLE = 1",
    ModeNumber.SYSTEMID: "No axis selected, SID_AXIS = 0",
}
# They need a flight in the air, an optical flow sensor or DShot motors.
_NEVER_ENTERED: Final = frozenset(
    {ModeNumber.FLIP, ModeNumber.AUTOTUNE, ModeNumber.FLOWHOLD, ModeNumber.TURTLE, *_TEXTS}
)


# They are enabled by parameters, and Turtle by DShot motors; FLOWHOLD is where there is a sensor.
_NOT_ENABLED: Final = frozenset({ModeNumber.FOLLOW, ModeNumber.SYSTEMID, ModeNumber.TURTLE})


class FlightModes:
    """The flight mode, STABILIZE at first, and why it is that."""

    def __init__(self, vehicle: "Vehicle", estimates: Estimates, home: Home, is_armed: Callable[[], bool]) -> None:
        self._vehicle = vehicle
        self._release = vehicle.release
        self._texts = vehicle.texts
        self._log = vehicle.log
        self._estimates = estimates
        self._home = home
        self._is_armed = is_armed
        self.current = MODES[ModeNumber.STABILIZE]
        self.reason = ModeReason.INITIALISED

    def name_of(self, mode: Mode) -> str:
        """Return a mode's name as the release spells it."""
        return mode.words if self._release.spells_modes_out else mode.name

    def available(self) -> list[AvailableMode]:
        """Return the modes that AVAILABLE_MODES lists (GCS_MAVLINK_Copter::send_available_mode).

        AUTO RTL comes first: it is AUTO under another name and number.
        """
        auto_rtl = "Auto RTL" if self._release.spells_modes_out else "AUTO RTL"
        named = [(ModeNumber.AUTO_RTL, auto_rtl), *((mode.number, self.name_of(mode)) for mode in MODES.values())]
        return [AvailableMode(name, number, _NON_STANDARD, self._properties(number)) for number, name in named]

    def _properties(self, number: ModeNumber) -> int:
        is_enabled = self._vehicle.flow.enabled() if number == ModeNumber.FLOWHOLD else number not in _NOT_ENABLED
        return _NO_PROPERTIES if is_enabled or not self._release.lists_selectable_modes else _NOT_SELECTABLE

    def set_mode(self, number: int, reason: ModeReason) -> bool:
        """Enter a mode; return whether the vehicle is in it now. A refusal is sent as a text (Copter::set_mode)."""
        if number == self.current.number:
            self.reason = reason
            return True
        if number == ModeNumber.AUTO_RTL:
            return self._refuse("Mode change to AUTO RTL failed: No return path or landing sequence found", number)
        mode = MODES.get(number)
        if mode is None:
            return self._refuse(f"No such mode {number}", number)
        failure = self._failure(mode)
        if failure is not None:
            return self._refuse(f"Mode change to {self.name_of(mode)} failed: {failure}", number)
        mission = self._vehicle.copter.mission
        mission.stop()
        if number == ModeNumber.AUTO and mission.crew is not None:
            mission.wait_to_start()
        self.current = mode
        self.reason = reason
        self.log_mode()
        return True

    def log_mode(self) -> None:
        """Write a MODE record."""
        self._log.mode(self.current.number, self.reason)

    def _refuse(self, text: str, number: int) -> bool:
        self._texts.send_text(_MAV_SEVERITY_WARNING, text)
        self._log.error(ERR_SUBSYSTEM_FLIGHT_MODE, number)
        return False

    def _failure(self, mode: Mode) -> str | None:
        # Disarmed, any mode may be chosen: arming has its own checks.
        if self._is_armed():
            if mode.requires_position and not self._estimates.position_ok():
                return "requires position"
            takes_over_height = self.current.manual_throttle and not mode.manual_throttle
            if takes_over_height and not self._estimates.alt_ok():
                return "need alt estimate"
        return None if self._init(mode) else "init failed"

    def _init(self, mode: Mode) -> bool:
        """Do what the mode itself checks (Mode::init of each)."""
        if mode.number in _TEXTS:
            self._texts.send_text(_MAV_SEVERITY_WARNING, _TEXTS[mode.number])
        if mode.number in _NEVER_ENTERED:
            return False
        if mode.number == ModeNumber.AUTO:
            return not self._is_armed() or self._has_mission()
        if mode.number == ModeNumber.THROW:
            return not self._is_armed()
        if mode.number == ModeNumber.RTL:
            return not self._is_armed() or self._home.place is not None
        return mode.number != ModeNumber.SMART_RTL or self._home.has_return_path

    def _has_mission(self) -> bool:
        """Return whether a mission can be flown; on the ground it has to begin with a take-off (ModeAuto::init)."""
        copter = self._vehicle.copter
        if copter.mission.crew is None or not copter.mission.is_present():
            return False
        if copter.landing.landed and not copter.mission.starts_with_takeoff():
            self._texts.send_text(_MAV_SEVERITY_CRITICAL, "Auto: Missing Takeoff Cmd")
            return False
        return True
