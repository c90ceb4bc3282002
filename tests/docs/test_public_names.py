# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What packages say they offer is there, and examples need nothing else."""

import ast
import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import pytest

from tests.places import ROOT

PACKAGES = ("ap_core", "ap_visualodom", "ekf_stub", "mav_handlers", "viso")
PUBLIC = sorted(
    ".".join(path.parent.relative_to(ROOT).parts)
    for package in PACKAGES
    for path in (ROOT / package).rglob("__init__.py")
    if "__all__" in path.read_text(encoding="utf-8")
)
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "docs").rglob("*.py"))]
SHOWN = {
    f"{path.relative_to(ROOT)}:{number}": code
    for path in DOCUMENTS
    for text in [path.read_text(encoding="utf-8")]
    for number, code in enumerate(
        [text] if path.suffix == ".py" else re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    )
}


def imports(code: str) -> set[tuple[str, str]]:
    """Return what a program imports of ours, as modules and names; a whole module has no name."""
    found = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom):
            found |= {(str(node.module), name.name) for name in node.names}
        elif isinstance(node, ast.Import):
            found |= {(name.name, "") for name in node.names}
    return {(module, name) for module, name in found if module.partition(".")[0] in PACKAGES}


@pytest.mark.parametrize("package", PUBLIC)
def test_every_listed_name_is_there(package: str) -> None:
    module = import_module(package)
    assert all(getattr(module, name) is not None for name in module.__all__)
    assert set(module.__all__) <= set(dir(module))
    # A module of that name would take its place as soon as somebody imports it.
    assert [name for name in module.__all__ if find_spec(f"{package}.{name}")] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_every_package_lists_names(package: str) -> None:
    assert package in PUBLIC


def test_other_names_are_not_there() -> None:
    with pytest.raises(AttributeError, match=r"^module 'viso' has no attribute 'vehicles'$"):
        import_module("viso").vehicles  # noqa: B018


@pytest.mark.parametrize("code", SHOWN.values(), ids=SHOWN)
def test_examples_import_listed_names_only(code: str) -> None:
    for module, name in imports(code):
        assert module in PUBLIC, f"{module} lists no names"
        assert not name or name in import_module(module).__all__


def test_viso_alone_imports_next_to_nothing() -> None:
    # Its plugin for pytest imports it in every run of pytest.
    heavy = "{name.partition('.')[0] for name in sys.modules} & {'numpy', 'pymavlink', 'serial', 'typer', 'rich'}"
    program = f"""
import sys, time
start_s = time.process_time()
import viso
assert time.process_time() - start_s < 0.1
assert not {heavy}
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_endpoint_alone_imports_no_link() -> None:
    program = "import sys, mav_handlers; assert not {'serial', 'mav_handlers.links'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
