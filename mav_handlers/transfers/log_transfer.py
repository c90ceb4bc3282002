# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Listing, downloading and erasing logs over MAVLink, without I/O: requests in, messages out.

Source: AP_Logger/AP_Logger_MAVLinkLogTransfer.cpp.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from ap_core.verdict import Verdict
from mav_handlers.verdicts import HANDLED, LOG_ARMED, LOG_BUSY, LOG_NOT_READY, LOG_REPEATED, LOG_UNKNOWN
from mav_handlers.wire.messages import LOG_DATA, LOG_ENTRY, Message

DATA_BYTES: Final = 90
"""Bytes of a log in one LOG_DATA."""

HEARTBEAT_PATIENCE_US: Final = 3_000_000
PACKETS_PER_PASS: Final = 40
"""LOG_DATA in one pass of the main loop, as in the simulator."""

_MAV_SEVERITY_ERROR: Final = 3
_MAV_SEVERITY_INFO: Final = 6


class LogReader(Protocol):
    """A log open for reading."""

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes from ``offset`` on, none after the end or an error; never raise."""

    def close(self) -> None:
        """Let go of the log; further calls do nothing."""


class LogLibrary(Protocol):
    """The vehicle's logs. No method raises because of a file."""

    def count(self) -> int:
        """Search for logs and return their number, 0..65535; ids run from 1, the oldest, until the next call."""

    def entry(self, log_id: int) -> tuple[int, int]:
        """Return size in bytes and UTC in s, 32 bits each; zeros for a log that is gone."""

    def open(self, log_id: int) -> LogReader:
        """Open a log for reading; one that is gone reads as empty."""

    def begin_transfer(self) -> None:
        """Close the log being written, and open none until ``end_transfer``."""

    def end_transfer(self) -> None:
        """Allow a new log."""

    def erase_all(self) -> None:
        """Close the log being written, and delete every log."""


@dataclass(slots=True)
class _Listing:
    channel_index: int
    next_id: int
    last_id: int
    num_logs: int


@dataclass(slots=True)
class _Sending:
    channel_index: int
    log_id: int
    offset: int
    remaining: int
    reader: LogReader | None


