# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Public names of a package that are imported when they are asked for: to import the package alone takes nothing.

A package states its names twice, where type checkers and editors look for them: in ``__all__``, and with their modules
in a block under ``if TYPE_CHECKING``, of which this is told by name alone.
"""

import ast
import linecache
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module


def lazily(package: str) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` (PEP 562) of a package with a block ``if TYPE_CHECKING`` of its names."""
    module = sys.modules[package]

    @cache
    def homes() -> dict[str, str]:
        return _imports_for_checkers("".join(linecache.getlines(str(module.__file__), vars(module))))

    def get(name: str) -> object:
        if name.startswith("__") or name not in homes():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes()[name]), name)
        setattr(module, name, value)
        return value

    return get, lambda: sorted({*vars(module), *homes()})


def _imports_for_checkers(source: str) -> dict[str, str]:
    """Return the names that are imported under ``if TYPE_CHECKING``, each with its module."""
    blocks = (node for node in ast.parse(source).body if isinstance(node, ast.If))
    imports = (line for block in blocks for line in block.body if isinstance(line, ast.ImportFrom))
    return {name.name: str(line.module) for line in imports for name in line.names}
