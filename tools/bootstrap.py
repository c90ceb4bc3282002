# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the project's virtual environment on first use, then hand over to a program in it.

Only the standard library is imported, and the text stays readable for Python 3.7, so that an interpreter
that is too old can still look for a newer one or say what is wrong.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
MINIMUM_PYTHON = (3, 11)
NEWER_PYTHONS = ("python3.13", "python3.12", "python3.11")
LOCKS = {"run": "requirements/run.lock", "dev": "requirements/dev.lock"}
STAMP_NAME = "viso-setup.json"
COMPILE_PROGRAM = "tools/compile_native.py"
COMPILED_PACKAGE = "ekf_stub/core"
COMPILERS = ("cc", "gcc", "clang")
SHOWN_LINES = 6


class SetupError(Exception):
    """Set-up cannot go on; the text is for the user."""


class Stamp(NamedTuple):
    """What a finished (or, with an empty profile, unfinished) set-up left in the environment."""

    profile: str
    digest: str
    ours: bool  # False when the directory was there before: it is filled, never deleted


def launch(profile: str, command: Sequence[str], root: Path = ROOT) -> int:
    """Set up `profile` where needed, then replace this process by `command` from the environment.

    Args:
        profile: `run` for the program alone, `dev` for the checks as well.
        command: name of a program in the environment's `bin`, and its arguments.
        root: the project, the directory of pyproject.toml.

    Returns:
        2 when set-up failed, 130 when it was interrupted; otherwise it does not return.
    """
    try:
        require_python()
        venv = ensure_environment(root, profile)
        ensure_compiled(root, venv)
        program = str(venv / "bin" / command[0])
        sys.stdout.flush()
        os.execv(program, [program, *command[1:]])
    except (SetupError, OSError) as error:
        sys.stderr.write(f"viso: {error}\n")
    except KeyboardInterrupt:
        sys.stderr.write("\nviso: set-up interrupted, the next run starts it again\n")
        return 130
    return 2


def require_python(version: tuple[int, ...] = sys.version_info[:3]) -> None:
    """Go on in a newer Python from PATH when `version`, this one's, is too old; else raise SetupError."""
    if version[:2] >= MINIMUM_PYTHON:
        return
    for name in NEWER_PYTHONS:
        path = shutil.which(name)
        if path is not None and _is_new_enough(path):
            os.execv(path, [path, *sys.argv])
    needed = ".".join(map(str, MINIMUM_PYTHON))
    found = ".".join(map(str, version))
    raise SetupError(f"Python {needed} or newer is needed, this is {found} and PATH has no newer one")


def _is_new_enough(python: str) -> bool:
    """Return whether the interpreter starts (a version manager's shim may not) and is new enough."""
    test = f"import sys; sys.exit(sys.version_info[:2] < {MINIMUM_PYTHON})"
    return subprocess.run([python, "-c", test], capture_output=True, check=False).returncode == 0


def ensure_environment(root: Path, profile: str) -> Path:
    """Return the environment's directory after making, upgrading or rebuilding it where needed."""
    venv = root / ".venv"
    if _is_current(root, venv, profile):
        return venv
    with only_one(root):
        if not _is_current(root, venv, profile):  # another process may have done it meanwhile
            _set_up(root, venv, profile)
    return venv


def digest(root: Path, profile: str) -> str:
    """Hash all that decides what gets installed: the lock, pyproject's packaging tables and the place."""
    import tomllib  # here because Python 3.10 and older must get through the imports above

    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    tables = [project.get(name) for name in ("build-system", "project", "dependency-groups")]
    tables.append(project.get("tool", {}).get("hatch"))
    packaging = json.dumps([tables, str(root)], sort_keys=True).encode()
    return hashlib.sha256(packaging + (root / LOCKS[profile]).read_bytes()).hexdigest()


def read_stamp(venv: Path) -> Stamp | None:
    """Return the stamp of the environment; None when set-up never touched it."""
    try:
        fields = json.loads((venv / STAMP_NAME).read_text(encoding="utf-8"))
        return Stamp(str(fields["profile"]), str(fields["digest"]), bool(fields["ours"]))
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError):
        return Stamp("", "", True)  # cut short while it was written


def write_stamp(venv: Path, stamp: Stamp) -> None:
    """Write the stamp in one step, so that it is never seen half."""
    venv.mkdir(exist_ok=True)
    draft = venv / (STAMP_NAME + ".new")
    draft.write_text(json.dumps(stamp._asdict()), encoding="utf-8")
    draft.replace(venv / STAMP_NAME)


def _is_current(root: Path, venv: Path, profile: str) -> bool:
    stamp = read_stamp(venv)
    if stamp is None or stamp.profile not in {profile, "dev"} or not (venv / "bin" / "python").exists():
        return False
    return stamp.digest == digest(root, stamp.profile)


def _set_up(root: Path, venv: Path, profile: str) -> None:
    stamp = read_stamp(venv)
    if stamp is not None and stamp.profile == "dev":
        profile = "dev"  # a rebuild keeps the checks' tools
    wanted = digest(root, profile)
    sys.stderr.write(f"viso: setting up {venv.name} from {LOCKS[profile]}, once, takes about a minute ... ")
    sys.stderr.flush()
    started = time.monotonic()
    try:
        ours = _prepare(root, venv, stamp)
        _install(root, venv, profile)
        write_stamp(venv, Stamp(profile, wanted, ours))
    except (SetupError, OSError):
        sys.stderr.write("failed\n")
        raise
    sys.stderr.write(f"done in {time.monotonic() - started:.0f} s\n")


