# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors of three plain numbers: at 400 per second an array of numpy for each would cost too much."""

import math
from typing import Final

Three = tuple[float, float, float]

ZERO: Final = (0.0, 0.0, 0.0)


def added(vector: Three, other: Three, factor: float = 1.0) -> Three:
    """Return a vector plus a multiple of another one."""
    return vector[0] + factor * other[0], vector[1] + factor * other[1], vector[2] + factor * other[2]


def scaled(vector: Three, factor: float) -> Three:
    """Return a multiple of a vector."""
    return factor * vector[0], factor * vector[1], factor * vector[2]


def turned(vector: Three, angle_rad: float) -> Three:
    """Return a vector turned about the vertical, to the right."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1], vector[2]


def limited_length(vector: Three, limit: float) -> Three:
    """Return a vector, no longer than the limit."""
    length = math.hypot(*vector)
    return vector if length <= limit else scaled(vector, limit / length)
