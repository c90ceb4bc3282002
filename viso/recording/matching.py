# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which record of a log was made by which message, and when the autopilot handled it."""

from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from mav_handlers.wire.codec import V2_HEADER_AND_CRC_BYTES, full_length
from viso.files.float_bits import bits_of
from viso.recording.recorder import Sent

_MADE_BY: Final = {
    "VISION_POSITION_ESTIMATE": ("VISP",),
    "GLOBAL_VISION_POSITION_ESTIMATE": ("VISP",),
    "VICON_POSITION_ESTIMATE": ("VISP",),
    "ATT_POS_MOCAP": ("VISP",),
    "ODOMETRY": ("VISP", "VISV"),
    "VISION_SPEED_ESTIMATE": ("VISV",),
    "VISION_POSITION_DELTA": ("VISO",),
}
_EARLIEST_US: Final = -250_000
_LATEST_US: Final = 5_000_000
"""How long after its sending a message may be handled, by what is known of the autopilot's clock."""

_BITS_PER_BYTE: Final = 10
_BAUDS: Final = (57_600, 115_200)
_LOOP_US: Final = 2_500


class Record(NamedTuple):
    """A record of external navigation: its time, its name, the sender's stamp (0 without), and its fields."""

    time_us: int
    name: str
    stamp_us: int
    values: tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Handled:
    """A message, when it was handled in us since boot, and the records that it made."""

    sent: Sent
    arrival_us: int | None
    records: tuple[Record, ...]


def vision_records(log: bytes) -> list[Record]:
    """Return the records of external navigation of a log, in its order."""
    columns = LogColumns(log)
    found: list[tuple[int, Record]] = []
    for structure in LOG_STRUCTURE_FROM_VISUALODOM:
        name = structure.name
        if name not in columns.counts:
            continue
        rows = columns.records(name)
        labels = (rows.dtype.names or ())[1:]
        for offset, row in zip(columns.offsets(name).tolist(), rows, strict=True):
            values = tuple(row[label] if rows.dtype[label].kind == "f" else row[label].item() for label in labels)
            fields = dict(zip(labels, values, strict=True))
            found.append((offset, Record(int(fields["TimeUS"]), name, int(fields.get("RTimeUS", 0)), values)))
    return [record for _, record in sorted(found, key=lambda one: one[0])]


def out_of(handled: Handled) -> list[list[object]]:
    """Return what a message made as captures have it: floats in hex, everything else plain."""
    return [[one.name, *map(_plain, one.values)] for one in handled.records]


def _plain(value: object) -> object:
    return bits_of(np.float32(value)) if isinstance(value, np.floating) else value


def match(sent: Sequence[Sent], records: Sequence[Record]) -> tuple[list[Handled], int]:
    """Return each message with its records, and how many records are left that no message made.

    A record is of the first message without one that has its stamp, could make it, and was sent before. A message that
    made no record has the time at which it was sent by the autopilot's clock, but not before its predecessor's nor
    after its successor's.
    """
    waiting: dict[tuple[str, int], deque[Record]] = defaultdict(deque)
    for record in records:
        waiting[record.name, record.stamp_us].append(record)
    made = [_take(one, waiting) for one in sent]
    times = [min((record.time_us for record in own), default=None) for own in made]
    arrivals = list(_in_order(sent, times))
    handled = [Handled(*one) for one in zip(sent, arrivals, made, strict=True)]
    return handled, sum(map(len, waiting.values()))


def _take(sent: Sent, waiting: dict[tuple[str, int], deque[Record]]) -> tuple[Record, ...]:
    """Return the records of a message: all that it could make, or none."""
    stamp_us = getattr(sent.message, "usec", getattr(sent.message, "time_usec", 0))
    names = _MADE_BY.get(type(sent.message).__name__, ())
    queues = [waiting[name, 0 if name == "VISO" else stamp_us] for name in names]
    if not all(queues):
        return ()
    first = [queue[0] for queue in queues]
    if len({record.time_us for record in first}) != 1:
        return ()
    if sent.autopilot_us is not None and not _EARLIEST_US <= first[0].time_us - sent.autopilot_us <= _LATEST_US:
        return ()
    return tuple(queue.popleft() for queue in queues)


def _in_order(sent: Sequence[Sent], times_us: Sequence[int | None]) -> Iterator[int | None]:
    nexts: list[int | None] = []
    following: int | None = None
    for time_us in reversed(times_us):
        following = time_us if time_us is not None and (following is None or time_us < following) else following
        nexts.append(following)
    latest_us = 0
    for one, time_us, next_us in zip(sent, times_us, reversed(nexts), strict=True):
        if time_us is None and one.autopilot_us is None:
            yield None
            continue
        wanted_us = time_us if time_us is not None else one.autopilot_us or 0
        if next_us is not None:
            wanted_us = min(wanted_us, next_us)
        latest_us = max(latest_us, wanted_us)
        yield latest_us


def baud_of(handled: Sequence[Handled]) -> int | None:
    """Return the rate of the UART whose transport time the autopilot took off arrivals; None for none.

    The first message shows it: nothing of its sender's clock is known then, and its time is that of its first byte.
    """
    first = next((one for one in handled if one.records and one.records[0].name != "VISO"), None)
    if first is None:
        return None
    lag_us = first.records[0].time_us - 1000 * int(first.records[0].values[2])
    size = full_length(type(first.sent.message)) + V2_HEADER_AND_CRC_BYTES
    together = [one for one in handled if one.sent.now_us == first.sent.now_us]
    size += sum(len(one.sent.frame) for one in together[1:])
    expected = {baud: size * _BITS_PER_BYTE * 1e6 / baud for baud in _BAUDS}
    found = min(_BAUDS, key=lambda baud: abs(expected[baud] - lag_us))
    return found if lag_us > expected[found] / 2 and lag_us > _LOOP_US else None
