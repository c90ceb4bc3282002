# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the baseline strategy takes for a frame, from the array to the output, at two sizes of the picture."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from viso.bench.measure import NowS, Part, Round
from viso.errors import InputError

# Width, height, and by how much what is rendered is enlarged.
_SIZES: Final = {"640x480": (640, 480, 1), "5472x3648, BGR": (5472, 3648, 4)}


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Make a flight for each size; a round is a frame of each."""
    try:
        from viso.bench.vio_flight import FlownStrategy
        from viso.companion.world.ground import generate_texture
    except ModuleNotFoundError as error:
        raise InputError(f"{error}; pip install 'viso[vio]'") from error
    texture = generate_texture()
    flown = {name: FlownStrategy(texture, *size) for name, size in _SIZES.items()}

    def run_round() -> Mapping[str, Part]:
        return {name: strategy.run(now_s) for name, strategy in flown.items()}

    yield run_round