class LogTransfer:
    """The one log transfer of a vehicle, over all its links.

    After a request call ``pump`` for the same link at once, as the firmware sends the first messages while it handles
    the request; then call ``pump`` for every link once a pass of the main loop. ``send_text_to`` takes a link, a
    severity and a text.
    """

    def __init__(self, library: LogLibrary, send_text_to: Callable[[int, int, str], None]) -> None:
        self._library = library
        self._send_text_to = send_text_to
        self._job: _Listing | _Sending | None = None
        self._told_to_disarm = False

    @property
    def is_idle(self) -> bool:
        """Whether neither a log nor a list is being sent."""
        return self._job is None

    @property
    def is_active(self) -> bool:
        """Whether a log is being sent, which keeps the vehicle from arming; a list does not (in_log_download)."""
        return isinstance(self._job, _Sending)

    def refuse(self, channel_index: int, *, armed: bool, writes_enabled: bool) -> Verdict | None:
        """Refuse a link's requests while armed, with one text, or while booting (handle_log_message)."""
        if not writes_enabled:
            return LOG_NOT_READY
        if armed and not self._told_to_disarm:
            self._send_text_to(channel_index, _MAV_SEVERITY_ERROR, "Disarm for log download")
        self._told_to_disarm = armed
        return LOG_ARMED if armed else None

    def request_list(self, channel_index: int, start: int, end: int) -> Verdict:
        """Begin to list the logs from id ``start`` (0 counts as 1) to ``end`` (handle_log_request_list)."""
        if self._job is not None:
            return self._tell_busy(channel_index)
        num_logs = self._library.count()
        # FIRMWARE PARITY: the firmware waits for the counter to equal the end, so a start beyond it lists up to
        # 65535 and on from 0. Here such a request is clipped to one entry, the last one in range.
        last = min(max(end, 1), num_logs)
        self._job = _Listing(channel_index, min(max(start, 1), last), last, num_logs)
        return HANDLED

    def request_data(self, channel_index: int, log_id: int, ofs: int, count: int) -> Verdict:
        """Begin to send ``count`` bytes of a log from ``ofs`` on (handle_log_request_data).

        A request while this link's transfer runs is dropped without an answer: clients that fill gaps repeat it.

        Args:
            channel_index: the link that asks.
            log_id: 1, the oldest, to the number of logs.
            ofs: offset in bytes; beyond the end, an empty packet is sent.
            count: bytes wanted, cut at the end of the log as it is now.
        """
        if self._job is not None:
            return LOG_REPEATED if self._job.channel_index == channel_index else self._tell_busy(channel_index)
        if not 1 <= log_id <= self._library.count():
            return LOG_UNKNOWN
        # FIRMWARE PARITY: the firmware reads the size first and loses buffered records when it then closes the log.
        # Here the log is closed first, and sent to its last record.
        self._library.begin_transfer()
        size, _ = self._library.entry(log_id)
        remaining = min(max(size - ofs, 0), count)
        self._job = _Sending(channel_index, log_id, ofs, remaining, self._library.open(log_id))
        return HANDLED

    def forget(self, channel_index: int) -> None:
        """Stop the transfer of a link that has ended."""
        if self._job is not None and self._job.channel_index == channel_index:
            self.request_end()

    def request_end(self) -> Verdict:
        """Stop the transfer, whichever link began it (handle_log_request_end)."""
        self.pause()
        self._job = None
        return HANDLED

    def erase(self) -> Verdict:
        """Delete all logs, without an answer; a log being sent is sent to its end (handle_log_request_erase)."""
        self._library.erase_all()
        return HANDLED

    def _tell_busy(self, channel_index: int) -> Verdict:
        self._send_text_to(channel_index, _MAV_SEVERITY_INFO, "Log download in progress")
        return LOG_BUSY

    def pump(
        self,
        channel_index: int,
        now_us: int,
        *,
        armed: bool,
        heartbeat_us: int,
        max_packets: int = PACKETS_PER_PASS,
    ) -> list[Message]:
        """Return the messages to send on a link now: one LOG_ENTRY, or some LOG_DATA (handle_log_send).

        Returned messages count as sent. Nothing is due while the vehicle is armed, nor while the link waits for a
        heartbeat; ``heartbeat_us`` is the time of the last one since boot.
        """
        job = self._job
        if job is None or job.channel_index != channel_index:
            return []
        if armed:
            self.pause()
            return []
        if now_us - heartbeat_us > HEARTBEAT_PATIENCE_US or max_packets < 1:
            return []
        if isinstance(job, _Listing):
            return [self._next_entry(job)]
        return self._next_data(job, max_packets)

    def _next_entry(self, job: _Listing) -> LOG_ENTRY:
        size, time_utc_s = self._library.entry(job.next_id) if job.num_logs else (0, 0)
        message = LOG_ENTRY(job.next_id, job.num_logs, job.last_id, time_utc_s, size)
        job.next_id += 1
        if job.next_id > job.last_id:
            self.request_end()
        return message

    def _next_data(self, job: _Sending, max_packets: int) -> list[Message]:
        if job.reader is None:
            self._library.begin_transfer()
            job.reader = self._library.open(job.log_id)
        messages: list[Message] = []
        while self._job is job and len(messages) < max_packets:
            messages.append(self._next_packet(job, job.reader))
        return messages

    def _next_packet(self, job: _Sending, reader: LogReader) -> LOG_DATA:
        data = reader.read(job.offset, min(job.remaining, DATA_BYTES))
        message = LOG_DATA(job.log_id, job.offset, len(data), tuple(data.ljust(DATA_BYTES, b"\0")))
        job.offset += len(data)
        job.remaining -= len(data)
        if len(data) < DATA_BYTES or job.remaining == 0:
            self.request_end()
        return message

    def pause(self) -> None:
        """Allow logging again because the vehicle is being armed; sending continues once it is disarmed."""
        job = self._job
        if isinstance(job, _Sending) and job.reader is not None:
            job.reader.close()
            job.reader = None
            self._library.end_transfer()
