# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The EKF origin by message and by command, and what follows."""

from typing import TYPE_CHECKING

import pytest

from mav_handlers.verdicts import HANDLED, ORIGIN_REFUSED
from mav_handlers.wire.messages import (
    GPS_GLOBAL_ORIGIN,
    HEARTBEAT,
    HOME_POSITION,
    SET_GPS_GLOBAL_ORIGIN,
    STATUSTEXT,
    Message,
)

if TYPE_CHECKING:
    from tests.unit.mav_handlers.conftest import Bench, Client, MakeBench

LAT, LNG, ALT_MM = 473_977_420, 85_455_940, 488_000
SET_ORIGIN = 611
READY_MS = 6000  # when the estimator has told all there is to tell
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
SET = SET_GPS_GLOBAL_ORIGIN(1, LAT, LNG, ALT_MM)


@pytest.fixture
def bench(make_bench: "MakeBench") -> "Bench":
    """Return a vehicle that stands at its EKF origin, and knows that it does."""
    return standing(make_bench(until_ms=READY_MS))


def standing(bench: "Bench") -> "Bench":
    vars(bench.ahrs)["get_location"] = bench.vehicle.ahrs.origin
    return bench


def shorthand(messages: list[Message]) -> list[str]:
    return [m.text if isinstance(m, STATUSTEXT) else type(m).__name__ for m in messages]


