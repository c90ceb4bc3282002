# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The departure of a stream's heading from the vehicle's, without the constant part."""

from typing import Final

import numpy as np

from viso.estimators.axis_rotations import PROPER
from viso.geometry.rotation import Array, rotations_from_quats

_ENOUGH: Final = 500
_DIRECTIONS: Final = np.radians(np.arange(0.0, 360.0, 2.0))
_PASSES: Final = 3


def heading_departure(stream_wxyz: Array, vehicle_wxyz: Array) -> Array:
    """Return the stream's heading less the vehicle's in rad, [N], less the usual difference.

    The axes of the stream's body and world may be any; the body's need not be at exact right angles. The best-fitting
    choice of axes is used.

    Args:
        stream_wxyz: unit quaternions from the stream's body to its world, [N, 4].
        vehicle_wxyz: of the vehicle, from its body (FRD) to the earth (NED), at the same times.
    """
    stream, vehicle = rotations_from_quats(stream_wxyz), rotations_from_quats(vehicle_wxyz)
    every = max(1, len(stream) // _ENOUGH)

    def fixed(body: Array) -> float:
        return float(np.linalg.norm(np.mean(_worlds(stream[::every], vehicle[::every], body), axis=0)))

    as_one = _worlds(stream, vehicle, max(PROPER, key=fixed))
    by_yaw = np.angle(_yaw(vehicle) * np.conj(_yaw(stream)))
    departures = [_less_usual(angles) for angles in (_headings(as_one), by_yaw)]
    return min(departures, key=lambda angles: float(np.quantile(np.abs(angles), 0.9)))


def _worlds(stream: Array, vehicle: Array, body: Array) -> Array:
    """Return the rotations [N, 3, 3] from the stream's world to the earth, for given axes of its body."""
    return np.asarray(vehicle @ body @ stream.transpose(0, 2, 1), dtype=np.float64)


def _headings(to_earth: Array) -> Array:
    """Return the heading of a horizontal axis of the stream's world on the earth, rad."""
    vertical = int(np.abs(to_earth[:, 2, :].mean(axis=0)).argmax())
    horizontal = 1 if vertical == 0 else 0
    return np.asarray(np.angle(to_earth[:, :2, horizontal] @ np.array([1.0, 1j])), dtype=np.float64)


def _yaw(attitudes: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    return attitudes[:, 0, 0] + 1j * attitudes[:, 1, 0]


def _less_usual(angles: Array) -> Array:
    """Return angles less the one about which half of them lie closest."""
    thinned = angles[:: max(1, len(angles) // _ENOUGH)]
    off = np.abs(np.angle(np.exp(1j * (thinned[:, None] - _DIRECTIONS))))
    middle = float(_DIRECTIONS[np.argmin(np.median(off, axis=0))])
    for _ in range(_PASSES):
        near = np.angle(np.exp(1j * (thinned - middle)))
        middle += float(np.median(near[np.abs(near) <= np.median(np.abs(near)) + 1e-9]))
    return np.asarray(np.angle(np.exp(1j * (angles - middle))), dtype=np.float64)
