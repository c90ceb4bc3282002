# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of the house finds what is out of order."""

from typing import Any

import pytest

from tools.house import FRONTEND, circle, open_plans

CONTRACTS: list[dict[str, Any]] = [
    {"type": "layers", "layers": ["shop", "wire | port", "floor"]},
    {"type": "layers", "containers": ["shop"], "layers": ["counter", "shelf | till"], "exhaustive": True},
    {"type": "forbidden", "source_modules": ["floor"], "forbidden_modules": ["socket"]},
]


@pytest.mark.parametrize(
    ("knows", "known"),
    [(f"{FRONTEND}_backend", FRONTEND), ("mav_handlers.channel", "viso.vehicle.vehicle")],
    ids=["the firmware's own", "handlers and vehicle"],
)
def test_a_circle_is_found_unless_it_is_one_of_types_alone(knows: str, known: str) -> None:
    other = "ap_visualodom.batch"
    own: dict[str, set[str]] = {known: {knows}, knows: {known}}
    assert circle(own) == []
    assert set(circle(own, at_run_time=True)) == {knows, known}
    assert set(circle(own | {known: {knows, other}, other: {known}})) == {known, other}


def test_a_plan_with_gaps_is_found() -> None:
    assert list(open_plans(CONTRACTS)) == []
    (line,) = open_plans([{"name": "Shops", "containers": ["shop"], "layers": []}])
    assert "Shops" in line
