# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The clients of the interop tests are set up once, from locks that say exactly what and nothing else."""

import json
import os
import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tools import bootstrap, checks, interop_environment
from tools.bootstrap import ROOT, SetupError
from tools.checks import Run
from tools.lock_requirements import LEFT_OUT

NPM_CI = "installing tools/interop_node/package-lock.json"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name in (interop_environment.LOCK, *(interop_environment.NODE / n for n in interop_environment.NODE_FILES)):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("{}", encoding="utf-8")
    return tmp_path


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace every external step by one that only notes what it was for; npm is there."""
    done: list[str] = []

    def note(command: Sequence[str], what: str, **_options: object) -> None:
        done.append(what)
        if what.startswith("making"):
            Path(command[-1]).mkdir()

    monkeypatch.setattr(bootstrap, "run", note)
    monkeypatch.setattr(shutil, "which", lambda name: name)
    return done


def test_first_use_installs_the_clients_of_both_languages(root: Path, steps: list[str]) -> None:
    assert interop_environment.ensure(root) == root / ".venv-interop"
    assert steps == ["making .venv-interop", "installing requirements/interop.lock", NPM_CI]


@pytest.mark.parametrize(
    ("on_path", "user", "installed"),
    [
        ({"npm", "apt-get"}, 0, ["listing Debian's packages", "installing Chromium"]),
        ({"npm", "apt-get", "chromium"}, 0, ["listing Debian's packages", "installing Chromium"]),
        ({"npm", "apt-get", "chromium", "chromedriver"}, 0, []),
        ({"npm"}, 0, []),
        ({"npm", "apt-get"}, 1000, []),
    ],
)
def test_browser_is_installed_where_it_is_missing_and_we_may(
    root: Path,
    steps: list[str],
    monkeypatch: pytest.MonkeyPatch,
    on_path: set[str],
    user: int,
    installed: list[str],
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: name if name in on_path else None)
    monkeypatch.setattr(os, "geteuid", lambda: user)
    interop_environment.ensure(root)
    assert steps[3:] == installed


def test_second_use_does_nothing(root: Path, steps: list[str]) -> None:
    interop_environment.ensure(root)
    steps.clear()
    interop_environment.ensure(root)
    assert steps == []


@pytest.mark.parametrize("changed", ["requirements/interop.lock", "tools/interop_node/package-lock.json"])
def test_changed_lock_remakes_it_from_scratch(root: Path, steps: list[str], changed: str) -> None:
    stray = interop_environment.ensure(root) / "stray"
    stray.touch()
    steps.clear()
    (root / changed).write_text('{"changed": true}', encoding="utf-8")
    interop_environment.ensure(root)
    assert len(steps) == 3
    assert not stray.exists()


def test_failed_step_leaves_an_environment_that_is_not_trusted(
    root: Path, steps: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(SetupError, match="npm"):
        interop_environment.ensure(root)
    monkeypatch.setattr(shutil, "which", lambda name: name)
    steps.clear()
    interop_environment.ensure(root)
    assert steps[-1] == NPM_CI


def test_failed_set_up_is_an_exit_code_and_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> Path:
        raise SetupError("no npm")

    monkeypatch.setattr(interop_environment, "ensure", fail)
    assert interop_environment.main(["--set-up"]) == 2
    assert capsys.readouterr().err == "viso: no npm\n"


def test_set_up_alone_runs_no_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interop_environment, "ensure", lambda: ROOT)
    assert interop_environment.main(["--set-up"]) == 0


def _pins() -> dict[str, str]:
    text = (ROOT / "requirements" / "interop.lock").read_text(encoding="utf-8")
    return dict(re.findall(r"^([a-z0-9-]+)==([^\s;]+)", text, re.MULTILINE))


def test_lock_satisfies_every_requirement() -> None:
    lines = (ROOT / "requirements" / "interop.in").read_text(encoding="utf-8").splitlines()
    pins = _pins()
    for requirement in (Requirement(line) for line in lines if line and not line.startswith("#")):
        assert requirement.specifier.contains(pins[requirement.name.lower()]), f"{requirement}: tools/lock --clients"


def test_lock_leaves_out_what_headless_use_does_not_need() -> None:
    assert not _pins().keys() & set(LEFT_OUT)


def test_every_pin_has_a_hash_and_no_address() -> None:
    text = (ROOT / "requirements" / "interop.lock").read_text(encoding="utf-8")
    assert len(re.findall(r"^[a-z0-9-]+==.*\\\n    --hash=sha256:", text, re.MULTILINE)) == len(_pins())
    assert "://" not in text


def test_node_packages_have_hashes_and_no_address() -> None:
    lock = json.loads((ROOT / "tools" / "interop_node" / "package-lock.json").read_text(encoding="utf-8"))
    packages = {name: package for name, package in lock["packages"].items() if name}
    assert "node_modules/node-mavlink" in packages
    assert all(package["integrity"].startswith("sha512-") for package in packages.values())
    assert not any("resolved" in package for package in packages.values())


def test_checks_set_the_clients_up_before_tests_that_need_them() -> None:
    names = [step.name for step in checks.STEPS]
    assert names.index("clients") < names.index("tests")
    step = checks.STEPS[names.index("clients")]
    assert step.commands(Run(False, Path("no-such-folder"))) == []
    assert [command[-1] for command in step.commands(Run(True, Path("no-such-folder")))] == ["--set-up"]


@pytest.mark.parametrize(("given", "wanted"), [(None, True), ("/mine.pem", False)])
def test_npm_knows_the_certificates_of_the_system(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, given: str | None, wanted: bool
) -> None:
    bundle = tmp_path / "bundle.crt"
    bundle.touch()
    monkeypatch.setenv("SSL_CERT_FILE", str(bundle))
    monkeypatch.delenv("NODE_EXTRA_CA_CERTS", raising=False)
    if given is not None:
        monkeypatch.setenv("NODE_EXTRA_CA_CERTS", given)
    assert interop_environment._node_environment()["NODE_EXTRA_CA_CERTS"] == (str(bundle) if wanted else given)
