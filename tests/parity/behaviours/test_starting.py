# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From boot to aiding: behaviours 1 to 7, 40 and 41."""

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest

from mav_handlers.wire.messages import LOCAL_POSITION_NED, SET_GPS_GLOBAL_ORIGIN
from tests.parity.behaviours.logs import Log, Recordings
from tests.parity.behaviours.parked import Parked
from tests.parity.behaviours.status import (
    AIDED_FLAGS,
    AIDED_SS,
    AIDED_TS,
    AIDING,
    NOT_AIDED_TS,
    PARKED_FLAGS,
    PARKED_SS,
    REPORTED,
)

if TYPE_CHECKING:
    from tests.parity.behaviours.conftest import MakeParked

pytestmark = pytest.mark.slow

BOOT = ("initialised", "tilt alignment complete")
LOOP_S = 0.0025
STEP_S = 0.0125
SETTLE_S = 20.0
AHRS_START_S = 2.455
AUX_FUNCTION, ALIGN, HIGH, ACCEPTED = 218, 80, 2, 0
EKF_ORIGIN, HOME = 0, 1


@pytest.fixture(scope="module")
def started(make_parked: "MakeParked") -> Parked:
    """Return a vehicle that stands for a while, and is then given poses and velocities."""
    parked = make_parked()
    parked.run_to(8.0)
    parked.stream(11.0, lambda: parked.pose(1.0, 2.0, -0.5), parked.velocity)
    return parked


def test_01_boot_texts_come_in_order_and_once_per_core(recordings: Recordings, started: Parked) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    for log in recording.both:
        assert log.said(until_s=25.0) == list(BOOT)
        boot = [said for time_s, said in log.texts if time_s < 25.0 and said.endswith(BOOT)]
        assert sorted(boot) == sorted(f"EKF3 IMU{core} {text}" for core in (0, 1) for text in BOOT)
    assert recording.when(lambda log: log.when("initialised")) == pytest.approx(4.454, abs=0.001)
    assert recording.when(lambda log: log.when("tilt alignment complete")) == pytest.approx(5.777, abs=0.001)
    told = [text for _, text in started.texts() if "IMU1" not in text]
    assert [text for text in told if text.startswith(("EKF3", "AHRS"))] == [
        "AHRS: DCM active",
        "EKF3 IMU0 initialised",
        "AHRS: EKF3 active",
        "EKF3 IMU0 tilt alignment complete",
        "EKF3 IMU0 yaw aligned",
        f"EKF3 IMU0 {AIDING}",
        "EKF3 IMU0 initial pos NED = 1.0,2.0,-0.5 (m)",
        "EKF3 IMU0 initial vel NED = 0.0,0.0,0.0 (m/s)",
    ]
    by_core = [[text for _, text in started.texts() if f"IMU{core}" in text] for core in (0, 1)]
    assert [text.replace("IMU0", "IMU1") for text in by_core[0]] == by_core[1]
    assert {severity for severity, text in started.texts() if text.startswith(("EKF3", "AHRS"))} == {6}


def test_02_without_data_it_stays_parked(recordings: Recordings, started: Parked) -> None:
    for log in recordings("2025-07/bench_pose_velocity").both:
        assert {(row.TS, row.SS) for row in log.between("XKF4", 6.0, 25.0)} == {(NOT_AIDED_TS, PARKED_SS)}
        assert {(row.PN, row.PE) for row in log.between("XKF1", 6.0, 25.0)} == {(0.0, 0.0)}
    assert set(started.flags(6.0, 8.0)) == {PARKED_FLAGS}
    assert {(row.TS, row.SS) for row in started.log().between("XKF4", 6.0, 8.0)} == {(NOT_AIDED_TS, PARKED_SS)}
    assert {(row.PN, row.PE) for row in started.log().between("XKF1", 6.0, 8.0)} == {(0.0, 0.0)}


def test_03_first_pose_aligns_yaw_and_a_loop_later_starts_aiding(recordings: Recordings, started: Parked) -> None:
    recording = recordings("2025-07/bench_pose_velocity")
    first_s = recording.input("REPH", lambda sample: True)
    assert recording.when(lambda log: log.when("yaw aligned")) == pytest.approx(25.1416, abs=0.001)
    assert recording.when(lambda log: log.when(AIDING)) == pytest.approx(25.1441, abs=0.001)
    for log in recording.both:
        assert log.when(AIDING) - log.when("yaw aligned") == pytest.approx(LOOP_S, abs=1e-4)
        assert log.when(AIDING) - first_s == pytest.approx(0.054, abs=STEP_S)
    log = started.log()
    assert log.when(AIDING) - log.when("yaw aligned") == pytest.approx(LOOP_S, abs=1e-4)
    assert log.when(AIDING) - log.rows("REPH")[0].t == pytest.approx(0.054, abs=STEP_S)


def test_04_initial_velocity_is_told_only_if_there_was_one(recordings: Recordings) -> None:
    for log in recordings("2025-07/bench_pose_velocity").both:
        starts = [i for i, text in enumerate(log.said()) if text == AIDING]
        assert len(starts) == 2
        assert [log.said()[i + 2] for i in starts] == ["initial vel NED = 0.0,0.0,0.0 (m/s)"] * 2
    for log in recordings("2025-07/bench_pose_baro").both:
        assert log.said().count(AIDING) == 1
        assert not [text for text in log.said() if text.startswith("initial vel")]


