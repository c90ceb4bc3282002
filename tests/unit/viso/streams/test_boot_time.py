# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of telemetry logs are the autopilot's."""

from pathlib import Path

import pytest

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, HEARTBEAT, SYSTEM_TIME, Message
from viso.streams.boot_time import boot_time_us
from viso.streams.telemetry_log import read_telemetry_log

BEAT = HEARTBEAT(0, 2, 3, 81, 4, 3)
EPOCH_US = 1_700_000_000_000_000


def tlog(path: Path, *rows: tuple[float, int, Message]) -> Path:
    """Write a telemetry log of rows of time in s, component and message, all of system 1."""
    codecs = {component: Codec(1, component) for _, component, _ in rows}
    data = b"".join(
        (EPOCH_US + round(at_s * 1e6)).to_bytes(8, "big") + codecs[component].encode(message)
        for at_s, component, message in rows
    )
    path.write_bytes(data)
    return path


def begins_s(path: Path, *rows: tuple[float, int, Message]) -> float:
    return read_telemetry_log(tlog(path / "a.tlog", *rows), 30_000_000).begins_us * 1e-6


def attitude(boot_s: float) -> ATTITUDE:
    return ATTITUDE(round(boot_s * 1e3), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_times_are_those_of_the_autopilot_s_clock(tmp_path: Path) -> None:
    rows = [(0.0, 1, BEAT), (1.0, 1, SYSTEM_TIME(0, 101_000)), (2.0, 1, attitude(102.0))]
    assert begins_s(tmp_path, *rows) == pytest.approx(100.0)


def test_quickest_message_of_ten_seconds_counts(tmp_path: Path) -> None:
    late = [(at_s, 1, attitude(100.0 + at_s - 0.2)) for at_s in (0.0, 1.0, 3.0)]
    assert begins_s(tmp_path, (0.0, 1, BEAT), *late, (4.0, 1, attitude(104.0))) == pytest.approx(100.0)
    assert begins_s(tmp_path, (0.0, 1, BEAT), *late, (40.0, 1, attitude(140.0))) == pytest.approx(99.8)


def test_clocks_of_others_do_not_count(tmp_path: Path) -> None:
    rows = [(0.0, 1, BEAT), (1.0, 191, attitude(900.0)), (2.0, 1, attitude(5.0))]
    assert begins_s(tmp_path, *rows) == pytest.approx(3.0)


def test_nothing_comes_before_boot(tmp_path: Path) -> None:
    stream = read_telemetry_log(tlog(tmp_path / "a.tlog", (0.0, 1, BEAT), (9.0, 1, attitude(2.0))), 0)
    assert [message.arrival_us for message in stream.messages] == [0, 2_000_000]


def test_lead_counts_without_the_autopilot_s_clock(tmp_path: Path) -> None:
    stream = read_telemetry_log(tlog(tmp_path / "a.tlog", (0.0, 1, BEAT), (1.0, 1, BEAT)), 30_000_000)
    assert boot_time_us(stream) is None
    assert stream.begins_us == 30_000_000