def _prepare(root: Path, venv: Path, stamp: Stamp | None) -> bool:
    """Leave an environment that pip can install into; return whether it is ours to delete."""
    if stamp is None and venv.exists():
        return False
    ours = stamp is None or stamp.ours
    upgrade = stamp is not None and stamp.profile == "run" and _is_current(root, venv, "run")
    if not ours or upgrade:
        return ours
    if stamp is not None:
        shutil.rmtree(venv)
    write_stamp(venv, Stamp("", "", True))
    run([sys.executable, "-I", "-m", "venv", str(venv)], f"making {venv.name}")
    return True


def _install(root: Path, venv: Path, profile: str) -> None:
    """Install the locked wheels, then the project itself without asking any index."""
    pip = [str(venv / "bin" / "python"), "-I", "-m", "pip", "--quiet", "--no-input", "--disable-pip-version-check"]
    install = [*pip, "install"]
    lock = LOCKS[profile]
    # The lock is complete. Left to resolve, pip 23 takes the newest wheel of an extra that the lock pins without it.
    locked = ["--no-deps", "--require-hashes", "--only-binary", ":all:", "-r", str(root / lock)]
    run(install + locked, f"installing {lock}")
    project = ["--no-index", "--no-deps", "--no-build-isolation", "--editable", str(root)]
    run(install + project, "installing the project")


def ensure_compiled(root: Path, venv: Path) -> None:
    """Compile what a wheel would hold compiled, unless that was done or tried before, or VISO_PURE forbids it.

    Without a compiler, or when compiling fails, one line says why, and the program goes on interpreted.
    """
    if not (root / COMPILED_PACKAGE).is_dir() or os.environ.get("VISO_PURE", "0") not in {"", "0"}:
        return
    tried = root / COMPILED_PACKAGE / "_compiled" / "tried"
    if _is_tried(tried, root, venv):
        return
    with only_one(root):
        if not _is_tried(tried, root, venv):  # another process may have done it meanwhile
            wanted = compile_digest(root, venv)
            is_done = _compile(root, venv)
            tried.write_text(wanted if is_done else wanted + _compilers(), encoding="utf-8")


def _is_tried(tried: Path, root: Path, venv: Path) -> bool:
    """Return whether what is there has been compiled, or could not be by the compilers that there still are."""
    try:
        before = tried.read_text(encoding="utf-8")
    except FileNotFoundError:
        return False
    wanted = compile_digest(root, venv)
    return before in {wanted, wanted + _compilers()}


def _compile(root: Path, venv: Path) -> bool:
    """Compile, say so in a line, and return whether it went well."""
    sys.stderr.write("viso: compiling the filter, once, takes about a minute ... ")
    sys.stderr.flush()
    started = time.monotonic()
    program = [str(venv / "bin" / "python"), "-P", str(root / COMPILE_PROGRAM)]
    try:
        run([*program, str(root), COMPILED_PACKAGE, COMPILED_PACKAGE], "compiling")
    except SetupError as error:
        reason = str(error).splitlines()[-1].strip()
        sys.stderr.write(f"not done, going on interpreted: {reason}\n")
        return False
    sys.stderr.write(f"done in {time.monotonic() - started:.0f} s\n")
    return True


def compile_digest(root: Path, venv: Path) -> str:
    """Hash all that decides what comes out: the sources, and what compiles them."""
    sources = [*sorted((root / COMPILED_PACKAGE).glob("*.py")), root / "ap_core" / "native.py", root / COMPILE_PROGRAM]
    installed = [path.name for path in venv.glob("lib/*/site-packages/mypy-*")]
    tools = json.dumps([os.path.realpath(venv / "bin" / "python"), *installed]).encode()
    return hashlib.sha256(b"\0".join([tools, *(path.read_bytes() for path in sources)])).hexdigest()


def _compilers() -> str:
    """Return what decides whether compiling works at all: compilers on PATH, and the header files of Python."""
    found = [os.path.realpath(path) for path in map(shutil.which, COMPILERS) if path is not None]
    header = Path(sysconfig.get_path("include")) / "Python.h"
    return json.dumps([os.environ.get("CC"), header.exists(), *((path, os.stat(path).st_mtime_ns) for path in found)])


def run(command: Sequence[str], what: str, *, environment: Mapping[str, str] | None = None) -> None:
    """Run a step silently; raise SetupError with its last lines when it fails."""
    result = subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
        env=environment,
    )
    if result.returncode != 0:
        lines = [line for line in result.stdout.splitlines() if line.strip()][-SHOWN_LINES:]
        raise SetupError("\n    ".join([f"{what} failed (exit code {result.returncode}):", *lines]))


@contextlib.contextmanager
def only_one(root: Path) -> Iterator[None]:
    """Hold a lock on the project's directory, so that two set-ups never work at once."""
    handle = os.open(root, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            sys.stderr.write("viso: waiting for another set-up of this directory\n")
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