def test_05_initial_position_is_the_pose_less_the_lever_arm(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_vertical_velocity_100hz")
    assert recording.recorded.rows("RVOH")[0].OX == 0.5
    assert recording.recorded.rows("REPH")[0].PX == 1.0
    for log in recording.both:
        assert log.when("initial pos NED = 0.5,") == log.when(AIDING)
        assert log.value("XKF1", "PN", log.when(AIDING)) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("yaw_deg", "told"), [(90.0, "1.0,-0.5,"), (180.0, "1.5,")])
def test_05_lever_arm_turns_with_the_vehicle(make_parked: "MakeParked", yaw_deg: float, told: str) -> None:
    parked = make_parked(VISO_POS_X=0.5)
    parked.run_to(7.0)
    parked.stream(7.2, lambda: parked.pose(1.0, yaw_deg=yaw_deg))
    assert parked.log().when(f"initial pos NED = {told}") > 7.0


def test_06_it_navigates_without_an_origin(recordings: Recordings, started: Parked) -> None:
    for log in recordings("2025-07/bench_pose_velocity").both:
        aided = {(row.TS, row.SS, row.SS & REPORTED) for row in log.between("XKF4", 25.2, 55.0)}
        assert aided == {(AIDED_TS, AIDED_SS, AIDED_FLAGS)}
        assert set(log.values("XKF1", "OH", 25.2, 55.0)) == {0.0}
        assert not log.rows("ORGN")
    started_s = started.log().when(AIDING)
    assert set(started.flags(started_s + 0.11)) == {AIDED_FLAGS}
    assert min(time_s for time_s, _ in started.messages(LOCAL_POSITION_NED)) > started_s
    told = [(position.x, position.y, position.z) for _, position in started.messages(LOCAL_POSITION_NED)]
    assert told == [pytest.approx((1.0, 2.0, -0.5), abs=0.01)] * len(told)
    assert len(told) > 20
    assert set(started.log().values("XKF1", "OH", 8.2)) == {0.0}


def test_07_origin_is_told_by_each_core_and_moves_nothing(recordings: Recordings) -> None:
    recording = recordings("2025-07/bench_steps")
    set_s = recording.when(lambda log: log.when("origin set"))
    for log in recording.both:
        told = [said for _, said in log.texts if said.endswith("origin set")]
        assert sorted(told) == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set"]
        assert log.rows("ORGN")[0].t == pytest.approx(set_s, abs=LOOP_S)
        assert {row.Alt for row in log.rows("ORGN")} == {584.0}
        before, after = (log.between("XKF1", set_s + when, set_s + when + 0.5) for when in (-0.5, 0.0))
        assert ({row.OH for row in before}, {row.OH for row in after}) == ({0.0}, {584.0})
        north = [row.PN for row in (*before, *after)]
        assert max(abs(b - a) for a, b in pairwise(north)) < 1e-4


def test_07_origin_of_a_client_is_logged_as_the_firmwares(recordings: Recordings, make_parked: "MakeParked") -> None:
    parked = make_parked()
    parked.run_to(6.0)
    parked.stream(7.0, lambda: parked.pose(3.0, -4.0), parked.velocity)
    parked.send(SET_GPS_GLOBAL_ORIGIN(1, -353632620, 1491652370, 584_000))
    parked.stream(8.0, lambda: parked.pose(3.0, -4.0), parked.velocity)
    ours, recorded = parked.log(), recordings("2025-07/bench_steps").recorded

    def told(log: Log) -> list[tuple[int, float, float, float]]:
        return [(row.Type, row.Lat, row.Lng, row.Alt) for row in log.rows("ORGN")]

    assert [kind for kind, *_ in told(ours)] == [EKF_ORIGIN, EKF_ORIGIN, HOME]
    assert [kind for kind, *_ in told(recorded)] == [EKF_ORIGIN, EKF_ORIGIN, HOME]
    assert told(ours)[:2] == told(recorded)[:2]
    assert sum(said.endswith("origin set") for _, said in ours.texts) == 2
    assert ours.values("XKF1", "PN", 7.0) == [pytest.approx(3.0, abs=0.001)] * len(ours.between("XKF1", 7.0))
    assert (ours.value("XKF1", "OH", 6.9), ours.value("XKF1", "OH", 7.1)) == (0.0, 584.0)


def test_40_camera_is_aligned_20_s_after_the_ahrs_has_started(make_parked: "MakeParked") -> None:
    parked = make_parked("66601", compass=True, VISO_TYPE=2)
    parked.run_to(6.0)
    parked.stream(7.0, lambda: parked.pose(yaw_deg=40.0), rate_hz=20)
    parked.run_to(21.0)
    parked.stream(23.0, lambda: parked.pose(yaw_deg=40.0), rate_hz=20)
    shifted = [(time_s, said) for time_s, said in parked.log().texts if said.startswith("VisOdom: yaw shifted")]
    assert len(shifted) == 1
    # The next pose is up to 50 ms after that.
    assert AHRS_START_S + SETTLE_S < shifted[0][0] <= AHRS_START_S + SETTLE_S + 0.05


def test_41_camera_is_not_aligned_to_a_yaw_that_is_its_own(make_parked: "MakeParked") -> None:
    parked = make_parked(compass=True, VISO_TYPE=2)
    parked.run_to(23.0)
    assert parked.vehicle.ahrs.initialised()
    assert parked.vehicle.ahrs.dcm_yaw_initialised()
    assert parked.vehicle.ahrs.using_extnav_for_yaw()
    assert parked.command(AUX_FUNCTION, ALIGN, HIGH) == ACCEPTED
    parked.stream(25.0, lambda: parked.pose(yaw_deg=40.0))
    log = parked.log()
    assert not [said for _, said in log.texts if said.startswith("VisOdom: yaw")]
    assert log.rows("XKF1")[-1].Yaw == pytest.approx(40.0, abs=0.1)
