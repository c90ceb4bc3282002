# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The one FTP session of a vehicle, and the operation of each request.

Source: GCS_MAVLink/GCS_FTP.cpp (ftp_worker, ftp_list_dir, gen_dir_entry), AP_Filesystem/AP_Filesystem.cpp (crc32).
"""

import zlib
from collections.abc import Callable, Generator, Mapping
from dataclasses import replace
from typing import Final

from ap_core.cint import u16, u32
from mav_handlers.transfers.ftp_ports import Entry, Failure, FtpFiles, ReadableFile, WritableFile
from mav_handlers.transfers.ftp_wire import DATA_BYTES, FtpError, Opcode, Reply, Request, ack, nack

SESSION_TIMEOUT_MS: Final = 3000
BURST_PACKETS: Final = 500
CRC_READ_BYTES: Final = 64
CRC_READS_PER_STEP: Final = 64

_UINT32_MAX: Final = 0xFFFFFFFF
_NO_SESSION: Final = -1

Job = Generator[Reply | None, None, Reply | None]
"""Yields a reply, or None after a step without one; returns the reply to record as the last, if it is another."""


def _listed(entry: Entry) -> bytes:
    text = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{u32(entry.size)}"
    return text.encode("utf-8", "surrogateescape") + b"\0\0"


def _done(request: Request, failure: Failure | None, *, offset: int = 0) -> Reply:
    return ack(request, offset=offset) if failure is None else nack(request, failure)


def burst_read(request: Request, file: ReadableFile) -> Job:
    """Read from the request's offset and send up to 500 packets; a Nack marks the end of the file."""
    count = request.size or DATA_BYTES
    reply = ack(request)
    end_offset = 0
    for packet in range(BURST_PACKETS):
        offset = request.offset + packet * count
        data = file.read(offset, count)
        if isinstance(data, Failure) or not data:
            end = nack(request, data if isinstance(data, Failure) else FtpError.END_OF_FILE, offset=end_offset)
            yield replace(end, seq=reply.seq, burst_complete=reply.burst_complete)
            return None
        is_short = len(data) < count
        reply = replace(reply, data=data, offset=offset, burst_complete=is_short or packet == BURST_PACKETS - 1)
        yield reply
        # The firmware sets the offset to the end of the file only after a short packet.
        end_offset = offset + len(data) if is_short else offset
        reply = replace(reply, seq=u16(reply.seq + 1))
    # The firmware has already numbered a packet that it does not send.
    return reply


def file_crc32(request: Request, file: ReadableFile) -> Job:
    """Compute a file's checksum and close it: polynomial 0xEDB88320, starting from 0 and not inverted at the end."""
    checksum = _UINT32_MAX  # zlib inverts before and after
    offset = 0
    try:
        while True:
            for _ in range(CRC_READS_PER_STEP):
                data = file.read(offset, CRC_READ_BYTES)
                if isinstance(data, Failure):
                    yield nack(request, data)
                    return None
                if not data:
                    yield ack(request, (checksum ^ _UINT32_MAX).to_bytes(4, "little"))
                    return None
                checksum = zlib.crc32(data, checksum)
                offset += len(data)
            yield None
    finally:
        file.close()


