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

# The firmware's own circle: a backend knows its frontend, which makes it.
FRONTEND: Final = "ap_visualodom.ap_visualodom"
# What makes up the vehicle knows it as a type.
VEHICLE: Final = "viso.vehicle.vehicle"

Imports = Mapping[str, Collection[str]]


def circle(imports: Imports) -> list[str]:
    """Return the modules of a circle, each imported by the next, or none; two are meant, and no finding."""
    meant = ((FRONTEND, FRONTEND + "_"), (VEHICLE, "viso.vehicle."))
    others = {
        module: [name for name in sorted(imported) if not any(name == to and module.startswith(by) for to, by in meant)]
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


def main() -> int:
    """Print the figures and what is wrong; return 1 when something is."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    modules = [name for name in project_files() if name.suffix == ".py"]
    product = [name for name in modules if name.parts[0] in tool["root_packages"]]
    lines = sum(len((ROOT / name).read_bytes().splitlines()) for name in product)
    graph = grimp.build_graph(*tool["root_packages"], cache_dir=None)
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    folder, most = Counter(name.parent for name in modules).most_common(1)[0]
    print(f"{len(product)} modules of {lines} lines; {folder} holds the most, {most}; {graph.count_imports()} imports")

    found = list(open_plans(tool["contracts"]))
    if around := circle(imports):
        found.append(f"a circle of imports: {' <- '.join(around)}")
    print("\n".join(found) or "no circle, no gap in the plans")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
