# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The flags of the build."""

import importlib.util

import pytest

from viso.companion.vio import build_info
from viso.companion.vio.build_info import read_flags

FLAGS = {"gtsam": "BUILD_FIXED_LAG", "viso_okvis2_native": "BUILD_OKVIS2", "viso_vins_mono_native": "BUILD_VINS_MONO"}


@pytest.mark.parametrize("module", [None, *FLAGS])
def test_strategies_are_there_with_their_modules(monkeypatch: pytest.MonkeyPatch, module: str | None) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", {module: object()}.get)
    assert read_flags() == {"BUILD_KLT_RANSAC": True} | {flag: name == module for name, flag in FLAGS.items()}


def test_process_environment_has_no_say(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BUILD_OKVIS2", "1")
    assert read_flags()["BUILD_OKVIS2"] is False


def test_flags_are_read_once_and_cannot_be_set() -> None:
    with pytest.raises(TypeError):
        build_info.FLAGS["BUILD_OKVIS2"] = True  # type: ignore[index]  # that is the test
