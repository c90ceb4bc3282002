# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a recording is, by its first bytes: users rename, pack and mistake files."""

from enum import Enum
from pathlib import Path
from typing import Final

from ap_core.log_structure import FMT, HEAD_BYTE1, HEAD_BYTE2
from mav_handlers.links.packed import PackedError, first_bytes
from mav_handlers.links.tlog import begins_with_entry
from mav_handlers.wire.codec import begins_with_frame
from viso.errors import InputError

DATAFLASH_BYTES: Final = bytes((HEAD_BYTE1, HEAD_BYTE2, FMT.msg_type))
"""The first bytes of a DataFlash log, which describes its own descriptions first."""
_ENOUGH_BYTES: Final = 1024
_NOT_READ: Final = (
    (b"ULog\x01\x12\x35", "a log of PX4 (ULog), which viso does not read: it knows ArduPilot's recordings"),
    (b"FMT, ", "a DataFlash log that was turned into text: give the .BIN that it was made of"),
    (b"<!DOCTYPE html", "a page of the web, not the file that was meant: download it again"),
    (b"<html", "a page of the web, not the file that was meant: download it again"),
)


class Content(Enum):
    """What a recording without lines of text is."""

    DATAFLASH_LOG = "DataFlash log"
    TELEMETRY_LOG = "telemetry log"
    LINK_BYTES = "bytes of a link"


def content_of(path: Path) -> Content | None:
    """Return what a file is by its first bytes, packed or not; None if they do not tell, or there is no such file.

    Raises InputError for files that are never read, such as logs of PX4 and pointers of Git LFS; one line says what
    the file is.
    """
    try:
        head = first_bytes(path, _ENOUGH_BYTES)
    except PackedError as error:
        raise InputError(f"{path}: {error}") from error
    except OSError:
        return None
    for magic, reason in _NOT_READ:
        if head.startswith(magic):
            raise InputError(f"{path}: {reason}")
    if head.startswith(DATAFLASH_BYTES):
        return Content.DATAFLASH_LOG
    if begins_with_entry(head):
        return Content.TELEMETRY_LOG
    return Content.LINK_BYTES if begins_with_frame(head) else None
