# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""TOML, YAML and JSON of users: unusable contents are a ValueError with one line of text."""

import json
import re
import tomllib
from collections.abc import Iterator
from typing import Any, Final

MOST_LEVELS: Final = 64
"""Of lists and tables within each other: more would end a recursion, be it where a value is shown."""
MOST_BITS: Final = 64
"""Of a whole number in TOML or YAML, where it may be hexadecimal: a longer one may become neither float nor text."""
_TOO_DEEP: Final = "nested too deeply"
_BETWEEN_KEYS: Final = re.compile(r"[\[\]{},=]")


def parsed_toml(text: str) -> dict[str, Any]:
    """Return what a TOML text holds. Raises ValueError, one line that says why it cannot be used."""
    # Each dot of a key is a table within another, and the time that they take grows with their square.
    lines = (line for line in text.splitlines() if not line.lstrip().startswith("#"))
    if any(part.count(".") > MOST_LEVELS for line in lines for part in _BETWEEN_KEYS.split(line)):
        raise ValueError(_TOO_DEEP)
    try:
        found = tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError as error:
        raise ValueError(f"not TOML: {error}") from None
    _check_numbers(found)
    return found


def parsed_yaml(text: str) -> Any:
    """Return what a YAML text holds, without aliases: a few lines of them would hold billions of values.

    Raises ValueError, one line that says why it cannot be used.
    """
    import yaml  # here because it takes longer than all else that a command without YAML imports

    class Loader(yaml.SafeLoader):
        def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
            if self.check_event(yaml.AliasEvent):
                mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]  # the stubs lack its type
                raise yaml.composer.ComposerError(problem="aliases are not supported", problem_mark=mark)
            return super().compose_node(parent, index)

    try:
        found = yaml.load(text, Loader)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except yaml.MarkedYAMLError as error:
        place = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise ValueError(f"not YAML: {place}{error.problem or error.context}") from None
    except Exception as error:  # what ill-formed values make it raise has no common base
        raise ValueError(f"not YAML: {' '.join(str(error).split()) or type(error).__name__}") from None
    _check_numbers(found)
    return found


def parsed_json(text: str) -> Any:
    """Return what a JSON text holds. Raises ValueError, one line that says why it cannot be used."""
    try:
        found = json.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except json.JSONDecodeError as error:
        line = f"line {error.lineno}, " if error.lineno > 1 else ""
        raise ValueError(f"not JSON: {error.msg} in {line}column {error.colno}") from None
    except ValueError as error:
        raise ValueError(f"not JSON: {error}") from None
    if text.count("[") + text.count("{") > MOST_LEVELS:  # most lines of a recording have fewer
        list(_levels(found))
    return found


def _check_numbers(document: Any) -> None:
    for level in _levels(document):
        if any(type(one) is int and one.bit_length() > MOST_BITS for one in level):
            raise ValueError(f"a whole number of more than {MOST_BITS} bits")


def _levels(document: Any) -> Iterator[list[Any]]:
    """Yield the values of a document, those of one level together. Raises ValueError if there are too many levels."""
    level = [document]
    for _ in range(MOST_LEVELS):
        yield level
        level = [inner for one in level if isinstance(one, dict | list | tuple | set) for inner in _parts(one)]
        if not level:
            return
    raise ValueError(_TOO_DEEP)


def _parts(one: dict[Any, Any] | list[Any] | tuple[Any, ...] | set[Any]) -> list[Any]:
    return [*one, *one.values()] if isinstance(one, dict) else [*one]
