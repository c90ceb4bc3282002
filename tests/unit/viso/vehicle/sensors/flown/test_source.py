# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A log's sensors say the same again, at the same times, and nothing before and after."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ap_core.dataflash import DataFlashWriter
from ap_core.log_field import LogValue
from ap_core.log_structure import ATT, COMMON_STRUCTURES
from ekf_stub.core.inertial import DownSampler, Inertial
from ekf_stub.inputs.measurements import InertialDelta, numbers_of
from ekf_stub.inputs.sensors import Sensors
from tests.places import RECORDED
from viso.errors import InputError
from viso.vehicle.sensors.errors import SensorErrors
from viso.vehicle.sensors.flown.source import RecordedSource, read_recorded_source
from viso.vehicle.sensors.source import ImuOptions

FIRMWARE_LOG = RECORDED / "logs" / "prearm.BIN.xz"
LOOP_US = 2500
DT = 0.0025

RECORDS = (
    ("RFRH", "TimeUS,TF", "QI"),
    ("RFRF", "FTypes,Slow", "BB"),
    ("RISI", "DVX,DVY,DVZ,DAX,DAY,DAZ,DVDT,DADT,Flags,I", "ffffffffBB"),
    ("RBRI", "LastUpdate,Alt,H,I", "IfBB"),
    ("RFRN", "HLat,HLon,HAlt,E2T,AM,TX,TY,TZ,VC,EKT,Flags", "IIIfIfffBBB"),
    ("RMGH", "Dec,Avail,NumInst,AutoDec,NumEna,LOE,C,FUsable", "fBBBBBBB"),
    ("RMGI", "LU,OX,OY,OZ,FX,FY,FZ,UFY,H,HSF,I", "IffffffBBBB"),
)

Record = tuple[str, Sequence[LogValue]]


def risi(*numbers: float, imu: int = 0) -> Record:
    """Make inertial data of a pass: change of velocity and rotation, and further numbers."""
    return "RISI", (*numbers, *(DT, DT)[: 8 - len(numbers)], 15, imu)


def baro(time_ms: int, height: float, instance: int = 0) -> Record:
    return "RBRI", (time_ms, height, 1, instance)


def mag(time_us: int, *field: float, instance: int = 0) -> Record:
    return "RMGI", (time_us, 5.0, 13.0, -18.0, *field, 1, 1, 1, instance)


def declination(angle: float) -> Record:
    return "RMGH", (angle, 1, 1, 1, 1, 0, 1, 0)


def flags(value: int) -> Record:
    return "RFRN", (0, 0, 0, 1.0, 0, 0.0, 0.0, 0.0, 2, 3, value)


def one_pass(time_us: int, *records: Record) -> list[Record]:
    return [("RFRH", (time_us, 0)), *records, ("RFRF", (8, 1))]


def log_bytes(*records: Record) -> bytes:
    writer = DataFlashWriter(COMMON_STRUCTURES)
    types = {"ATT": ATT} | {definition[0]: writer.define(*definition) for definition in RECORDS}
    start_up = b"".join(writer.start_up([], time_us=0))
    return start_up + b"".join(writer.record(types[name], values) for name, values in records)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "recorded.BIN"


def play(path: Path, *passes: list[Record], options: ImuOptions | None = None) -> RecordedSource:
    path.write_bytes(log_bytes(*[record for one in passes for record in one]))
    return read_recorded_source(str(path))(options or ImuOptions(has_compass=lambda: True))


def sense(source: RecordedSource, now_us: int) -> Sensors:
    sensors = source.sense(now_us)
    assert sensors is not None
    return sensors


def still(part: float = 1.0) -> Record:
    return risi(0, 0, -9.80665 * DT * part, 0, 0, 0)


def test_records_are_played_at_their_times(path: Path) -> None:
    first = one_pass(
        100_000, declination(0.25), risi(0.5, 0.25, -2, 0.125, 0, -1), baro(95, 1.5), mag(95_000, 200, -30, -500)
    )
    source = play(path, first, one_pass(102_500, risi(1, 2, 3, 4, 5, 6, 0.002, 0.003)))
    assert source.sense(99_999) is None
    sensors = sense(source, 100_000)
    assert sensors.delta.del_vel.tolist() == [0.5, 0.25, -2]
    assert sensors.delta.del_ang.tolist() == [0.125, 0, -1]
    assert sensors.delta.del_vel_dt == sensors.delta.del_ang_dt == np.float32(DT)
    assert sensors.baro == (95, 1.5)
    assert sensors.mag is not None
    assert (sensors.mag[0], sensors.mag[1].tolist()) == (95_000, [200, -30, -500])
    assert sensors.declination == 0.25
    delta = sense(source, 102_500).delta
    assert (delta.del_vel.tolist(), delta.del_ang.tolist()) == ([1, 2, 3], [4, 5, 6])
    assert delta.del_vel_dt == np.float32(0.002)
    assert delta.del_ang_dt == np.float32(0.003)


