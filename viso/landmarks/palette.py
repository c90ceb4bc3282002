# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of pictures."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final


class Palette(StrEnum):
    """The palette: safe for colour-blind people, or the colours of older pictures."""

    SAFE = "safe"
    CLASSIC = "classic"


@dataclass(frozen=True, slots=True)
class Colours:
    """Colours of landmarks predicted and observed in the picture, those in the world, and aircraft in all views."""

    predicted: str
    observed: str
    landmark: str
    aircraft: str


COLOURS: Final[Mapping[Palette, Colours]] = MappingProxyType(
    {
        Palette.SAFE: Colours(predicted="#e69f00", observed="#4c8dff", landmark="#8e44ad", aircraft="#00a88a"),
        Palette.CLASSIC: Colours(predicted="#2ecc40", observed="#ff4136", landmark="#0057d9", aircraft="#ff851b"),
    }
)