class FtpSession:
    """The session: at most one open file, for the client that opened it first."""

    def __init__(self, files: FtpFiles) -> None:
        self._files = files
        self._session = 0
        self._reading: ReadableFile | None = None
        self._writing: WritableFile | None = None

    @property
    def is_open(self) -> bool:
        """Return whether a file is open."""
        return self._reading is not None or self._writing is not None

    def close(self) -> None:
        """Close the open file, if any; its session is over."""
        for file in (self._reading, self._writing):
            if file is not None:
                file.close()
        self._reading = self._writing = None
        self._session = _NO_SESSION

    def answer(self, request: Request, idle_ms: int) -> Reply | Job | None:
        """Execute a request, ``idle_ms`` after the last reply.

        Return the reply, or a job that makes it; None for an unknown opcode.
        """
        if request.size > DATA_BYTES:
            return nack(request, FtpError.INVALID_DATA_SIZE)
        if request.session != self._session:
            if request.opcode in (Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS):
                return ack(request)
            if self.is_open and idle_ms < SESSION_TIMEOUT_MS:
                return nack(request, FtpError.INVALID_SESSION)
            self._close_if_open()
        elif request.opcode == Opcode.OPEN_FILE_RO and idle_ms > SESSION_TIMEOUT_MS:
            self._close_if_open()
        operation = _OPERATIONS.get(request.opcode)
        return None if operation is None else operation(self, request)

    def _close_if_open(self) -> None:
        if self.is_open:
            self.close()

    def _none(self, request: Request) -> Reply:
        return ack(request)

    def _end(self, request: Request) -> Reply:
        self.close()
        return ack(request)

    def _list_directory(self, request: Request) -> Reply:
        path = request.path()
        if path is None:
            return nack(request, FtpError.INVALID_DATA_SIZE, offset=request.offset)
        entries = self._files.list_directory(path[:-1] if len(path) > 1 and path.endswith("/") else path)
        if isinstance(entries, Failure):
            return nack(request, entries, offset=request.offset)
        data = b""
        for entry in entries[request.offset :]:
            listed = _listed(entry)
            if len(data) + len(listed) > DATA_BYTES:
                break
            data += listed
        if not data:
            return nack(request, FtpError.END_OF_FILE, offset=request.offset)
        return ack(request, data, offset=request.offset)

    def _open_file_ro(self, request: Request) -> Reply:
        if self.is_open:
            return nack(request, FtpError.FAIL)
        file = self._open_read(request)
        if isinstance(file, Reply):
            return file
        self._reading, self._session = file, request.session
        return ack(request, u32(file.size).to_bytes(4, "little"))

    def _open_read(self, request: Request) -> ReadableFile | Reply:
        path = request.path()
        if path is None:
            return nack(request, FtpError.INVALID_DATA_SIZE)
        file = self._files.open_read(path)
        return nack(request, file) if isinstance(file, Failure) else file

    def _open_file_wo(self, request: Request) -> Reply:
        if self.is_open:
            return nack(request, FtpError.FAIL)
        path = request.path()
        if path is None:
            return nack(request, FtpError.INVALID_DATA_SIZE)
        file = self._files.open_write(path, create=request.opcode == Opcode.CREATE_FILE)
        if isinstance(file, Failure):
            return nack(request, file)
        self._writing, self._session = file, request.session
        return ack(request)

    def _read_file(self, request: Request) -> Reply:
        if self._reading is None:
            return self._not_open_so(request)
        data = self._reading.read(request.offset, request.size)
        if isinstance(data, Failure):
            return nack(request, data)
        return ack(request, data, offset=request.offset) if data else nack(request, FtpError.END_OF_FILE)

    def _burst_read_file(self, request: Request) -> Reply | Job:
        return self._not_open_so(request) if self._reading is None else burst_read(request, self._reading)

    def _write_file(self, request: Request) -> Reply:
        if self._writing is None:
            return self._not_open_so(request)
        failure = self._writing.write(request.offset, request.data[: request.size])
        return _done(request, failure, offset=request.offset)

    def _not_open_so(self, request: Request) -> Reply:
        return nack(request, FtpError.FAIL if self.is_open else FtpError.FILE_NOT_FOUND)

    def _change(self, request: Request, change: Callable[[str], Failure | None]) -> Reply:
        path = request.path()
        return nack(request, FtpError.INVALID_DATA_SIZE) if path is None else _done(request, change(path))

    def _remove(self, request: Request) -> Reply:
        return self._change(request, self._files.remove)

    def _create_directory(self, request: Request) -> Reply:
        return self._change(request, self._files.make_directory)

    def _rename(self, request: Request) -> Reply:
        paths = request.two_paths()
        if paths is None:
            return nack(request, FtpError.INVALID_DATA_SIZE)
        return _done(request, self._files.rename(*paths))

    def _calc_file_crc32(self, request: Request) -> Reply | Job:
        file = self._open_read(request)
        return file if isinstance(file, Reply) else file_crc32(request, file)


_OPERATIONS: Final[Mapping[int, Callable[[FtpSession, Request], Reply | Job]]] = {
    Opcode.NONE: FtpSession._none,
    Opcode.TERMINATE_SESSION: FtpSession._end,
    Opcode.RESET_SESSIONS: FtpSession._end,
    Opcode.LIST_DIRECTORY: FtpSession._list_directory,
    Opcode.OPEN_FILE_RO: FtpSession._open_file_ro,
    Opcode.READ_FILE: FtpSession._read_file,
    Opcode.CREATE_FILE: FtpSession._open_file_wo,
    Opcode.WRITE_FILE: FtpSession._write_file,
    Opcode.REMOVE_FILE: FtpSession._remove,
    Opcode.CREATE_DIRECTORY: FtpSession._create_directory,
    Opcode.REMOVE_DIRECTORY: FtpSession._remove,
    Opcode.OPEN_FILE_WO: FtpSession._open_file_wo,
    Opcode.RENAME: FtpSession._rename,
    Opcode.CALC_FILE_CRC32: FtpSession._calc_file_crc32,
    Opcode.BURST_READ_FILE: FtpSession._burst_read_file,
}
