# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of the house finds what is out of order, and the picture shows the contracts as they are."""

import re
from typing import Any

from tools.house import FRONTEND, circle, open_plans
from tools.rooms_picture import draw, rooms

CONTRACTS: list[dict[str, Any]] = [
    {"type": "layers", "layers": ["shop", "wire | port", "floor"]},
    {"type": "layers", "containers": ["shop"], "layers": ["counter", "shelf | till"], "exhaustive": True},
    {"type": "forbidden", "source_modules": ["floor"], "forbidden_modules": ["socket"]},
]


def test_a_circle_is_found_and_the_firmwares_own_is_not() -> None:
    backend, other = f"{FRONTEND}_backend", "ap_visualodom.batch"
    own: dict[str, set[str]] = {FRONTEND: {backend}, backend: {FRONTEND}}
    assert circle(own) == []
    assert set(circle(own | {FRONTEND: {backend, other}, other: {FRONTEND}})) == {FRONTEND, other}


def test_a_plan_with_gaps_is_found() -> None:
    assert list(open_plans(CONTRACTS)) == []
    (line,) = open_plans([{"name": "Shops", "containers": ["shop"], "layers": []}])
    assert "Shops" in line


def test_the_picture_has_each_room_below_those_that_may_import_it() -> None:
    picture = draw(rooms({"contracts": CONTRACTS}))
    height = {name: float(y) for y, name in re.findall(r'y="([\d.]+)"[^>]*>(\w+)<', picture)}
    assert height["shop"] < height["counter"] < height["shelf"] == height["till"]
    assert height["till"] < height["wire"] == height["port"] < height["floor"]
