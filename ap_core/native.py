# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Packages with compiled modules, and the choice between these and the sources.

The sources are authoritative. Compiled modules lie in a folder of the package. The folder's name is a digest of the
sources and of the Python version, so only the same sources and the same Python find it.
"""

import os
from collections.abc import MutableSequence
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import source_hash
from pathlib import Path
from typing import Final

PURE_VARIABLE: Final = "VISO_PURE"
"""The environment variable that, set to 1, selects the interpreted sources."""
COMPILED: Final = "_compiled"


def modules_of(package: Path) -> list[Path]:
    """Return the sources to compile: all modules of a package except ``__init__``."""
    return sorted(path for path in package.glob("*.py") if path.name != "__init__.py")


def digest(package: Path) -> str:
    """Return the name of the folder of compiled modules: a digest of sources, their names and the Python version."""
    parts = [EXTENSION_SUFFIXES[0].encode()]
    for path in modules_of(package):
        parts += [path.name.encode(), path.read_bytes()]
    return source_hash(b"\0".join(parts)).hex()


def use_compiled(package: str, path: MutableSequence[str]) -> bool:
    """Import a package's compiled modules, if they exist and match the sources.

    Args:
        package: ``__name__`` of the package, whose ``__init__`` calls this.
        path: its ``__path__``.

    Returns:
        Whether compiled modules are used.
    """
    folder = Path(path[0])
    builds = folder / COMPILED
    if is_pure() or not builds.is_dir():
        return False
    build = builds / digest(folder)
    if not build.is_dir():
        _tell_stale(package)
        return False
    if not any(build.iterdir()):  # compilation of these sources failed and was reported then
        return False
    path.insert(0, str(build))
    return True


def is_pure() -> bool:
    """Return whether the environment selects the interpreted sources."""
    return os.environ.get(PURE_VARIABLE, "0") not in {"", "0"}


def _tell_stale(package: str) -> None:
    import logging  # a slow import

    logging.getLogger(__name__).warning(
        "%s runs interpreted: its sources are not those that were compiled; tools/viso or pip install compiles them",
        package,
    )
