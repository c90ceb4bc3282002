# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON in small pieces: the vehicle's thread cannot run while the library encodes one."""

import json
from collections.abc import Mapping
from typing import Any


def _dumps(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def encode(message: Mapping[str, Any]) -> str:
    """Return an object as JSON, its lists encoded one element at a time."""
    return "{" + ",".join(f"{_dumps(key)}:{_encode(value)}" for key, value in message.items()) + "}"


def _encode(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ",".join(map(_dumps, value)) + "]"
    return _dumps(value)
