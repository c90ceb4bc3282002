# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""pyproject.toml, the locks and the source tree agree with each other."""

import re
import tomllib
from fnmatch import fnmatch
from typing import Any

import pytest
from packaging.requirements import Requirement

from tests.places import ROOT
from tools.bootstrap import COMPILED_PACKAGE
from tools.lock_requirements import RUN_EXTRAS
from tools.project_files import project_files

PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = sorted(marker.parent.name for marker in ROOT.glob("*/py.typed"))
RUN = [
    *PROJECT["build-system"]["requires"],
    *PROJECT["project"]["dependencies"],
    *(needed for extra in RUN_EXTRAS for needed in PROJECT["project"]["optional-dependencies"][extra]),
    *PROJECT["dependency-groups"]["build"],
]
DEV = RUN + PROJECT["dependency-groups"]["dev"]


def _pins(name: str) -> dict[str, str]:
    text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
    return dict(re.findall(r"^([a-z0-9-]+)==([^\s;]+)", text, re.MULTILINE))


def test_wheels_hold_the_packages_and_nothing_else() -> None:
    assert sorted(PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]) == PACKAGES


def test_a_checkout_compiles_what_a_wheel_holds_compiled() -> None:
    wheel = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["hooks"]["custom"]["package"] == COMPILED_PACKAGE


def test_every_file_tells_its_licence_or_reuse_toml_does() -> None:
    listed = tomllib.loads((ROOT / "REUSE.toml").read_text(encoding="utf-8"))["annotations"][0]["path"]
    elsewhere = [*listed, "LICENSE", "LICENSES/*"]
    bare = [name for name in project_files() if not any(fnmatch(name.as_posix(), path) for path in elsewhere)]
    assert [name for name in bare if b"SPDX-License-Identifier" not in (ROOT / name).read_bytes()[:200]] == []


def test_layers_coverage_and_types_know_every_package() -> None:
    tools = PROJECT["tool"]
    assert sorted(tools["importlinter"]["root_packages"]) == PACKAGES
    assert sorted(tools["coverage"]["run"]["source"]) == PACKAGES
    assert sorted(tools["mypy"]["files"]) == sorted([*PACKAGES, "tests", "tools"])


@pytest.mark.parametrize(("lock", "needed"), [("run.lock", RUN), ("dev.lock", DEV)])
def test_lock_satisfies_every_requirement(lock: str, needed: list[str]) -> None:
    pins = _pins(lock)
    for requirement in map(Requirement, needed):
        assert requirement.specifier.contains(pins[requirement.name]), f"{requirement}: run tools/lock"


def test_the_checks_lock_extends_the_runtime_lock() -> None:
    assert _pins("run.lock").items() <= _pins("dev.lock").items()


@pytest.mark.parametrize("lock", ["run.lock", "dev.lock"])
def test_every_pin_has_a_hash_and_no_address(lock: str) -> None:
    text = (ROOT / "requirements" / lock).read_text(encoding="utf-8")
    assert len(re.findall(r"^[a-z0-9-]+==.*\\\n    --hash=sha256:", text, re.MULTILINE)) == len(_pins(lock))
    assert "://" not in text
