# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The page about arming explains every text of a check."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from ap_visualodom.ap_visualodom import AP_VisualOdom
from ap_visualodom.ap_visualodom_intelt265 import AP_VisualOdom_IntelT265
from ekf_stub.ahrs.ahrs_base import AhrsBase
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.cores import Cores
from ekf_stub.ahrs.sources import source_failure
from tests.places import ROOT
from viso.vehicle import ranges
from viso.vehicle.copter.arming_checks import ArmingChecks

PAGE = ROOT / "docs" / "arming.md"
PIECES = frozenset({"Roll/Pitch", "Yaw", "AHRS: ", "VisOdom: "})
"""What only stands within another text, or before one."""
_NOT_TEXT = re.compile(r"[A-Z]+[A-Z0-9_{}]*|[a-z_]*|\W*")


def sources() -> Iterator[ast.FunctionDef]:
    """Yield the functions that make the texts."""
    yield from map(definition_of, interpreted())
    # Of what may be compiled, only the file tells the source.
    yield definition_in("ekf_stub/core/lanes.py", "unhealthy_reason")
    yield from (definition_in("ekf_stub/core/gps.py", name) for name in ("update", "judge", "_failure"))


def definition_of(function: Callable[..., Any]) -> ast.FunctionDef:
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    assert isinstance(definition, ast.FunctionDef)
    return definition


def definition_in(path: str, name: str) -> ast.FunctionDef:
    nodes = ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
    return next(node for node in nodes if isinstance(node, ast.FunctionDef) and node.name == name)


def interpreted() -> Iterator[Callable[..., Any]]:
    yield from (check for name, check in vars(ArmingChecks).items() if inspect.isfunction(check) and name != "lists")
    yield from (AP_VisualOdom.pre_arm_check, AP_VisualOdom_IntelT265.pre_arm_check)
    yield from (AhrsBase.pre_arm_failure, Ekf3Ahrs.pre_arm_failure, Cores.disagreement)
    yield source_failure
    yield ranges.RangeFinders.failure


def patterns_in(definition: ast.FunctionDef) -> Iterator[str]:
    """Yield a pattern for each text in a function; what is filled in may be anything."""
    statements = definition.body[1:]  # behind the docstring, if there is one
    if not isinstance(definition.body[0], ast.Expr):
        statements = definition.body
    within = set[ast.AST]()
    for node in (node for statement in statements for node in ast.walk(statement)):
        if isinstance(node, ast.JoinedStr) and node not in within:
            within.update(ast.walk(node))
            parts = [part.value if isinstance(part, ast.Constant) else "{}" for part in node.values]
            yield from _pattern("".join(map(str, parts)))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in within:
            yield from _pattern(node.value)


def _pattern(text: str) -> Iterator[str]:
    fixed = re.split(r"\{.*?\}", text)
    if "".join(fixed) not in PIECES and not _NOT_TEXT.fullmatch(text):
        yield ".+".join(map(re.escape, fixed))


def all_patterns() -> list[str]:
    found = [pattern for function in sources() for pattern in patterns_in(function)]
    return [*found, re.escape("EKF3 still initialising"), *map(re.escape, ranges._FAILURES.values())]


@pytest.mark.parametrize("pattern", all_patterns())
def test_text_is_explained(pattern: str) -> None:
    texts = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert [text for text in texts if re.search(f"{pattern}$", text)], pattern


def test_the_texts_are_found() -> None:
    assert len(all_patterns()) > 40
