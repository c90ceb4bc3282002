# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the message classes have in common: dataclasses with slots, frozen, which share their methods.

``dataclass(frozen=True, slots=True)`` compiles six methods a class. For all messages together that took a sixth of the
time in which an autopilot starts, and what it compiles stores fields more slowly than is done here.
"""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, FrozenInstanceError, dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Final, NoReturn, TypeVar, dataclass_transform


class Message:
    """Base of all messages; the class name is MAVLink's name of the message."""

    __slots__ = ()

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    _names: ClassVar[tuple[str, ...]] = ()
    _puts: ClassVar[tuple[Callable[["Message", Any], None], ...]] = ()
    _defaults: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, *values: Any, **named: Any) -> None:
        puts = self._puts
        if named or len(values) != len(puts):
            values = self._completed(values, named)
        for put, value in zip(puts, values):  # noqa: B905  # as many by now
            put(self, value)

    @classmethod
    def _completed(cls, values: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
        """Return the values of all fields; raise TypeError, as of any function, for those that do not fit."""
        rest = cls._names[len(values) :]
        if len(values) + len(named) == len(cls._names) and all(map(named.__contains__, rest)):
            return (*values, *map(named.__getitem__, rest))
        given = {**cls._defaults, **named}
        missing = [name for name in rest if name not in given]
        unknown = [name for name in named if name not in rest]
        if missing or unknown or len(values) > len(cls._names):
            raise TypeError(f"{cls.__name__}: {len(values)} values, missing {missing}, no place for {unknown}")
        return (*values, *[given[name] for name in rest])

    def _values(self) -> tuple[Any, ...]:
        return tuple([getattr(self, name) for name in self._names])

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in self._names)
        return f"{type(self).__qualname__}({shown})"

    def __reduce__(self) -> tuple[type["Message"], tuple[Any, ...]]:
        return type(self), self._values()

    if not TYPE_CHECKING:  # what a type checker knows of frozen dataclasses says more

        def __setattr__(self, name: str, _value: object) -> NoReturn:
            raise FrozenInstanceError(f"cannot assign to field {name!r}")

        def __delattr__(self, name: str) -> NoReturn:
            raise FrozenInstanceError(f"cannot delete field {name!r}")


_M = TypeVar("_M", bound=Message)

MESSAGES: Final[dict[str, type[Message]]] = {}
"""All message classes by name."""

Values = tuple[Any, ...]


def maker_of(cls: type[_M], pick: Callable[[Values], Values]) -> Callable[[Values], _M]:
    """Return what makes a message of values from which the fields, all of them in their order, are picked."""
    # Fields of a twin that is not frozen are stored by instructions of the interpreter, ten times as fast as by calls.
    slots = [name for name in cls._names if name in vars(cls)]
    thawed = {"__slots__": slots, "__setattr__": object.__setattr__, "__delattr__": object.__delattr__}
    twin = type("Twin", cls.__bases__, thawed)
    known: dict[str, Any] = {"new": object.__new__, "twin": twin, "cls": cls, "pick": pick}
    targets = ", ".join(f"made.{name}" for name in cls._names)
    text = f"""
def make(values):
    made = new(twin)
    {targets}, = pick(values)
    made.__class__ = cls
    return made
"""
    exec(text, known)
    make: Callable[[Values], _M] = known["make"]
    return make


@dataclass_transform(frozen_default=True)
def message(cls: type[_M]) -> type[_M]:
    """Make a message class of a class with annotated fields; with a leading ``_`` it is for others to inherit from."""
    made = dataclass(init=False, repr=False, eq=False, slots=True)(cls)
    made._names = tuple(field.name for field in fields(made))
    made._puts = tuple(getattr(made, name).__set__ for name in made._names)
    made._defaults = {field.name: field.default for field in fields(made) if field.default is not MISSING}
    if not made.__name__.startswith("_"):
        MESSAGES[made.__name__] = made
    return made
