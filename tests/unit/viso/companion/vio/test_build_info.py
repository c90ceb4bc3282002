# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flags of the build."""

import importlib.util

import pytest

from viso.companion.vio import build_info
from viso.companion.vio.build_info import read_flags


@pytest.mark.parametrize(("gtsam", "on"), [(object(), True), (None, False)])
def test_flags_of_a_usual_build(monkeypatch: pytest.MonkeyPatch, gtsam: object, on: bool) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", {"gtsam": gtsam}.get)
    assert read_flags() == {
        "BUILD_KLT_RANSAC": True,
        "BUILD_FIXED_LAG": on,
        "BUILD_OKVIS2": False,
        "BUILD_VINS_MONO": False,
    }


def test_process_environment_has_no_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BUILD_OKVIS2", "1")
    assert read_flags()["BUILD_OKVIS2"] is False


def test_flags_are_read_once_and_cannot_be_set() -> None:
    with pytest.raises(TypeError):
        build_info.FLAGS["BUILD_OKVIS2"] = True  # type: ignore[index]  # that is the test
