# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's end of MAVLink without I/O: bytes and time in, bytes and events out.

Received bytes are handled inside the call that delivers them. The codec cuts frames out of the bytes, the routing table
decides who a frame is for, a row of ``HANDLERS`` handles it and returns a verdict, and the verdict is counted and
reported as an event. Output waits for ``poll``, which sends by due time and by a link's free space, as the firmware's
telemetry loop does. Nothing here reads a clock, opens a port, or raises because of received data. The same bytes at the
same times therefore get the same answers, in a test as on a wire.

Most of the 400 polls a second have nothing to do. Each poll therefore computes the time until which nothing is due
(``Rest``). New work ends that rest: a text, a changed parameter, any message but a pose.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

from ap_core.cint import u8, u32
from ap_core.fmath import ieee754
from ap_core.param import FromParams, ParamEcho
from ap_core.verdict import Verdict, VerdictKind
from mav_handlers.channel import Channel, Context, Rest, TransmitReserve
from mav_handlers.handlers import HANDLERS, VISION_MESSAGES
from mav_handlers.handlers.clocks import send_timesync, timesync_due_us
from mav_handlers.handlers.commands import MavCmd, MavResult
from mav_handlers.handlers.item_transfer import ItemTransfer
from mav_handlers.params.names import OPTION_PRIVATE
from mav_handlers.params.reads import NO_INDEX, ParamReads
from mav_handlers.radio import RadioLink
from mav_handlers.routing import RADIO_MESSAGES, TARGETED, RouteTable, target_fields
from mav_handlers.senders import gps_global_origin
from mav_handlers.senders.intervals import by_name, set_defaults
from mav_handlers.senders.sending import Sending
from mav_handlers.signing import SigningState
from mav_handlers.transfers.ftp import FtpReply, FtpServer
from mav_handlers.verdicts import (
    BAD_DATA_VERDICTS,
    FLOW_NOT_READ,
    NO_HANDLER,
    NOT_ACCEPTED,
    NOT_ADDRESSED,
    OWN_MESSAGE,
    UNKNOWN_MESSAGE,
    UNREAD_FLOW,
)
from mav_handlers.wire.codec import BadData, Codec, Header, Received
from mav_handlers.wire.messages import COMMAND_ACK, FILE_TRANSFER_PROTOCOL, PARAM_VALUE, Message

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

MAV_COMP_ID_AUTOPILOT1: Final = 1
EVENTS_KEPT: Final = 10_000
BAD_DATA_NAME: Final = "BAD_DATA"
UNKNOWN_NAME: Final = "UNKNOWN"
_MAV_SEVERITY_INFO: Final = 6


class MessageEvent(NamedTuple):
    """A handled frame. ``header`` is None for bytes that are no frame; ``now_us`` is since boot."""

    channel: int
    now_us: int
    name: str
    header: Header | None
    message: Message | None
    verdict: Verdict


