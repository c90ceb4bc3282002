# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that follows poses: its sensors, integrated as a navigator would, must show the stream's movement."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
import quaternion
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.cint import u32
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.core.inertial import GRAVITY_MSS
from ekf_stub.core.vectors import euler_of, quat_of_euler
from ekf_stub.inputs.measurements import Array, InertialDelta
from ekf_stub.inputs.sensors import Sensors
from tests.unit.viso.vehicle.sensors.conftest import LEVEL, LOOP_US, Three, Wxyz, yawed
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.source import ImuOptions, ideal_field
from viso.vehicle.sensors.stream.follow import ACCELERATION_DELAY_S, REST_UNTIL_US, FollowSource

AGE_MS = 50
POSE_US = 33_333
REST_S = 1e-6 * REST_UNTIL_US
BEGIN_S = 8.0
"""When the streams of these tests begin to move."""

ORIGIN: Three = (0.0, 0.0, 0.0)

Path = Callable[[float], Three]
Turn = Callable[[float], Wxyz]


def level(_t: float) -> Wxyz:
    return LEVEL


def still(_t: float) -> Three:
    return ORIGIN


def walk_north(speed: float) -> Path:
    return lambda t: (speed * max(0.0, t - BEGIN_S), 0.0, 0.0)


def circle(t: float) -> Three:
    """Walk along a circle of 3 m at 1.7 m/s, 1 m/s^2 to its middle, up and down by half a metre; from rest."""
    since = max(0.0, t - BEGIN_S)
    phase = 0.577 * (since - 2.0 * (1.0 - math.exp(-0.5 * since)))
    return 3.0 * math.cos(phase) - 3.0, 3.0 * math.sin(phase), 0.5 * math.cos(0.7 * phase) - 0.5


@dataclass
class Rig:
    """A source, poses for it, and a navigator that knows nothing but its inertial data."""

    options: ImuOptions = field(default_factory=ImuOptions)
    pose_us: int = POSE_US
    age_ms: int = AGE_MS

    def __post_init__(self) -> None:
        self.source = FollowSource(self.options)
        self.now_us = 0
        self.vel: Array = np.zeros(3)
        self.pos: Array = np.zeros(3)
        self.quat = quaternion.from_rotation_vector(np.array([0.0, 0.0, self.options.heading_rad]))
        self.deltas: list[InertialDelta] = []
        self.sensors: list[Sensors] = []
        self._next_pose_us = 0

    @property
    def time_s(self) -> float:
        return 1e-6 * self.now_us

    def run(self, until_s: float, path: Path | None = still, turn: Turn = level) -> None:
        """Run up to a time, with a stream or, for a path of None, without."""
        while self.now_us < round(1e6 * until_s):
            self.now_us += LOOP_US
            sensors = self.source.sense(self.now_us)
            assert sensors is not None
            self._navigate(sensors.delta)
            self.sensors.append(sensors)
            if path is not None and self.now_us >= self._next_pose_us:
                self._next_pose_us = self.now_us + self.pose_us
                observed_ms = self.now_us // 1000 - self.age_ms
                self.tell(path(1e-3 * observed_ms), turn(1e-3 * observed_ms))

    def tell(self, pos: Three, quat: Wxyz = LEVEL, *, observed_ms: int | None = None, is_reset: bool = False) -> None:
        """Hand in a pose."""
        observed_ms = self.now_us // 1000 - self.age_ms if observed_ms is None else observed_ms
        self.source.take_pose(Vector3f(*pos), Quaternion(*quat), observed_ms, is_reset=is_reset)

    def _navigate(self, delta: InertialDelta) -> None:
        self.deltas.append(delta)
        halfway = self.quat * quaternion.from_rotation_vector(0.5 * delta.del_ang)
        gravity = np.array([0.0, 0.0, GRAVITY_MSS * delta.del_vel_dt])
        vel = self.vel + quaternion.as_rotation_matrix(halfway) @ delta.del_vel + gravity
        self.pos = self.pos + 0.5 * delta.del_vel_dt * (self.vel + vel)
        self.vel = vel
        self.quat = (self.quat * quaternion.from_rotation_vector(delta.del_ang)).normalized()

    def accels(self) -> Array:
        """Return the specific forces so far, shape (n, 3)."""
        return np.array([delta.del_vel / delta.del_vel_dt for delta in self.deltas])

    def rates(self) -> Array:
        """Return the body rates so far, shape (n, 3)."""
        return np.array([delta.del_ang / delta.del_ang_dt for delta in self.deltas])


