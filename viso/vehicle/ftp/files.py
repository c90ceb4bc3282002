# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that the vehicle shows by MAVLink FTP: parameters, reports on the system, logs.

Nothing else can be reached: paths are compared with names that exist here, and only a log's name ever meets the disk.

Source: AP_Filesystem/AP_Filesystem.cpp (backend_by_path), AP_Filesystem_Param.cpp, AP_Filesystem_Sys.cpp.
"""

import errno
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

from ap_core.param import ParamTable
from mav_handlers.transfers.ftp_ports import Entry, Failure, ReadableFile, WritableFile
from mav_handlers.transfers.param_pck import PckQuery, parse_query
from viso.logs.files import LASTLOG_NAME
from viso.vehicle.ftp.open_files import BytesFile, DiskFile, OnUpload, ParamPckFile, ParamUpload

LOG_FOLDERS: Final = ("APM/LOGS", "logs")
"""Where clients look for logs: on a card, and in simulation."""

PARAM_PCK: Final = "param.pck"
SYSTEM_FILE_SIZE: Final = 100_000
"""What the firmware says of the size of every report, which it makes only when it is opened."""

_LOG_NAME: Final = re.compile(rf"[0-9]{{8}}\.BIN|{re.escape(LASTLOG_NAME)}")
_ABSENT: Final = Failure(errno.ENOENT)
_READ_ONLY: Final = Failure(errno.EROFS)


class _LogFolder:
    """The logs in a directory; nothing else that may be there is seen."""

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
