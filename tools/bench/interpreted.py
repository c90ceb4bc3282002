# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A bench in a process of its own in which the filter is interpreted, as it is with VISO_PURE=1."""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context

Round = Callable[[], float]

_stack = ExitStack()
_rounds: list[Round] = []


def _start(prepare: Callable[[ExitStack], Round]) -> None:
    _rounds.append(prepare(_stack))


def _round() -> float:
    return _rounds[0]()


def interpreted(prepare: Callable[[ExitStack], Round], stack: ExitStack) -> Round:
    """Prepare a bench in a process that imports the interpreted filter; return what has it do a round."""
    os.environ["VISO_PURE"] = "1"
    stack.callback(os.environ.pop, "VISO_PURE")
    pool = stack.enter_context(ProcessPoolExecutor(1, mp_context=get_context("spawn")))
    pool.submit(_start, prepare).result()
    return lambda: pool.submit(_round).result()
