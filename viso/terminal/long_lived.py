# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the garbage collector from what is there for good: to look through all of it takes a tenth of a second."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def long_lived() -> Iterator[None]:
    """Count everything that exists now as no garbage, for a while; whoever has done so before keeps it that way."""
    if gc.get_freeze_count():
        yield
        return
    gc.freeze()  # with the little garbage that starting has made: to find it would delay the first message
    try:
        yield
    finally:
        gc.unfreeze()


@contextmanager
def uncollected() -> Iterator[None]:
    """Look for no garbage while something is made that stays, such as modules; afterwards it counts as old."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if not gc.get_freeze_count():
            # Everything goes into the oldest generation at once; a collector that is just switched on would go
            # through all of it on its way there.
            gc.freeze()
            gc.unfreeze()
        if was_on:
            gc.enable()
