# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An autopilot that has booted; vehicles of a kind boot once for all tests, of which each has a copy."""

import pytest

from tests.copies import Copies
from viso.testing import Autopilot, AutopilotOptions
from viso.testing import autopilot as autopilot_module
from viso.testing.vehicle import BootedVehicle, booted_vehicle

_BOOTED: dict[str, Copies[BootedVehicle]] = {}


def _copy(options: AutopilotOptions) -> BootedVehicle:
    key = repr((options, list(options.params.items())))
    if key not in _BOOTED:
        _BOOTED[key] = Copies(booted_vehicle(options))
    return _BOOTED[key].make()


@pytest.fixture(autouse=True)
def copied(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let autopilots be copies: booting takes ten times as long."""
    monkeypatch.setattr(autopilot_module, "booted_vehicle", _copy)


@pytest.fixture
def autopilot() -> Autopilot:
    """Return an autopilot with the usual parameters and a least quality of 50."""
    return Autopilot(AutopilotOptions(params={"VISO_QUAL_MIN": 50}))
