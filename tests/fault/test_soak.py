# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Two minutes of ODOMETRY at 200 Hz and telemetry on two links, in virtual time: nothing lost, nothing grows."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.messages import HEARTBEAT

if TYPE_CHECKING:
    from tests.fault.conftest import Bench, MakeBench

pytestmark = pytest.mark.slow

STEP_US = 5000
SECOND_US = 1_000_000
RATES_HZ = {
    **{f"{group}": 4 for group in ("RAW_SENS", "EXT_STAT", "RC_CHAN", "EXTRA3")},
    **{f"{group}": 10 for group in ("POSITION", "EXTRA1", "EXTRA2")},
}
STREAMS = {f"MAV{link}_{group}": rate for link in (1, 2) for group, rate in RATES_HZ.items()}
ALLOWED_GROWTH_KB = 1_000


def resident_kb() -> int:
    """Return how much memory this process has."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4


def fly(bench: "Bench", seconds: int) -> int:
    """Send a sample every 5 ms, read both links every 50 ms, and beat as a ground station once a second.

    Returns:
        How many messages the vehicle sent.
    """
    received = 0
    for step in range(seconds * SECOND_US // STEP_US):
        bench.send_sample(0)
        bench.run_ms(STEP_US / 1000)
        if step % 200 == 0:
            bench.send(1, HEARTBEAT(6, 8, 0, 0, 0, 3))
        if step % 10 == 0:
            received += len(bench.read(0)) + len(bench.read(1))
            bench.drop_events()
    return received


def stand_soak(bench: "Bench", seconds: int) -> None:
    """Fly for a while and check that all is counted, logged and sent, and that memory has not grown."""
    third = seconds // 3
    fly(bench, third)
    begin_kb, begin_size = resident_kb(), bench.vehicle.logger.size
    sent = fly(bench, seconds - third)
    growth_kb = resident_kb() - begin_kb
    samples = seconds * SECOND_US // STEP_US
    assert bench.accepted(0) == samples
    assert bench.channels[0].frames_received == samples
    assert bench.channels[1].frames_received == seconds
    assert [channel.packets_dropped for channel in bench.channels] == [0, 0]
    assert [channel.frames_not_sent for channel in bench.channels] == [0, 0]
    assert (bench.endpoint.events_lost, bench.vehicle.texts.overwritten, bench.vehicle.logger.dropped) == (0, 0, 0)
    assert sent > (seconds - third) * 2 * 10
    assert growth_kb < ALLOWED_GROWTH_KB
    per_second = (bench.vehicle.logger.size - begin_size) / (seconds - third)
    assert 20_000 < per_second < 60_000
    bench.check_account()
    bench.check_params()
    records = bench.check_files()
    assert (records["VISP"], records["VISV"]) == (samples, samples)
    assert sum(path.stat().st_size for path in bench.store.directory.glob("*.BIN")) == bench.vehicle.logger.size


def test_two_minutes_at_200_hz_lose_nothing(make_bench: "MakeBench") -> None:
    stand_soak(make_bench(**STREAMS), 120)