def assert_at_rest(rig: Rig) -> None:
    assert np.abs(rig.accels() - (0.0, 0.0, -GRAVITY_MSS)).max() < 1e-5
    assert np.abs(rig.rates()).max() < 1e-9


class TestRest:
    """Before there is anything to follow."""

    @pytest.mark.slow
    def test_it_stands_level_with_its_heading(self) -> None:
        rig = Rig(ImuOptions(heading_rad=1.0))
        rig.run(10.0, path=None)
        assert_at_rest(rig)
        assert rig.source.yaw_rad() == pytest.approx(1.0)

    def test_poses_of_the_first_seconds_do_not_move_it(self) -> None:
        rig = Rig()
        rig.run(REST_S, path=lambda t: (math.sin(3 * t), t, -t))
        assert_at_rest(rig)
        assert set(rig.source.ignored) == {"at_rest_after_boot"}

    @pytest.mark.slow
    def test_it_stays_where_the_stream_begins(self) -> None:
        rig = Rig()
        rig.run(12.0, path=lambda _t: (100.0, -50.0, -5.0))
        assert_at_rest(rig)
        newest = rig.sensors[-1].baro
        assert newest is not None
        assert newest[1] == 0.0


class TestMovement:
    """What the inertial data add up to."""

    @pytest.mark.slow
    def test_it_goes_where_the_stream_goes(self) -> None:
        rig = Rig()
        rig.run(BEGIN_S + 4.0, circle)
        worst = 0.0
        while rig.time_s < 20.0:
            rig.run(rig.time_s + 0.1, circle)
            worst = max(worst, float(np.abs(rig.pos - circle(rig.time_s)).max()))
        assert worst < 0.05

    @pytest.mark.slow
    def test_noise_of_the_camera_is_smoothed(self) -> None:
        rng = np.random.default_rng(1)
        rig = Rig()

        def shaking(t: float) -> Three:
            x, y, z = np.add(circle(t), 0.01 * rng.standard_normal(3))
            return x, y, z

        rig.run(30.0, shaking)
        assert float(np.abs(rig.pos - circle(rig.time_s)).max()) < 0.1
        assert np.abs(np.diff(rig.accels()[3200:], axis=0)).max() / 0.0025 < 100.0

    @pytest.mark.slow
    def test_steady_speed_has_no_lag(self) -> None:
        rig = Rig()
        rig.run(20.0, walk_north(2.0))
        assert rig.pos[0] == pytest.approx(walk_north(2.0)(20.0)[0], abs=0.01)
        assert rig.vel[0] == pytest.approx(2.0, abs=0.02)

    @pytest.mark.slow
    def test_steady_acceleration_has_no_lag(self) -> None:
        rig = Rig()
        rig.run(13.0, lambda t: (0.5 * max(0.0, t - BEGIN_S) ** 2, 0.0, 0.0))
        assert rig.pos[0] == pytest.approx(12.5, abs=0.02)
        assert rig.vel[0] == pytest.approx(5.0, abs=0.02)

    @pytest.mark.slow
    def test_half_of_a_step_of_acceleration_is_followed_after_the_delay_that_it_states(self) -> None:
        rig = Rig()
        rig.run(13.0, lambda t: (0.5 * max(0.0, t - BEGIN_S) ** 2, 0.0, 0.0))
        half_way = int(np.argmax(rig.accels()[:, 0] > 0.5)) * 1e-6 * LOOP_US
        assert half_way == pytest.approx(BEGIN_S + ACCELERATION_DELAY_S, abs=0.03)

    @pytest.mark.slow
    def test_turning_steadily_has_no_lag(self) -> None:
        rig = Rig()
        rate_deg_s = 60.0
        rig.run(15.0, turn=lambda t: yawed(rate_deg_s * max(0.0, t - BEGIN_S)))
        assert math.degrees(euler_of(tuple(rig.quat.components.tolist()))[2]) == pytest.approx(
            60.0 * 7.0 - 360.0, abs=0.5
        )

    @pytest.mark.slow
    def test_it_takes_the_tilt_of_the_stream(self) -> None:
        tilt = quaternion.from_rotation_vector(np.radians([10.0, -5.0, 0.0]))
        rig = Rig()
        rig.run(12.0, turn=lambda t: LEVEL if t < BEGIN_S else (tilt.w, tilt.x, tilt.y, tilt.z))
        assert rig.quat.w * tilt.w + rig.quat.x * tilt.x + rig.quat.y * tilt.y == pytest.approx(1.0, abs=1e-5)

    @pytest.mark.slow
    @pytest.mark.parametrize("pose_us", [10_000, 50_000, 100_000, 200_000])
    def test_it_follows_at_any_usual_rate(self, pose_us: int) -> None:
        rig = Rig(pose_us=pose_us)
        rig.run(30.0, circle)
        assert np.abs(rig.pos - circle(30.0)).max() < 0.15
        assert not rig.source.jumps

    @pytest.mark.slow
    def test_acceleration_and_rates_are_continuous_whatever_the_stream_does(self) -> None:
        rng = np.random.default_rng(2)
        rig = Rig()
        rig.run(20.0, lambda _t: tuple(3.0 * rng.standard_normal(3)), lambda _t: yawed(360.0 * rng.random()))
        upright = np.array([0.0, 0.0, -GRAVITY_MSS])
        turned = np.abs(np.diff(rig.rates(), axis=0)).max() / 0.0025
        felt = np.abs(np.diff(rig.accels() - upright, axis=0)).max() / 0.0025
        assert turned < 61.0
        assert felt < 160.0 * math.sqrt(3.0) + 61.0 * GRAVITY_MSS


