# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Internal errors: conditions that the firmware records as its own bugs and reports until reboot.

Source: AP_InternalError/AP_InternalError.h.
"""

from collections.abc import Callable
from enum import IntFlag


class InternalError(IntFlag):
    """Bits of the firmware's internal error mask that this project can raise."""

    BAD_ROTATION = 1 << 22
    CONSTRAINING_NAN = 1 << 10


InternalErrorSink = Callable[[InternalError], None]


class InternalErrors:
    """Collect internal errors as AP_InternalError does: a mask, a count and the last error."""

    def __init__(self) -> None:
        self.mask = 0
        self.count = 0
        self.last: InternalError | None = None

    def __call__(self, error: InternalError) -> None:
        """Record one error (AP_InternalError::error)."""
        self.mask |= int(error)
        self.count += 1
        self.last = error
