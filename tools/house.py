# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Check that the house stays in order: circles of imports and plans of rooms; tell how large it is.

Who may import whom is import-linter's matter; here are the figures that it does not know.
"""

from __future__ import annotations

import sys
import tomllib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import Any, Final

import grimp

from tools.project_files import ROOT, project_files

FRONTEND: Final = "ap_visualodom.ap_visualodom"
# Who knows whom as a type only: the firmware's backends their frontend, which makes them; handlers, and what makes up
# the vehicle, the vehicle.
TYPES_ONLY: Final = (
    (f"{FRONTEND}_", FRONTEND),
    ("mav_handlers.", "viso.vehicle."),
    ("viso.vehicle.", "viso.vehicle.vehicle"),
)

Imports = Mapping[str, Collection[str]]


def is_type_only(module: str, imported: str) -> bool:
    """Return whether an import against the order is one for the type checker that we mean to have."""
    return any(module.startswith(knows) and imported.startswith(known) for knows, known in TYPES_ONLY)


def circle(imports: Imports, *, at_run_time: bool = False) -> list[str]:
    """Return the modules of a circle, each imported by the next, or none.

    Args:
        imports: by module, those that it imports.
        at_run_time: these are made when code runs; else some are known to be for the type checker, and left out.
    """
    others = {
        module: [name for name in sorted(imported) if at_run_time or not is_type_only(module, name)]
        for module, imported in sorted(imports.items())
    }
    try:
        TopologicalSorter(others).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def open_plans(contracts: Collection[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each plan of rooms that a new room could be missing from."""
    for contract in contracts:
        if "containers" in contract and not contract.get("exhaustive"):
            yield f"the contract {contract['name']!r} is not exhaustive"


def _imports(graph: grimp.ImportGraph) -> Imports:
    return {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}


def main() -> int:
    """Print the figures and what is wrong; return 1 when something is."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    modules = [name for name in project_files() if name.suffix == ".py"]
    product = [name for name in modules if name.parts[0] in tool["root_packages"]]
    lines = sum(len((ROOT / name).read_bytes().splitlines()) for name in product)
    graph, run_time = (
        grimp.build_graph(*tool["root_packages"], cache_dir=None, exclude_type_checking_imports=excluded)
        for excluded in (False, True)
    )
    folder, most = Counter(name.parent for name in modules).most_common(1)[0]
    print(f"{len(product)} modules of {lines} lines; {folder} holds the most, {most}; {graph.count_imports()} imports")

    found = list(open_plans(tool["contracts"]))
    if around := circle(_imports(graph)) or circle(_imports(run_time), at_run_time=True):
        found.append(f"a circle of imports: {' <- '.join(around)}")
    print("\n".join(found) or "no circle, no gap in the plans")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