def test_vehicle_rests_where_the_log_says_nothing(path: Path) -> None:
    source = play(path, one_pass(100_000, still()), one_pass(200_000, still()))
    assert source.is_at_rest(99_999)
    assert not source.is_at_rest(100_000)
    sense(source, 100_000)
    assert source.is_at_rest(199_999)
    assert not source.is_at_rest(10**9)
    sense(source, 200_000)
    assert source.is_at_rest(10**9)


def test_what_is_not_written_again_holds(path: Path) -> None:
    first = one_pass(100_000, declination(0.25), still(), baro(95, 1.5), mag(95_000, 1, 2, 3))
    source = play(path, first, one_pass(102_500), one_pass(105_000, baro(105, 2.5)), one_pass(107_500))
    passes = [sense(source, now_us) for now_us in range(100_000, 107_501, LOOP_US)]
    assert {tuple(one.delta.del_vel.tolist()) for one in passes} == {(0.0, 0.0, float(np.float32(-9.80665 * DT)))}
    assert [one.baro for one in passes] == [(95, 1.5), (95, 1.5), (105, 2.5), (105, 2.5)]
    assert {one.mag[0] for one in passes if one.mag} == {95_000}
    assert {one.declination for one in passes} == {0.25}


def test_nothing_is_left_when_the_log_ends(path: Path) -> None:
    source = play(path, one_pass(100_000, still()), one_pass(102_500))
    assert [source.sense(now_us) is None for now_us in (100_000, 102_500, 105_000, 200_000)] == [False] * 2 + [True] * 2


def test_gap_in_the_log_brings_nothing(path: Path) -> None:
    source = play(path, one_pass(100_000, still()), one_pass(110_000))
    got = [source.sense(now_us) is not None for now_us in range(100_000, 112_501, LOOP_US)]
    assert got == [True, False, False, False, True, False]


def test_imus_that_differ_are_played_each_and_others_not(path: Path) -> None:
    both = one_pass(100_000, risi(1, 0, 0, 0, 0, 0), risi(2, 0, 0, 0, 0, 0, imu=1))
    worse = "RISI", (4, 0, 0, 0, 0, 0, DT, DT, 13, 1)
    source = play(path, both, one_pass(102_500, risi(3, 0, 0, 0, 0, 0), worse))
    first, second = (sense(source, now_us) for now_us in (100_000, 102_500))
    assert [imu.delta.del_vel[0] for imu in (*first.imus, *second.imus)] == [1, 2, 3, 4]
    assert [(imu.has_gyro, imu.has_accel) for imu in second.imus] == [(True, True), (False, True)]
    assert second.delta is second.imus[0].delta
    same = play(path, one_pass(100_000, still(), risi(0, 0, -9.80665 * DT, 0, 0, 0, imu=1)))
    assert sense(same, 100_000).imus == ()


def test_what_was_before_the_first_pass_is_over(path: Path) -> None:
    source = play(path, *[one_pass(time_us, still()) for time_us in range(100_000, 200_000, LOOP_US)])
    assert sense(source, 150_000).delta.del_vel_dt == np.float32(DT)
    assert sense(source, 152_500).delta.del_vel_dt == np.float32(DT)


def inertial_of(delta: InertialDelta) -> Inertial:
    """Return inertial data as the filter takes them."""
    vx, vy, vz, x, y, z, vel_dt, ang_dt = numbers_of(delta)
    return Inertial((vx, vy, vz), (x, y, z), vel_dt, ang_dt)


def filter_step(*deltas: InertialDelta) -> Inertial:
    """Return what a step of the filter makes of passes that add up to 12.5 ms."""
    sampler = DownSampler()
    *_, step = [sampler.add(inertial_of(delta), 0, True) for delta in deltas]
    assert step is not None
    return step


def test_passes_of_the_log_add_up_in_a_slower_loop(path: Path) -> None:
    turning = [(0.001 * number, 0.01, -0.02, 0.002, -0.001 * number, 0.0015) for number in range(5)]
    times_us = range(100_000, 112_500, LOOP_US)
    recorded = [one_pass(time_us, risi(*numbers)) for time_us, numbers in zip(times_us, turning, strict=True)]
    source = play(path, one_pass(97_500, still()), *recorded)
    sense(source, 97_500)
    whole = sense(source, 110_000).delta
    parts = [InertialDelta(np.array(numbers[:3]), np.array(numbers[3:]), DT, DT) for numbers in turning]
    step, expected = filter_step(whole), filter_step(*parts)
    assert step.del_vel == pytest.approx(expected.del_vel, abs=1e-8)
    assert step.del_ang == pytest.approx(expected.del_ang, abs=1e-9)
    assert (step.del_vel_dt, step.del_ang_dt) == pytest.approx((expected.del_vel_dt, expected.del_ang_dt))
    assert np.array_equal(whole.del_vel, np.float32(whole.del_vel))


def test_other_instances_are_passed_over(path: Path) -> None:
    others = [risi(9, 9, 9, 9, 9, 9, imu=1), baro(99, 9, instance=1), mag(99_000, 9, 9, 9, instance=1)]
    sensors = sense(play(path, one_pass(100_000, still(), baro(95, 1.5), *others)), 100_000)
    assert sensors.delta.del_vel[0] == 0
    assert sensors.baro == (95, 1.5)
    assert sensors.mag is None


