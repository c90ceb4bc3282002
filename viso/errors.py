# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that a command tells its user in one line."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(Exception):
    """Something given to a command cannot be used; the text is one line that names it and says why.

    Line ends within the text, such as those of a name that it quotes, become spaces.
    """

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.splitlines()))


def within(option: str, value: float | None, low: float, high: float) -> None:
    """Let a number pass that lies between two others, or is not given. Raises InputError naming the option."""
    if value is not None and not low <= value <= high:
        raise InputError(f"{option} {value:g}: not between {low:g} and {high:g}")


@contextmanager
def file_errors(place: object) -> Iterator[None]:
    """Raise InputError for what the file system does not do; the text begins with the place."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{place}: {error.strerror or error}") from error


@contextmanager
def as_input_errors(*kinds: type[Exception]) -> Iterator[None]:
    """Raise InputError in place of errors of some kinds, with their text."""
    try:
        yield
    except kinds as error:
        raise InputError(str(error)) from error
