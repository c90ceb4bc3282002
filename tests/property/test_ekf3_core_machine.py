# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever sensors and external navigation say, the filter says nothing that is not a number.

A state machine flies a vehicle, lets its sensors lie, and changes parameters and sources under way. It begins at boot
or where the filter navigates already: by external navigation, by GPS, by odometry, or in flight with all axes of the
compass. What must hold after each frame is in ``CoreRig.check``; nothing raises, and no arithmetic warns.

Tried with 5 examples of 25 steps each, always the same ones, and 2 with two cores that must agree to the bit; the
slow tests take 80 and 24.
"""

import copy
import math
from collections.abc import Callable
from functools import cache
from inspect import signature
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from ap_core.cint import u32
from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.compiled.compiled_pass import COMPILED
from ekf_stub.filter.inertial import InertialDelta
from ekf_stub.filter.inertial_pass import PLAIN, Kernel
from ekf_stub.fusion.aiding import AidingMode
from ekf_stub.inputs.gps_sample import GpsSample
from ekf_stub.inputs.sources import ROWS
from tests.property.core_rig import FEEDS, HOME, CoreRig

WRAP_US = (1 << 32) * 1000
SLOW_LOOP_US = 20_000
PARAMETERS = (
    *("VELNE_M_NSE", "VELD_M_NSE", "VEL_I_GATE", "POSNE_M_NSE", "POS_I_GATE", "GLITCH_RAD", "ALT_M_NSE", "HGT_I_GATE"),
    *("HGT_DELAY", "MAG_M_NSE", "MAG_CAL", "MAG_I_GATE", "GYRO_P_NSE", "ACC_P_NSE", "GBIAS_P_NSE", "ABIAS_P_NSE"),
    *("NOAID_M_NSE", "YAW_M_NSE", "YAW_I_GATE", "TAU_OUTPUT", "MAGE_P_NSE", "MAGB_P_NSE", "ACC_BIAS_LIM", "MAG_EF_LIM"),
    *("VIS_VERR_MIN", "VIS_VERR_MAX", "HRT_FILT", "OGNM_TEST_SF", "SRC_OPTIONS"),
)
SINGLE_MAX = float(np.finfo(np.float32).max)
ODD = [0.0, -0.0, 1.0, -1.0, 1e-8, 1e-30, 1e5, -1e5, 1e30, -1e30, SINGLE_MAX, math.nan, math.inf, -math.inf]
WIDE = st.sampled_from(ODD) | st.floats()
FLOATS = st.sampled_from(ODD) | st.floats(width=32)
SMALL = st.floats(-5, 5, width=32)
MOSTLY_SMALL = SMALL | SMALL | FLOATS
THREE = st.tuples(SMALL, SMALL, SMALL) | st.tuples(MOSTLY_SMALL, MOSTLY_SMALL, MOSTLY_SMALL)
VECTORS = THREE.map(lambda parts: Vector3f(*parts))
QUATERNIONS = st.tuples(*[MOSTLY_SMALL] * 4).map(lambda parts: Quaternion(*parts))
ERRORS = st.floats(0.0078125, 2, width=32) | FLOATS
STAMP_AGES = st.integers(0, 60) | st.integers(-50, 300) | st.integers(0, (1 << 32) - 1)
SHORTLY = st.just(0.0) | st.just(0.1)
DELAYS = st.sampled_from([0, 10, 250]) | st.integers(0, 65535)
INT32 = st.integers(-(1 << 31), (1 << 31) - 1)
DTS = st.sampled_from([0.0025, 0.0, 1.0, 1e-300]) | WIDE
PLACES = st.builds(Location, INT32, INT32, INT32) | st.builds(
    lambda north, east, alt_cm: Location(HOME.lat + north, HOME.lng + east, HOME.alt_cm + alt_cm),
    *[st.integers(-9000, 9000)] * 3,
)
TIMES_S = st.sampled_from([0.1, 1.0, 6.0, 8.0, 16.0, 86_400.0])


def delta_of(parts: tuple[float, ...]) -> InertialDelta:
    """Return inertial data."""
    return InertialDelta(np.array(parts[:3]), np.array(parts[3:6]), parts[6], parts[7])


DELTAS = st.tuples(*[MOSTLY_SMALL | WIDE] * 6, DTS, DTS).map(delta_of)
OTHER_FIELDS = st.one_of(
    st.fixed_dictionaries({"declination": WIDE, "place_declination": st.none() | WIDE}),
    st.fixed_dictionaries({"lever_arm": st.tuples(*[MOSTLY_SMALL] * 3) | st.tuples(*[WIDE] * 3)}),
    st.fixed_dictionaries({"home_lat": INT32, "flying_ms": st.integers(0, (1 << 32) - 1)}),
)
SOLUTIONS = st.fixed_dictionaries(
    {
        "fix_type": st.just(3) | st.integers(0, 6),
        "location": PLACES,
        "vel_ned": VECTORS,
        "num_sats": st.just(9) | st.integers(0, 255),
    },
    optional={
        "hdop": st.integers(0, 65535),
        "has_vertical_velocity": st.booleans(),
        "speed_accuracy": st.none() | FLOATS,
        "horizontal_accuracy": st.none() | FLOATS,
        "vertical_accuracy": st.none() | FLOATS,
        "yaw_deg": st.none() | FLOATS,
    },
)


# Where it begins


def boot(sources: str, *feeds: str, **options: Any) -> CoreRig:
    """Return a vehicle as it boots."""
    rig = CoreRig(sources, loop_us=SLOW_LOOP_US, **options)
    rig.feeds.update(feeds)
    return rig


def run_until(rig: CoreRig, is_reached: Callable[[CoreRig], bool], within_s: float) -> CoreRig:
    """Let time pass until something has come about, which it must."""
    for _ in range(round(10 * within_s)):
        if is_reached(rig):
            return rig
        rig.run(0.1)
    raise AssertionError(f"not within {within_s} s: {rig.texts}")


def navigates(mode: AidingMode) -> Callable[[CoreRig], bool]:
    """Return what says whether the filter navigates in a way."""
    return lambda rig: rig.core.initialised and rig.core.aiding.mode is mode


def by_ext_nav(sources: str, *feeds: str) -> CoreRig:
    """Return a vehicle that navigates by external navigation."""
    rig = run_until(boot(sources, "pose", *feeds), navigates(AidingMode.ABSOLUTE), 4)
    assert "EKF3 IMU0 is using external nav data" in rig.texts
    return rig


def by_gps() -> CoreRig:
    """Return a vehicle that navigates by GPS, and has external navigation in its second source set."""
    rig = boot("33131", "gps", has_compass=True, **{f"EK3_SRC2_{row}": 6 for row in ROWS})
    run_until(rig, navigates(AidingMode.ABSOLUTE), 60)
    assert "EKF3 IMU0 is using GPS" in rig.texts
    return rig


def by_odometry() -> CoreRig:
    """Return a vehicle that navigates by odometry."""
    return run_until(boot("06101", "odometry", has_compass=True), navigates(AidingMode.RELATIVE), 60)


def with_field() -> CoreRig:
    """Return a vehicle in flight whose filter fuses all axes of the compass."""
    rig = run_until(boot("66661", "pose", "velocity", has_compass=True), navigates(AidingMode.ABSOLUTE), 4)
    rig.armed, rig.accel_ned = True, np.array([0.0, 0.3, -2.0])
    run_until(rig, lambda flying: flying.fused_field, 4)
    rig.accel_ned = np.array([0.0, -0.3, 2.0])
    rig.run(1)
    assert rig.core.state.learns_field
    assert rig.core.control.vehicle.in_flight
    return rig


STARTS: dict[str, Callable[[], CoreRig]] = {
    "cold": lambda: boot("66666", "pose"),
    "cold with all": lambda: boot("36161", *FEEDS, has_compass=True),
    "at the wrap": lambda: boot("66666", "pose", "velocity", start_us=WRAP_US - 3_000_000),
    "pose": lambda: by_ext_nav("66666"),
    "pose and velocity": lambda: by_ext_nav("66666", "velocity"),
    "pose, baro and GPS at hand": lambda: by_ext_nav("66166", "velocity", "gps"),
    "GPS": by_gps,
    "odometry": by_odometry,
    "field": with_field,
}


@cache
def started(name: str, kernel: Kernel = PLAIN) -> CoreRig:
    """Return where a machine may begin, to be copied."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CoreRig, "kernel", kernel)
        return STARTS[name]()


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in ("GPS", "odometry") else ()) for name in STARTS]
)
def test_machine_can_begin_there(name: str) -> None:
    assert started(name).core.refused.total() == 0


