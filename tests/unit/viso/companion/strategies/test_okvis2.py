# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the facade of okvis2 looks for its engine."""

import pytest

from tests.unit.viso.companion.strategies.fake_native import install
from tests.unit.viso.companion.vio.strategy_rig import WaxRig
from viso.companion.strategies.okvis2 import Okvis2


def test_engine_is_that_of_its_native_module(monkeypatch: pytest.MonkeyPatch) -> None:
    module = install(monkeypatch, "viso_okvis2_native")
    strategy = Okvis2(WaxRig().context)
    assert (strategy.name, len(module.engines)) == ("okvis2", 1)
