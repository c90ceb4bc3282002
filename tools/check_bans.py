# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that the packages use nothing that is banned where they stand: clocks, sockets, files and so on.

A ban is a row of `BANS`. The check reads the syntax tree: aliases of imports are followed, so `np.sin`,
`from numpy import sin as s` and `import numpy; numpy.sin` are all `numpy.sin`.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.project_files import ROOT, project_files

PACKAGES = ("ap_core/", "ap_visualodom/", "ekf_stub/", "mav_handlers/", "viso/companion/", "viso/")
PURE = ("ap_core/", "ap_visualodom/", "ekf_stub/", "mav_handlers/")
PORT = ("ap_core/", "ap_visualodom/")
LINKS = "mav_handlers/links/"


def _names(module: str, names: str) -> frozenset[str]:
    return frozenset(f"{module}.{name}" for name in names.split())


TRIG = "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh"
NUMPY_TRIG = TRIG + " arcsin arccos arctan arctan2 arcsinh arccosh arctanh hypot exp log"
CLOCK_READS = (
    _names("datetime.datetime", "now utcnow today")
    | _names("datetime.date", "today")
    | {"time", "numpy.datetime64.now"}
)
NETWORK = frozenset({"socket", "socketserver", "select", "selectors", "ssl", "asyncio", "http", "urllib", "serial"})
SYSTEM = frozenset({"os", "subprocess", "multiprocessing", "threading", "signal", "sched"})
FILES = (
    frozenset({"builtins.open", "pathlib.Path", "pathlib.PosixPath", "shutil", "tempfile", "glob", "mmap"})
    | _names("io", "open open_code FileIO")
    | _names("numpy", "load save savez savez_compressed loadtxt savetxt genfromtxt fromfile memmap")
    | {f".{name}" for name in ("read_text", "read_bytes", "write_text", "write_bytes", "tofile")}
)


FLOAT32 = "use ap_core.fmath, it is float32"


@dataclass(frozen=True)
class Ban:
    """Names that must not appear in some folders.

    Args:
        names: dotted names with all that is below them; `.name` bans a method on whatever object.
        where: folders (ending in `/`) or files the ban holds for.
        unless: folders or files inside `where` that are free.
        reason: what to do instead, for the finding.
    """

    names: frozenset[str]
    where: tuple[str, ...]
    unless: tuple[str, ...]
    reason: str

    def holds_for(self, name: str) -> bool:
        """Tell whether the ban holds for the file, given relative to the project."""
        return name.startswith(self.where) and not name.startswith(self.unless)

    def hit(self, dotted: str) -> str | None:
        """Return the banned name that `dotted` is, or is part of; None when it is free."""
        parts = dotted.split(".")
        heads = (".".join(parts[:count]) for count in range(1, len(parts) + 1))
        return next((head for head in heads if head in self.names), None)


BANS = (
    Ban(
        CLOCK_READS,
        PACKAGES,
        (
            LINKS,
            "viso/running/real_time.py",
            "viso/faults/proxy.py",
            "viso/running/playing.py",
            "viso/landmarks/live.py",
            "viso/vio/live.py",
            "viso/commands/bench.py",
            "viso/commands/doctor.py",
        ),
        "take the time as an argument",
    ),
    Ban(NETWORK, PURE, (LINKS,), "sockets and ports belong to mav_handlers/links"),
    Ban(SYSTEM, PURE, (LINKS,), "no system calls here, let the caller pass what is needed"),
    Ban(FILES, PURE, (LINKS,), "no files here, take and return bytes or lines"),
    Ban(_names("numpy", NUMPY_TRIG), PORT, (), "use ap_core.fmath, numpy's results differ between CPUs"),
    Ban(_names("math", TRIG + " exp log"), PORT, ("ap_core/fmath.py",), FLOAT32),
    # The packer of records asks by it whether any value is large or a NaN.
    Ban(_names("math", "hypot"), PORT, ("ap_core/fmath.py", "ap_core/log_structure.py"), FLOAT32),
    Ban(
        frozenset({"pymavlink"}),
        PACKAGES,
        ("mav_handlers/wire/codec.py", "viso/logs/recorded.py", "viso/bench/versus_pymavlink.py"),
        "use mav_handlers.wire, or viso.logs.recorded for logs",
    ),
    Ban(frozenset({"builtins.print"}), PACKAGES, ("viso/cli.py", "viso/commands/"), "use logging"),
    Ban(frozenset({"time.sleep"}), ("tests/unit/",), (), "pass a clock and step it"),
)


def uses(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield line number and dotted name of each import, attribute chain, builtin and method in `tree`."""
    aliases = dict(_aliases(tree))
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield from ((node.lineno, name) for _, name in _imported(node))
        elif isinstance(node, ast.Attribute):
            yield node.lineno, f".{node.attr}"
            if (dotted := _dotted(node, aliases)) is not None:
                yield node.lineno, dotted
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id not in aliases:
            yield node.lineno, f"builtins.{node.id}"


def _imported(node: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, str]]:
    """Yield each name that an import binds and the dotted name behind it; relative imports are our own."""
    if isinstance(node, ast.Import):
        for item in node.names:
            yield item.asname or item.name.split(".")[0], item.name
    elif node.level == 0 and node.module is not None:
        for item in node.names:
            yield item.asname or item.name, f"{node.module}.{item.name}"


def _aliases(tree: ast.Module) -> Iterator[tuple[str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for item in node.names:
                top = item.name.split(".")[0]
                yield (item.asname, item.name) if item.asname else (top, top)
        elif isinstance(node, ast.ImportFrom):
            yield from _imported(node)


def _dotted(node: ast.expr, aliases: dict[str, str]) -> str | None:
    """Return the full name of an attribute chain that starts at an import, else None."""
    if isinstance(node, ast.Name):
        return aliases.get(node.id)
    if isinstance(node, ast.Attribute):
        base = _dotted(node.value, aliases)
        return None if base is None else f"{base}.{node.attr}"
    return None


def findings_in(name: str, source: str, bans: tuple[Ban, ...] = BANS) -> list[str]:
    """Return a line for each banned use in the source text of the file `name`, in order, without doubles."""
    active = [ban for ban in bans if ban.holds_for(name)]
    if not active:
        return []
    found = {
        (line, hit.removeprefix("builtins."), ban.reason)
        for line, dotted in uses(ast.parse(source, name))
        for ban in active
        if (hit := ban.hit(dotted)) is not None
    }
    return [f"{name}:{line}: {hit}: {reason}" for line, hit, reason in sorted(found)]


def findings(root: Path = ROOT) -> list[str]:
    """Return a line for each banned use in the Python files under `root`."""
    found: list[str] = []
    for name in project_files(root):
        if name.suffix == ".py":
            found += findings_in(name.as_posix(), (root / name).read_text(encoding="utf-8"))
    return found


def main() -> int:
    """Print the findings; return 1 when there are any."""
    found = findings()
    print("\n".join(found) or "no banned name in any package")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
