# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that the vehicle shows by MAVLink FTP: parameters, reports on the system, logs.

Nothing else can be reached: paths are compared with names that exist here, and only a log name is used on the disk.

Source: AP_Filesystem/AP_Filesystem.cpp (backend_by_path), AP_Filesystem_Param.cpp, AP_Filesystem_Posix.cpp,
AP_Filesystem_Sys.cpp; AP_HAL_SITL/Util.cpp and UARTDriver.cpp (uart_info).
"""

import errno
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Self

from ap_core.param import ParamTable
from mav_handlers.transfers.ftp_ports import Entry, Failure, ReadableFile, WritableFile
from mav_handlers.transfers.param_pck import (
    MAX_UPLOAD_BYTES,
    PackedParam,
    PckQuery,
    build_param_pck,
    estimate_size,
    parse_param_pck_upload,
    parse_query,
)
from viso.logs.files import LASTLOG_NAME

OnUpload = Callable[[Sequence[PackedParam]], None]

_MAX_SEEK: Final = 0x7FFFFFFF
_INVALID: Final = Failure(errno.EINVAL)
_ABSENT: Final = Failure(errno.ENOENT)


class BytesFile:
    """Bytes in memory, open for reading; ``size`` is the size that clients get."""

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
        """Hand over the parameters, if the file is valid (AP_Filesystem_Param.cpp, finish_upload)."""
        uploaded = parse_param_pck_upload(bytes(self._data))
        if uploaded is not None:
            self._on_upload(uploaded)


class DiskFile:
    """A regular file on disk, open for reading; ``size`` is the size that clients get."""

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


_BITS_PER_BYTE: Final = 10


@dataclass(frozen=True, slots=True)
class UartCounts:
    """A link: bytes sent and received since boot, whether a client is connected, and its name."""

    tx_bytes: int
    rx_bytes: int
    connected: bool
    path: str


class UartsText:
    """Makes the report of the links that ``read_counts`` returns, always in the same order."""

    def __init__(self, read_counts: Callable[[], Sequence[UartCounts]], now_us: Callable[[], int]) -> None:
        self._read_counts = read_counts
        self._now_us = now_us
        self._last_ms = 0
        self._last: list[UartCounts] = []

    def __call__(self) -> str:
        """Return the text; amounts are since the last call, rates in bits per second at 10 bits a byte."""
        now_ms = self._now_us() // 1000
        elapsed_ms = max(now_ms - self._last_ms, 1)
        counts = list(self._read_counts())
        lines = [self._line(index, count, elapsed_ms) for index, count in enumerate(counts)]
        self._last_ms, self._last = now_ms, counts
        return "UARTV1\n" + "".join(lines)

    def _line(self, index: int, now: UartCounts, elapsed_ms: int) -> str:
        before = self._last[index] if index < len(self._last) else UartCounts(0, 0, False, "")
        tx, rx = now.tx_bytes - before.tx_bytes, now.rx_bytes - before.rx_bytes
        tx_rate, rx_rate = (amount * 1000 * _BITS_PER_BYTE // elapsed_ms for amount in (tx, rx))
        state = "connected    " if now.connected else "not connected"
        return f"SERIAL{index} TX={tx:8} RX={rx:8} TXBD={tx_rate:6} RXBD={rx_rate:6} {state} ({now.path})\n"


LOG_FOLDERS: Final = ("APM/LOGS", "logs")
"""Where clients look for logs: on a card, and in simulation."""

PARAM_PCK: Final = "param.pck"
SYSTEM_FILE_SIZE: Final = 100_000
"""The size of every report in listings; the firmware makes a report only when it is opened."""

_LOG_NAME: Final = re.compile(rf"[0-9]{{8}}\.BIN|{re.escape(LASTLOG_NAME)}")
_READ_ONLY: Final = Failure(errno.EROFS)


class _LogFolder:
    """The logs in a directory; other files are not shown."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def entries(self) -> Iterator[Entry]:
        """Yield the logs in the order of their names; what cannot be read is left out."""
        try:
            names = sorted(os.listdir(self._directory))
        except OSError:
            return
        for name in names:
            file = self.open(name)
            if not isinstance(file, Failure):
                file.close()
                yield Entry(name, file.size)

    def open(self, name: str) -> DiskFile | Failure:
        """Open a log."""
        return DiskFile.open(self._directory / name) if _LOG_NAME.fullmatch(name) else _ABSENT


