# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Float32 values as eight hex digits, the notation of recorded behaviour."""

import struct

import numpy as np

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f

NAN_BITS = "7fc00000"


def bits_of(value: np.float32) -> str:
    """Return the binary32 bits, most significant first; every NaN gives the same bits."""
    if np.isnan(value):
        return NAN_BITS
    return struct.pack(">f", value).hex()


def float_of(bits: object) -> np.float32:
    """Return the value of eight hex digits. Raises ValueError if ``bits`` is anything else."""
    if not isinstance(bits, str) or len(bits) != 8:
        raise ValueError(f"not a float in hex: {bits!r}")
    return np.float32(np.frombuffer(bytes.fromhex(bits), ">f4")[0])


def floats_of(bits: object, count: int) -> tuple[np.float32, ...]:
    """Return the values of a list of ``count`` floats in hex. Raises ValueError if ``bits`` is anything else."""
    if not isinstance(bits, list) or len(bits) != count:
        raise ValueError(f"not a list of {count} floats in hex: {bits!r}")
    return tuple(float_of(item) for item in bits)


def vector_of(bits: object) -> Vector3f:
    """Return the vector of three floats in hex; ValueError otherwise."""
    return Vector3f(*floats_of(bits, 3))


def quaternion_of(bits: object) -> Quaternion:
    """Return the quaternion of four floats in hex, w first; ValueError otherwise."""
    return Quaternion(*floats_of(bits, 4))


def json_value(value: object) -> object:
    """Return a record's field as recorded behaviour writes it: floats in hex, everything else plain."""
    return bits_of(value) if isinstance(value, np.float32) else value
