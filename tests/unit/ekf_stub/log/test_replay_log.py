# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of the estimator in the log: which records, in which order, and when not."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.inputs.measurements import (
    AllGps,
    BaroReading,
    FinderState,
    FlowMeasurement,
    GpsSample,
    ImuReading,
    InertialDelta,
    RangeState,
)
from ekf_stub.inputs.sensors import Sensors
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from ekf_stub.log.replay_log import (
    CHECK_LANE_SWITCH,
    EKF2_BEFORE_EKF3,
    EKF3_BEFORE_EKF2,
    REQUEST_YAW_RESET,
    RESET_HEIGHT_DATUM,
    SOURCE_SET_1,
    TERRAIN_STABLE,
    TERRAIN_UNSTABLE,
    ReplayLog,
    SensorSet,
    VehicleFrame,
)

START_US = 3_455_000
FRAME_US = 2500
CANBERRA = Location(-353_632_610, 1_491_652_300, 58_400)
SENSORS = Sensors(
    InertialDelta(np.array([0.0, 0.25, -0.5]), np.zeros(3), 0.0025, 0.0025),
    baro=(3449, 0.5),
    mag=(3_449_453, np.array([232.0, 52.0, -528.0])),
    declination=0.25,
)
FIRST_FRAME = [
    *("RFRH", "RFRN", "RISH", "RISI", "RISI", "RISI", "RBRH", "RBRI", "RBRI", "RGPH"),
    *("RGPI", "RGPJ", "RGPI", "RGPJ", "RGPI", "RGPJ", "RMGH", "RMGI", "RMGI", "RMGI", "RVOH"),
]


