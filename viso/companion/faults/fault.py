# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every kind of fault is."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from random import Random
from typing import Any, ClassVar

from viso.companion.faults.packet import Packet, PassedOver, decode, pack
from viso.companion.faults.parameters import check_parameters


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
        check_parameters(self)

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
