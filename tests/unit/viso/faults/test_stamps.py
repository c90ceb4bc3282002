# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of the sender's clock."""

import pytest

from tests.unit.viso.faults.rig import (
    BEAT,
    STAMP_US,
    after,
    after_one,
    encoded,
    every_kind,
    odometry,
    passed_over,
    position,
)


def stamp(message: object) -> int:
    return int(getattr(message, "usec", 0) or getattr(message, "time_usec", 0))


@pytest.mark.parametrize(("fault", "stamp_us"), [
    ("kind: clock_step, step_ms: -1500", 3_500_000),
    ("kind: clock_step, step_ms: -60000", 0),
    ("kind: stamp_unit", 5_000),
    ("kind: stamp_unit, unit: s", 5),
    ("kind: stamp_unit, unit: ns", 5_000_000_000),
    ("kind: stamp_constant", 0),
    ("kind: stamp_constant, stamp_us: 77", 77),
])  # fmt: skip
def test_stamp_of_every_kind_of_message_changes(fault: str, stamp_us: int) -> None:
    assert [stamp(message) for message in after(fault, *every_kind())] == [stamp_us] * len(every_kind())


def test_only_the_stamp_changes() -> None:
    assert after_one("kind: stamp_constant", odometry()) == odometry(0)


def test_stamp_stays_within_its_64_bits() -> None:
    assert after_one("kind: stamp_unit, unit: ns", position(usec=2**63)).usec == 2**64 - 1


def test_clock_steps_and_stays() -> None:
    heard = after("kind: clock_step, step_ms: 10, at_s: 0.1", *[odometry()] * 3)
    assert [message.time_usec - STAMP_US for message in heard] == [0, 10_000, 10_000]


def test_clock_drifts_from_its_beginning_on() -> None:
    heard = after("kind: clock_drift, drift_ppm: -1000, start_s: 0.1", *[odometry()] * 4)
    assert [message.time_usec - STAMP_US for message in heard] == [0, 0, -100, -200]


@pytest.mark.parametrize("kind", ["clock_step", "stamp_unit", "stamp_constant"])
def test_message_without_a_stamp_is_passed_over(kind: str) -> None:
    assert passed_over(f"kind: {kind}", encoded(BEAT)[0]) == {"nothing in it to change": 1}
