# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile the modules of a package with mypyc, as one group: `compile_native.py ROOT PACKAGE TARGET`.

The compiled modules come into a folder of TARGET, which is the package itself, or what becomes the package in a wheel.
ROOT is the project, and PACKAGE a folder in it. The program ends with an error, and its reason as the last line, when
the package goes without. An empty folder then tells that this was tried.
"""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Final

# Where a wheel is built, the project itself is not installed.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from ap_core.native import COMPILED, PURE_VARIABLE, digest, is_pure, modules_of

LIBRARY: Final = "native"
"""The module of a package that its compiled modules share."""
OPTIMISATION_VARIABLE: Final = "MYPYC_OPT_LEVEL"
"""The environment variable that, set to 0, has a test wait for less; mypy's own set-up knows it too."""
C_OPTIONS: Final = (
    "-ffp-contract=off",  # a multiplication and an addition in one differ from the interpreter by a bit
    "-fno-fast-math",
    "-Wno-error",  # mypyc lets warnings fail, and other compilers have others
)


def main(root: Path, package: Path, target: Path) -> None:
    """Compile a package of `root`; leave its modules, or an empty folder, in `target`."""
    if is_pure():
        sys.exit(f"{PURE_VARIABLE} is set")
    os.chdir(root)
    builds = target.resolve() / COMPILED
    builds.mkdir(parents=True, exist_ok=True)
    build = builds / digest(package)
    with tempfile.TemporaryDirectory(prefix="draft-", dir=builds) as draft:
        try:
            _require_tools()
            modules = _compile(package, Path(draft))
        except (Exception, SystemExit):
            build.mkdir(exist_ok=True)
            _remove_others(build)
            raise
        if build.name != digest(package):
            sys.exit("a source has changed meanwhile")
        shutil.rmtree(build, ignore_errors=True)
        modules.rename(build)
        _remove_others(build)


def _require_tools() -> None:
    """Exit with a reason where nothing can be compiled."""
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]
    if shutil.which(compiler) is None:
        sys.exit(f"there is no C compiler {compiler}")
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.is_file():
        sys.exit(f"there is no {header}, which a package like python3-dev brings")


def _compile(package: Path, draft: Path) -> Path:
    """Return the folder of the compiled modules, in `draft`."""
    from mypyc.build import mypycify
    from setuptools import Distribution
    from setuptools.command.build_ext import build_ext

    group = ".".join([*package.parts, LIBRARY])
    extensions = mypycify(
        ["--follow-imports=silent", *map(str, modules_of(package))],
        opt_level=os.environ.get(OPTIMISATION_VARIABLE, "3"),
        debug_level="0",
        target_dir=str(draft / "c"),
        group_name=group,
    )
    for extension in extensions:
        extension.extra_compile_args = [*extension.extra_compile_args, *C_OPTIONS]
    command = build_ext(Distribution({"ext_modules": extensions}))
    command.build_lib, command.build_temp = str(draft / "lib"), str(draft / "objects")
    command.ensure_finalized()
    command.run()
    return draft / "lib" / package


def _remove_others(build: Path) -> None:
    """Remove what earlier sources left, and interrupted runs."""
    for other in build.parent.iterdir():
        if other.is_dir() and other != build:
            shutil.rmtree(other, ignore_errors=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
