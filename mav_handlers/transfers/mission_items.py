# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Items of missions, fences and rally points: which there are, and what of a message the firmware keeps.

Source: AP_Mission/AP_Mission.cpp (mavlink_int_to_mission_cmd, mission_cmd_to_mavlink_int, type),
GCS_MAVLink/MissionItemProtocol_Fence.cpp, GCS_MAVLink/MissionItemProtocol_Rally.cpp.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

from ap_core.cint import i8, i16, int_of_float, u8, u16
from ap_core.fmath import f32
from ap_core.location import MAX_LAT, MAX_LNG, Location
from mav_handlers.wire.messages import MISSION_ITEM, MISSION_ITEM_INT

FRAME_ABSOLUTE: Final = 0
FRAME_RELATIVE: Final = 3
MOST_ALTITUDE_M: Final = 83_000
MOST_MISSION_ITEMS: Final = 650
MOST_FENCE_ITEMS: Final = 70
MOST_RALLY_POINTS: Final = 46
"""How many the storage of the firmware's simulator holds (StorageManager/StorageManager.cpp)."""

_FRAMES: Final[Mapping[int, int]] = {0: FRAME_ABSOLUTE, 2: FRAME_ABSOLUTE, 5: FRAME_ABSOLUTE, 3: FRAME_RELATIVE, 6: 3}
_RALLY_FRAMES: Final[Mapping[int, int]] = {0: FRAME_ABSOLUTE, 5: FRAME_ABSOLUTE, 3: FRAME_RELATIVE, 6: FRAME_RELATIVE}
_FENCE_FRAMES: Final = frozenset({0, 3, 5, 6, 10, 11})
_CENTI: Final = f32(0.01)
_HUNDRED: Final = f32(100)
_UNITS_PER_DEGREE: Final = f32(1.0e7)
_DEGREES_PER_UNIT: Final = f32(1.0e-7)
_FLT_EPSILON: Final = 2.0**-23
_MOST_U16: Final = 65535


class MissionType(IntEnum):
    """MAV_MISSION_TYPE values that the firmware supports."""

    MISSION = 0
    FENCE = 1
    RALLY = 2


class MissionResult(IntEnum):
    """MAV_MISSION_RESULT values used here."""

    ACCEPTED = 0
    ERROR = 1
    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    NO_SPACE = 4
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13
    DENIED = 14
    OPERATION_CANCELLED = 15


