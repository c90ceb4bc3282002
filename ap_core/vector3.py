# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Three float32 components (AP_Math/vector3.h, Vector3f)."""

import math

import numpy as np

from ap_core.fmath import f32, norm3


class Vector3f:
    """A vector of three float32 values; treat it as immutable, every operation returns a new one.

    Components are coerced once, here; operators keep float32 and the firmware's order of operations.
    """

    __slots__ = ("x", "y", "z")

    def __init__(self, x: float | np.float32 = 0.0, y: float | np.float32 = 0.0, z: float | np.float32 = 0.0):
        # Most are float32 already; the check costs a tenth of a conversion.
        self.x = x if type(x) is f32 else f32(x)
        self.y = y if type(y) is f32 else f32(y)
        self.z = z if type(z) is f32 else f32(z)

    def __repr__(self) -> str:
        return f"Vector3f({self.x}, {self.y}, {self.z})"

    def __eq__(self, other: object) -> bool:
        # Exact, unlike the firmware's is_equal: only tests compare vectors, the port never does.
        return isinstance(other, Vector3f) and self.to_tuple() == other.to_tuple()

    def __hash__(self) -> int:
        return hash(self.to_tuple())

    def __add__(self, other: "Vector3f") -> "Vector3f":
        return Vector3f(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: "Vector3f") -> "Vector3f":
        return Vector3f(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: np.float32) -> "Vector3f":
        return Vector3f(self.x * factor, self.y * factor, self.z * factor)

    def __truediv__(self, divisor: np.float32) -> "Vector3f":
        return Vector3f(self.x / divisor, self.y / divisor, self.z / divisor)

    def to_tuple(self) -> tuple[np.float32, np.float32, np.float32]:
        """Return (x, y, z)."""
        return self.x, self.y, self.z

    def length(self) -> np.float32:
        """Return the length (vector3.cpp, Vector3<T>::length)."""
        return norm3(self.x, self.y, self.z)

    def is_nan(self) -> bool:
        """Return whether any component is NaN (vector3.cpp, Vector3<T>::is_nan)."""
        return math.isnan(self.x) or math.isnan(self.y) or math.isnan(self.z)
