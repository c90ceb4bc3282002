# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cutting bytes into frames."""

from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.companion.faults.rig import BEAT, encoded, odometry
from viso.companion.faults.splitter import FrameSplitter

FRAMES = encoded(BEAT, odometry(), BEAT)


def test_each_frame_is_a_piece_however_it_arrives() -> None:
    splitter, data = FrameSplitter(), b"".join(FRAMES)
    assert splitter.feed(data) == FRAMES
    assert [piece for byte in data for piece in splitter.feed(bytes([byte]))] == FRAMES
    assert splitter.unread_bytes == 0


def test_rest_of_a_frame_is_waited_for() -> None:
    splitter = FrameSplitter()
    assert splitter.feed(FRAMES[0] + FRAMES[1][:50]) == [FRAMES[0]]
    assert splitter.unread_bytes == 50
    assert splitter.feed(FRAMES[1][50:]) == [FRAMES[1]]


@given(st.lists(st.one_of(st.binary(max_size=30), st.sampled_from([*FRAMES, FRAMES[1][:70], b"\xfd", b"\xfe\x03"]))))
def test_no_byte_gets_lost_or_out_of_order(parts: list[bytes]) -> None:
    splitter = FrameSplitter()
    pieces = b"".join(piece for part in parts for piece in splitter.feed(part))
    fed = b"".join(parts)
    assert fed.startswith(pieces)
    assert len(fed) - len(pieces) == splitter.unread_bytes
