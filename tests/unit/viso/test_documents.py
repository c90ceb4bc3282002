# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TOML, YAML and JSON: what they hold, and the one line for all that cannot be used."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from viso.documents import MOST_LEVELS, parsed_json, parsed_toml, parsed_yaml

BOMB = "a: &a [1, 1]\nb: &b [*a, *a]\n" + "".join(f"c{n}: &b [*b, *b]\n" for n in range(60))


@pytest.mark.parametrize(("read", "text", "holds"), [
    (parsed_toml, "a = 1\n[b]\nc = [1.5, 'd']", {"a": 1, "b": {"c": [1.5, "d"]}}),
    (parsed_yaml, "a: 1\nb: {c: [1.5, d]}", {"a": 1, "b": {"c": [1.5, "d"]}}),
    (parsed_json, '{"a": 1, "b": {"c": [1.5, "d"]}}', {"a": 1, "b": {"c": [1.5, "d"]}}),
    (parsed_toml, "#" + "." * 99 + f"\na = {2**63 - 1}\nb = [" + "1.5, " * 99 + "]", None),
    (parsed_json, f"[{10**400}]", [10**400]),
    (parsed_json, "[" * MOST_LEVELS + "]" * MOST_LEVELS, None),
])  # fmt: skip
def test_holds_what_is_written(read: Callable[[str], Any], text: str, holds: Any) -> None:
    found = read(text)
    assert holds is None or found == holds


@pytest.mark.parametrize(("read", "text", "reason"), [
    (parsed_toml, "a = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
    (parsed_toml, "a = " + "{a=" * 5000, "nested too deeply"),
    (parsed_toml, ".".join("a" * 5000) + " = 1", "nested too deeply"),
    (parsed_toml, "[" + ".".join("a" * 5000) + "]", "nested too deeply"),
    (parsed_toml, "a = " + "9" * 5000, "not TOML: Exceeds the limit"),
    (parsed_toml, "a = 0x" + "f" * 5000, "a whole number of more than 64 bits"),
    (parsed_toml, "a = ", "not TOML: Invalid value (at end of document)"),
    (parsed_yaml, "[" * 600, "nested too deeply"),
    (parsed_yaml, "[" * 99 + "]" * 99, "nested too deeply"),
    (parsed_yaml, "- " * 5000, "nested too deeply"),
    (parsed_yaml, "a: " + "9" * 5000, "not YAML: Exceeds the limit"),
    (parsed_yaml, "? 0x" + "f" * 5000, "a whole number of more than 64 bits"),
    (parsed_yaml, "a: !!int ''", "not YAML: "),
    (parsed_yaml, "a: !!bool x", "not YAML: "),
    (parsed_yaml, "a: !!timestamp x", "not YAML: "),
    (parsed_yaml, "a: 2020-13-77", "not YAML: "),
    (parsed_yaml, "a: [\n", "not YAML: line 2: "),
    (parsed_yaml, "a: \x00", "not YAML: unacceptable character #x0000: special characters are not allowed"),
    (parsed_yaml, BOMB, "not YAML: line 2: aliases are not supported"),
    (parsed_yaml, "a: !!python/name:os.system", "not YAML: line 1: could not determine a constructor"),
    (parsed_json, "[" * 5000 + "]" * 5000, "nested too deeply"),
    (parsed_json, "[" * 99 + "]" * 99, "nested too deeply"),
    (parsed_json, "9" * 5000, "not JSON: Exceeds the limit"),
    (parsed_json, "[1,", "not JSON: Expecting value in column 4"),
    (parsed_json, "[1,\n\n2", "not JSON: Expecting ',' delimiter in line 3, column 2"),
])  # fmt: skip
def test_what_cannot_be_used_is_one_line(read: Callable[[str], Any], text: str, reason: str) -> None:
    with pytest.raises(ValueError, match=rf"\A{re.escape(reason)}[^\n]{{,150}}\Z"):
        read(text)
