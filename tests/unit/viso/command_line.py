# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the tests of the command line name what came of it."""

from collections.abc import Callable
from typing import NamedTuple


class Outcome(NamedTuple):
    """How a command ended: exit code, standard output, standard error."""

    code: int
    out: str
    err: str


Viso = Callable[..., Outcome]


def failed_with(outcome: Outcome, line: str) -> bool:
    """Assert that a command ended with one line of complaint and nothing else."""
    assert outcome == Outcome(2, "", f"viso: {line}\n")
    return True
