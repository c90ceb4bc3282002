# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Division of a byte stream into datagrams of one frame each (AP_HAL/utility/packetise.cpp).

Some clients read no more than a couple of kilobytes of a datagram.
"""

from collections.abc import Iterator
from typing import Final

_STX_V1: Final = 0xFE
_STX_V2: Final = 0xFD
_OVERHEAD_V1: Final = 8
_OVERHEAD_V2: Final = 12
_SIGNATURE: Final = 13
_FLAG_SIGNED: Final = 1
_OTHER_BYTES: Final = 256


def datagrams(data: bytes) -> Iterator[bytes]:
    """Yield the bytes in order, frame by frame; other bytes in pieces of at most 256."""
    start = 0
    while start < len(data):
        end = min(start + _frame_bytes(data, start), len(data))
        yield data[start:end]
        start = end


def _frame_bytes(data: bytes, start: int) -> int:
    marker, left = data[start], len(data) - start
    if marker == _STX_V1 and left >= _OVERHEAD_V1:
        return data[start + 1] + _OVERHEAD_V1
    if marker == _STX_V2 and left >= _OVERHEAD_V2:
        return data[start + 1] + _OVERHEAD_V2 + (_SIGNATURE if data[start + 2] & _FLAG_SIGNED else 0)
    return next(
        (at - start for at in range(start + 1, min(start + _OTHER_BYTES, len(data))) if data[at] in (_STX_V1, _STX_V2)),
        _OTHER_BYTES,
    )
