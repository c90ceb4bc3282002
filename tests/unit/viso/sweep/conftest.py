# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Small sweeps over a recorded capture, cut short."""

from collections.abc import Callable
from typing import Any

import pytest

from tests.places import RECORDED
from viso.sweep.plan import SweepPlan
from viso.sweep.planning import make_plan
from viso.sweep.request import SweepRequest

CAPTURE = RECORDED / "captures" / "mav.jsonl.gz"
UNTIL_S = 5.6

MakePlan = Callable[..., SweepPlan]


@pytest.fixture
def make_plan_of() -> MakePlan:
    """Return a function that makes a plan, by default of two points on the beginning of a capture."""

    def make(**request: Any) -> SweepPlan:
        usual: dict[str, Any] = {"streams": [CAPTURE], "set": ["VISO_DELAY_MS=0,100"], "until": UNTIL_S}
        return make_plan(SweepRequest(**{**usual, **request}))

    return make


@pytest.fixture
def plan(make_plan_of: MakePlan) -> SweepPlan:
    """Return a plan of two points."""
    return make_plan_of()
