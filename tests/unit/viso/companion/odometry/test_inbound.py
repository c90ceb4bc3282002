# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes in from the flight controller."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mav_handlers.wire.messages import (
    ATTITUDE,
    ATTITUDE_QUATERNION,
    DISTANCE_SENSOR,
    HEARTBEAT,
    HIGHRES_IMU,
    RAW_IMU,
    SCALED_IMU,
    TIMESYNC,
    Message,
)
from viso.companion.odometry.clock_sync import ClockSync
from viso.companion.odometry.inbound import FcInbound, stream_requests
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.types import ImuSample

MS = 1_000_000
NOW_NS = 10**12
FC_NS = 5 * 10**9
"""The autopilot's time when it is ``NOW_NS`` on the companion."""

RAW = RAW_IMU(FC_NS // 1000, 100, 200, -1000, 10, 20, 30, 0, 0, 0)
SCALED = SCALED_IMU(FC_NS // MS, 100, 200, -1000, 10, 20, 30, 0, 0, 0)
HIGHRES = HIGHRES_IMU(FC_NS // 1000, 1.0, 2.0, -9.8, 0.1, 0.2, 0.3, 0, 0, 0, 0, 0, 0, 0, 0xFFFF)
NORTHWARDS = ATTITUDE(FC_NS // MS, 0.0, 0.1, 0.0, 0, 0, 0)
RANGE = DISTANCE_SENSOR(FC_NS // MS, 20, 4000, 1500, 0, 0, 25, 0)


class Rig:
    """An inbound side whose samples are kept, its clock in step unless said otherwise."""

    def __init__(self, synced: bool = True) -> None:
        self.clock = ClockSync()
        self.samples: list[ImuSample] = []
        self.heights: list[tuple[int, float]] = []
        self.inbound = FcInbound(self.clock, self.samples.append, lambda *height: self.heights.append(height))
        if synced:
            self.clock.take(TIMESYNC(FC_NS, self.clock.request(NOW_NS).ts1), NOW_NS)

    def take(self, message: Message, arrival_ns: int = NOW_NS + MS) -> None:
        self.inbound.take(message, arrival_ns)

    @property
    def counters(self) -> dict[str, int]:
        return dict(self.inbound.counters)


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_whole_numbers_are_milli_g_and_milliradians_in_frd(rig: Rig) -> None:
    rig.take(RAW)
    (sample,) = rig.samples
    assert sample.accel == pytest.approx(np.array([0.1, -0.2, 1.0]) * GRAVITY_MSS)
    assert sample.gyro == pytest.approx([0.010, -0.020, -0.030])


def test_high_resolution_is_in_si_units_in_frd(rig: Rig) -> None:
    rig.take(HIGHRES)
    (sample,) = rig.samples
    assert sample.accel == pytest.approx([1.0, -2.0, 9.8])
    assert sample.gyro == pytest.approx([0.1, -0.2, -0.3])


def test_scaled_imu_is_as_raw_imu(rig: Rig) -> None:
    rig.take(SCALED)
    other = Rig()
    other.take(RAW)
    assert rig.samples[0].accel == pytest.approx(other.samples[0].accel)
    assert rig.samples[0].gyro == pytest.approx(other.samples[0].gyro)


@pytest.mark.parametrize("message", [RAW, SCALED, HIGHRES])
def test_stamps_are_turned_into_the_companions_time(rig: Rig, message: Message) -> None:
    rig.take(message, NOW_NS + 7 * MS)
    assert [sample.t_ns for sample in rig.samples] == [NOW_NS]


def test_without_an_offset_half_the_mean_period_is_taken_off_the_arrival() -> None:
    rig = Rig(synced=False)
    arrivals = [NOW_NS + ms * MS for ms in (0, 4, 12, 15, 20)]
    for number, arrival_ns in enumerate(arrivals):
        rig.take(replace(RAW, time_usec=number), arrival_ns)
    assert [sample.t_ns - NOW_NS for sample in rig.samples] == [
        0,
        4 * MS - 2 * MS,
        12 * MS - 3 * MS,
        15 * MS - 5 * MS // 2,
        20 * MS - 5 * MS // 2,
    ]


@pytest.mark.parametrize(("better", "worse"), [(HIGHRES, RAW), (HIGHRES, SCALED), (RAW, SCALED)])
def test_best_message_that_arrives_is_used(rig: Rig, better: Message, worse: Message) -> None:
    rig.take(better)
    rig.take(_later(worse, 10), NOW_NS + 11 * MS)
    assert len(rig.samples) == 1
    assert rig.counters == {type(better).__name__: 1, f"{type(worse).__name__}_refused_better_source": 1}


def _later(message: Message, ms: int) -> Message:
    if isinstance(message, (RAW_IMU, HIGHRES_IMU)):
        return replace(message, time_usec=message.time_usec + ms * 1000)
    assert isinstance(message, (SCALED_IMU, ATTITUDE, DISTANCE_SENSOR))
    return replace(message, time_boot_ms=message.time_boot_ms + ms)


def test_better_message_takes_over(rig: Rig) -> None:
    rig.take(SCALED)
    rig.take(_later(HIGHRES, 10), NOW_NS + 11 * MS)
    assert [sample.t_ns for sample in rig.samples] == [NOW_NS, NOW_NS + 10 * MS]


@pytest.mark.parametrize(("ms", "taken"), [(500, 1), (501, 2)])
def test_lesser_message_serves_when_the_better_one_stops_for_half_a_second(rig: Rig, ms: int, taken: int) -> None:
    rig.take(HIGHRES, NOW_NS)
    rig.take(_later(SCALED, ms), NOW_NS + ms * MS)
    assert len(rig.samples) == taken


def test_better_message_of_no_use_does_not_keep_out_the_lesser(rig: Rig) -> None:
    rig.take(replace(HIGHRES, time_usec=1))
    rig.take(RAW)
    assert len(rig.samples) == 1


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (replace(HIGHRES, xacc=math.nan), "not_finite"),
        (replace(HIGHRES, zgyro=math.inf), "not_finite"),
        (replace(HIGHRES, yacc=1e30), "out_of_range"),
        (replace(HIGHRES, ygyro=-200.0), "out_of_range"),
        (replace(HIGHRES, fields_updated=0x1F), "not_updated"),
        (replace(HIGHRES, id=1), "other_imu"),
        (replace(RAW, id=2), "other_imu"),
        (replace(RAW, time_usec=RAW.time_usec - 2_000_000), "too_old"),
        (replace(RAW, time_usec=RAW.time_usec + 2_000_000), "in_the_future"),
        (replace(NORTHWARDS, yaw=math.nan), "not_finite"),
        (ATTITUDE(FC_NS // MS, 0, 0, 0, 0, 0, 0), "no_attitude"),
        (ATTITUDE_QUATERNION(FC_NS // MS, 0, 0, 0, 0, 0, 0, 0), "no_rotation"),
        (ATTITUDE_QUATERNION(FC_NS // MS, math.nan, 0, 0, 0, 0, 0, 0), "no_rotation"),
        (replace(RANGE, orientation=0), "not_downwards"),
        (replace(RANGE, current_distance=4001), "out_of_range"),
        (replace(RANGE, current_distance=19), "out_of_range"),
        (replace(RANGE, min_distance=0, current_distance=0), "out_of_range"),
        (replace(RANGE, signal_quality=1), "out_of_range"),
        (RANGE, "no_attitude"),
    ],
)
def test_what_is_of_no_use_is_counted_with_its_reason(rig: Rig, message: Message, reason: str) -> None:
    rig.take(message)
    assert rig.counters == {f"{type(message).__name__}_refused_{reason}": 1}
    assert (rig.samples, rig.heights) == ([], [])
    assert rig.inbound.attitude_at(NOW_NS) is None


@pytest.mark.parametrize("back_us", [0, 1, 5000])
def test_time_does_not_go_backwards(rig: Rig, back_us: int) -> None:
    rig.take(RAW)
    rig.take(replace(RAW, time_usec=RAW.time_usec - back_us))
    assert len(rig.samples) == 1
    assert rig.counters["RAW_IMU_refused_not_later"] == 1


def test_messages_of_no_interest_are_left_alone(rig: Rig) -> None:
    rig.take(HEARTBEAT(2, 3, 0, 0, 4, 3))
    assert rig.counters == {}


@pytest.mark.parametrize(("ms", "silent"), [(500, False), (501, True)])
def test_imu_is_silent_half_a_second_after_its_last_message(rig: Rig, ms: int, silent: bool) -> None:
    assert rig.inbound.imu_silent(NOW_NS)
    rig.take(RAW, NOW_NS)
    assert rig.inbound.imu_silent(NOW_NS + ms * MS) is silent


@pytest.mark.parametrize(("heading_rad", "yaw_rad"), [(1e-9, math.pi / 2), (math.pi / 2, 0.0), (math.pi, -math.pi / 2)])
def test_heading_becomes_the_yaw_from_east(rig: Rig, heading_rad: float, yaw_rad: float) -> None:
    rig.take(replace(NORTHWARDS, pitch=0.0, yaw=heading_rad))
    assert rig.inbound.yaw_at(NOW_NS) == pytest.approx(yaw_rad, abs=1e-8)


def test_nose_up_and_right_wing_down_are_so_in_enu(rig: Rig) -> None:
    rig.take(ATTITUDE(FC_NS // MS, 0.3, 0.2, 1.0, 0, 0, 0))
    attitude = rig.inbound.attitude_at(NOW_NS)
    assert attitude is not None
    nose, left = attitude.R[:, 0], attitude.R[:, 1]
    assert nose == pytest.approx([math.sin(1.0) * math.cos(0.2), math.cos(1.0) * math.cos(0.2), math.sin(0.2)])
    assert left[2] == pytest.approx(math.sin(0.3) * math.cos(0.2))


def test_quaternion_gives_the_same_attitude_as_the_angles(rig: Rig) -> None:
    rig.take(ATTITUDE(FC_NS // MS, 0.0, 0.0, 0.8, 0, 0, 0))
    other = Rig()
    other.take(ATTITUDE_QUATERNION(FC_NS // MS, math.cos(0.4), 0, 0, math.sin(0.4), 0, 0, 0))
    found, expected = other.inbound.attitude_at(NOW_NS), rig.inbound.attitude_at(NOW_NS)
    assert found is not None
    assert expected is not None
    np.testing.assert_allclose(found.R, expected.R, atol=1e-12)


def test_attitude_is_the_nearest_within_a_fifth_of_a_second(rig: Rig) -> None:
    for ms in (0, 100):
        rig.take(replace(NORTHWARDS, time_boot_ms=FC_NS // MS + ms, yaw=0.001 * ms), NOW_NS + ms * MS)
    yaws = [rig.inbound.yaw_at(NOW_NS + ms * MS) for ms in (-201, -200, 49, 51, 300, 301)]
    assert yaws == [
        None,
        pytest.approx(math.pi / 2),
        pytest.approx(math.pi / 2),
        pytest.approx(math.pi / 2 - 0.1),
        pytest.approx(math.pi / 2 - 0.1),
        None,
    ]


def test_height_is_the_distance_without_the_lean(rig: Rig) -> None:
    rig.take(replace(NORTHWARDS, roll=0.3, pitch=0.2))
    rig.take(RANGE)
    ((t_ns, agl_m),) = rig.heights
    assert t_ns == NOW_NS
    assert agl_m == pytest.approx(15.0 * math.cos(0.3) * math.cos(0.2))


def test_distance_of_a_body_on_its_side_is_no_height(rig: Rig) -> None:
    rig.take(replace(NORTHWARDS, roll=1.2))
    rig.take(RANGE)
    assert rig.counters["DISTANCE_SENSOR_refused_leaning"] == 1


def test_stream_requests_name_messages_and_intervals() -> None:
    requests = stream_requests({"HIGHRES_IMU": 200, "ATTITUDE": 10}, target_system=3)
    assert [(r.target_system, r.command, r.param1, r.param2) for r in requests] == [
        (3, 511, 105, 5000),
        (3, 511, 30, 100_000),
    ]


def test_unknown_stream_is_an_error() -> None:
    with pytest.raises(KeyError):
        stream_requests({"NO_SUCH_MESSAGE": 1})


def test_rebooted_autopilot_is_heard_again_after_the_next_clock_answer(rig: Rig) -> None:
    rig.take(RAW)
    later_ns, boot_ns = NOW_NS + 20_000 * MS, 2 * 10**9
    rebooted = replace(RAW, time_usec=boot_ns // 1000)
    rig.take(rebooted, later_ns)
    assert rig.counters["RAW_IMU_refused_too_old"] == 1
    rig.clock.take(TIMESYNC(boot_ns, rig.clock.request(later_ns).ts1), later_ns)
    rig.take(rebooted, later_ns)
    assert rig.samples[-1].t_ns == later_ns
