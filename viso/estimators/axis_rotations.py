# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Permutations of axes: the 24 rotations by right angles, the 24 mirrored ones, and their names."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import Final

import numpy as np

from ap_core.internal_error import InternalErrors
from ap_core.rotations import Rotation, rotate_vector
from ap_core.vector3 import Vector3f
from ap_visualodom.var_info import VAR_INFO
from viso.geometry.rotation import Array

# The directions of the axes x, y, z of the vehicle and of the earth, then of their opposites.
BODY_WORDS: Final = ("forward", "right", "down", "back", "left", "up")
EARTH_WORDS: Final = ("north", "east", "down", "south", "west", "up")

_OF_RIGHT_ANGLES: Final = 38  # later rotations have other angles
_ORIENT_NAMES: Final = next(row for row in VAR_INFO if row.name == "_ORIENT").values or {}


def _signed_permutations() -> list[Array]:
    signs = product((1.0, -1.0), repeat=3)
    return [np.eye(3)[list(order)] * sign for sign in signs for order in permutations(range(3))]


PROPER: Final = tuple(matrix for matrix in _signed_permutations() if np.linalg.det(matrix) > 0)
MIRRORED: Final = tuple(matrix for matrix in _signed_permutations() if np.linalg.det(matrix) < 0)


@dataclass(frozen=True, slots=True)
class AxisMap:
    """The directions of the axes x, y and z of a stream.

    Attributes:
        signed_axes: for each of them 1, 2 or 3 for x, y or z of the reference, negative for the opposite direction.
    """

    signed_axes: tuple[int, int, int]

    @classmethod
    def of(cls, matrix: Array) -> "AxisMap":
        """Return the map of a matrix [3, 3] of zeros and ones, of either sign, from the stream to the reference."""
        rows = np.abs(matrix).argmax(axis=0)
        x, y, z = (int(np.sign(matrix[row, column])) * (int(row) + 1) for column, row in enumerate(rows))
        return cls((x, y, z))

    @property
    def matrix(self) -> Array:
        """The matrix [3, 3] from the stream's axes to the reference's."""
        matrix = np.zeros((3, 3))
        for column, axis in enumerate(self.signed_axes):
            matrix[abs(axis) - 1, column] = np.sign(axis)
        return matrix

    @property
    def is_identity(self) -> bool:
        """Whether the stream's axes are the reference's."""
        return self.signed_axes == (1, 2, 3)

    @property
    def rotation(self) -> Rotation | None:
        """The firmware's orientation with this matrix, one of VISO_ORIENT's if possible; None if mirrored."""
        return _ROTATIONS.get(self.signed_axes)

    def directions(self, words: Sequence[str]) -> list[str]:
        """Return the words for x, y and z, of six words as in ``BODY_WORDS``."""
        return [words[abs(axis) - 1 + (3 if axis < 0 else 0)] for axis in self.signed_axes]

    def letters(self, words: Sequence[str]) -> str:
        """Return the usual short name, such as FLU or ENU."""
        return "".join(word[0].upper() for word in self.directions(words))

    def describe(self, subject: str, words: Sequence[str]) -> str:
        """Return all in words: ``camera x is vehicle -y (left), ...`` with the subject ``camera {} is vehicle``."""
        parts = zip("xyz", self.signed_axes, self.directions(words), strict=True)
        return ", ".join(
            f"{subject.format(name)} {'-' if axis < 0 else ''}{'xyz'[abs(axis) - 1]} ({word})"
            for name, axis, word in parts
        )


def orient_name(rotation: Rotation) -> str:
    """Return VISO_ORIENT's name of an orientation, such as Left, or else the firmware's name."""
    return _ORIENT_NAMES.get(int(rotation), rotation.name)


def rotation_matrix(rotation: int) -> Array:
    """Return the matrix [3, 3] of one of the firmware's orientations."""
    columns = [rotate_vector(Vector3f(*unit), rotation, InternalErrors()) for unit in np.eye(3, dtype=np.float32)]
    return np.array([[float(column.x), float(column.y), float(column.z)] for column in columns]).T


def _rotations() -> dict[tuple[int, int, int], Rotation]:
    found: dict[tuple[int, int, int], Rotation] = {}
    for number in dict.fromkeys((*_ORIENT_NAMES, *range(_OF_RIGHT_ANGLES))):
        matrix = rotation_matrix(number)
        if np.isin(np.abs(matrix), (0.0, 1.0)).all():
            found.setdefault(AxisMap.of(matrix).signed_axes, Rotation(number))
    return found


_ROTATIONS: Final = _rotations()
