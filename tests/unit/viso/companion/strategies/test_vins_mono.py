# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the facade of vins_mono looks for its engine."""

import pytest

from tests.unit.viso.companion.strategies.fake_native import install
from tests.unit.viso.companion.vio.strategy_rig import WaxRig
from viso.companion.strategies.vins_mono import VinsMono


def test_engine_is_that_of_its_native_module(monkeypatch: pytest.MonkeyPatch) -> None:
    module = install(monkeypatch, "viso_vins_mono_native")
    strategy = VinsMono(WaxRig().context)
    assert (strategy.name, len(module.engines)) == ("vins_mono", 1)
