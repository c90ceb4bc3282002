# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every datagram carries one frame."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.links.datagram import datagrams


def frame(version: int, text: str, *, signed: bool = False) -> bytes:
    mav = dialect.MAVLink(None, 1, 1)
    if signed:
        mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.timestamp = b"k" * 32, True, 1
    message = dialect.MAVLink_statustext_message(6, text.encode())
    return bytes(message.pack(mav, force_mavlink1=version == 1))


FRAMES = st.one_of(
    st.builds(frame, st.just(1), st.text("ab", max_size=50)),
    st.builds(frame, st.just(2), st.text("ab", max_size=50), signed=st.booleans()),
)


@given(st.lists(FRAMES))
def test_each_frame_is_a_datagram(frames: list[bytes]) -> None:
    assert list(datagrams(b"".join(frames))) == frames


@given(st.binary(max_size=2000))
def test_nothing_is_lost_or_added_whatever_the_bytes(data: bytes) -> None:
    pieces = list(datagrams(data))
    assert b"".join(pieces) == data
    assert all(0 < len(piece) <= 280 for piece in pieces)


def test_what_is_no_frame_ends_where_one_begins() -> None:
    whole = frame(2, "hello")
    assert list(datagrams(b"0 0 0 " + whole)) == [b"0 0 0 ", whole]


@pytest.mark.parametrize("cut", [1, 5, 20])
def test_end_of_a_frame_that_is_missing_changes_nothing(cut: int) -> None:
    first, part = frame(2, "hello"), frame(2, "hello")[:cut]
    assert list(datagrams(first + part)) == [first, part]
