# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever sensors, the camera and parameters say, the filter goes on, and says nothing that is not a number.

What is absurd stays outside, and is counted. A state machine flies a vehicle, lets its sensors lie and changes
parameters under way; after each thing that happens, all states are finite and within their limits, and the covariance
is one.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.ahrs.sources import ROWS
from ekf_stub.core.inputs import Compasses, CompassReading
from ekf_stub.core.params import PARAM_NAMES
from ekf_stub.inputs.measurements import DOWNWARD, FinderState, GpsSample, RangeState, RangeStatus
from tests.unit.ekf_stub.filter_rig import (
    GRAVITY_MSS,
    HOME,
    PERIODS_US,
    SLOW_LOOP_US,
    WRAP_US,
    FilterRig,
    by_gps,
    navigating,
    standing,
)

NAN, INF = math.nan, math.inf
ODD = [0.0, -0.0, 1.0, -1.0, 1e-30, 1e5, -1e5, 1e30, -1e30, 5e-324, NAN, INF, -INF]
ROUNDING = 1e-9  # of a mix of errors in units of their sigmas
NO_VARIANCE = float(np.finfo(float).tiny / np.finfo(float).eps)
"""A variance below this and the products that it is compared with have lost digits."""


# What is absurd stays outside


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 1e30])
def test_what_is_absurd_counts_as_not_there_and_is_counted(bad: float) -> None:
    inputs = standing().core.inputs
    inputs.set_baro(900, bad)
    assert inputs.baro_ms == -1
    inputs.set_compasses(Compasses([CompassReading(0, (0.0, bad, 0.0))]))
    assert inputs.compasses.readings == []
    inputs.set_compasses(Compasses([CompassReading(0, (0.0, 1.0, 0.0), offsets=(bad, 0.0, 0.0))]))
    assert inputs.compasses.readings == []
    sound: dict[str, Any] = {"speed_accuracy": 0.3, "yaw_deg": 359.0}
    for field in ("speed_accuracy", "horizontal_accuracy", "vertical_accuracy", "yaw_deg"):
        inputs.set_gps(GpsSample(1000, 3, HOME, Vector3f(1, 2, 3), 10, **{**sound, field: bad}))
        assert inputs.gps is None
    inputs.set_gps(GpsSample(1000, 3, HOME, Vector3f(0, 0, bad), 10))
    assert inputs.gps is None
    for finder, clearance in (((0.0, bad), 0.1), ((bad, 0.0), 0.1), ((0.0, 1.0), bad)):
        place, distance = (0.0, finder[0], 0.0), finder[1]
        inputs.set_ranges(RangeState((FinderState(place, distance, DOWNWARD, RangeStatus.GOOD),), clearance))
        assert inputs.ranges is None
    inputs.set_declination(bad)
    assert inputs.declination == 0.0
    inputs.set_lever_arm((0.0, bad, 0.0))
    assert inputs.lever_arm == (0.0, 0.0, 0.0)
    counts = {"baro": 1, "compasses": 2, "gps": 5, "ranges": 3}
    assert inputs.refused == {**counts, "declination": 1, "lever_arm": 1}


def test_what_is_sound_comes_in_as_it_is_again() -> None:
    inputs = standing().core.inputs
    inputs.set_baro(900, NAN)
    inputs.set_baro(1000, 3.0)
    assert (inputs.baro_ms, inputs.baro_height) == (1000, 3.0)
    sample = GpsSample(1000, 3, HOME, Vector3f(1, 2, 3), 10)
    inputs.set_gps(sample)
    assert inputs.gps is sample
    inputs.set_lever_arm((0.1, 0.0, -0.2))
    assert inputs.lever_arm == (0.1, 0.0, -0.2)
    assert inputs.refused == {"baro": 1}


REST = (0.0, 0.0, -GRAVITY_MSS * 0.0025, 0.0, 0.0, 0.0, 0.0025, 0.0025)


@pytest.mark.parametrize("column", range(8))
@pytest.mark.parametrize("bad", [NAN, INF, -INF, 1e3, -1e3])
def test_last_sound_inertial_data_stand_in_for_what_is_absurd(column: int, bad: float) -> None:
    rig = navigating()
    before = rig.core.delta
    row = list(REST)
    row[column] = bad
    rig.run_row(*row)
    assert rig.core.refused == 1
    assert rig.core.delta is before
    rig.run(1.0)
    assert rig.miss_m() < 0.01


