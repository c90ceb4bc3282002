# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the way."""

from itertools import pairwise

import pytest

from mav_handlers.wire.codec import BadData, Codec
from tests.unit.viso.faults.rig import (
    BEAT,
    decoded,
    encoded,
    every_kind,
    odometry,
    passed_over,
    position,
    speed,
)
from viso.faults import Injector, TimedFrame, inject, parse_timeline, run_through

PERIOD_US = 50_000


def stream(count: int, period_us: int = PERIOD_US) -> list[TimedFrame]:
    """Return ODOMETRY whose x counts from 0."""
    frames = encoded(*(odometry(x=float(number)) for number in range(count)))
    return [(number * period_us, frame) for number, frame in enumerate(frames)]


def arrivals(fault: str, count: int = 8, period_us: int = PERIOD_US) -> list[tuple[int, int]]:
    """Return time in ms and number of what arrives of a stream."""
    timeline = parse_timeline(f"seed: 4\nfaults: [{{{fault}}}]")
    return [
        (time_us // 1000, int(decoded(frame)[1].x)) for time_us, frame in inject(stream(count, period_us), timeline)
    ]


def test_fail_loses_external_navigation_and_nothing_else() -> None:
    frames = [(0, frame) for frame in encoded(*every_kind(), BEAT)]
    assert [decoded(frame)[1] for _, frame in inject(frames, parse_timeline("faults: [{kind: fail}]"))] == [BEAT]


def test_blackout_loses_everything() -> None:
    frames = [(0, frame) for frame in (*encoded(*every_kind(), BEAT), b"noise")]
    assert not list(inject(frames, parse_timeline("faults: [{kind: blackout}]")))


def test_loss_by_chance_loses_the_share_that_it_should() -> None:
    assert 180 < 1000 - len(arrivals("kind: loss, probability: 0.2", 1000)) < 220


def test_loss_in_bursts_loses_rows() -> None:
    heard = [number for _, number in arrivals("kind: loss, probability: 0.05, burst_messages: 4", 400)]
    gaps = [after - before - 1 for before, after in pairwise(heard) if after - before > 1]
    assert gaps
    assert all(gap >= 4 for gap in gaps)


def test_loss_at_a_time_loses_one_message() -> None:
    assert [number for _, number in arrivals("kind: loss, at_s: 0.12", 6)] == [0, 1, 2, 4, 5]


@pytest.mark.parametrize(("rate_hz", "numbers"), [(20, range(12)), (10, range(0, 12, 2)), (15, [0, 2, 3, 4, 6, 7, 8])])
def test_rate_thins_out_to_the_grid(rate_hz: int, numbers: range) -> None:
    count = 12 if rate_hz != 15 else 9
    assert [number for _, number in arrivals(f"kind: rate, rate_hz: {rate_hz}", count)] == list(numbers)


def test_rate_holds_for_each_kind_of_message_by_itself() -> None:
    frames = [(0, frame) for frame in encoded(odometry(), speed(), odometry())]
    assert len(list(inject(frames, parse_timeline("faults: [{kind: rate}]")))) == 2


def test_delay_keeps_the_distances_and_lets_nobody_overtake_at_its_end() -> None:
    assert arrivals("kind: delay, delay_ms: 120, end_s: 0.1", 6) == [
        (120, 0), (170, 1), (170, 2), (170, 3), (200, 4), (250, 5)
    ]  # fmt: skip


def test_delay_of_one_kind_lets_others_pass() -> None:
    frames = [(0, frame) for frame in encoded(odometry(), BEAT)]
    late = list(inject(frames, parse_timeline("faults: [{kind: delay}]")))
    assert [(time_us, decoded(frame)[0].name) for time_us, frame in late] == [(0, "HEARTBEAT"), (100_000, "ODOMETRY")]


def test_jitter_is_late_by_up_to_its_length_and_keeps_the_order() -> None:
    heard = arrivals("kind: jitter, jitter_ms: 70", 200)
    lateness = [time_ms - number * 50 for time_ms, number in heard]
    assert [number for _, number in heard] == list(range(200))
    assert 0 <= min(lateness) < 5
    assert 65 < max(lateness) <= 70


def test_bunch_delivers_at_the_ends_of_its_periods() -> None:
    assert arrivals("kind: bunch, period_ms: 120", 7) == [
        (0, 0), (120, 1), (120, 2), (240, 3), (240, 4), (360, 5), (360, 6)
    ]  # fmt: skip


def test_reorder_lets_others_overtake() -> None:
    assert arrivals("kind: reorder, delay_ms: 70, at_s: 0.05", 4) == [(0, 0), (100, 2), (120, 1), (150, 3)]


def test_duplicates_follow_the_first_and_hold_up_nobody() -> None:
    assert arrivals("kind: duplicate, copies: 2, delay_ms: 60, at_s: 0", 3) == [
        (0, 0), (50, 1), (60, 0), (100, 2), (120, 0)
    ]  # fmt: skip
    first, second = inject(stream(1), parse_timeline("faults: [{kind: duplicate}]"))
    assert first == second


@pytest.mark.parametrize("bits", [1, 5])
def test_corrupt_flips_bits_and_the_checksum_tells(bits: int) -> None:
    ((_, before),) = stream(1)
    ((_, after),) = inject([(0, before)], parse_timeline(f"faults: [{{kind: corrupt, bits: {bits}}}]"))
    flipped = [old ^ new for old, new in zip(before, after, strict=True)]
    assert sum(value.bit_count() for value in flipped) == bits
    assert flipped[:3] == [0, 0, 0]
    codec = Codec(0, 0)
    codec.feed(after)
    assert isinstance(codec.next_received(), BadData)


def test_corrupt_passes_over_what_is_too_short() -> None:
    assert passed_over("kind: corrupt", b"\xfe\x00\x00") == {"too short": 1}


def test_mavlink1_has_no_extension_fields() -> None:
    (frame,) = encoded(position(reset_counter=3, covariance=(1.0,) * 21))
    ((_, old),) = inject([(0, frame)], parse_timeline("faults: [{kind: mavlink1}]"))
    header, message = decoded(old)
    assert (header.version, header.sequence, len(old)) == (1, 0, 40)
    assert (message.x, message.reset_counter, message.covariance) == (1.0, 0, (0.0,) * 21)


def test_mavlink1_leaves_what_is_or_cannot_be() -> None:
    assert passed_over("kind: mavlink1", encoded(odometry())[0]) == {"not in MAVLink 1": 1}
    assert passed_over("kind: mavlink1", encoded(position(), version=1)[0]) == {}


def test_sender_id_changes_the_ids_and_nothing_else() -> None:
    frames = encoded(odometry(), odometry(x=7.0))
    ((_, frame),) = inject([(0, frames[1])], parse_timeline("faults: [{kind: sender_id, component_id: 3}]"))
    header, message = decoded(frame)
    assert (header.system_id, header.component_id, header.sequence, message) == (2, 3, 1, odometry(x=7.0))


def test_second_sender_repeats_with_its_own_numbers_and_clock() -> None:
    timeline = parse_timeline("faults: [{kind: second_sender, clock_offset_s: 2, start_s: 0.1}]")
    injector = Injector(timeline)
    heard = [(time_us, *decoded(frame)) for time_us, frame in run_through(stream(4), injector)]
    told = [
        (time_us, header.sequence, message.time_usec, int(message.x))
        for time_us, header, message in heard
        if header.component_id == 198
    ]
    assert told == [(105_000, 0, 7_000_000, 2), (155_000, 1, 7_000_000, 3)]
    assert [header.sequence for _, header, _ in heard if header.component_id == 197] == [0, 1, 2, 3]
    assert injector.tally().added == 2
