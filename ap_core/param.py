# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameter system as ground stations see it: one flat list over the groups of all objects.

Source: AP_Param/AP_Param.cpp and GCS_MAVLink/GCS_Param.cpp. There is no storage here: ``stored_values`` and
``load_stored`` carry values over a restart. Work of the firmware's I/O thread happens at once.
"""

import logging
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, Generic, TypeVar

import numpy as np

from ap_core.fmath import NAN
from ap_core.param_group import ParamGroup, ParamSlot
from ap_core.param_info import (
    ParamFlag,
    ParamInfo,
    ParamType,
    ParamValue,
    assigned,
    from_wire,
    is_equal,
    is_within_hundredth_percent,
    to_f32,
)

T = TypeVar("T")

__all__ = [
    "NO_INDEX",
    "Param",
    "ParamEcho",
    "ParamFlag",
    "ParamGroup",
    "ParamInfo",
    "ParamOutcome",
    "ParamSet",
    "ParamTable",
    "ParamType",
]

_log = logging.getLogger(__name__)

_FORMAT_VERSION: Final = "FORMAT_VERSION"

NO_INDEX: Final = 65535
"""``param_index`` of a parameter that was not found by its index."""


@dataclass(frozen=True, slots=True)
class Param:
    """A reading of one parameter.

    ``name`` has the requested spelling, ``canonical_name`` that of the list. ``value`` is the MAVLink value, ``raw``
    the stored one (an int32 may need more digits than float32 has). ``index`` is NO_INDEX
    when the parameter was found by name.
    """

    name: str
    type: ParamType
    value: np.float32
    default: np.float32
    index: int
    canonical_name: str
    raw: ParamValue


class ParamOutcome(Enum):
    """Outcome of a PARAM_SET."""

    SET = "set"
    UNKNOWN = "unknown parameter"
    NOT_FINITE = "value is NaN or infinite"
    READ_ONLY = "read-only"


@dataclass(frozen=True, slots=True)
class ParamEcho:
    """One PARAM_VALUE that a PARAM_SET causes; ``wire_type`` is its MAV_PARAM_TYPE."""

    name: str
    value: np.float32
    wire_type: int


@dataclass(frozen=True, slots=True)
class ParamSet:
    """Result of a PARAM_SET.

    With SET the echoes go to every active link, with READ_ONLY the single echo goes to the requester.
    ``previous`` and ``value`` are the values before and after; NaN for an unknown parameter and for a whole vector.
    """

    outcome: ParamOutcome
    previous: np.float32 = NAN
    value: np.float32 = NAN
    echoes: tuple[ParamEcho, ...] = ()


class ParamTable:
    """All parameters of a vehicle in list order.

    Attributes:
        generation: number of stores so far; values derived from parameters stay valid until it grows.
        stored_generation: number of changes to the values that persist over a restart.
        on_change: called after each store. A listener may only discard derived values: other listeners may be called
            later.
    """

    def __init__(self, groups: Sequence[ParamGroup]) -> None:
        """Build the list over ``groups``, whose values stay live.

        Raises ValueError if two parameters have the same name.
        """
        self.groups = tuple(groups)
        self.generation = 0
        self.stored_generation = 0
        self.on_change: list[Callable[[], None]] = []
        for group in self.groups:
            group.on_change.append(self._note_change)
        self._by_name: dict[str, ParamSlot] = {}
        for slot in (slot for group in self.groups for slot in group.slots):
            if slot.name in self._by_name:
                raise ValueError(f"{slot.name}: defined twice")
            self._by_name[slot.name] = slot
        self._stored: dict[str, ParamValue] = {}
        self._file_defaults: dict[str, tuple[np.float32, bool]] = {}
        self._listed: tuple[ParamSlot, ...] = ()
        self._listed_when: tuple[bool, ...] | None = None

    def _note_change(self) -> None:
        self.generation += 1
        for listener in self.on_change:
            listener()

    def _listing(self) -> tuple[ParamSlot, ...]:
        enabled = tuple(group.enabled for group in self.groups)
        if enabled != self._listed_when:
            self._listed = tuple(slot for group in self.groups for slot in group.listed_slots)
            self._listed_when = enabled
        return self._listed

    @property
    def count(self) -> int:
        """The number of listed parameters at this moment (AP_Param.cpp, count_parameters)."""
        return len(self._listing())

    def __iter__(self) -> Iterator[Param]:
        return (self._param(slot, index) for index, slot in enumerate(self._listing()))

    def by_index(self, index: int) -> Param | None:
        """Return a listed parameter, or None outside 0..count-1 (AP_Param.cpp, find_by_index)."""
        listing = self._listing()
        return self._param(listing[index], index) if 0 <= index < len(listing) else None

    def find(self, name: str) -> Param | None:
        """Return a parameter by name, listed or not, with the spelling rules of ParamGroup.match.

        The name of a vector gives a FLOAT with value NaN. Source: AP_Param.cpp, find.
        """
        match = self._match(name)
        if match is None:
            return None
        slot, whole_vector = match
        if whole_vector:
            canonical = slot.group.prefix + slot.row.name
            return Param(name, ParamType.FLOAT, NAN, NAN, NO_INDEX, canonical, NAN)
        return self._param(slot, NO_INDEX, name)

    def _match(self, name: str) -> tuple[ParamSlot, bool] | None:
        slot = self._by_name.get(name)  # the usual spelling
        if slot is not None:
            return slot, False
        if not name.isascii():  # the firmware folds the case of ASCII letters only
            return None
        return next((match for group in self.groups if (match := group.match(name)) is not None), None)

    def _param(self, slot: ParamSlot, index: int, spelled: str | None = None) -> Param:
        name = slot.name
        return Param(
            name=spelled or name,
            type=slot.type,
            value=slot.value,
            default=self._default(slot),
            index=index,
            canonical_name=name,
            raw=slot.raw,
        )

    def _default(self, slot: ParamSlot) -> np.float32:
        from_file = self._file_defaults.get(slot.name)
        return slot.group.default(slot) if from_file is None else from_file[0]

    def _named(self, name: str) -> ParamSlot:
        slot = self._by_name.get(name)
        if slot is None:
            raise ValueError(f"{name}: no such parameter")
        return slot

    def get_int(self, name: str) -> int:
        """Return an integer parameter by its canonical full name; ValueError when there is none."""
        slot = self._named(name)
        return slot.group.get_int(slot.key)

    def get_float(self, name: str) -> np.float32:
        """Return a float parameter by its canonical full name; ValueError when there is none."""
        slot = self._named(name)
        return slot.group.get_float(slot.key)

    def get_number(self, name: str) -> float:
        """Return any parameter by its canonical full name; ValueError when there is none."""
        return float(self._named(name).value)

    def set(self, name: str, value: float | np.float32) -> None:
        """Set a parameter in memory by its canonical full name, as ParamGroup.set does."""
        slot = self._named(name)
        slot.group.set(slot.key, value)

    def group(self, prefix: str) -> ParamGroup:
        """Return the first group with that prefix; ValueError when there is none."""
        for group in self.groups:
            if group.prefix == prefix:
                return group
        raise ValueError(f"{prefix}: no such parameter group")

    def set_from_mavlink(self, name: str, value: float | np.float32) -> ParamSet:
        """Do what a PARAM_SET does, and return what to send (GCS_Param.cpp, handle_param_set).

        The packet's type is ignored, and documented ranges are not enforced.
        """
        match = self._match(name)
        if match is None:
            return ParamSet(ParamOutcome.UNKNOWN)
        slot, whole_vector = match
        requested = to_f32(value)
        previous = NAN if whole_vector else slot.value
        if not np.isfinite(requested):
            return ParamSet(ParamOutcome.NOT_FINITE, previous, previous)
        if self._is_read_only(slot):
            echo = ParamEcho(name, previous, slot.type.wire_type)
            return ParamSet(ParamOutcome.READ_ONLY, previous, previous, (echo,))
        if not whole_vector:  # the firmware cannot set all three at once, yet it saves them
            slot.group.store(slot.key, from_wire(requested, slot.type))
        echoes = self._save(slot, force=not is_equal(requested, previous))
        return ParamSet(ParamOutcome.SET, previous, NAN if whole_vector else slot.value, echoes)

    def _is_read_only(self, slot: ParamSlot) -> bool:
        return ParamFlag.READ_ONLY in slot.row.flags or self._file_defaults.get(slot.name, (NAN, False))[1]

    def _save(self, slot: ParamSlot, force: bool) -> tuple[ParamEcho, ...]:
        """Store a parameter unless it has its default, and return the echoes (AP_Param.cpp, save_sync)."""
        if slot.name not in self._stored and not force and self._is_default(slot):
            # The echo takes its type from the top-level entry, which for a member is the group itself.
            wire_type = slot.type.wire_type if slot.group.ungrouped else ParamType.FLOAT.wire_type
            echoes: tuple[ParamEcho, ...] = (ParamEcho(slot.name, self._default(slot), wire_type),)
        else:
            self.stored_generation += 1
            self._stored.update((sibling.name, sibling.raw) for sibling in slot.siblings)
            # The save of a first element looks like the save of its vector, and all three are sent.
            saved = slot.siblings if slot.axis == 0 else (slot,)
            echoes = tuple(ParamEcho(one.name, one.value, one.type.wire_type) for one in saved)
        return () if ParamFlag.HIDDEN in slot.row.flags else echoes

    def _is_default(self, slot: ParamSlot) -> bool:
        if slot.row.type is ParamType.VECTOR3F:
            return False
        value, default = slot.value, self._default(slot)
        if is_equal(value, default):
            return True
        return slot.type is not ParamType.INT32 and is_within_hundredth_percent(value, default)

    def stored_values(self) -> dict[str, float]:
        """Return the values that persist over a restart, by canonical full name."""
        return {name: value if isinstance(value, int) else float(value) for name, value in self._stored.items()}

    def forget_stored(self) -> None:
        """Erase stored values, so that a restart begins with defaults; values stay until then (AP_Param::erase_all)."""
        self.stored_generation += 1
        self._stored.clear()

    def load_stored(self, values: Mapping[str, float | np.float32]) -> list[str]:
        """Load stored values at start-up and return the names that no longer exist.

        Raises ValueError for a value that its type cannot take.
        """
        unknown = [name for name in values if name not in self._by_name]
        for name in values.keys() - set(unknown):
            slot = self._by_name[name]
            raw = assigned(values[name], slot.type)
            self._stored[name] = raw
            slot.group.store(slot.key, raw)
        return unknown

    def apply_defaults(
        self, values: Mapping[str, float | np.float32], source: str, *, read_only: Collection[str] = ()
    ) -> list[str]:
        """Apply a defaults file and return the unknown names.

        A value becomes the parameter's default, and its value unless one is stored. Of several files the last
        one gives the value and, as in the firmware, the first one the default. FORMAT_VERSION is skipped.
        Source: AP_Param.cpp, load_defaults_file and get_default_value.

        Args:
            values: numbers by name, in any spelling that ``find`` understands.
            source: the file's name, for the log.
            read_only: names among ``values`` that MAVLink may not set.

        Raises:
            ValueError: a NaN or infinite value.
        """
        unknown = []
        for name, value in values.items():
            if name == _FORMAT_VERSION:
                continue
            match = self._match(name)
            if match is None:
                _log.info("%s: unknown parameter %s ignored", source, name)
                unknown.append(name)
            else:
                self._apply_default(*match, to_f32(value), name in read_only)
        return unknown

    def _apply_default(self, slot: ParamSlot, whole_vector: bool, value: np.float32, read_only: bool) -> None:
        if not np.isfinite(value):
            raise ValueError(f"{slot.name}: default is not finite")
        self._file_defaults.setdefault(slot.name, (value, read_only))
        if not whole_vector and slot.name not in self._stored:
            slot.group.store(slot.key, from_wire(value, slot.type))


class FromParams(Generic[T]):
    """A cached value that depends on parameters alone; call the object to get the value.

    Args:
        work_out: computes the value; called at the first use, and at the first use after any parameter was stored.
    """

    def __init__(self, params: ParamTable, work_out: Callable[[], T]) -> None:
        self._params = params
        self._work_out = work_out
        self._generation: int | None = None
        self._value: T

    def __call__(self) -> T:
        """Return the value for the present parameters."""
        if self._generation != self._params.generation:
            self._value = self._work_out()
            self._generation = self._params.generation
        return self._value


class Numbers(dict[str, float]):
    """Numbers by parameter name, each looked up once until a parameter changes.

    It is a dictionary that fills itself, because a dictionary lookup is fastest.

    Args:
        prefix: precedes each requested name.
        renamed: actual names of some requested names.
    """

    def __init__(self, params: ParamTable, prefix: str = "", renamed: Mapping[str, str] | None = None) -> None:
        super().__init__()
        self._renamed = dict(renamed or {})
        self._params = params
        self._prefix = prefix
        params.on_change.append(self._forget)

    def _forget(self) -> None:
        self.clear()

    def __missing__(self, name: str) -> float:
        """Look a parameter up by its name after the prefix; ValueError when there is none."""
        number = self[name] = self._params.get_number(self._prefix + self._renamed.get(name, name))
        return number