# One lie at a time


def say_inertial(
    rig: CoreRig, *, vx: float = 0.0, vz: float = -0.2, ax: float = 0.0, vel_dt: float = 0.02, ang_dt: float = 0.02
) -> None:
    """Let inertial data say something."""
    rig.frame(delta=delta_of((vx, 0.0, vz, ax, 0.0, 0.0, vel_dt, ang_dt)))


def say_sensors(
    rig: CoreRig,
    *,
    height: float = 0.0,
    field: float = 200.0,
    declination: float = 0.1,
    place_declination: float = 0.2,
    lever_arm: float = 0.0,
) -> None:
    """Let other sensors say something for a while."""
    rig.run(
        0.1,
        baro=(rig.now_ms, height),
        mag=(rig.now_us, np.array([field, 0.0, field])),
        declination=declination,
        place_declination=place_declination,
        lever_arm=(0.0, lever_arm, 0.0),
    )


def say_solution(
    rig: CoreRig,
    *,
    vel: float = 0.0,
    speed_accuracy: float = 0.3,
    horizontal_accuracy: float = 0.5,
    vertical_accuracy: float = 0.5,
    yaw_deg: float = 20.0,
) -> None:
    """Let the GPS say something."""
    rig.gps = GpsSample(
        *(rig.now_ms, 3, HOME, Vector3f(0, vel, vel), 12, 80, 80, True),
        *(speed_accuracy, horizontal_accuracy, vertical_accuracy, yaw_deg),
    )


