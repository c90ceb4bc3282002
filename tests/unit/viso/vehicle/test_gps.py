# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The GPS as the vehicle sees it: driver, time-out, regularity, log records and time of day."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from pymavlink.DFReader import DFReader_binary

from ap_core.clock import VirtualClock
from ap_core.location import Location
from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_core.param import ParamTable
from ap_core.vector3 import Vector3f
from ap_visualodom.ap_visualodom import make_params
from mav_handlers.wire.messages import GPS_INPUT
from viso.firmware.log_releases import GPA, GPS, OF
from viso.parameters.table import make_groups
from viso.vehicle.gps import Gps

if TYPE_CHECKING:
    from tests.unit.viso.conftest import Bench

MakeBench = Callable[..., "Bench"]

PACKET = GPS_INPUT(
    0, 0, 0, 1000, 2300, 3, 473977418, 85455938, 488.5, 0.5, 0.75, 1.0, 2.0, 3.0, 0.25, 0.5, 1.5, 11, 9000
)
NO_TIME = replace(PACKET, time_week=0)
SPECIFIED, DETECTED = "GPS 1: specified as MAV", "GPS 1: detected MAV"
# The first ms of GPS week 2300, less 18 leap seconds.
WEEK_2300_US = (315_964_800 + 2300 * 604_800 - 18) * 1_000_000


