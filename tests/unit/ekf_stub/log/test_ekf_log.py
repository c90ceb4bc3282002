# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the estimator's records are written, for which cores, in which order, and what they hold."""

import math
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ekf_stub.log.ekf_log import EkfLog
from ekf_stub.log.reporting import UNINITIALISED
from ekf_stub.reports import CoreReport, GsfReport, OdometryReport
from tests.unit.ekf_stub.filter_rig import FilterRig, standing

PERIOD_US = 99_960  # of the recorded logs
STREAM = ["XKF4", "XKF1", "XKF2", "XKF3", "XKFS", "XKQ"]
PRIMARY_STREAM = ["XKF4", "XKF1", "XKF2", "XKF3", "XKF5", "XKFS", "XKQ"]
REPORT = replace(UNINITIALISED, faults=0)


class Rig:
    """A log of estimates, and the parameters that it asks for."""

    def __init__(self, cores: tuple[int, ...] = (0, 1), primary: int = 0, **params: int) -> None:
        self.params = {"LOG_BITMASK": 0, "EK3_LOG_LEVEL": 0, **params}
        self.records: list[tuple[str, dict[str, Any]]] = []
        self.log = EkfLog(self, self.params.__getitem__, cores, lambda: primary)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Read back what a reader would find."""
        body = structure.pack(values)[3:]
        codes = {"Q": "Q", "B": "B", "b": "b", "h": "h", "H": "H", "I": "I", "c": "h", "C": "H", "e": "i", "f": "f"}
        found = struct.unpack("<" + "".join(codes[char] for char in structure.format), body)
        self.records.append((structure.name, dict(zip(structure.fields, found, strict=True))))

    def stream(self, report: CoreReport = REPORT, now_us: int = 0) -> list[str]:
        """Write what streams, and return its names in order."""
        self.records.clear()
        self.log.write_streaming(report, now_us)
        return [name for name, _ in self.records]

    def fields(self, name: str, report: CoreReport, now_us: int = 0) -> dict[str, Any]:
        """Return the first record of a name."""
        self.stream(report, now_us)
        return next(fields for found, fields in self.records if found == name)


def odometry(recalled: int) -> CoreReport:
    return replace(REPORT, odometry=OdometryReport(recalled, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))


# Order and cores


def test_primary_core_comes_with_its_own_records_then_the_other() -> None:
    rig = Rig()
    rig.stream(now_us=1_000_000)
    assert rig.stream(now_us=1_000_000 + PERIOD_US) == [*PRIMARY_STREAM, *STREAM]
    assert [fields["C"] for _, fields in rig.records] == [0] * len(PRIMARY_STREAM) + [1] * len(STREAM)
    assert {fields["TimeUS"] for _, fields in rig.records} == {1_000_000 + PERIOD_US}


def test_only_core_is_the_primary_one() -> None:
    rig = Rig(cores=(0,))
    assert rig.stream(now_us=0) == PRIMARY_STREAM


def test_another_core_may_be_the_primary_one() -> None:
    rig = Rig(primary=1)
    assert rig.stream() == [*STREAM, *PRIMARY_STREAM]
    assert {fields["PI"] for name, fields in rig.records if name == "XKF4"} == {1}


@pytest.mark.parametrize(("level", "names"), [(1, ["XKF4", "XKF4"]), (2, ["XKF4", "XKF4"]), (3, [])])
def test_log_level_leaves_out_what_comes_later(level: int, names: list[str]) -> None:
    assert Rig(EK3_LOG_LEVEL=level).stream(odometry(1), now_us=1_000_000) == names


# Rates


def test_covariance_comes_with_every_fifth_of_ten_a_second() -> None:
    # As in the recorded logs, of which the first record is at 3.549 s.
    rig, times_us = Rig(), [3_549_413 + PERIOD_US * number for number in range(11)]
    with_covariance = [time_us for time_us in times_us if "XKV1" in rig.stream(now_us=time_us)]
    assert with_covariance == times_us[::5]


def test_covariance_of_the_primary_core_ends_its_records() -> None:
    rig = Rig()
    assert rig.stream(odometry(1), now_us=1_000_000) == [*PRIMARY_STREAM, "XKFD", "XKV1", "XKV2", *STREAM]


def test_odometry_is_written_once_for_each_sample_and_core() -> None:
    rig = Rig()
    counts = [rig.stream(odometry(recalled)).count("XKFD") for recalled in (1, 1, 2, 7, 7)]
    assert counts == [1, 0, 1, 1, 0]


def test_odometry_is_written_again_after_the_filter_began_anew() -> None:
    rig = Rig()
    assert [rig.stream(odometry(recalled)).count("XKFD") for recalled in (5, 1)] == [1, 1]


def passes(rig: Rig, vehicle: FilterRig, count: int) -> list[tuple[str, int, int]]:
    """Run passes of a vehicle; return name, time and core of the records that came of them."""
    rig.records.clear()
    for _ in range(count):
        vehicle.one_pass()
        rig.log.log_pass(vehicle.core, vehicle.now_us)
    return [(name, fields["TimeUS"], fields["C"]) for name, fields in rig.records]


def test_tilt_comes_in_the_first_step_after_more_than_half_a_second() -> None:
    rig = Rig(EK3_LOG_LEVEL=3)
    written = passes(rig, standing(), 1000)
    times_us = [time_us for name, time_us, core in written if name == "XKTV" and core == 0]
    # In steps of 12.5 ms, by times in ms.
    assert {after - before for before, after in pairwise(times_us)} == {512_500}
    assert Counter(core for name, _, core in written if name == "XKTV") == {0: len(times_us), 1: len(times_us)}


def test_answer_about_standing_still_comes_every_200_ms_whatever_the_level() -> None:
    written = passes(Rig(EK3_LOG_LEVEL=3), standing(), 400)
    times_us = [time_us for name, time_us, core in written if name == "XKFM" and core == 0]
    assert len(times_us) in (4, 5)
    assert {after - before for before, after in pairwise(times_us)} <= {202_500, 200_000}


def test_changed_answer_about_standing_still_comes_at_once() -> None:
    # GIVEN a vehicle that stands still; WHEN it is turned
    rig, vehicle = Rig(), standing()
    assert vehicle.core.stillness.is_still
    vehicle.yaw_rate = 0.5
    # THEN the answer changes within less than the usual time, and both cores say so
    before_us = vehicle.now_us
    while vehicle.core.stillness.is_still:
        passes(rig, vehicle, 1)
    assert vehicle.now_us - before_us < 200_000
    answers = [(fields["C"], fields["OGNM"]) for name, fields in rig.records if name == "XKFM"]
    assert answers == [(0, 0), (1, 0)]


def test_nothing_about_standing_still_while_the_test_does_not_run() -> None:
    vehicle = standing()
    vehicle.arm()
    vehicle.run(0.1)
    assert [name for name, _, _ in passes(Rig(), vehicle, 100) if name == "XKFM"] == []


def test_answer_counts_as_changed_after_a_time_without_a_test() -> None:
    vehicle = standing()
    vehicle.arm()
    vehicle.run(0.01)
    vehicle.arm(False)
    rig = Rig()
    while not vehicle.core.stillness.is_still:
        passes(rig, vehicle, 1)
    assert [fields["OGNM"] for name, fields in rig.records if name == "XKFM"] == [1, 1]


def test_clock_that_wraps_leaves_no_gap() -> None:
    rig, wrap_us = Rig(cores=(0,)), (1 << 32) * 1000
    times_us = [wrap_us - 400_000 + PERIOD_US * number for number in range(11)]
    assert sum("XKV1" in rig.stream(now_us=time_us) for time_us in times_us) == 3


# Contents


def test_values_are_cut_towards_zero() -> None:
    report = replace(REPORT, vel_innovation=(0.0199, -0.0199, 1.0), accel_bias=(-0.009, 0.009, 0.01))
    assert [Rig().fields("XKF3", report)[label] for label in ("IVN", "IVE", "IVD")] == [1, -1, 100]
    assert [Rig().fields("XKF2", report)[label] for label in ("AX", "AY", "AZ")] == [0, 0, 1]


def test_values_are_scaled_in_single_precision() -> None:
    # 0.29 * 100 is 28.999999999999996 in double precision, and 29 in single.
    assert Rig().fields("XKF3", replace(REPORT, pos_innovation=(0.29, 0.57, 0.58)))["IPN"] == 29


def test_values_beyond_the_field_wrap() -> None:
    report = replace(REPORT, pos_innovation=(327.67, 327.69, -400.0))
    assert [Rig().fields("XKF3", report)[label] for label in ("IPN", "IPE", "IPD")] == [32767, -32767, 25536]


@pytest.mark.parametrize("number", [1e20, 1e38, math.inf, -math.inf, math.nan])
def test_values_beyond_every_integer_are_zero(number: float) -> None:
    report = replace(REPORT, vel_innovation=(number, 0.0, 0.0), yaw_innovation=number, mag_innovation=(number,) * 3)
    found = Rig().fields("XKF3", report)
    assert [found[label] for label in ("IVN", "IMX", "IYAW")] == [0, 0, 0]


@pytest.mark.parametrize(("ratio", "score"), [(1e38, pytest.approx(1e38)), (1e40, math.inf), (math.inf, math.inf)])
def test_score_beyond_single_precision_is_infinite(ratio: float, score: float) -> None:
    assert Rig().fields("XKF3", replace(REPORT, error_score=ratio))["ErSc"] == score
    assert Rig().fields("XKF4", replace(REPORT, pos_ratio=ratio))["SP"] == 0


@pytest.mark.parametrize(("yaw_deg", "centidegrees"), [(0, 0), (90, 9000), (-90, 27000), (180, 18000), (-0.5, 35950)])
def test_yaw_is_written_as_a_heading(yaw_deg: float, centidegrees: int) -> None:
    found = Rig().fields("XKF1", replace(REPORT, rpy_rad=(0, 0, math.radians(yaw_deg))))["Yaw"]
    assert found == pytest.approx(centidegrees, abs=1)


def test_yaw_a_hair_west_of_north_is_a_full_turn() -> None:
    assert Rig().fields("XKF1", replace(REPORT, rpy_rad=(0, 0, -1e-9)))["Yaw"] == 36000


def test_outputs_of_a_moment() -> None:
    report = replace(
        REPORT,
        rpy_rad=(math.radians(1.5), math.radians(-2.25), 0.0),
        vel_ned=(1.0, 2.0, 3.0),
        height_rate=3.5,
        pos_ned=(4.0, 5.0, -6.0),
        gyro_bias=(math.radians(0.127), math.radians(-0.253), 0.0),
        origin_alt_cm=58399,
    )
    fields = Rig().fields("XKF1", report)
    assert [fields[label] for label in ("Roll", "Pitch", "GX", "GY", "GZ", "OH")] == [150, -225, 12, -25, 0, 58399]
    assert [fields[label] for label in ("VN", "VE", "VD", "dPD", "PN", "PE", "PD")] == [1, 2, 3, 3.5, 4, 5, -6]


def test_ratios_are_written_as_their_roots_and_yaw_with_the_compass() -> None:
    report = replace(REPORT, vel_ratio=0.04, pos_ratio=4.0, height_ratio=0.25, mag_ratio=0.01, yaw_ratio=0.09)
    fields = Rig().fields("XKF4", report)
    assert [fields[label] for label in ("SV", "SP", "SH", "SM", "SVT")] == [20, 200, 50, 30, 0]


def test_covariance_comes_with_the_first_records_of_a_core_that_becomes_the_primary_one() -> None:
    rig, primary = Rig(), 0
    log = EkfLog(rig, rig.params.__getitem__, (1,), lambda: primary)
    for now_us in range(1_000_000, 2_100_000, PERIOD_US):
        primary = int(now_us > 1_700_000)
        log.write_streaming(REPORT, now_us)
    found = [fields["TimeUS"] for name, fields in rig.records if name == "XKV1"]
    assert found == [1_000_000 + 8 * PERIOD_US]
    assert [fields["PI"] for name, fields in rig.records if name == "XKF4"] == [0] * 8 + [1] * 4


def test_scores_against_other_cores_are_written() -> None:
    fields = Rig().fields("XKF3", replace(REPORT, error_score=2.25, relative_error=-0.5))
    assert (fields["ErSc"], fields["RErr"]) == (2.25, -0.5)


def test_health_of_a_moment() -> None:
    report = replace(REPORT, faults=1, timeouts=49, flags=0x12027, tilt_error_rad=0.5, moved_ne=(4.0, -1.0))
    fields = Rig().fields("XKF4", report)
    labels = ("FS", "TS", "SS", "GPS", "PI", "errRP", "OFN", "OFE")
    assert [fields[label] for label in labels] == [1, 49, 0x12027, 0, 0, 0.5, 4.0, -1.0]


def test_tracking_errors_attitude_and_source_set() -> None:
    report = replace(
        REPORT, angle_error=0.25, vel_error=0.5, pos_error=0.75, quat_wxyz=(0.5, 0.5, -0.5, 0.5), source_set=2
    )
    assert list(Rig().fields("XKF5", report).values())[-3:] == [0.25, 0.5, 0.75]
    assert list(Rig().fields("XKQ", report).values())[2:] == [0.5, 0.5, -0.5, 0.5]
    assert Rig().fields("XKFS", report)["SS"] == 2


def test_covariance_is_split_after_twelve_states() -> None:
    report = replace(REPORT, variances=tuple(map(float, range(24))))
    rig = Rig()
    assert list(rig.fields("XKV1", report, 1_000_000).values())[2:] == list(range(12))
    assert list(dict(rig.records)["XKV2"].values())[2:] == list(range(12, 24))


def test_innovations_of_odometry() -> None:
    assert list(Rig().fields("XKFD", odometry(1)).values())[2:] == [1, 2, 3, 4, 5, 6]


def test_tilt_is_written_as_a_variance() -> None:
    rig, vehicle = Rig(cores=(0,)), standing()
    while not (vehicle.core.logs_tilt and rig.records):
        passes(rig, vehicle, 1)
    variance = pytest.approx(vehicle.core.state.predicted_tilt_var)  # as single precision has it
    time_us = vehicle.now_us
    tilts = [record for record in rig.records if record[0] == "XKTV"]
    assert tilts == [("XKTV", {"TimeUS": time_us, "C": 0, "TVS": variance, "TVD": variance})]


def test_core_without_a_state_says_so_and_nothing_else() -> None:
    # What the recorded logs hold before the filter has begun.
    rig = Rig(cores=(0,))
    fields = rig.fields("XKF4", UNINITIALISED)
    assert {label: value for label, value in fields.items() if value} == {"FS": 128}
    assert dict(rig.records)["XKQ"] == {"TimeUS": 0, "C": 0, "Q1": 1.0, "Q2": 0.0, "Q3": 0.0, "Q4": 0.0}


GSF = GsfReport(
    -0.5 * math.pi,
    math.radians(4.0),
    (0.0, -math.pi / 6, 0.25 * math.pi, 0.5 * math.pi, 0.75 * math.pi),
    (0.5, 0.125, 0.125, 0.125, 0.125),
    (1.0, 2.0, 3.0, 4.0, 5.0),
    (-1.0, -2.0, -3.0, -4.0, -5.0),
)


@pytest.mark.parametrize(("level", "names"), [
    (0, ["XKF4", "XKY0", "XKY1", "XKF1"]),
    (1, ["XKF4"]),
    (2, ["XKF4", "XKY0", "XKY1"]),
    (3, []),
])  # fmt: skip
def test_yaw_by_gps_is_logged_as_long_as_more_than_health_is(level: int, names: list[str]) -> None:
    rig = Rig((0,), EK3_LOG_LEVEL=level)
    assert rig.stream(replace(REPORT, gsf=GSF))[:4] == names


def test_yaw_by_gps_in_degrees() -> None:
    rig = Rig()
    assert list(rig.fields("XKY0", replace(REPORT, gsf=GSF)).values())[2:] == pytest.approx(
        [270, 2, 0, 330, 45, 90, 135, *GSF.weights]
    )
    assert list(dict(rig.records)["XKY1"].values())[2:] == [1, 2, 3, 4, 5, -1, -2, -3, -4, -5]
