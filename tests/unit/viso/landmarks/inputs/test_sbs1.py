# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of BaseStation: what each type tells, how it comes together, and lines that are broken."""

from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.landmarks.inputs.sbs1 import FIELDS, Sbs1Reader
from viso.landmarks.types import AircraftReport

ICAO = "3C6DD1"
NOON_S = datetime(2025, 7, 14, 12, tzinfo=UTC).timestamp()


def line(kind: int, at_s: float = 0.0, icao: str = ICAO, **fields: str | float) -> str:
    """Return a line of a type, a time in s after noon, with named fields."""
    places = {"alt": 11, "speed": 12, "track": 13, "lat": 14, "lon": 15, "rate": 16, "ground": 21}
    stamp = datetime.fromtimestamp(NOON_S + at_s, UTC)
    date, time = f"{stamp:%Y/%m/%d}", f"{stamp:%H:%M:%S}.{stamp.microsecond // 1000:03}"
    texts = ["MSG", str(kind), "1", "1", icao, "1", date, time, date, time, *[""] * (FIELDS - 10)]
    for name, value in fields.items():
        texts[places[name]] = str(value)
    return ",".join(texts)


def only(reader: Sbs1Reader, *lines: str, arrival_s: float | None = None) -> AircraftReport:
    events = [event for text in lines for event in reader.take(text, arrival_s)]
    assert len(events) == 1
    assert isinstance(events[0], AircraftReport)
    assert not reader.refused
    return events[0]


def test_report_has_what_the_lines_before_told() -> None:
    report = only(
        Sbs1Reader(),
        line(1, 0.0),
        line(4, 1.0, speed=251.5, track=87.3, rate=-640),
        line(5, 2.0, alt=4975),
        line(8, 2.5),
        line(3, 3.125, alt=5000, lat="47.46412", lon="8.54903"),
    )
    assert report == AircraftReport(NOON_S + 3.125, ICAO, 47.46412, 8.54903, 5000.0, 251.5, 87.3, -640.0, True)


@given(st.floats(-90, 90), st.floats(-180, 180), st.integers(-40, 2000))
def test_positions_come_back_within_the_five_decimals_of_the_format(lat: float, lon: float, steps: int) -> None:
    text = line(3, alt=25 * steps, lat=f"{lat:.5f}", lon=f"{lon:.5f}")
    events = Sbs1Reader().take(text)
    if abs(lat) < 5e-6 and abs(lon) < 5e-6:
        assert events == []
        return
    [report] = events
    assert isinstance(report, AircraftReport)
    assert abs(report.latitude_deg - lat) <= 0.5e-5 + 1e-12
    assert abs(report.longitude_deg - lon) <= 0.5e-5 + 1e-12
    assert report.altitude_ft == 25 * steps


@pytest.mark.parametrize("kind", [5, 6, 7])
def test_altitude_of_another_type_is_taken_along(kind: int) -> None:
    report = only(Sbs1Reader(), line(kind, 0, alt=4975), line(3, 1, lat=47, lon=8))
    assert report.altitude_ft == 4975


def test_what_is_older_than_15_s_is_forgotten() -> None:
    report = only(
        Sbs1Reader(), line(4, 0, speed=250, track=87, rate=64), line(5, 0, alt=4975), line(3, 15.5, lat=47, lon=8)
    )
    assert (report.altitude_ft, report.speed_kt, report.heading_deg, report.vertical_rate_ft_min) == (None, 0, 0, 0)


def test_velocity_without_a_speed_keeps_the_one_before() -> None:
    report = only(
        Sbs1Reader(), line(4, 0, speed=250, track=87, rate=64), line(4, 1, rate=640), line(3, 2, lat=47, lon=8)
    )
    assert (report.speed_kt, report.vertical_rate_ft_min) == (250, 64)


def test_aircraft_are_kept_apart() -> None:
    report = only(Sbs1Reader(), line(5, icao="ABCDEF", alt=100), line(3, lat=47, lon=8))
    assert report.altitude_ft is None


def test_aircraft_on_the_surface_has_no_altitude() -> None:
    report = only(Sbs1Reader(), line(5, 0, alt=1400), line(2, 1, alt=0, speed=12.5, track=140.6, lat=47, lon=8))
    assert (report.altitude_ft, report.speed_kt, report.heading_deg) == (None, 12.5, 140.6)


