# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso explain``: what a text on the ground station, or a code of the doctor, means."""

import difflib
from collections.abc import Iterator
from typing import Annotated, Final

import typer

from viso.doctor import all_checks
from viso.doctor.checks.check import Check
from viso.errors import InputError
from viso.explain.texts import Text, all_texts, texts_like, without_beginning
from viso.terminal.console import out

_MOST_TEXTS: Final = 8


def explain(
    words: Annotated[
        list[str],
        typer.Argument(help="A text of the autopilot, or words of it; or a code of viso doctor, such as XN8-10."),
    ],
) -> None:
    """Explain a text on the ground station, or a code of the doctor: cause, what to check, what to change.

    Example: viso explain "EKF variance"
    """
    asked = " ".join(words)
    code = asked.strip().upper()
    found = next((check for check in all_checks() if check.code == code), None)
    if found is not None:
        lines = list(_check_lines(found))
    else:
        texts = texts_like(asked) if without_beginning(asked) else []
        if not texts:
            raise InputError(f"{asked!r}: no text of the autopilot and no code of the doctor{_nearest(asked)}")
        lines = [line for group, text in texts[:_MOST_TEXTS] for line in _text_lines(group, text)]
        if len(texts) > _MOST_TEXTS:
            lines.append(f"{len(texts) - _MOST_TEXTS} more texts hold these words; all are in docs/texts.md")
    for line in lines:
        out.print(line.replace("`", ""), markup=False, highlight=False)


def _nearest(asked: str) -> str:
    shown = {without_beginning(text.shown).lower(): text.shown for _, text in all_texts()}
    near = difflib.get_close_matches(without_beginning(asked).lower(), shown, n=3, cutoff=0.5)
    names = ", ".join(f"{shown[one]!r}" for one in near)
    return f"; the nearest: {names}" if names else "; docs/texts.md has all of them"


def _text_lines(group: str, text: Text) -> Iterator[str]:
    yield f"{text.shown}  ({group})"
    yield f"    cause: {text.cause}"
    yield f"    check: {text.check}"
    yield f"    fix: {text.fix}"
    if text.codes:
        yield f"    more: viso doctor on a recording, which looks into {', '.join(text.codes)}"
    yield ""


def _check_lines(found: Check) -> Iterator[str]:
    yield f"{found.code}  {found.title}  ({found.severity.value})"
    yield f"    autopilot: {found.firmware} [{found.source}]"
    yield f"    rests on: {found.witness.value}"
    yield f"    fix: {found.fix}"
    texts = [text.shown for _, text in all_texts() if found.code in text.codes]
    if texts:
        yield f"    texts: {', '.join(texts)}"
    yield f"    more: docs/doctor-codes.md#{found.code.lower()}"