def test_compass_is_heard_if_it_is_in_use(path: Path) -> None:
    source = play(path, one_pass(100_000, still(), mag(95_000, 1, 2, 3)), options=ImuOptions())
    assert sense(source, 100_000).mag is None


@pytest.mark.parametrize("bad", [
    risi(math.nan, 9, 9, 9, 9, 9), risi(9, 9, 9, 9, 9, math.inf), baro(99, math.nan), mag(99_000, 9, math.inf, 9),
    declination(math.nan), ("ATT", (100_000, 0, 0, 0, 0, 0, math.inf, 3)),
])  # fmt: skip
def test_what_is_not_a_number_is_passed_over(path: Path, bad: Record) -> None:
    good = [declination(0.25), still(), baro(95, 1.5), mag(95_000, 1, 2, 3)]
    source = play(path, one_pass(100_000, *good), one_pass(102_500, bad))
    before, after = sense(source, 100_000), sense(source, 102_500)
    assert before.mag is not None
    assert after.mag is not None
    assert after.delta.del_vel.tolist() == before.delta.del_vel.tolist()
    assert after.delta.del_ang.tolist() == before.delta.del_ang.tolist()
    assert (after.baro, after.declination, after.mag[0]) == (before.baro, before.declination, before.mag[0])
    assert math.isfinite(source.yaw_rad())


def test_times_that_run_backwards_are_passed_over(path: Path) -> None:
    source = play(path, one_pass(100_000, still()), one_pass(50_000, still(9.0)), one_pass(102_500, still()))
    assert sense(source, 100_000).delta.del_vel_dt == np.float32(DT)
    assert sense(source, 102_500).delta.del_vel_dt == np.float32(DT)


def test_heading_is_that_of_the_logs_own_estimate(path: Path) -> None:
    attitude = "ATT", (100_000, 0.0, 0.0, 0.0, 0.0, 0.0, 350.0, 3)
    source = play(
        path,
        one_pass(100_000, still()),
        [attitude],
        one_pass(102_500),
        options=ImuOptions(heading_rad=0.5),
    )
    sense(source, 100_000)
    assert source.yaw_rad() == 0.5
    source.set_armed(True)
    sense(source, 102_500)
    assert source.yaw_rad() == pytest.approx(math.radians(-10))


def test_take_off_and_touchdown_are_expected_as_in_the_log(path: Path) -> None:
    passes = [one_pass(100_000, still(), flags(0)), one_pass(102_500, still(), flags(64 + 1)), one_pass(105_000)]
    source = play(path, *passes, one_pass(107_500, flags(128 + 1)))
    told = [(sense(source, now_us), source.expected())[1] for now_us in (100_000, 102_500, 105_000, 107_500)]
    assert told == [(False, False), (True, False), (True, False), (False, True)]
    silent = play(path, one_pass(100_000, still()))
    sense(silent, 100_000)
    assert silent.expected() is None


def test_errors_may_be_added(path: Path) -> None:
    options = ImuOptions(errors=SensorErrors(baro_bias_m=0.5))
    assert sense(play(path, one_pass(100_000, still(), baro(95, 1.5)), options=options), 100_000).baro == (95, 2.0)


@pytest.mark.slow
def test_recording_of_the_firmware_is_played_whole() -> None:
    source = read_recorded_source(str(FIRMWARE_LOG))(ImuOptions(has_compass=lambda: True))
    passes = [source.sense(now_us) for now_us in range(0, 60_000_000, LOOP_US)]
    heard = [one for one in passes if one is not None]
    first = next(number for number, one in enumerate(passes) if one is not None)
    assert first * LOOP_US == 3_455_000
    assert sum(one.delta.del_vel_dt for one in heard) == pytest.approx(15_887 * DT, abs=0.01)
    assert len({one.baro for one in heard}) == 398
    assert len({one.mag[0] for one in heard if one.mag}) == 398
    assert heard[-1].declination == pytest.approx(0.22336, abs=1e-5)
    assert np.mean([one.delta.del_vel[2] for one in heard]) == pytest.approx(
        -9.80665 * DT, rel=2e-3
    )  # its bias included


def test_log_that_tells_of_no_motion_is_refused(path: Path) -> None:
    with pytest.raises(InputError) as raised:
        play(path, [("ATT", (100_000, 0, 0, 0, 0, 0, 0, 3))], [("RFRH", (100_000, 0)), ("RFRF", (8, 1))])
    assert str(raised.value) == (f"{path}: too short to fly: 1 ATT, and 50 ATT with as many XKF1 or POS are the fewest")


@pytest.mark.parametrize("data", [b"", b"not a log\n" * 20])
def test_file_that_is_no_log_is_refused(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with pytest.raises(InputError) as raised:
        read_recorded_source(str(path))
    assert str(raised.value) == f"{path}: not a DataFlash log"


def test_missing_log_is_an_error(path: Path) -> None:
    with pytest.raises(InputError) as raised:
        read_recorded_source(str(path))
    assert str(raised.value) == f"{path}: No such file or directory"
