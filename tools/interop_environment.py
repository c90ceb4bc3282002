# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the environment of the interop tests' clients on first use; `tools/interop` then runs those tests.

The clients are heavy and no part of the program, so they live apart in `.venv-interop`: those in Python from
requirements/interop.lock, the one in JavaScript from tools/interop_node/package-lock.json. A browser is the system's:
where that is Debian and we may, its Chromium is installed; elsewhere the tests of the page are skipped without one.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import ssl
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tools import bootstrap
from tools.bootstrap import ROOT, SetupError, Stamp

NAME = ".venv-interop"
LOCK = Path("requirements", "interop.lock")
NODE = Path("tools", "interop_node")
NODE_FILES = ("package.json", "package-lock.json")
PROFILE = "interop"
BROWSER_PROGRAMS = ("chromium", "chromedriver")
BROWSER_PACKAGES = ("chromium", "chromium-driver")
SYSTEM_CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"  # where Debian has them, whatever Python was built for


def ensure(root: Path = ROOT) -> Path:
    """Return the environment's directory after making or remaking it where needed.

    Raises:
        SetupError: with the last lines of the step that failed.
    """
    folder = root / NAME
    if _is_current(root, folder):
        return folder
    with bootstrap.only_one(root):
        if not _is_current(root, folder):  # another process may have done it meanwhile
            _set_up(root, folder)
    return folder


def digest(root: Path) -> str:
    """Hash all that decides what gets installed: both locks, the browser and the place."""
    files = [root / LOCK, *(root / NODE / name for name in NODE_FILES)]
    parts = [*(path.read_bytes() for path in files), *(name.encode() for name in BROWSER_PACKAGES)]
    return hashlib.sha256(b"\0".join([str(root).encode(), *parts])).hexdigest()


def _is_current(root: Path, folder: Path) -> bool:
    return bootstrap.read_stamp(folder) == Stamp(PROFILE, digest(root), True)


def _set_up(root: Path, folder: Path) -> None:
    sys.stderr.write(f"viso: setting up {NAME}, once, takes about a minute ... ")
    sys.stderr.flush()
    started = time.monotonic()
    try:
        shutil.rmtree(folder, ignore_errors=True)
        _install_python(root, folder)
        _install_node(root, folder / "node")
        _install_browser()
        bootstrap.write_stamp(folder, Stamp(PROFILE, digest(root), True))
    except (SetupError, OSError):
        sys.stderr.write("failed\n")
        raise
    sys.stderr.write(f"done in {time.monotonic() - started:.0f} s\n")


def _install_python(root: Path, folder: Path) -> None:
    bootstrap.run([sys.executable, "-I", "-m", "venv", str(folder)], f"making {NAME}")
    pip = [str(folder / "bin" / "python"), "-I", "-m", "pip", "install", "--quiet", "--no-input"]
    # The lock leaves out on purpose what headless use does not need.
    locked = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r", str(root / LOCK)]
    bootstrap.run([*pip, "--disable-pip-version-check", *locked], f"installing {LOCK}")


def _install_node(root: Path, folder: Path) -> None:
    npm = shutil.which("npm")
    if npm is None:
        raise SetupError("the interop tests need node and npm, PATH has no npm")
    folder.mkdir()
    for name in NODE_FILES:
        shutil.copy(root / NODE / name, folder)
    options = ["--ignore-scripts", "--legacy-peer-deps", "--no-audit", "--no-fund", "--loglevel=error"]
    what = f"installing {NODE / NODE_FILES[1]}"
    bootstrap.run([npm, "ci", "--prefix", str(folder), *options], what, environment=_node_environment())


def _install_browser() -> None:
    if all(map(shutil.which, BROWSER_PROGRAMS)) or shutil.which("apt-get") is None or os.geteuid() != 0:
        return
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    bootstrap.run(["apt-get", "-qq", "update"], "listing Debian's packages", environment=quiet)
    install = ["apt-get", "-qq", "install", "--yes", "--no-install-recommends", *BROWSER_PACKAGES]
    bootstrap.run(install, "installing Chromium", environment=quiet)


def _node_environment() -> dict[str, str]:
    """Return the environment for npm, which does not know the system's certificates by itself."""
    certificates = ssl.get_default_verify_paths().cafile or SYSTEM_CERTIFICATES
    known = {"NODE_EXTRA_CA_CERTS": certificates} if Path(certificates).exists() else {}
    return {**known, **os.environ}


def main(args: Sequence[str]) -> int:
    """Set up, then run the tests; return pytest's exit code, or 2 when set-up failed."""
    parser = argparse.ArgumentParser(prog="tools/interop", description="Run the tests with real clients.")
    parser.add_argument("--set-up", action="store_true", help="only make the environment")
    tree_help = "run instead the firmware's own autotests of a checkout, with viso sitl in the simulator's place"
    parser.add_argument("--autotest", type=Path, metavar="TREE", help=tree_help)
    parser.add_argument("--firmware", default="4.7", help="the release that the checkout is, 4.7 unless given")
    parser.add_argument("names", nargs="*", metavar="NAME", help="of autotests, for those alone")
    options = parser.parse_args(args)
    if options.autotest is not None and not (options.autotest / "Tools" / "autotest" / "autotest.py").is_file():
        parser.error(
            f"--autotest {options.autotest}: no checkout of the firmware: it has no Tools/autotest/autotest.py"
        )
    try:
        folder = ensure()
    except (SetupError, OSError) as error:
        sys.stderr.write(f"viso: {error}\n")
        return 2
    if options.autotest is not None:
        from tools import autotest

        work = Path(tempfile.mkdtemp(prefix="viso-autotest-"))
        python = folder / "bin" / "python"
        return not autotest.check(python, options.autotest.resolve(), work, options.firmware, options.names)
    tests = [sys.executable, "-m", "pytest", "-n", "2", "-m", "interop", "tests/interop"]
    return 0 if options.set_up else subprocess.run(tests, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
