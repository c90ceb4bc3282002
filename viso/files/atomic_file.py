# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing a file such that a crash at any instant leaves the old or the new one, whole."""

import contextlib
import errno
import fcntl
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path


def replace_file(path: Path, data: bytes, *, mode: int = 0o644, synced: bool = True) -> None:
    """Put a file in place as a whole; its folder is made when it is missing.

    A link to the file stays a link: what it points to is replaced.

    Args:
        path: the file.
        data: all that it is to hold.
        mode: its permissions, less the process's umask, from the first byte on.
        synced: whether to wait for the disk; without that it holds for a crash of the process, not of the computer.

    Raises:
        OSError: as the file system says; the file is then as it was.
    """
    path = _target(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{secrets.token_hex(8)}.draft")
    try:
        _write_draft(draft, data, mode, synced=synced)
        os.replace(draft, path)
    except BaseException:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise
    if synced:
        _sync_folder(path.parent)


def remove_stale_drafts(path: Path) -> None:
    """Delete what killed processes left; a draft in use is locked (one not yet locked costs its writer a retry)."""
    for draft in _drafts(_target(path)):
        with contextlib.suppress(OSError), draft.open("rb") as stale:
            fcntl.flock(stale.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
            draft.unlink()


def _target(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _write_draft(path: Path, data: bytes, mode: int, *, synced: bool) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    try:
        with contextlib.suppress(OSError):  # some file systems have no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        waiting = memoryview(data)
        while waiting:
            waiting = waiting[os.write(descriptor, waiting) :]
        if synced:
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some file systems cannot do that to a folder
            raise
    finally:
        os.close(descriptor)


def _drafts(path: Path) -> Iterator[Path]:
    pattern = re.compile(re.escape(f".{path.name}.") + r"[0-9a-f]{16}\.draft")
    with contextlib.suppress(OSError):
        yield from [entry for entry in path.parent.iterdir() if pattern.fullmatch(entry.name)]
