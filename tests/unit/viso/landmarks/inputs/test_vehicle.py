# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses, fixes and aircraft from MAVLink: messages, bytes of a link, telemetry logs."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.links.tlog import TlogWriter
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ATTITUDE, GLOBAL_POSITION_INT, HEARTBEAT, LOCAL_POSITION_NED, Message
from viso.landmarks.adsb_vehicle import to_message
from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.inputs.vehicle import ArrivalTimes, MavlinkReader, MavlinkStream, TlogFile
from viso.landmarks.types import AircraftReport, Event, GeodeticPoint, GlobalFix, VehiclePose

AT = LOCAL_POSITION_NED(10_000, 3.0, 4.0, -5.0, 1.0, -2.0, 0.5)
EAST = ATTITUDE(10_000, 0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0)
PLACE = GLOBAL_POSITION_INT(10_000, 474_000_000, 85_000_000, 432_500, 12_000, 0, 0, 0, 9000)
HELICOPTER = AircraftReport(60.0, "3C6DD1", 47.5, 8.5, 5000.0, 90.0, 45.0, 640.0)


def told(reader: MavlinkReader, *messages: Any) -> list[Event]:
    """Return what messages tell that arrive as they are stamped."""
    return [event for message in messages for event in reader.take(message, message.time_boot_ms * 1e-3)]


def pose_of(reader: MavlinkReader, *messages: Message) -> VehiclePose:
    events = told(reader, *messages)
    assert len(events) == 1
    assert isinstance(events[0], VehiclePose)
    return events[0]


def test_pose_is_enu_and_its_body_flu() -> None:
    reader = MavlinkReader()
    pose = pose_of(reader, AT, replace(EAST, pitch=0.1))
    assert (pose.t_s, pose.x_m, pose.y_m, pose.z_m) == (10.0, 4.0, 3.0, 5.0)
    assert pose.yaw_rad == pytest.approx(0, abs=1e-7)
    assert pose.world_R_body is not None
    forward, left, up = pose.world_R_body.T
    np.testing.assert_allclose(forward, [math.cos(0.1), 0, math.sin(0.1)], atol=1e-7)  # nose up
    np.testing.assert_allclose(left, [0, 1, 0], atol=1e-7)
    np.testing.assert_allclose(up, [-math.sin(0.1), 0, math.cos(0.1)], atol=1e-7)
    assert not reader.refused


def test_roll_to_the_right_lowers_the_right_side() -> None:
    pose = pose_of(MavlinkReader(), AT, replace(EAST, roll=0.2))
    assert pose.world_R_body is not None
    np.testing.assert_allclose(pose.world_R_body[:, 1], [0, math.cos(0.2), math.sin(0.2)], atol=1e-7)


@given(heading_rad=st.floats(-math.pi, math.pi).filter(bool))
def test_heading_becomes_a_yaw(heading_rad: float) -> None:
    pose = pose_of(MavlinkReader(), AT, replace(EAST, yaw=heading_rad))
    assert math.remainder(pose.yaw_rad - (math.pi / 2 - heading_rad), 2 * math.pi) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("late_ms", [-400, 0, 250, 1000])
def test_position_is_carried_on_to_the_time_of_the_attitude(late_ms: int) -> None:
    pose = pose_of(MavlinkReader(), AT, replace(EAST, time_boot_ms=10_000 + late_ms))
    assert pose.t_s == pytest.approx(10 + late_ms / 1000)
    late_s = late_ms / 1000
    assert (pose.x_m, pose.y_m, pose.z_m) == pytest.approx((4 - 2 * late_s, 3 + late_s, 5 - 0.5 * late_s))


def test_fix_is_above_sea_level() -> None:
    [fix] = told(MavlinkReader(), PLACE)
    assert isinstance(fix, GlobalFix)
    assert fix.t_s == 10.0
    assert (fix.point.latitude_deg, fix.point.longitude_deg) == pytest.approx((47.4, 8.5), abs=1e-9)
    assert fix.point.alt_m == pytest.approx(432.5)


def test_aircraft_has_the_time_at_which_it_was_heard() -> None:
    reader = MavlinkReader()
    [report] = reader.take(to_message(HELICOPTER, 62.0), 100.0)
    assert isinstance(report, AircraftReport)
    assert (report.t_s, report.icao) == (98.0, "3C6DD1")


@pytest.mark.parametrize(
    ("messages", "reason"),
    [
        ([EAST], "an attitude without a position"),
        ([AT, replace(EAST, time_boot_ms=11_001)], "an attitude without a position"),
        ([AT, replace(EAST, yaw=0.0)], "an attitude that is not known yet"),
        ([AT, replace(EAST, yaw=math.nan)], "an attitude that is no rotation"),
        ([AT, replace(EAST, roll=math.inf)], "an attitude that is no rotation"),
        ([replace(AT, vx=math.nan)], "a position that is not finite"),
        ([replace(AT, x=1e30), EAST], "a position out of range"),
        ([replace(PLACE, lat=0, lon=0)], "no fix: (0, 0)"),
        ([replace(PLACE, lat=2_000_000_000)], "bad latitude_deg"),
    ],
)
def test_what_is_of_no_use_is_counted(messages: list[Message], reason: str) -> None:
    reader = MavlinkReader()
    assert told(reader, *messages) == []
    assert reader.refused == {reason: 1}


