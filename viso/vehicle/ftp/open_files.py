# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that an FTP client has opened: bytes in memory, a file on disk, the parameters as a download or an upload.

Source: AP_Filesystem/AP_Filesystem_Param.cpp, AP_Filesystem_Posix.cpp.
"""

import errno
import os
import stat
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Self

from ap_core.param import ParamTable
from mav_handlers.transfers.ftp_ports import Failure
from mav_handlers.transfers.param_pck import (
    MAX_UPLOAD_BYTES,
    PackedParam,
    PckQuery,
    build_param_pck,
    estimate_size,
    parse_param_pck_upload,
)

OnUpload = Callable[[Sequence[PackedParam]], None]

_MAX_SEEK: Final = 0x7FFFFFFF
_INVALID: Final = Failure(errno.EINVAL)
_ABSENT: Final = Failure(errno.ENOENT)


class BytesFile:
    """Bytes in memory, open for reading; ``size`` is what clients are told."""

    def __init__(self, data: bytes, size: int) -> None:
        self._data = data
        self.size = size

    def read(self, offset: int, count: int) -> bytes:
        """Return up to ``count`` bytes at ``offset``."""
        return self._data[offset : offset + count]

    def close(self) -> None:
        """Do nothing."""


class ParamPckFile:
    """``param.pck`` open for reading. The first read fixes the size of all reads, as it decides on the padding."""

    def __init__(self, params: ParamTable, query: PckQuery) -> None:
        self._params = params
        self._query = query
        self._read_size = 0
        self._image = b""
        self.size = estimate_size(params)

    def read(self, offset: int, count: int) -> bytes | Failure:
        """Return up to ``count`` bytes at ``offset``."""
        if self._read_size not in (0, count):
            return _INVALID
        if count == 0:
            return b""
        if not self._image:
            query = self._query
            if query.start >= self._params.count:
                return _INVALID
            # FIRMWARE PARITY: the firmware packs the values again for each read, and a parameter that changes length
            # or hides others in the middle of a download damages the file; here all values are of the first read.
            self._image = build_param_pck(
                self._params,
                read_size=count,
                start=query.start,
                count=query.count,
                with_defaults=query.with_defaults,
            )
            self._read_size = count
        return self._image[offset : offset + count]

    def close(self) -> None:
        """Do nothing."""


class ParamUpload:
    """``param.pck`` open for writing; closing hands over what is whole and well-formed."""

    def __init__(self, on_upload: OnUpload) -> None:
        self._on_upload = on_upload
        self._data = bytearray()

    def write(self, offset: int, data: bytes) -> Failure | None:
        """Put ``data`` at ``offset``."""
        end = offset + len(data)
        if end > MAX_UPLOAD_BYTES:
            return Failure(errno.ENOSPC)
        self._data.extend(bytes(max(0, end - len(self._data))))
        self._data[offset:end] = data
        return None

    def close(self) -> None:
        """Take over the parameters, if the file is in order (AP_Filesystem_Param.cpp, finish_upload)."""
        uploaded = parse_param_pck_upload(bytes(self._data))
        if uploaded is not None:
            self._on_upload(uploaded)


class DiskFile:
    """A regular file on disk, open for reading; ``size`` is what clients are told."""

    def __init__(self, descriptor: int, size: int) -> None:
        self._descriptor = descriptor
        self.size = size

    @classmethod
    def open(cls, path: Path) -> Self | Failure:
        """Open a file; a link is not followed, a device not waited for, and both count as absent."""
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            return _ABSENT if error.errno == errno.ELOOP else _failure(error)
        status = os.fstat(descriptor)
        if stat.S_ISREG(status.st_mode):
            return cls(descriptor, status.st_size)
        os.close(descriptor)
        return _ABSENT

    def read(self, offset: int, count: int) -> bytes | Failure:
        """Return up to ``count`` bytes at ``offset``; the firmware cannot go beyond 2 GiB."""
        if offset > _MAX_SEEK:
            return _INVALID
        try:
            return os.pread(self._descriptor, count, offset)
        except OSError as error:
            return _failure(error)

    def close(self) -> None:
        """Close the descriptor."""
        os.close(self._descriptor)


def _failure(error: OSError) -> Failure:
    return Failure(error.errno or errno.EIO)
