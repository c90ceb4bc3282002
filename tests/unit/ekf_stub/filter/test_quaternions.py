# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quaternion that the filter uses is numpy-quaternion's own, and comes without the rest of the package."""

import importlib.machinery
import subprocess
import sys

import pytest
import quaternion

from ekf_stub.filter import quaternions

OURS = "from ekf_stub.filter.quaternions import quaternion as ours"
THEIRS = "from quaternion import quaternion as theirs"


@pytest.mark.parametrize("imports", [(OURS, THEIRS), (THEIRS, OURS)], ids=["ours first", "theirs first"])
def test_there_is_one_type_whoever_is_imported_first(imports: tuple[str, str]) -> None:
    program = "\n".join((*imports, "assert ours is theirs", "assert ours(1, 2, 3, 4) * theirs(0, 1, 0, 0)"))
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_it_comes_without_the_package() -> None:
    program = f"import sys\n{OURS}\nassert not sys.modules.keys() & {{'quaternion', 'scipy', 'numba'}}"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


def test_one_and_zero_are_those_of_the_package() -> None:
    assert (quaternions.one, quaternions.zero) == (quaternion.one, quaternion.zero)


def test_a_package_laid_out_in_another_way_is_imported_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "quaternion.numpy_quaternion")
    monkeypatch.setattr(importlib.machinery.PathFinder, "find_spec", lambda *_: None)
    assert quaternions._extension() is quaternion
