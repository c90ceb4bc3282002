# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""FTP requests that take more than one step: bursts and checksums.

Source: GCS_MAVLink/GCS_FTP.cpp (ftp_worker), AP_Filesystem/AP_Filesystem.cpp (crc32).
"""

import zlib
from collections.abc import Generator
from dataclasses import replace
from typing import Final

from ap_core.cint import u16
from mav_handlers.transfers.ftp_ports import Failure, ReadableFile
from mav_handlers.transfers.ftp_wire import DATA_BYTES, FtpError, Reply, Request, ack, nack

BURST_PACKETS: Final = 500
CRC_READ_BYTES: Final = 64
CRC_READS_PER_STEP: Final = 64

_UINT32_MAX: Final = 0xFFFFFFFF

Job = Generator[Reply | None, None, Reply | None]
"""Yields a reply, or None after a step without one; returns what is to pass for the last reply, if not that one."""


def burst_read(request: Request, file: ReadableFile) -> Job:
    """Read on from the request's offset and send up to 500 packets; the end of the file is a Nack."""
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
        # Only behind a short packet does the firmware point at the end of the file.
        end_offset = offset + len(data) if is_short else offset
        reply = replace(reply, seq=u16(reply.seq + 1))
    # By now the firmware has numbered a packet that it does not send.
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