class TestJump:
    """What no vehicle can do."""

    @pytest.mark.slow
    @pytest.mark.parametrize(
        "way",
        [(0.7, 0.0, 0.0), *(pytest.param(way, marks=pytest.mark.slow) for way in ((0.0, -30.0, 0.0), (0.0, 0.0, 4.0)))],
    )
    def test_jump_of_position_is_not_followed(self, way: Three) -> None:
        rig = Rig()
        rig.run(13.0, lambda t: ORIGIN if t < 8.0 else way)
        assert_at_rest(rig)
        assert rig.source.jumps == {"position": 1}

    @pytest.mark.slow
    @pytest.mark.parametrize("degrees", [-10.0, *(pytest.param(way, marks=pytest.mark.slow) for way in (-170.0, 90.0))])
    def test_jump_of_yaw_is_not_followed(self, degrees: float) -> None:
        rig = Rig()
        rig.run(13.0, turn=lambda t: yawed(0.0 if t < 8.0 else degrees))
        assert np.abs(rig.rates()).max() < 1e-6
        assert rig.source.jumps == {"yaw": 1}

    @pytest.mark.slow
    def test_any_change_with_a_reset_is_a_jump(self) -> None:
        rig = Rig()
        rig.run(8.0)
        rig.tell((0.1, 0.0, 0.0), yawed(2.0), observed_ms=rig.now_us // 1000, is_reset=True)
        rig.run(13.0, lambda _t: (0.1, 0.0, 0.0), lambda _t: yawed(2.0))
        assert np.abs(rig.rates()).max() < 1e-5
        assert np.abs(rig.pos).max() < 1e-3
        assert rig.source.jumps["reset"] == 1

    @pytest.mark.slow
    def test_movement_goes_on_through_a_jump(self) -> None:
        rig = Rig()
        rig.run(20.0, lambda t: (walk_north(1.0)(t)[0] + (5.0 if t > 12.0 else 0.0), 0.0, 0.0))
        assert rig.pos[0] == pytest.approx(12.0, abs=0.05)

    @pytest.mark.slow
    def test_after_a_jump_of_yaw_the_way_is_turned_with_the_frame(self) -> None:
        # What the camera calls east from then on is the vehicle's north.
        rig = Rig()
        rig.run(8.0)
        rig.run(14.0, lambda t: (0.0, max(0.0, t - 10.0), 0.0), lambda _t: yawed(90.0))
        assert rig.pos == pytest.approx([4.0, 0.0, 0.0], abs=0.02)

    @pytest.mark.slow
    def test_single_outlier_leaves_no_trace(self) -> None:
        rig = Rig()
        rig.run(8.0)
        rig.tell((3.0, 0.0, 0.0))
        rig.run(13.0)
        assert_at_rest(rig)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("speed", "pose_us"),
        [
            (18.0, 33_333),
            *(pytest.param(speed, 33_333, marks=pytest.mark.slow) for speed in (4.0, 10.0)),
            *(pytest.param(speed, 100_000, marks=pytest.mark.slow) for speed in (4.0, 10.0, 18.0)),
        ],
    )
    def test_movement_that_begins_suddenly_is_followed(self, speed: float, pose_us: int) -> None:
        rig = Rig(pose_us=pose_us)
        rig.run(20.0, walk_north(speed))
        assert rig.vel[0] == pytest.approx(speed, rel=0.02)

    @pytest.mark.slow
    def test_movement_that_is_too_fast_is_not_followed(self) -> None:
        rig = Rig()
        rig.run(12.0, walk_north(100.0))
        assert np.abs(rig.vel).max() < 0.05

    @pytest.mark.slow
    def test_agile_turning_is_no_jump(self) -> None:
        rig = Rig()
        rig.run(14.0, turn=lambda t: yawed(40.0 * math.sin(4.0 * max(0.0, t - BEGIN_S))))
        assert not rig.source.jumps


