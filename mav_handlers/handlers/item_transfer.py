# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The exchange of items of a mission, a fence or rally points, item by item.

A client announces how many items will come. They are then requested from it one after the other, and acknowledged
together. Meanwhile nobody else may read or write them.

Source: GCS_MAVLink/MissionItemProtocol.cpp and its three kinds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from ap_core.cint import u32
from mav_handlers.channel import Channel, Context
from mav_handlers.transfers.mission_items import (
    MOST_FENCE_ITEMS,
    MOST_MISSION_ITEMS,
    MOST_RALLY_POINTS,
    Cmd,
    ItemList,
    MissionItem,
    MissionResult,
    MissionType,
    in_degrees,
    kept_of_fence,
    kept_of_mission,
    kept_of_rally,
)
from mav_handlers.wire.messages import (
    MISSION_ACK,
    MISSION_COUNT,
    MISSION_ITEM_INT,
    MISSION_REQUEST,
    MISSION_WRITE_PARTIAL_LIST,
)

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

UPLOAD_TIMEOUT_MS: Final = 8000
REQUEST_AGAIN_MS: Final = 1000
_MAV_SEVERITY_WARNING: Final = 4
_MAV_SEVERITY_INFO: Final = 6


@dataclass(slots=True)
class _Upload:
    """An upload: who sends on which link, the item awaited and the last one, and times in ms."""

    channel: Channel
    sender: tuple[int, int]
    seq: int
    last: int
    received_ms: int
    requested_ms: int