def _folders(paths: Iterable[str]) -> dict[str, list[Entry]]:
    """Return what leads to some paths: folders that hold nothing but folders."""
    folders: dict[str, list[Entry]] = {"": []}
    for path in paths:
        parent = ""
        for name in path.split("/"):
            child = f"{parent}/{name}" if parent else name
            if child not in folders:
                folders[parent].append(Entry(name))
                folders[child] = []
            parent = child
    return folders


class VehicleFiles:
    """The vehicle's tree: ``@PARAM/param.pck``, ``@SYS``, and the logs under each of ``log_folders``.

    Everything is read-only, except that parameters can be uploaded if somebody takes them.

    Args:
        params: the parameters.
        log_directory: where the logs are; None for a vehicle without.
        system_texts: makers of the texts under ``@SYS``, by the firmware's file names; an empty text means no file.
        log_folders: what clients call the folder of the logs.
        on_upload: takes the parameters of an uploaded ``param.pck``; None refuses uploads.
    """

    def __init__(
        self,
        params: ParamTable,
        *,
        log_directory: Path | None = None,
        system_texts: Mapping[str, Callable[[], str]] = MappingProxyType({}),
        log_folders: Sequence[str] = LOG_FOLDERS,
        on_upload: OnUpload | None = None,
    ) -> None:
        self._params = params
        self._system_texts = dict(system_texts)
        self._logs = {} if log_directory is None else dict.fromkeys(log_folders, _LogFolder(log_directory))
        self._on_upload = on_upload
        self._folders = _folders([*self._logs, *(["@SYS"] if self._system_texts else [])])

    def list_directory(self, path: str) -> Sequence[Entry] | Failure:
        """Return a folder's entries; ``@PARAM`` cannot be listed."""
        path = path.removeprefix("/")
        if _below("@SYS", path) == "":
            return [Entry(name, SYSTEM_FILE_SIZE) for name in self._system_texts]
        if (logs := self._logs.get(path)) is not None:
            return list(logs.entries())
        return self._folders.get(path, _ABSENT)

    def open_read(self, path: str) -> ReadableFile | Failure:
        """Open a file for reading."""
        path = path.removeprefix("/")
        if (name := _below("@PARAM", path)) is not None:
            query = _pck_query(name)
            return query if isinstance(query, Failure) else ParamPckFile(self._params, query)
        if (name := _below("@SYS", path)) is not None:
            return self._open_system_text(name)
        folder, _, name = path.rpartition("/")
        logs = self._logs.get(folder)
        return _ABSENT if logs is None else logs.open(name)

    def _open_system_text(self, name: str) -> ReadableFile | Failure:
        make = self._system_texts.get(name)
        data = make().encode("utf-8", "replace") if make is not None else b""
        return BytesFile(data, SYSTEM_FILE_SIZE) if data else _ABSENT

    def open_write(self, path: str, *, create: bool) -> WritableFile | Failure:
        """Open ``@PARAM/param.pck`` for an upload; everything else is read-only."""
        name = _below("@PARAM", path.removeprefix("/"))
        if name is None or self._on_upload is None:
            return _READ_ONLY
        query = _pck_query(name)
        return query if isinstance(query, Failure) else ParamUpload(self._on_upload)

    def remove(self, path: str) -> Failure:
        """Refuse."""
        return _READ_ONLY

    def make_directory(self, path: str) -> Failure:
        """Refuse."""
        return _READ_ONLY

    def rename(self, old_path: str, new_path: str) -> Failure:
        """Refuse."""
        return _READ_ONLY


def _below(prefix: str, path: str) -> str | None:
    """Return the part of a path behind a prefix and a slash, which the firmware does without as well; else None."""
    return path.removeprefix(prefix).removeprefix("/") if path.startswith(prefix) else None


def _pck_query(name: str) -> PckQuery | Failure:
    file_name, _, query = name.partition("?")
    if file_name != PARAM_PCK:
        return _ABSENT
    parsed = parse_query(query)
    return Failure(errno.EINVAL) if parsed is None else parsed
