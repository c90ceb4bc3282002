# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Raw Mode-S frames, made from known states: what comes out is what went in, to the bit that the format has."""

import builtins
import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("pyModeS", reason="pyModeS is not installed")

from tests.unit.viso.landmarks.inputs import frames
from viso.landmarks.inputs.base import InputFileError
from viso.landmarks.inputs.mode_s import MISSING_EXTRA, ModeSReader
from viso.landmarks.types import AircraftReport

START_S = 1_700_000_000.0
ZURICH = (47.464, 8.549)


def reports(reader: ModeSReader, *lines: str, arrival_s: float | None = None) -> list[AircraftReport]:
    found = [event for line in lines for event in reader.take(line, arrival_s)]
    assert all(isinstance(event, AircraftReport) for event in found)
    return [event for event in found if isinstance(event, AircraftReport)]


def flight(
    latitude_deg: float, longitude_deg: float, count: int = 12, **fields: Any
) -> list[tuple[float, float, float, str]]:
    """Return time, latitude, longitude and frame of an aircraft that flies north-east, a frame each 0.5 s."""
    found = []
    for step in range(count):
        place = latitude_deg + 5e-4 * step, longitude_deg + 5e-4 * step
        found.append((START_S + 0.5 * step, *place, frames.position(*place, bool(step % 2), **fields)))
    return found


def test_checksum_is_that_of_the_decoder() -> None:
    import pyModeS

    assert pyModeS.Message(frames.position(*ZURICH, odd=False)).crc_valid


@given(
    latitude_deg=st.floats(-85, 85, allow_nan=False),
    longitude_deg=st.floats(-179.9, 179.9),
    altitude_ft=st.integers(-40, 1900).map(lambda steps: 25 * steps),
)
def test_positions_come_back_within_half_a_step_of_the_code(
    latitude_deg: float, longitude_deg: float, altitude_ft: int
) -> None:
    reader = ModeSReader()
    flown = flight(latitude_deg, longitude_deg, altitude_ft=altitude_ft)
    truth = {t_s: (latitude, longitude) for t_s, latitude, longitude, _ in flown}
    odd = {t_s: bool(step % 2) for step, t_s in enumerate(truth)}
    found = reports(reader, *(f"{t_s},{frame}" for t_s, _, _, frame in flown))
    # A pair across a border of zones tells nothing, and the first three are held back; they cannot all be lost.
    assert len(found) >= 5
    assert not reader.refused
    for report in found:
        latitude, longitude = truth[report.t_s]
        step_lat, step_lon = frames.bin_sizes_deg(report.latitude_deg, odd[report.t_s])
        assert abs(report.latitude_deg - latitude) <= step_lat / 2 + 1e-9
        assert abs(math.remainder(report.longitude_deg - longitude, 360)) <= step_lon / 2 + 1e-9
        assert report.altitude_ft == altitude_ft
        assert report.is_baro


@pytest.mark.parametrize("latitude_deg", [0.0, 47.0, 59.9, 80.0])
def test_half_a_step_of_the_code_is_below_three_metres(latitude_deg: float) -> None:
    metres = 111_320 / 2
    step_lat, step_lon = frames.bin_sizes_deg(latitude_deg, odd=True)
    assert step_lat * metres < 3
    assert step_lon * metres * math.cos(math.radians(latitude_deg)) < 3


def test_velocity_goes_with_the_positions_that_follow() -> None:
    lines = [f"{START_S} {frames.velocity(-300, 400, -1280)}"]
    lines += [f"{t_s} {frame}" for t_s, _, _, frame in flight(*ZURICH)]
    report = reports(ModeSReader(), *lines)[-1]
    assert report.speed_kt == 500
    assert report.heading_deg == pytest.approx(360 - math.degrees(math.atan2(3, 4)), abs=1e-9)
    assert report.vertical_rate_ft_min == -1280


def test_old_velocity_is_forgotten() -> None:
    lines = [f"{START_S - 20} {frames.velocity(-300, 400, -1280)}"]
    lines += [f"{t_s} {frame}" for t_s, _, _, frame in flight(*ZURICH)]
    report = reports(ModeSReader(), *lines)[-1]
    assert (report.speed_kt, report.heading_deg, report.vertical_rate_ft_min) == (0, 0, 0)


def test_geometric_altitude_is_told_from_pressure_altitude() -> None:
    flown = flight(*ZURICH, altitude_ft=3281, kind=20)
    report = reports(ModeSReader(), *(f"{t_s} {frame}" for t_s, _, _, frame in flown))[-1]
    assert not report.is_baro
    assert report.altitude_ft == pytest.approx(1000 / 0.3048, abs=1)  # in whole metres and whole feet


def test_missing_altitude_is_none() -> None:
    flown = flight(*ZURICH, altitude_ft=None)
    assert reports(ModeSReader(), *(f"{t_s} {frame}" for t_s, _, _, frame in flown))[-1].altitude_ft is None