class Rig:
    """A GPS that is updated every 20 ms; what it writes and tells is kept."""

    def __init__(self, gps_type: int = 14, **params: int) -> None:
        self.clock = VirtualClock()
        self.params = ParamTable(make_groups(1, make_params()))
        for name, value in {"GPS1_TYPE": gps_type, **params}.items():
            self.params.set(name, value)
        self.texts: list[str] = []
        self.records: list[tuple[LogStructure, dict[str, Any]]] = []
        self.told_us: list[int] = []
        self.gps = Gps(self.clock, self.params, self, self, self.told_us.append)
        self.clock.set_us(3_000_000)
        self.gps.update()

    def send_text(self, severity: int, text: str) -> None:
        assert severity == 6
        self.texts.append(text)

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        structure.pack(values)
        self.records.append((structure, dict(zip(structure.fields, values, strict=True))))

    def run_ms(self, duration_ms: int) -> None:
        for _ in range(duration_ms // 20):
            self.clock.set_us(self.clock.micros64() + 20_000)
            self.gps.update()

    def hear(self, packet: GPS_INPUT = PACKET) -> bool:
        taken = self.gps.take(packet)
        self.run_ms(20)
        return taken

    def healthy(self) -> bool:
        sample = self.gps.sample()
        assert sample is not None
        return sample.is_healthy

    def logged(self, structure: LogStructure) -> list[dict[str, Any]]:
        return [fields for kind, fields in self.records if kind is structure]


@pytest.mark.parametrize("gps_type", [0, 1, 2, 5])
def test_there_is_no_gps_unless_asked_for(gps_type: int) -> None:
    rig = Rig(gps_type)
    assert not rig.hear()
    assert rig.gps.sample() is None
    assert (rig.texts, rig.records) == ([], [])


def test_driver_is_announced_and_has_no_fix_yet() -> None:
    rig = Rig()
    sample = rig.gps.sample()
    assert sample is not None
    assert (sample.fix_type, sample.time_ms, sample.last_fix_ms) == (1, 3000, 0)
    assert rig.texts == [SPECIFIED]
    rig.run_ms(100)
    assert rig.texts == [SPECIFIED]


def test_first_data_is_announced_once() -> None:
    rig = Rig()
    rig.hear()
    rig.hear()
    assert rig.texts == [SPECIFIED, DETECTED]


def test_driver_comes_when_the_type_is_set_later() -> None:
    rig = Rig(gps_type=1)
    rig.params.set("GPS1_TYPE", 14)
    rig.run_ms(20)
    assert rig.hear()


def test_message_before_the_first_update_is_lost() -> None:
    rig = Rig(gps_type=1)
    rig.params.set("GPS1_TYPE", 14)
    assert not rig.gps.take(PACKET)


def test_solution_is_told_with_all_that_it_has() -> None:
    rig = Rig()
    rig.hear()
    sample = rig.gps.sample()
    assert sample is not None
    assert (sample.fix_type, sample.num_sats, sample.hdop, sample.vdop) == (3, 11, 50, 75)
    assert sample.location == Location(473977418, 85455938, 48850)
    assert sample.vel_ned == Vector3f(1, 2, 3)
    assert sample.has_vertical_velocity
    assert (sample.speed_accuracy, sample.horizontal_accuracy, sample.vertical_accuracy) == (0.25, 0.5, 1.5)
    assert sample.yaw_deg == 90


def test_solution_without_gps_time_has_the_time_of_the_update() -> None:
    rig = Rig()
    rig.hear(NO_TIME)
    sample = rig.gps.sample()
    assert sample is not None
    assert (sample.time_ms, sample.last_fix_ms) == (3020, 3020)


def test_solution_with_gps_time_has_the_corrected_one() -> None:
    rig = Rig()
    rig.gps.take(PACKET)
    rig.run_ms(320)
    rig.gps.take(replace(PACKET, time_week_ms=1200))
    rig.run_ms(20)
    sample = rig.gps.sample()
    assert sample is not None
    assert sample.time_ms == 3200


def test_last_fix_remains_when_the_fix_is_lost() -> None:
    rig = Rig()
    rig.hear(replace(NO_TIME, fix_type=2))
    rig.hear(replace(NO_TIME, fix_type=1))
    sample = rig.gps.sample()
    assert sample is not None
    assert (sample.time_ms, sample.last_fix_ms) == (3040, 3020)


def test_solution_is_the_newest_at_once() -> None:
    rig = Rig()
    rig.hear()
    before = rig.gps.sample()
    rig.gps.take(replace(PACKET, satellites_visible=PACKET.satellites_visible + 1))
    after = rig.gps.sample()
    assert before is not None
    assert after is not None
    assert after.num_sats == before.num_sats + 1


def test_gps_that_is_silent_for_more_than_4_seconds_has_no_fix() -> None:
    rig = Rig()
    rig.hear(NO_TIME)
    rig.run_ms(4000)
    before = rig.gps.sample()
    rig.run_ms(20)
    after = rig.gps.sample()
    assert before is not None
    assert after is not None
    assert before.fix_type == 3
    assert (after.fix_type, after.time_ms, after.location) == (1, 7040, Location(0, 0, 0))
    assert (after.hdop, after.yaw_deg, after.has_vertical_velocity) == (65535, None, False)


def test_gps_that_speaks_again_is_announced_again() -> None:
    rig = Rig()
    rig.hear()
    rig.run_ms(4100)
    rig.hear()
    assert rig.texts == [SPECIFIED, DETECTED, DETECTED]


def test_type_0_takes_the_gps_away_and_14_brings_it_back() -> None:
    rig = Rig()
    rig.hear()
    rig.params.set("GPS1_TYPE", 0)
    assert not rig.hear()
    assert rig.gps.sample() is None
    rig.params.set("GPS1_TYPE", 14)
    assert rig.hear()
    assert rig.gps.sample() is not None


def test_driver_goes_with_its_silence_when_the_type_is_another_by_then() -> None:
    rig = Rig()
    rig.hear()
    rig.params.set("GPS1_TYPE", 1)
    assert rig.hear()
    rig.run_ms(4100)
    assert not rig.hear()
    assert rig.gps.sample() is None


# Log


def test_each_solution_is_logged() -> None:
    rig = Rig()
    rig.hear(NO_TIME)
    rig.run_ms(180)
    rig.hear(NO_TIME)
    assert [fields["TimeUS"] for fields in rig.logged(GPS)] == [3_020_000, 3_220_000]
    fields = rig.logged(GPS)[0]
    assert (fields["I"], fields["Status"], fields["GMS"], fields["GWk"], fields["NSats"]) == (0, 3, 1000, 0, 11)
    assert (fields["HDop"], fields["Lat"], fields["Lng"], fields["Alt"]) == (50, 473977418, 85455938, 48850)
    assert (fields["Spd"], fields["GCrs"]) == (pytest.approx(5**0.5), pytest.approx(63.434949))
    assert (fields["VZ"], fields["Yaw"], fields["U"]) == (3, 90, 1)


def test_accuracies_are_logged_beside_it() -> None:
    rig = Rig()
    rig.hear(NO_TIME)
    rig.run_ms(180)
    rig.hear(NO_TIME)
    fields = rig.logged(GPA)[-1]
    assert (fields["VDop"], fields["HAcc"], fields["VAcc"], fields["SAcc"]) == (75, 50, 150, 25)
    assert (fields["YAcc"], fields["VV"], fields["SMS"], fields["Delta"]) == (10, 1, 3220, 200)
    assert (fields["AEl"], fields["RTCMFU"], fields["RTCMFD"]) == (-(1 << 31), 0, 0)


def test_what_is_unknown_is_logged_as_0() -> None:
    rig = Rig()
    rig.hear(replace(PACKET, ignore_flags=0xFF, yaw=0))
    fields = rig.logged(GPA)[0]
    assert (fields["HAcc"], fields["VAcc"], fields["SAcc"], fields["YAcc"], fields["VV"]) == (0, 0, 0, 0, 0)
    assert (fields["VDop"], rig.logged(GPS)[0]["HDop"], rig.logged(GPS)[0]["Yaw"]) == (65535, 65535, 0)


@pytest.mark.parametrize(
    ("accuracy_m", "logged"),
    [(655.34, 65534), (655.4, 65535), (1e9, 65535), (3.4e38, 65535), (float("nan"), 65535), (-0.5, 65486)],
)
def test_accuracy_that_does_not_fit_is_logged_as_the_firmware_converts_it(accuracy_m: float, logged: int) -> None:
    rig = Rig()
    rig.hear(replace(PACKET, horiz_accuracy=accuracy_m))
    assert rig.logged(GPA)[0]["HAcc"] == logged


def test_time_out_is_logged_once() -> None:
    rig = Rig()
    rig.hear(NO_TIME)
    rig.run_ms(4100)
    assert [fields["Status"] for fields in rig.logged(GPS)] == [3, 1]
    assert rig.logged(GPA)[-1]["Delta"] == 4000


def test_nothing_is_logged_without_the_bit_for_gps() -> None:
    rig = Rig(LOG_BITMASK=180222 & ~4)
    rig.hear()
    assert rig.records == []


# Regularity


def test_gps_of_5_hz_is_healthy() -> None:
    rig = Rig()
    for _ in range(5):
        rig.hear(NO_TIME)
        rig.run_ms(180)
    assert rig.healthy()


@pytest.mark.parametrize(("late", "healthy"), [(1, True), (2, False)])
def test_two_late_messages_in_a_row_are_too_many(late: int, healthy: bool) -> None:
    rig = Rig()
    rig.hear(NO_TIME)
    for _ in range(late):
        rig.run_ms(240)
        rig.hear(NO_TIME)
    assert rig.healthy() is healthy


def test_gps_that_is_always_a_little_late_is_not_healthy() -> None:
    rig = Rig()
    rig.run_ms(220)
    for _ in range(200):
        rig.hear(NO_TIME)
        rig.run_ms(220)
    assert not rig.healthy()


def test_message_in_time_makes_good_for_late_ones() -> None:
    rig = Rig()
    for pause_ms in (0, 240, 240, 0, 0, 0):
        rig.run_ms(pause_ms)
        rig.hear(NO_TIME)
    assert rig.healthy()


# Time of day


def test_3d_fix_tells_the_time_of_day() -> None:
    rig = Rig()
    rig.hear()
    # Made at 3000 ms, by the corrected time; told 20 ms later.
    assert rig.told_us == [WEEK_2300_US + 1_000_000 + 20_000]


def test_time_of_day_runs_on_between_solutions() -> None:
    rig = Rig()
    rig.hear()
    rig.run_ms(40)
    assert [time_us - rig.told_us[0] for time_us in rig.told_us] == [0, 20_000, 40_000]


@pytest.mark.parametrize("packet", [NO_TIME, replace(PACKET, fix_type=2)])
def test_time_of_day_needs_a_week_and_a_3d_fix(packet: GPS_INPUT) -> None:
    rig = Rig()
    rig.hear(packet)
    assert rig.told_us == []


@pytest.mark.parametrize(("gps_type", "lag_s"), [(0, 0.0), (1, 0.1), (14, 0.2), (2, 0.2)])
def test_lag_is_the_drivers_or_what_the_firmware_takes_without_one(gps_type: int, lag_s: float) -> None:
    assert Rig(gps_type).gps.lag_s() == lag_s


# In the vehicle


def test_estimator_and_endpoint_are_given_the_same(make_bench: "MakeBench") -> None:
    bench = make_bench(GPS1_TYPE=14)
    bench.send(PACKET)
    bench.run_for(0.025)
    sample = bench.vehicle.ahrs.state.gps.used
    assert sample is not None
    assert sample.num_sats == 11
    assert bench.vehicle.gps.sample() == sample


def test_log_readers_see_the_solution_and_take_the_time_from_it(make_bench: "MakeBench", tmp_path: Path) -> None:
    bench = make_bench(GPS1_TYPE=14)
    bench.send(PACKET)
    bench.run_for(0.02)
    bench.vehicle.close()
    path = tmp_path / "1.BIN"
    path.write_bytes(bench.logs[0].data)
    with DFReader_binary(str(path)) as log:
        record = log.recv_match(type="GPS")
        assert (record.Lat, record.Lng, record.Alt) == pytest.approx((47.3977418, 8.5455938, 488.5))
        assert (record.HDop, record.NSats, record.GWk, record.GMS) == (0.5, 11, 2300, 1000)
        assert record._timestamp * 1e6 == pytest.approx(WEEK_2300_US + 1_000_000, abs=100_000)


def place_of(bench: "Bench") -> tuple[float, ...]:
    """Return where the estimator is, m NED from its origin."""
    position = bench.vehicle.ahrs.get_relative_position_NED_origin_float()
    assert position is not None
    return tuple(float(value) for value in position.to_tuple())


def hear(bench: "Bench", until_s: float, packet: GPS_INPUT) -> None:
    """Send solutions five times per second."""
    while bench.scheduler.now_us < until_s * 1e6:
        bench.send(packet)
        bench.run_for(0.2)


@pytest.mark.slow
def test_estimator_navigates_by_it_and_changes_over_to_external_navigation_and_back(make_bench: "MakeBench") -> None:
    good = replace(PACKET, vn=0.0, ve=0.0, vd=0.0, horiz_accuracy=0.5, vert_accuracy=0.5, speed_accuracy=0.3)
    bench = make_bench(GPS1_TYPE=14, VISO_TYPE=1, EK3_SRC2_POSXY=6, EK3_SRC2_POSZ=6, EK3_SRC2_YAW=6)
    hear(bench, 41.0, good)
    assert bench.vehicle.ahrs.origin() is not None
    assert "EKF3 IMU0 is using GPS" not in [text for _, _, text in bench.texts]
    hear(bench, 42.0, good)
    assert "EKF3 IMU0 is using GPS" in [text for _, _, text in bench.texts]
    hear(bench, 46.0, replace(good, lat=good.lat + 90))  # a metre north
    assert place_of(bench) == pytest.approx((1, 0, 0), abs=0.2)

    bench.set("LOG_REPLAY", 1)
    bench.run_for(0.1)
    bench.texts.clear()
    assert bench.command(42007, 2) == 0
    bench.see(4.0, x=5.0, y=-3.0, z=-2.0)
    assert [text for _, _, text in bench.texts] == ["EKF3 IMU0 yaw aligned", "EKF3 IMU1 yaw aligned"]
    assert place_of(bench) == pytest.approx((5, -3, -2), abs=0.1)
    assert {"Id": 86} in bench.written("EV")
    assert {"Event": 14} in bench.written("REV3")
    assert {row["SS"] for row in bench.written("XKFS")[-4:]} == {1}

    bench.texts.clear()
    assert bench.command(42007, 1) == 0
    hear(bench, 51.0, good)
    assert [text for _, _, text in bench.texts if "EKF3" in text] == []
    assert place_of(bench) == pytest.approx((0, 0, -2), abs=0.2)
    assert {"Id": 85} in bench.written("EV")
    assert {"Event": 13} in bench.written("REV3")


@pytest.mark.parametrize(("structure", "number", "length"), [(GPS, 94, 51), (GPA, 95, 39), (OF, 180, 28)])
def test_records_have_the_firmwares_numbers_and_lengths(structure: LogStructure, number: int, length: int) -> None:
    assert (structure.msg_type, structure.length) == (number, length)
