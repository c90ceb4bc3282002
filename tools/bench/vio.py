# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the baseline strategy takes for a frame, from the array to the output."""

from collections.abc import Callable
from contextlib import ExitStack


def prepare(width: int, height: int, enlargement: int, _stack: ExitStack) -> Callable[[], float]:
    """Make a flight with pictures of a size, of which what is rendered is enlarged; a round is a frame."""
    # What the extra vio brings takes long to import.
    from tools.bench.vio_flight import FlownStrategy
    from viso.companion.world.ground import generate_texture

    return FlownStrategy(generate_texture(), width, height, enlargement).run