@pytest.mark.parametrize(
    "form",
    ["{t},{f}", "{t} {f}", '{t},"{f}","3C6DD1",11', "{t},*{f};", "  {t}\t{f}\r\n"],
    ids=["csv", "blank", "more columns", "AVR", "white space"],
)
def test_time_of_the_line_is_the_time_of_the_report(form: str) -> None:
    reader = ModeSReader()
    lines = [form.format(t=t_s, f=frame.lower()) for t_s, _, _, frame in flight(*ZURICH)]
    times = [report.t_s for report in reports(reader, *lines, arrival_s=3.0)]
    assert times[-1] == START_S + 5.5
    assert all(later - earlier == 0.5 for earlier, later in pairwise(times))


@pytest.mark.parametrize("form", ["*{};", "{}", "@0123456789AB{};"])
def test_time_of_arrival_comes_before_the_receivers_counter(form: str) -> None:
    reader = ModeSReader()
    found = [
        report
        for t_s, _, _, frame in flight(*ZURICH)
        for report in reports(reader, form.format(frame), arrival_s=t_s + 0.25)
    ]
    assert found[-1].t_s == START_S + 5.75


def test_receivers_counter_runs_at_12_mhz() -> None:
    lines = [f"@{round((t_s - START_S + 7) * 12e6):012x}{frame};" for t_s, _, _, frame in flight(*ZURICH)]
    assert reports(ModeSReader(), *lines)[-1].t_s == pytest.approx(12.5, abs=1e-6)


def test_aircraft_are_kept_apart() -> None:
    lines = []
    for (t_s, _, _, near), (_, _, _, far) in zip(flight(*ZURICH), flight(-33.9, 151.2, icao="7C0001"), strict=True):
        lines += [f"{t_s} {near}", f"{t_s} {far}"]
    found = {report.icao: report for report in reports(ModeSReader(), *lines)}
    assert found[frames.ICAO].latitude_deg == pytest.approx(47.4695, abs=1e-3)
    assert found["7C0001"].latitude_deg == pytest.approx(-33.8945, abs=1e-3)


def damaged(frame: str) -> str:
    return frame[:14] + f"{int(frame[14], 16) ^ 1:X}" + frame[15:]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("1 " + damaged(frames.position(*ZURICH, odd=False)), "a frame with a bad checksum"),
        ("1 " + frames.surface(*ZURICH, odd=False), "a position on the surface"),
        ("1 " + frames.position(*ZURICH, False, None, 11)[:14], "not an ADS-B frame"),
        ("1 " + frames.squitter(11 << 51, first_byte=0xA0), "not an ADS-B frame"),
        ("1 " + frames.squitter(11 << 51, first_byte=0x95), "not an ICAO address"),
        ("1 8D40", "not a Mode-S frame"),
        ("*8D3C6DD1XX;", "not a Mode-S frame"),
        ("hello", "not a Mode-S frame"),
        (frames.velocity(1, 1, 0), "no time"),
        ("9" * 400 + " " + frames.velocity(1, 1, 0), "time is out of range"),
    ],
)
def test_what_is_of_no_use_is_counted(line: str, reason: str) -> None:
    reader = ModeSReader()
    assert reader.take(line) == []
    assert reader.refused == {reason: 1}


def test_damaged_frames_do_not_spoil_the_others() -> None:
    reader = ModeSReader()
    flown = flight(*ZURICH)
    lines = []
    for t_s, _, _, frame in flown:
        lines += [f"{t_s} {damaged(frame)}", f"{t_s} {frame}"]
    assert [r.t_s for r in reports(reader, *lines)] == [
        r.t_s for r in reports(ModeSReader(), *(f"{t_s} {frame}" for t_s, _, _, frame in flown))
    ]
    assert reader.refused == {"a frame with a bad checksum": len(flown)}


@given(st.one_of(st.text(max_size=60), st.binary(min_size=14, max_size=14).map(lambda data: f"5 {data.hex()}")))
def test_nothing_makes_it_raise(line: str) -> None:
    reader = ModeSReader()
    assert reader.take(line, 1.0) == []


@given(message=st.integers(0, 2**56 - 1), t_s=st.floats(0, 1e10))
def test_nothing_that_a_sound_frame_holds_makes_it_raise(message: int, t_s: float) -> None:
    reader = ModeSReader()
    assert reader.take(frames.squitter(message), t_s) == []


def test_missing_decoder_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = builtins.__import__

    def without(name: str, *args: Any) -> Any:
        if name.startswith("pyModeS"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return whole(name, *args)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputFileError) as raised:
        ModeSReader()
    assert str(raised.value) == MISSING_EXTRA
    assert "pip install 'ardupilot-viso[landmarks]'" in MISSING_EXTRA
