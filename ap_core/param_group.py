# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The live parameters of one object, as its ``var_info`` table describes them.

Source: AP_Param/AP_Param.cpp (find_group, next_group, setup_object_defaults).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

import numpy as np

from ap_core.param_info import MAX_NAME_SIZE, ParamFlag, ParamInfo, ParamType, ParamValue, assigned, to_f32
from ap_core.vector3 import Vector3f

_AXES: Final = ("_X", "_Y", "_Z")


@dataclass(frozen=True, slots=True, eq=False)
class ParamSlot:
    """The place of one number: a scalar parameter, or one element of a vector."""

    group: "ParamGroup" = field(repr=False)
    row: ParamInfo
    key: str
    axis: int

    @property
    def name(self) -> str:
        """The canonical full name."""
        return self.group.prefix + self.key

    @property
    def type(self) -> ParamType:
        """The type of the number; FLOAT for an element of a vector."""
        return ParamType.FLOAT if self.row.type is ParamType.VECTOR3F else self.row.type

    @property
    def raw(self) -> ParamValue:
        """The stored value."""
        return self.group.values[self.key]

    @property
    def value(self) -> np.float32:
        """The value in MAVLink's float32 (AP_Param.cpp, cast_to_float)."""
        return to_f32(self.raw)

    @property
    def siblings(self) -> tuple["ParamSlot", ...]:
        """The slots stored together with this one: all of a vector, or itself."""
        return self.group.slots_of(self.row)


