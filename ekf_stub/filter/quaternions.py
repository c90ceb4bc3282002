# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quaternion of numpy-quaternion where that is installed, else a type in Python with the same bits.

The package brings scipy, which is more than all else that an install takes, so only the extra `fast` asks for it.
"""

from typing import TYPE_CHECKING, Final

from ekf_stub.filter import plain_quaternion

if TYPE_CHECKING:
    from ekf_stub.filter.plain_quaternion import quaternion
else:
    try:
        from quaternion import quaternion
    except ModuleNotFoundError:
        quaternion = plain_quaternion.quaternion

one: Final = quaternion(1, 0, 0, 0)
zero: Final = quaternion(0, 0, 0, 0)
IS_PLAIN: Final[bool] = quaternion is plain_quaternion.quaternion
"""Whether the type is the one in Python, of which numpy knows nothing: arrays of it are arrays of objects."""

__all__ = ["IS_PLAIN", "one", "quaternion", "zero"]
