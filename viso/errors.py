# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors that a command tells its user in one line."""


class InputError(Exception):
    """Something given to a command cannot be used; the text is one line that names it and says why.

    Line ends within the text, such as those of a name that it quotes, become spaces.
    """

    def __init__(self, text: str) -> None:
        super().__init__(" ".join(text.splitlines()))