def say_pose(rig: CoreRig, *, z: float = 0.0, qx: float = 0.0, err: float = 0.2, yaw_err: float = 0.2) -> None:
    """Let external navigation give a pose."""
    rig.give_pose(Vector3f(0, 0, z), Quaternion(0, qx, 0, 0), (err, yaw_err))


def say_velocity(rig: CoreRig, *, north: float = 0.0, down: float = 0.0, err: float = 0.1) -> None:
    """Let external navigation give a velocity."""
    rig.give_velocity(Vector3f(north, 0, down), err)


def say_odometry(
    rig: CoreRig, *, way: float = 0.0, turn: float = 0.0, dt: float = 0.066, place: float = 0.0, quality: float = 99.0
) -> None:
    """Let external navigation give odometry."""
    rig.give_odometry(quality, (Vector3f(way, 0, 0), Vector3f(0, turn, 0), dt), pos_offset=Vector3f(0, 0, place))


def say_noise_of_odometry(rig: CoreRig, *, worst: float = 0.9) -> None:
    """Set the errors of odometry, and let external navigation give some."""
    rig.set_param("EK3_VIS_VERR_MIN", -worst)
    rig.set_param("EK3_VIS_VERR_MAX", worst)
    say_odometry(rig, quality=100.0)


def say_place(rig: CoreRig, *, accuracy: float = 1.0) -> None:
    """Tell the filter where it is."""
    rig.core.set_place(HOME, accuracy, rig.now_ms)


SAYERS: tuple[Callable[..., None], ...] = (
    *(say_inertial, say_sensors, say_solution, say_pose, say_velocity),
    *(say_odometry, say_noise_of_odometry, say_place),
)
LIES = [(say, part) for say in SAYERS for part in list(signature(say).parameters)[1:]]
NUMBERS = (math.nan, math.inf, -math.inf, SINGLE_MAX, -SINGLE_MAX, 1e7, -1.0, 0.0, 5e-324)
RUNNING = [name for name in STARTS if not name.startswith(("cold", "at"))]


@pytest.mark.parametrize(("say", "part"), LIES)
@pytest.mark.slow
def test_one_lie_spoils_nothing(say: Callable[..., None], part: str) -> None:
    for name in RUNNING:
        rig = copy.deepcopy(started(name))
        rig.feeds.clear()
        for number in NUMBERS:
            say(rig, **{part: number})
            for _ in range(4):
                rig.frame()
        rig.run(0.2)
        rig.check_mixes()


@pytest.mark.slow
@pytest.mark.parametrize("parameter", PARAMETERS)
def test_no_value_of_a_parameter_spoils_anything(parameter: str) -> None:
    for name in RUNNING:
        rig = copy.deepcopy(started(name))
        for value in NUMBERS:
            rig.set_param(f"EK3_{parameter}", value)
            for _ in range(4):
                rig.frame()
        rig.check_mixes()


# What may happen


