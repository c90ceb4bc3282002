# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Internal errors: conditions that the firmware records as its own bugs and reports until reboot.

Source: AP_InternalError/AP_InternalError.h, AP_InternalError/AP_InternalError.cpp.
"""

from enum import IntFlag
from typing import Final, Protocol


class InternalError(IntFlag):
    """Bits of the firmware's internal error mask that this project can raise."""

    CONSTRAINING_NAN = 1 << 10
    FLOW_OF_CONTROL = 1 << 20
    BAD_ROTATION = 1 << 22


_DESCRIPTIONS: Final = {
    InternalError.CONSTRAINING_NAN: "cnstring_nan",
    InternalError.FLOW_OF_CONTROL: "flow_of_ctrl",
    InternalError.BAD_ROTATION: "bad_rotation",
}


class InternalErrorSink(Protocol):
    """A receiver of internal errors."""

    def __call__(self, error: InternalError, line: int = 0, /) -> None:
        """Record an error and the line of the firmware's source that raises it, which the firmware reports."""


class InternalErrors:
    """Collects internal errors as AP_InternalError does: a mask, a count, the last error and its line."""

    def __init__(self) -> None:
        self.mask = 0
        self.count = 0
        self.last: InternalError | None = None
        self.last_line = 0

    def __call__(self, error: InternalError, line: int = 0, /) -> None:
        """Record one error (AP_InternalError::error)."""
        self.mask |= int(error)
        self.count += 1
        self.last = error
        self.last_line = line

    def describe(self) -> str:
        """Return the names of the errors so far, in the order of their bits (AP_InternalError::errors_as_string)."""
        return ",".join(text for error, text in _DESCRIPTIONS.items() if self.mask & error)