class TestMessage:
    """SET_GPS_GLOBAL_ORIGIN."""

    def test_origin_is_set(self, bench: "Bench", client: "Client") -> None:
        assert client.tell(SET) is HANDLED
        origin = bench.vehicle.ahrs.origin()
        assert origin is not None
        assert (origin.lat, origin.lng, origin.alt_cm) == (LAT, LNG, 48_800)

    def test_requester_is_told_at_once_and_the_texts_follow(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET)
        told, *texts = client.read()
        assert told == GPS_GLOBAL_ORIGIN(LAT, LNG, ALT_MM, bench.now_us)
        assert shorthand(texts) == ["EKF3 IMU0 origin set", "EKF3 IMU1 origin set"]

    def test_vehicle_that_keeps_its_origin_to_itself_tells_nobody(
        self, bench: "Bench", client: "Client", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(bench.vehicle.ahrs, "origin", lambda: None)
        assert client.tell(SET) is HANDLED
        assert client.read_of(GPS_GLOBAL_ORIGIN) == []

    def test_second_origin_is_refused_in_silence(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET)
        client.read()
        assert client.tell(SET_GPS_GLOBAL_ORIGIN(1, 1, 1, 1)) is ORIGIN_REFUSED
        assert client.read() == []
        origin = bench.vehicle.ahrs.origin()
        assert origin is not None
        assert origin.lat == LAT

    @pytest.mark.parametrize(
        ("lat", "lng"),
        [(900_000_001, 0), (-900_000_001, 0), (1, 1_800_000_001), (1, -1_800_000_001), (-(1 << 31), 1)],
    )
    def test_place_off_the_globe_is_refused(self, client: "Client", lat: int, lng: int) -> None:
        assert client.tell(SET_GPS_GLOBAL_ORIGIN(1, lat, lng, 0)) is ORIGIN_REFUSED

    @pytest.mark.parametrize(("lat", "lng"), [(900_000_000, 1_800_000_000), (-900_000_000, -1_800_000_000)])
    def test_edge_of_the_globe_is_taken(self, client: "Client", lat: int, lng: int) -> None:
        assert client.tell(SET_GPS_GLOBAL_ORIGIN(1, lat, lng, 0)) is HANDLED

    def test_all_zero_is_refused(self, client: "Client") -> None:
        assert client.tell(SET_GPS_GLOBAL_ORIGIN(1, 0, 0, 0)) is ORIGIN_REFUSED

    def test_zero_place_with_an_altitude_is_taken(self, client: "Client") -> None:
        assert client.tell(SET_GPS_GLOBAL_ORIGIN(1, 0, 0, 10)) is HANDLED

    def test_origin_before_the_estimator_runs_is_refused(self, make_bench: "MakeBench") -> None:
        bench = make_bench(until_ms=3000)
        assert bench.client.tell(SET) is ORIGIN_REFUSED

    @pytest.mark.parametrize(
        ("altitude_mm", "alt_cm"), [(19, 1), (-19, -1), (123_456_789, 12_345_679), (2_147_483_647, 214_748_368)]
    )
    def test_altitude_is_truncated_and_has_the_precision_of_float32(
        self, bench: "Bench", client: "Client", altitude_mm: int, alt_cm: int
    ) -> None:
        client.tell(SET_GPS_GLOBAL_ORIGIN(1, LAT, LNG, altitude_mm))
        origin = bench.vehicle.ahrs.origin()
        assert origin is not None
        assert origin.alt_cm == alt_cm

    def test_highest_altitude_there_is_does_not_break_the_link(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET_GPS_GLOBAL_ORIGIN(1, LAT, LNG, (1 << 31) - 1))
        bench.run_ms(10)
        assert len(client.read_of(GPS_GLOBAL_ORIGIN)) == 2


class TestConsequences:
    """Texts, home, and who is told."""

    def test_requester_gets_origin_then_the_texts_then_origin_and_home(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET)
        bench.run_ms(10)
        assert shorthand(client.read()) == [
            "GPS_GLOBAL_ORIGIN",
            "EKF3 IMU0 origin set",
            "EKF3 IMU1 origin set",
            "GPS_GLOBAL_ORIGIN",
            "HOME_POSITION",
            "Field Elevation Set: 488m",
        ]

    def test_every_link_is_told_of_home_and_origin(self, make_bench: "MakeBench") -> None:
        bench = standing(make_bench(until_ms=READY_MS, bauds=(None, None, None)))
        bench.clients[0].tell(SET)
        bench.run_ms(10)
        for silent in bench.clients[1:]:
            assert shorthand(silent.read()) == ["GPS_GLOBAL_ORIGIN", "HOME_POSITION"]

    def test_each_core_says_so(self, make_bench: "MakeBench") -> None:
        bench = make_bench(EK3_IMU_MASK=1)
        bench.client.tell(SET)
        bench.run_ms(10)
        assert bench.client.read_texts()[0:2] == ["EKF3 IMU0 origin set", "Field Elevation Set: 488m"]

    def test_field_elevation_is_in_whole_metres(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET_GPS_GLOBAL_ORIGIN(1, LAT, LNG, -1900))
        bench.run_ms(10)
        assert client.read_texts()[-1] == "Field Elevation Set: -2m"

    def test_home_is_where_the_origin_is(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET)
        bench.run_ms(10)
        [home] = client.read_of(HOME_POSITION)
        assert (home.latitude, home.longitude, home.altitude) == (LAT, LNG, ALT_MM)

    def test_log_has_origin_then_the_event_then_both(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET)
        bench.run_ms(10)
        records = [(name, fields.get("Type", fields.get("Id"))) for name, fields in bench.records]
        assert [record for record in records if record[0] in ("ORGN", "EV")] == [
            ("ORGN", 0),
            ("EV", 25),
            ("ORGN", 0),
            ("ORGN", 1),
        ]

    def test_home_is_set_only_once(self, bench: "Bench", client: "Client") -> None:
        client.tell(SET)
        bench.run_ms(10)
        client.read()
        bench.run_ms(3000)
        assert {type(message) for message in client.read()} == {HEARTBEAT}


class TestCommand:
    """DO_SET_GLOBAL_ORIGIN, by COMMAND_INT."""

    def test_origin_is_set_in_metres(self, bench: "Bench", client: "Client") -> None:
        assert client.command_int(SET_ORIGIN, LAT, LNG, 488.5) == ACCEPTED
        origin = bench.vehicle.ahrs.origin()
        assert origin is not None
        assert (origin.lat, origin.lng, origin.alt_cm) == (LAT, LNG, 48_850)

    def test_second_origin_fails(self, client: "Client") -> None:
        client.command_int(SET_ORIGIN, LAT, LNG)
        assert client.command_int(SET_ORIGIN, LAT, LNG) == FAILED

    def test_origin_before_the_estimator_runs_fails(self, make_bench: "MakeBench") -> None:
        assert make_bench(until_ms=3000).client.command_int(SET_ORIGIN, LAT, LNG) == FAILED

    @pytest.mark.parametrize(("lat", "lng"), [(0, 0), (900_000_001, 1), (1, 1_800_000_001)])
    def test_invalid_place_is_denied(self, client: "Client", lat: int, lng: int) -> None:
        assert client.command_int(SET_ORIGIN, lat, lng) == DENIED

    @pytest.mark.parametrize("alt_m", [float("nan"), float("inf"), float("-inf"), 83_001.0, -83_001.0, 3e38])
    def test_impossible_altitude_is_denied(self, client: "Client", alt_m: float) -> None:
        assert client.command_int(SET_ORIGIN, LAT, LNG, alt_m) == DENIED

    @pytest.mark.parametrize("alt_m", [83_000.0, -83_000.0])
    def test_limit_of_the_altitude_is_taken(self, client: "Client", alt_m: float) -> None:
        assert client.command_int(SET_ORIGIN, LAT, LNG, alt_m) == ACCEPTED

    @pytest.mark.parametrize("frame", [0, 3, 5, 6, 10, 11])
    def test_global_frames_are_taken(self, client: "Client", frame: int) -> None:
        assert client.command_int(SET_ORIGIN, LAT, LNG, frame=frame) == ACCEPTED

    @pytest.mark.parametrize("frame", [1, 2, 4, 12, 20, 255])
    def test_other_frames_are_denied_with_a_text(self, bench: "Bench", client: "Client", frame: int) -> None:
        assert client.command_int(SET_ORIGIN, LAT, LNG, frame=frame) == DENIED
        bench.run_ms(3)
        assert client.read_texts() == [f"Unknown mavlink coordinate frame {frame}"]

    def test_command_long_is_unsupported(self, bench: "Bench", client: "Client") -> None:
        assert client.command(SET_ORIGIN, 0, 0, 0, 0, 47.0, 8.0, 488.0) == UNSUPPORTED
        assert bench.vehicle.ahrs.origin() is None
