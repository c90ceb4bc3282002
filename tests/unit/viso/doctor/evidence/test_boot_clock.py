# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A recording of a slowed simulation is looked at by the autopilot's own clock, and the wall's is named."""

import numpy as np
import pytest

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, HEARTBEAT, SIMSTATE
from tests.unit.viso.conftest import odometry
from tests.unit.viso.doctor.evidences import evidence_of, findings_of, seen_in
from viso.doctor.evidence.boot_clock import BootClock, boot_clock, by_boot_clock
from viso.doctor.evidence.vehicle_data import listen
from viso.streams.stream_kinds import Stream, StreamMessage

WALL_US = np.arange(0, 40_000_000, 40_000)
CHANGING_US = np.interp(WALL_US, (0, 2e7, 4e7), (0, 1.6e7, 2e7)).astype(np.int64)


def recorded(boot_us: np.ndarray, *extra: SIMSTATE) -> Stream:
    """Return what a ground station writes down: both sides, by the wall's clock; the camera stamps by it as well."""
    pilot, camera, messages = Codec(1, 1), Codec(1, 197), []
    said = [HEARTBEAT(2, 3, 81, 0, 3, 3), *extra]
    for wall_us, at_us in zip(WALL_US.tolist(), boot_us.tolist(), strict=True):
        attitude = ATTITUDE(60_000 + at_us // 1000, 0.0, 0.0, 0.001 * wall_us / 40_000, 0.0, 0.0, 0.0)
        for codec, sent in ((pilot, said.pop(0) if said else attitude), (camera, odometry(1 + wall_us))):
            messages.append(StreamMessage(5_000_000 + wall_us, codec.encode(sent)))
    return Stream("slow", tuple(messages))


def clock_of(stream: Stream) -> BootClock:
    clock = listen(stream).clock
    assert clock is not None
    return clock


def test_times_become_those_of_the_autopilot() -> None:
    stream = recorded(CHANGING_US)
    clock = clock_of(stream)
    moved = by_boot_clock(stream, clock)
    arrival_us = np.array([one.arrival_us for one in moved.messages[::2]])
    assert np.abs(arrival_us - 5_000_000 - CHANGING_US).max() < 30_000
    assert "the autopilot's clock runs at 0.5 times that of the recording (0.2 to 0.8 in stretches)" in moved.notes[0]
    assert listen(moved).clock is None


def test_clock_of_a_wall_beside_it_is_named() -> None:
    stream = recorded(CHANGING_US)
    moved = by_boot_clock(stream, clock_of(stream))
    seen = [one for one in seen_in(moved) if one.component_id == 197]
    finding = findings_of(evidence_of(seen, is_simulated=True))["XN3-12"]
    assert "as a wall clock does beside a simulation whose speed changes" in finding.evidence
    assert "use_sim_time" in finding.fix


def test_clock_that_runs_as_the_recordings_is_left_alone() -> None:
    assert listen(recorded(WALL_US)).clock is None
    assert boot_clock([]) is None
    assert boot_clock([(n * 40_000, n * 40_000 + 7) for n in range(300)]) is None


def test_what_a_simulator_says_is_heard() -> None:
    states = [SIMSTATE(0.1, 0.2, 0.3, 0, 0, 0, 0, 0, 0, -353_632_621, 1_491_652_374 + 100 * n) for n in range(30)]
    told = listen(recorded(WALL_US, *states))
    assert told.is_simulated
    assert told.truth is not None
    assert told.truth.euler_rad[0].tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert told.position is not None
    assert told.position.origin == "SIMSTATE"
    assert np.isnan(told.position.ned_m[:, 2]).all()
    assert np.ptp(told.position.ned_m[:, 1]) == pytest.approx(2900 * 0.01113 * 0.8155, rel=2e-3)
