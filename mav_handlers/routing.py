# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which links a received frame is forwarded to, and whether the autopilot handles it itself.

Source: GCS_MAVLink/MAVLink_routing.cpp.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from mav_handlers.wire.codec import Header, target_offsets
from mav_handlers.wire.messages import HEARTBEAT, Message

MAX_ROUTES: Final = 20
RADIO_MESSAGES: Final = frozenset({"RADIO", "RADIO_STATUS"})
_MAV_COMP_ID_ALL: Final = 0
_MAV_COMP_ID_AUTOPILOT1: Final = 1
_BROADCAST: Final = (None, 0)
_V1_HEADER_BYTES: Final = 6
_V2_HEADER_BYTES: Final = 10
_OFFSETS: Final = target_offsets()
NO_TARGETS: Final = (None, None)
TARGETED: Final = frozenset(msg_id for msg_id, offsets in _OFFSETS.items() if offsets != NO_TARGETS)
"""Ids of the messages that have a target."""


def target_fields(header: Header) -> tuple[int | None, int | None]:
    """Return target_system and target_component of a frame, each None when its message has no such field.

    A field that the sender left out, as MAVLink 2 does with trailing zeros, is 0.

    Source: MAVLink_routing::get_targets.
    """
    if header.message_id not in TARGETED:
        return NO_TARGETS
    system_at, component_at = _OFFSETS[header.message_id]
    start = _V1_HEADER_BYTES if header.version == 1 else _V2_HEADER_BYTES
    payload = header.frame[start : start + header.frame[1]]
    return _byte_at(payload, system_at), _byte_at(payload, component_at)


def _byte_at(payload: bytes, offset: int | None) -> int | None:
    if offset is None:
        return None
    return payload[offset] if offset < len(payload) else 0


@dataclass(slots=True)
class Route:
    """A component heard on a link. ``vehicle_type`` is the MAV_TYPE of its first heartbeat, 0 until there is one."""

    system_id: int
    component_id: int
    channel: int
    vehicle_type: int


class Routing(NamedTuple):
    """Whether the autopilot handles a frame, and the links that it is forwarded to."""

    process_locally: bool
    forward_to: tuple[int, ...] = ()


class RouteTable:
    """The components heard on each link; at most 20 entries are stored."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int, int], Route] = {}

    @property
    def routes(self) -> tuple[Route, ...]:
        """The stored entries, oldest first."""
        return tuple(self._known.values())

    def forget(self, channel: int) -> None:
        """Remove the components heard on a link that has ended."""
        self._known = {place: route for place, route in self._known.items() if route.channel != channel}

    def learn(self, header: Header, message: Message | None, channel: int, *, own_system: int) -> None:
        """Store the link of a frame's sender, and its type from a heartbeat (MAVLink_routing::learn_route)."""
        place = header.system_id, header.component_id, channel
        route = self._known.get(place)
        if route is not None and not isinstance(message, HEARTBEAT):
            return
        own_ids = (_MAV_COMP_ID_ALL, _MAV_COMP_ID_AUTOPILOT1)
        if header.system_id == 0 or (header.system_id == own_system and header.component_id in own_ids):
            return
        vehicle_type = message.type if isinstance(message, HEARTBEAT) else 0
        if route is not None:
            route.vehicle_type = route.vehicle_type or vehicle_type
        elif len(self._known) < MAX_ROUTES:
            self._known[place] = Route(*place, vehicle_type)

    def decide(
        self,
        header: Header,
        target_system: int | None,
        target_component: int | None,
        channel: int,
        *,
        own_system: int,
        is_private: Callable[[int], bool],
        is_active: Callable[[int], bool],
        channels: Sequence[int],
    ) -> Routing:
        """Return the routing of a frame whose sender has been learned (MAVLink_routing::check_and_forward).

        The caller checks whether a link has room for the frame; a frame that does not fit counts as forwarded.

        Args:
            header: of the frame.
            target_system: the system it is addressed to; None when the message has no such field, 0 for all.
            target_component: the component it is addressed to, likewise.
            channel: number of the link it came on.
            own_system: the autopilot's system id.
            is_private: returns whether a link gets only frames that are addressed to its components.
            is_active: returns whether a frame other than a radio's has been received on a link.
            channels: numbers of all links.
        """
        if header.system_id == own_system and header.component_id == _MAV_COMP_ID_AUTOPILOT1:
            return Routing(process_locally=False)
        if header.name in RADIO_MESSAGES:
            return Routing(process_locally=True)
        if header.name == "HEARTBEAT":
            targets = self._heartbeat_targets(header, channel, channels, is_active) if not is_private(channel) else ()
            return Routing(True, tuple(target for target in targets if not is_private(target)))
        match_system = target_system in (*_BROADCAST, own_system)
        for_us = match_system and target_component in (*_BROADCAST, _MAV_COMP_ID_AUTOPILOT1)
        only_for_us = for_us and target_system not in _BROADCAST and target_component not in _BROADCAST
        if is_private(channel) or only_for_us:
            return Routing(for_us)
        forward_to = self._targets(target_system, target_component, channel, match_system, is_private, channels)
        process_locally = for_us or target_system in _BROADCAST or (match_system and not forward_to)
        # FIRMWARE PARITY: the firmware forwards SETUP_SIGNING like any other message. It carries the key in the clear,
        # so it stays on its link here.
        return Routing(process_locally, () if header.name == "SETUP_SIGNING" else forward_to)

    def _heartbeat_targets(
        self, header: Header, channel: int, channels: Sequence[int], is_active: Callable[[int], bool]
    ) -> tuple[int, ...]:
        """Return the links on which a heartbeat's sender has not been heard (MAVLink_routing::handle_heartbeat)."""
        sender = (header.system_id, header.component_id)
        heard_on = {route.channel for route in self._known.values() if (route.system_id, route.component_id) == sender}
        return tuple(link for link in channels if link != channel and link not in heard_on and is_active(link))

    def _targets(
        self,
        target_system: int | None,
        target_component: int | None,
        channel: int,
        match_system: bool,
        is_private: Callable[[int], bool],
        channels: Sequence[int],
    ) -> tuple[int, ...]:
        any_component = target_component in _BROADCAST or not match_system
        targets: list[int] = []
        for route in self._known.values():
            if route.channel == channel:
                continue
            exact = (route.system_id, route.component_id) == (target_system, target_component)
            addressed = target_system in _BROADCAST or (
                route.system_id == target_system and (any_component or route.component_id == target_component)
            )
            reachable = route.channel in channels and route.channel not in targets
            if addressed and reachable and (exact or not is_private(route.channel)):
                targets.append(route.channel)
        return tuple(targets)