class MavEndpoint:
    """The MAVLink endpoint of one vehicle, with any number of links.

    Give each link's bytes to ``receive_bytes``, call ``poll`` about 100 times per second, send what ``bytes_to_send``
    returns, and read what happened from ``next_event`` (``on_event`` is called at once). Received data never raises.

    Args:
        vehicle: the vehicle behind the endpoint.
        message_intervals: default intervals in ms by message id, by number of the link; 0 is off.
    """

    def __init__(self, vehicle: Vehicle, message_intervals: Mapping[int, Mapping[int, int]] | None = None) -> None:
        self._vehicle = vehicle
        self._message_intervals = message_intervals or {}
        params, names = vehicle.params, vehicle.release.params
        self._system_id = FromParams(params, lambda: u8(params.get_int(names.system_id)))
        self._only_gcs = FromParams(
            params, lambda: params.get_int(names.only_ground_station) & names.only_ground_station_bits != 0
        )
        self._private = self._private_of_channels()
        self.channels: list[Channel] = []
        self._events: deque[MessageEvent] = deque(maxlen=EVENTS_KEPT)
        self._echoes: deque[ParamEcho] = deque()
        self._has_polled = False
        self._polled_us = 0
        self._polled_generation = 0
        self._told_system_id: int | None = None
        self._texts_go_first = False
        self._reserve = TransmitReserve()
        self._rest = Rest()
        self.calibrating: tuple[Channel, Header] | None = None
        self.param_reads = ParamReads(tells_errors=vehicle.release.tells_param_errors)
        self.radio = RadioLink()
        self._sending = Sending(vehicle, self.param_reads, self.radio)
        self.routes = RouteTable()
        self.signing = SigningState(vehicle.signing_store, self._options)
        self.ftp = FtpServer(vehicle.files, vehicle.texts.send_text, lambda index: self.channels[index].has_room())
        self._log_transfer = vehicle.log_transfer
        self.item_transfers = {kind: ItemTransfer(vehicle, kind, items) for kind, items in vehicle.item_lists().items()}
        self.events_lost = 0
        self.on_event: Callable[[MessageEvent], None] | None = None
        vehicle.texts.listening_channels = self._listening_channels
        vehicle.texts.on_text.append(self._on_text)

    def open_channel(
        self, name: str, *, baud: int | None = None, version: int = 2, now_us: int = 0, port: int | None = None
    ) -> Channel:
        """Add a link.

        Args:
            name: the user's name for the link.
            baud: bits per second for the transport time of a UART; None for no delay.
            version: of MAVLink, 1 or 2.
            now_us: time since boot.
            port: the number of the port whose parameters apply, if it is not a port of its own: a further client of a
                server has those of the first.
        """
        codec = Codec(self._system_id(), MAV_COMP_ID_AUTOPILOT1, version)
        free = (channel.index for channel in self.channels if not channel.is_open)
        number = len(self.channels) if port is None else next(free, len(self.channels))
        port = number if port is None else port
        channel = Channel(
            number, name, codec, baud, reserve=self._reserve, rest=self._rest, port=port, timesync_sent_us=now_us
        )
        for former in self.channels[number : number + 1]:
            channel.counters = former.counters
        self.channels[number : number + 1] = [channel]
        self._rest.end()
        self._private = self._private_of_channels()
        self._told_system_id = None
        channel.card_intervals_ms = by_name(self._vehicle.release, self._message_intervals.get(port, {}))
        set_defaults(self._vehicle, channel, now_us)
        self.signing.open_link(channel)
        return channel

    def close_channel(self, channel: Channel) -> None:
        """Remove a client that has left, and its routes; another may get its number."""
        channel.close()
        self.routes.forget(channel.index)
        self._log_transfer.forget(channel.index)

    @ieee754
    def receive_bytes(self, channel: Channel, data: bytes, now_us: int, read_us: int | None = None) -> None:
        """Handle the bytes that a link delivered.

        Args:
            channel: the link.
            data: any bytes.
            now_us: time of handling, us since boot.
            read_us: time at which the bytes were read from the link, if earlier.
        """
        channel.codec.feed(data)
        channel.bytes_received += len(data)
        while (received := channel.codec.next_received()) is not None:
            self._dispatch(channel, received, now_us, now_us if read_us is None else read_us)
        if self._texts_go_first:
            self._send_first_texts()

    def _dispatch(self, channel: Channel, received: Received | BadData, now_us: int, read_us: int) -> None:
        header: Header | None
        message: Message | None
        if isinstance(received, BadData):
            header = message = None
            verdict = BAD_DATA_VERDICTS[received.reason]
            channel.packets_dropped += 1
            name, amount = BAD_DATA_NAME, received.length
        else:
            header, message = received
            channel.frames_received += 1
            verdict = self._handle(channel, header, message, now_us, read_us)
            # One name for all unknown ids: counting each of millions of ids would cost memory.
            name, amount = UNKNOWN_NAME if verdict is UNKNOWN_MESSAGE else header.name, 1
        channel.count(name, verdict, amount)
        event = MessageEvent(channel.index, now_us, name, header, message, verdict)
        if len(self._events) == EVENTS_KEPT:
            self.events_lost += 1
        self._events.append(event)
        if self.on_event is not None:
            self.on_event(event)

    def _handle(self, channel: Channel, header: Header, message: Message | None, now_us: int, read_us: int) -> Verdict:
        if message is None and header.name.startswith("UNKNOWN_"):
            # The firmware cannot check such a frame, and treats it as damaged.
            return UNKNOWN_MESSAGE
        if header.name not in RADIO_MESSAGES:
            channel.active = True
        refusal = self._route(channel, header, message)
        if refusal is not None:
            return refusal
        if self._only_gcs() and self._is_refused(header):
            return NOT_ACCEPTED
        handler = None if message is None else HANDLERS.get(type(message))
        if handler is None:
            return FLOW_NOT_READ if header.name in UNREAD_FLOW else NO_HANDLER
        if type(message) not in VISION_MESSAGES:  # which are for the port alone
            self._rest.end()
        return handler(Context(self._vehicle, channel, header, now_us, read_us), message)

    def _route(self, channel: Channel, header: Header, message: Message | None) -> Verdict | None:
        """Learn the sender's route and forward the frame; return a verdict if it is not for the autopilot."""
        system_id = self._system_id()
        if header.system_id == system_id and header.component_id == MAV_COMP_ID_AUTOPILOT1:
            return OWN_MESSAGE
        self.routes.learn(header, message, channel.index, own_system=system_id)
        if len(self.channels) == 1 and header.message_id not in TARGETED:  # the frame is for us, and for nobody else
            return None
        routing = self.routes.decide(
            header,
            *target_fields(header),
            channel.index,
            own_system=system_id,
            is_private=self._private().__getitem__,
            is_active=self._is_active,
            channels=range(len(self.channels)),
        )
        for index in routing.forward_to:
            self.channels[index].forward(header.frame)
        return None if routing.process_locally else NOT_ADDRESSED

    def _is_refused(self, header: Header) -> bool:
        is_gcs = self._vehicle.release.params.is_ground_station(self._vehicle.params, header.system_id)
        return not is_gcs and header.system_id != self._system_id() and header.name not in RADIO_MESSAGES

    def next_event(self) -> MessageEvent | None:
        """Return the oldest event not yet taken, or None; the newest 10000 are kept."""
        return self._events.popleft() if self._events else None

    def bytes_to_send(self, channel: Channel) -> bytes:
        """Return the output of a link and clear it."""
        return channel.take_output()

    def request_message(self, channel: Channel, name: str) -> None:
        """Queue a message to be sent once at the next poll."""
        channel.request(name)

    def request_message_everywhere(self, name: str) -> None:
        """Queue a message to be sent once at the next poll, on every link."""
        for channel in self.channels:
            channel.request(name)

    def send_origin(self, channel: Channel, now_us: int) -> None:
        """Send GPS_GLOBAL_ORIGIN at once, if there is an origin."""
        reply = gps_global_origin(self._vehicle, channel, now_us)
        if reply is not None:
            channel.send(reply)

    def send_texts_first(self) -> None:
        """Send waiting texts after the present bytes are handled, before the output of the next poll."""
        self._texts_go_first = True
        self._rest.end()

    def _send_first_texts(self) -> None:
        self._texts_go_first = False
        self._vehicle.texts.service(self.channels)

    def echo_parameters(self, echoes: Iterable[ParamEcho]) -> None:
        """Queue the echoes of a changed parameter for every active link."""
        self._echoes.extend(echoes)
        self._rest.end()

    def send_banner(self, channel: Channel) -> None:
        """Send the banner texts to one link (GCS_MAVLINK::send_banner)."""
        for line in self._vehicle.banner():
            self._vehicle.texts.send_text_to(channel.index, _MAV_SEVERITY_INFO, line)

    def send_ftp_replies(self, replies: Iterable[FtpReply]) -> None:
        """Send each reply of the file server to its client."""
        for reply in replies:
            channel, peer = self.channels[reply.peer.channel], reply.peer
            channel.send(FILE_TRANSFER_PROTOCOL(0, peer.system_id, peer.component_id, tuple(reply.payload)))
            if reply.banner:
                self.send_banner(channel)

    def pump_log_transfer(self, channel: Channel, now_us: int) -> None:
        """Send the next part of a log list or a log, as far as it fits on the link."""
        if channel.has_room():
            armed, heartbeat_us = self._vehicle.copter.is_armed(), channel.heartbeat_sent_us
            channel.send(*self._log_transfer.pump(channel.index, now_us, armed=armed, heartbeat_us=heartbeat_us))

    def conclude(self) -> None:
        """Acknowledge a calibration that was in progress, as once a second (GCS_MAVLINK_InProgress::check_tasks)."""
        if self.calibrating is not None:
            channel, asker = self.calibrating
            sender = asker.system_id, asker.component_id
            channel.send(COMMAND_ACK(MavCmd.PREFLIGHT_CALIBRATION, MavResult.ACCEPTED, 0, 0, *sender))
            self.calibrating = None

    def poll(self, now_us: int) -> None:
        """Send what is due: texts, parameters, periodic and requested messages."""
        last_us, self._polled_us = self._polled_us, now_us
        generation = self._vehicle.params.generation
        changed = self._vehicle.copter.take_changed()
        for name in changed:
            self.request_message_everywhere(name)
        if not changed and last_us <= now_us < self._rest.until_us and generation == self._polled_generation:
            return
        self._polled_generation = generation
        self._send_due(last_us, now_us)

    def idle_until_us(self) -> int:
        """Return the time before which ``poll`` has nothing to do unless new work arrives; 0 if it may have work."""
        return self._rest.until_us if self._vehicle.params.generation == self._polled_generation else 0

    def leave_out(self, now_us: int) -> None:
        """Record a poll that was skipped because nothing was due."""
        self._polled_us = now_us

    def _send_due(self, last_us: int, now_us: int) -> None:
        system_id = self._system_id()
        if system_id != self._told_system_id:
            self._told_system_id = system_id
            for channel in self.channels:
                channel.codec.system_id = system_id
        if self._texts_go_first:
            self._send_first_texts()
        if self._echoes:
            self._send_echoes()
        if self.ftp.busy:
            self.send_ftp_replies(self.ftp.continue_burst(now_us))
        self.signing.save_timestamp(self.channels, u32(now_us // 1000))
        self.param_reads.look_up(self._vehicle.params, last_us, now_us)
        for transfer in self.item_transfers.values():
            transfer.update(now_us)
        awaits_items = any(transfer.is_receiving for transfer in self.item_transfers.values())
        ftp_is_busy, private = self.ftp.slows_streams(now_us), self._private()
        for channel in self.channels:
            channel.awaits_items = awaits_items
            if not self._log_transfer.is_idle:
                self.pump_log_transfer(channel, now_us)
            if not private[channel.index]:
                send_timesync(channel, now_us, system_id)
            channel.ftp_is_busy = ftp_is_busy
            self._sending.run(channel, now_us)
        self._vehicle.texts.service(self.channels)
        self._has_polled = True
        self._rest.until_us = self._next_due_us(now_us)

    def _next_due_us(self, now_us: int) -> int:
        """Return the time until which nothing is due, 0 while anything waits for its turn or for room."""
        if self._has_work():
            return 0
        now_ms, private = now_us // 1000, self._private()
        waits_ms = [channel.wait_ms(now_ms) for channel in self.channels]
        waits_ms += self.ftp.speed_lasts_ms(now_us), self.signing.save_wait_ms(u32(now_ms))
        questions_us = [timesync_due_us(channel) for channel in self.channels if not private[channel.index]]
        transfers_us = [
            due_us for transfer in self.item_transfers.values() if (due_us := transfer.due_us()) is not None
        ]
        return min([(now_ms + min(waits_ms)) * 1000, *questions_us, *transfers_us])

    def _has_work(self) -> bool:
        return (
            self.ftp.busy
            or bool(self._echoes or self.param_reads.waiting)
            or self._texts_go_first
            or not self._log_transfer.is_idle
            or not self._vehicle.texts.is_empty
        )

    def _options(self, port: int) -> int:
        return self._vehicle.release.params.link_options(self._vehicle.params, port)

    def _private_of_channels(self) -> FromParams[list[bool]]:
        return FromParams(
            self._vehicle.params,
            lambda: [self._options(channel.port) & OPTION_PRIVATE != 0 for channel in self.channels],
        )

    def _is_active(self, index: int) -> bool:
        return self.channels[index].active

    def _is_private(self, channel: Channel) -> bool:
        return self._private()[channel.index]

    def _send_echoes(self) -> None:
        while self._echoes:
            echo = self._echoes.popleft()
            self._vehicle.log.parameter(echo.name, echo.value)
            count = self._vehicle.params.count
            for channel in self.channels:
                if channel.active and not self._is_private(channel):
                    channel.send(PARAM_VALUE(echo.name, float(echo.value), echo.wire_type, count, NO_INDEX))

    def _listening_channels(self) -> set[int] | None:
        if not self._has_polled:
            return None
        return {
            channel.index
            for channel in self.channels
            if (channel.active or channel.streaming) and not self._is_private(channel)
        }

    def _on_text(self, _severity: int, _text: str) -> None:
        self._rest.end()
        # While booting, requests do not wait for the telemetry loop.
        if self._has_polled and not self._vehicle.copter.has_booted:
            self._vehicle.texts.service(self.channels)

    def verdict_counts(self) -> dict[tuple[str, VerdictKind, str], int]:
        """Return the number of messages by type and verdict, over all links."""
        total: dict[tuple[str, VerdictKind, str], int] = {}
        for channel in self.channels:
            for key, amount in channel.counters.items():
                total[key] = total.get(key, 0) + amount
        return total