class TestGap:
    """A stream that stops, and comes again."""

    @pytest.mark.slow
    def test_it_brakes_to_rest_and_levels(self) -> None:
        tilted = quaternion.from_rotation_vector(np.radians([0.0, -10.0, 0.0]))
        rig = Rig()
        rig.run(12.0, walk_north(3.0), lambda _t: (tilted.w, tilted.x, tilted.y, tilted.z))
        assert rig.vel[0] == pytest.approx(3.0, abs=0.05)
        rig.run(13.6, path=None)
        assert np.abs(rig.vel).max() < 0.05
        rig.run(14.0, path=None)
        begun = len(rig.deltas)
        rig.run(20.0, path=None)
        assert np.abs(rig.accels()[begun:] - (0.0, 0.0, -GRAVITY_MSS)).max() < 0.01
        assert np.abs(rig.rates()[begun:]).max() < 0.001

    @pytest.mark.slow
    def test_it_catches_up_smoothly_with_what_is_near(self) -> None:
        rig = Rig()
        rig.run(10.0)
        rig.run(15.0, path=None)
        fastest = 0.0
        while rig.time_s < 20.0:
            rig.run(rig.time_s + 0.1, lambda _t: (1.0, 0.0, 0.0), lambda _t: yawed(20.0))
            fastest = max(fastest, float(np.linalg.norm(rig.vel)))
        assert rig.pos == pytest.approx([1.0, 0.0, 0.0], abs=0.01)
        assert math.degrees(euler_of(tuple(rig.quat.components.tolist()))[2]) == pytest.approx(20.0, abs=0.1)
        assert fastest < 2.5

    @pytest.mark.slow
    def test_it_stays_where_it_is_when_the_stream_comes_again_far_away(self) -> None:
        rig = Rig()
        rig.run(8.0)
        rig.run(13.0, path=None)
        rig.run(16.0, lambda _t: (3.0, 0.0, 0.0))
        assert_at_rest(rig)