class CoreMachine(RuleBasedStateMachine):
    """A vehicle with the filter, and a twin where there is one."""

    twins = 1
    kernel = PLAIN

    @initialize(name=st.sampled_from(sorted(STARTS)), loop_us=st.sampled_from([2500, 10_000, SLOW_LOOP_US]))
    def begin(self, name: str, loop_us: int) -> None:
        """Begin at one of the starts."""
        self.rigs = [copy.deepcopy(started(name, self.kernel)) for _ in range(self.twins)]
        for rig in self.rigs:
            rig.loop_us = loop_us

    def run_frames(self, frames: int, **fields: Any) -> None:
        """Let frames pass."""
        for rig in self.rigs:
            for _ in range(frames):
                rig.frame(**fields)

    @rule(seconds=st.floats(0.1, 1.0), accel=st.tuples(SMALL, SMALL, SMALL), yaw_rate=SMALL)
    def fly(self, seconds: float, accel: tuple[float, ...], yaw_rate: float) -> None:
        """Move in some way."""
        for rig in self.rigs:
            rig.accel_ned, rig.yaw_rate = np.array(accel), yaw_rate
            rig.run(seconds)

    @rule(seconds=st.floats(0.1, 1.0), feed=st.sampled_from(sorted(FEEDS)))
    def switch_feed(self, seconds: float, feed: str) -> None:
        """Let what a sensor says come no more, or again."""
        for rig in self.rigs:
            rig.feeds ^= {feed}
            rig.run(seconds)

    @rule(delta=DELTAS, frames=st.integers(1, 12))
    def shake(self, delta: InertialDelta, frames: int) -> None:
        """Let inertial data be anything for a while."""
        self.run_frames(frames, delta=delta)

    @rule(height=WIDE, age_ms=STAMP_AGES)
    def press(self, height: float, age_ms: int) -> None:
        """Let the barometer say anything."""
        for rig in self.rigs:
            rig.frame(baro=(u32(rig.now_ms - age_ms), height))
            rig.run(0.1)

    @rule(field=st.tuples(WIDE, WIDE, WIDE) | st.just((0.0, 0.0, 0.0)), age_us=st.sampled_from([0, 60_000_000]))
    def disturb(self, field: tuple[float, ...], age_us: int) -> None:
        """Let the compass say anything."""
        for rig in self.rigs:
            rig.frame(mag=(max(0, rig.now_us - age_us), np.array(field)))
            rig.run(0.1)

    @rule(fields=OTHER_FIELDS, frames=st.integers(1, 40))
    def mislead(self, fields: dict[str, Any], frames: int) -> None:
        """Let something be said that is not true for a while."""
        self.run_frames(frames, **fields)

    @rule(values=SOLUTIONS, age_ms=st.just(0) | STAMP_AGES)
    def find_place(self, values: dict[str, Any], age_ms: int) -> None:
        """Let the GPS find any solution."""
        for rig in self.rigs:
            rig.gps = GpsSample(time_ms=u32(rig.now_ms - age_ms), **values)
            rig.run(0.3)

    @rule(
        pos=VECTORS,
        quat=QUATERNIONS,
        errors=st.tuples(ERRORS, ERRORS),
        age_ms=STAMP_AGES,
        delay_ms=DELAYS,
        reset_ms=st.integers(0, 2),
        seconds=SHORTLY,
    )
    def send_pose(self, pos: Vector3f, quat: Quaternion, age_ms: int, seconds: float, **values: Any) -> None:
        """Send any pose."""
        for rig in self.rigs:
            rig.give_pose(pos, quat, stamp_ms=u32(rig.now_ms - age_ms), **values)
            rig.run(seconds)

    @rule(vel=VECTORS, err=ERRORS, age_ms=STAMP_AGES, delay_ms=DELAYS, seconds=SHORTLY)
    def send_velocity(self, vel: Vector3f, err: float, age_ms: int, delay_ms: int, seconds: float) -> None:
        """Send any velocity."""
        for rig in self.rigs:
            rig.give_velocity(vel, err, u32(rig.now_ms - age_ms), delay_ms)
            rig.run(seconds)

    @rule(
        quality=st.sampled_from([100.0, 0.0, -1.0]) | FLOATS,
        deltas=st.tuples(VECTORS, VECTORS, st.floats(0.015625, 1, width=32) | FLOATS),
        age_ms=STAMP_AGES,
        delay_ms=DELAYS,
        pos_offset=VECTORS,
        seconds=SHORTLY,
    )
    def send_odometry(self, quality: float, deltas: Any, age_ms: int, seconds: float, **values: Any) -> None:
        """Send any odometry."""
        for rig in self.rigs:
            rig.give_odometry(quality, deltas, u32(rig.now_ms - age_ms), **values)
            rig.run(seconds)

    @rule(name=st.sampled_from(PARAMETERS), value=FLOATS, frames=st.integers(0, 40))
    def set_parameter(self, name: str, value: float, frames: int) -> None:
        """Set a parameter, within its range or not."""
        for rig in self.rigs:
            rig.set_param(f"EK3_{name}", value)
        self.run_frames(frames)

    @rule(number=st.integers(1, 3), row=st.sampled_from(ROWS), value=st.sampled_from([0, 1, 2, 3, 6, 6, 8, 99, -1]))
    def set_source(self, number: int, row: str, value: int) -> None:
        """Change what a source set names."""
        for rig in self.rigs:
            rig.set_param(f"EK3_SRC{number}_{row}", float(value))
            rig.run(0.2)

    @rule(index=st.integers(0, 2))
    def choose_sources(self, index: int) -> None:
        """Choose another source set."""
        for rig in self.rigs:
            rig.sources.active_set = index
            rig.run(0.2)

    @rule(armed=st.booleans(), near_ground=st.booleans(), has_compass=st.booleans())
    def change_vehicle(self, armed: bool, near_ground: bool, has_compass: bool) -> None:
        """Arm or disarm, expect take-off or not, gain or lose the compass."""
        for rig in self.rigs:
            rig.armed, rig.near_ground, rig.has_compass = armed, near_ground, has_compass
            rig.run(0.2)

    @rule(place=PLACES)
    def set_origin(self, place: Location) -> None:
        """Set the origin, or try to."""
        for rig in self.rigs:
            rig.core.set_origin(place)
            rig.frame()

    @rule(place=PLACES, accuracy=FLOATS, age_ms=STAMP_AGES)
    def set_place(self, place: Location, accuracy: float, age_ms: int) -> None:
        """Tell the filter where it is."""
        for rig in self.rigs:
            if rig.core.initialised:
                rig.core.set_place(place, float(f32(accuracy)), u32(rig.now_ms - age_ms))
            rig.frame()

    @rule()
    def reset_height_datum(self) -> None:
        """Let heights count from here."""
        for rig in self.rigs:
            rig.core.reset_height_datum()
            rig.frame()

    @rule(loop_us=st.sampled_from([500, 2500, 10_000, SLOW_LOOP_US, 200_000]))
    def change_rate(self, loop_us: int) -> None:
        """Let frames come at another rate."""
        for rig in self.rigs:
            rig.loop_us = loop_us

    @rule(seconds=TIMES_S | st.just(None))
    def skip_time(self, seconds: float | None) -> None:
        """Let time pass without frames, perhaps until the milliseconds of 32 bits wrap."""
        for rig in self.rigs:
            to_wrap_us = WRAP_US - rig.now_us % WRAP_US - 200_000
            rig.now_us += max(0, to_wrap_us) if seconds is None else round(1e6 * seconds)
            rig.run(0.5)

    # What must hold, beside what does after each frame

    @invariant()
    def twins_agree(self) -> None:
        """The same input gives the same output."""
        if len(self.rigs) > 1:
            assert len({rig.fingerprint() for rig in self.rigs}) == 1

    @invariant()
    def covariance_is_positive(self) -> None:
        """No mix of errors has a negative variance."""
        self.rigs[0].check_mixes()