class Cmd(IntEnum):
    """MAV_CMD values that something here refers to by name."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    NAV_SPLINE_WAYPOINT = 82
    NAV_VTOL_TAKEOFF = 84
    NAV_VTOL_LAND = 85
    NAV_GUIDED_ENABLE = 92
    NAV_DELAY = 93
    NAV_LAST = 95
    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_RETURN_PATH_START = 188
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    DO_FENCE_ENABLE = 207
    DO_AUX_FUNCTION = 218
    DO_GUIDED_LIMITS = 222
    JUMP_TAG = 600
    DO_JUMP_TAG = 601
    FENCE_RETURN_POINT = 5000
    FENCE_POLYGON_INCLUSION = 5001
    FENCE_POLYGON_EXCLUSION = 5002
    FENCE_CIRCLE_INCLUSION = 5003
    FENCE_CIRCLE_EXCLUSION = 5004
    RALLY_POINT = 5100


Params = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class MissionItem:
    """An item as it is kept.

    Attributes:
        command: MAV_CMD.
        frame: 0 with an altitude above mean sea level, 3 with one above home; 0 without a place.
        params: param1 to param4.
        x, y: latitude and longitude in 1e-7 deg, or what else the command has there.
        z: altitude in m.
    """

    command: int
    frame: int = FRAME_ABSOLUTE
    params: Params = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    y: int = 0
    z: float = 0.0

    @classmethod
    def at(cls, command: int, place: Location) -> "MissionItem":
        """Return an item at a place above mean sea level."""
        return cls(command, x=place.lat, y=place.lng, z=float(f32(f32(place.alt_cm) * _CENTI)))

    @property
    def is_nav(self) -> bool:
        """Whether it is a navigation command; all others are done on the way (AP_Mission::is_nav_cmd)."""
        return self.command <= Cmd.NAV_LAST

    @property
    def alt_cm(self) -> int:
        """The altitude in cm."""
        return int_of_float(round(100 * self.z))


# What a field keeps of a number


def _gone(_value: float) -> float:
    return 0.0


def _kept(value: float) -> float:
    return value


def _as_u8(value: float) -> float:
    return float(u8(int_of_float(value)))


def _as_i8(value: float) -> float:
    return float(i8(int_of_float(value)))


def _as_u16(value: float) -> float:
    return float(u16(int_of_float(value)))


def _as_i16(value: float) -> float:
    return float(i16(int_of_float(value)))


def _as_sign(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _as_direction(value: float) -> float:
    return -1.0 if value <= -_FLT_EPSILON else 1.0


def _as_flag(value: float) -> float:
    return float(value > 0)


def _as_radius(value: float) -> float:
    radius = _as_u16(abs(value))
    return -radius if value < 0 else radius


def _turns(params: Params) -> Params:
    """Keep turns and radius in a byte each: parts of a turn in 1/256, radii above 255 m in tens of metres."""
    turns, _, radius, exit_from_tangent = params
    is_part, is_large = 0 < turns < 1, abs(radius) > 255
    tens = int_of_float(min(255.0, 0.1 * abs(radius))) if is_large else int_of_float(abs(radius))
    packed = u16(int_of_float(min(255.0, 256 * turns if is_part else turns))) | u8(tens) << 8
    kept_radius = float((packed >> 8) * (10 if is_large else 1))
    kept_turns = (packed & 0xFF) / (256 if is_part else 1)
    return kept_turns, 0.0, -kept_radius if radius < 0 else kept_radius, _as_flag(exit_from_tangent)


_Keep = Callable[[Params], Params]


def _fields(
    first: Callable[[float], float] = _gone,
    second: Callable[[float], float] = _gone,
    third: Callable[[float], float] = _gone,
    fourth: Callable[[float], float] = _gone,
) -> _Keep:
    """Return what keeps so much of each of four parameters."""

    def keep(params: Params) -> Params:
        return first(params[0]), second(params[1]), third(params[2]), fourth(params[3])

    return keep


_NOTHING: Final = _fields()


class CommandKind(NamedTuple):
    """A command of missions.

    Attributes:
        name: as in texts.
        keep: returns what is kept of its parameters.
        has_place: its x, y and z are a place.
        may_be_nan: the parameters, from 0, that may be no number.
    """

    name: str
    keep: _Keep = _NOTHING
    has_place: bool = False
    may_be_nan: frozenset[int] = frozenset()


def _at(name: str, keep: _Keep = _NOTHING, may_be_nan: frozenset[int] = frozenset()) -> CommandKind:
    return CommandKind(name, keep, True, may_be_nan)


_FOURTH: Final = frozenset({3})
_FIRST: Final = _fields(_as_u16)

COMMAND_KINDS: Final[Mapping[int, CommandKind]] = {
    Cmd.NAV_WAYPOINT: _at("WP", _FIRST, _FOURTH),
    Cmd.NAV_LOITER_UNLIM: _at("LoitUnlim", _fields(third=_as_radius), _FOURTH),
    Cmd.NAV_LOITER_TURNS: _at("LoitTurns", _turns),
    Cmd.NAV_LOITER_TIME: _at("LoitTime", _fields(_as_u16, third=_as_sign, fourth=_as_flag)),
    Cmd.NAV_RETURN_TO_LAUNCH: CommandKind("RTL"),
    Cmd.NAV_LAND: _at("Land", _fields(_as_u16, fourth=_as_direction), _FOURTH),
    Cmd.NAV_TAKEOFF: _at("Takeoff", _FIRST, _FOURTH),
    30: _at("ContinueAndChangeAlt", _FIRST),
    Cmd.NAV_LOITER_TO_ALT: _at("LoitAltitude", _fields(second=_as_radius, fourth=_as_flag)),
    Cmd.NAV_SPLINE_WAYPOINT: _at("SplineWP", _FIRST),
    Cmd.NAV_VTOL_TAKEOFF: _at("VTOLTakeoff", may_be_nan=_FOURTH),
    Cmd.NAV_VTOL_LAND: _at("VTOLLand", _FIRST, frozenset({2, 3})),
    Cmd.NAV_GUIDED_ENABLE: _at("GuidedEnable", _FIRST),
    Cmd.NAV_DELAY: CommandKind("Delay", _fields(_kept, _as_i8, _as_i8, _as_i8)),
    Cmd.CONDITION_DELAY: CommandKind("CondDelay", _fields(_kept)),
    Cmd.CONDITION_DISTANCE: CommandKind("CondDist", _fields(_kept)),
    Cmd.CONDITION_YAW: CommandKind("CondYaw", _fields(_kept, _kept, _as_i8, _as_u8)),
    Cmd.DO_JUMP: CommandKind("Jump", _fields(_as_u16, _as_i16)),
    Cmd.DO_CHANGE_SPEED: CommandKind("ChangeSpeed", _fields(_as_u8, _kept, _kept)),
    Cmd.DO_SET_HOME: _at("SetHome", _FIRST),
    181: CommandKind("SetRelay", _fields(_as_u8, _as_u8)),
    182: CommandKind("RepeatRelay", _fields(_as_u8, _as_i16, _kept)),
    183: CommandKind("SetServo", _fields(_as_u8, _as_u16)),
    184: CommandKind("RepeatServo", _fields(_as_u8, _as_u16, _as_i16, _kept)),
    Cmd.DO_RETURN_PATH_START: _at("ReturnPathStart"),
    Cmd.DO_LAND_START: _at("LandStart"),
    Cmd.DO_SET_ROI_LOCATION: _at("SetROILocation", _FIRST),
    Cmd.DO_SET_ROI_NONE: CommandKind("SetROINone", _FIRST),
    Cmd.DO_SET_ROI: _at("SetROI", _FIRST),
    206: CommandKind("SetCamTrigDst", _fields(_kept, third=_as_u8)),
    Cmd.DO_FENCE_ENABLE: CommandKind("FenceEnable", _FIRST),
    211: CommandKind("Gripper", _fields(_as_u8, _as_u8)),
    217: CommandKind("Scripting", _fields(_as_u16, _kept, _kept, _kept)),
    Cmd.DO_AUX_FUNCTION: CommandKind("AuxFunction", _fields(_as_u16, _as_u8)),
    Cmd.DO_GUIDED_LIMITS: CommandKind("GuidedLimits", _fields(_as_u16, _kept, _kept, _kept)),
    Cmd.JUMP_TAG: CommandKind("Tag", _FIRST),
    Cmd.DO_JUMP_TAG: CommandKind("JumpToTag", _fields(_as_u16, _as_i16)),
}
"""The commands that missions may have, one row each."""

IGNORED_COMMANDS: Final = frozenset({181, 182, 183, 184, 206, 211, 217, Cmd.JUMP_TAG})
"""Those that AP_Mission itself does, and that are done here at once: they move what there is not."""

UNKNOWN_COMMAND: Final = CommandKind("?")


# From messages to items


def kept_of_mission(message: MISSION_ITEM_INT, *, checks_delay: bool = False) -> MissionItem | MissionResult:
    """Return what a mission keeps of a message, or why it is refused.

    ``checks_delay``: the release refuses a time at a waypoint that does not fit.
    """
    kind = COMMAND_KINDS.get(message.command)
    params = message.param1, message.param2, message.param3, message.param4
    may_be_nan = frozenset[int]() if kind is None else kind.may_be_nan
    for number, value in enumerate(params):
        if math.isinf(value) or (math.isnan(value) and number not in may_be_nan):
            return MissionResult(MissionResult.INVALID_PARAM1 + number)
    if message.command <= 1:
        return MissionResult.INVALID
    if kind is None:
        return MissionResult.UNSUPPORTED
    if checks_delay and message.command == Cmd.NAV_WAYPOINT and not 0 <= params[0] <= _MOST_U16:
        return MissionResult.INVALID_PARAM1
    if not kind.has_place:
        return MissionItem(message.command, params=kind.keep(params))
    problem = _place_problem(message)
    if problem is None and (math.isnan(message.z) or abs(message.z) >= MOST_ALTITUDE_M):
        problem = MissionResult.INVALID_PARAM7
    if problem is None and message.frame not in _FRAMES:
        problem = MissionResult.UNSUPPORTED_FRAME
    if problem is not None:
        return problem
    altitude_m = float(f32(int_of_float(float(f32(message.z) * _HUNDRED))) * _CENTI)
    frame = _FRAMES[message.frame]
    return MissionItem(message.command, frame, kind.keep(params), message.x, message.y, altitude_m)


def _place_problem(message: MISSION_ITEM_INT) -> MissionResult | None:
    # The firmware compares in float32.
    if f32(abs(message.x)) > MAX_LAT:
        return MissionResult.INVALID_PARAM5_X
    return MissionResult.INVALID_PARAM6_Y if f32(abs(message.y)) > MAX_LNG else None


def kept_of_fence(message: MISSION_ITEM_INT) -> MissionItem | MissionResult:
    """Return what a fence keeps of a message, or why it is refused."""
    if message.frame not in _FENCE_FRAMES:
        return MissionResult.UNSUPPORTED_FRAME
    match message.command:
        case Cmd.FENCE_POLYGON_INCLUSION | Cmd.FENCE_POLYGON_EXCLUSION:
            if message.param1 > 255:
                return MissionResult.INVALID_PARAM1
            first = _as_u8(message.param1)
        case Cmd.FENCE_CIRCLE_INCLUSION | Cmd.FENCE_CIRCLE_EXCLUSION:
            first = message.param1
        case Cmd.FENCE_RETURN_POINT:
            first = 0.0
        case _:
            return MissionResult.UNSUPPORTED
    return MissionItem(message.command, params=(first, 0.0, 0.0, 0.0), x=message.x, y=message.y)


def kept_of_rally(message: MISSION_ITEM_INT) -> MissionItem | MissionResult:
    """Return what is kept of a message of a rally point, or why it is refused."""
    if message.command != Cmd.RALLY_POINT:
        return MissionResult.UNSUPPORTED
    problem = _place_problem(message)
    if problem is None and not -32768 <= message.z <= 32767 and not math.isnan(message.z):
        problem = MissionResult.INVALID_PARAM7
    if problem is None and message.frame not in _RALLY_FRAMES:
        problem = MissionResult.UNSUPPORTED_FRAME
    if problem is not None:
        return problem
    return MissionItem(message.command, _RALLY_FRAMES[message.frame], x=message.x, y=message.y, z=_as_i16(message.z))


def _has_place(command: int) -> bool:
    kind = COMMAND_KINDS.get(command, UNKNOWN_COMMAND)
    return kind.has_place or Cmd.FENCE_RETURN_POINT <= command <= Cmd.RALLY_POINT


def in_units(message: MISSION_ITEM) -> MISSION_ITEM_INT | MissionResult:
    """Return a message with float32 degrees as one with 1e-7 deg (convert_MISSION_ITEM_to_MISSION_ITEM_INT)."""
    x, y = message.x, message.y
    if _has_place(message.command):
        if not abs(x) <= 90:
            return MissionResult.INVALID_PARAM5_X
        if not abs(y) <= 180:
            return MissionResult.INVALID_PARAM6_Y
        x, y = float(f32(x) * _UNITS_PER_DEGREE), float(f32(y) * _UNITS_PER_DEGREE)
    head = message.target_system, message.target_component, message.seq, message.frame, message.command
    params = message.param1, message.param2, message.param3, message.param4
    flags = message.current, message.autocontinue
    return MISSION_ITEM_INT(*head, *flags, *params, int_of_float(x), int_of_float(y), message.z, message.mission_type)


def in_degrees(message: MISSION_ITEM_INT) -> MISSION_ITEM:
    """Return a message with float32 degrees in place of 1e-7 deg (convert_MISSION_ITEM_INT_to_MISSION_ITEM)."""
    scale = _DEGREES_PER_UNIT if _has_place(message.command) else f32(1)
    x, y = float(f32(message.x) * scale), float(f32(message.y) * scale)
    head = message.target_system, message.target_component, message.seq, message.frame, message.command
    params = message.param1, message.param2, message.param3, message.param4
    return MISSION_ITEM(*head, message.current, message.autocontinue, *params, x, y, message.z, message.mission_type)


# Lists of items


class ItemList(Protocol):
    """The items of a mission, of a fence or of rally points."""

    def count(self) -> int:
        """Return how many there are; of a fence that is being received, how many there will be."""

    def get(self, seq: int) -> MissionItem | None:
        """Return an item."""

    def begin(self, count: int | None) -> None:
        """Make ready to receive so many items, or with None some in place of others."""

    def put(self, seq: int, item: MissionItem) -> bool:
        """Replace an item, or add one behind the last; return whether that was possible."""

    def complete(self) -> bool:
        """Take note that all have come; return whether they are kept."""

    def abandon(self) -> None:
        """Take note that no more will come."""

    def clear(self) -> bool:
        """Delete all; return whether that was possible."""


class KeptItems:
    """Rally points: kept, and obeyed by nobody here.

    Attributes:
        items: all of them.
        changes: how often they have changed.
    """

    def __init__(self, items: Sequence[MissionItem] = ()) -> None:
        self.items = [*items]
        self.changes = 0

    def count(self) -> int:
        """Return how many there are."""
        return len(self.items)

    def get(self, seq: int) -> MissionItem | None:
        """Return an item."""
        return self.items[seq] if seq < len(self.items) else None

    def begin(self, count: int | None) -> None:
        """Delete those beyond a number."""
        if count is not None:
            del self.items[count:]
            self.changes += 1

    def put(self, seq: int, item: MissionItem) -> bool:
        """Replace an item, or add one behind the last."""
        self.items[seq : seq + 1] = [item]
        self.changes += 1
        return True

    def complete(self) -> bool:
        """Do nothing: they are kept."""
        return True

    def abandon(self) -> None:
        """Do nothing: those that came are kept."""

    def clear(self) -> bool:
        """Delete all."""
        self.items.clear()
        self.changes += 1
        return True


class FenceItems(KeptItems):
    """A fence: kept once all its items have come, and obeyed by nobody here."""

    def __init__(self, items: Sequence[MissionItem] = ()) -> None:
        super().__init__(items)
        self._new: list[MissionItem | None] | None = None

    def count(self) -> int:
        """Return how many there are, or will be."""
        return len(self.items if self._new is None else self._new)

    def begin(self, count: int | None) -> None:
        """Make ready for others."""
        self._new = [None] * (len(self.items) if count is None else count)

    def put(self, seq: int, item: MissionItem) -> bool:
        """Note an item."""
        if self._new is None or seq >= len(self._new):
            return False
        self._new[seq] = item
        return True

    def complete(self) -> bool:
        """Replace the fence; items that did not come stay."""
        new, self._new = self._new, None
        if new is not None:
            self.items = [self.items[seq] if item is None else item for seq, item in enumerate(new)]
            self.changes += 1
        return True

    def abandon(self) -> None:
        """Keep the old ones."""
        self._new = None

    def clear(self) -> bool:
        """Delete all."""
        self._new = None
        return super().clear()


Plans = Mapping[MissionType, Sequence[MissionItem]]
"""Items by MissionType."""


class ItemStore(Protocol):
    """A place that keeps items over a restart."""

    def load(self) -> Plans:
        """Return what is stored."""

    def save_if_changed(self, plans: Plans, *, synced: bool = True) -> bool:
        """Store items; return whether any was new. ``synced``: so that they survive a restart of the computer."""


class MemoryItemStore:
    """Keeps items in memory."""

    def __init__(self) -> None:
        self._plans: dict[MissionType, tuple[MissionItem, ...]] = {}

    def load(self) -> Plans:
        """Return what is stored."""
        return self._plans

    def save_if_changed(self, plans: Plans, *, synced: bool = True) -> bool:
        """Store items; return whether any was new."""
        before, self._plans = self._plans, {kind: tuple(items) for kind, items in plans.items()}
        return before != self._plans