@pytest.mark.parametrize("flag", ["1", "-1"])
def test_flag_of_the_ground_takes_the_altitude(flag: str) -> None:
    assert only(Sbs1Reader(), line(3, alt=1400, lat=47, lon=8, ground=flag)).altitude_ft is None


def test_zone_of_the_receiver_is_taken_off() -> None:
    assert only(Sbs1Reader(utc_offset_s=7200), line(3, lat=47, lon=8)).t_s == NOON_S - 7200


def test_line_without_a_date_has_the_time_of_its_arrival() -> None:
    fields = line(3, lat=47, lon=8).split(",")
    fields[6:10] = [""] * 4
    assert only(Sbs1Reader(), ",".join(fields), arrival_s=5.5).t_s == 5.5
    reader = Sbs1Reader()
    assert reader.take(",".join(fields)) == []
    assert reader.refused == {"no time": 1}


def test_address_in_lower_case_and_ends_of_lines_do_no_harm() -> None:
    assert only(Sbs1Reader(), line(3, icao="3c6dd1", lat=47, lon=8) + "\r\n", "\r\n").icao == ICAO


@pytest.mark.parametrize("other", ["SEL", "ID", "AIR", "STA", "CLK"])
def test_lines_that_tell_no_states_are_passed_over(other: str) -> None:
    reader = Sbs1Reader()
    assert reader.take(f"{other},,496,2286,{ICAO},27215,2025/07/14,12:00:00.000,2025/07/14,12:00:00.000") == []
    assert not reader.refused


def test_every_way_to_cut_a_line_short_is_safe() -> None:
    whole = line(3, alt=5000, lat="47.46412", lon="8.54903")
    for length in range(1, len(whole)):
        reader = Sbs1Reader()
        for event in reader.take(whole[:length]):
            assert isinstance(event, AircraftReport)
            assert (event.latitude_deg, event.longitude_deg, event.altitude_ft) == (47.46412, 8.54903, 5000)
        cut_in_numbers = length <= whole.index("8.54903") + len("8.54903")
        assert bool(reader.refused) == cut_in_numbers


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("hello", "not a BaseStation line"),
        ("MSG", "incomplete line"),
        (line(9), "unknown transmission type"),
        (line(3, icao="~3C6DD"), "not an ICAO address"),
        (line(3, icao=""), "not an ICAO address"),
        (line(3, alt=5000), "aircraft without a position"),
        (line(3, lat=47), "aircraft without a position"),
        (line(3, lat="0.00000", lon="0.00000"), "no fix: (0, 0)"),
        (line(3, lat="nan", lon="8"), "a field that is no number"),
        (line(3, lat="47", lon="inf"), "a field that is no number"),
        (line(3, lat="x", lon="8"), "a field that is no number"),
        (line(3, lat="91", lon="8"), "bad latitude_deg"),
        (line(3, lat="47", lon="181"), "bad longitude_deg"),
        (line(3, lat=47, lon=8).replace("2025/07/14", "2025/02/30"), "bad date or time"),
        (line(3, lat=47, lon=8).replace("2025/07/14", "14.7.2025"), "bad date or time"),
        (line(3, lat=47, lon=8).replace("12:00:00", "25:00:00"), "bad date or time"),
    ],
)
def test_what_is_of_no_use_is_counted(text: str, reason: str) -> None:
    reader = Sbs1Reader()
    assert reader.take(text) == []
    assert reader.refused == {reason: 1}


@given(
    st.one_of(
        st.text(max_size=80),
        st.lists(st.text(max_size=8), max_size=24).map(lambda fields: ",".join(["MSG", "3", *fields])),
        st.integers(0, 200).flatmap(
            lambda at: st.text(max_size=4).map(lambda junk: line(3, lat=47, lon=8)[:at] + junk + line(3, lat=47)[at:])
        ),
    )
)
def test_nothing_makes_it_raise(text: str) -> None:
    reader = Sbs1Reader()
    events = reader.take(text, 1.0)
    assert len(events) + sum(reader.refused.values()) <= 1