def test_bad_aircraft_is_counted_by_its_field() -> None:
    reader = MavlinkReader()
    assert reader.take(replace(to_message(HELICOPTER, 62.0), ICAO_address=0), 100.0) == []
    assert reader.refused == {"bad ICAO_address": 1}


def test_other_messages_are_passed_over() -> None:
    reader = MavlinkReader()
    assert reader.take(HEARTBEAT(2, 3, 0, 0, 4, 3), 1.0) == []
    assert not reader.refused


class TestArrivalTimes:
    def test_late_arrivals_do_not_shake_the_times(self) -> None:
        times = ArrivalTimes()
        delays_s = [0.01, 0.15, 0.02, 0.3, 0.01, 0.08]
        found = [times.t_s(0.1 * step, 1000 + 0.1 * step + delay) for step, delay in enumerate(delays_s)]
        assert found == pytest.approx([1000.01 + 0.1 * step for step in range(len(delays_s))])

    def test_autopilot_that_boots_begins_anew(self) -> None:
        times = ArrivalTimes()
        times.t_s(500.0, 1500.0)
        assert times.t_s(2.0, 1510.0) == 1510.0

    def test_clock_that_is_set_back_begins_anew(self) -> None:
        times = ArrivalTimes()
        times.t_s(500.0, 1500.0)
        assert times.t_s(500.1, 900.1) == pytest.approx(900.1)
        assert times.t_s(500.2, 900.3) == pytest.approx(900.2)

    def test_old_delays_are_forgotten(self) -> None:
        times = ArrivalTimes()
        times.t_s(0.0, 100.0)
        for step in range(1, 1001):
            found = times.t_s(step, 100.5 + step)
        assert found == 1100.5


class Vehicle:
    """Encodes messages of a vehicle."""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        self._codec = Codec(system_id, component_id)

    def bytes(self, *messages: Message) -> bytes:
        return b"".join(self._codec.encode(message) for message in messages)


def test_stream_takes_bytes_as_they_come() -> None:
    stream = MavlinkStream()
    data = Vehicle().bytes(AT, EAST)
    events: list[Event] = []
    for start in range(0, len(data), 7):
        events += stream.feed(data[start : start + 7], 100.0)
    assert [type(event) for event in events] == [VehiclePose]


def test_stream_stays_with_the_first_vehicle() -> None:
    stream = MavlinkStream()
    first, second = Vehicle(1), Vehicle(2)
    stream.feed(first.bytes(AT), 100.0)
    assert stream.feed(second.bytes(replace(AT, x=99.0), EAST), 100.0) == []
    [pose] = stream.feed(first.bytes(EAST), 100.0)
    assert isinstance(pose, VehiclePose)
    assert pose.y_m == 3.0
    assert stream.refused == {"a message of another vehicle": 2}


def test_aircraft_may_come_from_anyone() -> None:
    stream = MavlinkStream()
    stream.feed(Vehicle(1).bytes(AT), 100.0)
    assert len(stream.feed(Vehicle(1, 156).bytes(to_message(HELICOPTER, 60.0)), 100.0)) == 1
    assert not stream.refused


@pytest.mark.slow
@given(st.binary(max_size=200))
def test_bytes_that_are_no_frames_do_no_harm(junk: bytes) -> None:
    stream = MavlinkStream()
    assert stream.feed(junk, 100.0) == []
    stream.feed(Vehicle().bytes(AT), 100.0)
    # What looked like the head of a frame may have eaten the first ones.
    assert [event for _ in range(20) for event in stream.feed(Vehicle().bytes(AT, EAST), 100.0)]


def test_tlog_has_the_times_of_its_entries(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    vehicle = Vehicle()
    with TlogWriter(path) as log:
        for time_us, message in (
            (1_700_000_000_020_000, AT),
            (1_700_000_000_050_000, EAST),
            (1_700_000_001_000_000, PLACE),
        ):
            log.write(time_us, vehicle.bytes(message))
    file = TlogFile(path)
    pose, fix = file.events()
    assert pose.t_s == pytest.approx(1_700_000_000.02, abs=1e-6)
    assert isinstance(fix, GlobalFix)
    assert fix.point == GeodeticPoint(474_000_000 * 1e-7, 85_000_000 * 1e-7, 432.5)
    assert not file.refused


def test_damage_of_a_tlog_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    vehicle = Vehicle()
    with TlogWriter(path) as log:
        for message in (AT, EAST):
            log.write(1_700_000_000_000_000, vehicle.bytes(message))
    path.write_bytes(path.read_bytes() + b"\0" * 5)
    file = TlogFile(path)
    assert len(list(file.events())) == 1
    assert file.refused == {"damaged bytes of the log": 5}


def test_file_that_is_no_tlog_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"hello")
    with pytest.raises(InputFileError) as raised:
        list(TlogFile(path).events())
    assert str(raised.value).startswith(f"{path}: byte 0: ")
    assert len(str(raised.value).splitlines()) == 1
