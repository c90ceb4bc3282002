# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which record was made by which message, and at what time messages without one count as handled."""

from mav_handlers.wire.messages import COMMAND_LONG, ODOMETRY, VISION_POSITION_ESTIMATE, Message
from viso.recording.matching import Handled, Record, baud_of, match
from viso.recording.recorder import Sent


def pose(stamp_us: int) -> VISION_POSITION_ESTIMATE:
    return VISION_POSITION_ESTIMATE(stamp_us, 0, 0, 0, 0, 0, 0)


def odometry(stamp_us: int) -> ODOMETRY:
    zeros = (0.0,) * 21
    return ODOMETRY(stamp_us, 20, 12, 0, 0, 0, (1.0, 0.0, 0.0, 0.0), 0, 0, 0, 0, 0, 0, zeros, zeros)


def command() -> COMMAND_LONG:
    return COMMAND_LONG(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)


def sent(time_us: int, message: Message) -> Sent:
    return Sent(time_us, time_us, message, bytes(40))


def record(name: str, time_us: int, stamp_us: int, corrected_ms: int = 0) -> Record:
    return Record(time_us, name, stamp_us, (time_us, stamp_us, corrected_ms))


def arrivals(handled: list[Handled]) -> list[int | None]:
    return [one.arrival_us for one in handled]


def test_records_go_to_the_message_of_their_stamp_and_kind() -> None:
    messages = [sent(1000, pose(7)), sent(2000, odometry(8)), sent(3000, pose(9))]
    records = [record("VISP", 1500, 7), record("VISP", 2500, 8), record("VISV", 2500, 8), record("VISP", 3500, 9)]
    handled, left = match(messages, records)
    assert [[one.name for one in each.records] for each in handled] == [["VISP"], ["VISP", "VISV"], ["VISP"]]
    assert arrivals(handled) == [1500, 2500, 3500]
    assert left == 0


def test_odometry_that_was_dropped_takes_no_record_of_a_pose_with_its_stamp() -> None:
    handled, left = match([sent(1000, odometry(7)), sent(2000, pose(7))], [record("VISP", 2500, 7)])
    assert [len(one.records) for one in handled] == [0, 1]
    assert (arrivals(handled), left) == ([1000, 2500], 0)


def test_same_stamps_are_taken_in_order() -> None:
    handled, _ = match([sent(1000, pose(7)), sent(2000, pose(7))], [record("VISP", 1500, 7), record("VISP", 2500, 7)])
    assert arrivals(handled) == [1500, 2500]


def test_record_of_long_before_is_of_no_message() -> None:
    handled, left = match([sent(9_000_000, pose(7))], [record("VISP", 1_000_000, 7)])
    assert (handled[0].records, left) == ((), 1)


def test_message_without_record_was_handled_between_its_neighbours() -> None:
    messages = [
        sent(900, command()),
        sent(1000, pose(7)),
        sent(1200, command()),
        sent(1300, pose(8)),
        sent(9000, command()),
    ]
    handled, _ = match(messages, [record("VISP", 1500, 7), record("VISP", 2500, 8)])
    assert arrivals(handled) == [900, 1500, 1500, 2500, 9000]


def test_transport_time_of_the_first_record_tells_the_rate() -> None:
    size = 12 + 117

    def rate_of(lag_us: float) -> int | None:
        corrected_ms = round((5_000_000 - lag_us) / 1000)
        return baud_of(match([sent(4_999_000, pose(7))], [record("VISP", 5_000_000, 7, corrected_ms)])[0])

    assert rate_of(1000) is None
    assert rate_of(size * 10e6 / 115_200 + 1000) == 115_200
    assert rate_of(size * 10e6 / 57_600 + 1000) == 57_600
    assert baud_of([]) is None
