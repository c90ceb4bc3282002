# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quaternion of numpy-quaternion where that is installed, else a type in Python with the same bits.

The package brings scipy, which is more than all else that an install takes, so only the extra `fast` asks for it.
"""

import sys
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import TYPE_CHECKING, Final

from viso.geometry import plain_quaternion

_EXTENSION: Final = "quaternion.numpy_quaternion"


def _find_type() -> type:
    """Return the type; the package's own module is passed by, as it imports scipy and numba, for most of a second."""
    if _EXTENSION not in sys.modules:
        package = find_spec("quaternion")
        spec = package and PathFinder.find_spec(_EXTENSION, package.submodule_search_locations)
        if not spec or spec.loader is None:
            return plain_quaternion.quaternion
        sys.modules[_EXTENSION] = module = module_from_spec(spec)
        spec.loader.exec_module(module)
    found: type = sys.modules[_EXTENSION].quaternion
    return found


if TYPE_CHECKING:
    from viso.geometry.plain_quaternion import quaternion
else:
    quaternion = _find_type()

one: Final = quaternion(1, 0, 0, 0)
zero: Final = quaternion(0, 0, 0, 0)
IS_PLAIN: Final[bool] = quaternion is plain_quaternion.quaternion
"""Whether the type is the one in Python, of which numpy knows nothing: arrays of it are arrays of objects."""

__all__ = ["IS_PLAIN", "one", "quaternion", "zero"]