class TestYaw:
    """Whose heading is the truth."""

    @pytest.mark.slow
    def test_with_a_compass_the_vehicle_keeps_its_heading_and_the_way_is_turned(self) -> None:
        rig = Rig(ImuOptions(heading_rad=0.0, has_compass=lambda: True))
        rig.run(14.0, walk_north(1.0), lambda _t: yawed(90.0))
        assert rig.source.yaw_rad() == pytest.approx(0.0, abs=1e-6)
        assert rig.pos == pytest.approx([0.0, -6.0, 0.0], abs=0.02)

    def test_without_one_it_takes_that_of_the_stream(self) -> None:
        rig = Rig(ImuOptions(heading_rad=0.0))
        rig.run(7.0, turn=lambda _t: yawed(90.0))
        assert math.degrees(rig.source.yaw_rad()) == pytest.approx(90.0)
        assert_at_rest(rig)

    @pytest.mark.slow
    def test_without_one_a_stream_with_another_yaw_makes_the_same_movement_of_the_body(self) -> None:
        def turned(t: float) -> Three:
            north, east, down = circle(t)
            return -east, north, down

        plain, other = Rig(), Rig()
        plain.run(15.0, circle)
        other.run(15.0, turned, lambda _t: yawed(90.0))
        assert other.accels() == pytest.approx(plain.accels(), abs=1e-3)


class TestReadings:
    """Barometer and compass."""

    @pytest.mark.slow
    def test_barometer_shows_the_height_ten_times_a_second(self) -> None:
        rig = Rig()
        rig.run(20.0, lambda t: (0.0, 0.0, -max(0.0, t - BEGIN_S)))
        readings = {sensors.baro for sensors in rig.sensors if sensors.baro is not None}
        assert len(readings) == 200
        assert max(readings)[1] == pytest.approx(12.0, abs=0.1)
        assert all(float(np.float32(height)) == height for _, height in readings)

    @pytest.mark.slow
    def test_compass_shows_the_true_heading(self) -> None:
        rig = Rig(ImuOptions(heading_rad=math.radians(30.0), has_compass=lambda: True))
        rig.run(12.0, turn=lambda t: yawed(0.0 if t < BEGIN_S else min(60.0, 30.0 * (t - BEGIN_S))))
        mag = rig.sensors[-1].mag
        assert mag is not None
        assert mag[1] == pytest.approx(ideal_field(None, quat_of_euler(0.0, 0.0, math.radians(90.0))), abs=1.0)

    def test_there_is_none_without_a_compass(self) -> None:
        rig = Rig()
        rig.run(7.0)
        assert {sensors.mag is None for sensors in rig.sensors} == {True}

    @pytest.mark.slow
    def test_inertial_data_are_exact_in_single_precision(self) -> None:
        rig = Rig()
        rig.run(10.0, circle)
        values = np.array([(*d.del_vel, *d.del_ang, d.del_vel_dt, d.del_ang_dt) for d in rig.deltas])
        assert np.array_equal(values, values.astype(np.float32))

    def test_sensors_err_as_they_are_told_to(self) -> None:
        rig = Rig(ImuOptions(errors=SensorErrors(gyro_bias_deg_s=(0.0, 0.0, 2.0), baro_bias_m=1.0)))
        rig.run(1.0, path=None)
        assert np.degrees(rig.rates()[:, 2]) == pytest.approx(2.0, rel=1e-5)
        assert rig.sensors[-1].baro == (950, 1.0)


