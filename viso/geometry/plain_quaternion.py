# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A quaternion in Python: it stands in where numpy-quaternion is not installed, ten times slower, bit for bit equal."""

import math

import numpy as np
import numpy.typing as npt

_EPSILON = 1e-14  # below it numpy-quaternion takes a length for none


class quaternion:
    """Four numbers in double precision, w the real one. Operations are those of numpy-quaternion that are used here."""

    __slots__ = ("w", "x", "y", "z")

    def __init__(self, w: float, x: float, y: float, z: float) -> None:
        self.w, self.x, self.y, self.z = float(w), float(x), float(y), float(z)

    def __repr__(self) -> str:
        return f"quaternion({self.w!r}, {self.x!r}, {self.y!r}, {self.z!r})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, quaternion):
            return NotImplemented
        return self.w == other.w and self.x == other.x and self.y == other.y and self.z == other.z

    __hash__ = None  # type: ignore[assignment]  # for it can be changed

    @property
    def components(self) -> tuple[float, float, float, float]:
        """All four, w first."""
        return self.w, self.x, self.y, self.z

    @property
    def vec(self) -> npt.NDArray[np.float64]:
        """The last three."""
        return np.array((self.x, self.y, self.z))

    def __neg__(self) -> "quaternion":
        return quaternion(-self.w, -self.x, -self.y, -self.z)

    def __add__(self, other: "quaternion") -> "quaternion":
        return quaternion(self.w + other.w, self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: "quaternion") -> "quaternion":
        return quaternion(self.w - other.w, self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, other: "quaternion | float") -> "quaternion":
        if isinstance(other, quaternion):
            a, b, c, d = self.w, self.x, self.y, self.z
            w, x, y, z = other.w, other.x, other.y, other.z
            return quaternion(
                a * w - b * x - c * y - d * z,
                a * x + b * w + c * z - d * y,
                a * y - b * z + c * w + d * x,
                a * z + b * y - c * x + d * w,
            )
        return self.__rmul__(other)

    def __rmul__(self, other: float) -> "quaternion":
        if isinstance(other, float | int | np.floating):
            factor = float(other)
            return quaternion(factor * self.w, factor * self.x, factor * self.y, factor * self.z)
        return NotImplemented  # an array goes through its elements

    def __truediv__(self, divisor: float) -> "quaternion":
        return quaternion(self.w / divisor, self.x / divisor, self.y / divisor, self.z / divisor)

    def conj(self) -> "quaternion":
        """Return the turn back, of a unit quaternion."""
        return quaternion(self.w, -self.x, -self.y, -self.z)

    conjugate = conj

    def norm(self) -> float:
        """Return the sum of the squares."""
        return self.w * self.w + self.x * self.x + self.y * self.y + self.z * self.z

    def __abs__(self) -> float:
        """Return the length."""
        return math.sqrt(self.norm())

    abs = __abs__

    def normalized(self) -> "quaternion":
        """Return the same of length 1, or what C's division by no length comes to."""
        length = self.abs()
        if length == 0.0:
            return self * math.inf
        return self / length

    def exp(self) -> "quaternion":
        """Return the exponential, which is the rotation of half a rotation vector; w must be 0."""
        angle = math.sqrt(self.x * self.x + self.y * self.y + self.z * self.z)
        if angle <= _EPSILON or math.isnan(angle):
            return quaternion(1.0, 0.0, 0.0, 0.0)
        if angle == math.inf:
            return quaternion(math.nan, math.nan, math.nan, math.nan)
        part = math.sin(angle) / angle
        return quaternion(math.cos(angle), part * self.x, part * self.y, part * self.z)

    def log(self) -> "quaternion":
        """Return the logarithm, which is half the rotation vector of a rotation; the length must be about 1."""
        length = math.sqrt(self.x * self.x + self.y * self.y + self.z * self.z)
        if length <= _EPSILON * abs(self.w):
            return quaternion(0.0, math.pi if self.w < 0.0 else 0.0, 0.0, 0.0)
        angle = math.atan2(length, self.w) / length
        real = math.log(self.w * self.w + length * length) / 2.0
        return quaternion(real, angle * self.x, angle * self.y, angle * self.z)
