# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Packages whose modules are also compiled, and the choice of what is imported.

The source is the definition. Compiled modules lie in a folder of the package. Its name is the digest of the sources and
of the Python that they were compiled for, so that they are found by the same sources and the same Python only.
"""

import os
from collections.abc import MutableSequence
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import source_hash
from pathlib import Path
from typing import Final

PURE_VARIABLE: Final = "VISO_PURE"
"""The environment variable that, set to 1, has the sources interpreted."""
COMPILED: Final = "_compiled"


def modules_of(package: Path) -> list[Path]:
    """Return the sources that are compiled: all modules of a package, without the package's own."""
    return sorted(path for path in package.glob("*.py") if path.name != "__init__.py")


def digest(package: Path) -> str:
    """Return the name of the folder of compiled modules: a digest of the sources, with their names, and of Python."""
    parts = [EXTENSION_SUFFIXES[0].encode()]
    for path in modules_of(package):
        parts += [path.name.encode(), path.read_bytes()]
    return source_hash(b"\0".join(parts)).hex()


def use_compiled(package: str, path: MutableSequence[str]) -> bool:
    """Have a package's modules imported from what is compiled, where that is there and fits.

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
    if not any(build.iterdir()):  # these sources could not be compiled, which was reported then
        return False
    path.insert(0, str(build))
    return True


def is_pure() -> bool:
    """Return whether the environment asks for the interpreted sources."""
    return os.environ.get(PURE_VARIABLE, "0") not in {"", "0"}


def _tell_stale(package: str) -> None:
    import logging  # which takes long

    logging.getLogger(__name__).warning(
        "%s runs interpreted: its sources are not those that were compiled; tools/viso or pip install compiles them",
        package,
    )