class TestTime:
    """Clocks and stamps."""

    def test_time_that_has_been_gives_nothing(self) -> None:
        source = FollowSource(ImuOptions())
        assert source.sense(2500) is not None
        assert source.sense(2500) is None
        assert source.sense(0) is None

    @pytest.mark.slow
    def test_age_of_a_pose_is_made_up_for(self) -> None:
        rig = Rig(age_ms=250)
        rig.run(14.0, walk_north(2.0))
        assert rig.pos[0] == pytest.approx(12.0, abs=0.02)

    @pytest.mark.slow
    def test_stamps_that_repeat_or_step_back_are_ignored(self) -> None:
        rig = Rig()
        rig.run(10.0)
        for observed_ms in (9900, 9900, 9500):
            rig.tell((9.0, 9.0, 9.0), observed_ms=observed_ms)
        rig.run(12.0)
        assert_at_rest(rig)
        assert rig.source.ignored["not_newer"] == 3

    @pytest.mark.slow
    def test_stamps_from_the_future_count_as_new(self) -> None:
        rig = Rig(age_ms=-5000)
        rig.run(12.0, lambda t: walk_north(1.0)(t - 5.0))
        assert rig.pos[0] == pytest.approx(4.0, abs=0.02)

    @pytest.mark.slow
    def test_wrap_of_the_millisecond_clock_makes_no_difference(self) -> None:
        wrap_us = (1 << 32) * 1000
        start_us = wrap_us - 10_000_000
        source = FollowSource(ImuOptions())
        north = vel = 0.0
        for now_us in range(start_us, wrap_us + 10_000_000, LOOP_US):
            sensors = source.sense(now_us)
            assert sensors is not None
            vel += float(sensors.delta.del_vel[0])
            north += 1e-6 * LOOP_US * vel
            if (now_us - start_us) % 30_000 == 0:
                path = walk_north(1.0)(1e-6 * (now_us - start_us))
                source.take_pose(Vector3f(*path), Quaternion(), u32(now_us // 1000), is_reset=False)
        assert north == pytest.approx(12.0, abs=0.05)
        assert not source.ignored


ANY = st.floats(width=32)
POSES = st.lists(
    st.tuples(st.tuples(ANY, ANY, ANY), st.tuples(ANY, ANY, ANY, ANY), st.integers(-(1 << 40), 1 << 40), st.booleans()),
    max_size=30,
)


class TestNonsense:
    """Anything may come from outside."""

    @settings(max_examples=50)
    @given(poses=POSES, near=st.booleans())
    @pytest.mark.slow
    def test_nothing_that_comes_raises_or_makes_the_sensors_absurd(
        self, poses: list[tuple[Three, Wxyz, int, bool]], near: bool
    ) -> None:
        rig = Rig()
        rig.run(6.5)
        for pos, quat, observed_ms, is_reset in poses:
            unit = quat if near else LEVEL
            rig.tell(pos, unit, observed_ms=observed_ms if near else None, is_reset=is_reset)
            rig.run(rig.time_s + 0.05, path=None)
        assert np.abs(rig.accels()).max() < 60.0
        assert np.abs(rig.rates()).max() < 30.0

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("pos", "quat", "reason"),
        [
            ((math.nan, 0.0, 0.0), LEVEL, "absurd_position"),
            ((0.0, math.inf, 0.0), LEVEL, "absurd_position"),
            ((0.0, 0.0, 2e6), LEVEL, "absurd_position"),
            (ORIGIN, (math.nan, 0.0, 0.0, 0.0), "absurd_attitude"),
            (ORIGIN, (0.0, 0.0, 0.0, 0.0), "absurd_attitude"),
            (ORIGIN, (3.0, 0.0, 0.0, 0.0), "absurd_attitude"),
        ],
    )
    def test_what_cannot_be_used_is_counted_and_does_nothing(self, pos: Three, quat: Wxyz, reason: str) -> None:
        rig = Rig()
        rig.run(7.0)
        rig.source.ignored.clear()
        rig.tell(pos, quat)
        rig.run(9.0)
        assert rig.source.ignored == Counter({reason: 1})
        assert_at_rest(rig)

    @pytest.mark.slow
    def test_same_input_gives_the_same_output(self) -> None:
        first, second = Rig(), Rig()
        for rig in (first, second):
            rig.run(12.0, circle)
        assert np.array_equal(first.accels(), second.accels())
