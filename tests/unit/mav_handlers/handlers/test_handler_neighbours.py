# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of other sensors and programs, beside external navigation."""

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from ap_core.verdict import Verdict, VerdictKind
from mav_handlers.senders.sys_status import SENSOR_GPS, SENSOR_LASER_POSITION, SENSOR_OPTICAL_FLOW, sensor_bits
from mav_handlers.verdicts import (
    ADSB_OFF,
    GPS_NOT_MAVLINK,
    GPS_OTHER_INSTANCE,
    HANDLED,
    NO_FLOW_SENSOR,
    NO_HANDLER,
    NO_PRECISION_LANDING,
    NO_RANGEFINDER,
)
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import (
    ADSB_VEHICLE,
    DISTANCE_SENSOR,
    GLOBAL_POSITION_INT,
    GPS_INPUT,
    HEARTBEAT,
    LANDING_TARGET,
    NAMED_VALUE_FLOAT,
    OPTICAL_FLOW,
    SYSTEM_TIME,
    VISION_POSITION_ESTIMATE,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

SOLUTION = GPS_INPUT(
    0, 0, 0, 1000, 2300, 3, 473977418, 85455938, 488.5, 0.5, 0.75, 1.0, 2.0, 3.0, 0.25, 0.5, 1.5, 11, 9000
)
FLOW = OPTICAL_FLOW(0, 0, 100, -50, 0.0, 0.0, 200, 1.0)
AIRCRAFT = ADSB_VEHICLE(0x4B1234, 473900000, 85400000, 0, 1_500_000, 9000, 12_000, -200, "SWR123", 3, 1, 3, 7000)
TARGET = LANDING_TARGET(1, 0, 12, 0.1, 0.2, 3.0, 0.0, 0.0)
OTHER_VEHICLE = GLOBAL_POSITION_INT(1, 473900000, 85400000, 500_000, 10_000, 0, 0, 0, 0)
DISTANCE = DISTANCE_SENSOR(0, 10, 1000, 250, 0, 0, 25, 0)
WEEK_2300_US = (315_964_800 + 2300 * 604_800 - 18) * 1_000_000


@pytest.fixture
def filter_starts() -> bool:
    return False


def pose(usec: int) -> VISION_POSITION_ESTIMATE:
    return VISION_POSITION_ESTIMATE(usec, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class TestGpsInput:
    """GPS_INPUT."""

    def test_it_is_dropped_without_a_gps_that_takes_it(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(SOLUTION) is GPS_NOT_MAVLINK
        assert bench.vehicle.gps.sample() is None

    def test_it_becomes_the_gps_of_the_vehicle(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14)
        assert bench.client.tell(SOLUTION) is HANDLED
        bench.run_ms(20)
        sample = bench.vehicle.gps.sample()
        assert sample is not None
        assert (sample.fix_type, sample.num_sats, sample.location.alt_cm) == (3, 11, 48850)
        assert [record["NSats"] for record in bench.logged("GPS")] == [11]
        assert [record["HAcc"] for record in bench.logged("GPA")] == [50]

    def test_second_gps_is_nobodys(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14)
        assert bench.client.tell(replace(SOLUTION, gps_id=1)) is GPS_OTHER_INSTANCE
        bench.run_ms(20)
        assert bench.logged("GPS") == []

    def test_second_gps_takes_it_if_that_is_a_mavlink_gps(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=0, GPS2_TYPE=14)
        assert bench.client.tell(replace(SOLUTION, gps_id=1)) is HANDLED
        assert bench.client.tell(SOLUTION) is GPS_NOT_MAVLINK
        bench.run_ms(40)
        assert [record["I"] for record in bench.logged("GPS")] == [1]
        sample = bench.vehicle.gps.sample()
        assert sample is not None
        assert sample.num_sats == 11

    def test_it_is_dropped_while_booting(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14, until_ms=1000)
        assert bench.client.tell(SOLUTION) is GPS_NOT_MAVLINK

    def test_gps_is_announced(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14, until_ms=0)
        bench.client.tell(HEARTBEAT(6, 8, 0, 0, 4, 3))
        bench.run_ms(4000)
        bench.client.tell(SOLUTION)
        bench.run_ms(50)
        assert [text for text in bench.client.read_texts() if text.startswith("GPS")] == [
            "GPS 1: specified as MAV",
            "GPS 1: detected MAV",
        ]

    def test_it_has_a_time_correction_of_its_own(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14)
        bench.client.tell(pose(7_000_000))
        bench.client.tell(SOLUTION)
        bench.run_ms(100)
        bench.client.tell(pose(7_100_000))
        assert [call.timeStamp_ms for call in bench.poses] == [5000, 5100]

    def test_late_solution_has_the_time_at_which_it_was_made(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14)
        bench.client.tell(SOLUTION)
        bench.run_ms(300)
        bench.client.tell(replace(SOLUTION, time_week_ms=1200))
        bench.run_ms(20)
        assert [record["SMS"] for record in bench.logged("GPA")] == [5000, 5200]

    def test_it_sets_the_clock(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14)
        bench.client.tell(SOLUTION)
        bench.run_ms(1000)
        assert bench.vehicle.rtc.utc_us() == WEEK_2300_US + 2_000_000

    def test_it_does_not_set_the_clock_unless_admitted(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14, BRD_RTC_TYPES=2)
        bench.client.tell(SOLUTION)
        bench.run_ms(1000)
        assert bench.vehicle.rtc.utc_us() == 0

    def test_its_time_ranks_above_that_of_clients(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14, BRD_RTC_TYPES=3)
        bench.client.tell(SOLUTION)
        bench.run_ms(20)
        bench.client.tell(SYSTEM_TIME(WEEK_2300_US + 100_000_000, 0))
        assert bench.vehicle.rtc.utc_us() == WEEK_2300_US + 1_020_000

    @pytest.mark.parametrize(("pause_ms", "healthy"), [(200, True), (260, False)])
    def test_gps_is_healthy_as_long_as_it_is_regular(
        self, make_bench: "MakeBench", pause_ms: int, healthy: bool
    ) -> None:
        bench = make_bench(GPS1_TYPE=14)
        for number in range(3):
            bench.client.tell(replace(SOLUTION, time_week_ms=1000 + pause_ms * number))
            bench.run_ms(pause_ms)
        assert bool(sensor_bits(bench.vehicle)[2] & SENSOR_GPS) is healthy

    def test_log_begins_with_the_gps(self, make_bench: "MakeBench") -> None:
        bench = make_bench(GPS1_TYPE=14, has_log=True)
        bench.vehicle.logger.close()
        bench.run_ms(10)
        assert "GPS 1: specified as MAV" in [record["Message"] for record in bench.logged("MSG")]


class TestOpticalFlow:
    """OPTICAL_FLOW."""

    def test_it_is_dropped_without_a_sensor_that_takes_it(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(FLOW) is NO_FLOW_SENSOR
        bench.run_ms(20)
        assert bench.logged("OF") == []

    def test_it_is_logged(self, make_bench: "MakeBench") -> None:
        bench = make_bench(FLOW_TYPE=5)
        assert bench.client.tell(FLOW) is HANDLED
        bench.run_ms(100)
        bench.client.tell(FLOW)
        bench.run_ms(5)
        assert [record["Qual"] for record in bench.logged("OF")] == [200, 200]
        assert float(bench.logged("OF")[1]["flowX"]) == pytest.approx(10.0)

    @pytest.mark.parametrize(("flow_type", "there"), [(0, False), (5, True)])
    def test_sensor_is_present_when_asked_for(self, make_bench: "MakeBench", flow_type: int, there: bool) -> None:
        bench = make_bench(FLOW_TYPE=flow_type)
        present, enabled, healthy = sensor_bits(bench.vehicle)
        assert (present & SENSOR_OPTICAL_FLOW != 0, enabled & SENSOR_OPTICAL_FLOW != 0) == (there, there)
        assert not healthy & SENSOR_OPTICAL_FLOW

    def test_sensor_is_healthy_while_there_is_flow(self, make_bench: "MakeBench") -> None:
        bench = make_bench(FLOW_TYPE=5)
        bench.client.tell(FLOW)
        bench.run_ms(5)
        assert sensor_bits(bench.vehicle)[2] & SENSOR_OPTICAL_FLOW
        bench.run_ms(500)
        assert not sensor_bits(bench.vehicle)[2] & SENSOR_OPTICAL_FLOW


class TestDistanceSensor:
    """DISTANCE_SENSOR."""

    def test_range_finder_that_looks_there_takes_it(self, make_bench: "MakeBench") -> None:
        bench = make_bench(RNGFND1_TYPE=10)
        assert bench.client.tell(DISTANCE) is HANDLED
        assert bench.client.tell(replace(DISTANCE, orientation=24)) is NO_RANGEFINDER

    def test_sensor_is_healthy_while_there_are_ranges_good_or_not(self, make_bench: "MakeBench") -> None:
        bench = make_bench(RNGFND1_TYPE=10)
        assert [bool(bits & SENSOR_LASER_POSITION) for bits in sensor_bits(bench.vehicle)] == [True, True, False]
        bench.client.tell(replace(DISTANCE, current_distance=5000))
        bench.run_ms(50)
        assert sensor_bits(bench.vehicle)[2] & SENSOR_LASER_POSITION
        bench.run_ms(600)
        assert not sensor_bits(bench.vehicle)[2] & SENSOR_LASER_POSITION

    def test_vehicle_without_one_has_none(self, bench: "Bench") -> None:
        assert not any(bits & SENSOR_LASER_POSITION for bits in sensor_bits(bench.vehicle))


class TestNamedValueFloat:
    """NAMED_VALUE_FLOAT."""

    @pytest.fixture
    def bench(self, make_bench: "MakeBench") -> "Bench":
        return make_bench(has_log=True)

    def test_it_is_logged_with_its_sender(self, bench: "Bench", client: "Client") -> None:
        client.codec = Codec(42, 7)
        assert client.tell(NAMED_VALUE_FLOAT(1234, "drift_rate", 0.5)) is HANDLED
        assert bench.logged("NVAL") == [
            {"TimeUS": 5_000_000, "TimeBootMS": 1234, "Name": "drift_rate", "Value": 0.5, "SSys": 42, "SCom": 7}
        ]

    def test_its_record_is_laid_out_as_the_firmwares(self, bench: "Bench", client: "Client") -> None:
        client.tell(NAMED_VALUE_FLOAT(0, "a", 0.0))
        at = bench.log.data.index(b"NVAL")
        assert bench.log.data[at + 4 : at + 84].replace(b"\0", b"") == b"QINfBBTimeUS,TimeBootMS,Name,Value,SSys,SCom"


class TestLandingTarget:
    """LANDING_TARGET."""

    def test_it_is_dropped(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(TARGET) is NO_PRECISION_LANDING

    def test_it_shares_the_links_time_correction(self, bench: "Bench", client: "Client") -> None:
        client.tell(replace(TARGET, time_usec=7_000_000))
        bench.run_ms(300)
        client.tell(pose(7_100_000))
        assert [call.timeStamp_ms for call in bench.poses] == [5100]

    def test_other_links_have_their_own(self, make_bench: "MakeBench") -> None:
        bench = make_bench(bauds=(None, None))
        bench.clients[1].tell(replace(TARGET, time_usec=7_000_000))
        bench.run_ms(300)
        bench.client.tell(pose(7_100_000))
        assert [call.timeStamp_ms for call in bench.poses] == [5300]


@pytest.mark.parametrize(("message", "verdict"), [(DISTANCE, NO_RANGEFINDER), (AIRCRAFT, ADSB_OFF)])
def test_message_for_a_sensor_that_is_not_there_is_dropped_with_its_reason(
    client: "Client", message: DISTANCE_SENSOR | ADSB_VEHICLE, verdict: Verdict
) -> None:
    assert client.tell(message) is verdict
    assert verdict.kind is VerdictKind.DROPPED


def test_place_of_another_vehicle_is_ignored(client: "Client") -> None:
    client.codec = Codec(2, 1)
    assert client.tell(OTHER_VEHICLE) is NO_HANDLER


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("message", [AIRCRAFT, OTHER_VEHICLE])
def test_aircraft_and_vehicles_are_forwarded_unchanged_to_the_other_link_alone(
    make_bench: "MakeBench", message: ADSB_VEHICLE | GLOBAL_POSITION_INT, version: int
) -> None:
    bench = make_bench(bauds=(None, None))
    sender, other = bench.clients
    other.tell(HEARTBEAT(6, 8, 0, 0, 4, 3))
    frame = Codec(200, 156, version).encode(message)
    for client in bench.clients:
        client.read()
    sender.send_bytes(frame)
    assert other.channel.take_output() == frame
    assert sender.channel.take_output() == b""
