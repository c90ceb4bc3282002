# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Links back to back in memory."""

from mav_handlers.links import PairLink, make_pair


def test_bytes_come_out_at_the_other_end_only() -> None:
    left, right = make_pair()
    left.send(b"to the right")
    assert left.receive() == b""
    assert right.receive() == b"to the right"


def test_call_that_does_not_fit_is_dropped_whole() -> None:
    left, right = make_pair(capacity_bytes=10)
    left.send(b"12345678")
    left.send(b"abc")
    left.send(b"90")
    assert right.receive() == b"1234567890"
    assert left.stats.drop_reasons == {"backlog full": 1}
    assert left.stats.bytes_dropped == 3


def test_reading_makes_room() -> None:
    left, right = make_pair(capacity_bytes=4)
    left.send(b"1234")
    right.receive(2)
    left.send(b"56")
    assert right.receive() == b"3456"


def test_bytes_sent_before_the_end_closed_are_still_read() -> None:
    left, right = make_pair()
    left.send(b"last words")
    left.close()
    assert right.receive() == b"last words"
    assert right.stats.disconnects == 1


def test_end_without_partner_has_no_peer() -> None:
    left, right = make_pair()
    right.close()
    left.send(b"x")
    assert left.stats.drop_reasons == {"no peer": 1}


def test_ends_have_the_given_names() -> None:
    assert [link.name for link in make_pair(("vehicle", "companion"))] == ["vehicle", "companion"]


def test_same_calls_give_the_same_counters() -> None:
    def run() -> tuple[object, object]:
        left, right = make_pair(capacity_bytes=100)
        for number in range(50):
            left.send(bytes(number))
            right.receive(7)
        return left.stats, right.stats

    assert run() == run()


def test_unpaired_end_can_be_closed() -> None:
    link = PairLink("alone")
    link.close()
    assert link.stats.disconnects == 0
