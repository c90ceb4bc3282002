# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The 251 bytes of a MAVLink FTP request or reply.

Source: GCS_MAVLink/GCS_FTP.cpp (handle_file_transfer_protocol, send_ftp_reply, ftp_error, ftp_check_name_len).
"""

import errno
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Self

from ap_core.cint import u8, u16, u32
from mav_handlers.transfers.ftp_ports import Failure

PAYLOAD_BYTES: Final = 251
DATA_BYTES: Final = 239
_HEADER: Final = struct.Struct("<HBBBBBxI")


class Opcode(IntEnum):
    """What a request asks for, and the two kinds of replies."""

    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    ACK = 128
    NACK = 129


class FtpError(IntEnum):
    """The first data byte of a Nack; with FAIL_ERRNO the second is an errno."""

    FAIL = 1
    FAIL_ERRNO = 2
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    END_OF_FILE = 6
    UNKNOWN_COMMAND = 7
    FILE_EXISTS = 8
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


_ERROR_OF_ERRNO: Final = {errno.EEXIST: FtpError.FILE_EXISTS, errno.ENOENT: FtpError.FILE_NOT_FOUND}


def _c_string(data: bytes) -> bytes:
    return data.partition(b"\0")[0]


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "surrogateescape")


@dataclass(frozen=True, slots=True)
class Request:
    """A request; ``data`` has 239 bytes whatever ``size`` says."""

    seq: int
    session: int
    opcode: int
    size: int
    offset: int
    data: bytes

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Read a payload; one that is too short is filled up with zeros, the rest of a longer one is left out."""
        padded = payload[:PAYLOAD_BYTES].ljust(PAYLOAD_BYTES, b"\0")
        seq, session, opcode, size, _req_opcode, _burst_complete, offset = _HEADER.unpack_from(padded)
        return cls(seq, session, opcode, size, offset, padded[_HEADER.size :])

    def path(self) -> str | None:
        """Return the path in the data, or None when ``size`` does not fit it."""
        name = _c_string(self.data)
        extra = self.size - len(name)
        if self.size == 0 or (extra != 0 and not (extra == 1 and self.data[-1] == 0)):
            return None
        return _text(name[: DATA_BYTES - 1])

    def two_paths(self) -> tuple[str, str] | None:
        """Return the paths of a rename, or None when ``size`` does not fit them."""
        old = _c_string(self.data[: DATA_BYTES - 2])
        new = _c_string(self.data[len(old) + 1 :])
        extra = self.size - len(old) - len(new)
        is_ended = extra == 1 or (extra == 2 and self.data[-1] == 0)
        if self.size == 0 or self.data[len(old)] != 0 or not is_ended:
            return None
        return _text(old), _text(new[: DATA_BYTES - 2 - len(old)])


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply; its size is the length of ``data``."""

    seq: int
    session: int
    req_opcode: int
    opcode: int = Opcode.NONE
    burst_complete: bool = False
    offset: int = 0
    data: bytes = b""

    def pack(self) -> bytes:
        """Return the payload, 251 bytes."""
        size = u8(len(self.data))
        header = _HEADER.pack(
            self.seq, self.session, self.opcode, size, self.req_opcode, self.burst_complete, u32(self.offset)
        )
        return (header + self.data).ljust(PAYLOAD_BYTES, b"\0")

    @classmethod
    def parse(cls, payload: bytes) -> Self:
        """Read a payload; one that is too short is filled up with zeros, the rest of a longer one is left out."""
        padded = payload[:PAYLOAD_BYTES].ljust(PAYLOAD_BYTES, b"\0")
        seq, session, opcode, size, req_opcode, burst_complete, offset = _HEADER.unpack_from(padded)
        data = padded[_HEADER.size :][:size]
        return cls(seq, session, req_opcode, opcode, bool(burst_complete), offset, data)


def ack(request: Request, data: bytes = b"", *, offset: int = 0) -> Reply:
    """Answer a request that succeeded."""
    return Reply(u16(request.seq + 1), request.session, request.opcode, Opcode.ACK, offset=offset, data=data)


def nack(request: Request, error: FtpError | Failure, *, offset: int = 0) -> Reply:
    """Answer a request that failed (ftp_error)."""
    data = _failure_data(error) if isinstance(error, Failure) else bytes([error])
    return Reply(u16(request.seq + 1), request.session, request.opcode, Opcode.NACK, offset=offset, data=data)


def _failure_data(failure: Failure) -> bytes:
    known = _ERROR_OF_ERRNO.get(failure.errno)
    return bytes([FtpError.FAIL_ERRNO, u8(failure.errno)]) if known is None else bytes([known])
