# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Checks of command-line options that several commands share."""

from viso.errors import InputError


def within(option: str, value: float | None, low: float, high: float) -> None:
    """Let a number pass that lies between two others, or is not given. Raises InputError naming the option."""
    if value is not None and not low <= value <= high:
        raise InputError(f"{option} {value:g}: not between {low:g} and {high:g}")