class ItemTransfer:
    """The transfer of one kind of items.

    Args:
        vehicle: whose items they are.
        kind: which.
        items: the list of them.
    """

    def __init__(self, vehicle: Vehicle, kind: MissionType, items: ItemList) -> None:
        self._vehicle = vehicle
        self._kind = kind
        self._items = items
        self._upload: _Upload | None = None
        self._warned_of_item = self._warned_of_request = False
        self._most = {
            MissionType.MISSION: MOST_MISSION_ITEMS,
            MissionType.FENCE: MOST_FENCE_ITEMS,
            MissionType.RALLY: MOST_RALLY_POINTS,
        }[kind]

    @property
    def is_receiving(self) -> bool:
        """Whether items are being requested from a client."""
        return self._upload is not None

    def _keep(self, message: MISSION_ITEM_INT) -> MissionItem | MissionResult:
        if self._kind is MissionType.FENCE:
            return kept_of_fence(message)
        if self._kind is MissionType.RALLY:
            return kept_of_rally(message)
        return kept_of_mission(message, checks_delay=self._vehicle.release.checks_waypoint_delay)

    def _warn(self, text: str) -> None:
        self._vehicle.texts.send_text(_MAV_SEVERITY_WARNING, text)

    def acknowledge(self, ctx: Context, result: MissionResult) -> None:
        """Tell a sender the result."""
        ctx.channel.send(MISSION_ACK(*_sender(ctx), result, self._kind))

    def needs_mavlink2(self, ctx: Context) -> bool:
        """Refuse a message on a link of MAVLink 1, unless it is about a mission (mavlink2_requirement_met)."""
        if self._kind is MissionType.MISSION or ctx.channel.codec.version == 2:
            return False
        self._warn("Need mavlink2 for item transfer")
        self.acknowledge(ctx, MissionResult.UNSUPPORTED)
        return True

    # Reading

    def send_count(self, ctx: Context) -> None:
        """Tell how many items there are (handle_mission_request_list)."""
        if self.is_receiving:
            self.acknowledge(ctx, MissionResult.DENIED)
        else:
            self._count(ctx)

    def _count(self, ctx: Context) -> None:
        ctx.channel.send(MISSION_COUNT(*_sender(ctx), self._items.count(), self._kind))

    def send_item_in_units(self, ctx: Context, seq: int) -> None:
        """Send an item (handle_mission_request_int)."""
        if self.is_receiving:
            self.acknowledge(ctx, MissionResult.DENIED)
            return
        item = self._item(ctx, seq)
        if item is None:
            self._tell_of_no_item(ctx, seq, sends_count=True)
        else:
            ctx.channel.send(item)

    def send_item_in_degrees(self, ctx: Context, seq: int) -> None:
        """Send an item in float32, where degrees are accurate to metres only, and advise against it once a transfer.

        Source: MissionItemProtocol::handle_mission_request.
        """
        item = self._item(ctx, seq)
        if item is None:
            self._tell_of_no_item(ctx, seq, sends_count=False)
            return
        if not self._warned_of_request:
            self._warned_of_request = True
            self._warn("got MISSION_REQUEST; use MISSION_REQUEST_INT!")
        ctx.channel.send(in_degrees(item))

    def _item(self, ctx: Context, seq: int) -> MISSION_ITEM_INT | None:
        item = self._items.get(seq)
        if item is None:
            return None
        is_mission = self._kind is MissionType.MISSION
        # FIRMWARE PARITY: the firmware compares the command, not the item's number, with the current one's number.
        is_current = is_mission and item.command == self._vehicle.copter.mission.nav_index
        head = *_sender(ctx), seq, item.frame, item.command, int(is_current), int(is_mission)
        return MISSION_ITEM_INT(*head, *item.params, item.x, item.y, item.z, self._kind)

    def _tell_of_no_item(self, ctx: Context, seq: int, *, sends_count: bool) -> None:
        result = MissionResult.INVALID_SEQUENCE
        if self._vehicle.release.tells_bad_items_by_type:
            sends_count = self._kind is MissionType.MISSION
            if sends_count or (self._kind is MissionType.FENCE and seq == self._items.count()):
                result = MissionResult.ERROR
        if sends_count:
            self._count(ctx)
        self.acknowledge(ctx, result)

    # Writing

    def _cancel(self, ctx: Context) -> bool:
        """End an upload of the same sender; return whether there is none of anybody else (cancel_upload)."""
        if self._upload is not None and self._upload.sender != _sender(ctx):
            self.acknowledge(ctx, MissionResult.DENIED)
            return False
        if self._upload is not None:
            self._end()
        return True

    def _end(self) -> None:
        self._upload = None
        self._items.abandon()

    def clear(self, ctx: Context) -> None:
        """Delete all items (handle_mission_clear_all)."""
        cleared = self._cancel(ctx) and self._items.clear()
        self.acknowledge(ctx, MissionResult.ACCEPTED if cleared else MissionResult.ERROR)

    def receive(self, ctx: Context, count: int) -> None:
        """Begin to request items (handle_mission_count)."""
        if not self._cancel(ctx):
            return
        if count > self._most:
            self.acknowledge(ctx, MissionResult.NO_SPACE)
            self._warn(f"Only {self._most} items are supported")
            return
        self._items.begin(count)
        if count:
            self._request_all(ctx, 0, count - 1)
        else:
            self._complete(ctx.channel, _sender(ctx))

    def receive_part(self, ctx: Context, message: MISSION_WRITE_PARTIAL_LIST) -> None:
        """Begin to request items that replace some (handle_mission_write_partial_list)."""
        if self.is_receiving:
            self.acknowledge(ctx, MissionResult.DENIED)
            return
        count, first, last = self._items.count(), message.start_index, message.end_index
        if not 0 <= first <= last <= count:
            self._warn("Flight plan update rejected")
            self.acknowledge(ctx, MissionResult.ERROR)
            return
        self._items.begin(None)
        self._request_all(ctx, first, last)

    def _request_all(self, ctx: Context, first: int, last: int) -> None:
        now_ms = ctx.now_us // 1000
        self._upload = _Upload(ctx.channel, _sender(ctx), first, last, now_ms, now_ms)
        self._warned_of_item = self._warned_of_request = False
        self._request(self._upload, now_ms)
        ctx.channel.rest.end()

    def _request(self, upload: _Upload, now_ms: int) -> None:
        upload.channel.send(MISSION_REQUEST(*upload.sender, upload.seq, self._kind))
        upload.requested_ms = now_ms

    def advise_against_degrees(self) -> None:
        """Advise the sender of a MISSION_ITEM, once a transfer (send_mission_item_warning)."""
        if not self._warned_of_item:
            self._warned_of_item = True
            self._warn("got MISSION_ITEM; GCS should send MISSION_ITEM_INT")

    def take(self, ctx: Context, message: MISSION_ITEM_INT) -> None:
        """Keep an item that was requested, and request the next one (handle_mission_item)."""
        upload = self._upload
        if upload is None:
            self.acknowledge(ctx, MissionResult.ERROR)
            return
        result = MissionResult.INVALID_SEQUENCE
        if message.seq == upload.seq:
            result = self._put(upload, message) if _sender(ctx) == upload.sender else MissionResult.DENIED
            if result not in (MissionResult.ACCEPTED, MissionResult.DENIED):
                self._end()
        if result is not MissionResult.ACCEPTED:
            upload.channel.send(MISSION_ACK(*_sender(ctx), result, self._kind))
            return
        upload.received_ms = ctx.now_us // 1000
        upload.seq += 1
        if upload.seq > upload.last:
            self._complete(upload.channel, upload.sender)
        else:
            self._request(upload, upload.received_ms)

    def _put(self, upload: _Upload, message: MISSION_ITEM_INT) -> MissionResult:
        count = self._items.count()
        if message.seq > count:
            return MissionResult.ERROR
        item = self._keep(message)
        if isinstance(item, MissionResult):
            return item
        if item.command == Cmd.DO_JUMP and not 0 < item.params[0] <= max(count - 1, upload.last):
            return MissionResult.ERROR
        return MissionResult.ACCEPTED if self._items.put(message.seq, item) else MissionResult.ERROR

    def _complete(self, channel: Channel, sender: tuple[int, int]) -> None:
        if self._kind is MissionType.MISSION:
            self._vehicle.texts.send_text_to(channel.index, _MAV_SEVERITY_INFO, "Flight plan received")
        kept = self._items.complete()
        channel.send(MISSION_ACK(*sender, MissionResult.ACCEPTED if kept else MissionResult.ERROR, self._kind))
        self._end()

    def update(self, now_us: int) -> None:
        """Request an item again, or give an upload up (MissionItemProtocol::update)."""
        upload, now_ms = self._upload, now_us // 1000
        if upload is None:
            return
        if u32(now_ms - upload.received_ms) > UPLOAD_TIMEOUT_MS:
            name = "Mission" if self._kind is MissionType.MISSION else self._kind.name.capitalize()
            self._vehicle.texts.send_text_to(upload.channel.index, _MAV_SEVERITY_WARNING, f"{name} upload timeout")
            upload.channel.send(MISSION_ACK(*upload.sender, MissionResult.OPERATION_CANCELLED, self._kind))
            self._end()
        elif u32(now_ms - upload.requested_ms) > REQUEST_AGAIN_MS + upload.channel.stream_slowdown_ms:
            self._request(upload, now_ms)

    def due_us(self) -> int | None:
        """Return when ``update`` has something to do, us since boot; None while nothing is being received."""
        upload = self._upload
        if upload is None:
            return None
        again_ms = upload.requested_ms + REQUEST_AGAIN_MS + upload.channel.stream_slowdown_ms
        return 1000 * (min(again_ms, upload.received_ms + UPLOAD_TIMEOUT_MS) + 1)


def _sender(ctx: Context) -> tuple[int, int]:
    return ctx.header.system_id, ctx.header.component_id