class TwinMachine(CoreMachine):
    """Two vehicles to which the same happens."""

    twins = 2


class CompiledMachine(CoreMachine):
    """A vehicle whose filter is compiled."""

    kernel = COMPILED


def steps(examples: int) -> settings:
    """Return settings under which every run draws the same examples."""
    return settings(
        max_examples=examples,
        stateful_step_count=25,
        deadline=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )


@pytest.mark.slow
def test_whatever_comes_the_filter_keeps_its_head() -> None:
    run_state_machine_as_test(CoreMachine, settings=steps(40))


@pytest.mark.slow
def test_whatever_comes_the_compiled_filter_keeps_its_head() -> None:
    run_state_machine_as_test(CompiledMachine, settings=steps(40))


def test_compass_that_comes_is_used_from_that_frame_on() -> None:
    rig = boot("66661", "pose")
    rig.loop_us = 2500
    rig.run(1.5)
    for _ in range(5):
        assert not rig.core.yaw.uses_compass
        with_compass = copy.deepcopy(rig)
        with_compass.has_compass = True
        with_compass.frame()
        assert with_compass.core.yaw.uses_compass
        rig.frame()


@pytest.mark.slow
def test_same_input_gives_the_same_output() -> None:
    run_state_machine_as_test(TwinMachine, settings=steps(12))