def test_rest_stands_in_for_inertial_data_that_are_absurd_from_the_first_on() -> None:
    rig = FilterRig()
    for _ in range(410):
        rig.run_row(*([NAN] * 8))
    assert rig.core.initialised
    assert rig.core.refused == 410
    assert rig.core.delta.del_vel == (0.0, 0.0, -GRAVITY_MSS * 0.0025)


@pytest.mark.parametrize("short", [0.0, 1e-300, 5e-5])
def test_rows_of_no_length_have_the_firmwares_least(short: float) -> None:
    rig = navigating()
    for _ in range(300):
        rig.run_row(*REST[:6], short, short)
    assert rig.core.refused == 0
    assert (rig.core.delta.del_vel_dt, rig.core.delta.del_ang_dt) == (1e-4, 1e-4)
    check(rig)


# What must hold


def numbers_of(value: object) -> Iterator[float]:
    """Yield all numbers of a report, one after the other."""
    if isinstance(value, tuple):
        for part in value:
            yield from numbers_of(part)
    elif hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            yield from numbers_of(getattr(value, name))
    elif isinstance(value, int | float):
        yield value


def check(rig: FilterRig) -> None:
    """Check that what the filter says makes sense."""
    core = rig.core
    if not core.initialised:
        return
    report = rig.report
    assert all(map(math.isfinite, numbers_of(report))), report
    assert abs(math.hypot(*report.quat_wxyz) - 1.0) < 1e-9
    assert abs(math.hypot(*core.state.quat) - 1.0) < 1e-9
    assert max(map(abs, core.state.vel)) <= 500.0
    assert max(map(abs, core.state.pos)) <= 50e6
    assert 0 <= report.flags < 1 << 17
    assert 0 <= report.timeouts < 1 << 6
    assert report.faults == 0
    assert min(report.vel_ratio, report.pos_ratio, report.height_ratio, report.mag_ratio, report.yaw_ratio) >= 0
    cov = rig.covariance()
    assert np.array_equal(cov, cov.T)
    variances = cov.diagonal()
    assert variances.min() >= 0
    sigma = np.sqrt(np.where(variances > NO_VARIANCE, variances, 1.0))
    assert np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0] > -ROUNDING


# Where it may begin


def in_flight() -> FilterRig:
    """Return a vehicle in flight whose filter fuses all axes of the compass."""
    rig = standing("66661", has_compass=True, run_s=3.0, loop_us=SLOW_LOOP_US)
    rig.feeds |= {"camera", "velocity"}
    rig.run(0.5)
    rig.arm()
    rig.climb(4.0)
    rig.run(0.5)
    assert rig.core.yaw.mag_fusion == 2
    return rig


