# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many messages the codec turns into bytes, and back."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

from mav_handlers.wire.codec import Codec
from viso.bench.measure import NowS, Part, Round
from viso.bench.odometry import PERIOD_US, odometry_at

MESSAGES_A_ROUND: Final = 100


@contextmanager
def prepare(now_s: NowS) -> Iterator[Round]:
    """Make messages and a codec for each end."""
    messages = [odometry_at(number * PERIOD_US) for number in range(MESSAGES_A_ROUND)]
    sender, receiver = Codec(1, 197), Codec(1, 1)

    def run_round() -> Mapping[str, Part]:
        begin_s = now_s()
        frames = [sender.encode(message) for message in messages]
        encoded_s = now_s()
        for frame in frames:
            receiver.feed(frame)
            while receiver.next_received() is not None:
                pass
        decoded_s = now_s()
        return {
            "ODOMETRY to bytes": Part(encoded_s - begin_s, len(messages)),
            "bytes to ODOMETRY": Part(decoded_s - encoded_s, len(messages)),
        }

    yield run_round
