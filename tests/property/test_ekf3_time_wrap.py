# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every 49.7 days milliseconds of 32 bits wrap, as stamps and the firmware's clock have them; the filter goes on.

What happens is the same as at any other time, to the bit: texts and flags at the same relative times, and estimates.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import numpy as np
import pytest

from ap_core.cint import u32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.core.reporting import report_of
from ekf_stub.fusion.aiding import AidingMode
from tests.property.core_rig import DELAY_MS, CoreRig, numbers_of
from viso.sensors.options import ImuOptions
from viso.sensors.script.script import ScriptSource
from viso.sensors.script.script_file import parse_script

WRAP_US = (1 << 32) * 1000
START_US = 60_000_000
USUAL_US = 20 * 86_400_000_000
SLOW_LOOP_US = 20_000
SAMPLE_US = 100_000
POSE_US = 35_000

FLIGHT = """
start = "armed"
[[leg]]
shape = "point"
to_ned_m = [0, 0, -3]
duration_s = 4
[[leg]]
shape = "figure_eight"
length_m = 8
width_m = 4
period_s = 6
laps = 6
nose = "path"
"""


class Sample(NamedTuple):
    """What a core says, at a time since the start."""

    time_us: int
    flags: int
    timeouts: int
    mode: AidingMode
    numbers: tuple[float, ...]