def by_flow() -> FilterRig:
    """Return a vehicle that sees flow and ranges."""
    rig = FilterRig("05101", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.feeds |= {"flow", "ranges", "odometry"}
    rig.run(3.0)
    return rig


STARTS = {
    "cold": lambda: FilterRig("66666", loop_us=SLOW_LOOP_US),
    "at the wrap": lambda: FilterRig("66666", loop_us=SLOW_LOOP_US, start_us=WRAP_US - 3_000_000),
    "camera": lambda: navigating("66666", "velocity", loop_us=SLOW_LOOP_US),
    "two cores": lambda: navigating("66161", "gps", cores=2, has_compass=True, loop_us=SLOW_LOOP_US),
    "GPS": by_gps,
    "flow": by_flow,
    "flight": in_flight,
}
RUNNING = ("camera", "GPS", "flow", "flight")


@pytest.mark.parametrize("name", STARTS)
def test_machine_can_begin_there(name: str) -> None:
    rig = STARTS[name]()
    check(rig)
    assert rig.core.refused == 0
    assert rig.core.inputs.refused == {}


@pytest.mark.parametrize("value", [0.0, -1.0, 1e30, -1e30])
def test_no_value_of_all_parameters_spoils_anything(value: float) -> None:
    for name in RUNNING:
        rig = STARTS[name]()
        for number, parameter in enumerate(PARAM_NAMES):
            set_absurd(rig, parameter, value)
            if number % 6 == 0:
                rig.run(0.1)
                check(rig)
        rig.run(0.5)
        check(rig)


@pytest.mark.slow
@pytest.mark.parametrize("parameter", PARAM_NAMES)
def test_no_value_of_a_parameter_spoils_anything(parameter: str) -> None:
    for name in RUNNING:
        rig = STARTS[name]()
        for value in (1e30, -1.0, 0.0, 5e-324):
            set_absurd(rig, parameter, value)
            rig.run(0.2)
            check(rig)


INTEGRAL = {"AFFINITY", "FLOW_DELAY", "GPS_CHECK", "GSF_RUN_MASK", "GSF_USE_MASK", "HGT_DELAY", "MAG_CAL", "MAG_EF_LIM"}
INTEGRAL |= {"OGN_HGT_MASK", "OPTIONS", "PRIMARY", "FLOW_USE"}


def set_absurd(rig: FilterRig, parameter: str, value: float) -> None:
    """Set a parameter to what a ground station may: integers are of 16 bits at most."""
    number = max(-32768.0, min(value, 32767.0)) if parameter in INTEGRAL and math.isfinite(value) else value
    setattr(rig._params, parameter, number)


# Whatever comes


WIDE = st.sampled_from(ODD) | st.floats()
SINGLE = st.sampled_from(ODD) | st.floats(width=32)
"""What messages bring: single precision, of which no square overflows."""
SMALL = st.floats(-5, 5)
MOSTLY_SMALL = SMALL | SMALL | SINGLE
VECTORS = st.tuples(SMALL, SMALL, SMALL) | st.tuples(MOSTLY_SMALL, MOSTLY_SMALL, MOSTLY_SMALL)
STAMP_AGES = st.integers(0, 60) | st.integers(-50, 300) | st.integers(0, (1 << 32) - 1)
DELAYS = st.sampled_from([0, 10, 250]) | st.integers(0, 65535)
INT32 = st.integers(-(1 << 31), (1 << 31) - 1)
DTS = st.sampled_from([0.0025, 0.0, 1.0, 1e-300]) | WIDE
PLACES = st.builds(Location, INT32, INT32, INT32) | st.builds(
    lambda north, east, alt_cm: Location(HOME.lat + north, HOME.lng + east, HOME.alt_cm + alt_cm),
    *[st.integers(-9000, 9000)] * 3,
)
ACCURACIES = st.none() | WIDE
REAL = st.sampled_from([0.0, 1.0, -1.0, 1e-30, 1e30, -1e30]) | st.floats(
    allow_nan=False, allow_infinity=False, width=32
)


class FilterMachine(RuleBasedStateMachine):
    """A vehicle with the filter."""

    rig: FilterRig

    @initialize(name=st.sampled_from(sorted(STARTS)))
    def begin(self, name: str) -> None:
        """Begin at one of the starts."""
        self.rig = STARTS[name]()
        self.counted = 0

    @rule(seconds=st.floats(0.05, 0.5), accel=st.tuples(SMALL, SMALL, SMALL), yaw_rate=SMALL)
    def fly(self, seconds: float, accel: tuple[float, float, float], yaw_rate: float) -> None:
        """Move in some way."""
        self.rig.accel_ned, self.rig.yaw_rate = accel, yaw_rate
        self.rig.run(seconds)
        self.rig.accel_ned, self.rig.yaw_rate = (0.0, 0.0, 0.0), 0.0

    @rule(feed=st.sampled_from(sorted(PERIODS_US)))
    def switch_feed(self, feed: str) -> None:
        """Let what a sensor says come no more, or again."""
        self.rig.feeds ^= {feed}
        self.rig.run(0.2)

    @rule(vel=VECTORS | st.tuples(WIDE, WIDE, WIDE), ang=VECTORS, dts=st.tuples(DTS, DTS), passes=st.integers(1, 12))
    def shake(self, vel: tuple[float, ...], ang: tuple[float, ...], dts: tuple[float, ...], passes: int) -> None:
        """Let inertial data be anything for a while."""
        for _ in range(passes):
            self.rig.run_row(*[*vel, *ang, *dts] * len(self.rig.lanes.cores))

    @rule(height=WIDE, age_ms=STAMP_AGES)
    def press(self, height: float, age_ms: int) -> None:
        """Let the barometer say anything."""
        for core in self.rig.lanes.cores:
            core.inputs.set_baro((self.rig.now_ms - age_ms) & 0xFFFFFFFF, height)
        self.rig.run(0.1)

    @rule(field=st.tuples(WIDE, WIDE, WIDE) | VECTORS, special=st.sampled_from(["is_healthy", "is_used", "none"]))
    def disturb(self, field: tuple[float, float, float], special: str) -> None:
        """Let compasses say anything."""
        self.rig.compasses = {0: {"field": field}, 1: {} if special == "none" else {special: False}}
        self.rig.compass_count = 2
        self.rig.see_compasses()
        self.rig.run(0.1)
        self.rig.compasses = {}

    @rule(declination=WIDE, lever_arm=VECTORS, home_lat=INT32, flying_ms=st.integers(0, 1 << 32))
    def mislead(
        self,
        declination: float,
        lever_arm: tuple[float, float, float],
        home_lat: int,
        flying_ms: int,
    ) -> None:
        """Let something be said that is not true."""
        for core in self.rig.lanes.cores:
            core.inputs.set_declination(declination)
            core.inputs.set_lever_arm(lever_arm)
            core.inputs.home_lat = home_lat
        self.rig.flying_ms = flying_ms
        self.rig.run(0.1)

    @rule(
        place=PLACES,
        vel=VECTORS,
        fix_type=st.just(3) | st.integers(0, 6),
        sats=st.just(9) | st.integers(0, 255),
        accuracies=st.tuples(ACCURACIES, ACCURACIES, ACCURACIES, ACCURACIES),
        age_ms=st.just(0) | STAMP_AGES,
    )
    def find_place(self, place: Location, vel: Any, fix_type: int, sats: int, accuracies: Any, age_ms: int) -> None:
        """Let the GPS find any solution."""
        speed, horizontal, vertical, yaw = accuracies
        with np.errstate(over="ignore"):
            velocity = Vector3f(*vel)
        sample = GpsSample(
            (self.rig.now_ms - age_ms) & 0xFFFFFFFF,
            fix_type,
            place,
            velocity,
            sats,
            speed_accuracy=speed,
            horizontal_accuracy=horizontal,
            vertical_accuracy=vertical,
            yaw_deg=yaw,
        )
        for core in self.rig.lanes.cores:
            core.inputs.set_gps(sample)
        self.rig.run(0.3)

    @rule(pos=VECTORS, yaw=MOSTLY_SMALL, errs=st.tuples(MOSTLY_SMALL, MOSTLY_SMALL), age_ms=STAMP_AGES, delay_ms=DELAYS)
    def send_pose(self, pos: Any, yaw: float, errs: tuple[float, float], age_ms: int, delay_ms: int) -> None:
        """Send any pose."""
        self.rig.reset_ms = age_ms % 3
        stamp_ms = self.rig.now_ms - age_ms
        self.rig.camera(*pos, yaw=yaw, err=errs[0], yaw_err=errs[1], stamp_ms=stamp_ms, delay_ms=delay_ms)
        self.rig.run(0.1)

    @rule(vel=VECTORS, err=MOSTLY_SMALL, age_ms=STAMP_AGES, delay_ms=DELAYS)
    def send_velocity(self, vel: Any, err: float, age_ms: int, delay_ms: int) -> None:
        """Send any velocity."""
        self.rig.velocity(*vel, err=err, stamp_ms=self.rig.now_ms - age_ms, delay_ms=delay_ms)
        self.rig.run(0.1)

    @rule(vel=VECTORS, err=MOSTLY_SMALL, offset=VECTORS, age_ms=STAMP_AGES, del_time=WIDE)
    def send_odometry(self, vel: Any, err: float, offset: Any, age_ms: int, del_time: float) -> None:
        """Send any odometry of which nothing is said to be NaN."""
        stamp_ms = self.rig.now_ms - age_ms
        self.rig.odometry(*vel, err=err, offset=offset, stamp_ms=stamp_ms, del_time=del_time)
        self.rig.run(0.1)

    @rule(flow=st.tuples(MOSTLY_SMALL, MOSTLY_SMALL, MOSTLY_SMALL, MOSTLY_SMALL), offset=VECTORS, distance=WIDE | SMALL)
    def look_down(self, flow: tuple[float, ...], offset: Any, distance: float) -> None:
        """Let flow sensor and range finder say anything."""
        self.rig.flow(flow[0], flow[1], gyro=flow[2:], offset=offset)
        for _ in range(4):
            self.rig.see_range(distance, place=offset)
            self.rig.run(0.06)

    @rule(name=st.sampled_from(PARAM_NAMES), value=REAL)
    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, within its range or not."""
        set_absurd(self.rig, name, value)
        self.rig.run(0.1)

    @rule(number=st.integers(1, 3), row=st.sampled_from(ROWS), value=st.sampled_from([0, 1, 2, 3, 5, 6, 6, 8, 99, -1]))
    def set_source(self, number: int, row: str, value: int) -> None:
        """Change what a source set names."""
        self.rig.table.set(f"EK3_SRC{number}_{row}", value)
        self.rig.sources.forget()
        self.rig.run(0.2)

    @rule(index=st.integers(0, 2))
    def choose_sources(self, index: int) -> None:
        """Choose another source set."""
        self.rig.sources.active_set = index
        self.rig.run(0.2)

    @rule(armed=st.booleans(), near_ground=st.booleans(), has_compass=st.booleans(), stable=st.booleans())
    def change_vehicle(self, armed: bool, near_ground: bool, has_compass: bool, stable: bool) -> None:
        """Arm or disarm, expect take-off or not, gain or lose the compass."""
        self.rig.arm(armed, takeoff=near_ground)
        for core in self.rig.lanes.cores:
            core.inputs.has_compass = has_compass
            core.set_terrain_stable(stable)
        self.rig.run(0.2)

    @rule(place=PLACES, accuracy=WIDE, age_ms=STAMP_AGES)
    def tell_place(self, place: Location, accuracy: float, age_ms: int) -> None:
        """Set the origin, or put the vehicle somewhere."""
        self.rig.lanes.set_origin(place)
        self.rig.lanes.set_place(place, accuracy, (self.rig.now_ms - age_ms) & 0xFFFFFFFF)
        self.rig.one_pass()

    @rule()
    def ask_for_help(self) -> None:
        """Let heights count from here, ask for yaw and for another lane."""
        self.rig.lanes.reset_height_datum()
        self.rig.lanes.request_yaw_reset()
        self.rig.lanes.check_lane_switch()
        self.rig.one_pass()

    @rule(has_gyro=st.booleans(), has_accel=st.booleans())
    def lose_imu(self, has_gyro: bool, has_accel: bool) -> None:
        """Let an IMU fail, or come back."""
        imus = self.rig.imus
        if len(imus.imus) > 1:
            imus.imus[0].has_gyro, imus.imus[0].has_accel = has_gyro, has_accel
            imus.first_gyro, imus.first_accel = int(not has_gyro), int(not has_accel)
        self.rig.run(0.1)

    @rule(seconds=st.sampled_from([0.1, 1.0, 6.0, 8.0, 16.0, 86_400.0, None, -2.0]))
    def skip_time(self, seconds: float | None) -> None:
        """Let time pass without passes, perhaps until the milliseconds of 32 bits wrap, or run back."""
        to_wrap_us = WRAP_US - self.rig.now_us % WRAP_US - 200_000
        self.rig.now_us += max(0, to_wrap_us) if seconds is None else round(1e6 * seconds)
        self.rig.run(0.4)

    @invariant()
    def filter_keeps_its_head(self) -> None:
        """All is finite, and what was refused is counted."""
        if hasattr(self, "rig"):
            check(self.rig)
            counted = self.rig.core.refused + sum(self.rig.core.inputs.refused.values())
            assert counted >= self.counted
            self.counted = counted


def steps(examples: int, count: int) -> settings:
    """Return settings under which every run draws the same examples."""
    return settings(
        max_examples=examples,
        stateful_step_count=count,
        deadline=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )


def test_whatever_comes_the_filter_keeps_its_head() -> None:
    run_state_machine_as_test(FilterMachine, settings=steps(6, 20))


@pytest.mark.slow
def test_whatever_comes_the_filter_keeps_its_head_for_longer() -> None:
    run_state_machine_as_test(FilterMachine, settings=steps(50, 30))


def test_same_input_gives_the_same_output() -> None:
    def run() -> tuple[object, ...]:
        rig = STARTS["flight"]()
        rig.accel_ned, rig.yaw_rate = (0.3, -0.2, 0.1), 0.4
        rig.run(1.0)
        return rig.report, rig.texts, rig.outcomes, rig.covariance().tobytes()

    assert run() == run()
