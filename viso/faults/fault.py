# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every kind of fault is, and its parameters: dataclass fields that are checked, by type and range, when made."""

import math
from abc import ABC, abstractmethod
from dataclasses import Field, dataclass, field, fields, replace
from enum import StrEnum
from random import Random
from typing import Any, ClassVar, get_args, get_origin

from viso.faults.packet import Packet, PassedOver, decode, pack


@dataclass(frozen=True, slots=True)
class Moment:
    """When a fault meets a frame, from its beginning on, and the fault's own source of chance."""

    since_us: int
    random: Random

    @property
    def since_s(self) -> float:
        return self.since_us / 1e6


@dataclass(slots=True)
class Fault(ABC):
    """A kind of fault with its parameters; what it remembers of a stream is in fields that are not parameters.

    ``sitl`` names the parameters of ArduPilot's simulator (libraries/SITL, SIM_Vicon) that do the same. A fault that
    ``lasts`` goes on from its ``at_s``; others happen then to one message. One for ``every_message`` is not only for
    those of external navigation unless told otherwise; one with ``for_messages`` is for those.
    """

    sitl: ClassVar[str] = ""
    lasts: ClassVar[bool] = False
    every_message: ClassVar[bool] = False
    for_messages: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Check every parameter and bring it into its own type. Raises ValueError, ``name: what``, for the first."""
        for one in parameters_of(self):
            try:
                setattr(self, one.name, _checked(one.type, getattr(self, one.name), one.metadata))
            except ValueError as error:
                raise ValueError(f"{one.name}: {error}") from None

    @property
    def goes_on(self) -> bool:
        """Return whether the next message is met without asking chance."""
        return False

    @abstractmethod
    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        """Return what becomes of a frame: nothing, itself, another in its place, or several.

        Raises:
            PassedOver: if there is nothing to be done with it.
        """


@dataclass(slots=True)
class ContentFault(Fault):
    """A fault of what a message says; the frame keeps its sequence number and the ids of its sender."""

    def act(self, packet: Packet, moment: Moment) -> tuple[Packet, ...]:
        """Return the frame with the changed message."""
        packet = decode(packet)
        changed = self.change(packet.message, moment)
        if changed is None:
            raise PassedOver("nothing in it to change")
        if changed == packet.message:
            return (packet,)
        return (pack(replace(packet, message=changed)),)

    @abstractmethod
    def change(self, message: Any, moment: Moment) -> Any:
        """Return the changed message, None if it holds nothing that this fault changes."""


def parameter(default: Any, low: float = -math.inf, high: float = math.inf, *, nan: bool = False) -> Any:
    """Return a dataclass field for a value, or several, from ``low`` to ``high``, both included; infinity never is."""
    return field(default=default, metadata={"range": (low, high), "nan": nan})


def parameters_of(fault: Any) -> tuple[Field[Any], ...]:
    """Return the fields of a fault, or of its class, that a timeline may give."""
    return tuple(one for one in fields(fault) if one.init)


def _checked(kind: Any, value: Any, metadata: Any) -> Any:
    if get_origin(kind) is tuple:
        if not isinstance(value, list | tuple) or not value:
            raise ValueError(f"{value!r} is no list, or an empty one")
        return tuple(_checked(get_args(kind)[0], one, metadata) for one in value)
    if kind in (int, float):
        return _number(kind, value, metadata)
    if issubclass(kind, StrEnum):
        if value not in list(kind):
            raise ValueError(f"{value!r} is none of {', '.join(kind)}")
        return kind(value)
    if type(value) is not kind:
        raise ValueError(f"{value!r} is no {'text' if kind is str else 'true or false'}")
    return value


def _number(kind: type[int] | type[float], value: Any, metadata: Any) -> int | float:
    number = as_number(value)
    low, high = metadata["range"]
    if math.isnan(number):
        if not metadata["nan"]:
            raise ValueError("not a number")
        return number
    if math.isinf(number) or not low <= number <= high:
        raise ValueError(f"{value!r} is not within {low:g} to {high:g}")
    if kind is int and number != int(number):
        raise ValueError(f"{value!r} is no whole number")
    return kind(value) if kind is int and type(value) is int else kind(number)


def as_number(value: Any) -> float:
    """Return a number of a timeline; YAML takes some, such as 1e6, for text. Raises ValueError if it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{value!r} is no number")
    try:
        return float(value)
    except (ValueError, OverflowError):
        raise ValueError(f"{value!r} is no number") from None
