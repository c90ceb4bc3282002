# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The mission: its items, and which of them is done now (AP_Mission/AP_Mission.cpp).

A navigation command moves the vehicle. The others that stand before it are done meanwhile, one after the other; those
behind the last navigation command are not done.
"""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from ap_core.location import Location
from mav_handlers.transfers.mission_items import (
    COMMAND_KINDS,
    IGNORED_COMMANDS,
    MOST_MISSION_ITEMS,
    UNKNOWN_COMMAND,
    Cmd,
    MissionItem,
)
from viso.logs.vehicle_log import CMD, MISE

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

NO_INDEX: Final = 65535
FIRST: Final = 1
REPEAT_FOR_EVER: Final = -1
OPTION_CLEAR_ON_BOOT: Final = 1 << 0
OPTION_CONTINUE_AFTER_LAND: Final = 1 << 2
OPTION_KEEP_JUMP_COUNTS: Final = 1 << 3
MASK_LOG_CMD: Final = 1 << 8
MOST_JUMPS: Final = 64
"""How many jumps may follow each other."""
MOST_LOOPS: Final = 255
MOST_BEFORE_TAKEOFF: Final = 16
_TAKEOFFS: Final = frozenset({Cmd.NAV_TAKEOFF, Cmd.NAV_VTOL_TAKEOFF})
_BEFORE_TAKEOFF: Final = frozenset({Cmd.DO_AUX_FUNCTION, Cmd.NAV_DELAY})
_MAV_SEVERITY_INFO: Final = 6


class MissionState(IntEnum):
    """Where a mission is, as MISSION_CURRENT tells it (MISSION_STATE)."""

    STOPPED = 2
    RUNNING = 3
    COMPLETE = 5


class Command(NamedTuple):
    """An item with its number."""

    seq: int
    item: MissionItem


class Crew(Protocol):
    """Who does the commands of a mission."""

    def start(self, command: Command) -> bool:
        """Begin a command; return whether it can be done."""

    def verify(self, command: Command) -> bool:
        """Return whether a command is done."""

    def end(self) -> None:
        """Do what is to be done at the end of the mission."""


class Mission:
    """The items of a mission, of which the first is home, and its progress.

    Attributes:
        items: all of them.
        state: where it is.
        crew: who does the commands; None if nobody flies the vehicle. Then the mission never starts.
        waits: it is to be started as soon as there is an origin.
        reached_seq: the command that was done last, of which clients are told.
        changes: how often items have changed.
    """

    def __init__(self, vehicle: "Vehicle", home: Callable[[], Location | None]) -> None:
        self._vehicle = vehicle
        self._home = home
        self._counts_home = vehicle.release.counts_home
        self.items: list[MissionItem] = []
        self.state = MissionState.STOPPED
        self.crew: Crew | None = None
        self.waits = False
        self.reached_seq = 0
        self._reached_is_new = False
        self.changes = 0
        self._nav: Command | None = None
        self._do: Command | None = None
        self._nav_is_loaded = self._do_is_loaded = self._do_are_done = False
        self._jumps: dict[int, int] = {}

    # Its items

    def load(self, items: Sequence[MissionItem]) -> None:
        """Take the items that were stored, at the end of booting, or forget them (AP_Mission::init)."""
        self.items = [*items]
        self._changed()
        if self._option(OPTION_CLEAR_ON_BOOT):
            self._vehicle.texts.send_text(_MAV_SEVERITY_INFO, "Clearing Mission")
            self.clear()

    def _option(self, bit: int) -> bool:
        return bool(self._vehicle.params.get_int("MIS_OPTIONS") & bit)

    def _changed(self) -> None:
        self.changes += 1
        self._vehicle.params.set("MIS_TOTAL", len(self.items))

    def add_home(self) -> None:
        """Store home as the first item (AP_Mission::write_home_to_storage)."""
        if self._counts_home and not self.items:
            self.items.append(self._home_item())
            self._changed()

    def _home_item(self) -> MissionItem:
        home = self._home() or Location(0, 0, 0)
        return MissionItem.at(Cmd.NAV_WAYPOINT, home)

    def count(self) -> int:
        """Return how many items there are, home among them."""
        return len(self.items)

    def get(self, seq: int) -> MissionItem | None:
        """Return an item; the first is always home, which is zeros while unset."""
        if seq == 0:
            return self._home_item()
        return self.items[seq] if seq < len(self.items) else None

    def begin(self, count: int | None) -> None:
        """Delete items beyond a number, as others will come."""
        if count is not None and len(self.items) > count:
            del self.items[count:]
            self._changed()

    def put(self, seq: int, item: MissionItem) -> bool:
        """Replace an item, or add one behind the last (AP_Mission::add_cmd, AP_Mission::replace_cmd)."""
        if seq == len(self.items):
            if len(self.items) >= MOST_MISSION_ITEMS:
                return False
            self.add_home()
            self.items.append(item)
        elif seq:
            self.items[seq] = item
        self._changed()
        return True

    def complete(self) -> bool:
        """Log all items, as they have come."""
        self.log_items()
        return True

    def abandon(self) -> None:
        """Do nothing: those that came are kept."""

    def clear(self) -> bool:
        """Delete all items, unless they are being flown; home returns when it is next set (AP_Mission::clear)."""
        if self._vehicle.copter.is_armed() and self.state is MissionState.RUNNING:
            return False
        self.begin(0)
        self._nav = self._do = None
        self._nav_is_loaded = self._do_is_loaded = False
        self.state = MissionState.STOPPED
        return True

    def log_items(self) -> None:
        """Write CMD of all items."""
        for seq in range(len(self.items)):
            self._log(CMD, Command(seq, self.get(seq) or MissionItem(0)))

    def _log(self, name: str, command: Command) -> None:
        self._vehicle.log.mission_item(name, len(self.items), command.seq, command.item)

    def tagged(self, tag: int) -> int:
        """Return the number of the first JUMP_TAG with a tag, 0 if there is none (get_index_of_jump_tag)."""
        tags = (seq for seq, item in enumerate(self.items) if item.command == Cmd.JUMP_TAG and item.params[0] == tag)
        return next((seq for seq in tags if seq), 0)

    # Where it is

    @property
    def nav_index(self) -> int:
        """The number of the current navigation command, 65535 if there is none."""
        return NO_INDEX if self._nav is None else self._nav.seq

    @property
    def nav_seq(self) -> int:
        """The same, but 0 if there is none."""
        return 0 if self._nav is None else self._nav.seq

    def is_present(self) -> bool:
        """Return whether there is more than home."""
        return len(self.items) > 1

    def _starts_at(self) -> int:
        resumes = self._vehicle.params.get_int("MIS_RESTART") == 0
        return self._nav.seq if resumes and self._nav is not None else FIRST

    def starts_with_takeoff(self) -> bool:
        """Return whether it goes on with a take-off (AP_Mission::starts_with_takeoff_cmd)."""
        return self._is_takeoff_next(self._starts_at())

    def continues_after_landing(self) -> bool:
        """Return whether MIS_OPTIONS lets a take-off follow a landing (continue_after_land_check_for_takeoff)."""
        continues = self._option(OPTION_CONTINUE_AFTER_LAND) and self._nav is not None
        return continues and self._is_takeoff_next(self.nav_seq + 1)

    def _is_takeoff_next(self, seq: int) -> bool:
        for number in range(seq, seq + MOST_BEFORE_TAKEOFF):
            found = self.next_nav(number)
            if found is None:
                return False
            if found.item.command not in _BEFORE_TAKEOFF:
                return found.item.command in _TAKEOFFS
        return False

    def note_reached(self, seq: int) -> None:
        """Let clients know that a command is done."""
        self.reached_seq, self._reached_is_new = seq, True

    def take_reached(self) -> bool:
        """Tell, once, that a command was done."""
        is_new, self._reached_is_new = self._reached_is_new, False
        return is_new

    # How it goes on

    def wait_to_start(self) -> None:
        """Be ready to start (ModeAuto::init)."""
        self.waits = True

    def start_unless_running(self) -> None:
        """Start or resume, unless it runs (handle_MAV_CMD_MISSION_START)."""
        if self.crew is not None and self.state is not MissionState.RUNNING:
            self.start_or_resume()

    def start_or_resume(self) -> None:
        """Go on, or with MIS_RESTART begin with the first command."""
        if self._vehicle.params.get_int("MIS_RESTART") == 1:
            self.start()
        else:
            self.resume()

    def start(self) -> None:
        """Begin with the first command."""
        self.state = MissionState.RUNNING
        self.reset()
        if not self._advance_nav():
            self._complete()

    def stop(self) -> None:
        """Stop, as AUTO is left."""
        self.waits = False
        if self.state is MissionState.RUNNING:
            self.state = MissionState.STOPPED

    def resume(self) -> None:
        """Begin the current command again, or if there is none the mission."""
        if self.crew is None:
            return
        if self.state is MissionState.COMPLETE or self._nav is None or self.nav_seq >= len(self.items):
            self.start()
            return
        self.state = MissionState.RUNNING
        self._nav = Command(self._nav.seq, self.items[self._nav.seq])
        if self._do_is_loaded and self._do is not None:
            self.set_current(self._do.seq)
        elif self._nav_is_loaded:
            self.set_current(self._nav.seq)

    def reset(self) -> None:
        """Forget how far it has come."""
        self._nav_is_loaded = self._do_is_loaded = self._do_are_done = False
        self._nav = self._do = None
        self._jumps.clear()

    def set_current(self, seq: int) -> bool:
        """Go on with a command, at once if the mission runs; return whether that is possible (set_current_cmd)."""
        if seq >= len(self.items) or len(self.items) == 1:
            return False
        self._do = None
        self._do_is_loaded = self._do_are_done = self._nav_is_loaded = False
        if seq == 0 or self.state is MissionState.COMPLETE:
            self._jumps.clear()
            seq = seq or FIRST
        if self.state is MissionState.RUNNING:
            if not self._advance_nav(seq):
                self._complete()
                return False
            return True
        return self._find_current(seq)

    def _find_current(self, seq: int) -> bool:
        while not self._nav_is_loaded:
            found = self._next(seq, counts=True)
            if found is None:
                self._nav = None
                return False
            if found.item.is_nav:
                self._nav, self._nav_is_loaded = found, True
            elif not self._do_is_loaded:
                self._do, self._do_is_loaded = found, True
            seq = found.seq + 1
        self._do_are_done = not self._do_is_loaded
        self.state = MissionState.STOPPED
        return True

    def restart_nav(self) -> bool:
        """Begin the current navigation command again; return whether that was possible (restart_current_nav_cmd)."""
        if self.state is not MissionState.RUNNING or not 0 < self.nav_seq < len(self.items):
            return False
        return self.set_current(self.nav_seq)

    def update(self) -> None:
        """Go on to the next command where one is done (AP_Mission::update)."""
        if self.state is not MissionState.RUNNING or not self.items:
            return
        if self._nav_is_loaded and self._nav is not None and self._is_done(self._nav):
            self._nav_is_loaded = False
        if not self._nav_is_loaded and not self._advance_nav():
            self._complete()
            return
        if not self._do_is_loaded:
            self._advance_do()
        elif self._do is not None and self._is_done(self._do):
            self._do_is_loaded = False

    def _is_done(self, command: Command) -> bool:
        if command.item.command in IGNORED_COMMANDS or command.item.command == Cmd.DO_AUX_FUNCTION:
            return True
        return self.crew is None or self.crew.verify(command)

    def _begin(self, command: Command) -> bool:
        vehicle, number = self._vehicle, command.item.command
        if vehicle.params.get_int("LOG_BITMASK") & MASK_LOG_CMD:
            self._log(MISE, command)
        name = COMMAND_KINDS.get(number, UNKNOWN_COMMAND).name
        more = " 0" if number == Cmd.JUMP_TAG else ""
        vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Mission: {command.seq} {name}{more}")
        return number in IGNORED_COMMANDS or (self.crew is not None and self.crew.start(command))

    def _complete(self) -> None:
        self.state = MissionState.COMPLETE
        if self.crew is not None:
            self.crew.end()

    def _advance_nav(self, first: int = 0) -> bool:
        """Begin the next navigation command; return whether there is one (AP_Mission::advance_current_nav_cmd)."""
        if self.state is not MissionState.RUNNING or self._nav_is_loaded:
            return False
        self._do = None
        self._do_is_loaded = self._do_are_done = False
        seq = first or (FIRST if self._nav is None else self._nav.seq + 1)
        for _ in range(MOST_LOOPS):
            found = self._next(seq, counts=True)
            if found is None:
                return False
            if found.item.is_nav:
                self._nav = found
                self._nav_is_loaded = self._begin(found)
            elif not self._do_is_loaded:
                self._do, self._do_is_loaded = found, True
                self._begin(found)
            if self._nav_is_loaded:
                self._do_are_done = not self._do_is_loaded
                return True
            seq = found.seq + 1
        return False

    def _advance_do(self) -> None:
        """Begin the next command that is done on the way (AP_Mission::advance_current_do_cmd)."""
        if self._do_are_done:
            return
        found = self._next(FIRST if self._do is None else self._do.seq + 1)
        if found is None or found.item.is_nav:
            self._do_are_done = True
            return
        self._do, self._do_is_loaded = found, True
        self._begin(found)

    def next_nav(self, seq: int) -> Command | None:
        """Return the next navigation command from a number on, behind jumps (AP_Mission::get_next_nav_cmd)."""
        for number in range(seq, len(self.items)):
            found = self._next(number)
            if found is None or found.item.is_nav:
                return found
        return None

    def _next(self, seq: int, *, counts: bool = False) -> Command | None:
        """Return the next command from a number on that is no jump (AP_Mission::get_next_cmd).

        ``counts``: jumps on the way there count as done.
        """
        jumps, first_jump = 0, None
        while seq < len(self.items):
            item = self.get(seq) or MissionItem(0)
            if item.command not in (Cmd.DO_JUMP, Cmd.DO_JUMP_TAG):
                return Command(seq, item)
            jumps += 1
            target = int(item.params[0])
            if item.command == Cmd.DO_JUMP_TAG:
                target = self.tagged(target)
            is_endless = not counts and first_jump == seq
            if jumps > MOST_JUMPS or not 0 < target < len(self.items) or is_endless:
                return None
            first_jump = seq if first_jump is None else first_jump
            seq = target if self._jumps_from(seq, int(item.params[1]), counts=counts) else seq + 1
        return None

    def _jumps_from(self, seq: int, times: int, *, counts: bool) -> bool:
        done = self._jumps.get(seq, 0)
        if times != REPEAT_FOR_EVER and done >= times:
            if counts and self._vehicle.release.repeats_jumps and not self._option(OPTION_KEEP_JUMP_COUNTS):
                self._jumps[seq] = 0
            return False
        if counts:
            self._jumps[seq] = done + 1
            limit = "unlimited" if times == REPEAT_FOR_EVER else str(times)
            self._vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"Mission: {seq} Jump {done + 1}/{limit}")
        return True
