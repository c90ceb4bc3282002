# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The firmware that the emulator claims to be."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Firmware:
    """A release: its texts and version numbers.

    ``sw_version`` packs major, minor, patch and type (0 development) as AUTOPILOT_VERSION wants it.
    """

    name: str
    version_text: str
    source_hash: str
    major: int
    minor: int
    patch: int
    release_type: int

    @property
    def banner(self) -> str:
        """Return the text by which ground stations and log readers know the vehicle."""
        return f"{self.version_text} ({self.source_hash})"

    @property
    def sw_version(self) -> int:
        """Return AUTOPILOT_VERSION.flight_sw_version."""
        return self.major << 24 | self.minor << 16 | self.patch << 8 | self.release_type


REFERENCE: Final = Firmware("4.7-dev", "ArduCopter V4.7.0-dev", "2b361bde", 4, 7, 0, 0)
