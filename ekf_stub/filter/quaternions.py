# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quaternion of numpy-quaternion, double precision, without the rest of that package.

Importing the package imports scipy's splines and, where it is installed, numba, for functions of time series: together
that takes longer than all else that an autopilot imports. A filter needs the type alone, which is an extension module
of its own. It is loaded under its own name, so that there is one type, whoever imports the whole package besides.
"""

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from types import ModuleType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from quaternion import one, quaternion, zero

_PACKAGE: Final = "quaternion"
_EXTENSION: Final = "quaternion.numpy_quaternion"


def _extension() -> ModuleType:
    """Return the extension module, or the package where that one is laid out in another way."""
    if _EXTENSION in sys.modules:
        return sys.modules[_EXTENSION]
    package = find_spec(_PACKAGE)
    spec = package and PathFinder.find_spec(_EXTENSION, package.submodule_search_locations)
    if spec is None or spec.loader is None:
        return import_module(_PACKAGE)
    module = sys.modules[_EXTENSION] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if not TYPE_CHECKING:
    quaternion = _extension().quaternion
    one = quaternion(1, 0, 0, 0)
    zero = quaternion(0, 0, 0, 0)

__all__ = ["one", "quaternion", "zero"]
