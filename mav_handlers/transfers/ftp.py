# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""MAVLink FTP without I/O: requests and time in, replies out, one session over all links.

Source: GCS_MAVLink/GCS_FTP.cpp (handle_file_transfer_protocol, ftp_worker, ftp_push_replies). The firmware's thread
does a job at once; here it is done in steps, so that a transfer neither floods a link nor blocks the vehicle.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from ap_core.cint import u16, u32
from mav_handlers.transfers.ftp_ports import FtpFiles
from mav_handlers.transfers.ftp_session import FtpSession, Job
from mav_handlers.transfers.ftp_wire import DATA_BYTES, FtpError, Opcode, Reply, Request, nack

QUEUE_CAPACITY: Final = 5
SLOW_DOWN_MS: Final = 1000
STEPS_PER_CALL: Final = 16
"""Steps in one call; a step is a request, a packet of a burst or a part of a checksum."""

_BANNER_PATH: Final = b"@PARAM/param.pck"
_MAV_SEVERITY_DEBUG: Final = 7
# A FILE_TRANSFER_PROTOCOL in a MAVLink 2 frame, without the data.
_FRAME_BYTES: Final = 254 + 12 - DATA_BYTES


@dataclass(frozen=True, slots=True)
class FtpPeer:
    """The client of a request, and its link.

    ``bytes_per_second`` is the rate of a link without flow control, of which a burst uses a third; None: no limit.
    """

    channel: int
    system_id: int
    component_id: int
    bytes_per_second: int | None = None


@dataclass(frozen=True, slots=True)
class FtpReply:
    """A payload of 251 bytes for a peer; with ``banner`` the banner texts follow it."""

    peer: FtpPeer
    payload: bytes
    banner: bool = False


class FtpServer:
    """The file server: pass requests to ``handle``, call ``continue_burst`` at every poll, send the replies of both.

    Args:
        files: the files that clients see.
        send_text: takes a severity and a text for the ground station.
        has_room: returns whether a link has room for a frame; until then its replies wait.
    """

    def __init__(
        self,
        files: FtpFiles,
        send_text: Callable[[int, str], None] = lambda severity, text: None,
        has_room: Callable[[int], bool] = lambda channel: True,
    ) -> None:
        self._session = FtpSession(files)
        self._send_text = send_text
        self._has_room = has_room
        self._queue: deque[tuple[Request, FtpPeer]] = deque()
        self._now_us = 0
        self._last_sent_ms = 0
        self._last: tuple[Reply, FtpPeer] | None = None
        self._job: tuple[Job, FtpPeer] | None = None
        self._job_delay_us = 0
        self._job_due_us = 0

    def handle(self, payload: bytes, now_us: int, peer: FtpPeer) -> list[FtpReply]:
        """Queue a request and return the first replies; the request is dropped if five are waiting."""
        if len(self._queue) < QUEUE_CAPACITY:
            self._queue.append((Request.parse(payload), peer))
        return self.continue_burst(now_us)

    def continue_burst(self, now_us: int) -> list[FtpReply]:
        """Continue the present job, then waiting requests, and return more replies."""
        self._now_us = now_us
        replies: list[FtpReply] = []
        for _ in range(STEPS_PER_CALL):
            if not self._step(replies):
                break
        return replies

    @property
    def busy(self) -> bool:
        """Return whether a job or a request is left for ``continue_burst``."""
        return self._job is not None or bool(self._queue)

    def slows_streams(self, now_us: int) -> bool:
        """Return whether periodic messages come at a quarter of their rate (get_reschedule_interval_ms).

        That is for 1 s after a reply, other than one to TerminateSession, and as in the firmware for 1 s after boot.
        """
        return self._since_reply_ms(now_us) < SLOW_DOWN_MS

    def speed_lasts_ms(self, now_us: int) -> int:
        """Return how long ``slows_streams`` stays the same if no reply is sent."""
        since_ms = self._since_reply_ms(now_us)
        return (SLOW_DOWN_MS if since_ms < SLOW_DOWN_MS else 1 << 32) - since_ms

    def _since_reply_ms(self, now_us: int) -> int:
        return u32(now_us // 1000 - self._last_sent_ms)

    def close(self) -> None:
        """Close open files, as at shutdown, and drop jobs and requests."""
        if self._job is not None:
            self._job[0].close()
            self._job = None
        self._queue.clear()
        self._session.close()

    def _step(self, replies: list[FtpReply]) -> bool:
        if self._job is not None:
            return self._go_on(*self._job, replies)
        if not self._queue or not self._has_room(self._queue[0][1].channel):
            return False
        self._begin(*self._queue.popleft(), replies)
        return True

    def _go_on(self, job: Job, peer: FtpPeer, replies: list[FtpReply]) -> bool:
        if self._now_us < self._job_due_us or not self._has_room(peer.channel):
            return False
        try:
            reply = next(job)
        except StopIteration as end:
            self._job = None
            if end.value is not None:
                self._last = end.value, peer
            return True
        if reply is not None:
            self._push(reply, peer, replies)
            self._job_due_us = self._now_us + self._job_delay_us
        return True

    def _begin(self, request: Request, peer: FtpPeer, replies: list[FtpReply]) -> None:
        if self._last is not None and self._is_repeated(request, peer, *self._last):
            self._push(*self._last, replies)
            return
        answer = self._session.answer(request, u32(self._now_ms - self._last_sent_ms))
        if answer is None and request.opcode in (Opcode.ACK, Opcode.NACK):
            # No answer is sent, yet the firmware has prepared one for a repetition.
            self._last = Reply(u16(request.seq + 1), request.session, request.opcode), peer
            return
        if answer is None:
            self._send_text(_MAV_SEVERITY_DEBUG, f"Unsupported FTP: {request.opcode}")
            answer = nack(request, FtpError.FAIL)
        if isinstance(answer, Reply):
            self._push(answer, peer, replies, banner=self._opens_parameters(request, answer))
        else:
            self._job = answer, peer
            self._job_delay_us = self._burst_delay_us(request, peer)
            self._job_due_us = self._now_us

    @property
    def _now_ms(self) -> int:
        return u32(self._now_us // 1000)

    def _push(self, reply: Reply, peer: FtpPeer, replies: list[FtpReply], *, banner: bool = False) -> None:
        self._last = reply, peer
        self._last_sent_ms = 0 if reply.req_opcode == Opcode.TERMINATE_SESSION else self._now_ms
        replies.append(FtpReply(peer, reply.pack(), banner))

    @staticmethod
    def _is_repeated(request: Request, peer: FtpPeer, reply: Reply, asker: FtpPeer) -> bool:
        # Neither operation nor link is compared, and a wrapped number is not recognised.
        is_asker = (peer.system_id, peer.component_id) == (asker.system_id, asker.component_id)
        return is_asker and request.session == reply.session and request.seq + 1 == reply.seq

    @staticmethod
    def _opens_parameters(request: Request, reply: Reply) -> bool:
        is_opened = request.opcode == Opcode.OPEN_FILE_RO and reply.opcode == Opcode.ACK
        return is_opened and request.data.startswith(_BANNER_PATH)

    @staticmethod
    def _burst_delay_us(request: Request, peer: FtpPeer) -> int:
        if peer.bytes_per_second is None or request.opcode != Opcode.BURST_READ_FILE:
            return 0
        return 3000 * (_FRAME_BYTES + (request.size or DATA_BYTES)) // max(peer.bytes_per_second, 1) * 1000