class Rig:
    """An estimator whose frames are logged, LOG_REPLAY set."""

    def __init__(
        self, event_order: tuple[LogStructure, LogStructure] = EKF2_BEFORE_EKF3, *, ranges_in_cm: bool = False
    ) -> None:
        self.enabled = True
        self.records: list[tuple[str, tuple[LogValue, ...]]] = []
        fitted = SensorSet(compass_offsets=(5.0, 13.0, -18.0))
        self.log = ReplayLog(self, lambda: self.enabled, fitted, event_order=event_order, ranges_in_cm=ranges_in_cm)
        self.sensors = SENSORS
        self.vehicle = VehicleFrame()
        self.gps: GpsSample | None = None
        self.all_gps: AllGps | None = None
        self.ranges: RangeState | None = None
        self.camera = VisualOdomFrame(Vector3f(), 10, True, True)
        self._now_us = START_US

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        self.records.append((structure.name, tuple(values)))

    def frame(self, *, was_initialised: bool = True) -> None:
        self.log.start_frame(self._now_us, 0)
        self._now_us += FRAME_US
        self.log.vehicle(self.vehicle)
        self.log.sensors(self.sensors, self.all_gps or AllGps((self.gps,)))
        self.log.ranges(self.ranges)
        self.log.frame(self.camera)
        self.log.note_run(was_initialised=was_initialised)

    def frames_with(self, sensors: Sensors) -> list[str]:
        """Return what another frame with other sensors writes."""
        self.sensors = sensors
        self.frame()
        return self.names()

    def pose(self) -> None:
        self.log.pose(Vector3f(), Quaternion(), (f32(0.2), f32(0.2)), self._now_us // 1000, 10, 0)

    def velocity(self) -> None:
        self.log.velocity(Vector3f(), f32(0.1), self._now_us // 1000, 10)

    def odometry(self) -> None:
        self.log.body_odometry(f32(50), Vector3f(), Vector3f(), f32(0.02), self._now_us // 1000, 0, Vector3f())

    def flow(self) -> None:
        measured = FlowMeasurement(180, (0.25, -0.5), (0.125, 0.0), (0.5, 0.0, -0.25))
        self.log.flow(measured, self._now_us // 1000)

    def names(self) -> list[str]:
        names = [name for name, _ in self.records]
        self.records.clear()
        return names

    def values(self, name: str) -> list[tuple[LogValue, ...]]:
        found = [values for kind, values in self.records if kind == name]
        self.records.clear()
        return found


@pytest.fixture
def new() -> Rig:
    """Return a log without frames."""
    return Rig()


@pytest.fixture
def rig() -> Rig:
    """Return a log whose first two frames have been, the second waiting for its end."""
    rig = Rig()
    rig.frame()
    rig.frame()
    rig.records.clear()
    return rig


# Range finders and flow

RANGES = RangeState((FinderState((0.5, 0.0, 0.25), 2.0, 25, 4), FinderState((0.0, 0.0, 0.0), 0.5, 24, 2)), 0.125, 30.0)


def test_range_finders_stand_between_compass_and_camera(new: Rig) -> None:
    new.ranges = RANGES
    new.frame()
    assert new.names()[-6:] == ["RMGI", "RMGI", "RRNH", "RRNI", "RRNI", "RVOH"]


def test_range_finders_are_logged_as_they_change(rig: Rig) -> None:
    rig.ranges = RANGES
    rig.frame()
    assert rig.values("RRNI") == [(0.5, 0.0, 0.25, 2.0, 25, 4, 0), (0.0, 0.0, 0.0, 0.5, 24, 2, 1)]
    rig.ranges = RANGES._replace(finders=(RANGES.finders[0], RANGES.finders[1]._replace(distance=0.75)))
    rig.frame()
    assert [record for record in rig.records if record[0].startswith("RRN")] == [
        ("RRNI", (0.0, 0.0, 0.0, 0.75, 24, 2, 1))
    ]
    rig.ranges = rig.ranges._replace(max_distance=20.0)
    rig.frame()
    assert rig.values("RRNH") == [(0.125, 20.0, 2)]


def test_4_6_logs_ranges_in_whole_centimetres() -> None:
    rig = Rig(ranges_in_cm=True)
    rig.ranges = RANGES._replace(ground_clearance=0.1)
    rig.frame()
    written = [values for name, values in rig.records if name.startswith("RRN")]
    assert written == [(10, 3000, 2), (0.5, 0.0, 0.25, 200, 25, 4, 0), (0.0, 0.0, 0.0, 50, 24, 2, 1)]


def test_flow_is_logged_with_where_its_sensor_is(rig: Rig) -> None:
    rig.flow()
    assert rig.values("ROFH") == [(0.25, -0.5, 0.125, 0.0, 3460, 0.5, 0.0, -0.25, 0.0, 180)]


# Which inputs


def test_first_frame_has_every_input_in_order(new: Rig) -> None:
    new.frame()
    assert new.names() == FIRST_FRAME


def test_frame_begins_with_its_time_and_the_time_in_flight(new: Rig) -> None:
    assert new.log.start_frame(5_000_123, 750)
    assert new.records == [("RFRH", (5_000_123, 750))]


def test_frame_of_unchanged_inputs_has_none(rig: Rig) -> None:
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH"]


def test_inertial_data_are_logged_for_each_imu(rig: Rig) -> None:
    rig.sensors = replace(SENSORS, delta=InertialDelta(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), 7.0, 8.0))
    rig.frame()
    assert rig.values("RISI") == [(1, 2, 3, 4, 5, 6, 7, 8, 15, 0), (1, 2, 3, 4, 5, 6, 7, 8, 15, 1)]


def test_imus_that_differ_are_logged_each_with_what_may_be_used(rig: Rig) -> None:
    some, other = SENSORS.delta, InertialDelta(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), 7.0, 8.0)
    imus = ImuReading(some), ImuReading(other, has_gyro=False), ImuReading(other, has_accel=False)
    rig.sensors = replace(SENSORS, imus=imus)
    rig.frame()
    assert [name for name, _ in rig.records if name.startswith("RIS")] == ["RISH", "RISI", "RISI"]
    assert [values[-2:] for name, values in rig.records if name == "RISI"] == [(13, 1), (14, 2)]
    rig.records.clear()
    rig.sensors = replace(SENSORS, imus=(imus[2], *imus[1:]))
    rig.frame()
    assert [values[1:3] for values in rig.values("RISH")] == [(0, 1)]


def test_inertial_data_that_differ_in_a_sign_of_zero_are_logged(rig: Rig) -> None:
    delta = InertialDelta(np.array([-0.0, 0.25, -0.5]), np.zeros(3), 0.0025, 0.0025)
    assert rig.frames_with(replace(SENSORS, delta=delta)) == ["RFRF", "RFRH", "RISI", "RISI"]


def test_place_of_an_imu_that_is_not_fitted_is_logged_once(new: Rig) -> None:
    new.frame()
    assert new.values("RISI")[2] == (*[0.0] * 8, 0, 2)


def test_new_height_is_logged_for_each_barometer(rig: Rig) -> None:
    rig.sensors = replace(SENSORS, baro=(3549, 1.5))
    rig.frame()
    assert rig.values("RBRI") == [(3549, 1.5, 1, 0), (3549, 1.5, 1, 1)]


def test_new_field_is_logged_for_each_compass(rig: Rig) -> None:
    rig.sensors = replace(SENSORS, mag=(3_549_413, np.array([1.0, 2.0, 3.0])))
    rig.frame()
    assert rig.values("RMGI") == [(3_549_413, 5, 13, -18, 1, 2, 3, 1, 1, 1, number) for number in range(3)]


def test_same_field_said_again_is_not_logged(rig: Rig) -> None:
    same = replace(SENSORS, mag=(3_449_453, np.array([232.0, 52.0, -528.0])))
    assert rig.frames_with(same) == ["RFRF", "RFRH"]


def test_declination_is_logged_when_it_becomes_known(rig: Rig) -> None:
    assert rig.frames_with(replace(SENSORS, declination=0.5)) == ["RFRF", "RFRH", "RMGH"]


def test_times_of_sensors_wrap_as_the_records_do(rig: Rig) -> None:
    field = np.array([1.0, 2.0, 3.0])
    rig.sensors = replace(SENSORS, baro=(0x1_0000_0005, 0.5), mag=(0x1_0000_0007, field))
    rig.frame()
    times = {name: values[0] for name, values in rig.records if name in ("RBRI", "RMGI")}
    assert times == {"RBRI": 5, "RMGI": 7}


def test_vehicle_without_barometer_and_compass_says_so(new: Rig) -> None:
    new.sensors = Sensors(SENSORS.delta, declination=0.25)
    new.frame()
    records = dict(new.records)
    assert records["RBRH"] == (0, 0)
    assert records["RMGH"] == (0.25, 0, 0, 1, 0, 0, 1, 0)
    assert not {"RBRI", "RMGI"} & records.keys()


@pytest.mark.parametrize(
    ("vehicle", "flags"),
    [
        (VehicleFrame(), 0),
        (VehicleFrame(armed=True), 1),
        (VehicleFrame(has_flow_sensor=True), 16),
        (VehicleFrame(takeoff_expected=True), 64),
        (VehicleFrame(touchdown_expected=True), 128),
        (VehicleFrame(armed=True, takeoff_expected=True, touchdown_expected=True), 193),
    ],
)
def test_what_the_vehicle_is_about_are_bits(new: Rig, vehicle: VehicleFrame, flags: int) -> None:
    new.vehicle = vehicle
    new.frame()
    assert new.values("RFRN")[0][-1] == flags


def test_arming_is_logged_once(rig: Rig) -> None:
    rig.vehicle = VehicleFrame(armed=True)
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH", "RFRN"]
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH"]


def test_trim_that_differs_in_a_sign_of_zero_is_logged(rig: Rig) -> None:
    rig.vehicle = VehicleFrame(trim_rad=(0.0, -0.0, 0.0))
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH", "RFRN"]


def test_home_is_logged_with_latitude_south_wrapped(rig: Rig) -> None:
    rig.vehicle = VehicleFrame(home=CANBERRA, eas2tas=1.5, trim_rad=(0.1, 0.2, 0.3), ekf_type=2)
    rig.frame()
    assert rig.values("RFRN") == [(3941334686, 1491652300, 58400, 1.5, 524288, 0.1, 0.2, 0.3, 2, 2, 0)]


def test_state_of_the_camera_is_logged_as_it_changes(rig: Rig) -> None:
    rig.camera = VisualOdomFrame(Vector3f(), 10, False, True)
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH", "RVOH"]


# GPS


def test_without_gps_there_are_three_empty_places(new: Rig) -> None:
    new.frame()
    records = [(name, values) for name, values in new.records if name.startswith("RGP")]
    assert records[0] == ("RGPH", (0, 0))
    assert [values for name, values in records if name == "RGPI"] == [
        (0, 0, 0, 0, 8, 0, 0, 0),
        (0, 0, 0, 0, 8, 0, 0, 1),
        (0, 0, 0, 0, 0, 0, 0, 2),
    ]
    assert [values[-2:] for name, values in records if name == "RGPJ"] == [(65535, 0), (65535, 1), (0, 2)]


def test_lag_of_a_gps_that_is_not_there_is_logged(new: Rig) -> None:
    new.log.start_frame(START_US, 0)
    new.log.sensors(SENSORS, gps_lag_s=0.1)
    assert next(values for name, values in new.records if name == "RGPI") == (0, 0, 0, 0.1, 8, 0, 0, 0)


def test_two_gps_are_logged_with_their_numbers(rig: Rig) -> None:
    first = GpsSample(5000, 3, CANBERRA, Vector3f(), 10)
    rig.all_gps = AllGps((first, replace(first, num_sats=12)), primary=1)
    rig.frame()
    assert dict(rig.records)["RGPH"] == (2, 1)
    slow = [values for name, values in rig.records if name == "RGPI"]
    assert [(values[6], values[7]) for values in slow] == [(10, 0), (12, 1)]
    assert [values[-1] for name, values in rig.records if name == "RGPJ"] == [0, 1]


def test_barometers_that_differ_are_logged_each(rig: Rig) -> None:
    rig.frame()
    baros = BaroReading(3549, 0.5, is_healthy=False), BaroReading(3549, 0.75)
    rig.sensors = replace(SENSORS, baro=(3549, 0.75), baros=baros)
    rig.frame()
    logged = [values for name, values in rig.records if name.startswith("RBR")]
    assert logged[-3:] == [(1, 2), (3549, 0.5, 0, 0), (3549, 0.75, 1, 1)]


def test_solution_of_a_gps_is_logged(rig: Rig) -> None:
    rig.gps = GpsSample(5000, 3, CANBERRA, Vector3f(1, 2, 3), 10, hdop=121, has_vertical_velocity=True)
    rig.frame()
    records = dict(rig.records)
    assert records["RGPH"] == (1, 0)
    assert records["RGPI"] == (0, 0, 0, 0.2, 1 | 8, 3, 10, 0)
    assert records["RGPJ"] == (5000, 1, 2, 3, 0, 0, 0, 0, -353632610, 1491652300, 58400, 0, 0, 121, 0)


def test_what_a_gps_knows_of_itself_is_logged_with_its_bits(rig: Rig) -> None:
    rig.gps = GpsSample(
        *(5000, 3, CANBERRA, Vector3f(), 10),
        speed_accuracy=0.25,
        horizontal_accuracy=0.5,
        vertical_accuracy=0.75,
        yaw_deg=90.0,
    )
    rig.frame()
    records = dict(rig.records)
    assert records["RGPI"][4] == 2 | 4 | 8 | 16 | 32
    assert records["RGPJ"][4:8] == (0.25, 90, 10, 5000)
    assert records["RGPJ"][11:13] == (0.5, 0.75)


def test_gps_solution_that_has_been_logged_is_not_again(rig: Rig) -> None:
    rig.gps = GpsSample(5000, 3, CANBERRA, Vector3f(), 10)
    rig.frame()
    rig.records.clear()
    rig.gps = replace(rig.gps, time_ms=5200)
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH", "RGPJ"]


# What was done


def types_of(rig: Rig) -> list[LogValue]:
    return [values[0] for values in rig.values("RFRF")]


def test_types_tell_of_initialising_and_updating(new: Rig) -> None:
    for was_initialised in (False, False, True, True, True):
        new.frame(was_initialised=was_initialised)
    assert types_of(new) == [5, 5, 13, 9]


def test_filter_that_begins_anew_goes_on_updating(rig: Rig) -> None:
    for was_initialised in (False, True, True):
        rig.frame(was_initialised=was_initialised)
    assert types_of(rig) == [9, 9, 9]


def test_writing_estimates_adds_a_bit(rig: Rig) -> None:
    rig.log.note_logged()
    rig.frame()
    rig.frame()
    assert types_of(rig) == [41, 9]


@pytest.mark.parametrize(
    ("call", "name"), [(Rig.flow, "ROFH"), (Rig.pose, "REPH"), (Rig.velocity, "REVH"), (Rig.odometry, "RBOH")]
)
def test_sample_comes_after_the_frame(rig: Rig, call: Callable[[Rig], None], name: str) -> None:
    call(rig)
    call(rig)
    assert rig.names() == ["RFRF", name]


def test_estimates_written_after_a_sample_end_the_frame_again(rig: Rig) -> None:
    rig.pose()
    rig.log.note_logged()
    rig.frame()
    assert rig.names() == ["RFRF", "REPH", "RFRF", "RFRH"]


def test_estimates_written_after_a_sample_stand_alone_in_the_types(rig: Rig) -> None:
    rig.pose()
    rig.log.note_logged()
    rig.frame()
    assert types_of(rig) == [9, 32]


# Between frames


@pytest.mark.parametrize("number", [RESET_HEIGHT_DATUM, TERRAIN_STABLE, TERRAIN_UNSTABLE])
def test_event_for_both_filters_goes_to_both(rig: Rig, number: int) -> None:
    rig.log.event(number)
    assert rig.records[1:] == [("REV2", (number,)), ("REV3", (number,))]
    assert rig.names()[0] == "RFRF"


def test_event_for_both_filters_may_go_to_this_one_first() -> None:
    rig = Rig(EKF3_BEFORE_EKF2)
    rig.frame()
    rig.log.event(RESET_HEIGHT_DATUM)
    assert [name for name, _ in rig.records[-2:]] == ["REV3", "REV2"]


@pytest.mark.parametrize("number", [REQUEST_YAW_RESET, CHECK_LANE_SWITCH, SOURCE_SET_1])
def test_event_for_this_filter_goes_to_it_alone(rig: Rig, number: int) -> None:
    rig.log.event(number)
    assert rig.records[1:] == [("REV3", (number,))]


def test_same_event_is_logged_each_time(rig: Rig) -> None:
    rig.log.event(CHECK_LANE_SWITCH)
    rig.log.event(CHECK_LANE_SWITCH)
    assert rig.names() == ["RFRF", "REV3", "REV3"]


def test_origin_does_not_end_the_frame(rig: Rig) -> None:
    rig.log.origin(CANBERRA)
    assert rig.records == [(name, (3941334686, 1491652300, 58400)) for name in ("RSO2", "RSO3")]


def test_origin_is_told_to_the_other_filter_again_after_the_next_inputs(rig: Rig) -> None:
    rig.log.origin(CANBERRA)
    rig.records.clear()
    rig.camera = VisualOdomFrame(Vector3f(), 10, False, True)
    rig.frame()
    assert rig.records[-1] == ("RSO2", (3941334686, 1491652300, 58400))
    assert rig.names() == ["RFRF", "RFRH", "RVOH", "RSO2"]
    rig.frame()
    assert rig.names() == ["RFRF", "RFRH"]


# When


def everything(rig: Rig) -> None:
    rig.frame()
    rig.pose()
    rig.log.note_logged()
    rig.log.event(RESET_HEIGHT_DATUM)
    rig.log.origin(CANBERRA)
    rig.frame()


def test_nothing_is_logged_while_it_is_not_wanted(new: Rig) -> None:
    new.enabled = False
    everything(new)
    assert not new.log.start_frame(0, 0)
    assert new.names() == []


def test_nothing_is_logged_before_the_first_frame(new: Rig) -> None:
    new.log.event(RESET_HEIGHT_DATUM)
    new.log.origin(CANBERRA)
    assert new.names() == []


def test_new_log_begins_with_the_end_of_the_frame_before_and_every_input(rig: Rig) -> None:
    rig.log.new_log()
    rig.frame()
    assert rig.names() == ["RFRF", *FIRST_FRAME]


def test_nothing_is_logged_between_the_opening_of_a_log_and_the_next_frame(rig: Rig) -> None:
    rig.log.new_log()
    rig.pose()
    rig.log.event(RESET_HEIGHT_DATUM)
    rig.log.origin(CANBERRA)
    assert rig.names() == []


def test_log_that_is_wanted_later_begins_with_every_input(new: Rig) -> None:
    new.enabled = False
    new.frame()
    new.enabled = True
    new.frame()
    assert new.names() == ["RFRF", *FIRST_FRAME]


def test_camera_alone_does_not_pass_for_the_first_frame(new: Rig) -> None:
    new.log.frame(new.camera)
    assert new.names() == ["RVOH"]
    new.frame()
    assert new.names() == FIRST_FRAME


def test_camera_that_was_off_in_the_first_frame_is_missing(new: Rig) -> None:
    new.camera = VisualOdomFrame(Vector3f(), 10, False, False)
    new.frame()
    assert new.names() == FIRST_FRAME[:-1]


def test_numbers_of_sensors_are_told(new: Rig) -> None:
    log = ReplayLog(new, lambda: True, SensorSet(imus=3, baros=1, compasses=1, loop_rate_hz=200))
    log.start_frame(START_US, 0)
    log.sensors(SENSORS)
    records = dict(new.records)
    assert records["RISH"] == (200, 0, 0, 0.005, 3, 3)
    assert records["RBRH"] == (0, 1)
    assert records["RMGH"] == (0.25, 1, 1, 1, 1, 0, 1, 0)
    names = new.names()
    assert [names.count(name) for name in ("RISI", "RBRI", "RMGI")] == [3, 1, 1]