class Voyage:
    """A run of the filter, of which samples are taken.

    Args:
        rig: the vehicle.

    Attributes:
        samples: what the core said, ten times per second.
        texts: what it told, with the time in us since the start.
    """

    def __init__(self, rig: CoreRig) -> None:
        self.rig = rig
        self.start_us = rig.now_us
        self.samples: list[Sample] = []
        self.texts: list[tuple[int, str]] = []
        self._told = 0

    @property
    def time_us(self) -> int:
        """Time since the start."""
        return self.rig.now_us - self.start_us

    def run_until(self, end_s: float, run_frame: Callable[[], None] | None = None) -> None:
        """Go on to a time since the start."""
        while self.time_us < 1e6 * end_s:
            (run_frame or self.rig.frame)()
            self._listen()

    def _listen(self) -> None:
        rig, core = self.rig, self.rig.core
        self.texts += [(self.time_us, text) for text in rig.texts[self._told :]]
        self._told = len(rig.texts)
        if core.initialised and self.time_us % SAMPLE_US == 0:
            report = report_of(core, rig.now_us // 1000)
            numbers = tuple(numbers_of(report))
            self.samples.append(Sample(self.time_us, report.flags, report.timeouts, core.aiding.mode, numbers))

    def modes(self) -> list[AidingMode]:
        """Return how it navigated, one after the other."""
        modes = [sample.mode for sample in self.samples]
        return [mode for mode, before in zip(modes, [None, *modes], strict=False) if mode is not before]


class ScriptFlight:
    """A flight of eights, with poses and velocities that agree with it."""

    def __init__(self, voyage: Voyage) -> None:
        self._rig = voyage.rig
        self._source = ScriptSource(ImuOptions(), parse_script(FLIGHT, "flight", 0.5))
        self._next_us = self._rig.now_us
        self.is_seen = True

    def frame(self) -> None:
        """Run a frame."""
        rig = self._rig
        now_us = rig.now_us + rig.loop_us
        self._source.set_armed(rig.armed)
        sensors = self._source.sense(now_us)
        assert sensors is not None
        assert sensors.baro is not None
        rig.frame(delta=sensors.delta, baro=(u32(sensors.baro[0]), sensors.baro[1]))
        if self.is_seen and now_us >= self._next_us:
            self._next_us = now_us + POSE_US
            truth = self._source.truth(now_us - 1000 * DELAY_MS)
            rig.give_pose(Vector3f(*truth.pos_ned), Quaternion(*truth.quat_wxyz), (0.2, 0.2))
            rig.give_velocity(Vector3f(*truth.vel_ned), 0.1)

    def miss_m(self) -> float:
        """Return how far off the filter is."""
        return float(np.linalg.norm(self._rig.core.position() - self._source.truth(self._rig.now_us).pos_ned))


def slow(sources: str, *feeds: str, has_compass: bool = False, start_us: int) -> Voyage:
    """Return a vehicle that stands, or moves as it is told, with frames at 50 Hz."""
    rig = CoreRig(sources, has_compass=has_compass, start_us=start_us, loop_us=SLOW_LOOP_US)
    rig.feeds.update(feeds)
    return Voyage(rig)


# What happens, at the times that are told


def lose_sight_in_flight(start_us: int) -> Voyage:
    """Fly eights, see nothing from 8 s on, so that aiding stops at 23 s, and see again at 24 s."""
    voyage = Voyage(CoreRig("66666", start_us=start_us, loop_us=10_000))
    flight = ScriptFlight(voyage)
    voyage.run_until(4, flight.frame)
    voyage.rig.armed = True
    voyage.run_until(8, flight.frame)
    assert flight.miss_m() < 0.05
    flight.is_seen = False
    voyage.run_until(24, flight.frame)
    flight.is_seen = True
    voyage.run_until(27, flight.frame)
    assert flight.miss_m() < 0.05
    assert voyage.modes() == [AidingMode.NONE, AidingMode.ABSOLUTE, AidingMode.NONE, AidingMode.ABSOLUTE]
    return voyage


def lose_pose(start_us: int) -> Voyage:
    """Have poses without velocities until 6 s, none until 16 s, then some that are elsewhere."""
    voyage = slow("66666", "pose", start_us=start_us)
    voyage.run_until(6)
    voyage.rig.feeds -= {"pose"}
    voyage.run_until(16)
    voyage.rig.feeds |= {"pose"}
    voyage.rig.pos += (3.0, 0.0, -2.0)
    voyage.run_until(20)
    assert voyage.modes() == [AidingMode.NONE, AidingMode.ABSOLUTE]
    assert any(sample.timeouts & 3 == 3 for sample in voyage.samples)
    return voyage


def stand(sources: str, start_us: int, *, has_compass: bool = False) -> Voyage:
    """Wait for external navigation that does not come."""
    voyage = slow(sources, has_compass=has_compass, start_us=start_us)
    voyage.run_until(20)
    assert voyage.modes() == [AidingMode.NONE]
    return voyage


def wait_for_odometry(start_us: int) -> Voyage:
    """Wait so long for odometry that all else that it takes is there."""
    voyage = slow("06101", has_compass=True, start_us=start_us)
    voyage.run_until(46)
    voyage.rig.feeds |= {"odometry"}
    voyage.run_until(47)
    assert voyage.modes() == [AidingMode.NONE, AidingMode.RELATIVE]
    return voyage


def use(sources: str, feed: str, mode: AidingMode, start_us: int) -> Voyage:
    """Navigate by something, lose it at 42 s, and find it again at 49 s."""
    voyage = slow(sources, feed, has_compass=True, start_us=start_us)
    voyage.run_until(42)
    assert voyage.samples[-1].mode is mode
    voyage.rig.feeds -= {feed}
    voyage.run_until(49)
    voyage.rig.feeds |= {feed}
    voyage.run_until(52)
    return voyage


def lose_all_flags(start_us: int) -> Voyage:
    """Move while parked, as velocities say, until the filter restarts."""
    voyage = slow("06666", "velocity", start_us=start_us)
    voyage.run_until(3)
    voyage.rig.vel[0] = 5.0
    voyage.run_until(20)
    assert "EKF3 IMU0 forced reset" in voyage.rig.texts
    return voyage


def stay_up(start_us: int) -> Voyage:
    """Be up and navigate since soon after boot, and for weeks; little but the last of that is run."""
    voyage = slow("66666", "pose", start_us=0)
    voyage.run_until(5)
    assert voyage.samples[-1].mode is AidingMode.ABSOLUTE
    for part in (1, 2, 3):  # so that none is half of 2^32 ms long
        voyage.rig.run(1.0)
        voyage.rig.now_us = start_us * part // 3 // SAMPLE_US * SAMPLE_US
    after = Voyage(voyage.rig)
    after.run_until(14)
    assert after.samples[-1].mode is AidingMode.ABSOLUTE
    return after


SCENARIOS: dict[str, Callable[[int], Voyage]] = {
    "flight": lose_sight_in_flight,
    "pose": lose_pose,
    "nothing": partial(stand, "66666"),
    "nothing but a compass": partial(stand, "66661", has_compass=True),
    "no odometry": wait_for_odometry,
    "odometry": partial(use, "06101", "odometry", AidingMode.RELATIVE),
    "GPS": partial(use, "33131", "gps", AidingMode.ABSOLUTE),
    "forced reset": lose_all_flags,
}


def just_before_wrap_us(wrap_s: int) -> int:
    """Return a time that is so long before the wrap; readings are taken every tenth of a second since boot."""
    return (WRAP_US - 1_000_000 * wrap_s) // SAMPLE_US * SAMPLE_US


@cache
def usual(name: str) -> Voyage:
    """Return how it goes when nothing wraps."""
    return SCENARIOS[name](USUAL_US)


def assert_same(one: Voyage, other: Voyage, within: float = 0.0) -> None:
    """Check that two runs went the same way, to the bit unless estimates may differ a little."""
    assert one.texts == other.texts
    for first, second in zip(one.samples, other.samples, strict=True):
        assert first[:-1] == second[:-1]
        assert np.abs(np.subtract(first.numbers, second.numbers)).max() <= within


@pytest.mark.parametrize(
    ("name", "wrap_s"),
    [
        ("pose", 10),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                *(
                    ("flight", 6),
                    ("flight", 10),
                    ("flight", 23),
                    ("pose", 5),
                    ("nothing", 10),
                    ("nothing but a compass", 10),
                ),
                *(("no odometry", 45), ("odometry", 46), ("GPS", 46), ("forced reset", 6), ("forced reset", 15)),
            )
        ),
    ],
)
def test_wrap_makes_no_difference(name: str, wrap_s: int) -> None:
    assert_same(SCENARIOS[name](just_before_wrap_us(wrap_s)), usual(name))


@pytest.mark.slow
def test_nothing_happens_2_to_the_32_milliseconds_after_what_happened_at_boot() -> None:
    assert_same(stay_up(just_before_wrap_us(10)), stay_up(USUAL_US), within=1e-9)


@pytest.mark.slow
def test_soon_after_boot_it_goes_as_after_weeks() -> None:
    assert_same(lose_sight_in_flight(START_US), usual("flight"), within=1e-9)