class ParamGroup:
    """Live values of one object's parameters, addressed by the names in its table.

    A new group has its default values. ``top_level_prefix`` is the part of the prefix whose case must match:
    the name of the firmware's top-level entry, which is empty for objects that sit inside the vehicle (VISO,
    LOG, SERIAL). ``ungrouped`` marks parameters that are top-level entries themselves.
    """

    def __init__(
        self,
        prefix: str,
        var_info: Sequence[ParamInfo],
        *,
        defaults: Mapping[str, float] = MappingProxyType({}),
        top_level_prefix: str = "",
        ungrouped: bool = False,
    ) -> None:
        """Build the group with its defaults.

        Args:
            prefix: precedes the names of the rows, such as ``VISO``.
            var_info: the rows, in list order.
            defaults: other defaults for this vehicle, by row name (``_POS_X`` for elements of a vector).

        Raises:
            ValueError: names that are too long or unknown, or an ENABLE flag where it has no meaning.
        """
        self.prefix = prefix
        self.top_level_prefix = top_level_prefix
        self.ungrouped = ungrouped
        self.var_info = tuple(var_info)
        self._slots = {slot.key: slot for row in self.var_info for slot in self._make_slots(row)}
        self._rows = {row.name: row for row in self.var_info}
        self._check()
        self._defaults = {key: to_f32(value) for key, value in self._table_defaults()}
        for key, value in defaults.items():
            self._defaults[self._slot(key).key] = to_f32(value)
        self.values: dict[str, ParamValue] = {
            key: assigned(value, self._slots[key].type) for key, value in self._defaults.items()
        }
        """Stored values by key; written by ``store`` only."""
        self.on_change: list[Callable[[], None]] = []
        """Each is called after a value was stored, changed or not."""

    def _make_slots(self, row: ParamInfo) -> list[ParamSlot]:
        suffixes = _AXES if row.type is ParamType.VECTOR3F else ("",)
        return [ParamSlot(self, row, row.name + suffix, axis) for axis, suffix in enumerate(suffixes)]

    def _check(self) -> None:
        if not self.prefix.startswith(self.top_level_prefix):
            raise ValueError(f"{self.prefix}: does not start with {self.top_level_prefix}")
        for slot in self._slots.values():
            if len(slot.name) > MAX_NAME_SIZE:
                raise ValueError(f"{slot.name}: longer than {MAX_NAME_SIZE} characters")
        for index, row in enumerate(self.var_info):
            if ParamFlag.ENABLE in row.flags and (index > 0 or row.type is not ParamType.INT8):
                raise ValueError(f"{self.prefix}{row.name}: only a first row of type INT8 can enable a group")

    def _table_defaults(self) -> Iterator[tuple[str, float]]:
        for slot in self._slots.values():
            default = slot.row.default
            yield slot.key, default[slot.axis] if isinstance(default, tuple) else default

    def _slot(self, key: str) -> ParamSlot:
        slot = self._slots.get(key)
        if slot is None:
            raise ValueError(f"{self.prefix}{key}: no such scalar parameter")
        return slot

    def get_int(self, name: str) -> int:
        """Return the value of an integer parameter, by row name. Raises ValueError if there is none of that name."""
        value = self.values.get(name)
        if isinstance(value, int):
            return value
        raise ValueError(f"{self.prefix}{name}: no such integer parameter")

    def get_float(self, name: str) -> np.float32:
        """Return the value of a float parameter or an element of a vector (``_POS_X``), by row name.

        Raises ValueError if there is none of that name.
        """
        value = self.values.get(name)
        if type(value) is np.float32:
            return value
        raise ValueError(f"{self.prefix}{name}: no such float parameter")

    def get_vector(self, name: str) -> Vector3f:
        """Return the value of a vector, by row name. Raises ValueError if there is none of that name."""
        return Vector3f(*(slot.value for slot in self._vector_slots(name)))

    def set(self, name: str, value: float | np.float32 | Vector3f) -> None:
        """Set a value in memory as a C assignment does; nothing is stored or announced (AP_Param.h, set).

        A vector takes a Vector3f, or a number through the name of an element. Raises ValueError for an unknown
        parameter, or a value that its type cannot take.
        """
        if isinstance(value, Vector3f):
            for slot, element in zip(self._vector_slots(name), value.to_tuple(), strict=True):
                self.store(slot.key, element)
        else:
            self.store(name, assigned(value, self._slot(name).type))

    def store(self, key: str, value: ParamValue) -> None:
        """Store a value, already of the parameter's type, and call the listeners."""
        self.values[key] = value
        for listener in self.on_change:
            listener()

    def _vector_slots(self, name: str) -> tuple[ParamSlot, ...]:
        row = self._rows.get(name)
        if row is None or row.type is not ParamType.VECTOR3F:
            raise ValueError(f"{self.prefix}{name}: no such vector parameter")
        return self.slots_of(row)

    @property
    def enabled(self) -> bool:
        """False while the group's enabling parameter is 0, which hides the others from the list."""
        first = self.var_info[0] if self.var_info else None
        return first is None or ParamFlag.ENABLE not in first.flags or self.values[first.name] != 0

    @property
    def slots(self) -> tuple[ParamSlot, ...]:
        """All slots of the group, hidden ones included, in list order."""
        return tuple(self._slots.values())

    @property
    def listed_slots(self) -> tuple[ParamSlot, ...]:
        """The slots that the parameter list shows at present (AP_Param.cpp, next_group)."""
        listed = tuple(slot for slot in self.slots if ParamFlag.HIDDEN not in slot.row.flags)
        return listed if self.enabled else listed[:1]

    def slots_of(self, row: ParamInfo) -> tuple[ParamSlot, ...]:
        """Return the three elements of a vector's row, or the one slot of any other row."""
        if row.type is ParamType.VECTOR3F:
            return tuple(self._slots[row.name + suffix] for suffix in _AXES)
        return (self._slots[row.name],)

    def default(self, slot: ParamSlot) -> np.float32:
        """Return the default of one of this group's slots."""
        return self._defaults[slot.key]

    def match(self, name: str) -> tuple[ParamSlot, bool] | None:
        """Find a full name as the firmware does (AP_Param.cpp, find and find_group).

        The top-level prefix is case-sensitive, the rest is not. An element of a vector is found by the row's name as
        the table spells it and ``_X``, ``_Y`` or ``_Z``; further characters are ignored.

        Returns:
            The slot, and whether the name stands for a whole vector (the slot is then its first element).
        """
        top = len(self.top_level_prefix)
        nested = self.prefix[top:].lower()
        rest = name[top:]
        if not name.startswith(self.top_level_prefix) or not rest.lower().startswith(nested):
            return None
        tail = rest[len(nested) :]
        for row in self.var_info:
            if tail.lower() == row.name.lower():
                return self.slots_of(row)[0], row.type is ParamType.VECTOR3F
            if row.type is ParamType.VECTOR3F and tail.startswith(tuple(row.name + axis for axis in _AXES)):
                return self._slots[tail[: len(row.name) + 2]], False
        return None
